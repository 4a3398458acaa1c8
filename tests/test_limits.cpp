// Where methods fail: the limits of `chart_kind limits` against stability functions known from tableaus and
// characteristic polynomials, and each failure beside what the program says of it.
// tests/command_line/test_limits.py has the same from the command line.
#include <algorithm>
#include <cmath>

#include "catch.hpp"
#include "shared.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/study/chart.hpp"
#include "study/simulate.hpp"
#include "study/step_audit.hpp"

using namespace stickslip;

namespace {

// Undamped sliding at v (stable waves of real part -gamma (v^2 - 1)/2 by friction).
Scene sliding_scene(double v) {
  Scene s;
  s.n = 32;
  s.length = 8;
  s.delta = 0;
  s.v = v;
  return s;
}

VecHandle uniform(const Model& model, double psi, double eta) {
  VecHandle u = model.create_vector();
  double* a;
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    a[2 * i] = psi;
    a[2 * i + 1] = eta;
  }
  SS_TRY(VecRestoreArray(u, &a));
  return u;
}
double first_psi(Vec u) {
  const double* a;
  SS_TRY(VecGetArrayRead(u, &a));
  const double psi = a[0];
  SS_TRY(VecRestoreArrayRead(u, &a));
  return psi;
}
double cubic(double psi) { return psi * psi * psi / 3 - psi; }

template <class Use>
void with_forecast(const Scene& scene, const Settings& method, const Use& use) {
  const InDatabase given(method);
  const Model model(PETSC_COMM_WORLD, scene);
  VecHandle u = uniform(model, scene.v, cubic(scene.v));
  const Integrator integrator(model, MethodSpec::from(given.options), u);
  StepForecast forecast(model, u, integrator);
  use(forecast, model, integrator);
}

// |R(z)| of a Runge-Kutta method of PETSc from its tableau: R = 1 + z b (1 - z A)^-1 e.
double tableau_modulus(const char* subtype, Complex z) {
  TsHandle ts;
  SS_TRY(TSCreate(PETSC_COMM_SELF, ts.out()));
  SS_TRY(TSSetType(ts, TSRK));
  SS_TRY(TSRKSetType(ts, subtype));
  PetscInt stages, p;
  const PetscReal *A, *b, *c, *embedded, *interpolating;
  PetscBool fsal;
  SS_TRY(TSRKGetTableau(ts, &stages, &A, &b, &c, &embedded, &p, &interpolating, &fsal));
  std::vector<Complex> k(static_cast<std::size_t>(stages));
  Complex R = 1;
  for (PetscInt i = 0; i < stages; ++i) {
    Complex stage = 1;
    for (PetscInt j = 0; j < i; ++j) stage += z * A[i * stages + j] * k[static_cast<std::size_t>(j)];
    k[static_cast<std::size_t>(i)] = stage;
    R += z * b[i] * stage;
  }
  return std::abs(R);
}

// lambda of waves about sliding of the continuum: lambda^2 + C lambda + A (K0 + K1 kappa^2) = 0.
Complex wave_eigenvalue(const Scene& s, double stiffness) {
  const double C = s.A() * (s.v * s.v - 1);
  return -C / 2 + std::sqrt(Complex(C * C / 4 - s.A() * stiffness));
}

bool told(const std::string& text, std::size_t from = 0) {
  for (std::size_t i = from; i < warnings().size(); ++i)
    if (warnings()[i].find(text) != std::string::npos) return true;
  return false;
}

}  // namespace

TEST_CASE("explicit limits are those of the tableau's stability function", "[limits]") {
  for (const char* subtype : {"3bs", "5dp", "4", "5f", "8vr"}) {
    const Scene s = sliding_scene(1.1);
    with_forecast(
        s, {{"ts_type", "rk"}, {"ts_rk_type", subtype}, {"ts_adapt_type", "none"}, {"ts_dt", "0.01"}},
        [&](StepForecast& forecast, const Model& model, const Integrator& integrator) {
          const double omega = model.wave_frequency();
          const Complex lambda = wave_eigenvalue(s, omega * omega / s.A());
          for (const double y : {0.3, 1., 2., 2.8, 3.5, 4.5}) {
            const double dt = y / omega;
            const double expected = std::log(tableau_modulus(integrator.method().subtype, dt * lambda)) / dt;
            INFO("rk:" << subtype << " at omega dt = " << y);
            CHECK(forecast.shortest_wave_excess(dt) == Approx(expected - lambda.real()).margin(1e-9 * omega));
          }
        });
  }
}

