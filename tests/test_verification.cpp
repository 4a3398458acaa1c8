// Space and the whole scheme against independent solutions: stencils and ends, dispersion, damping
// identities, uniform motion, travelling waves.
#include <cmath>
#include <complex>
#include <functional>

#include "catch.hpp"
#include "shared.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/output/displacement.hpp"

using namespace stickslip;

namespace {

using Node = std::array<double, 2>;  // psi, eta
using Start = std::function<Node(double x)>;

const Settings strict = {
    {"ts_type", "rk"}, {"ts_rk_type", "8vr"}, {"ts_rtol", "1e-12"}, {"ts_atol", "1e-12"}};

// psi and eta of every node at time t.
Fields advance(const Scene& scene, const Start& start, double t, const Settings& settings = strict) {
  return ended(scene, settings, t, [&](PetscInt node, double* at) {
    const Node p = start(scene.x(node));
    std::copy(p.begin(), p.end(), at);
  });
}

enum class Ends { ring, free, held };

Scene with_ends(Ends ends, int order, PetscInt n, double length) {
  Scene s;
  s.order = order;
  s.n = n;
  s.length = length;
  s.left = ends == Ends::ring ? End::periodic : ends == Ends::free ? End::free : End::velocity;
  s.right = ends == Ends::ring ? End::periodic : End::free;
  return s;
}

bool held(const Scene& s, PetscInt i) {
  return (i == 0 && s.left == End::velocity) || (i == s.n - 1 && s.right == End::velocity);
}

// D2 as a matrix, row by row; none of held nodes.
std::vector<double> second_difference(const Scene& s) {
  std::vector<double> D(s.n * s.n);
  for (PetscInt i = 0; i < s.n; ++i)
    if (!held(s, i))
      for (const auto& [node, weight] : second_difference_row(s, i)) D[i * s.n + node] += weight;
  return D;
}

// Largest error of the solution of psi - D2 psi = g, held ends given, for the psi that the functions state.
double elliptic_error(const Scene& s, double (*psi)(double), double (*psi_xx)(double)) {
  std::vector<double> a = second_difference(s), b;
  for (double& entry : a) entry = -entry;
  for (PetscInt i = 0; i < s.n; ++i) {
    a[i * (s.n + 1)] += 1;
    b.push_back(psi(s.x(i)) - (held(s, i) ? 0 : psi_xx(s.x(i))));
  }
  CHECK(solve_dense(int(s.n), a.data(), 1, b.data()));
  double error = 0;
  for (PetscInt i = 0; i < s.n; ++i) error = std::max(error, std::abs(b[i] - psi(s.x(i))));
  return error;
}

// Eigenvalues of D2 without its held nodes.
std::vector<std::complex<double>> second_difference_eigenvalues(const Scene& s) {
  const std::vector<double> D = second_difference(s);
  std::vector<double> rest;
  int count = 0;
  for (PetscInt i = 0; i < s.n; ++i) {
    if (held(s, i)) continue;
    ++count;
    for (PetscInt j = 0; j < s.n; ++j)
      if (!held(s, j)) rest.push_back(D[i * s.n + j]);
  }
  return eigenvalues(count, rest);
}

double wavy(double x) { return std::cos(1.1 * (x - 2)) + 0.3 * std::cos(2.3 * (x - 2)); }  // even about x = 2
double wavy_xx(double x) { return -1.21 * std::cos(1.1 * (x - 2)) - 0.3 * 5.29 * std::cos(2.3 * (x - 2)); }
double even(double x) { return std::cos(M_PI * x / 2) + 0.5 * std::cos(M_PI * x); }  // about 0 and 2
double even_xx(double x) { return -M_PI * M_PI * (0.25 * std::cos(M_PI * x / 2) + 0.5 * std::cos(M_PI * x)); }
double turning(double x) { return std::sin(M_PI * x) + 0.5 * std::cos(2 * M_PI * x); }
double turning_xx(double x) { return -M_PI * M_PI * (std::sin(M_PI * x) + 2 * std::cos(2 * M_PI * x)); }

const std::vector<std::pair<const char*, Ends>> all_ends = {
    {"ring", Ends::ring}, {"free", Ends::free}, {"held", Ends::held}};

}  // namespace

