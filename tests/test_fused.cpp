// The step of rk that takes all stages tile by tile, against the same step put together stage by stage.
#include <execinfo.h>
#include <sys/time.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <ctime>

#include "catch.hpp"
#include "shared.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/time/stick.hpp"
#include "study/simulate.hpp"
#include "time/tiles.hpp"

using namespace stickslip;

namespace {

ErrorNorm norm_of(double atol, double rtol, NormType type) {
  return {Tolerances::as_set({}, rtol, atol), type};
}

// Bogacki and Shampine's pair of orders 3 and 2 (its last stage is the solution); the classical method of
// order 4 with an invented estimate (its last stage is not); and with one that has a stage of its own.
const std::vector<StageProgram> tableaus = {
    {4,
     {0, 0, 0, 0, .5, 0, 0, 0, 0, .75, 0, 0, 2. / 9, 1. / 3, 4. / 9, 0},
     {2. / 9, 1. / 3, 4. / 9, 0},
     {7. / 24, 1. / 4, 1. / 3, 1. / 8}},
    {4,
     {0, 0, 0, 0, .5, 0, 0, 0, 0, .5, 0, 0, 0, 0, 1, 0},
     {1. / 6, 1. / 3, 1. / 3, 1. / 6},
     {.25, .25, .25, .25}},
    {5,
     {0, 0, 0, 0, 0, .5, 0, 0, 0, 0, 0, .5, 0, 0, 0, 0, 0, 1, 0, 0, .2, .1, .1, .3, 0},
     {1. / 6, 1. / 3, 1. / 3, 1. / 6, 0},
     {.25, .25, .25, 0, .25}}};

std::vector<Scene> scenes() {
  std::vector<Scene> all;
  // one tile; several, the last ones shared by the ranks
  for (const PetscInt n : {PetscInt(90), PetscInt(1400)}) {
    for (const int order : {2, 4, 6, 8}) {
      Scene ring;
      ring.n = n;
      ring.order = order;
      all.push_back(ring);
      Scene ends = ring;
      ends.left = order == 8 ? End::free : End::velocity;
      ends.right = End::free;
      ends.left_value = -1.5;
      ends.spread = 0.3;
      all.push_back(ends);
    }
    Scene state;
    state.n = n;
    state.left = End::free;
    state.right = End::velocity;
    state.right_value = 0.4;
    state.friction.state = StateLaw("contact-age");
    all.push_back(state);
    Scene chain;
    chain.form = Form::chain;
    chain.n = n;
    chain.order = 2;
    chain.delta = 0;
    chain.length = double(n - 1);
    chain.left = chain.right = End::free;
    chain.spread = 0.2;
    all.push_back(chain);
    chain.left = End::velocity;
    chain.left_value = 0.7;
    all.push_back(chain);
    for (const StateLaw law : {StateLaw("none"), StateLaw("healing")}) {  // with friction that sticks
      Scene sticks;
      sticks.n = n;
      sticks.friction.law = law == StateLaw("none") ? Law("coulomb") : Law("carlson-langer");
      sticks.friction.state = law;
      sticks.spread = 0.2;
      all.push_back(sticks);
      sticks.left = End::velocity;
      sticks.right = End::free;
      sticks.left_value = 0.7;
      all.push_back(sticks);
    }
  }
  const std::size_t without = all.size();
  for (std::size_t i = 0; i < without; ++i) {
    all.push_back(all[i]);
    all.back().nu = 0.02;
  }
  Scene tiny;
  tiny.n = 1;
  all.push_back(tiny);
  tiny.n = 3;
  tiny.order = 8;
  all.push_back(tiny);
  return all;
}

// Who rests and who slides where, with friction that sticks; the model and the step are told.
std::vector<double> give_direction(const Model& model, TiledStep& step) {
  std::vector<double> direction;
  if (!Stick::applies_to(model.scene())) return direction;
  for (PetscInt i = 0; i < model.local(); ++i) {
    const PetscInt node = model.first() + i;
    direction.push_back(node % 7 < 3 ? 0. : node % 11 < 6 ? 1. : -1.);
  }
  model.set_direction(direction.data());
  step.set_direction(direction);
  return direction;
}

void start(const Model& model, Vec u) {
  double* a;
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double x = double(model.first() + i);
    a[i * model.dof()] = 0.4 + 0.8 * std::sin(0.05 * x) + 0.1 * std::sin(1.7 * x);
    a[i * model.dof() + 1] = 0.3 * std::cos(0.04 * x);
    if (model.dof() == 3) a[i * model.dof() + 2] = 1.3 + 0.2 * std::sin(0.9 * x);
  }
  SS_TRY(VecRestoreArray(u, &a));
  model.set_held(u);
}

