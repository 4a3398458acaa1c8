// Cycles of smooth friction: periods, multipliers, waves, branches, cells.

#include <cmath>
#include <complex>

#include "catch.hpp"
#include "cycles/cell_field.hpp"
#include "cycles/cycle_waves.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/study/verify.hpp"

using namespace stickslip;

namespace {

Scene undamped(double gamma, double v) {
  Scene s;
  s.gamma = gamma;
  s.delta = 0;
  s.v = v;
  return s;
}

Scene regularised_chain(double v, double eps) {
  Scene s;
  s.form = Form::chain;
  s.order = 2;
  s.n = 1;
  s.length = 1;
  s.zeta = std::sqrt(0.02);
  s.v = v;
  s.friction.law = Law("carlson-langer");
  s.friction.regularised = true;
  s.friction.eps = eps;
  return s;
}

Scene healing_chain(double v) {
  Scene s = regularised_chain(v, 0.05);
  s.friction.state = StateLaw("healing");
  return s;
}

CycleBranch branch_in_v(const std::function<Scene(double)>& at, double from, double to, int steps,
                        const CycleWatch& watch = nullptr) {
  const SmoothCycle first = uniform_cycle(at(from));
  const auto node = [at](double v) {
    Scene s = at(v);
    s.n = 1;
    return s;
  };
  const auto path = smooth_family(node, from, std::abs(to - from), first);
  return continue_cycle(*path, {"v", from, to, steps}, watch);
}

const SpecialPoint* find(const CycleBranch& branch, const std::string& kind) {
  for (const SpecialPoint& p : branch.special)
    if (p.kind == kind) return &p;
  return nullptr;
}

}  // namespace

TEST_CASE("cycles of van der Pol's equation have the known periods", "[cycle][serial]") {
  for (const auto& [gamma, period] :
       {std::pair(1., 6.66329), {3., 8.85910}, {5., 11.61223}, {10., 19.07837}}) {
    const Cycle cycle = uniform_cycle(undamped(gamma, 0)).cycle;
    INFO("gamma " << gamma << ", period " << cycle.period);
    CHECK(std::abs(cycle.period - period) < 6e-6);
    CHECK(cycle.error_estimate < 1e-10);
    CHECK(cycle.residual < 1e-12);
    CHECK(cycle.psi_max == Approx(-cycle.psi_min).epsilon(1e-9));  // odd
    CHECK(cycle.amplitude == Approx(cycle.psi_max).epsilon(1e-9));
    CHECK(cycle.rest_fraction == 0);
    REQUIRE(cycle.multipliers.size() == 2);
    CHECK(std::abs(cycle.multipliers[cycle.phase_mode] - 1.) < 1e-9);
  }
  // gamma 1: the second multiplier, by DOP853 and Liouville's formula
  const Cycle cycle = uniform_cycle(undamped(1, 0)).cycle;
  CHECK(std::abs(cycle.multipliers[1 - cycle.phase_mode]) == Approx(8.59695e-4).epsilon(1e-5));
}