TEST_CASE("D2 reaches its order with every end", "[space][serial]") {
  for (const auto& [name, ends] : all_ends)
    for (const int order : {2, 4, 6, 8}) {
      if (ends == Ends::held && order == 8) continue;
      const auto error = [&, e = ends](PetscInt cells) {
        const Scene s = with_ends(e, order, e == Ends::ring ? cells : cells + 1, 2);
        if (e == Ends::ring) return elliptic_error(s, turning, turning_xx);
        return e == Ends::free ? elliptic_error(s, even, even_xx) : elliptic_error(s, wavy, wavy_xx);
      };
      const double measured = std::log2(error(24) / error(48));
      INFO(name << " order " << order << ": " << measured);
      CHECK(measured > order - 0.3);
      if (ends != Ends::held) CHECK(measured < order + 0.3);
    }
}

TEST_CASE("a run reaches the order of its stencil with every end", "[space]") {
  // At v = 0 the cubic system is odd in (psi, eta): sin(pi x/2 l) on a ring of 4 l stays odd about 0 and even
  // about l. So a part of the ring, held at 0 or free, has the same smooth solution, which fits its ends to
  // all orders.
  const double l = 1.5, t = 1;
  const auto scene = [&](Ends ends, int order, PetscInt cells_per_l) {
    Scene s = ends == Ends::ring   ? with_ends(ends, order, 4 * cells_per_l, 4 * l)
              : ends == Ends::free ? with_ends(ends, order, 2 * cells_per_l + 1, 2 * l)
                                   : with_ends(ends, order, cells_per_l + 1, l);
    s.v = 0;
    s.left_value = 0;
    return s;
  };
  const auto start = [&](double origin) {
    return [=](double x) {
      const double wave = std::sin(M_PI * (x - origin) / (2 * l));
      return Node{0.8 * wave, 0.3 * wave};
    };
  };
  const Fields reference = advance(scene(Ends::ring, 8, 256), start(0), t);
  for (const auto& [name, ends] : all_ends)
    for (const int order : {2, 4, 6, 8}) {
      if (ends == Ends::held && order == 8) continue;
      const auto error = [&, e = ends](PetscInt cells) {
        const Fields run = advance(scene(e, order, cells), start(e == Ends::free ? l : 0), t);
        double largest = 0;
        for (std::size_t i = 0; i < run.psi.size(); ++i) {
          if (e == Ends::held && i == 0) continue;
          // free: x from -l, which is 3 l on the ring
          const std::size_t node = (i + (e == Ends::free ? 3 * cells : 0)) * (256 / cells) % 1024;
          largest = std::max({largest, std::abs(run.psi[i] - reference.psi[node]),
                              std::abs(run.eta[i] - reference.eta[node])});
        }
        return largest;
      };
      const PetscInt coarse = order <= 4 ? 16 : 32;  // where the order shows
      const double measured = std::log2(error(coarse) / error(2 * coarse));
      INFO(name << " order " << order << ": " << measured);
      CHECK(measured > order - 0.4);
    }
}

TEST_CASE("the semi-discrete wave operator has no growing mode of its own", "[space][serial]") {
  // psi_t = A eta, eta_t = K1 D2 psi: lambda^2 = c^2 mu. No growth where mu is real and not positive.
  for (const auto& [name, ends] : all_ends)
    for (const int order : {2, 4, 6, 8})
      for (const PetscInt n : {12, 23, 40}) {
        const Scene s = with_ends(ends, order, n, 1);
        const double scale = largest_symbol(order, s.h());
        double worst_imaginary = 0, worst_real = -HUGE_VAL, largest = 0;
        for (const auto& mu : second_difference_eigenvalues(s)) {
          worst_imaginary = std::max(worst_imaginary, std::abs(mu.imag()));
          worst_real = std::max(worst_real, mu.real());
          largest = std::max(largest, std::abs(mu));
        }
        INFO(name << " order " << order << " n " << n << ": " << worst_imaginary / scale);
        if (ends == Ends::held && order == 8) {
          CHECK(worst_imaginary > 1e-3 * scale);  // why order 8 with a held end is refused
        } else {
          // QR on a matrix that is not normal: round-off times n and its departure from normality
          CHECK(worst_imaginary < 1e-10 * scale);
          CHECK(worst_real < 1e-10 * scale);
          CHECK(largest < scale * (1 + 1e-10));
        }
      }
}

