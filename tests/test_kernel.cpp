// The loops over nodes: whole ranges, parts of them, both compilations and any number of ranks give the same
// bits.
#include <cmath>
#include <random>
#include <vector>

#include "catch.hpp"
#include "model/dispatch.hpp"
#include "model/kernel.hpp"
#include "numerics/elementary.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"

using namespace stickslip;
using namespace stickslip::kernel;

namespace {

constexpr PetscInt margin = 4, count = 5 * tile_size + 77;  // several tiles and a part of one

const Coefficients coefficients{3, 0.07, 1. / 3, 0.2, 0.21, {-2.5, 1.4, -0.08, 0.011, -0.0017}};

struct Field {
  std::vector<double> u, amplitude;
};

// count nodes and `margin` more on both sides
Field field(int dof) {
  Field f;
  for (PetscInt i = 0; i < (count + 2 * margin) * dof; ++i)
    f.u.push_back(0.7 * std::sin(1.3 * double(i)) + 0.2 + 0.1 * double(i % dof));
  for (PetscInt i = 0; i < count; ++i) f.amplitude.push_back(1 + 0.3 * std::cos(0.9 * double(i)));
  return f;
}

// The loop over [begin, end), whatever lies outside.
template <int half_width, class Loop>
void call(const Loop& loop, int dof, const Field& x, bool spread, PetscInt begin, PetscInt end,
          std::vector<double>& f) {
  const auto psi = [&](PetscInt i) { return x.u[static_cast<std::size_t>((i + margin) * dof)]; };
  std::vector<double> before, behind;
  for (PetscInt j = 0; j < half_width; ++j) {
    before.push_back(psi(begin - half_width + j));
    behind.push_back(psi(end + j));
  }
  // a copy of the range alone, so that the sanitizers see every access outside it
  const std::vector<double> u(x.u.begin() + (begin + margin) * dof, x.u.begin() + (end + margin) * dof);
  const std::vector<double> amplitude(x.amplitude.begin() + begin, x.amplitude.begin() + end);
  loop(coefficients,
       Range{u.data(), spread ? amplitude.data() : nullptr, &f[static_cast<std::size_t>(begin * dof)],
             end - begin, before.data(), behind.data()});
}

const std::vector<PetscInt> cuts = {0, 1, 2, 5, 132, 133, 261, 390, 391, 600, count};

// `expected(u, coupling, a)`: the right-hand side of a node by the equations.
template <int half_width, class Kernel, class Expected>
void check(const Kernel& kernel, bool spread, const Expected& expected) {
  constexpr int dof = Kernel::dof;
  const Field x = field(dof);
  const auto size = static_cast<std::size_t>(count * dof);
  std::vector<double> whole(size), pieces(size), avx2(size);
  call<half_width>(Baseline<Kernel>{kernel}, dof, x, spread, 0, count, whole);
  for (std::size_t k = 0; k + 1 < cuts.size(); ++k)
    call<half_width>(Baseline<Kernel>{kernel}, dof, x, spread, cuts[k], cuts[k + 1], pieces);
  CHECK(pieces == whole);
  if (has_avx2()) {
    call<half_width>(Avx2<Kernel>{kernel}, dof, x, spread, 0, count, avx2);
    CHECK(avx2 == whole);
    for (std::size_t k = 0; k + 1 < cuts.size(); ++k)
      call<half_width>(Avx2<Kernel>{kernel}, dof, x, spread, cuts[k], cuts[k + 1], pieces);
    CHECK(pieces == whole);
  }
  if (has_avx512()) {
    std::vector<double> avx512(size);
    call<half_width>(Avx512<Kernel>{kernel}, dof, x, spread, 0, count, avx512);
    CHECK(avx512 == whole);
  }
  double worst = 0;
  for (PetscInt i = 0; i < count; ++i) {
    const double* u = &x.u[static_cast<std::size_t>((i + margin) * dof)];
    double coupling = 0;
    for (int j = -half_width; j <= half_width; ++j) coupling += coefficients.w[std::abs(j)] * u[j * dof];
    const std::array<double, 3> f =
        expected(u, coupling, spread ? x.amplitude[static_cast<std::size_t>(i)] : 1.);
    for (int d = 0; d < dof; ++d)
      worst = std::max(
          worst, std::abs(whole[static_cast<std::size_t>(i * dof + d)] - f[static_cast<std::size_t>(d)]));
  }
  CHECK(worst < 1e-14);  // some ten terms of at most 4, each rounded by 1e-16 of itself
}

constexpr const Coefficients& k = coefficients;

// The coupling by the loop that knows no law, the rest onto it.
template <int half_width, class F>
struct TwoPasses {
  static constexpr int dof = F::has_state ? 3 : 2;
  F friction;
  void operator()(const Coefficients& c, const Range& r) const {
    if constexpr (half_width > 0) Wave<half_width, dof, true>{}(c, r);
    Onto<F>{friction, half_width > 0}(c, r);
  }
};

template <int half_width, class F>
void check_friction(const F& friction, bool spread) {
  const auto state = [](const double* u) { return F::has_state ? u[2] : 0; };
  const auto expected = [&](const double* u, double coupling, double a) {
    const double force = a * friction.force(u[0], state(u));
    return std::array<double, 3>{
        k.A * (u[1] - k.B * u[0] - force),
        k.K0 * (k.v - u[0]) + (half_width > 0 ? coupling : 0) - k.s_delta * (u[1] - force),
        friction.rate_partials(u[0], state(u)).g};
  };
  if constexpr (half_width > 0 && !F::has_state)
    check<half_width>(Whole<half_width, F>{friction}, spread, expected);
  check<half_width>(TwoPasses<half_width, F>{friction}, spread, expected);
  check<0>(Reaction<F>{friction}, spread, [&](const double* u, double, double a) {
    const double force = a * friction.force(u[0], state(u));
    return std::array<double, 3>{-k.A * force, k.s_delta * force, friction.rate_partials(u[0], state(u)).g};
  });
}

template <int half_width, int dof>
void check_wave() {
  check<half_width>(Wave<half_width, dof, false>{}, false, [&](const double* u, double coupling, double) {
    return std::array<double, 3>{k.A * (u[1] - k.B * u[0]), k.K0 * (k.v - u[0]) + coupling - k.s_delta * u[1],
                                 0};
  });
  check<half_width>(Wave<half_width, dof, true>{}, false, [&](const double*, double coupling, double) {
    return std::array<double, 3>{0, coupling, 0};
  });
}

}  // namespace