TEST_CASE("a cell's rates and Jacobian are those of Model", "[cycle][serial]") {
  for (int kind = 0; kind < 4; ++kind) {
    Scene s;
    s.n = 7;
    s.length = 7 * 0.3;
    s.order = kind == 0 ? 6 : 4;
    if (kind > 0) s = healing_chain(0.4), s.n = 6, s.length = 6;
    if (kind == 2)
      s.left = End::velocity, s.right = End::free, s.left_value = -0.7, s.length = 5, s.spread = 0.4;
    if (kind == 3) {
      s = undamped(2, 0.3);
      s.n = 9;
      s.length = 2;
      s.left = End::velocity;
      s.right = End::velocity;
      s.left_value = 0.5;
      s.right_value = -0.2;
    }
    const CellField field(s);
    const Model model(PETSC_COMM_SELF, s);
    const VecHandle u = model.create_vector(), f = model.create_vector();
    const std::size_t dof = std::size_t(field.dof()), d = std::size_t(field.dim());
    double* a;
    SS_TRY(VecGetArray(u, &a));
    for (PetscInt i = 0; i < s.n * PetscInt(dof); ++i) a[i] = counter_uniform(7 + kind, i) - 0.3;
    SS_TRY(VecRestoreArray(u, &a));
    model.set_held(u);
    model.rhs(Part::full, u, f);
    const double *from, *rate;
    SS_TRY(VecGetArrayRead(u, &from));
    SS_TRY(VecGetArrayRead(f, &rate));
    std::vector<double> y(d), g(d), J(d * d), up(d), down(d);
    for (std::size_t k = 0; k < field.nodes(); ++k)
      for (std::size_t j = 0; j < dof; ++j) y[k * dof + j] = from[std::size_t(field.node(k)) * dof + j];
    field.rates(y.data(), g.data());
    double scale = 1;
    for (std::size_t k = 0; k < field.nodes(); ++k)
      for (std::size_t j = 0; j < dof; ++j) {
        const double expected = rate[std::size_t(field.node(k)) * dof + j];
        scale = std::max(scale, std::abs(expected));
        INFO("kind " << kind << " node " << field.node(k) << " entry " << j);
        CHECK(std::abs(g[k * dof + j] - expected) < 1e-12 * scale);
      }
    SS_TRY(VecRestoreArrayRead(u, &from));
    SS_TRY(VecRestoreArrayRead(f, &rate));
    field.jacobian(y.data(), J.data());
    for (std::size_t c = 0; c < d; ++c) {
      constexpr double h = 1e-5;
      std::vector<double> moved = y;
      moved[c] += h;
      field.rates(moved.data(), up.data());
      moved[c] -= 2 * h;
      field.rates(moved.data(), down.data());
      for (std::size_t r = 0; r < d; ++r) {
        INFO("kind " << kind << " entry " << r << "," << c);
        // the differences err by h^2 f'''/6 ~ 1e-10 (2/eps^2 of the regularised law) and round-off 1e-16
        // scale/h
        CHECK(std::abs(J[r * d + c] - (up[r] - down[r]) / (2 * h)) <
              (kind == 1 || kind == 2 ? 1e-6 : 1e-8) * scale);
        if (std::abs(int(r) - int(c)) > field.band()) CHECK(J[r * d + c] == 0);
      }
    }
  }
}

TEST_CASE("waves on uniform oscillations grow as known", "[cycle][serial]") {
  Scene s;  // gamma 3, delta 0.2, c 1, v 0.2
  int points = 0;
  const BlochSpectrum damped = bloch_spectrum(uniform_cycle(s), 200);
  CHECK(damped.growth_rate == Approx(0.0270974).margin(5e-8));
  // rings on which that wave fits as the longest, and that carry none that grows
  Scene ring = s;
  ring.left = ring.right = End::periodic;
  ring.length = 2 * M_PI / damped.wavenumber;
  CHECK(growth_on_uniform(ring) == Approx(damped.growth_rate).margin(1e-9));
  ring.length = 5;
  CHECK(growth_on_uniform(ring) < 0);
  // where the longest wave of a ring stops to grow
  MediumLines lines(
      [&](double v, double gamma) {
        Scene here = ring;
        here.length = 8.784836402747949;
        here.c = 1.0600603155793924;
        here.delta = 0;
        here.v = v;
        here.gamma = gamma;
        return here;
      },
      {{"model_v", 0.8, 1.01}, {"model_gamma", 1.379, 1.517}}, 1, [] {});
  std::vector<std::string> notes;
  for (const Crossing& c : lines.waves(4, notes)) {
    CHECK(c.wavenumber == Approx(2 * M_PI / 8.784836402747949));
    ++points;
  }
  CHECK(points > 0);
  CHECK(damped.wavenumber * damped.wavenumber == Approx(0.4436).margin(5e-5));
  CHECK(!damped.stable);
  CHECK(damped.diffusion < 0);
  const BlochSpectrum fast = bloch_spectrum(uniform_cycle(undamped(3, 0)), 200);
  CHECK(std::abs(fast.multiplier) == Approx(1.302).margin(5e-4));
  CHECK(fast.wavenumber * fast.wavenumber == Approx(0.485).margin(5e-4));
  double edge = 0;
  for (const BlochPoint& p : fast.points)
    if (p.growth_rate > 0) edge = p.wavenumber;
  CHECK(edge * edge < 1.122);
  CHECK(edge * edge > 1.0);
  const BlochSpectrum calm = bloch_spectrum(uniform_cycle(undamped(3, 0.9)), 200);
  CHECK(calm.stable);
  CHECK(calm.decided);
  CHECK(calm.diffusion > 0);
  CHECK(calm.growth_rate < 0);
}

