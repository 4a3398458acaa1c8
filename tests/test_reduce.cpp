// The smallest problem for a scene, and what it cannot show: unstable waves on a uniform motion.
#include <cmath>
#include <random>

#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/stability/linearised_operator.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/time/time.hpp"
#include "stickslip/waves/wave_stability.hpp"
#include "study/step_audit.hpp"

using namespace stickslip;

namespace {

Scene plain(double v, double length, PetscInt n = 64) {
  Scene s;
  s.delta = 0;
  s.v = v;
  s.length = length;
  s.n = n;
  return s;
}

// The length of a ring whose longest wave has this c^2 kappa^2.
double length_for(double c2k2) { return 2 * M_PI / std::sqrt(c2k2); }

Options options_of(std::initializer_list<std::pair<const char*, const char*>> given) {
  Options options;
  for (const auto& [name, value] : given) options = options.with(name, value);
  return options;
}

PetscInt nodes_solved(const Options& options) {
  return problem_of(Scene::from(options), options, std::nullopt).model.scene().n;
}

}  // namespace

TEST_CASE("what repeats is solved once", "[reduce]") {
  const auto nodes = [](std::initializer_list<std::pair<const char*, const char*>> given) {
    return nodes_solved(options_of(given).with("grid_n", "48"));
  };
  CHECK(nodes({}) == 1);
  CHECK(nodes({{"bc_left", "free"}}) == 1);
  CHECK(nodes({{"model_form", "chain"}}) == 1);
  CHECK(nodes({{"model_form", "chain"}, {"bc_left", "free"}}) == 1);
  CHECK(nodes({{"init_type", "sine"}, {"init_amplitude", "0"}}) == 1);
  CHECK(nodes({{"init_type", "sine"}}) == 48);
  CHECK(nodes({{"init_type", "sine"}, {"init_mode", "4"}}) == 12);
  CHECK(nodes({{"init_type", "sine"}, {"init_mode", "10"}}) == 24);  // two cells of five waves fit the nodes
  CHECK(nodes({{"init_type", "sine"}, {"init_mode", "5"}}) == 48);
  CHECK(nodes({{"init_type", "sine"}, {"init_mode", "4"}, {"bc_left", "free"}}) == 48);
  CHECK(nodes({{"init_type", "pulses"}, {"init_pulses", "3"}}) == 16);
  CHECK(nodes({{"init_type", "wave"}, {"init_pulses", "2"}}) == 24);
  // a perturbation of any size is kept
  CHECK(nodes({{"init_noise", "1e-15"}}) == 48);
  CHECK(nodes({{"init_type", "sine"}, {"init_amplitude", "1e-14"}}) == 48);
  CHECK(nodes({{"init_type", "sine"}, {"init_mode", "4"}, {"init_noise", "1e-9"}}) == 48);
  CHECK(nodes({{"friction_spread", "0.1"}}) == 48);
  CHECK(nodes({{"bc_left", "velocity"}}) == 48);
  CHECK(nodes({{"bc_left", "velocity"}, {"bc_right", "free"}}) == 48);
  CHECK(nodes({{"scene_reduce", "off"}}) == 48);
}

TEST_CASE("a cell has the frequencies, the step and the start of the whole", "[reduce]") {
  const Options options = options_of({{"init_type", "pulses"}, {"init_pulses", "4"}, {"grid_n", "96"}});
  const Scene scene = Scene::from(options);
  const Problem cell = problem_of(scene, options, std::nullopt);
  const Problem whole = problem_of(scene, options.with("scene_reduce", "off"), std::nullopt);
  CHECK(cell.model.scene().h() == Approx(scene.h()).epsilon(1e-15));
  CHECK(cell.model.wave_frequency() == Approx(whole.model.wave_frequency()).epsilon(1e-14));
  CHECK(cell.model.unknowns() == 48);
  CHECK(whole.what.empty());
  const Scene one = problem_of(Scene::from(Options()), Options(), std::nullopt).model.scene();
  CHECK(one.n == 1);
  CHECK(one.copies == 512);
  double norm = 0, norm_of_whole = 0;
  SS_TRY(VecNorm(cell.u, NORM_2, &norm));
  SS_TRY(VecNorm(whole.u, NORM_2, &norm_of_whole));
  CHECK(2 * norm == Approx(norm_of_whole).epsilon(1e-14));
}

TEST_CASE("the uniform oscillation is unstable to long waves at small v", "[reduce][serial]") {
  // gamma = 3, v = 0: 0 < c^2 k^2 < 1.122, largest multiplier 1.302 at 0.485
  const UniformInstability worst = instability_of_oscillation(plain(0, 400 * length_for(.485), 40960));
  CHECK(worst.multiplier == Approx(1.302).margin(6e-4));
  CHECK(std::pow(worst.wavenumber, 2) == Approx(.485).margin(.003));
  CHECK(worst.period == Approx(8.85910).epsilon(1e-6));
  CHECK(worst.growth_rate * worst.period == Approx(std::log(worst.multiplier)));
  // a ring so short that all of its waves lie above the band, and one whose longest is just inside
  CHECK(instability_of_oscillation(plain(0, length_for(1.13))).growth_rate == 0);
  CHECK(instability_of_oscillation(plain(0, length_for(1.11))).growth_rate > 0);
  // between free ends half a wave fits
  Scene free = plain(0, length_for(1.13));
  free.left = free.right = End::free;
  CHECK(instability_of_oscillation(free).multiplier == Approx(1.28).margin(.03));
  CHECK(instability_of_oscillation(plain(.9, 1000, 4096)).growth_rate == 0);
}