TEST_CASE("small waves follow the dispersion relation, with either sign of delta", "[space]") {
  // psi = v + e Re(p exp(ikx)): lambda^2 + C lambda + A (K0 + K1 kappa^2) = 0. Started with eta' = 0
  // deviation, so that psi' has the solution of that oscillator with psi(0) = 1, psi_t(0) = -A (B + phi').
  const double e = 1e-6, t = 3;
  for (const bool derived : {true, false})
    for (const int order : {2, 4, 6, 8})
      for (const int mode : {1, 9}) {
        Scene s = with_ends(Ends::ring, order, 24, 10);
        s.v = 1;  // between the two thresholds: derived decays at 0.1, printed grows at 0.1
        s.derived_sign = derived;
        const double k = 2 * M_PI * mode / s.length, slope = s.v * s.v - 1;
        const Fields run = advance(
            s,
            [&](double x) {
              return Node{s.v + e * std::cos(k * x), std::pow(s.v, 3) / 3 - s.v};
            },
            t);
        const double C = s.A() * slope + s.s_delta(), K = s.A() * (s.K0() + s.K1() * symbol(order, s.h(), k));
        CHECK(C == Approx(derived ? 0.2 : -0.2).margin(1e-12));
        // psi_t(0) = -A phi' = 0 here
        const double w = std::sqrt(K - C * C / 4);
        const double expected = std::exp(-C * t / 2) * (std::cos(w * t) + C / 2 / w * std::sin(w * t));
        // nonlinear terms are of relative size e, the integration of 1e-12/e
        CHECK((run.psi[0] - s.v) / e == Approx(expected).margin(3e-5));
      }
}

TEST_CASE("modes of a chain with free ends", "[space]") {
  const double e = 1e-6, t = 2;
  Scene s;
  s.form = Form::chain;
  s.order = 2;
  s.n = 11;
  s.length = 10;
  s.left = s.right = End::free;
  s.v = 1;
  s.k1 = 2;
  s.zeta = 0.3;
  for (const int mode : {0, 1, 7, 10}) {
    const double q = M_PI * mode / double(s.n), C = s.A() * s.B();
    const Fields run = advance(
        s,
        [&](double x) {
          return Node{s.v + e * std::cos(q * (x + 0.5)), s.B() * s.v - 2. / 3};
        },
        t);
    const double w = std::sqrt((s.k0 + 4 * s.k1 * std::pow(std::sin(q / 2), 2)) / s.m - C * C / 4);
    // psi_t(0) = -C psi(0)
    const double expected = std::exp(-C * t / 2) * (std::cos(w * t) - C / 2 / w * std::sin(w * t));
    for (std::size_t i = 0; i < run.psi.size(); ++i)
      CHECK((run.psi[i] - s.v) / e == Approx(expected * std::cos(q * (double(i) + 0.5))).margin(3e-5));
  }
}

