// The loops over nodes: whole ranges, parts of them, both compilations and any number of ranks give the same
// bits.
#include <cmath>
#include <random>
#include <vector>

#include "catch.hpp"
#include "model/law_family.hpp"
#include "model/right_hand_side.hpp"
#include "numerics/elementary.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"

using namespace stickslip;
using namespace stickslip::kernel;

namespace {

constexpr PetscInt margin = 4, count = 5 * tile_size + 77;  // several tiles and a part of one

const Coefficients k{3, 0.07, 1. / 3, 0.2, 0.21, {-2.5, 1.4, -0.08, 0.011, -0.0017}};
const std::vector<PetscInt> cuts = {0, 1, 2, 5, 132, 133, 261, 390, 391, 600, count};

// psi, eta, the state, the amplitude and the coupling of `count` nodes; psi of `margin` more on both sides.
struct Field {
  std::vector<double> psi, eta, state, amplitude, coupling;
  Field() {
    for (PetscInt i = -margin; i < count + margin; ++i) psi.push_back(0.7 * std::sin(1.3 * double(i)) + 0.2);
    for (PetscInt i = 0; i < count; ++i) {
      eta.push_back(0.7 * std::sin(1.9 * double(i)) + 0.3);
      state.push_back(0.7 * std::sin(2.3 * double(i)) + 0.4);
      amplitude.push_back(1 + 0.3 * std::cos(0.9 * double(i)));
      coupling.push_back(std::sin(0.7 * double(i)));
    }
  }
};

// What `call(version of the loop, begin, end, rates)` makes of all nodes, of parts of them and with every set
// of instructions: the same bits. `rates`: psi's of all nodes, then eta's and the state's.
template <class Loop, class Call>
std::vector<double> same_bits(const Loop& loop, const Call& call) {
  std::vector<double> whole(3 * count);
  call(Baseline<Loop>{loop}, PetscInt(0), count, whole);
  const auto agrees = [&](const auto& version) {
    std::vector<double> all(3 * count), pieces(3 * count);
    call(version, PetscInt(0), count, all);
    for (std::size_t j = 0; j + 1 < cuts.size(); ++j) call(version, cuts[j], cuts[j + 1], pieces);
    CHECK(all == whole);
    CHECK(pieces == whole);
  };
  agrees(Baseline<Loop>{loop});
  if (has_avx2()) agrees(Avx2<Loop>{loop});
  if (has_avx512()) agrees(Avx512<Loop>{loop});
  return whole;
}

// The columns of a law, as it stands for a node by itself.
template <class F>
void check_columns(const F& friction) {
  const Field x;
  const auto call = [&](const auto& loop, PetscInt begin, PetscInt end, std::vector<double>& values) {
    const auto of = [&](const std::vector<double>& v, PetscInt from) {
      return std::vector<double>(v.begin() + begin + from, v.begin() + end + from);
    };
    const auto psi = of(x.psi, margin), s = of(x.state, 0);
    std::vector<double> columns[6];
    for (auto& column : columns) column.resize(psi.size());
    const auto at = [&](int j) { return columns[j].data(); };
    loop(LawTile{psi.data(), s.data(), nullptr, end - begin},
         LawValues{at(0), at(1), at(2), at(3), at(4), at(5)});
    values.resize(6 * count);
    for (int j = 0; j < 6; ++j)
      std::copy(columns[j].begin(), columns[j].end(), values.begin() + j * count + begin);
  };
  same_bits(LawRates<F, false>{friction}, call);
  const std::vector<double> all = same_bits(LawPartials<F, false>{friction}, call);
  for (std::size_t i = 0; i < std::size_t(count); ++i) {
    const double psi = x.psi[i + margin], s = F::has_state ? x.state[i] : 0;
    const Partials p = friction.partials(psi, s);
    const RatePartials g = friction.rate_partials(psi, s);
    const double values[] = {p.F, p.F_psi, p.F_state, g.g, g.g_psi, g.g_state};
    for (int j = 0; j < (F::has_state ? 6 : 2); ++j)
      CHECK(std::abs(all[std::size_t(j * count) + i] - values[j]) <= 1e-14 * (1 + std::abs(values[j])));
  }
}

// `friction`: what the source says, for a node by itself.
template <class Source, class F>
void check_friction(const Source& source, const F& friction, bool spread) {
  const Field x;
  const auto call = [&](const auto& loop, PetscInt begin, PetscInt end, std::vector<double>& rates) {
    // copies of the range alone, so that the sanitizers see every access outside it
    const auto of = [&](const std::vector<double>& v, PetscInt from) {
      return std::vector<double>(v.begin() + begin + from, v.begin() + end + from);
    };
    const auto psi = of(x.psi, margin), eta = of(x.eta, 0), s = of(x.state, 0), a = of(x.amplitude, 0);
    std::vector<double> f_psi(psi.size()), f_eta = of(x.coupling, 0), f_state(psi.size());
    const double* const state = Source::has_state ? s.data() : nullptr;
    loop(k, Columns{psi.data(), eta.data(), state, spread ? a.data() : nullptr,
                    f_eta.data(), f_psi.data(), f_eta.data(), f_state.data(), end - begin});
    std::copy(f_psi.begin(), f_psi.end(), rates.begin() + begin);
    std::copy(f_eta.begin(), f_eta.end(), rates.begin() + count + begin);
    std::copy(f_state.begin(), f_state.end(), rates.begin() + 2 * count + begin);
  };
  const std::vector<double> rates = same_bits(PointwiseOfColumns<Source>{source}, call);
  double worst = 0;
  for (std::size_t i = 0; i < std::size_t(count); ++i) {
    const double psi = x.psi[i + margin], eta = x.eta[i], s = Source::has_state ? x.state[i] : 0;
    const double force = (spread ? x.amplitude[i] : 1) * friction.partials(psi, s).F;
    worst = std::max(
        {worst, std::abs(rates[i] - k.A * (eta - k.B * psi - force)),
         std::abs(rates[count + i] - (k.K0 * (k.v - psi) + x.coupling[i] - k.s_delta * (eta - force))),
         std::abs(rates[2 * count + i] - friction.rate_partials(psi, s).g)});
  }
  CHECK(worst < 1e-14);  // some ten terms of at most 4, each rounded by 1e-16 of itself
}

template <class F>
void check_law(const F& friction) {
  check_columns(friction);
  const ByColumns<F::has_state, F::steep, false> source{columns_of<false>(friction, false)};
  for (const bool spread : {false, true}) check_friction(source, friction, spread);
}

// None, for a node by itself.
struct NoForce {
  Partials partials(double, double) const { return {0, 0, 0}; }
  RatePartials rate_partials(double, double) const { return {0, 0, 0}; }
};

template <int half_width>
void check_stencil() {
  const Field x;
  const auto call = [&](const auto& loop, PetscInt begin, PetscInt end, std::vector<double>& rates) {
    const std::vector<double> psi(x.psi.begin() + begin + margin - half_width,
                                  x.psi.begin() + end + margin + half_width);
    loop(k, ColumnRange{psi.data() + half_width, &rates[std::size_t(begin)], end - begin});
  };
  const std::vector<double> sums = same_bits(StencilOfColumns<half_width>{}, call);
  double worst = 0;
  for (std::size_t i = 0; i < std::size_t(count); ++i) {
    double sum = 0;
    for (int j = -half_width; j <= half_width; ++j)
      sum += k.w[std::abs(j)] * x.psi[i + std::size_t(margin + j)];
    worst = std::max(worst, std::abs(sums[i] - sum));
  }
  CHECK(worst < 1e-14);
}

}  // namespace

