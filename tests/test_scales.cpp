// The scales of a scene, and the tolerances of a step that are parts of them.
#include <cmath>

#include "catch.hpp"
#include "shared.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/time/time.hpp"

using namespace stickslip;

namespace {

Scene scene_of(const Settings& settings) {
  return Scene::from(InDatabase(settings).options);
}

Settings chain(const Settings& more) {
  Settings all = {{"model_form", "chain"}, {"grid_n", "3"}, {"bc_left", "free"}};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace

TEST_CASE("scales are 1 where everything is about 1", "[scales]") {
  for (const Settings& settings : {Settings{}, chain({}), chain({{"friction_law", "carlson-langer"}})}) {
    const Scales s = scales_of(scene_of(settings)).least;
    CHECK(s.psi == 1);
    CHECK(s.eta == 1);
    CHECK(s.state == 1);
  }
}

TEST_CASE("the least velocity that a scene has is its scale", "[scales]") {
  const auto psi = [](const Settings& more) { return scales_of(scene_of(chain(more))).least.psi; };
  CHECK(psi({{"model_v", "1e-6"}}) == 5 * 1e-6);
  CHECK(psi({{"model_v", "1e-6"}, {"load_sine_amplitude", "3e-6"}, {"load_sine_period", "7"}}) ==
        Approx(5 * 4e-6));
  CHECK(psi({{"friction_law", "stribeck"}, {"friction_vs", "0.03"}, {"model_v", "1"}}) == 0.03);
  // f0/sqrt(k0 m) = 2e3/sqrt(4e10)
  CHECK(psi({{"friction_law", "coulomb"},
             {"model_v", "1"},
             {"model_f0", "2e3"},
             {"model_k0", "2e6"},
             {"model_m", "2e4"}}) == Approx(0.01));
  // a drop of 0.3 in friction makes slips of 0.3 f0/sqrt(m (k0 + 2 k1)), however slow the plate
  CHECK(psi({{"friction_law", "coulomb"},
             {"friction_fd", "0.7"},
             {"model_v", "1e-9"},
             {"model_k0", "0.5"},
             {"model_k1", "1"},
             {"model_m", "0.1"}}) == Approx(0.3 / std::sqrt(0.25)));
  CHECK(psi({{"friction_law", "coulomb"}, {"friction_fd", "1"}, {"model_v", "1e-9"}}) == 5e-9);
  CHECK(psi({{"friction_law", "coulomb"}, {"friction_stick", "regularised"}, {"model_v", "1e-9"}}) == 5e-9);
  // rate-and-state's reference velocity says only where friction is mu0
  CHECK(psi({{"friction_law", "rate-and-state"}, {"friction_psi0", "1e-12"}, {"model_v", "1e-3"}}) == 5e-3);
  CHECK(psi({{"friction_law", "dahl"},
             {"friction_fc", "1"},
             {"friction_sigma0", "1e5"},
             {"model_k0", "2"}}) == Approx(1e-5 * std::sqrt(2)));
}

TEST_CASE("scales follow the units to the last bit, by powers of two", "[scales]") {
  const Settings given = chain({{"friction_law", "dahl"},
                                {"friction_fc", "0.7"},
                                {"friction_sigma0", "31"},
                                {"model_v", "0"},
                                {"model_k0", "0.3"},
                                {"model_m", "1.7"},
                                {"model_f0", "2.9"}});
  const Scene scene = scene_of(given);
  const SceneScales before = scales_of(scene);
  const double length = std::ldexp(1., 13), time = std::ldexp(1., -21), force = std::ldexp(1., 9);
  Scene other = scene;
  other.f0 *= force;
  other.k0 *= force / length;
  other.k1 *= force / length;
  other.m *= force * time * time / length;
  other.friction.values["friction_sigma0"] /= length;
  const SceneScales after = scales_of(other);
  CHECK(after.least.psi == before.least.psi * length / time);
  CHECK(after.least.eta == before.least.eta);
  CHECK(after.least.state == before.least.state * length);
  CHECK(after.slip.psi == before.slip.psi * length / time);
  CHECK(after.slip.state == before.slip.state * length);
  CHECK(after.velocity == before.velocity * length / time);
  CHECK(after.rate == before.rate / time);
}

TEST_CASE("tolerances of a step by its options", "[scales][serial]") {
  const Settings slow = chain({{"friction_law", "rate-and-state"}, {"model_v", "1e-6"}});
  const auto of = [&](const Settings& more) {
    Settings all = slow;
    all.insert(all.end(), more.begin(), more.end());
    const InDatabase database(all);
    const Model model(PETSC_COMM_WORLD, Scene::from(database.options));
    const VecHandle u = model.create_vector();
    SS_TRY(VecSet(u, 1e-6));
    return Integrator(model, MethodSpec::from(database.options), u).tolerances();
  };
  const Tolerances usual = of({});
  CHECK(usual.absolute[0] == Approx(5e-12));
  CHECK(usual.absolute[1] == Approx(0.6e-6));
  CHECK(usual.relative[0] == 1e-6);
  CHECK(usual.absolute[2] == Approx(2e-6));  // ln(theta), whose size depends on the unit of time
  CHECK(usual.relative[2] == 0);
  const Tolerances strict = of({{"ts_atol", "auto:1e-9"}, {"ts_rtol", "1e-8"}});
  CHECK(strict.absolute[0] == Approx(5e-15));
  CHECK(strict.relative[0] == 1e-8);
  CHECK(strict.absolute[2] == Approx(1.1e-8));
  const Tolerances number = of({{"ts_atol", "1e-7"}});
  CHECK(number.absolute[0] == 1e-7);
  CHECK(number.absolute[1] == 1e-7);
  CHECK(number.relative[2] == 1e-6);
}