TEST_CASE("a wave on the uniform oscillation has the growth of a fast train", "[reduce][serial]") {
  for (const double v : {0., .3, .5}) {
    const UniformInstability here = instability_of_oscillation(plain(v, 2000, 65536));
    const TrainSpectrum train = infinite_train_stability(solve_train(plain(v, 1), {1, {}, 20.}));
    // they part like c^2/V^2 = 1/400
    CHECK(here.growth_rate == Approx(train.infinite_growth).epsilon(1. / 200));
  }
}

TEST_CASE("a wave leaves the uniform oscillation at the computed rate", "[reduce][serial]") {
  Options options = options_of({{"model_v", "0"}, {"model_delta", "0"}, {"grid_n", "24"}});
  const auto measured = [](const Options& all, double period) {
    const Scene scene = Scene::from(all);
    const Model model(PETSC_COMM_SELF, scene);
    VecHandle u = model.create_vector();
    double *a, start[3] = {2, 0, 0};
    if (model.dof() == 3) start[2] = model.steady_state(scene.v);
    SS_TRY(VecGetArray(u, &a));
    for (PetscInt i = 0; i < scene.n; ++i) {
      for (int c = 0; c < model.dof(); ++c) a[i * model.dof() + c] = start[c];
      a[i * model.dof()] += 1e-7 * std::cos(2 * M_PI * double(i) / double(scene.n));
    }
    SS_TRY(VecRestoreArray(u, &a));
    SS_TRY(PetscOptionsSetValue(nullptr, "-ts_rtol", "1e-9"));
    SS_TRY(PetscOptionsSetValue(nullptr, "-ts_atol", "1e-9"));
    Integrator integrator(model, MethodSpec::from(all), u);
    SS_TRY(PetscOptionsClearValue(nullptr, "-ts_rtol"));
    SS_TRY(PetscOptionsClearValue(nullptr, "-ts_atol"));
    const auto go_on = [](const Integrator::Step&) { return Integrator::Verdict::go_on; };
    double size[2];
    for (int part = 0; part < 2; ++part) {
      integrator.advance(u, 6 * period * part, 6 * period * (part + 1), go_on);
      const double* b;
      double sum = 0;
      SS_TRY(VecGetArrayRead(u, &b));
      for (PetscInt i = 0; i < scene.n; ++i)
        sum += b[i * model.dof()] * std::cos(2 * M_PI * double(i) / double(scene.n)) / double(scene.n);
      SS_TRY(VecRestoreArrayRead(u, &b));
      size[part] = sum;
    }
    return std::pow(size[1] / size[0], 1. / 6);
  };
  const auto compare = [&](const Options& all) {
    const UniformInstability found = instability_of_oscillation(Scene::from(all));
    CHECK(found.multiplier > 1.01);
    CHECK(measured(all, found.period) == Approx(found.multiplier).epsilon(5e-3));
  };
  compare(options.with("grid_length", length_for(.485)));
  compare(options.with("grid_length", length_for(.485))
              .with("model_delta", "0.2")
              .with("model_delta_sign", "printed"));
  compare(options.with("model_v", "0.2")
              .with("model_delta", "")
              .with("model_form", "chain")
              .with("grid_n", "10"));
}

TEST_CASE("sliding grows at the rate of its dispersion relation", "[reduce][serial]") {
  Scene s = plain(.5, 20);
  const double C = s.A() * (s.v * s.v - 1);
  const double K = s.K0() + s.K1() * symbol(s.order, s.h(), 2 * M_PI / 20);
  CHECK(instability_of_sliding(s).growth_rate ==
        Approx(-C / 2 + std::sqrt(std::max(0., C * C / 4 - s.A() * K))).epsilon(1e-12));
  s.v = 1.1;
  CHECK(instability_of_sliding(s).growth_rate == 0);
}

TEST_CASE("steady sliding beside held ends is that of the whole line", "[serial]") {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> part(0, 1);
  for (int k = 0; k < 12; ++k) {
    Scene s;
    s.form = k % 3 == 0 ? Form::chain : Form::continuum;
    s.order = s.form == Form::chain ? 2 : 2 + 2 * (k % 3);
    s.n = 3000 + PetscInt(1000 * part(random));
    s.length = s.form == Form::chain ? double(s.n - 1) : 100 + 100 * part(random);
    s.v = 0.2 + part(random);
    s.left = k % 4 == 1 ? End::free : End::velocity;
    s.right = k % 4 == 2 || k % 4 == 0 ? End::free : End::velocity;
    s.left_value = part(random);
    s.right_value = 2 * part(random);
    s.k1 = 1 + 20 * part(random);
    s.c = 0.2 + part(random);
    const std::vector<double> whole = SteadySliding(s).psi;
    const auto psi = steady_velocity(s);
    CAPTURE(k, s.n, s.order);
    double off = 0;
    for (PetscInt i = 0; i < s.n; ++i) off = std::max(off, std::abs(psi(i) - whole[std::size_t(i)]));
    CHECK(off < 1e-12);  // round-off of two banded solves of condition up to 1 + 4 K1/(K0 h^2), some 1e4
  }
}