// u + dt sum_j weights[j] slopes[j]; not by VecAXPY, whose BLAS may round a product and a sum as one.
void combine(Vec u, double dt, const double* weights, const std::vector<VecHandle>& slopes, Vec into) {
  SS_TRY(VecCopy(u, into));
  PetscInt count;
  double* sum;
  SS_TRY(VecGetLocalSize(into, &count));
  SS_TRY(VecGetArray(into, &sum));
  for (std::size_t j = 0; j < slopes.size(); ++j) {
    const double weight = dt * weights[j], *slope;
    SS_TRY(VecGetArrayRead(slopes[j], &slope));
    for (PetscInt i = 0; i < count; ++i) sum[i] += weight * slope[i];
    SS_TRY(VecRestoreArrayRead(slopes[j], &slope));
  }
  SS_TRY(VecRestoreArray(into, &sum));
}

double weighted_norm(const Model& model, Vec u, Vec other, double atol, double rtol, NormType norm) {
  const double *a, *b;
  SS_TRY(VecGetArrayRead(u, &a));
  SS_TRY(VecGetArrayRead(other, &b));
  double sum = 0, largest = 0;
  for (PetscInt i = 0; i < model.local() * model.dof(); ++i) {
    const double q = std::abs(a[i] - b[i]) / (atol + rtol * std::max(std::abs(a[i]), std::abs(b[i])));
    sum += q * q;
    largest = std::max(largest, q);
  }
  SS_TRY(VecRestoreArrayRead(u, &a));
  SS_TRY(VecRestoreArrayRead(other, &b));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPI_DOUBLE, MPI_SUM, model.comm()));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, model.comm()));
  return norm == NORM_INFINITY ? largest : std::sqrt(sum / double(model.scene().n * model.dof()));
}

}  // namespace

TEST_CASE("a step taken tile by tile is the step taken stage by stage", "[fused]") {
  int checked = 0, ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  for (const Scene& scene : scenes()) {
    if (scene.n < ranks) continue;
    const Model model(PETSC_COMM_WORLD, scene);
    for (const StageProgram& method : tableaus) {
      ++checked;
      if (!in_turn(checked, ranks)) continue;
      const auto stages = static_cast<std::size_t>(method.stages);
      const double dt = 0.5 / std::max(model.wave_frequency(), 5.);
      VecHandle u = model.create_vector(), expected = model.create_vector(), other = model.create_vector(),
                found = model.create_vector(), at_end = model.create_vector();
      start(model, u);
      TiledStep step(model, method, Stick::applies_to(scene));
      const std::vector<double> direction = give_direction(model, step);
      std::vector<VecHandle> slopes, kept;
      for (std::size_t i = 0; i < stages; ++i) {
        slopes.push_back(model.create_vector());
        kept.push_back(model.create_vector());
        combine(u, dt, &method.A[i * stages], slopes, expected);
        model.rhs(Part::full, expected, slopes[i]);
      }
      combine(u, dt, method.b.data(), slopes, expected);
      combine(u, dt, method.embedded.data(), slopes, other);

      const ErrorNorm mean = norm_of(1e-4, 1e-3, NORM_2), of_largest = norm_of(1e-4, 1e-3, NORM_INFINITY);
      const TiledStep::Outcome outcome = step.take(u, dt, mean, true, found, kept, at_end);
      INFO("n " << scene.n << " order " << scene.order << " dof " << model.dof() << " form "
                << int(scene.form) << " left " << int(scene.left) << " dt " << dt);
      // Values of size 2; rates of size A phi + K1 kappa^2 psi < wave^2/A: each rounded some ten times.
      const double w = model.wave_frequency(), eps = 2.2e-16, rate = 10 + 4 * w * w / scene.A();
      CHECK(distance(expected, found) <= 20 * eps * (2 + dt * rate));
      for (std::size_t i = 0; i < stages; ++i)
        CHECK(distance(slopes[i], kept[i]) <= 20 * eps * rate * (1 + dt * rate));
      CHECK(distance(at_end, kept[stages - 1]) == 0);
      if (step.last_is_solution()) {
        model.rhs(Part::full, found, expected);
        CHECK(distance(at_end, expected) == 0);
        combine(u, dt, method.b.data(), slopes, expected);
      }
      CHECK(outcome.finite);
      // the error is a difference of values of size 2, weighted by 1e4
      CHECK(std::abs(outcome.error - weighted_norm(model, expected, other, 1e-4, 1e-3, NORM_2)) <=
            40 * eps * (2 + dt * rate) / 1e-4);
      const TiledStep::Outcome largest = step.take(u, dt, of_largest, true, found, {});
      CHECK(std::abs(largest.error - weighted_norm(model, expected, other, 1e-4, 1e-3, NORM_INFINITY)) <=
            40 * eps * (2 + dt * rate) / 1e-4);
      // without the estimate the last stage may be left out, and nothing else changes
      VecHandle again = model.create_vector();
      step.take(u, dt, mean, false, again, {});
      CHECK(distance(found, again) == 0);
      if (!direction.empty()) model.set_direction(nullptr);
    }
  }
  CHECK(checked >= 60);
}