TEST_CASE("a wave's multipliers are those of a cell of several nodes", "[cycle][serial]") {
  Scene s = regularised_chain(1, 5e-2);
  const SmoothCycle one = uniform_cycle(s);
  constexpr PetscInt m = 3;
  Scene cell = s;
  cell.n = m;
  cell.length = m;
  const std::size_t dof = std::size_t(one.cycle.dof);
  const CycleGuess guess{one.cycle.period,
                         [&](double phase, double* y) {
                           std::vector<double> node(dof);
                           evaluate(Collocation::gauss5(), one.mesh, one.values.data(), int(dof), phase,
                                    node.data());
                           for (PetscInt i = 0; i < m; ++i)
                             std::copy(node.begin(), node.end(), y + std::size_t(i) * dof);
                         },
                         one.mesh};
  const SmoothCycle three = solve_cycle(cell, guess);
  CHECK(three.cycle.period == Approx(one.cycle.period).epsilon(1e-10));
  // the multipliers of the cell: of the wavenumbers 0, 1/3, 2/3; of a phase theta: (theta + 2 pi j)/3
  Deviations of_one(one), of_three(three);
  const auto expected = [&](double theta) {
    std::vector<Complex> all;
    for (int j = 0; j < m; ++j) {
      const double k = (theta + 2 * M_PI * j) / double(m), kappa2 = 2 - 2 * std::cos(k);
      for (const Complex mu : of_one.of_wave(kappa2)) all.push_back(mu);
    }
    return all;
  };
  const auto compare = [&](const std::vector<Complex>& found, const std::vector<Complex>& known) {
    REQUIRE(found.size() == known.size());
    for (const Complex mu : known) {
      double nearest = 1e300;
      for (const Complex other : found) nearest = std::min(nearest, std::abs(mu - other));
      INFO("multiplier " << mu);
      CHECK(nearest < 1e-7);
    }
  };
  compare(three.cycle.multipliers, expected(0));
  compare(of_three.of_phase(0.7), expected(0.7));
}

TEST_CASE("a cycle beside stable sliding is found", "[cycle][serial]") {
  const Cycle cycle = uniform_cycle(regularised_chain(2, 1e-2)).cycle;
  CHECK(cycle.amplitude > 1.5);
  CHECK(growth_rate(cycle) < 0);
}

TEST_CASE("a branch goes through the canard explosion to the Hopf point", "[cycle][serial]") {
  Scene s;
  const auto at = [s](double v) {
    Scene here = s;
    here.v = v;
    return here;
  };
  const CycleBranch branch = branch_in_v(at, 0.9, 1.1, 100);
  const SpecialPoint* hopf = find(branch, "hopf");
  REQUIRE(hopf);
  const double exact = std::sqrt(1 - 0.2 / 3);
  CHECK(std::abs(hopf->value - exact) < 1e-8);
  // at the Hopf point the frequency is sqrt(A K0) = 1 with the trace of J zero: its determinant, K0 A + s
  // delta ... = 1
  CHECK(hopf->period == Approx(2 * M_PI).epsilon(1e-5));
  CHECK(!find(branch, "fold"));  // supercritical, and no fold on the way: the amplitude falls monotonically
  double largest_drop = 0;
  for (std::size_t k = 1; k < branch.points.size(); ++k)
    largest_drop =
        std::max(largest_drop, branch.points[k - 1].cycle.amplitude - branch.points[k].cycle.amplitude);
  CHECK(largest_drop < 0.2);  // of 1.86: the explosion is resolved
}

TEST_CASE("a branch finds where waves begin to grow", "[cycle][serial]") {
  const auto at = [](double v) {
    Scene s;
    s.v = v;
    s.n = 1;
    return s;
  };
  const auto special = [&](double from, double to, const std::string& kind) {
    const SmoothCycle first = uniform_cycle(at(from));
    const auto path = smooth_family(at, from, std::abs(to - from), first);
    const CycleWatch watch = [&](double, const Cycle&) {
      return watch_waves(bloch_spectrum(smooth_candidate(*path), 50));
    };
    const CycleBranch branch = continue_cycle(*path, {"v", from, to, 20}, watch);
    const SpecialPoint* found = find(branch, kind);
    REQUIRE(found);
    CHECK(branch.points.front().stable != branch.points.back().stable);
    return *found;
  };
  const SpecialPoint longest = special(0.832, 0.837, "long-wave"), finite = special(0.93, 0.935, "wave");
  // asked directly, with other wavenumbers
  const BlochSpectrum neutral = bloch_spectrum(uniform_cycle(at(longest.value)), 60);
  CHECK(std::abs(neutral.diffusion) < 1e-7);
  const BlochSpectrum touching = bloch_spectrum(uniform_cycle(at(finite.value)), 60);
  CHECK(std::abs(touching.largest_of_finite) < 1e-8);
  CHECK(touching.diffusion > 0);
}

