// Friction laws and state laws: derivatives, steady states, Newton's steps, thresholds of sliding.
//
// Everything that goes by for_every_friction() covers a law or a state law from the moment it is listed;
// these cases are tagged [every_law] and are compiled with the laws of docs/developers/adding.md, too.
#include <petscsys.h>

#include <petscblaslapack.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <functional>

#include "catch.hpp"
#include "model/kernel.hpp"
#include "shared.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"

using namespace stickslip;

namespace {

using Complex = std::complex<double>;

// Without a state, or with one that grows without end in motion.
bool has_no_steady_state(const FrictionParameters& p) { return p.state.none() || p.state->needs_stops; }

// Calls body for every law with every state law that it may have, exact and (where that differs) regularised.
void for_every_friction(const std::function<void(const FrictionParameters&)>& body) {
  for (const Law law : all_laws())
    for (const StateLaw state : all_state_laws()) {
      if (!belong_together(law, state)) continue;
      for (const bool regularised : {false, true}) {
        if (regularised && (!law->jumps_at_rest || state->needs_stops)) continue;
        FrictionParameters p;
        p.law = law;
        p.state = state;
        p.regularised = regularised;
        p.eps = 0.01;
        p.values["state_t_h"] = 1.7;
        p.values["state_D"] = 0.8;
        p.values["state_theta0"] = 0.6;
        p.curve = {{0, 1}, {0.03, 0.8}, {0.5, 0.55}, {1.3, 0.5}, {3, 0.6}};  // of the law `table`
        body(p);
      }
    }
}

std::string name_of(const FrictionParameters& p) {
  return to_string(p.law) + " with " + to_string(p.state) + (p.regularised ? ", regularised" : "");
}

const double velocities[] = {-2.3, -1.1, -0.31, -1e-3, -1e-8, 1e-10, 1e-6, 1e-4, 0.02, 0.2, 0.9, 3.7};
// Stored states: tau, or ln theta over twenty decades.
const double states[] = {-23, -7.1, -0.4, 0.7, 1.9, 11, 23};

// Central difference of f at x with step e, and how wrong it may be: the difference to step 2 e is three
// times the error of truncation (the next term of the series is smaller by far), `noise` the round-off in f.
struct Difference {
  double value, error;
};
Difference central(const std::function<double(double)>& f, double x, double e, double noise) {
  const double one = (f(x + e) - f(x - e)) / (2 * e), two = (f(x + 2 * e) - f(x - 2 * e)) / (4 * e);
  return {one, std::abs(two - one) + noise / e};
}

void check_derivative(double derivative, const Difference& d, const char* what) {
  INFO(what << ": " << derivative << ", by differences " << d.value << " +- " << d.error);
  CHECK(std::abs(derivative - d.value) <= d.error + 1e-14 * std::abs(derivative));
}

std::vector<Complex> eigenvalues(std::vector<double> matrix, int n) {
  PetscBLASInt size = n, work_size = 8 * n, info = 0, one = 1;
  std::vector<double> re(static_cast<std::size_t>(n)), im(re), work(static_cast<std::size_t>(work_size));
  double nothing = 0;
  LAPACKgeev_("N", "N", &size, matrix.data(), &size, re.data(), im.data(), &nothing, &one, &nothing, &one,
              work.data(), &work_size, &info);
  REQUIRE(info == 0);
  std::vector<Complex> all;
  for (std::size_t i = 0; i < re.size(); ++i) all.emplace_back(re[i], im[i]);
  return all;
}

// The Jacobian of the whole right-hand side at uniform sliding psi = v, column by column.
std::vector<double> jacobian_at_sliding(const Scene& s) {
  const Model model(PETSC_COMM_SELF, s);
  VecHandle u = model.create_vector(), w = model.create_vector();
  const int dof = model.dof();
  double* a;
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < s.n; ++i) {
    a[i * dof] = s.v;
    if (dof == 3) a[i * dof + 2] = model.steady_state(s.v);
    a[i * dof + 1] = s.B() * s.v + model.friction(i, s.v, dof == 3 ? a[i * dof + 2] : 0).F;
  }
  SS_TRY(VecRestoreArray(u, &a));
  model.rhs(Part::full, u, w);
  double residual;
  SS_TRY(VecNorm(w, NORM_INFINITY, &residual));
  CHECK(residual <= 1e-13 * (1 + s.A() + s.v / s.friction.value("friction_D")));  // sliding is steady
  MatHandle J = model.create_jacobian(Part::full), dense;
  model.jacobian(Part::full, u, 0, 1, J);
  SS_TRY(MatConvert(J, MATSEQDENSE, MAT_INITIAL_MATRIX, dense.out()));
  const double* entries;
  SS_TRY(MatDenseGetArrayRead(dense, &entries));
  std::vector<double> matrix(entries, entries + s.n * dof * s.n * dof);
  SS_TRY(MatDenseRestoreArrayRead(dense, &entries));
  return matrix;
}