TEST_CASE("a step taken tile by tile does not depend on the ranks, to the last bit", "[fused]") {
  int drawn = 0, ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  for (const Scene& scene : scenes()) {
    if (scene.n < ranks || !in_turn(++drawn, ranks, numbers_of_ranks)) continue;
    const Model model(PETSC_COMM_WORLD, scene), alone(PETSC_COMM_SELF, scene);
    VecHandle u = model.create_vector(), found = model.create_vector();
    VecHandle all = alone.create_vector(), expected = alone.create_vector();
    start(model, u);
    start(alone, all);
    TiledStep step(model, tableaus[0], Stick::applies_to(scene)),
        step_alone(alone, tableaus[0], Stick::applies_to(scene));
    const auto direction = give_direction(model, step), direction_alone = give_direction(alone, step_alone);
    step.take(u, 0.02, norm_of(1e-4, 1e-3, NORM_2), true, found, {});
    step_alone.take(all, 0.02, norm_of(1e-4, 1e-3, NORM_2), true, expected, {});
    CHECK(same_bits(model, found, expected));
  }
}

TEST_CASE("a step taken tile by tile tells what is not finite", "[fused]") {
  Scene scene;
  scene.n = 1400;
  const Model model(PETSC_COMM_WORLD, scene);
  VecHandle u = model.create_vector(), found = model.create_vector();
  start(model, u);
  const TiledStep step(model, tableaus[0]);
  for (const bool estimate : {true, false})
    for (const NormType norm : {NORM_2, NORM_INFINITY}) {
      CHECK(step.take(u, 0.01, norm_of(1e-6, 1e-6, norm), estimate, found, {}).finite);
      CHECK_FALSE(step.take(u, 1e60, norm_of(1e-6, 1e-6, norm), estimate, found, {}).finite);
    }
}

#if defined(NDEBUG) && defined(__OPTIMIZE__)
namespace {

constexpr int deepest = 64;
std::array<int, deepest> seen_at_depth;

void note_depth(int) {
  void* frames[deepest];
  ++seen_at_depth[std::size_t(std::min(backtrace(frames, deepest), deepest - 1))];
}

}  // namespace

// Where the processor is after every millisecond of its time, mostly the loops over nodes.
TEST_CASE("a step passes the calls that the page lists", "[serial]") {
  Scene scene;
  scene.n = 1000;
  const Model model(PETSC_COMM_WORLD, scene);
  VecHandle u = model.create_vector();
  start(model, u);
  const InDatabase given({{"ts_rtol", "1e-10"}, {"ts_atol", "1e-10"}});
  Integrator integrator(model, MethodSpec::from(given.options), u);
  REQUIRE(integrator.report().method == "rk:7vr");
  void* frames[deepest];
  const int here = backtrace(frames, deepest);
  seen_at_depth = {};
  struct sigaction each{}, before{};
  each.sa_handler = note_depth;
  each.sa_flags = SA_RESTART;
  sigaction(SIGPROF, &each, &before);
  const itimerval every{{0, 1000}, {0, 1000}}, never{};
  setitimer(ITIMER_PROF, &every, nullptr);
  int samples = 0;
  for (double t = 0; samples < 60 && t < 4000; t += 1) {
    simulate(integrator, u, {t, t + 1}, {});
    samples = 0;
    for (const int count : seen_at_depth) samples += count;
  }
  setitimer(ITIMER_PROF, &never, nullptr);
  sigaction(SIGPROF, &before, nullptr);
  REQUIRE(samples >= 60);
  const auto usual = std::max_element(seen_at_depth.begin(), seen_at_depth.end());
  // beyond this function: `simulate`, the calls, what the signal adds (its handler and the system's frame)
  const int calls = int(usual - seen_at_depth.begin()) - here - 1 - 2;
  INFO(calls << " calls in " << *usual << " of " << samples << " samples");
  CHECK(3 * *usual > samples);
  CHECK(calls <= 8);
  CHECK(calls >= 4);
}
#endif