TEST_CASE("the loops give the same bits for parts of a range and for every instruction set", "[serial]") {
  const Product<Cubic, SignExact, NoState> cubic{};
  const Product<CarlsonLanger, SignExact, NoState> carlson_langer{};
  const Product<CarlsonLanger, SignRegularised, Healing> healing{{}, {1, 2, 1}, {0.2}};
  const OwnState<RateAndState, Ageing> ageing{{{}, 0.5, 0.7, 1, 0.6, 1}, {1}};
  for (const bool spread : {false, true}) {
    check_friction<0>(cubic, spread);
    check_friction<1>(cubic, spread);
    check_friction<2>(cubic, spread);
    check_friction<3>(cubic, spread);
    check_friction<4>(cubic, spread);
    check_friction<2>(carlson_langer, spread);
    check_friction<1>(healing, spread);
    check_friction<3>(ageing, spread);
  }
  check_wave<1, 2>();
  check_wave<4, 2>();
  check_wave<2, 3>();
}

TEST_CASE("the right-hand side has the same bits on any number of ranks") {
  for (const int order : {2, 4, 6, 8})
    for (const PetscInt n : {19, 1000}) {  // 19: on four ranks some need the halo at every node
      Scene s;
      s.n = n;
      s.order = order;
      s.length = 40;
      s.spread = order == 4 ? 0.2 : 0;
      if (order == 6) {
        s.left = End::velocity;
        s.right = End::free;
        s.left_value = -1.5;
      }
      const Model model(PETSC_COMM_WORLD, s), alone(PETSC_COMM_SELF, s);
      VecHandle u = model.create_vector(), f = model.create_vector(), u_alone = alone.create_vector(),
                f_alone = alone.create_vector();
      const auto fill = [](const Model& m, Vec to) {
        double* a;
        SS_TRY(VecGetArray(to, &a));
        for (PetscInt i = 0; i < 2 * m.local(); ++i) a[i] = std::sin(0.37 * double(2 * m.first() + i));
        SS_TRY(VecRestoreArray(to, &a));
      };
      fill(model, u);
      fill(alone, u_alone);
      for (const Part part : {Part::full, Part::pointwise, Part::stencil, Part::wave, Part::reaction}) {
        model.rhs(part, u, f);
        alone.rhs(part, u_alone, f_alone);
        const double *mine, *all;
        SS_TRY(VecGetArrayRead(f, &mine));
        SS_TRY(VecGetArrayRead(f_alone, &all));
        PetscInt different = 0;
        for (PetscInt i = 0; i < 2 * model.local(); ++i)
          if (mine[i] != all[2 * model.first() + i]) ++different;
        CHECK(different == 0);
        SS_TRY(VecRestoreArrayRead(f_alone, &all));
        SS_TRY(VecRestoreArrayRead(f, &mine));
      }
    }
}

namespace {

// The distance in units of the last place of the exact value; subnormal ones have the last place of the
// smallest.
double off_by(double found, long double exact) {
  const double rounded = double(exact);
  if (std::isnan(rounded)) return std::isnan(found) ? 0 : HUGE_VAL;
  if (std::isinf(rounded) || std::isinf(found)) return found == rounded ? 0 : HUGE_VAL;
  return double(std::abs(found - exact)) / (std::nextafter(std::abs(rounded), HUGE_VAL) - std::abs(rounded));
}

}  // namespace