double growth(const std::vector<Complex>& all) {
  double largest = -1e300;
  for (const Complex& z : all) largest = std::max(largest, z.real());
  return largest;
}

// The coefficients of the cubic of one mode from the pointwise laws: a, r and b, b by a difference of steady
// friction (Richardson: error of order e^4).
struct CubicTerms {
  double a, r, b, b_error;
};
CubicTerms cubic_terms(const Scene& s) {
  return with_friction(s.friction, [&](const Friction& f) {
    const double state = f.steady_state(s.v), damping = s.B() + s.s_delta() / s.A();
    const auto steady = [&](double v) { return f.force(v, f.steady_state(v)); };
    const double e = 1e-3 * s.v;
    const auto slope = [&](double h) { return (steady(s.v + h) - steady(s.v - h)) / (2 * h); };
    const double one = slope(e), two = slope(2 * e), three = slope(3 * e);
    // error e^2 c2 + e^4 c4 + ... eliminated twice
    const double b = 1.5 * one - 0.6 * two + 0.1 * three;
    return CubicTerms{f.partials(s.v, state).F_psi + damping, -f.rate_partials(s.v, state).g_state,
                      b + damping, 2e-16 * std::abs(steady(s.v)) / e};
  });
}

Scene one_block(const FrictionParameters& p, double v, double m, double k0, double zeta) {
  Scene s;
  s.form = Form::chain;
  s.delta = 0;
  s.order = 2;
  s.n = 1;
  s.length = 1;
  s.left = s.right = End::free;
  s.friction = p;
  s.v = v;
  s.m = m;
  s.k0 = k0;
  s.zeta = zeta;
  return s;
}

}  // namespace

TEST_CASE("friction and state rates: derivatives agree with differences, law by law", "[serial][every_law]") {
  for_every_friction([](const FrictionParameters& p) {
    with_friction(p, [&](const Friction& f) {
      for (const double psi : velocities)
        for (const double s : states) {
          if (!p.state->logarithmic && s < 0) continue;  // a strength
          if (!p.law->only_for.empty() && psi < 0) continue;  // psi > 0
          INFO(name_of(p) << " at psi = " << psi << ", state = " << s);
          // Steps that do not reach psi = 0, where exact laws jump; regularised ones bend over eps.
          const double e = 1e-4 * std::min(std::abs(psi), p.regularised ? p.eps : 1e300);
          const Partials d = f.partials(psi, s);
          CHECK(d.F == f.force(psi, s));
          // F is a product or a logarithm of well-conditioned factors: some units in the last place of its
          // terms (friction_mu0 and friction_b: of rate-and-state, 0 for other laws)
          const double of_logarithm = p.value("friction_mu0") + p.value("friction_b") * std::abs(s);
          const double noise = 2e-15 * (std::abs(d.F) + of_logarithm);
          check_derivative(d.F_psi, central([&](double x) { return f.force(x, s); }, psi, e, noise), "F_psi");
          if (f.has_state) {
            const RatePartials g = f.rate_partials(psi, s);
            CHECK(g.g == f.rate(psi, s));
            const double terms =
                std::abs(g.g) + std::abs(g.g_psi * psi) + std::abs(g.g_state) * (1 + std::abs(s));
            check_derivative(d.F_state, central([&](double x) { return f.force(psi, x); }, s, 1e-3, noise),
                             "F_state");
            check_derivative(g.g_psi, central([&](double x) { return f.rate(x, s); }, psi, e, 2e-15 * terms),
                             "g_psi");
            check_derivative(g.g_state,
                             central([&](double x) { return f.rate(psi, x); }, s, 1e-3, 2e-15 * terms),
                             "g_state");
          }
        }
    });
  });
}

