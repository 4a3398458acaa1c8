#include "time/sliding_step.hpp"

#include <algorithm>
#include <limits>

#include "stickslip/base/vectors.hpp"
#include "stickslip/model/frictions.hpp"

namespace stickslip {

bool SlidingStep::applies_to(const Model& model) {
  const Scene& s = model.scene();
  if (!s.massless() || s.normal.varies() || !s.friction.terms.none()) return false;
  if (!s.friction.has_state() || !s.friction.state->logarithmic) return false;
  const FrictionPlaces places = friction_places(s, model.first(), model.local());
  return bool(kernel::law_columns(s.friction, false, places).velocities);
}

SlidingStep::SlidingStep(const Model& model, const StageProgram& method)
    : tiles_(model, method.stages, method.stages + 1, false), scratch_(slopes_from + method.stages),
      coefficients_(kernel::coefficients_of(model.scene())),
      law_(kernel::law_columns(model.scene().friction, false, tiles_.places())),
      stencil_(stencil_loop(model.scene(), tiles_.links())),
      rates_(kernel::compiled<RatesLoop>(Rates())) {
  const int s = method.stages;
  const auto row = [s](const double* weights, int count) {
    SlopeSum sum;
    for (int j = 0; j < count; ++j) sum.add(slopes_from + j, weights[j]);
    return sum;
  };
  for (int i = 0; i < s; ++i) stages_.push_back({method.time(i), row(&method.A[std::size_t(i * s)], i)});
  solution_ = row(method.b.data(), s);
  if (!method.embedded.empty()) error_ = row(method.error_of_f().data(), s);

  // a of the nodes by their numbers
  const auto count = std::size_t(tiles_.number(model.local() + tiles_.right_halo()));
  std::vector<double> none(count, 0.), unused[4];
  for (std::vector<double>& column : unused) column.resize(count);
  strength_.resize(count);
  law_.velocities({none.data(), none.data(), nullptr, PetscInt(count), 0},
                  {unused[0].data(), unused[1].data(), unused[2].data(), strength_.data(), unused[3].data()});
  rate_of_state_.resize(count);
  const PetscInt first = -tiles_.number(0), end = first + PetscInt(count);
  for (PetscInt i = first; i < end; ++i)
    if (const double* amplitude = tiles_.amplitude(i)) strength_[std::size_t(tiles_.number(i))] *= *amplitude;
  tiles_.for_held(first, end, [&](PetscInt i) { strength_[std::size_t(tiles_.number(i))] = 1; });
}

void SlidingStep::Rates::operator()(const kernel::Coefficients& coefficients, const Moved& nodes) const {
  const kernel::Coefficients c = coefficients;
  const Moved k = nodes;
#pragma GCC ivdep
  for (PetscInt i = 0; i < k.count; ++i) {
    const double eta_t = c.K0 * c.v - c.K0 * k.psi[i] + k.f[i];
    k.f[i] = (eta_t - c.B * k.psi_state[i] * k.state_rate[i]) / (k.strength[i] + c.B * k.psi_y[i]);
  }
}

template <class Body>
void SlidingStep::keeping_held(double* column, PetscInt first, PetscInt count, const Body& body) const {
  double held[2] = {};  // at most the two ends are
  int k = 0;
  tiles_.for_held(first, first + count, [&](PetscInt i) { held[k++] = column[i - first]; });
  body();
  k = 0;
  tiles_.for_held(first, first + count, [&](PetscInt i) { column[i - first] = held[k++]; });
}

void SlidingStep::to_y(const Nodes& n) const {
  keeping_held(n.force, n.first, n.count, [&] {
    law_.force_over_a({n.psi, n.state, nullptr, n.count, tiles_.number(n.first)}, n.force);
  });
}

void SlidingStep::to_eta(const Nodes& n) const {
  const double* const strength = &strength_[std::size_t(tiles_.number(n.first))];
  const double B = coefficients_.B;
  keeping_held(n.force, n.first, n.count, [&] {
    for (PetscInt i = 0; i < n.count; ++i) n.force[i] = strength[i] * n.force[i] + B * n.psi[i];
  });
}

// psi of held nodes is that of columns 0, which stands; their eta moves with nothing beside it.
void SlidingStep::velocities(const Tile& t, int index, double* g, PetscInt begin, PetscInt end) const {
  double *const psi = at(t, 1, 0, begin), *const psi_y = at(t, scratch_, 0, begin),
                *const psi_state = at(t, scratch_, 1, begin), *const state = at(t, index, 2, begin);
  double* const rate = g ? g : rate_of_state_.data();
  law_.velocities({at(t, index, 1, begin), state, nullptr, end - begin, tiles_.number(begin)},
                  {psi, psi_y, psi_state, at(t, scratch_, 2, begin), rate});
  tiles_.for_held(begin, end, [&](PetscInt i) {
    const PetscInt k = i - begin;
    double F;
    psi[k] = *at(t, 0, 0, i);
    psi_y[k] = psi_state[k] = 0;
    law_.rates({psi + k, state + k, nullptr, 1, tiles_.number(i)},
               {&F, nullptr, nullptr, rate + k, nullptr, nullptr});
  });
}

// New values in columns 1, with y for eta.
void SlidingStep::through(const Tile& t, double dt, double begin) const {
  const int hw = tiles_.half_width();
  const auto low = [&](int stencils) { return std::max(t.begin - stencils * hw, tiles_.low()); };
  const auto high = [&](int stencils) { return std::min(t.end + stencils * hw, tiles_.high()); };
  to_y({at(t, 0, 0, t.from), at(t, 0, 1, t.from), at(t, 0, 2, t.from), t.from, t.to - t.from});
  kernel::Coefficients c = coefficients_;
  for (int i = 0; i < stages(); ++i) {
    const Stage& stage = stages_[std::size_t(i)];
    const int ahead = stages() - i, slope = slopes_from + i, index = i == 0 ? 0 : 1;
    const PetscInt wide = low(ahead), wide_end = high(ahead), own = low(ahead - 1), own_end = high(ahead - 1);
    for (int d = 1; d < 3 && i > 0; ++d)
      tiles_.sum(t, d, tiles_.column(0, d), stage.sum, dt, wide, wide_end, tiles_.column(1, d));
    velocities(t, index, at(t, slope, 2, wide), wide, wide_end);
    double* const psi = tiles_.column(1, 0) - t.from;
    tiles_.close_ends(psi, own, own_end);
    const PetscInt number = tiles_.number(own);
    stencil_(coefficients_, {psi + own, at(t, slope, 1, own), own_end - own, number});
    c.v = tiles_.model().plate_velocity(begin + stage.time * dt);
    rates_(c, {psi + own, at(t, scratch_, 0, own), at(t, scratch_, 1, own), at(t, slope, 2, own),
               &strength_[std::size_t(number)], at(t, slope, 1, own), own_end - own});
  }
  for (int d = 1; d < 3; ++d)
    tiles_.sum(t, d, tiles_.column(0, d), solution_, dt, t.begin, t.end, tiles_.column(1, d));
  velocities(t, 1, nullptr, t.begin, t.end);
  to_eta({at(t, 1, 0, t.begin), at(t, 1, 1, t.begin), at(t, 1, 2, t.begin), t.begin, t.end - t.begin});
}

StepTaker::Outcome SlidingStep::take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                                     const std::vector<VecHandle>& slopes, Vec, double begin) const {
  constexpr double any = std::numeric_limits<double>::infinity();
  const double rtol = norm.tolerances.relative[0];
  ErrorNorm of_logarithms = norm;
  of_logarithms.tolerances.absolute = {rtol, any, rtol};
  of_logarithms.tolerances.relative.fill(0);
  StepErrors::Sums sums;
  {
    std::vector<Writing> kept;
    kept.reserve(slopes.size());
    for (const VecHandle& slope : slopes) kept.emplace_back(slope);
    tiles_.pass(
        u, u_new, stages() * tiles_.half_width(), [&](const Tile& t) { through(t, dt, begin); },
        [&](const Tile& t) {
          for (std::size_t i = 0; i < kept.size(); ++i) tiles_.store(t, slopes_from + int(i), kept[i]);
          tiles_.measure(t, error_, dt, of_logarithms, estimate, sums, [&] {
            const double* const psi_y = at(t, scratch_, 0, t.own_begin);
            const double* const psi_state = at(t, scratch_, 1, t.own_begin);
            const double *const of_y = at(t, 0, 1, t.own_begin), *const of_state = at(t, 0, 2, t.own_begin);
            double* const of_psi = at(t, 0, 0, t.own_begin);
            for (PetscInt i = 0; i < t.own_end - t.own_begin; ++i)
              of_psi[i] = psi_y[i] > 0 ? of_y[i] + psi_state[i] / psi_y[i] * of_state[i] : 0;
          });
        });
  }
  const Model& model = tiles_.model();
  model.count_evaluations(stages());
  return StepErrors::over_ranks(model.comm(), sums, norm, estimate,
                                double(model.scene().n) * (model.dof() - 1));
}

