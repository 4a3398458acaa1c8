// The eigenvalues of steady sliding against LAPACK on the Jacobian of the time-stepping model, against the
// exact dispersion relation, and the thresholds known in closed form.

#include <petscsys.h>
#include <petscblaslapack.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "catch.hpp"
#include "stability/argument_principle.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/stability/spectrum.hpp"

using namespace stickslip;

namespace {

// The steady state as a vector of the model.
VecHandle steady_vector(const Model& model, const SteadySliding& s) {
  VecHandle u = model.create_vector();
  PetscScalar* x;
  SS_TRY(VecGetArray(u, &x));
  const std::size_t d = std::size_t(model.dof());
  for (PetscInt i = 0; i < model.local(); ++i) {
    const std::size_t at = std::size_t(i) * d, g = std::size_t(model.first() + i);
    x[at] = s.psi[g];
    x[at + 1] = s.eta[g];
    if (d == 3) x[at + 2] = s.state[g];
  }
  SS_TRY(VecRestoreArray(u, &x));
  return u;
}

// Every eigenvalue of the model's Jacobian without the held nodes, by LAPACK.
std::vector<Complex> lapack(const LinearisedOperator& s) {
  const Model model(PETSC_COMM_SELF, s.scene);
  VecHandle u = steady_vector(model, SteadySliding(s.scene));
  MatHandle J = model.create_jacobian(Part::full);
  model.jacobian(Part::full, u, 0, 1, J);
  std::vector<PetscInt> rows;
  for (PetscInt g : s.coupling.node)
    for (int c = 0; c < model.dof(); ++c) rows.push_back(g * model.dof() + c);
  const PetscInt n = PetscInt(rows.size());
  std::vector<PetscScalar> a(std::size_t(n * n));
  SS_TRY(MatSetOption(J, MAT_ROW_ORIENTED, PETSC_FALSE));
  SS_TRY(MatGetValues(J, n, rows.data(), n, rows.data(), a.data()));
  PetscBLASInt size = PetscBLASInt(n), one = 1, info = 0, work_size = 8 * size;
  std::vector<double> re(rows.size()), im(rows.size()), work(std::size_t(8 * n));
  LAPACKgeev_("N", "N", &size, a.data(), &size, re.data(), im.data(), nullptr, &one, nullptr, &one,
              work.data(), &work_size, &info);
  REQUIRE(info == 0);
  std::vector<Complex> values;
  for (std::size_t i = 0; i < rows.size(); ++i) values.emplace_back(re[i], im[i]);
  std::sort(values.begin(), values.end(), [](Complex x, Complex y) { return x.real() > y.real(); });
  return values;
}

// The size of the operator, of which its eigenvalues by LAPACK have the round-off.
double size_of(const LinearisedOperator& s) { return s.imaginary_bound() + s.viscous_rate(); }

// A scene drawn at random: forms, laws, states, spreads, ends, orders, signs, viscosity between neighbours.
Scene random_scene(unsigned seed, PetscInt largest) {
  std::mt19937 random(seed);
  const auto draw = [&](double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<double>(0, 1)(random);
  };
  const auto pick = [&](int choices) { return int(random() % unsigned(choices)); };
  Scene s;
  s.form = pick(2) ? Form::continuum : Form::chain;
  s.n = PetscInt(draw(20, double(largest)));
  s.v = draw(0.1, 1.6);
  const int ends = pick(5);
  if (ends == 1 || ends == 3) s.left = End::free;
  if (ends == 2 || ends == 4) s.left = End::velocity;
  if (ends == 1 || ends == 2) s.right = End::free;
  if (ends == 3 || ends == 4) s.right = End::velocity;
  s.left_value = pick(2) ? s.v : draw(-1.5, 1.5);
  s.right_value = pick(2) ? s.v : draw(0.2, 1.5);
  if (s.form == Form::continuum) {
    s.gamma = draw(0.5, 5);
    s.delta = pick(3) ? draw(0, 0.8) : 0;
    s.derived_sign = pick(2) != 0;
    s.c = draw(0.5, 2);
    s.length = draw(5, 60);
    const bool held = s.left == End::velocity || s.right == End::velocity;
    s.order = 2 + 2 * pick(held ? 3 : 4);
  } else {
    s.order = 2;
    s.m = draw(0.5, 2);
    s.k0 = draw(0.05, 1);
    s.k1 = draw(0.05, 2);
    s.f0 = draw(0.5, 2);
    s.zeta = pick(2) ? draw(0, 1.5) : 0;
    s.length = double(s.ring() ? s.n : s.n - 1);
  }
  const int law = pick(8);
  FrictionParameters& f = s.friction;
  f.law = law < 4   ? Law("cubic")
          : law < 6 ? Law("carlson-langer")
          : law < 7 ? Law("coulomb")
                    : Law("rate-and-state");
  if (f.law == Law("rate-and-state")) {
    f.state = pick(2) ? StateLaw("ageing") : StateLaw("slip");
    f.values["friction_a"] = draw(0.01, 0.2);
    f.values["friction_b"] = draw(0.01, 0.3);
    f.values["friction_D"] = f.values["state_D"] = draw(0.3, 2);
  } else if (f.law != Law("cubic") && pick(2)) {
    f.state = pick(2) ? StateLaw("healing") : StateLaw("contact-age");
    f.values["state_t_h"] = draw(0.5, 3);
    f.values["state_D"] = draw(0.5, 3);
  }
  if (pick(3)) {
    s.spread = draw(0.01, 0.5);
    s.spread_kind = pick(2) ? SpreadKind::uniform : SpreadKind::lognormal;
    s.spread_length = draw(0.3, 3);
    s.friction_seed = PetscInt(random() % 1000u);
  }
  if (pick(3) == 0) s.nu = draw(0.01, 0.5);
  return s;
}

std::string describe(const Scene& s) {
  return to_string(s.form) + " n=" + std::to_string(s.n) + " order=" + std::to_string(s.order) + " " +
         to_string(s.friction.law) + "/" + to_string(s.friction.state) + " " + to_string(s.left) + "-" +
         to_string(s.right) + " spread=" + std::to_string(s.spread) +
         " delta=" + std::to_string(s.s_delta()) + " nu=" + std::to_string(s.nu);
}

}  // namespace