TEST_CASE("a branch finds where a quantity of one's own passes zero", "[cycle][serial]") {
  const auto at = [](double v) { return undamped(1, v); };
  const CycleWatch watch = [](double, const Cycle& cycle) {
    Watched seen;
    seen.tests["amplitude-2"] = cycle.amplitude - 2;
    return seen;
  };
  const CycleBranch branch = branch_in_v(at, 0.05, 0.4, 20, watch);
  const SpecialPoint* found = find(branch, "amplitude-2");
  REQUIRE(found);
  CHECK(branch.special.size() == 1);
  // independent: cycles solved for one by one
  const auto above = [&](double v) { return uniform_cycle(at(v)).cycle.amplitude - 2; };
  const double root = find_root(above, {0.05, above(0.05), 0.4, above(0.4)}, 1e-11);
  CHECK(std::abs(found->value - root) < 1e-8 * (0.4 - 0.05));
  CHECK(found->period == Approx(uniform_cycle(at(root)).cycle.period).epsilon(1e-8));
}

TEST_CASE("folds are where a cycle's multiplier is 1", "[cycle][serial]") {
  const auto at = [](double v) { return regularised_chain(v, 1e-2); };
  const CycleBranch branch = branch_in_v(at, 1.5, 3.0, 150);
  const SpecialPoint *fold = find(branch, "fold"), *hopf = find(branch, "hopf");
  INFO(branch.end);
  REQUIRE(fold);
  REQUIRE(hopf);
  CHECK(branch.points.front().stable);
  CHECK(!branch.points.back().stable);
  // independent: just below the fold two cycles, the rates of both change of sign; the velocity where sliding
  // loses stability by the slope of the smoothed law
  const auto damping = [](double v) {
    const double eps = 1e-2, t = std::tanh(v / eps), sech2 = 1 - t * t, m = 1 + v * t;
    return std::sqrt(0.02) + (sech2 / eps * m - t * (t + v * sech2 / eps)) / (m * m);
  };
  double low = 1.5, high = 2;
  for (int k = 0; k < 60; ++k) (damping((low + high) / 2) < 0 ? low : high) = (low + high) / 2;
  CHECK(std::abs(hopf->value - low) < 1e-8);
  // sharper friction: the fold tends to the grazing of exact stick, 2.4047128, from below
  CHECK(fold->value < 2.4047);
  CHECK(fold->value > 2.3);
}

TEST_CASE("a cell settles on a cycle that its own motion repeats", "[cycle][serial]") {
  Scene s;
  s.form = Form::chain;
  s.order = 2;
  s.n = 2;
  s.length = 2;
  const SmoothCycle pair = settled_cycle(s, {0.5, 0.1, -0.3, 0.2}, 200);
  CHECK(pair.cycle.error_estimate < 1e-10);
  // one period by an independent method: Runge and Kutta's classical one, with Richardson's extrapolation
  const CellField& field = *pair.field;
  const auto advanced = [&](int steps) {
    std::vector<double> y(pair.values.begin(), pair.values.begin() + field.dim()), k[4], at(y.size());
    for (auto& part : k) part.resize(y.size());
    const double h = pair.cycle.period / steps;
    for (int n = 0; n < steps; ++n) {
      for (int j = 0; j < 4; ++j) {
        for (std::size_t i = 0; i < y.size(); ++i)
          at[i] = y[i] + (j == 0 ? 0 : h * (j == 3 ? 1 : .5) * k[j - 1][i]);
        field.rates(at.data(), k[j].data());
      }
      for (std::size_t i = 0; i < y.size(); ++i)
        y[i] += h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
    }
    return y;
  };
  const std::vector<double> coarse = advanced(8000), fine = advanced(16000);
  for (std::size_t i = 0; i < fine.size(); ++i)
    CHECK(std::abs(fine[i] + (fine[i] - coarse[i]) / 15 - pair.values[i]) < 1e-9);
}

TEST_CASE("what is no cycle is said", "[cycle][serial]") {
  CHECK_THROWS_AS(uniform_cycle(undamped(3, 1.2)), Failure);
  Scene exact = regularised_chain(1, 1e-2);
  exact.friction.regularised = false;
  CHECK_THROWS_AS(CellField(exact), UsageError);
  Scene large;
  large.n = 512;
  CHECK_THROWS_AS(check_smooth_cell(large), UsageError);
  Scene calm = undamped(3, 1.2);
  calm.n = 3;
  calm.length = 3;
  CHECK_THROWS_AS(settled_cycle(calm, {0.5, 0.1, -0.3, 0.2, 0, 0}, 100), Failure);
}