TEST_CASE("the loops give the same bits for parts of a range and for every instruction set", "[serial]") {
  check_law(Product<Cubic, SignExact, NoState>{});
  check_law(Product<CarlsonLanger, SignExact, NoState>{});
  check_law(Product<CarlsonLanger, SignRegularised, Healing>{{{}, {{}, 1, 2, 1}}, {0.2}});
  check_law(OwnState<RateAndState, Ageing>{{{{}, 0.5, 0.7, 1, 0.6, 1}, {{}, 1}}});
  using OfCubic = Product<Cubic, SignExact, NoState>;
  for (const bool spread : {false, true}) {
    check_friction(Within<OfCubic, false, false>{OfCubic{}}, OfCubic{}, spread);
    check_friction(NoFriction<true>{}, NoForce{}, spread);
  }
  check_stencil<1>();
  check_stencil<2>();
  check_stencil<3>();
  check_stencil<4>();
}

TEST_CASE("parts of a range of nodes have the bits of the whole", "[serial]") {
  for (const int order : {2, 4, 6, 8})
    for (const char* law : {"cubic", "rate-and-state"}) {
      Scene s;
      s.n = count + 2 * margin;
      s.order = order;
      s.friction.law = Law(law);
      if (law == std::string("rate-and-state")) s.friction.state = StateLaw("ageing");
      const PetscInt dof = s.friction.has_state() ? 3 : 2;
      const RightHandSide right_hand_side(s, 0, s.n);
      std::vector<double> u, whole(std::size_t(count * dof)), pieces(whole.size());
      for (PetscInt i = 0; i < s.n * dof; ++i) u.push_back(0.7 * std::sin(1.3 * double(i)) + 0.2);
      const auto call = [&](Part part, PetscInt begin, PetscInt end, std::vector<double>& f) {
        const auto psi = [&](PetscInt i) { return u[std::size_t((i + margin) * dof)]; };
        std::vector<double> before, behind;
        for (PetscInt j = 0; j < order / 2; ++j) {
          before.push_back(psi(begin - order / 2 + j));
          behind.push_back(psi(end + j));
        }
        const std::vector<double> own(u.begin() + (begin + margin) * dof, u.begin() + (end + margin) * dof);
        right_hand_side.take(
            part, 0.2,
            {own.data(), nullptr, &f[std::size_t(begin * dof)], end - begin, before.data(), behind.data()});
      };
      for (const Part part : {Part::full, Part::pointwise, Part::stencil, Part::wave, Part::reaction}) {
        call(part, 0, count, whole);
        for (std::size_t j = 0; j + 1 < cuts.size(); ++j) call(part, cuts[j], cuts[j + 1], pieces);
        CHECK(pieces == whole);
      }
    }
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