namespace {

// Calls body(psi, force, state, first, count) for columns of the nodes of a Vec, and puts them back.
template <class Body>
void over_columns(const Model& model, Vec u, const Body& body) {
  constexpr PetscInt most = kernel::tile_size;
  const kernel::Copy to = kernel::copy_loop<true>(3), from = kernel::copy_loop<false>(3);
  double psi[most], force[most], state[most];
  double* const columns[] = {psi, force, state};
  const Writing a(u);
  for (PetscInt first = 0; first < model.local(); first += most) {
    const PetscInt count = std::min(most, model.local() - first);
    const kernel::Interleaved nodes{a + first * 3, columns, count};
    to(nodes);
    body(psi, force, state, first, count);
    from(nodes);
  }
}

}  // namespace

void SlidingStep::begin_sum(Vec u) const {
  over_columns(tiles_.model(), u, [&](double* psi, double* force, double* state, PetscInt first,
                                      PetscInt count) { to_y({psi, force, state, first, count}); });
}

void SlidingStep::end_sum(Vec u) const {
  over_columns(tiles_.model(), u,
               [&](double* psi, double* force, double* state, PetscInt first, PetscInt count) {
                 double psi_y[kernel::tile_size], psi_state[kernel::tile_size], a[kernel::tile_size];
                 double g[kernel::tile_size];
                 keeping_held(psi, first, count, [&] {
                   law_.velocities({force, state, nullptr, count, tiles_.number(first)},
                                   {psi, psi_y, psi_state, a, g});
                 });
                 to_eta({psi, force, state, first, count});
               });
}

}  // namespace stickslip
