// The fastest wave of a uniform continuum against all of its waves, one by one.

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "catch.hpp"
#include "stickslip/stability/fastest_wave.hpp"

using namespace stickslip;

namespace {

double growth_of(const LinearisedOperator& s, double k) {
  double growth = -1e300;
  for (const Complex& z : dispersion(s.mean(), k * k)) growth = std::max(growth, z.real());
  return growth;
}

Scene drawn(std::mt19937& random) {
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const auto one_of = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
  std::vector<Given> given{{"grid_n", "32", ""}};
  const auto add = [&](const char* name, const std::string& text) { given.push_back({name, text, ""}); };
  for (const auto& [name, low, high] : {std::tuple<const char*, double, double>{"model_gamma", 0.3, 4},
                                        {"model_delta", 0, 0.6},
                                        {"model_c", 0.3, 3},
                                        {"model_v", 0.1, 2},
                                        {"grid_length", 1, 40}})
    add(name, number_text(between(low, high)));
  const char* const ends[][2] = {
      {"periodic", "periodic"}, {"free", "free"}, {"velocity", "velocity"}, {"free", "velocity"}};
  const int end = one_of(4);
  add("bc_left", ends[end][0]);
  add("bc_right", ends[end][1]);
  const int law = one_of(4);
  if (law > 0) add("friction_law", law == 1 ? "carlson-langer" : law == 2 ? "cubic" : "rate-and-state");
  if (law == 1) add("state_law", one_of(2) ? "healing" : "contact-age");
  if (law == 2) add("state_law", "contact-age");
  if (law == 3) add("state_law", one_of(2) ? "slip" : "ageing");
  if (law == 1 || law == 2) add("state_D", number_text(between(0.05, 3)));
  if (law == 3) add("friction_D", number_text(between(0.02, 1)));
  if (one_of(2)) add("model_nu", number_text(std::pow(10, between(-3, 1))));
  return Scene::from(Options::from("spectrum", given), true);
}

}  // namespace

TEST_CASE("no wave grows faster than the one named, and the one named grows so fast", "[continuum]") {
  std::mt19937 random(7);
  int limits = 0, between = 0;
  for (int k = 0; k < 600; ++k) {
    const Scene scene = drawn(random);
    const LinearisedOperator s(scene);
    const auto lead = continuum_lead(s);
    REQUIRE(lead);
    const double unit = (scene.ring() ? 2 : 1) * M_PI / scene.length,
                 level = 2e-9 * (s.rate + s.A * 10);
    const int held = int(scene.left == End::velocity) + int(scene.right == End::velocity);
    for (int j = 0; j < 2000; ++j) REQUIRE(growth_of(s, unit * (held / 2. + j)) <= lead->growth + level);
    const bool limit = std::isinf(lead->wavenumber);
    REQUIRE(growth_of(s, limit ? 1e5 * unit : lead->wavenumber) ==
            Approx(lead->growth).margin(limit ? 1e-6 : 1e-9));
    const bool longest = !limit && std::abs(lead->wavenumber - unit * held / 2.) < 1e-9 * unit;
    const double whole = lead->wavenumber / unit - held / 2.;
    if (!limit) REQUIRE(whole == Approx(std::round(whole)).margin(1e-9));
    if (!limit && (s.N == 0 || !s.has_state())) REQUIRE(longest);
    limits += limit;
    between += !limit && !longest;
  }
  CHECK(limits > 40);  // and some of each kind were drawn
  CHECK(limits < 560);
  CHECK(between > 3);
}

TEST_CASE("chains, spread and other held velocities have no closed answer; all waves alike name the longest",
          "[continuum]") {
  const auto of = [](const std::vector<Given>& given) {
    return continuum_lead(LinearisedOperator(Scene::from(Options::from("spectrum", given), true)));
  };
  CHECK_FALSE(of({{"model_form", "chain", ""}, {"grid_n", "8", ""}}));
  CHECK_FALSE(of({{"friction_spread", "0.1", ""}, {"grid_n", "8", ""}}));
  CHECK_FALSE(of({{"bc_left", "velocity", ""}, {"bc_left_value", "0.7", ""}, {"grid_n", "16", ""}}));
  const auto alike = of({{"grid_n", "16", ""}, {"model_v", "0.9", ""}});
  REQUIRE(alike);
  CHECK(alike->degenerate);
  CHECK(alike->wavenumber == 0);
  CHECK(alike->growth == Approx(-(3 * (0.81 - 1) + 0.2) / 2));
}

TEST_CASE(
    "no wave that fits a scene grows faster than the fastest, be it drawn with a peak between two samples",
    "[continuum]") {
  std::mt19937 random(19);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  int peaks = 0, alike = 0;
  for (int k = 0; k < 3600; ++k) {
    Scene s;
    s.form = k % 3 == 0 ? Form::chain : Form::continuum;
    s.order = s.form == Form::chain ? 2 : 2 + 2 * PetscInt(random() % 4);
    s.n = 3 + PetscInt(std::pow(10, between(0, 2.7)));
    s.length = std::pow(10, between(-0.3, 2));
    if (k % 2) s.left = s.right = End::free;
    if (k % 8 == 7 && s.order == 2) s.right = End::velocity;
    s.nu = k % 5 == 0 ? 0 : std::pow(10, between(-4, 0.5));
    const bool state = k % 4 != 1;
    s.friction.state = StateLaw(state ? "contact-age" : "none");
    LinearPoint p(s);
    p.set({between(-2, 1), between(-1, 3), state ? between(-3, 1) : 0,
           state ? -std::pow(10, between(-1.5, 1)) : 0});
    p.has_state = state;
    const Waves waves = Waves::of(s);
    const auto found = fastest_wave(p, waves, same_growth(p));
    REQUIRE(found);
    std::vector<double> growth;
    for (std::int64_t j = 0; j < waves.count; ++j)
      growth.push_back(rightmost_root(p, waves.kappa2(j))->real());
    const double most = *std::max_element(growth.begin(), growth.end()),
                 ends = std::max(growth.front(), growth.back());
    const auto within = [&](double levels) {  // of the fastest
      return std::count_if(growth.begin(), growth.end(),
                           [&](double g) { return g >= most - levels * same_growth(p); });
    };
    INFO("scene " << k);
    REQUIRE(found->value.real() <= most);
    REQUIRE(found->value.real() >= most - 1.1 * same_growth(p));
    CHECK(found->wavenumber == waves.k(found->index));
    if (within(0.9) == within(1.1)) CHECK(found->degenerate == (within(1) > 1));
    peaks += most > ends + same_growth(p);
    alike += found->degenerate;
  }
  CHECK(peaks > 30);
  CHECK(alike > 100);
}
