// Cycles of friction that sticks: closed forms, differences of motions, and where a slip fails to come back.
#include <cmath>
#include <random>

#include "catch.hpp"
#include "cycles/cycle_waves.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"

using namespace stickslip;

namespace {

Scene chain(const char* law, PetscInt n) {
  Scene s;
  s.form = Form::chain;
  s.order = 2;
  s.friction.law = Law(law);
  s.n = n;
  s.length = double(n);
  return s;
}

// The damped Coulomb block m = f0 = 1: with D = fs - fd, a = zeta/2 and w^2 = k0 - a^2 its slip is
//     psi = v - e^(-a t) [v cos(w t) + ((a v - D)/w) sin(w t)].
struct DampedSlip {
  double k0, zeta, v, D, a = zeta / 2, w = std::sqrt(k0 - a * a);
  double psi(double t) const {
    return v - std::exp(-a * t) * (v * std::cos(w * t) + (a * v - D) / w * std::sin(w * t));
  }
};

}  // namespace

TEST_CASE("Coulomb's block: period, rest and multipliers of its cycle as in closed form",
          "[stick_cycle][serial]") {
  Scene s = chain("coulomb", 1);
  s.k0 = 1;
  s.v = 0.1;
  const StickFate found = uniform_stick_fate(s);
  REQUIRE(found.fate == Fate::repeats);
  const double D = 0.5, v = 0.1, slip_time = 2 * (M_PI - std::atan(D / v));
  const double slip = v * (slip_time - std::sin(slip_time)) + D * (1 - std::cos(slip_time));
  const double drop = slip - v * slip_time, period = slip_time + drop / v;
  const Cycle c = described(s, found.cycle);
  CHECK(c.period == Approx(period).epsilon(1e-13));  // some hundred roundings
  CHECK(c.rest_fraction == Approx(drop / v / period).epsilon(1e-12));
  CHECK(c.psi_max == Approx(v + std::hypot(v, D)).epsilon(1e-11));
  CHECK(c.psi_min == 0);
  CHECK(c.force_drop == Approx(2 * std::hypot(v, D)).epsilon(1e-11));  // eta swings about fd
  CHECK(c.error_estimate < 1e-10);
  REQUIRE(c.multipliers.size() == 2);
  CHECK(std::abs(c.multipliers[0] - 1.) < 1e-11);
  CHECK(std::abs(c.multipliers[1]) < 1e-11);
}

TEST_CASE("the extremes of a cycle lie between the ends of steps as anywhere", "[stick_cycle][serial]") {
  for (int k = 0; k < 24; ++k) {  // the steps fall otherwise in each
    Scene s = chain("coulomb", 1);
    s.k0 = 1;
    s.v = (k % 2 ? -1 : 1) * (0.05 + 0.013 * k);
    const double D = 0.5, v = std::abs(s.v), top = v + std::hypot(v, D);
    const Cycle c = described(s, uniform_stick_fate(s).cycle);
    INFO("v = " << s.v);
    CHECK((s.v > 0 ? c.psi_max : -c.psi_min) == Approx(top).epsilon(1e-11));
    CHECK(c.force_drop == Approx(2 * std::hypot(v, D)).epsilon(1e-11));
  }
}

TEST_CASE("Where stick-slip of the damped Coulomb block ends, to the slip that only grazes rest",
          "[stick_cycle][serial]") {
  Scene s = chain("coulomb", 1);
  s.k0 = 0.7;
  s.zeta = 0.3;
  const auto depth = [&](double v) {
    s.v = v;
    const StickFate found = uniform_stick_fate(s);
    return found.fate == Fate::repeats ? found.cycle.depth : found.cycle.clearance;
  };
  const double graze = find_root(depth, {0.2, depth(0.2), 3, depth(3)}, 1e-14);
  // by the closed form: least psi of the slip
  const auto least = [&](double v) {
    const DampedSlip slip{s.k0, s.zeta, v, 0.5};
    return find_least([&](double t) { return slip.psi(t); }, M_PI / slip.w, 2 * M_PI / slip.w, 1e-9,
                      [](double) { return false; })
        .value;
  };
  CHECK(graze == Approx(find_root(least, {0.2, least(0.2), 3, least(3)}, 1e-14)).epsilon(1e-12));
}