TEST_CASE("higher derivatives of friction and state rates agree with differences, law by law",
          "[serial][every_law]") {
  for_every_friction([](const FrictionParameters& p) {
    with_friction(p, [&](const Friction& f) {
      for (const double psi : velocities)
        for (const double s : states) {
          if (!p.state->logarithmic && s < 0) continue;  // a strength
          if (!p.law->only_for.empty() && psi < 0) continue;  // psi > 0
          INFO(name_of(p) << " at psi = " << psi << ", state = " << s);
          const double e = 1e-4 * std::min(std::abs(psi), p.regularised ? p.eps : 1e300), e_state = 1e-3;
          const HigherPartials d = f.higher_partials(psi, s);
          const Partials F = f.partials(psi, s);
          const RatePartials g = f.rate_partials(psi, s);
          // A derivative in psi brings 1/psi (1/eps), one in the logarithm of age 1; each is a sum of such
          // terms.
          const double per_psi = 1 / (1e4 * e),
                       of_logarithm = p.value("friction_mu0") + p.value("friction_b") * 23;
          const auto noise = [&](double scale, int order) {
            return 1e-14 * scale * std::pow(per_psi, order);
          };
          const double in_F =
              std::abs(F.F) + std::abs(F.F_psi) / per_psi + std::abs(F.F_state) * (1 + of_logarithm);
          const double in_g =
              std::abs(g.g) + std::abs(g.g_psi) / per_psi + std::abs(g.g_state) * (1 + std::abs(s));
          const auto by_psi = [&](double value, const std::function<double(double, double)>& lower,
                                  double scale, int order, const char* what) {
            check_derivative(
                value, central([&](double x) { return lower(x, s); }, psi, e, noise(scale, order)), what);
          };
          const auto by_state = [&](double value, const std::function<double(double, double)>& lower,
                                    double scale, const char* what) {
            check_derivative(
                value, central([&](double x) { return lower(psi, x); }, s, e_state, noise(scale, 0)), what);
          };
          using Of = HigherPartials;
          const auto higher = [&](HigherDerivatives Of::*of, double HigherDerivatives::*member) {
            return [&f, of, member](double x, double y) { return f.higher_partials(x, y).*of.*member; };
          };
          using D = HigherDerivatives;
          by_psi(
              d.F.pp, [&](double x, double y) { return f.partials(x, y).F_psi; }, in_F, 1, "F_pp");
          by_psi(
              d.F.ps, [&](double x, double y) { return f.partials(x, y).F_state; }, in_F, 0, "F_ps");
          by_psi(d.F.ppp, higher(&Of::F, &D::pp), in_F, 2, "F_ppp");
          by_psi(d.F.pps, higher(&Of::F, &D::ps), in_F, 1, "F_pps");
          by_psi(d.F.pss, higher(&Of::F, &D::ss), in_F, 0, "F_pss");
          by_psi(
              d.g.pp, [&](double x, double y) { return f.rate_partials(x, y).g_psi; }, in_g, 1, "g_pp");
          by_psi(
              d.g.ps, [&](double x, double y) { return f.rate_partials(x, y).g_state; }, in_g, 0, "g_ps");
          by_psi(d.g.ppp, higher(&Of::g, &D::pp), in_g, 2, "g_ppp");
          by_psi(d.g.pps, higher(&Of::g, &D::ps), in_g, 1, "g_pps");
          by_psi(d.g.pss, higher(&Of::g, &D::ss), in_g, 0, "g_pss");
          if (!f.has_state) continue;
          by_state(
              d.F.ss, [&](double x, double y) { return f.partials(x, y).F_state; }, in_F, "F_ss");
          by_state(d.F.sss, higher(&Of::F, &D::ss), in_F, "F_sss");
          by_state(
              d.g.ss, [&](double x, double y) { return f.rate_partials(x, y).g_state; }, in_g, "g_ss");
          by_state(d.g.sss, higher(&Of::g, &D::ss), in_g, "g_sss");
        }
    });
  });
}

