// The boundary of sliding against the thresholds known in closed form, and the shape of traced curves.

#include <cmath>

#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/verify.hpp"

using namespace stickslip;

namespace {

Options options_of(const std::vector<std::pair<std::string, std::string>>& texts) {
  std::vector<Given> given;
  for (const auto& [name, text] : texts) given.push_back({name, text, ""});
  return Options::from("boundary", given);
}

GrowthRate growth_of(const Options& options, const std::vector<Axis>& axes) {
  return GrowthRate(PETSC_COMM_SELF, scene_of(options, axes), axes, options.text("spectrum_refine") != "off");
}

std::vector<Crossing> roots(const Options& options, const Axis& axis) {
  GrowthRate growth = growth_of(options, {axis});
  BoundaryFindings findings;
  return boundary_points(growth, findings);
}

double only_root(const Options& options, const Axis& axis) {
  const std::vector<Crossing> found = roots(options, axis);
  REQUIRE(found.size() == 1);
  CHECK(found[0].residual < 1e-10);
  return found[0].value;
}

}  // namespace

TEST_CASE("thresholds of the laws of velocity", "[boundary]") {
  const Axis v{"model_v", 0.01, 3, false};
  CHECK(only_root(options_of({{"grid_n", "64"}}), v) == Approx(std::sqrt(1 - 0.2 / 3)).epsilon(1e-10));
  CHECK(only_root(options_of({{"grid_n", "64"}, {"model_delta_sign", "printed"}}), v) ==
        Approx(std::sqrt(1 + 0.2 / 3)).epsilon(1e-10));
  CHECK(only_root(options_of({{"grid_n", "64"}, {"bc_left", "free"}, {"grid_order", "6"}}), v) ==
        Approx(std::sqrt(1 - 0.2 / 3)).epsilon(1e-10));
  CHECK(only_root(options_of({{"model_form", "chain"}, {"grid_n", "30"}, {"model_zeta", "0.3"}}), v) ==
        Approx(std::sqrt(0.7)).epsilon(1e-10));
  CHECK(only_root(options_of({{"model_form", "chain"},
                              {"grid_n", "30"},
                              {"model_zeta", "0.3"},
                              {"model_f0", "1.7"},
                              {"friction_law", "carlson-langer"}}),
                  v) == Approx(std::sqrt(1.7 / 0.3) - 1).epsilon(1e-10));
}

TEST_CASE("both signs of v are found, and what crosses is named", "[boundary]") {
  const auto found = roots(options_of({{"grid_n", "64"}}), {"model_v", -2, 2, false});
  REQUIRE(found.size() == 2);
  CHECK(found[0].value == Approx(-std::sqrt(1 - 0.2 / 3)).epsilon(1e-10));
  CHECK(found[1].value == Approx(std::sqrt(1 - 0.2 / 3)).epsilon(1e-10));
  CHECK(found[0].kind == "hopf");
  CHECK(found[0].degenerate);
  CHECK(found[0].frequency == Approx(1));  // sqrt(A K0)
  CHECK(found[0].wavenumber == 0);
}

TEST_CASE("rate-and-state thresholds, with inertia", "[boundary]") {
  // Rice and Ruina: stable iff K > (b - a) T/D [1 + v^2/(A a D T)], frequency (v/D) sqrt((b - a)/a)
  const double a = 0.02, b = 0.05, D = 0.7, v = 0.4, A = 1.25;
  const auto o = options_of({{"model_form", "chain"},
                             {"grid_n", "16"},
                             {"friction_law", "rate-and-state"},
                             {"state_law", "ageing"},
                             {"friction_a", "0.02"},
                             {"friction_b", "0.05"},
                             {"friction_D", "0.7"},
                             {"model_v", "0.4"},
                             {"model_f0", "1.25"}});
  const Scene scene = Scene::from(o, true);
  const SteadySliding sliding(scene);
  const double T = std::tanh(sliding.eta[0] / a);
  const double K = (b - a) * T / D * (1 + v * v / (A * a * D * T));
  const auto found = roots(o, {"model_k0", 1e-3, 1, true});
  REQUIRE(found.size() == 1);
  CHECK(found[0].value / 1.25 == Approx(K).epsilon(1e-8));
  CHECK(found[0].frequency == Approx(v / D * std::sqrt((b - a) / a)).epsilon(1e-6));
  CHECK_FALSE(found[0].degenerate);

  // the slip law in Erickson's variables: epsilon = g^2 xi/(g^2 + xi) at g = 0.8, xi = 0.5
  const double value = only_root(options_of({{"model_form", "chain"},
                                             {"grid_n", "8"},
                                             {"friction_law", "rate-and-state"},
                                             {"state_law", "slip"},
                                             {"friction_a", "0.01"},
                                             {"friction_D", "1"},
                                             {"model_v", "1"},
                                             {"model_k0", "0.64"},
                                             {"model_f0", "128"}}),
                                 {"friction_b", 0.0105, 0.02, false});
  CHECK(value / 0.01 - 1 == Approx(0.64 * 0.5 / (0.64 + 0.5)).epsilon(1e-8));
}