TEST_CASE("The block of Carlson and Langer sticks and slips beyond its linear boundary up to 2.4047128309",
          "[stick_cycle][serial]") {
  Scene s = chain("carlson-langer", 1);
  s.zeta = std::sqrt(0.02);  // `paper` at k1 = 0.2
  const auto depth = [&](double v) {
    s.v = v;
    const StickFate found = uniform_stick_fate(s);
    return found.fate == Fate::repeats ? found.cycle.depth : found.cycle.clearance;
  };
  CHECK(depth(1.66) < 0);  // linear: 1.6591479485
  const double graze = find_root(depth, {1.7, depth(1.7), 3, depth(3)}, 1e-14);
  CHECK(std::abs(graze - 2.4047128309) < 1e-10);  // an independent integration, to its last digit
  s.v = graze * (1 + 1e-9);
  CHECK(uniform_stick_fate(s).fate == Fate::slides);
  s.v = graze * (1 - 1e-9);
  CHECK(uniform_stick_fate(s).fate == Fate::repeats);
  s.v = -s.v;  // the mirror image
  CHECK(uniform_stick_fate(s).fate == Fate::repeats);
  s.friction.back_slip = false;
  CHECK(uniform_stick_fate(s).fate == Fate::stuck);
}

TEST_CASE("Deviations of random cells go round starts and stops as differences of motions do",
          "[stick_cycle][serial]") {
  std::mt19937 draw(5);
  std::uniform_real_distribution<double> real(0, 1);
  int cycles = 0;
  for (int k = 0; k < 10; ++k) {
    Scene s = chain(k % 2 ? "coulomb" : "carlson-langer", 1 + k % 5);
    if (k % 3 == 0) s.friction.state = StateLaw(k % 2 ? "healing" : "contact-age");
    if (k % 4 == 1 && s.n > 1) {
      s.left = s.right = End::free;
      s.length = double(s.n - 1);
    }
    s.k0 = 0.2 + real(draw);
    s.k1 = real(draw);
    s.zeta = 0.4 * real(draw);
    s.v = 0.05 + 0.3 * real(draw);
    s.spread = 0.3;
    s.friction_seed = k;
    const StickMotion m(s);
    StickState p;
    for (PetscInt i = 0; i < s.n; ++i) {
      p.u.insert(p.u.end(), {0, 0.8 * real(draw)});
      if (m.dof() == 3) p.u.push_back(0.5 + 0.2 * real(draw));
    }
    m.decide(p);
    while (p.t < 40) m.advance(p, 40);
    const std::size_t size = m.size();
    StickState with(p);
    with.count = size;
    with.deviations.assign(size * size, 0.);
    for (std::size_t i = 0; i < size; ++i) with.deviations[i * size + i] = 1;
    const auto after = [&](StickState q) {
      while (q.t < 60) m.advance(q, 60);
      return q;
    };
    const StickState end = after(with);
    for (std::size_t i = 0; i < size; ++i) {
      const double e = 1e-6, psi = p.u[i / std::size_t(m.dof()) * std::size_t(m.dof())];
      if (i % std::size_t(m.dof()) == 0 && std::abs(psi) < 2 * e) continue;  // at rest psi does not deviate
      StickState up(p), down(p);
      up.u[i] += e;
      down.u[i] -= e;
      const StickState a = after(up), b = after(down);
      if (a.direction != b.direction) continue;  // a change at the very end
      // a difference of third order in e over events that pass at rates of 0.01
      for (std::size_t j = 0; j < size; ++j)
        CHECK((a.u[j] - b.u[j]) / (2 * e) == Approx(end.deviations[i * size + j]).margin(1e-5));
    }
    const StickFate found = stick_fate(s, p.u, 60);
    if (found.fate != Fate::repeats) continue;
    ++cycles;
    CHECK(found.cycle.residual < 1e-12);
    double nearest = 1;
    for (const auto& mu : multipliers_of(size, monodromy_matrix(m, found.cycle)))
      nearest = std::min(nearest, std::abs(mu - 1.));
    CHECK(nearest < 1e-9);  // the phase
  }
  CHECK(cycles >= 3);
}