TEST_CASE("steady sliding solves the model's equations", "[spectrum]") {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const SteadySliding s(random_scene(seed, 60));
    INFO(describe(s.scene));
    const Model model(PETSC_COMM_WORLD, s.scene);
    VecHandle u = steady_vector(model, s), f = model.create_vector();
    model.rhs(Part::full, u, f);
    const PetscScalar* x;
    SS_TRY(VecGetArrayRead(f, &x));
    double worst = 0;
    for (PetscInt i = 0; i < model.local(); ++i)
      if (!model.held(model.first() + i))
        for (int c = 0; c < model.dof(); ++c) worst = std::max(worst, std::abs(x[i * model.dof() + c]));
    SS_TRY(VecRestoreArrayRead(f, &x));
    const LinearisedOperator J(s);
    const double stiff = J.largest_stiffness() + J.viscous_rate() + s.scene.A();
    CHECK(worst <= 1e-14 * stiff * 10);
    CHECK(s.residual <= 1e-14 * stiff * 10);
  }
}

TEST_CASE("the growth rate is that of the dense matrix", "[spectrum][serial]") {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const LinearisedOperator s(random_scene(seed, seed % 20 == 0 ? 160 : 80));
    INFO("seed " << seed << ": " << describe(s.scene));
    const std::vector<Complex> all = lapack(s);
    double growth = all[0].real();
    SpectrumSettings settings;
    settings.refine = false;
    settings.method = SpectrumMethod::krylov;
    const Spectrum found = compute_spectrum(PETSC_COMM_SELF, s, settings);
    // LAPACK's error: round-off of the norm, times the condition, to the half for the pairs that are nearly
    // double
    const double scale = size_of(s);
    INFO(found.completeness_check << "; frequency " << found.frequency);
    CHECK(found.growth == Approx(growth).margin(1e-9 * scale));
    CHECK(found.complete);
    for (const Mode& m : found.modes) CHECK(m.residual <= 1e-9 * scale);
    if (found.dispersion_error) CHECK(*found.dispersion_error <= 1e-10);
  }
}