TEST_CASE("damping is viscosity, and scales out, to round-off", "[identity]") {
  // At fixed steps the identities hold step by step; round-off grows with the motion, here over a time of 10.
  const Settings fixed = {{"ts_type", "rk"}, {"ts_rk_type", "4"}, {"ts_dt", "0.05"}};
  const double t = 10;
  for (const bool derived : {true, false}) {
    Scene s = with_ends(Ends::ring, 2, 20, 20);  // spacing 1, so that a chain can be the same system
    s.derived_sign = derived;
    const double sd = s.s_delta();
    const Start start = [](double x) { return Node{0.3 + 0.5 * std::sin(2 * M_PI * x / 20), 0.1}; };
    const Fields run = advance(s, start, t, fixed);

    Scene chain = s;
    chain.form = Form::chain;
    chain.f0 = s.gamma;
    chain.k0 = 1;
    chain.k1 = s.c * s.c;
    chain.zeta = sd;
    const auto shifted = [&](double x) {
      return Node{start(x)[0], start(x)[1] + sd / s.gamma * start(x)[0]};
    };
    const Fields viscous = advance(chain, shifted, t, fixed);

    const double a2 = 1 - sd / s.gamma, a = std::sqrt(a2);
    Scene scaled = s;
    scaled.gamma *= a2;
    scaled.delta = 0;
    scaled.v /= a;
    const Fields free = advance(
        scaled,
        [&](double x) {
          return Node{start(x)[0] / a, (start(x)[1] + (1 - a2) * start(x)[0]) / (a * a2)};
        },
        t, fixed);
    for (std::size_t i = 0; i < run.psi.size(); ++i) {
      CHECK(viscous.psi[i] == Approx(run.psi[i]).margin(1e-12));
      CHECK(viscous.eta[i] == Approx(run.eta[i] + sd / s.gamma * run.psi[i]).margin(1e-12));
      CHECK(free.psi[i] * a == Approx(run.psi[i]).margin(1e-12));
      CHECK(free.eta[i] * a * a2 == Approx(run.eta[i] + (1 - a2) * run.psi[i]).margin(1e-12));
    }
  }
}

TEST_CASE("uniform scenes follow the orbit of the oscillator", "[uniform]") {
  for (const bool chain : {false, true}) {
    Scene s;
    s.n = chain ? 5 : 12;
    if (chain) {
      s.form = Form::chain;
      s.order = 2;
      s.length = s.n;
      s.zeta = 0.3;
    }
    const Orbit orbit = uniform_orbit(s);
    const auto start = [&](double) { return Node{orbit.psi_at(0), orbit.eta_at(0)}; };
    for (const double part : {0.3, 1.}) {
      const Fields run = advance(s, start, part * orbit.period);
      for (std::size_t i = 0; i < run.psi.size(); ++i) {
        // tolerance 1e-12 a step, some 1e2 steps, on an orbit that attracts
        CHECK(run.psi[i] == Approx(orbit.psi_at(part)).margin(1e-9));
        CHECK(run.eta[i] == Approx(orbit.eta_at(part)).margin(1e-9));
      }
    }
  }
}

TEST_CASE("wave speeds on a ring converge at the stencil's order", "[wave][serial]") {
  // gamma 3, c 1, v 0.5, delta 0: four pulses on a ring of 100 run at 2.68955; a quarter of it holds one. The
  // start is the profile itself; the window is short, since trains may be unstable.
  Scene s = with_ends(Ends::ring, 2, 0, 25);
  s.delta = 0;
  s.v = 0.5;
  const Oscillator oscillator(s);
  const auto length = [&](double V) { return V * find_orbit(oscillator, 1 - s.c * s.c / (V * V)).period; };
  double V0 = 2.6, V1 = 2.7, l0 = length(V0), l1 = length(V1);
  for (int i = 0; i < 6 && std::abs(l1 - s.length) > 1e-11; ++i) {
    const double V = V1 + (s.length - l1) * (V1 - V0) / (l1 - l0);
    V0 = V1;
    l0 = l1;
    V1 = V;
    l1 = length(V);
  }
  CHECK(V1 == Approx(2.68955).margin(5e-6));
  const Orbit orbit = find_orbit(oscillator, 1 - s.c * s.c / (V1 * V1));
  const auto speed = [&](int order, PetscInt n) {
    s.order = order;
    s.n = n;
    // how far the first Fourier coefficient has turned
    const auto phase = [&](const Fields& run) {
      std::complex<double> sum = 0;
      for (std::size_t i = 0; i < run.psi.size(); ++i)
        sum += run.psi[i] * std::polar(1., -2 * M_PI * double(i) / double(n));
      return std::arg(sum);
    };
    const auto start = [&](double x) {
      const double turn = 1 - x / s.length;
      // eta = f'/A + F is the orbit's own
      return Node{orbit.psi_at(turn), orbit.eta_at(turn)};
    };
    const double T = 4;
    const Fields begin = advance(s, start, 1e-9), end = advance(s, start, T);
    const double turned = std::remainder(phase(end) - phase(begin) + 2 * M_PI * V1 * T / s.length, 2 * M_PI);
    return V1 - turned * s.length / (2 * M_PI * T);
  };
  for (const auto& [order, n] : {std::pair(2, 256), std::pair(4, 192), std::pair(6, 96)}) {
    const double coarse = std::abs(speed(order, n) - V1), fine = std::abs(speed(order, 2 * n) - V1);
    INFO("order " << order << ": " << coarse << " " << fine);
    CHECK(std::log2(coarse / fine) > order - 0.5);
  }
}