TEST_CASE("spread friction: the root of the dense matrix", "[boundary]") {
  for (const char* form : {"chain", "continuum"}) {
    const auto o = options_of({{"model_form", form},
                               {"grid_n", "60"},
                               {"grid_order", "2"},
                               {"bc_left", "free"},
                               {"friction_spread", "0.4"}});
    const Options damped = std::string(form) == "chain" ? o.with("model_zeta", 0.4) : o;
    const auto found = roots(damped, {"model_v", 0.3, 2, false});
    REQUIRE(found.size() == 1);
    const LinearisedOperator sliding(Scene::from(damped.with("model_v", found[0].value), true));
    double growth = -1e300;
    for (const Mode& m : dense_modes(sliding, 1))
      if (m.value.imag() <= resolved_frequency(sliding)) growth = std::max(growth, m.value.real());
    CHECK(std::abs(growth) < 1e-10);
  }
}

TEST_CASE("a mode that takes the lead between samples is found by the count", "[boundary][serial]") {
  // A hundred modes of this medium change their order within 1e-3 of the boundary.
  const auto o = options_of({{"grid_n", "400"}, {"bc_left", "velocity"}, {"friction_spread", "0.2"}});
  const auto found = roots(o, {"model_v", 0.5, 1.5, false});
  REQUIRE(found.size() == 1);
  CHECK(found[0].complete.value_or(false));
  SpectrumSettings settings;
  settings.compare = false;
  const Spectrum spectrum = compute_spectrum(
      PETSC_COMM_SELF, LinearisedOperator(Scene::from(o.with("model_v", found[0].value), true)), settings);
  CHECK(spectrum.complete);
  CHECK(std::abs(spectrum.growth) < 1e-10);
}

TEST_CASE("curves: figure 6, a fold, two pieces", "[boundary]") {
  const auto trace = [](const Options& options, const Axis& x, const Axis& y, PetscInt points) {
    GrowthRate growth = growth_of(options, {x, y});
    BoundaryFindings findings;
    auto curve = boundary_curve(growth, points, findings);
    CHECK(findings.notes.empty());
    for (const Crossing& c : curve) {
      const auto v = closed_form_velocity(growth.scene(c.x, c.y));
      REQUIRE(v);
      const double computed = x.name == "model_v" ? c.value : c.value2;
      CHECK(std::abs(std::abs(computed) - *v) <= 1e-8 * std::max(1., *v));
    }
    return curve;
  };
  const auto chain = [](const char* law) {
    return options_of(
        {{"model_form", "chain"}, {"grid_n", "32"}, {"model_zeta", "paper"}, {"friction_law", law}});
  };
  const Axis k1{"model_k1", 1e-3, 10.5, true}, v{"model_v", 1e-2, 30, true};
  CHECK(trace(chain("cubic"), k1, v, 21).size() >= 20);
  const auto curve = trace(chain("carlson-langer"), k1, v, 21);
  CHECK(curve.size() == 21);
  // the ends stand on the border, the points evenly
  CHECK((curve.front().x == 0 || curve.front().x == 1 || curve.front().y == 0 || curve.front().y == 1));
  CHECK((curve.back().x == 0 || curve.back().x == 1 || curve.back().y == 0 || curve.back().y == 1));
  double least = 1, most = 0;
  for (std::size_t k = 1; k < curve.size(); ++k) {
    const double d = std::hypot(curve[k].x - curve[k - 1].x, curve[k].y - curve[k - 1].y);
    least = std::min(least, d);
    most = std::max(most, d);
  }
  CHECK(most < 1.2 * least);

  const auto simple = options_of({{"model_form", "chain"}, {"grid_n", "16"}});
  const Axis both{"model_v", -1.5, 1.5, false};
  // zeta = 1 - v^2 turns at v = 0
  const auto fold = trace(simple, both, {"model_zeta", 0.2, 1.5, false}, 20);
  CHECK(fold.back().piece == 0);
  double top = 0;
  for (const Crossing& c : fold) top = std::max(top, c.value2);
  CHECK(top == Approx(1).margin(0.02));
  const auto two = trace(simple, both, {"model_zeta", 0., 0.5, false}, 20);
  CHECK(two.back().piece == 1);
}

