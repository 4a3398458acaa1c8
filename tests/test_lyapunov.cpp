// Tangent vectors against differences of two motions, the statistics of their growth, the dimension.
#include <cmath>
#include <random>

#include "catch.hpp"
#include "shared.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/checkpoint.hpp"
#include "stickslip/stability/tangents.hpp"
#include "stickslip/time/time.hpp"
#include "study/lyapunov.hpp"

using namespace stickslip;

namespace {

const Settings strict = {{"ts_rtol", "1e-11"}, {"ts_atol", "1e-11"}};

// u_i = start + eps * deviation, by the number of the unknown.
void fill(const Model& model, Vec deviation, double eps, Vec u) {
  const double* y = nullptr;
  double* a;
  if (deviation) SS_TRY(VecGetArrayRead(deviation, &y));
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i)
    for (int d = 0; d < model.dof(); ++d) {
      const double wave = std::sin(1.7 * double(model.first() + i) + d);
      a[i * model.dof() + d] = d == 2 ? 1.2 + 0.1 * wave : d == 1 ? 0.5 + 0.2 * wave : 0.3 + 0.2 * wave;
      if (y) a[i * model.dof() + d] += eps * y[i * model.dof() + d];
    }
  SS_TRY(VecRestoreArray(u, &a));
  if (deviation) SS_TRY(VecRestoreArrayRead(deviation, &y));
  model.set_held(u);
}

// Where the motion from there comes to by the time t.
VecHandle end_of(const Model& model, Vec deviation, double eps, double t, Tangents* along = nullptr) {
  const InDatabase given(strict);
  VecHandle u = model.create_vector();
  fill(model, deviation, eps, u);
  Integrator integrator(model, MethodSpec::from(given.options), u);
  if (along) integrator.set_output_times([](double after) { return std::nextafter(after, HUGE_VAL); });
  integrator.advance(u, 0, t, [&](const Integrator::Step& step) {
    const double dt = step.t - step.t_before;
    if (along && dt > 0)
      along->advance(dt, [&](double part, Vec into) {
        step.interpolate(part == 1 ? step.t : step.t_before + part * dt, into);
      });
    return Integrator::Verdict::go_on;
  });
  return u;
}

Scene continuum(PetscInt n, End left, End right) {
  Scene s;
  s.n = n;
  s.length = 0.7 * double(n);
  s.left = left;
  s.right = right;
  s.left_value = s.right_value = 0.4;
  return s;
}

Scene chain(PetscInt n, const char* law, const char* state) {
  Scene s;
  s.form = Form::chain;
  s.delta = 0;
  s.n = n;
  s.order = 2;
  s.left = s.right = End::free;
  s.length = double(n - 1);
  s.k0 = 0.8;
  s.zeta = 0.05;
  s.friction.law = Law(law);
  s.friction.state = StateLaw(state);
  s.spread = 0.3;
  return s;
}

// The deviation that one tangent vector becomes, against the difference of two motions, relative to its
// length.
double miss(const Scene& scene, double t) {
  const Model model(PETSC_COMM_WORLD, scene);
  Tangents tangents(model, 1);
  VecHandle y = model.create_vector();
  SS_TRY(VecCopy(tangents.vectors()[0], y));
  end_of(model, nullptr, 0, t, &tangents);
  const double length = std::exp(tangents.growth()[0]);
  const double eps = 1e-5;
  const VecHandle up = end_of(model, y, eps, t), down = end_of(model, y, -eps, t);
  SS_TRY(VecAXPY(up, -1, down));
  SS_TRY(VecScale(up, 0.5 / eps / length));
  double* a;
  SS_TRY(VecGetArray(up, &a));
  for (PetscInt i = 0; i < model.local(); ++i)
    if (model.held(model.first() + i)) a[i * model.dof()] = a[i * model.dof() + 1] = 0;
  SS_TRY(VecRestoreArray(up, &a));
  return distance(up, tangents.vectors()[0]);
}

}  // namespace

// Differences over 2e-5 err by 1e-10 times a third derivative and by the tolerance over 1e-5, 1e-6.
TEST_CASE("A tangent vector becomes the difference of two motions", "[lyapunov]") {
  CHECK(miss(continuum(9, End::velocity, End::free), 2) < 1e-6);
  CHECK(miss(chain(4, "coulomb", "none"), 8) < 1e-6);
}

TEST_CASE("A tangent vector passes starts and stops of every law as the difference of two motions",
          "[lyapunov][serial]") {
  CHECK(miss(continuum(12, End::periodic, End::periodic), 3) < 1e-6);
  CHECK(miss(chain(5, "cubic", "none"), 6) < 1e-6);
  for (const char* law : {"carlson-langer", "coulomb"})
    for (const char* state : {"none", "healing", "contact-age"}) {
      INFO(law << " " << state);
      CHECK(miss(chain(4, law, state), 25) < 1e-6);
    }
}