TEST_CASE("exp, expm1, log, log1p and tanh of the loops err by one to three units of the last place",
          "[kernel][serial]") {
  std::mt19937_64 random(20261122);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution<>(a, b)(random); };
  double of_exp = 0, of_expm1 = 0, of_log = 0, of_log1p = 0, of_tanh = 0;
  for (int i = 0; i < 40000; ++i) {
    const double x = i % 4 == 0   ? between(-746, 710)
                     : i % 4 == 1 ? between(-2, 2)
                     : i % 4 == 2 ? between(-40, 40)
                                  : std::ldexp(between(-1, 1), -int(random() % 1070));
    const double beside_1 = std::ldexp(between(-1, 1), -int(random() % 52));
    const double y = i % 2 == 0 ? std::exp(between(-744, 709.7)) : 1 + beside_1,
                 z = i % 2 == 0 ? std::exp(x / 2) : beside_1;
    of_exp = std::max(of_exp, off_by(elementary::exp(x), std::exp((long double)x)));
    if (x <= 709) of_expm1 = std::max(of_expm1, off_by(elementary::expm1(x), std::expm1((long double)x)));
    of_log = std::max(of_log, off_by(elementary::log(y), std::log((long double)y)));
    of_log1p = std::max(of_log1p, off_by(elementary::log1p(z), std::log1p((long double)z)));
    of_tanh = std::max(of_tanh, off_by(elementary::tanh(x), std::tanh((long double)x)));
  }
  CHECK(of_exp <= 1);
  CHECK(of_log <= 1);
  CHECK(of_expm1 < 2);
  CHECK(of_log1p < 2);
  CHECK(of_tanh < 3);
  constexpr double denormal = 5e-324, largest = 1.7976931348623157e308;
  for (const double x : {0., -0., 1., -1., 1e-310, denormal, -denormal, largest, -largest, HUGE_VAL,
                         -HUGE_VAL, 709.78, 709.79, -745.1, -745.2, double(NAN), -double(NAN)}) {
    INFO(x);
    CHECK(off_by(elementary::exp(x), std::exp((long double)x)) <= 1);
    CHECK(off_by(elementary::log(x), std::log((long double)x)) <= 1);
    CHECK(off_by(elementary::tanh(x), std::tanh((long double)x)) <= 1);
    CHECK((std::isnan(x) || elementary::sign_or_zero(x) == double((x > 0) - (x < 0))));
  }
}

TEST_CASE("friction with a direct effect is its formula over all that a normal double holds",
          "[kernel][serial]") {
  // F = a asinh(q), with q = |psi|/(2 psi0) exp(l) in long double, whose range is wide enough; l errs as it
  // is rounded
  std::mt19937_64 random(7);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution<>(a, b)(random); };
  const double a = 0.03, psi0 = 0.7, epsilon = std::numeric_limits<double>::epsilon();
  for (int i = 0; i < 4000; ++i) {
    const double l = between(-900, i % 2 == 0 ? 900 : 6000),
                 psi = (i % 3 == 0 ? -1 : 1) * std::exp(between(-700, 40));
    const long double q = std::abs(psi) / (2 * (long double)psi0) * std::exp((long double)l);
    const long double F = a * std::asinh(q), root = q < 1e20 ? std::sqrt(1 + q * q) : q,
                      sign = psi < 0 ? -1 : 1;
    const Partials p = DirectEffect{a, psi0}.partials(psi, l, 0.05);
    const double allowed = epsilon * (8 + std::abs(l));  // of q in parts, as l is rounded; of F no more
    INFO("psi " << psi << " l " << l << " F " << p.F << " " << double(F));
    CHECK(std::abs(p.F - double(sign * F)) <= allowed * std::abs(double(F)) + 1e-322);
    CHECK(std::abs(p.F_state - double(sign * 0.05 * q / root)) <= allowed * double(0.05 * q / root) + 1e-322);
    const double slope = double(a * q / (std::abs((long double)psi) * root));
    if (slope < 1e250) CHECK(std::abs(p.F_psi - slope) <= allowed * slope + 1e-322);
  }
  CHECK(DirectEffect{a, psi0}.partials(0., 2000., 0.05).F == 0);
  CHECK(std::isfinite(DirectEffect{a, psi0}.partials(0., 2000., 0.05).F_psi));
  CHECK(std::isnan(DirectEffect{a, psi0}.partials(double(NAN), 3., 0.05).F));
  CHECK(std::isnan(DirectEffect{a, psi0}.partials(1., double(NAN), 0.05).F));
}

TEST_CASE("the weights of a second difference add up to exactly 0", "[kernel][serial]") {
  for (const int order : {2, 4, 6, 8})
    for (PetscInt n = 9; n < 100000; n = n * 5 / 4 + 1) {
      Scene scene;
      scene.n = n;
      scene.order = order;
      const stickslip::kernel::Coefficients c = stickslip::kernel::coefficients_of(scene);
      const double scale = scene.K1() / (scene.h() * scene.h());
      const auto w = second_difference(order);
      CHECK(c.w[0] + 2 * (c.w[1] + c.w[2] + c.w[3] + c.w[4]) == 0);
      for (std::size_t j = 0; j < 5; ++j) CHECK(std::abs(c.w[j] - scale * w[j]) <= 2e-15 * scale);
    }
}