namespace {

// Largest real part of the dense matrix among the frequencies that the grid carries.
double dense_growth(const Scene& scene) {
  const LinearisedOperator sliding(scene);
  double growth = -1e300;
  for (const Mode& m : dense_modes(sliding, 1))
    if (m.value.imag() <= resolved_frequency(sliding)) growth = std::max(growth, m.value.real());
  return growth;
}

}  // namespace

TEST_CASE("curves of spread and held scenes lie where the dense matrix has no growth", "[boundary][serial]") {
  const auto spread = options_of({{"grid_n", "48"}, {"grid_length", "12"}, {"friction_spread", "0.3"}});
  const auto held = options_of({{"model_form", "chain"},
                                {"grid_n", "40"},
                                {"bc_left", "velocity"},
                                {"bc_left_value", "0.5"},
                                {"bc_right", "free"},
                                {"friction_spread", "0.2"}});
  for (const bool continuum : {true, false}) {
    GrowthRate growth = growth_of(
        continuum ? spread : held,
        {{continuum ? "model_delta" : "model_zeta", 0.05, 0.8, false}, {"model_v", 0.3, 1.5, false}});
    BoundaryFindings findings;
    const auto curve = boundary_curve(growth, 15, findings);
    CHECK(findings.notes.empty());
    CHECK(curve.size() >= 14);
    for (const Crossing& c : curve) {
      CHECK(c.complete.value_or(false));
      CHECK(std::abs(dense_growth(growth.scene(c.x, c.y))) < 1e-9);
    }
    // and the lattice has the signs of the dense matrix
    for (int k = 0; k < findings.samples.side * findings.samples.side; k += 7) {
      const int column = k % findings.samples.side, row = k / findings.samples.side;
      const double x = double(column) / (findings.samples.side - 1),
                   y = double(row) / (findings.samples.side - 1);
      CHECK((findings.samples.growth[std::size_t(k)] > 0) == (dense_growth(growth.scene(x, y)) > 0));
    }
  }
}

TEST_CASE("the growth rate of a place is that of the dense matrix, whatever was asked before",
          "[boundary][serial]") {
  const std::vector<Axis> axes{{"model_v", 0.3, 1.5, false}, {"friction_spread", 0, 0.8, false}};
  for (const bool continuum : {true, false}) {
    const Options options =
        continuum ? options_of({{"grid_n", "40"}, {"grid_length", "12"}, {"bc_left", "free"}})
                  : options_of({{"model_form", "chain"}, {"grid_n", "40"}, {"bc_right", "free"}});
    std::vector<std::pair<double, double>> places;
    for (int k = 1; k <= 12; ++k)
      places.push_back({std::fmod(0.618034 * k, 1), std::fmod(0.754878 * k, 1)});
    GrowthRate forwards = growth_of(options, axes), backwards = growth_of(options, axes);
    std::vector<double> found;
    for (const auto& [x, y] : places) found.push_back(forwards(x, y));
    for (std::size_t k = places.size(); k-- > 0;) {
      const auto [x, y] = places[k];
      CHECK(backwards(x, y) == Approx(found[k]).margin(1e-10));
      CHECK(found[k] == Approx(dense_growth(forwards.scene(x, y))).margin(1e-9));
    }
  }
}

TEST_CASE("a closed curve smaller than a cell, with corners where two pairs cross at once",
          "[boundary][serial]") {
  // psi = 0 everywhere is unstable for zeta < 1, psi large anywhere is not; the equations are odd in (psi_e,
  // v).
  GrowthRate growth = growth_of(options_of({{"model_form", "chain"},
                                            {"grid_n", "4"},
                                            {"model_zeta", "0.999"},
                                            {"bc_left", "velocity"},
                                            {"bc_right", "free"}}),
                                {{"bc_left_value", -5, 4.3, false}, {"model_v", -4.1, 5, false}});
  BoundaryFindings findings;
  const auto curve = boundary_curve(growth, 40, findings);
  CHECK(findings.notes.empty());
  REQUIRE(curve.size() >= 30);
  CHECK(curve.back().piece == 0);
  double turn = 0;
  int switches = 0;
  for (std::size_t k = 0; k < curve.size(); ++k) {
    const Crossing &c = curve[k], &next = curve[(k + 1) % curve.size()];
    turn += std::remainder(std::atan2(next.value2, next.value) - std::atan2(c.value2, c.value), 2 * M_PI);
    switches += c.switched;
    Scene mirror = growth.scene(c.x, c.y);
    mirror.left_value *= -1;
    mirror.v *= -1;
    CHECK(std::abs(dense_growth(growth.scene(c.x, c.y))) < 1e-10);
    CHECK(std::abs(dense_growth(mirror)) < 1e-10);
  }
  CHECK(std::abs(turn) == Approx(2 * M_PI));
  CHECK(switches >= 4);
}