TEST_CASE("the state rate vanishes at the steady state and pulls towards it", "[serial][every_law]") {
  for_every_friction([](const FrictionParameters& p) {
    if (has_no_steady_state(p)) return;
    with_friction(p, [&](const Friction& f) {
      for (const double psi : velocities) {
        INFO(name_of(p) << " at psi = " << psi);
        const double s = f.steady_state(psi);
        const RatePartials g = f.rate_partials(psi, s);
        CHECK(std::abs(g.g) <= 1e-14 * std::abs(g.g_state) * (1 + std::abs(s)));
        CHECK(g.g_state < 0);
        CHECK(f.rate(psi, s + 1e-3) < 0);
        CHECK(f.rate(psi, s - 1e-3) > 0);
        CHECK(state_from_output(p.state, state_to_output(p.state, s)) == Approx(s).epsilon(1e-14));
      }
    });
  });
}

TEST_CASE("steady states and steady friction are those of the model", "[serial]") {
  // Written out anew from the equations; friction as a function of velocity over ten decades.
  for (const double v : {1e-8, 1e-6, 1e-3, 0.2, 5., 100.}) {
    FrictionParameters p;
    p.law = Law("carlson-langer");
    p.state = StateLaw("healing");
    p.values["state_t_h"] = 3;
    p.values["state_tau_inf"] = 1.8;
    p.values["state_D"] = 0.4;
    const double tau = (1.8 / 3 + v / 0.4) / (1. / 3 + v / 0.4);
    with_friction(p, [&](const Friction& f) {
      CHECK(f.steady_state(v) == Approx(tau).epsilon(1e-14));
      CHECK(f.force(-v, f.steady_state(-v)) == Approx(-tau / (1 + v)).epsilon(1e-14));
    });
    p.state = StateLaw("contact-age");
    p.values["state_b"] = 0.3;
    p.values["state_theta0"] = 0.01;
    with_friction(p, [&](const Friction& f) {
      const double F = (1 + 0.3 * std::log(1 + 0.4 / v / 0.01)) / (1 + v);
      CHECK(f.force(v, f.steady_state(v)) == Approx(F).epsilon(1e-13));
    });
    p.law = Law("rate-and-state");
    p.values["friction_a"] = 0.01;
    p.values["friction_b"] = 0.015;
    p.values["friction_psi0"] = 1e-3;
    p.values["friction_D"] = 0.3;
    for (const StateLaw state : {StateLaw("ageing"), StateLaw("slip")}) {
      p.state = state;
      with_friction(p, [&](const Friction& f) {
        // asinh(q) = ln(2 q) + 1/(4 q^2): q > e^40 here
        CHECK(f.force(v, f.steady_state(v)) ==
              Approx(0.6 + (0.01 - 0.015) * std::log(v / 1e-3)).epsilon(1e-13));
        // the direct effect: a jump of velocity by e at fixed state raises F by a
        CHECK(f.force(v * std::exp(1.), f.steady_state(v)) - f.force(v, f.steady_state(v)) ==
              Approx(0.01).margin(1e-14));
        // and after a jump of theta by e, b
        CHECK(f.force(v, f.steady_state(v) + 1) - f.force(v, f.steady_state(v)) ==
              Approx(0.015).margin(1e-14));
      });
    }
  }
}

TEST_CASE("rate-and-state friction is odd, monotone and finite over every velocity", "[serial]") {
  FrictionParameters p;
  p.law = Law("rate-and-state");
  p.state = StateLaw("ageing");
  for (const double a : {1e-4, 0.01, 0.05, 1.}) {
    p.values["friction_a"] = a;
    with_friction(p, [&](const Friction& f) {
      for (const double s : states) {
        CHECK(f.force(0, s) == 0);
        CHECK(std::isfinite(f.partials(0, s).F_psi));
        double before = 0;
        for (double log_psi = -320; log_psi < 3; log_psi += 0.25) {
          const double psi = std::pow(10, log_psi);
          if (psi == 0) continue;
          const double F = f.force(psi, s);
          CHECK(std::isfinite(F));
          CHECK(F >= before);
          CHECK(f.force(-psi, s) == -F);
          before = F;
        }
      }
    });
  }
}