namespace {

// A field that no symmetry simplifies, of all kinds of scene that have an energy.
VecHandle rough_start(const Model& model) {
  return started(model, [](PetscInt node, double* at) {
    for (int d = 0; d < 2; ++d) at[d] = 0.6 * std::sin(1.3 * double(node) + d) + 0.2;
  });
}

std::vector<Scene> energy_scenes() {
  std::vector<Scene> all;
  for (const int order : {2, 4, 6, 8})
    for (const Ends ends : {Ends::ring, Ends::free}) {
      Scene s = with_ends(ends, order, 21, 9);
      s.derived_sign = order != 4;
      s.spread = order == 6 ? 0.3 : 0;
      all.push_back(s);
    }
  for (const bool ring : {true, false}) {
    Scene s = with_ends(ring ? Ends::ring : Ends::free, 2, 13, ring ? 13 : 12);
    s.form = Form::chain;
    s.m = 0.7;
    s.f0 = 1.4;
    s.zeta = 0.3;
    all.push_back(s);
  }
  return all;
}

}  // namespace

TEST_CASE("the energy balance holds at every moment", "[energy]") {
  // The energy is quadratic in u, so that the central difference along the motion is its derivative:
  // round-off alone.
  for (const Scene& s : energy_scenes()) {
    Model model(PETSC_COMM_WORLD, s);
    const Plate plate;
    Displacement displacement(model, plate);
    CHECK(displacement.has_energy());
    VecHandle u = rough_start(model), f = model.create_vector(), moved = model.create_vector();
    model.rhs(Part::full, u, f);
    const Energy now = displacement.energy(u, 0);
    SS_TRY(VecWAXPY(moved, 0.5, f, u));
    const Energy after = displacement.energy(moved, 0);
    SS_TRY(VecWAXPY(moved, -0.5, f, u));
    const Energy before = displacement.energy(moved, 0);
    const double rate = after.kinetic + after.elastic - before.kinetic - before.elastic;
    const double size = after.kinetic + after.elastic + std::abs(now.input) + std::abs(now.friction);
    INFO("order " << s.order << " ring " << s.ring() << " form " << int(s.form));
    CHECK(std::abs(rate - (now.input - now.friction - now.viscous)) < 1e-11 * size);
  }
}

TEST_CASE("displacement moves with the velocity, and holds what is held", "[energy]") {
  std::vector<Scene> scenes = energy_scenes();
  for (const int order : {2, 4, 6}) {
    Scene s = with_ends(Ends::held, order, 21, 9);
    s.left_value = -1.5;
    scenes.push_back(s);
  }
  for (const Scene& s : scenes) {
    Model model(PETSC_COMM_WORLD, s);
    const Plate plate;
    Displacement displacement(model, plate);
    VecHandle u = rough_start(model), f = model.create_vector(), chi = displacement.create_vector(),
              later = displacement.create_vector();
    model.rhs(Part::full, u, f);
    const double t = 3, e = 1e-2;  // chi is linear in u and t, so that e may be large
    displacement.solve(u, t, chi);
    SS_TRY(VecAXPY(u, e, f));
    displacement.solve(u, t + e, later);
    SS_TRY(VecAXPY(u, -e, f));
    const Reading a(u), b(chi), c(later);
    for (PetscInt i = 0; i < model.local(); ++i) CHECK((c[i] - b[i]) / e == Approx(a[2 * i]).margin(1e-10));
    if (model.local() > 0 && model.held(model.first())) CHECK(b[0] == Approx(-1.5 * t).margin(1e-12));
  }
  Scene loose;
  loose.form = Form::chain;
  loose.order = 2;
  loose.n = 12;
  loose.length = 12;
  loose.k0 = loose.k1 = 0;
  Model model(PETSC_COMM_WORLD, loose);
  const Plate plate;
  Displacement displacement(model, plate);  // blocks that nothing ties are where they have gone
  CHECK(Displacement::floats(loose));
  VecHandle u = rough_start(model), chi = displacement.create_vector();
  const std::vector<double> gone(model.local(), 0.75), start(model.local(), 0.), force(model.local(), 0.3);
  displacement.count(start, force, [&](double) -> const std::vector<double>& { return gone; });
  displacement.solve(u, 2, chi);
  double least, most;
  SS_TRY(VecMin(chi, nullptr, &least));
  SS_TRY(VecMax(chi, nullptr, &most));
  CHECK(least == 0.75);
  CHECK(most == 0.75);
}

