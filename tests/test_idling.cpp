// Loops over steps, and over starts and stops, that do not get on in time are ended, and hear signals; and
// the next release of a node at rest is found ahead.
#include <cmath>
#include <csignal>
#include <random>
#include <string>

#include "base/process.hpp"
#include "base/pulse.hpp"
#include "catch.hpp"
#include "model/stick_rule.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/numerics/roots.hpp"

using namespace stickslip;

namespace {

// How many calls it takes until it throws, and what it says then.
template <class Call>
std::pair<int, std::string> calls_until_failure(const Call& call) {
  for (int k = 1; k < 100000; ++k) {
    try {
      call(k);
    } catch (const Failure& e) {
      return {k, e.what()};
    }
  }
  return {0, ""};
}

}  // namespace

TEST_CASE("a node that changes again and again at one time ends the loop, by its number") {
  const int rank = rank_in(PETSC_COMM_WORLD);
  Idling idling(PETSC_COMM_WORLD);
  // each rank has one of its own, and nodes that change now and then
  const auto [calls, text] = calls_until_failure([&](int k) {
    std::vector<PetscInt> changed{100 * PetscInt(rank) + 7};
    if (k % 20 == 0) changed.push_back(100 * PetscInt(rank) + 8);
    idling.at(3.5, changed);
  });
  CHECK(calls > Idling::most_changes);
  CHECK(calls < Idling::most_changes + 20);
  CHECK(text.find("at t = 3.5") != std::string::npos);
  CHECK(text.find(" 7") != std::string::npos);
  CHECK(text.find(" 8") == std::string::npos);
  if (ranks_in(PETSC_COMM_WORLD) > 1) CHECK(text.find("107") != std::string::npos);
}

TEST_CASE("steps that do not advance time end the loop") {
  Idling idling(PETSC_COMM_WORLD);
  const auto [calls, text] = calls_until_failure([&](int k) { idling.at(1e6 * (1 + 2.2e-16 * k)); });
  CHECK(calls > Idling::most_steps);
  CHECK(calls < Idling::most_steps + 20);
  CHECK(text.find("t = 1000000") != std::string::npos);
  // in a unit of time that is the caller's, at t = 0 too
  Idling beginning(PETSC_COMM_WORLD);
  CHECK(calls_until_failure([&](int k) { beginning.at(1e-20 * k, {}, 1e-14); }).first > Idling::most_steps);
}

TEST_CASE("a motion that gets on is never ended") {
  Idling idling(PETSC_COMM_WORLD);
  for (int k = 0; k < 2000; ++k) CHECK_FALSE(idling.at(1 + 1e-13 * k, {0}));
  // many nodes, each of them a few times at one time
  Idling many(PETSC_COMM_WORLD);
  for (int k = 0; k < 1000; ++k) CHECK_FALSE(many.at(2, {PetscInt(k % 100)}));
}

TEST_CASE("a signal is heard in a loop that does not get on in time") {
  for (const bool searches : {false, true}) {
    const SignalWatch watch;
    std::optional<Pulse> pulse;
    Idling idling(PETSC_COMM_WORLD);
    const bool had = SignalWatch::caught() != 0;
    if (searches) pulse.emplace("off", "test");
    if (!had) std::raise(SIGTERM);
    bool told = false, interrupted = false;
    for (int k = 0; k < 50 && !told && !interrupted; ++k) try {
        told = idling.at(1, {PetscInt(k)});
      } catch (const Interrupted& e) {
        interrupted = true;
      }
    CHECK((told || interrupted));
    if (!searches) CHECK(told);
  }
}

TEST_CASE("the first rise of a sum of sines and lines, however short it stays there", "[serial]") {
  std::mt19937 draw(7);
  std::uniform_real_distribution<double> part(0, 1);
  int found = 0, missed = 0;
  for (int k = 0; k < 400; ++k) {
    const double w1 = 1, w2 = 0.3 + part(draw), a2 = part(draw), line = 0.02 * (part(draw) - 0.5),
                 turn = 6 * part(draw);
    const auto g = [&](double x) { return std::sin(w1 * x) + a2 * std::sin(w2 * x + turn) + line * x; };
    // a level that is exceeded by the little that the highest of many maxima is above the second
    double best = -1e9, place = 0;
    const int samples = 200000;
    const double end = 40;
    for (int i = 0; i <= samples; ++i)
      if (g(end * i / samples) > best) best = g(place = end * i / samples);
    const double level = best - std::pow(10., -9 + 8 * part(draw));
    const auto f = [&](double x) {
      return ValueAndSlope{x, g(x) - level, w1 * std::cos(w1 * x) + a2 * w2 * std::cos(w2 * x + turn) + line};
    };
    double first = HUGE_VAL, piece = 2 * M_PI / std::max(w1, w2) / 16;
    for (double x = 0; x < end && first == HUGE_VAL; x += piece)
      first = first_rise(f, f(x), f(x + piece), 1e-16);
    if (first == HUGE_VAL) {
      ++missed;
      continue;
    }
    ++found;
    CHECK(f(first).value >= 0);
    CHECK(f(first).value < 1e-12);
    for (int i = 0; i < samples && end * i / samples < first - 1e-9; ++i)
      if (g(end * i / samples) > level && g(0) <= level)
        FAIL("an earlier one at " << end * i / samples << " of " << first);
  }
  CHECK(found > 350);
  CHECK(missed < 10);  // the highest place is the end
}

TEST_CASE("the release of a node whose strength is forgotten in a bend", "[serial]") {
  // slip s = s0 exp(-t/t_h), F = fd + (fs - fd) exp(-s/Dc): the threshold grows fastest in the middle, so
  // that the force may come up to it, fall behind and come up again
  FrictionParameters p;
  p.law = Law("slip-weakening");
  p.state = StateLaw("slip-memory");
  p.values = {{"friction_fs", 1.3}, {"friction_fd", 0.4}, {"friction_Dc", 0.2}, {"state_t_h", 0.7}};
  const auto law = Friction::of(p);
  std::mt19937 draw(11);
  std::uniform_real_distribution<double> part(0, 1);
  for (int k = 0; k < 300; ++k) {
    const double s0 = 6 * part(draw), force = 0.1 + 0.35 * part(draw),
                 rate = std::pow(10., -2 + 2.5 * part(draw));
    const auto excess = [&](double t) {
      return force + rate * t - law->threshold(s0 * std::exp(-t / 0.7)).value;
    };
    if (excess(0) >= 0) continue;
    double first = 0;
    while (excess(first) < 0) first += 1e-4;
    const double found = release({*law, 1, 1, force, s0, rate}, {}, HUGE_VAL).wait;
    INFO("s0 " << s0 << ", force " << force << ", rate " << rate);
    CHECK(found <= first);
    CHECK(found > first - 1.0001e-4);
  }
}