namespace {

// The cycle of a cell, `copies` times round a ring.
StickCycle repeated(const StickCycle& of, int copies) {
  StickCycle all = of;
  for (int i = 1; i < copies; ++i) all.start.insert(all.start.end(), of.start.begin(), of.start.end());
  return all;
}

// Largest distance of an element of one list from the nearest of the other, both ways.
double apart(const std::vector<std::complex<double>>& one, const std::vector<std::complex<double>>& other) {
  double most = one.size() == other.size() ? 0 : 1e300;
  for (const auto& [from, to] : {std::pair(&one, &other), std::pair(&other, &one)})
    for (const auto& mu : *from) {
      double nearest = 1e300;
      for (const auto& nu : *to) nearest = std::min(nearest, std::abs(mu - nu) / std::max(1., std::abs(mu)));
      most = std::max(most, nearest);
    }
  return most;
}

}  // namespace

TEST_CASE("Waves on cycles with rests have the multipliers of rings of so many cells",
          "[stick_cycle][serial]") {
  std::mt19937 draw(11);
  std::uniform_real_distribution<double> real(0, 1);
  int cells = 0, viscous = 0;
  for (int k = 0; k < 15; ++k) {
    const int m = 1 + k % 3, copies = m == 1 ? 5 : 3;
    Scene cell = chain(k % 2 ? "coulomb" : "carlson-langer", m);
    if (k % 4 == 3) {
      cell.form = Form::continuum;
      cell.gamma = 1 + real(draw);
      cell.delta = 0.1;
      cell.order = k % 8 == 3 ? 4 : 2;
      cell.length = double(m);
    }
    if (k % 3 == 0) cell.friction.state = StateLaw(k % 2 ? "healing" : "contact-age");
    cell.k0 = 0.2 + real(draw);
    cell.k1 = 0.02 + 0.2 * real(draw);
    cell.c = 0.2;
    cell.zeta = cell.form == Form::chain ? 0.2 * real(draw) : 0;
    cell.v = 0.05 + 0.3 * real(draw);
    if (k % 5 == 4 || k == 6) cell.nu = 0.01 + 0.05 * real(draw);
    std::vector<double> start;
    for (int i = 0; i < m; ++i) {
      start.insert(start.end(), {0, 0.8 * real(draw)});
      if (cell.friction.has_state()) start.push_back(0.5 + 0.2 * real(draw));
    }
    const StickFate found = m == 1 ? uniform_stick_fate(cell) : stick_fate(cell, start, 30);
    if (found.fate != Fate::repeats) continue;
    Scene ring = cell;
    ring.n = m * copies;
    ring.length = cell.length * copies;
    std::vector<std::complex<double>> of_ring, of_waves;
    try {
      const StickMotion motion(ring);
      of_ring = multipliers_of(motion.size(), monodromy_matrix(motion, repeated(found.cycle, copies)));
    } catch (const Failure&) {  // with viscosity neighbours that begin to slip at once with a jump
      CHECK(cell.nu > 0);
      CHECK_THROWS_AS(StickDeviations(cell, found.cycle).of_wave(0.1), Failure);
      continue;
    }
    StickDeviations waves(cell, found.cycle);
    for (int j = 0; j < copies; ++j) {
      const double theta = 2 * M_PI * j / copies;
      const auto of_one = m == 1 ? waves.of_wave(symbol(cell.order, cell.form == Form::chain ? 1 : cell.h(),
                                                        theta / cell.length))
                                 : waves.of_phase(theta);
      of_waves.insert(of_waves.end(), of_one.begin(), of_one.end());
    }
    INFO("scene " << k << " of " << m << " nodes");
    CHECK(apart(of_ring, of_waves) < 1e-8);  // double ones that round-off of 1e-16 parts
    cells += m > 1;
    viscous += cell.nu > 0;
  }
  CHECK(cells >= 6);
  CHECK(viscous >= 2);
}