TEST_CASE("Newton's steps of rate-and-state friction converge from anywhere", "[serial]") {
  // mass psi + F(psi) = given, the equation of an implicit stage: ten decades of mass, solutions of either
  // sign over thirty decades, starts as far off. Newton's steps alone leave for infinity there.
  FrictionParameters p;
  p.law = Law("rate-and-state");
  p.state = StateLaw("ageing");
  for (const double a : {0.01, 0.05, 0.3}) {
    p.values["friction_a"] = a;
    with_friction(p, [&](const Friction& f) {
      if (f.steep) {
        int most = 0;
        for (const double mass : {1e-3, 1., 1e3, 1e7})
          for (const double sought : {-1., 1e-30, 1e-20, 1e-12, 1e-6, 0.1, 10.})
            for (const double start : {-10., -1e-9, 0., 1e-25, 1e-15, 1e-7, 1e-3, 1., 100.}) {
              const double given = mass * sought + f.force(sought, 0.7);
              double psi = start;
              int count = 0;
              for (; count < 60; ++count) {
                const Partials d = f.partials(psi, 0.7);
                const double step = (given - mass * psi - d.F) / (mass + d.F_psi);
                const double next = f.newton_psi(psi, 0.7, psi + step, 0.7, mass);
                const bool done = std::abs(next - psi) <= 1e-12 * std::abs(next);
                psi = next;
                if (done) break;
              }
              INFO("a " << a << " mass " << mass << " sought " << sought << " start " << start << " found "
                        << psi);
              // the force is good to 1e-15, so psi to 1e-15 |F|/(psi F_psi + mass psi)
              const Partials d = f.partials(sought, 0.7);
              CHECK(std::abs(psi - sought) <=
                    1e-11 * std::abs(sought) + 1e-14 * std::abs(given) / (mass + d.F_psi));
              most = std::max(most, count);
            }
        INFO("a " << a << ": at most " << most << " steps");
        CHECK(most <= 25);
      }
    });
  }
}

TEST_CASE("laws that give a velocity for a force give the one that has it", "[serial]") {
  // F = a y over velocities of forty decades and both signs; slopes against differences
  for (const char* law : {"rate-and-state", "n-shaped", "dieterich"})
    for (const char* state : {"ageing", "slip", "ageing-cutoff", "prz"}) {
      FrictionParameters p;
      p.law = Law(law);
      p.state = StateLaw(state);
      p.values["friction_a"] = 0.01;
      const kernel::LawColumns columns = kernel::law_columns(p, false, {});
      REQUIRE(columns.velocities);
      const auto at = [&](double y, double s) {
        double psi, psi_y, psi_state, a, g;
        columns.velocities({&y, &s, nullptr, 1, 0}, {&psi, &psi_y, &psi_state, &a, &g});
        return std::array<double, 5>{psi, psi_y, psi_state, a, g};
      };
      const auto friction = Friction::of(p);
      for (const double psi : {-10., -1e-30, 0., 1e-40, 1e-20, 1e-6, 1., 100.}) {
        if (psi <= 0 && p.law->only_for[0]) continue;
        const double s = 0.7;
        double y;
        columns.force_over_a({&psi, &s, nullptr, 1, 0}, &y);
        const auto [found, by_y, by_state, a, g] = at(y, s);
        INFO(law << " " << state << " psi " << psi << " y " << y);
        // y has 16 digits, and so has psi but for the |y| that they stand for
        const double digits = 1e-15 * (2 + std::abs(y));
        CHECK(a == 0.01);
        CHECK(std::abs(a * y - friction->force(psi, s)) <= digits * a);
        CHECK(std::abs(found - psi) <= digits * (std::abs(psi) + by_y));
        CHECK(std::abs(g - friction->rate(found, s)) <= 1e-14 * (1 + std::abs(g)));
        const double h = 1e-4;
        const double of_y = (at(y + h, s)[0] - at(y - h, s)[0]) / (2 * h);
        const double of_state = (at(y, s + h)[0] - at(y, s - h)[0]) / (2 * h);
        CHECK(std::abs(of_y - by_y) <= 1e-6 * by_y);
        CHECK(std::abs(of_state - by_state) <= 1e-5 * (std::abs(by_state) + by_y));
      }
    }
}

