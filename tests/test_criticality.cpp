// First Lyapunov coefficients of Hopf points against closed forms, and the ways to them against each other.
// Random scenes stand in tests/audit/test_criticality.py, against oscillations solved for.

#include <cmath>

#include "catch.hpp"
#include "shared.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/verify.hpp"

using namespace stickslip;

namespace {

using Texts = std::vector<std::pair<std::string, std::string>>;

Options options_of(const Texts& texts) {
  std::vector<Given> given;
  for (const auto& [name, text] : texts) given.push_back({name, text, ""});
  return Options::from("boundary", given);
}

GrowthRate growth_of(const Options& options, const std::vector<Axis>& axes) {
  return GrowthRate(PETSC_COMM_SELF, scene_of(options, axes), axes, options.text("spectrum_refine") != "off");
}

std::vector<Crossing> roots(const Texts& texts, const Axis& axis) {
  GrowthRate growth = growth_of(options_of(texts), {axis});
  BoundaryFindings findings;
  return boundary_points(growth, findings);
}

Crossing only_root(const Texts& texts, const Axis& axis) {
  const std::vector<Crossing> found = roots(texts, axis);
  REQUIRE(found.size() == 1);
  REQUIRE(found[0].criticality.known());
  return found[0];
}

// One block on a spring in the variables of Erickson, Birnir and Lavallee (Nonlinear Processes in Geophysics
// 15 (2008) 1): r = g^2/xi, at the Hopf point omega^2 = epsilon. Friction so large that its logarithm is
// exact.
Texts one_block(const char* state) {
  return {{"model_form", "chain"}, {"grid_n", "1"},
          {"bc_left", "free"},     {"friction_law", "rate-and-state"},
          {"state_law", state},    {"friction_a", "0.01"},
          {"friction_D", "1"}};
}

}  // namespace

TEST_CASE("uniform motion without a state: the coefficient is -A F'''/16", "[criticality][serial]") {
  const auto coefficient = [](const Texts& texts) {
    const Crossing c = only_root(texts, {"model_v", 0.05, 4, false});
    CHECK(c.criticality.of == "uniform");
    CHECK(c.degenerate);
    return c.criticality.coefficient;
  };
  for (const char* sign : {"derived", "printed"})
    CHECK(coefficient({{"grid_n", "64"}, {"model_gamma", "1.7"}, {"model_delta_sign", sign}}) ==
          Approx(-1.7 * 2 / 16).epsilon(1e-12));
  CHECK(coefficient({{"model_form", "chain"}, {"grid_n", "12"}, {"model_zeta", "0.3"}, {"model_m", "2.5"}}) ==
        Approx(-2. / 16 / 2.5).epsilon(1e-12));
  // phi = 1/(1 + v) at v = sqrt(1/zeta) - 1, where phi''' = -6 zeta^2
  CHECK(coefficient({{"model_form", "chain"},
                     {"grid_n", "12"},
                     {"bc_left", "free"},
                     {"model_zeta", "0.2"},
                     {"friction_law", "carlson-langer"}}) == Approx(6 * 0.04 / 16).epsilon(1e-12));
}

TEST_CASE("a block with rate-and-state friction: closed forms for both laws of the state",
          "[criticality][serial]") {
  for (const double f0 : {40., 128., 900.})
    for (const double k0 : {0.1, 0.64, 3.}) {
      const double g2 = k0, xi = k0 / f0 / 0.01, r = g2 / xi, w2 = g2 * xi / (g2 + xi);
      const double common = r * w2 / (8 * ((1 + r) * (1 + r) + w2) * ((1 + r) * (1 + r) + 4 * w2));
      for (const char* state : {"slip", "ageing"}) {
        Texts texts = one_block(state);
        texts.insert(texts.end(),
                     {{"model_v", "1"}, {"model_f0", std::to_string(f0)}, {"model_k0", std::to_string(k0)}});
        const double b = 0.01 * (1 + w2);
        const Crossing c = only_root(texts, {"friction_b", 0.5 * (b + 0.01), 2 * b, false});
        CHECK(c.frequency == Approx(std::sqrt(w2)).epsilon(1e-9));
        const double exact = std::string(state) == "slip" ? -common * (1 + r) * (9 + r) * (1 + w2)
                                                          : common * (r * r - 6 * r - 7 - 4 * w2);
        INFO(state << " r " << r << " omega^2 " << w2);
        CHECK(c.criticality.coefficient == Approx(exact).epsilon(1e-8).margin(1e-10 * common));
      }
    }
}