TEST_CASE("leapfrog is stable up to 2 over the frequency of the neighbours' pull", "[limits][leapfrog]") {
  // One step of psi_t = A eta - C psi, eta_t = -K psi with K = K0 + K1 kappa^2: half a kick by K1 kappa^2,
  // the midpoint rule for the rest, half a kick. Its trace and determinant, with x = dt C/2, y = A K0 dt^2/4,
  // z = A K1 kappa^2 dt^2/4: d = 1 + x + y, trace = 2 (1 - y - 2 z)/d, determinant (1 - x + y)/d. Without
  // friction (C = 0) the roots leave the unit circle where trace = -2: at z = 1, whatever K0.
  for (const double v : {1., 1.1, 0.9}) {
    const Scene s = sliding_scene(v);
    with_forecast(
        s, {{"ts_type", "leapfrog"}, {"ts_dt", "0.01"}},
        [&](StepForecast& forecast, const Model& model, const Integrator&) {
          const double omega = model.wave_frequency(), own = s.A() * s.K0(), C = s.A() * (v * v - 1);
          const Complex lambda = wave_eigenvalue(s, omega * omega / s.A());
          for (const double part : {0.2, 0.9, 0.999, 1.001, 1.1, 3.}) {
            const double dt = part * 2 / std::sqrt(omega * omega - own);
            const double x = dt * C / 2, y = own * dt * dt / 4, z = (omega * omega - own) * dt * dt / 4;
            const double d = 1 + x + y, half = (1 - y - 2 * z) / d, det = (1 - x + y) / d;
            const Complex root = std::sqrt(Complex(half * half - det));
            const double modulus = std::max(std::abs(half + root), std::abs(half - root));
            INFO("v " << v << " part " << part);
            CHECK(forecast.shortest_wave_excess(dt) ==
                  Approx(std::log(modulus) / dt - lambda.real()).margin(1e-7 * omega));
            if (v == 1) CHECK((forecast.shortest_wave_excess(dt) > 1e-3 * omega) == (part > 1));
          }
          CHECK(forecast.shift(0.1) == 20);
        });
  }
}

TEST_CASE("implicit methods hide an instability where their stability functions say", "[limits]") {
  // Waves whose eigenvalues are a complex pair alone: without coupling all alike, lambda = 0.15 +- 0.989 i.
  Scene s = sliding_scene(std::sqrt(0.9));
  s.c = 0;
  const Complex lambda = wave_eigenvalue(s, s.K0());
  const double euler = 2 * lambda.real() / std::norm(lambda);
  const auto growth = [&](const Settings& method, double dt) {
    double rate = 0;
    with_forecast(s, method, [&](StepForecast& f, const Model&, const Integrator&) {
      rate = f.sliding_growth({{dt, 1.}}).resolved;
    });
    return rate;
  };
  const Settings beuler = {{"ts_type", "beuler"}, {"ts_dt", "0.1"}};
  CHECK(growth(beuler, euler * (1 - 1e-9)) > 0);
  CHECK(growth(beuler, euler * (1 + 1e-9)) < 0);
  for (const double dt : {0.1, 1., 10.}) {
    // |R| of the trapezoidal rule exceeds 1 exactly where Re lambda > 0
    const double cn = std::log(std::abs((1. + dt * lambda / 2.) / (1. - dt * lambda / 2.))) / dt;
    CHECK(growth({{"ts_type", "cn"}, {"ts_dt", "0.1"}}, dt) == Approx(cn).epsilon(1e-9));
    CHECK(growth({{"ts_type", "alpha"}, {"ts_alpha_radius", "1"}, {"ts_dt", "0.1"}}, dt) ==
          Approx(cn).epsilon(1e-7));
    // BDF 2: (3/2 - z) mu^2 - 2 mu + 1/2 = 0
    const Complex z = dt * lambda, root = std::sqrt(4. - 2. * (1.5 - z));
    const double largest =
        std::max(std::abs((2. + root) / (3. - 2. * z)), std::abs((2. - root) / (3. - 2. * z)));
    CHECK(growth({{"ts_type", "bdf"}, {"ts_adapt_type", "none"}, {"ts_dt", "0.1"}}, dt) ==
          Approx(std::log(largest) / dt).epsilon(1e-9));
  }
}