TEST_CASE("banded systems and generalised eigenvalues", "[cycle][dense][serial]") {
  constexpr int n = 40, band = 3, columns = 2;
  std::vector<double> a(n * n), x(n * columns), b(n * columns);
  for (int i = 0; i < n; ++i) {
    for (int j = std::max(0, i - band); j < std::min(n, i + band + 1); ++j)
      a[std::size_t(i * n + j)] = counter_uniform(3, i * n + j) - 0.5;
    for (int c = 0; c < columns; ++c) x[std::size_t(i * columns + c)] = counter_normal(4, i * columns + c);
  }
  for (int i = 0; i < n; ++i)
    for (int c = 0; c < columns; ++c)
      for (int j = 0; j < n; ++j)
        b[std::size_t(i * columns + c)] += a[std::size_t(i * n + j)] * x[std::size_t(j * columns + c)];
  std::vector<double> full = a, right = b;
  REQUIRE(solve_banded(n, band, a.data(), columns, b.data()));
  REQUIRE(solve_dense(n, full.data(), columns, right.data()));
  for (std::size_t k = 0; k < b.size(); ++k) CHECK(b[k] == Approx(right[k]).epsilon(1e-9).margin(1e-9));
  // (1 2; 3 4) against (2 0; 0 1): det(a - mu b) = 2 mu^2 - 9 mu - 2
  const auto mu = generalised_eigenvalues(2, std::vector<double>{1, 2, 3, 4}, {2, 0, 0, 1});
  CHECK(mu[0].real() == Approx((9 + std::sqrt(97.)) / 4));
  CHECK(mu[1].real() == Approx((9 - std::sqrt(97.)) / 4));
}

TEST_CASE("where the parameter goes as the period grows beyond bounds", "[cycle][serial]") {
  // by the exact period: theta' = lambda - sin theta (a place of rest is born on the cycle), and a pendulum
  // of energy lambda
  const auto on_circle = [](double lambda) { return 2 * M_PI / std::sqrt(lambda * lambda - 1); };
  const auto pendulum = [](double lambda) {
    double a = 1, g = std::sqrt((1 - lambda) / 2);
    for (int k = 0; k < 40; ++k) std::tie(a, g) = std::pair((a + g) / 2, std::sqrt(a * g));
    return 2 * M_PI / a;
  };
  std::vector<double> periods, values;
  for (double near = 1; near > 1e-5; near /= 1.3) {
    values.push_back(1 + near);
    periods.push_back(on_circle(values.back()));
  }
  const auto born = infinite_period_limit(periods, values);
  REQUIRE(born);
  CHECK(std::abs(born->value - 1) < std::min(born->error, 1e-8));
  periods.clear(), values.clear();
  for (double near = 1; near > 1e-15; near /= 1.3) {
    values.push_back(1 - near);
    periods.push_back(pendulum(values.back()));
  }
  CHECK(!infinite_period_limit(periods, values));  // not tenfold where the energy is 1 to the last digit
  for (double& period : periods) period -= 6;      // a shorter turn
  const auto passed = infinite_period_limit(periods, values);
  REQUIRE(passed);
  CHECK(std::abs(passed->value - 1) < 1e-8);
  // a period that tends to 7 has no such limit
  for (std::size_t k = 0; k < values.size(); ++k) periods[k] = 7 - std::pow(1 - values[k], 2);
  CHECK(!infinite_period_limit(periods, values));
}

TEST_CASE("as springs grow soft the period grows beyond bounds, at k0 = 0", "[cycle][serial]") {
  Scene s;
  s.form = Form::chain;
  s.order = 2;
  s.n = 1;
  s.length = 1;
  const auto at = [&](double k0) {
    Scene soft = s;
    soft.k0 = k0;
    return soft;
  };
  const SmoothCycle first = uniform_cycle(at(0.2));
  const auto path = smooth_family(at, 0.2, 0.2, first);
  const CycleBranch branch = continue_cycle(*path, {"k0", 0.2, 0, 100});
  REQUIRE(branch.special.size() == 1);
  CHECK(branch.special[0].kind == "infinite-period");
  CHECK(std::abs(branch.special[0].value) < 0.2e-8);
  // k0 T tends to the time on the two branches on which psi carries the force: integrals of (psi^2 - 1)/(v -
  // psi)
  const double v = s.v;
  const auto slow = [&](double psi) {
    return -psi * psi / 2 - v * psi - (v * v - 1) * std::log(std::abs(psi - v));
  };
  const double known = std::abs(slow(1) - slow(2)) + std::abs(slow(-1) - slow(-2));
  const CyclePoint& last = branch.points.back();
  CHECK(last.value * last.cycle.period == Approx(known).epsilon(20 * std::pow(last.value, 2. / 3)));
}