TEST_CASE("thresholds of every law with every state law are those of the cubic", "[serial][every_law]") {
  // One block: where the rightmost eigenvalue of Model's own Jacobian crosses zero as the spring stiffens,
  // against K = -r b (1 + r/(A a)), to 1e-8; and no crossing where the cubic has none. Viscosity moves the
  // direct effect a from negative to positive; tau_inf below 1 gives strength that grows with velocity, so
  // that with a < 0 the spring must be soft.
  int with_positive_a = 0, with_negative_a = 0;
  for_every_friction([&](const FrictionParameters& base) {
    if (has_no_steady_state(base)) return;
    for (const double v : {0.15, 0.7, 1.9})
      for (const double zeta : {0., 0.35, 0.8})
        for (const double m : {0.02, 1.})
          for (const double tau_inf : {2., 0.2}) {
            if (base.state->name != "healing" && tau_inf != 2) continue;
            FrictionParameters p = base;
            p.values["state_tau_inf"] = tau_inf;
            const auto at = [&](double K) {
              const Scene s = one_block(p, v, m, K, zeta);
              return growth(eigenvalues(jacobian_at_sliding(s), 3));
            };
            const Scene s = one_block(p, v, m, 1, zeta);
            const CubicTerms c = cubic_terms(s);
            INFO(name_of(p) << " v " << v << " zeta " << zeta << " m " << m << " tau_inf " << tau_inf << " a "
                            << c.a << " r " << c.r << " b " << c.b);
            if (std::abs(c.b) < 1e-6 || std::abs(c.a) < 1e-6) continue;  // coulomb without viscosity: neutral
            const double K = -c.r * c.b * (1 + c.r / (s.A() * c.a));
            if (K > 1e-6 && c.a + c.r / s.A() > 0) {
              double low = 0.5 * K, high = 2 * K;
              const double grows_low = at(low), grows_high = at(high);
              // softer is unstable for a > 0, stiffer for a < 0
              CHECK((c.a > 0 ? grows_low > 0 && grows_high < 0 : grows_low < 0 && grows_high > 0));
              for (int i = 0; i < 36; ++i) {  // to 2e-11 of K
                const double middle = (low + high) / 2;
                ((at(middle) > 0) == (grows_low > 0) ? low : high) = middle;
              }
              CHECK(std::abs(low - K) <= (1e-8 + 2 * c.b_error / std::abs(c.b)) * K);
              (c.a > 0 ? with_positive_a : with_negative_a)++;
            } else {
              const bool stable = c.a > 0 && c.b > 0;
              for (const double stiffness : {1e-3, 0.1, 10.}) CHECK((at(stiffness) < 0) == stable);
            }
          }
  });
  const bool own_list = all_laws().size() > 3;  // the program's laws have a of either sign
  CHECK(with_positive_a + with_negative_a > 5);
  if (own_list) CHECK((with_positive_a > 10 && with_negative_a > 0));
}

TEST_CASE("every eigenvalue on a ring is a root of the cubic of its wave", "[serial][every_law]") {
  for_every_friction([](const FrictionParameters& p) {
    if (has_no_steady_state(p)) return;
    for (const Form form : {Form::continuum, Form::chain}) {
      Scene s;
      s.form = form;
      s.friction = p;
      s.v = 0.6;
      s.n = 9;
      s.order = form == Form::chain ? 2 : 6;
      s.length = form == Form::chain ? 9 : 4;
      s.zeta = 0.15;
      s.derived_sign = p.regularised;
      if (form == Form::chain) s.delta = 0;
      const CubicTerms c = cubic_terms(s);
      std::vector<Complex> found = eigenvalues(jacobian_at_sliding(s), int(s.n) * 3);
      for (PetscInt k = 0; k < s.n; ++k) {
        const double kappa2 =
            symbol(s.order, form == Form::chain ? 1 : s.h(), 2 * M_PI * double(k) / s.length);
        const double K = s.K0() + s.K1() * kappa2, A = s.A();
        // lambda^3 + A (a + r/A) lambda^2 + A (K + r b) lambda + A r K: companion matrix, column by column
        const std::vector<double> companion = {
            0, 1, 0, 0, 0, 1, -A * c.r * K, -A * (K + c.r * c.b), -A * c.a - c.r};
        for (const Complex& root : eigenvalues(companion, 3)) {
          auto nearest = std::min_element(
              found.begin(), found.end(),
              [&](const Complex& x, const Complex& y) { return std::abs(x - root) < std::abs(y - root); });
          INFO(name_of(p) << ", " << to_string(form) << ", wave " << k << ", " << root << " against "
                          << *nearest);
          // simple roots, apart by more than 1e-2: eigenvalues move by round-off of the matrix times some
          // hundreds
          CHECK(std::abs(*nearest - root) < 1e-9 * (1 + std::abs(root)));
          found.erase(nearest);
        }
      }
    }
  });
}