// On one rank: the false wave grows out of round-off, which is another where ranks of few nodes take PETSc's
// own rk; with rk:3bs, which grows slowly beyond its limit, that moves what the bisection finds by a tenth.
TEST_CASE("limits found by bisection of runs are those of theory", "[limits][serial]") {
  const Options options = Options::from("chart", {{"model_delta", "0", ""},
                                                  {"model_v", "0.9", ""},
                                                  {"grid_n", "32", ""},
                                                  {"grid_length", "10", ""},
                                                  {"init_type", "sine", ""},
                                                  {"ts_max_time", "30", ""}});
  Limits limits(options);
  const auto row = [&](const char* name) { return limits.row(MethodSpec::parse("chart_methods", name)); };
  for (const char* name : {"rk:3bs", "rk:4", "arkimex:4:friction", "bdf:4", "leapfrog"}) {
    const LimitRow r = row(name);
    INFO(name);
    CHECK(r.warned);
    CHECK((r.shortest && r.shortest_theory));
    // 2 % from each bisection; more where round-off has a say, see above
    const double margin = std::string(name) == "rk:3bs" ? 0.15 : 0.04;
    if (r.shortest && r.shortest_theory) CHECK(*r.shortest == Approx(*r.shortest_theory).epsilon(margin));
  }
  for (const char* name : {"beuler", "bdf:2", "rosw:ra34pw2", "arkimex:4:both"}) {
    const LimitRow r = row(name);
    INFO(name);
    CHECK(r.warned);
    CHECK((r.damps && r.damps_theory));
    if (r.damps && r.damps_theory) CHECK(*r.damps == Approx(*r.damps_theory).epsilon(0.04));
  }
  CHECK_FALSE(row("cn").damps_theory);  // the trapezoidal rule hides nothing
  const LimitRow classical = row("rk:4");
  CHECK(classical.how == "blow-up");
  CHECK((classical.limit && classical.theory && *classical.limit > 0.5 * *classical.theory &&
         *classical.limit < 2 * *classical.theory));
}

TEST_CASE("what a step misses falls with the order of the method", "[limits]") {
  // local error over change: dt^order
  const auto miss = [](const Settings& method, double dt) {
    Settings all = method;
    all.push_back({"ts_dt", number_text(dt)});
    const InDatabase given(all);
    Scene s = sliding_scene(0.5);
    const Model model(PETSC_COMM_WORLD, s);
    VecHandle u = uniform(model, 0.3, 0.1);
    Integrator integrator(model, MethodSpec::from(given.options), u);
    StepAudit audit(model, given.options, integrator, 0, 2);
    simulate(integrator, u, {0, 2}, {&audit});
    const StepAudit::Verdict v = audit.verdict(u);
    CHECK(v.repeated >= 16);
    CHECK(v.beyond == 0);
    return v.miss.value_or(NAN);
  };
  for (const auto& [method, order] :
       {std::pair(Settings{{"ts_type", "beuler"}}, 1), std::pair(Settings{{"ts_type", "cn"}}, 2),
        std::pair(Settings{{"ts_type", "rk"}, {"ts_rk_type", "3"}}, 3)}) {
    const double ratio = miss(method, 0.1) / miss(method, 0.05);
    INFO(method[0].second);
    CHECK(std::log2(ratio) == Approx(order).margin(0.35));
  }
}