// The eigenvalues of a uniform ring, wave by wave, as often as they stand there; rightmost first.
std::vector<double> growth_of_waves(const LinearisedOperator& s) {
  std::vector<double> growth;
  for (PetscInt j = 0; j < s.scene.n; ++j)
    for (const Complex& z : dispersion(s.mean(), s.symbol(2 * M_PI * double(j) / s.scene.length)))
      growth.push_back(z.real());
  std::sort(growth.rbegin(), growth.rend());
  return growth;
}

// What a list of modes says of growth rates, in its own order.
std::vector<double> growth_of_list(const Spectrum& spectrum) {
  std::vector<double> growth;
  for (const Mode& m : spectrum.modes)
    growth.insert(growth.end(), m.value.imag() > 0 ? 2 : 1, m.value.real());
  return growth;
}

TEST_CASE("a list of eigenvalues is whole, and has double ones twice", "[spectrum][serial]") {
  // LAPACK makes a pair of many a double real one, with a frequency of round-off.
  std::vector<Scene> scenes;
  for (unsigned seed = 1; scenes.size() < 60; ++seed) {
    Scene scene = random_scene(seed, 50);
    if (!scene.ring() || !scene.friction.has_state()) continue;
    scene.spread = 0;
    scene.v *= seed % 2 ? 1 : -1;
    scenes.push_back(scene);
  }
  std::size_t real_twins = 0;
  for (const Scene& scene : scenes)
    for (const auto method : {SpectrumMethod::dense, SpectrumMethod::krylov})
      for (const PetscInt count : {6, 24, 1000}) {
        const LinearisedOperator s(scene);
        INFO(describe(scene) << " count=" << count
                             << (method == SpectrumMethod::dense ? " dense" : " krylov"));
        SpectrumSettings settings;
        settings.refine = false;
        settings.method = method;
        settings.count = count;
        const Spectrum found = compute_spectrum(PETSC_COMM_SELF, s, settings);
        const std::vector<double> exact = growth_of_waves(s), list = growth_of_list(found);
        for (std::size_t k = 0; k + 1 < found.modes.size(); ++k)
          real_twins += found.modes[k].value.imag() == 0 && found.modes[k + 1].value == found.modes[k].value;
        CHECK(found.list_complete);
        REQUIRE(list.size() <= exact.size());
        if (count == 1000) CHECK(list.size() == exact.size());
        double worst = 0;
        for (std::size_t k = 0; k < list.size(); ++k) worst = std::max(worst, std::abs(list[k] - exact[k]));
        CHECK(worst <= 1e-9 * size_of(s));
      }
  CHECK(real_twins > 100);
}

TEST_CASE("the search for long lines finds the growth rate of the dense matrix, or says that it may not",
          "[spectrum][serial]") {
  int complete = 0, scenes = 0;
  for (unsigned seed = 201; seed <= 224; ++seed) {
    Scene scene = random_scene(seed, 60);
    scene.n = scene.n + 60;
    if (scene.form == Form::chain) scene.length = double(scene.ring() ? scene.n : scene.n - 1);
    const LinearisedOperator s(scene);
    INFO("seed " << seed << ": " << describe(s.scene));
    SpectrumSettings settings;
    settings.refine = false;
    settings.method = SpectrumMethod::krylov;
    settings.long_from = 70;
    const Spectrum found = compute_spectrum(PETSC_COMM_SELF, s, settings);
    INFO(found.completeness_check);
    const double growth = lapack(s)[0].real(), scale = size_of(s);
    CHECK(found.growth <= growth + 1e-8 * scale);
    ++scenes;
    if (!found.complete) continue;
    ++complete;
    CHECK(std::abs(found.growth - growth) <= found.error + 1e-9 * scale);
  }
  CHECK(complete > 0.9 * scenes);
}