TEST_CASE("Rice and Ruina's critical stiffness with inertia", "[serial]") {
  for (const StateLaw law : {StateLaw("ageing"), StateLaw("slip")})
    for (const double mu0 : {0.6, 0.02})  // far from and near to the velocity at which asinh bends
      for (const double m : {0.001, 1., 50.})
        for (const double v : {1e-6, 0.01, 0.5}) {
          FrictionParameters p;
          p.law = Law("rate-and-state");
          p.state = law;
          const double a = p.values["friction_a"] = 0.01, b = p.values["friction_b"] = 0.016;
          const double D = p.values["friction_D"] = 0.02;
          p.values["friction_mu0"] = mu0;
          p.values["friction_psi0"] = 0.01;
          const Scene s = one_block(p, v, m, 1, 0);
          const double F = with_friction(p, [&](const Friction& f) { return f.force(v, f.steady_state(v)); });
          const double T = std::tanh(F / a), A = s.A();
          const double critical = (b - a) * T / D * (1 + v * v / (A * a * D * T));
          double low = critical / 2, high = critical * 2;
          const auto at = [&](double K) {
            return eigenvalues(jacobian_at_sliding(one_block(p, v, m, K, 0)), 3);
          };
          for (int i = 0; i < 60; ++i) {
            const double middle = (low + high) / 2;
            (growth(at(middle)) > 0 ? low : high) = middle;
          }
          INFO(to_string(law) << " mu0 " << mu0 << " m " << m << " v " << v);
          // eigenvalues are good to 1e-16 of the largest, A a/v, which sets how sharply the crossing shows
          const double largest = std::max({1., A * a / v, v / D});
          CHECK(low == Approx(critical).epsilon(std::max(1e-8, 1e-14 * largest / (v / D))));
          double frequency = 0;
          for (const Complex& z : at(critical)) frequency = std::max(frequency, z.imag());
          CHECK(frequency == Approx(v / D * std::sqrt((b - a) / a)).epsilon(1e-7));
        }
}

TEST_CASE("Erickson's Hopf point and line", "[serial]") {
  // epsilon = (b - a)/a, xi = K0 D/a, g^2 = A K0 D^2/v^2, c^2 k^2 = A K1 kappa^2 D^2/v^2
  const double g = 0.8, xi = 0.5;
  const auto scene = [&](double epsilon, double c2k2) {
    FrictionParameters p;
    p.law = Law("rate-and-state");
    p.state = StateLaw("slip");
    p.values["friction_a"] = 0.01;
    p.values["friction_b"] = p.value("friction_a") * (1 + epsilon);
    p.values["friction_D"] = 1;
    const double K0 = xi * p.value("friction_a"), A = g * g / K0;
    return one_block(p, 1, 1 / A, K0 + c2k2 / A, 0);  // the wave's K in the place of K0
  };
  const auto hopf = [&](double c2k2) {
    double low = 0, high = 3;
    for (int i = 0; i < 60; ++i) {
      const double middle = (low + high) / 2;
      (growth(eigenvalues(jacobian_at_sliding(scene(middle, c2k2)), 3)) < 0 ? low : high) = middle;
    }
    return low;
  };
  CHECK(hopf(0) == Approx(g * g * xi / (g * g + xi)).epsilon(1e-8));
  CHECK(hopf(0) == Approx(0.280702).margin(5e-7));
  for (const double c2k2 : {0.1, 0.5, 2.})
    CHECK(hopf(c2k2) == Approx((g * g + c2k2) / (1 + g * g / xi)).epsilon(1e-8));
}