TEST_CASE("the energy balance of a run closes at the method's order", "[energy][serial]") {
  // Energy minus the integral of the powers by Simpson's rule over pairs of steps: both of order 4, as is the
  // method.
  const Scene s = with_ends(Ends::free, 4, 21, 6);
  const auto gap = [&](int steps) {
    const InDatabase given({{"ts_type", "rk"}, {"ts_rk_type", "4"}, {"ts_dt", number_text(2. / steps)}});
    const Model model(PETSC_COMM_WORLD, s);
    const Plate plate;
    Displacement displacement(model, plate);
    const VecHandle u = started(model, [&](PetscInt node, double* at) {
      at[0] = 0.3 + 0.5 * std::cos(M_PI * s.x(node) / s.length);
      at[1] = 0.1;
    });
    double first = 0, last = 0, integral = 0;
    Integrator integrator(model, MethodSpec::from(given.options), u);
    integrator.advance(u, 0, 2, [&](const Integrator::Step& step) {
      const Energy e = displacement.energy(step.u, step.t);
      if (step.index == 0) first = e.kinetic + e.elastic;
      last = e.kinetic + e.elastic;
      const double weight = step.index == 0 || step.index == steps ? 1 : step.index % 2 ? 4 : 2;
      integral += weight / 3 * 2. / steps * (e.input - e.friction - e.viscous);
      return Integrator::Verdict::go_on;
    });
    CHECK(integrator.report().steps == steps);
    return std::abs(last - first - integral);
  };
  const double coarse = gap(40), fine = gap(80);
  INFO(coarse << " " << fine);
  CHECK(std::log2(coarse / fine) > 3.6);
  CHECK(fine < 1e-5);
}

TEST_CASE("a corner along x = c t costs order: h^(2p/(p+1))", "[space][serial]") {
  // psi(0) = -1.5 held, psi_t = 0 there, but c^2 psi_xx not psi_e - v: what init_type layer gives.
  const double t = 2;
  const Start layer = [](double x) {
    const double psi = 0.1 - 1.6 * std::exp(-x * x / 4);
    return Node{psi, psi * psi * psi / 3 - psi};
  };
  const auto scene = [](int order, PetscInt cells) {
    Scene s = with_ends(Ends::held, order, cells + 1, 8);
    s.left_value = -1.5;
    return s;
  };
  const Settings tight = {{"ts_rtol", "1e-8"}, {"ts_atol", "1e-8"}};
  const Fields reference = advance(scene(4, 1024), layer, t, tight);
  for (const int order : {2, 4}) {
    const auto error = [&](PetscInt cells) {
      const Fields run = advance(scene(order, cells), layer, t, tight);
      double largest = 0;
      for (std::size_t i = 0; i < run.psi.size(); ++i) {
        const double x = 8. * double(i) / double(cells);
        if (x > 1 && x < 3)
          largest = std::max(largest, std::abs(run.psi[i] - reference.psi[i * 1024 / cells]));
      }
      return largest;
    };
    const double measured = std::log2(error(64) / error(256)) / 2;
    INFO("order " << order << ": " << measured);
    CHECK(measured == Approx(2. * order / (order + 1)).margin(0.2));
  }
}