TEST_CASE("where a curve meets k0 = 0 the pair becomes a real mode beside the symmetry of sliding",
          "[boundary]") {
  // rate-and-state, b > a: the Hopf frequency falls to 0 with k0 where b = a, on the border of the box
  GrowthRate growth = growth_of(
      options_of(
          {{"model_form", "chain"}, {"grid_n", "6"}, {"friction_law", "rate-and-state"}, {"model_v", "1"}}),
      {{"friction_b", 0.01, 0.2, false}, {"model_k0", 0, 2, false}});
  BoundaryFindings findings;
  const auto curve = boundary_curve(growth, 12, findings);
  REQUIRE(curve.size() == 12);
  CHECK(findings.notes.empty());
  for (const Crossing& c : curve) {
    CHECK(c.kind == (c.value2 == 0 ? "zero" : "hopf"));
    // stable iff K > (b - a) T/D [1 + v^2/(A a D T)], A = f0/m = 1, K = k0/f0
    const double a = 0.05, D = 0.1;
    const SteadySliding sliding(growth.scene(c.x, c.y));
    const double T = std::tanh(sliding.eta[0] / a);
    CHECK((c.value - a) * T / D * (1 + 1 / (a * D * T)) == Approx(c.value2).epsilon(1e-8).margin(1e-7));
  }
}

TEST_CASE("a zero curve and a Hopf curve that meet inside the box: both are found, and where", "[boundary]") {
  // A chain that slides as a whole (k0 = 0), Carlson-Langer with healing. With a = B + F_psi, b = B +
  // dF_ss/dv and r = 1/t_h + v/D the real mode crosses at b = 0, the shortest wave (K = 4 K1) at a K + r b (a
  // + r/A) = 0; a = b = 0 where the state does not depend on the velocity: tau_inf = 1, zeta/f0 = -phi'(v).
  GrowthRate growth = growth_of(options_of({{"model_form", "chain"},
                                            {"grid_n", "16"},
                                            {"model_k0", "0"},
                                            {"model_v", "0.5"},
                                            {"friction_law", "carlson-langer"},
                                            {"state_law", "healing"}}),
                                {{"state_tau_inf", 0.5, 2, false}, {"model_zeta", 0.1, 0.8, false}});
  BoundaryFindings findings;
  const auto curve = boundary_curve(growth, 30, findings);
  CHECK(findings.notes.empty());
  REQUIRE(curve.size() == 30);
  CHECK(curve.back().piece == 0);
  const double v = 0.5, r = 1 + v, phi = 1 / (1 + v), slope = -phi * phi, K = 4 * 0.2;
  int zeros = 0;
  for (const Crossing& c : curve) {
    const double tau = (c.value + v) / r, a = c.value2 + tau * slope, b = a + (1 - c.value) / (r * r) * phi;
    zeros += c.kind == "zero";
    CHECK(c.kind == (c.value > 1 ? "zero" : "hopf"));
    CHECK(std::abs(c.kind == "zero" ? b : (a * K + r * b * (a + r)) / r) < 1e-9);
    CHECK(c.residual < 1e-10);
  }
  CHECK(zeros > 10);
  REQUIRE(findings.meetings.size() == 1);
  CHECK(findings.meetings[0].value == Approx(1).margin(1e-6));
  CHECK(findings.meetings[0].value2 == Approx(-slope).margin(1e-6));
}

TEST_CASE("a curve traced on a coarse grid and placed on the fine one, a trapped mode taking the lead",
          "[boundary][serial]") {
  // At gamma = 2.4 a mode trapped at the held end takes over from the whole line's.
  GrowthRate growth = growth_of(options_of({{"grid_n", "420"},
                                            {"grid_length", "20"},
                                            {"friction_spread", "0.2"},
                                            {"bc_left", "velocity"},
                                            {"bc_left_value", "0.5"}}),
                                {{"model_v", 0.7, 1.3, false}, {"model_gamma", 1.5, 4, false}});
  CHECK(growth.reduced().has_value());
  BoundaryFindings findings;
  const auto curve = boundary_curve(growth, 12, findings);
  CHECK(findings.notes.empty());
  REQUIRE(curve.size() == 12);
  CHECK(curve.back().piece == 0);
  SpectrumSettings settings;
  settings.compare = false;
  for (std::size_t k = 0; k < curve.size(); ++k) {
    CHECK(curve[k].complete.value_or(true));
    if (k % 4 != 0) continue;
    const Spectrum spectrum =
        compute_spectrum(PETSC_COMM_SELF, LinearisedOperator(growth.scene(curve[k].x, curve[k].y)), settings);
    CHECK(spectrum.complete);
    CHECK(std::abs(spectrum.growth) < 1e-9);
    CHECK(spectrum.frequency == Approx(curve[k].frequency).epsilon(1e-6));
  }
}