TEST_CASE("a long step of backward Euler finds a root that the motion does not lead to, and it is told",
          "[limits]") {
  // One step of a uniform motion: eta = eta0 + dt K0 (v - psi), psi - psi0 = dt A (eta - psi^3/3 + psi).
  const Scene s = sliding_scene(0.2);
  const double psi0 = 0.5, eta0 = -0.245;
  const auto residual = [&](double psi, double dt) {
    return psi - psi0 - dt * s.A() * (eta0 + dt * s.K0() * (s.v - psi) - cubic(psi));
  };
  const auto roots = [&](double dt) {
    std::vector<double> found;
    for (double a = -4; a < 4; a += 1e-3) {
      if ((residual(a, dt) < 0) == (residual(a + 1e-3, dt) < 0)) continue;
      double low = a, high = a + 1e-3;
      for (int i = 0; i < 60; ++i) {
        const double middle = (low + high) / 2;
        ((residual(middle, dt) < 0) == (residual(low, dt) < 0) ? low : high) = middle;
      }
      found.push_back((low + high) / 2);
    }
    return found;
  };
  // The bound: dt^2 A K0 - dt A + 1 = 0 has the roots 0.382 and 2.618 at gamma = 3.
  CHECK(roots(0.37).size() == 1);
  const double dt = 0.9;
  const std::vector<double> all = roots(dt);
  CHECK(all.size() == 3);

  const auto run = [&](const Settings& method) {
    const InDatabase given(method);
    const Model model(PETSC_COMM_WORLD, s);
    VecHandle u = uniform(model, psi0, eta0);
    Integrator integrator(model, MethodSpec::from(given.options), u);
    warn_of_steps(model, integrator, u, 3 * dt);
    integrator.advance(u, 0, 3 * dt, [](const Integrator::Step& step) {
      return step.t < 0.9 - 1e-9 ? Integrator::Verdict::go_on : Integrator::Verdict::stop;
    });
    return first_psi(u);
  };
  std::size_t before = warnings().size();
  const double landed = run({{"ts_type", "beuler"}, {"ts_dt", "0.9"}});
  CHECK(told("ts_dt 0.9 is so long that the implicit equations of beuler have several solutions", before));
  before = warnings().size();
  const double short_steps = run({{"ts_type", "beuler"}, {"ts_dt", "0.009"}});
  CHECK_FALSE(told("several solutions", before));
  // which of the roots is nearest to where the motion goes?
  const auto nearest = [&](double psi) {
    return std::min_element(all.begin(), all.end(),
                            [&](double a, double b) { return std::abs(a - psi) < std::abs(b - psi); }) -
           all.begin();
  };
  INFO("landed at " << landed << ", the motion at " << short_steps);
  CHECK(nearest(landed) != nearest(short_steps));
}

TEST_CASE("orders fall where friction is stiff, and it is told", "[limits][serial]") {
  // The slow branch of the relaxation oscillation at gamma = 300, psi from 2 downwards, where friction acts
  // at 900 per unit time; u stands on the branch to order 1/gamma^2.
  Scene s = sliding_scene(0.2);
  s.gamma = 300;
  s.n = 16;
  const auto end = [&](const Settings& method) {
    const InDatabase given(method);
    const Model model(PETSC_COMM_WORLD, s);
    VecHandle u = uniform(model, 2, 0.65);
    Integrator integrator(model, MethodSpec::from(given.options), u);
    warn_of_steps(model, integrator, u, 80);
    integrator.advance(u, 0, 80, nullptr);
    return first_psi(u);
  };
  const double exact =
      end({{"ts_type", "arkimex"}, {"imex_implicit", "both"}, {"ts_rtol", "1e-11"}, {"ts_atol", "1e-11"}});
  const auto order = [&](Settings method) {
    method.push_back({"ts_adapt_type", "none"});
    method.push_back({"ts_dt", "2"});
    const double coarse = std::abs(end(method) - exact);
    method.back().second = "1";
    return std::log2(coarse / std::abs(end(method) - exact));
  };
  struct Case {
    Settings method;
    int order;
    double low, high;  // of the order measured
    bool falls;
  };
  for (const Case& c : std::vector<Case>{
           {{{"ts_type", "arkimex"}, {"ts_arkimex_type", "4"}, {"imex_implicit", "both"}}, 4, 0.8, 1.5, true},
           {{{"ts_type", "arkimex"}, {"ts_arkimex_type", "5"}, {"imex_implicit", "both"}}, 5, 0.5, 1.5, true},
           {{{"ts_type", "rosw"}, {"ts_rosw_type", "ra34pw2"}}, 3, 0.3, 1.6, true},
           {{{"ts_type", "rosw"}, {"ts_rosw_type", "4l"}}, 4, 1.8, 2.2, true},
           {{{"ts_type", "theta"}}, 2, -0.5, 1, true},
           {{{"ts_type", "arkimex"}, {"ts_arkimex_type", "l2"}, {"imex_implicit", "both"}},
            2,
            1.8,
            2.2,
            false},
           {{{"ts_type", "bdf"}, {"ts_bdf_order", "2"}}, 2, 1.8, 2.2, false}}) {
    const std::size_t before = warnings().size();
    const double measured = order(c.method);
    INFO(c.method[0].second << " " << c.method.back().second << ": order " << measured);
    CHECK(measured > c.low);
    CHECK(measured < c.high);
    CHECK(told("falls from " + std::to_string(c.order) + " to 2, 1 or less", before) == c.falls);
  }
}