TEST_CASE("the count along the line is LAPACK's, also where the line is shared among ranks", "[spectrum]") {
  int tree = 0, all_scenes = 0;
  for (unsigned seed = 101; seed <= 118; ++seed) {
    Scene scene = random_scene(seed, 60);
    scene.n = scene.n + 60;
    if (scene.form == Form::chain) scene.length = double(scene.ring() ? scene.n : scene.n - 1);
    const LinearisedOperator s(scene);
    INFO("seed " << seed << ": " << describe(s.scene));
    const std::vector<Complex> all = lapack(s);
    const double height = 1.01 * s.imaginary_bound();
    for (const double part : {0.01, 0.2, 0.7}) {
      // the widest gap of the real parts near that place
      std::size_t at = std::max<std::size_t>(1, std::size_t(part * double(all.size() - 1)));
      for (std::size_t k = at; k < std::min(all.size() - 1, at + 8); ++k)
        if (all[k - 1].real() - all[k].real() > all[at - 1].real() - all[at].real()) at = k;
      const double a = (all[at - 1].real() + all[at].real()) / 2;
      if (all[at - 1].real() - all[at].real() < 1e-6 * size_of(s)) continue;  // LAPACK itself is no better
      const auto count = count_right(PETSC_COMM_WORLD, s, a, height, 3e9);
      REQUIRE(count);
      CHECK(*count == long(at));
      if (s.N > 0 && a <= -s.K1 / s.N) continue;  // where the factor of viscosity has its zero
      ++all_scenes;
      if (follow_phase(PETSC_COMM_WORLD, s, {a, height}, a)) ++tree;
    }
  }
  CHECK(all_scenes > 20);
  CHECK(tree > 0.9 * all_scenes);  // the others are counted by one determinant a point
}

TEST_CASE("friction does not enter det S(0): no real eigenvalue of sliding can cross zero", "[spectrum]") {
  // lambda multiplies every term of S but K0 - K1 D2, so the product of all eigenvalues is, up to its sign,
  // A^n prod r_i det(K0 - K1 D2): not 0 with K0 > 0 or a held end.
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const Scene scene = random_scene(7000 + seed, 40);
    INFO(describe(scene));
    std::optional<LinearisedOperator> s;
    try {
      s.emplace(scene);
    } catch (const Failure&) {
      continue;  // a threshold at rest
    }
    double product = 0;
    for (const Complex& z : lapack(*s)) product += std::log(std::abs(z));
    Scene plain = scene;  // another friction altogether
    plain.friction = FrictionParameters();
    plain.spread = 0;
    BandLU lu;
    double expected = double(s->size()) * std::log(s->A) + LinearisedOperator(plain).factor(0, lu).log_abs;
    for (std::size_t i = 0; s->has_state() && i < s->size(); ++i) expected += std::log(s->point(i).r());
    CHECK(std::isfinite(expected));
    CHECK(product == Approx(expected).margin(1e-6));
  }
}

TEST_CASE("modes trapped at the grid scale behind a held end are found on a long grid",
          "[spectrum][serial]") {
  // Stretches shorter than such a mode make others look more growing than it is.
  Scene scene;
  scene.n = 6000;
  scene.left = End::velocity;
  scene.right = End::free;
  scene.left_value = -1.5;
  scene.v = 0.9;
  SpectrumSettings settings;
  settings.refine = false;
  const LinearisedOperator sliding(scene);
  const Spectrum found = compute_spectrum(PETSC_COMM_WORLD, sliding, settings);
  CHECK(found.complete);
  // Near the least damping (1.4), below it, at the end of the band.
  CHECK(found.growth < 1.4);
  CHECK(found.growth > 1.34);
  CHECK(found.frequency == Approx(Model(PETSC_COMM_SELF, scene).wave_frequency()).epsilon(1e-3));
}