TEST_CASE("Tangent vectors add up to the divergence, and die where nodes rest", "[lyapunov][serial]") {
  const Model smooth(PETSC_COMM_WORLD, continuum(8, End::periodic, End::periodic));
  Tangents all(smooth, 16);
  double divergence = 0, grown = 0;
  {
    const InDatabase given(strict);
    VecHandle u = smooth.create_vector();
    fill(smooth, nullptr, 0, u);
    Integrator integrator(smooth, MethodSpec::from(given.options), u);
    integrator.set_output_times([](double after) { return std::nextafter(after, HUGE_VAL); });
    double first = 0;
    bool begun = false;
    integrator.advance(u, 0, 3, [&](const Integrator::Step& step) {
      const double dt = step.t - step.t_before;
      if (dt == 0) return Integrator::Verdict::go_on;
      all.advance(dt, [&](double part, Vec into) {
        step.interpolate(part == 1 ? step.t : step.t_before + part * dt, into);
      });
      double sum = 0;
      for (const double one : all.growth()) sum += one;
      if (begun) {
        grown += sum;
        divergence += all.divergence();
      } else {
        first = sum;  // with the volume of the vectors drawn
      }
      begun = true;
      return Integrator::Verdict::go_on;
    });
    CHECK(std::isfinite(first));
  }
  CHECK(!all.has_rested());
  CHECK(grown == Approx(divergence).epsilon(1e-7));

  const Model sticky(PETSC_COMM_WORLD, chain(4, "carlson-langer", "none"));
  Tangents some(sticky, 8);
  end_of(sticky, nullptr, 0, 25, &some);
  CHECK(some.has_rested());
  int gone = 0;
  for (const double one : some.growth()) gone += std::isinf(one) ? 1 : 0;
  CHECK(gone >= 1);
  CHECK(gone <= 4);
  some.renew();
  CHECK(!some.has_rested());
}

TEST_CASE("The slope of growth is exact for what is steady, and its error covers what forgets",
          "[lyapunov][serial]") {
  GrowthAverage steady(1, 2, 10);
  for (double t = 0; t < 10; t += 0.37) {
    const double end = std::min(10., t + 0.37);
    steady.add(t, end, {-0.3 * (end - t)});
  }
  CHECK(steady.measured() == Approx(8));
  CHECK(steady.exponents()[0].value == Approx(-0.3).epsilon(1e-12));
  CHECK(steady.exponents()[0].error < 1e-12);

  // rate 0.1 + cos(t): over n periods the weighted mean of the cosine is of the order 6/(time)^2
  GrowthAverage periodic(1, 0, 200);
  for (int i = 0; i < 4000; ++i) {
    const double a = 0.05 * i, b = 0.05 * (i + 1);
    periodic.add(a, b, {0.1 * (b - a) + std::sin(b) - std::sin(a)});
  }
  CHECK(std::abs(periodic.exponents()[0].value - 0.1) < 12. / (200. * 200.));

  // independent normal growth: the error is that of the slope, sqrt(6/5 variance/time), and z =
  // deviation/error Student's
  std::mt19937 draw(5);
  std::normal_distribution<double> normal;
  double squares = 0, errors = 0;
  const int repeats = 400;
  for (int r = 0; r < repeats; ++r) {
    GrowthAverage noise(1, 0, 100);
    for (int i = 0; i < 1000; ++i) noise.add(0.1 * i, 0.1 * (i + 1), {std::sqrt(0.1) * normal(draw)});
    const Estimate e = noise.exponents()[0];
    squares += e.value * e.value;
    errors += e.error * e.error;
  }
  const double exact = 1.2 / 100;  // of 400 draws each mean of squares is good to 7 %
  CHECK(squares / repeats == Approx(exact).epsilon(0.3));
  CHECK(errors / repeats == Approx(exact).epsilon(0.15));

  // goes on from what was saved
  GrowthAverage whole(2, 1, 9), half(2, 1, 9), rest(2, 0, 1);
  for (int i = 0; i < 90; ++i) {
    const std::vector<double> growth{std::sin(i), std::cos(3. * i)};
    whole.add(0.1 * i, 0.1 * (i + 1), growth);
    if (i == 44) {
      Checkpoint c;
      Archive to = Archive::to(c, {}), from = Archive::from(c, {});
      half.archive("growth", to);
      rest.archive("growth", from);
    }
    (i < 44 ? half : rest).add(0.1 * i, 0.1 * (i + 1), growth);
  }
  for (int k = 0; k < 2; ++k)
    CHECK(rest.exponents()[std::size_t(k)].value == whole.exponents()[std::size_t(k)].value);
}

TEST_CASE("The dimension of Kaplan and Yorke", "[lyapunov][serial]") {
  const double infinite = HUGE_VAL;
  const auto dimension = [](const std::vector<Estimate>& list, std::size_t n) {
    return kaplan_yorke(list, n);
  };
  // Lorenz
  CHECK(dimension({{0.9056, 1e-3}, {1e-5, 1e-4}, {-14.5723, 1e-2}}, 3)->value ==
        Approx(2 + 0.9056 / 14.5723));
  CHECK(dimension({{-0.1, 0.01}, {-0.2, 0.01}}, 2)->value == 0);
  CHECK(dimension({{-1e-5, 1e-4}, {-0.2, 0.01}}, 2)->value == 1);
  CHECK(dimension({{0.3, 0.01}, {0, 1e-4}, {-infinite, NAN}}, 6)->value == 2);
  CHECK(!dimension({{0.3, 0.01}, {-0.1, 0.01}}, 6));
  CHECK(dimension({{0.3, 0.01}, {-0.1, 0.01}}, 2)->value == 2);
  // D = 2 + a/|b|: its error from those of a and b
  CHECK(dimension({{0.5, 0.1}, {0, 1e-4}, {-2, 0.2}}, 3)->error ==
        Approx(std::hypot(0.1 / 2, 0.5 * 0.2 / 4)));
}