TEST_CASE("Bautin points lie where the closed form says, and none is where it says none",
          "[criticality][serial]") {
  const std::vector<Axis> axes{{"friction_b", 0.0101, 0.1, false}, {"model_v", 0.2, 2, true}};
  for (const char* state : {"ageing", "slip"}) {
    Texts texts = one_block(state);
    texts.insert(texts.end(), {{"model_f0", "128"}, {"model_k0", "0.64"}});
    GrowthRate growth = growth_of(options_of(texts), axes);
    BoundaryFindings findings;
    const std::vector<Crossing> curve = boundary_curve(growth, 41, findings);
    REQUIRE(curve.size() > 30);
    if (std::string(state) == "slip") {
      CHECK(findings.special.empty());
      continue;
    }
    REQUIRE(findings.special.size() == 1);
    CHECK(findings.special[0].kind == "bautin");
    const Crossing& c = findings.special[0].at;
    const double r = 1.28 / (c.value2 * c.value2), epsilon = c.value / 0.01 - 1;
    CHECK(r == Approx(3 + 2 * std::sqrt(4 + epsilon)).epsilon(1e-8));
    CHECK(c.frequency * c.frequency == Approx(epsilon * c.value2 * c.value2).epsilon(1e-7));
    for (const Crossing& point : curve)  // a fast plate is let go gently, a slow one by a jump
      CHECK(point.criticality.word() == (point.value2 > c.value2 ? "supercritical" : "subcritical"));
  }
}

TEST_CASE("waves of equal nodes and modes of nodes that hardly differ have the same coefficient",
          "[criticality][serial]") {
  for (const char* n : {"4", "6", "7"}) {
    const Texts texts{{"model_form", "chain"},   {"grid_n", n},
                      {"bc_left", "free"},       {"bc_right", "free"},
                      {"friction_law", "cubic"}, {"state_law", "contact-age"},
                      {"state_b", "0.3"},        {"state_D", "1.6"}};
    Texts spread = texts;
    spread.push_back({"friction_spread", "1e-12"});
    const Axis axis{"model_v", 0.15, 2, false};
    const Crossing wave = only_root(texts, axis), mode = only_root(spread, axis);
    CHECK(wave.criticality.of == "standing");
    CHECK(mode.criticality.of == "mode");
    CHECK(mode.criticality.coefficient == Approx(wave.criticality.coefficient).epsilon(1e-8));
  }
}

TEST_CASE("where there is no coefficient it is said why", "[criticality][serial]") {
  const auto why = [](const Texts& texts, const Axis& axis) {
    const std::vector<Crossing> found = roots(texts, axis);
    REQUIRE_FALSE(found.empty());
    CHECK_FALSE(found[0].criticality.known());
    CHECK(found[0].criticality.word().empty());
    return found[0].criticality.why_not;
  };
  // contact-age at F_psi = 0: short waves lead
  CHECK(why({{"grid_n", "64"},
             {"state_law", "contact-age"},
             {"state_b", ".9"},
             {"state_D", "2"},
             {"state_theta0", "2.4"},
             {"model_delta", "0"},
             {"model_gamma", ".4"}},
            {"model_v", 0.5, 1.5, false})
            .find("short waves") != std::string::npos);
  // a layer from a held end through psi = 0, where |psi| stands in the state's rate
  CHECK(why({{"model_form", "chain"},
             {"grid_n", "12"},
             {"bc_left", "velocity"},
             {"bc_left_value", "-0.5"},
             {"state_law", "contact-age"},
             {"model_zeta", "0.2"}},
            {"model_v", 0.5, 3, false})
            .find("kink") != std::string::npos);
}
