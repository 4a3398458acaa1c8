#include "cycles/stick_deviations.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/periodic_mesh.hpp"

namespace stickslip {

namespace {

using std::size_t;
using Complex = std::complex<double>;

// Steps in which a wave turns by no more than this carry it to 1e-11; the motion's own, of up to
// StickMotion's longest, are short beside everything else.
constexpr double turn_of_step = .7, turn_of_longest = 1.2;

}  // namespace

StickDeviations::StickDeviations(const Scene& cell, const StickCycle& cycle) : motion_(cell), cycle_(cycle) {
  for (PetscInt i = 0; i < cell.n; ++i) rows_.push_back(turned_row(cell, i));
  at_ends_ = nodes_at_ends(rows_);
}

// What psi of the next cells does to the rates: as D2 psi of the node.
LowRankCoupling StickDeviations::feed(const std::vector<double>& direction) const {
  const Scene& s = motion_.scene();
  const size_t dof = size_t(motion_.dof());
  LowRankCoupling feed;
  for (const size_t i : at_ends_) {
    const bool slides = direction[i] != 0;
    std::vector<double> into(motion_.size());
    const NodeCoefficients c = s.coefficients(PetscInt(i));
    into[i * dof] = slides ? c.A * s.N() : 0;
    into[i * dof + 1] = s.mean_K1() - (slides ? c.s_delta * s.N() : 0);
    feed.into.push_back(std::move(into));
    feed.of.push_back(i * dof);
  }
  return feed;
}

// Nothing moves: psi does not deviate, and eta keeps what it has.
IntervalPropagator StickDeviations::resting(double from, double to,
                                            const std::function<void(double, double*)>& at) const {
  const size_t d = motion_.size(), dof = size_t(motion_.dof());
  std::vector<double> begin(d), end(d), matrix(d * d);
  at(from, begin.data());
  at(to, end.data());
  for (size_t k = 0; k < d; ++k) {
    if (k % dof == 1) matrix[k * d + k] = 1;
    if (k % dof == 2)
      matrix[k * d + k] = motion_.state_contraction(int(k / dof), begin[k], end[k], to - from);
  }
  return {int(d), std::move(matrix), {}};
}

IntervalPropagator StickDeviations::jump(const std::vector<double>& was, const StickState& now) const {
  const size_t d = motion_.size(), dof = size_t(motion_.dof());
  const double N = motion_.scene().N();
  std::vector<double> matrix(d * d), unit(d);
  for (size_t k = 0; k < d; ++k) matrix[k * d + k] = 1;
  LowRankCoupling beside;
  if (N > 0) beside = feed(std::vector<double>(size_t(motion_.nodes())));
  for (std::vector<double>& into : beside.into) std::fill(into.begin(), into.end(), 0.);
  for (const StickMotion::Jump& jump : motion_.jumps(was, now)) {
    const size_t first = size_t(jump.change.node) * dof;
    const bool starts = jump.change.before == 0;
    if (starts) check_release(size_t(jump.change.node), now);
    for (size_t k = 0; k < d; ++k) {
      std::fill(unit.begin(), unit.end(), 0.);
      unit[k] = 1;
      jump.matrix.apply(&unit[first], starts ? motion_.neighbour_force(jump.change.node, unit.data()) : 0);
      for (size_t a = first; a < first + dof; ++a) matrix[a * d + k] = unit[a];
    }
    for (size_t a = 0; a < beside.of.size(); ++a)
      if (starts && beside.of[a] == first) jump.matrix.apply(&beside.into[a][first], N);
  }
  return {int(d), std::move(matrix), beside};
}

// With viscosity a node's copies in the next cells begin to slip with it, and where these are its neighbours
// motions beside it do it one by one: no matter where they do it without a jump in psi_t.
void StickDeviations::check_release(size_t node, const StickState& now) const {
  const TurnedRow& row = rows_[node];
  if (motion_.scene().N() == 0 || std::none_of(row.begin(), row.end(), [&](const TurnedTerm& t) {
        return t.turns != 0 && size_t(t.node) == node;
      }))
    return;
  std::vector<double> rates(motion_.size());
  motion_.rates(now.direction, now.u.data(), rates.data());
  if (rates[node * size_t(motion_.dof())] != 0)
    throw Failure(
        "cycle_spectrum: with viscosity between neighbours nodes that are alike begin to slip at once with a "
        "jump in their acceleration: in a wave on them they do it one by one, in an order of its own");
}

const std::vector<IntervalPropagator>& StickDeviations::links(int halvings) {
  const auto [found, is_new] = links_.try_emplace(halvings);
  if (!is_new) return found->second;
  std::vector<IntervalPropagator>& links = found->second;
  const size_t d = motion_.size();
  const double longest = std::ldexp(motion_.longest() * turn_of_step / turn_of_longest, -halvings);
  const Collocation& gauss = Collocation::gauss5();
  std::vector<double> direction, u(d), J(mesh_stages * d * d);
  StickReturnMapOptions wishes;
  wishes.changed = [&](const std::vector<double>& was, const StickState& now) {
    if (was != now.direction) links.push_back(jump(was, now));
    direction = now.direction;
  };
  wishes.passed = [&](double from, double to, const std::function<void(double, double*)>& at) {
    if (!(to > from)) return;
    if (std::all_of(direction.begin(), direction.end(), [](double going) { return going == 0; }))
      return links.push_back(resting(from, to, at));
    const LowRankCoupling beside = feed(direction);
    const int count = std::max(1, int(std::ceil((to - from) / longest * (1 - 1e-12))));
    const double h = (to - from) / count;
    for (int k = 0; k < count; ++k) {
      for (size_t j = 0; j < mesh_stages; ++j) {
        at(from + (k + gauss.c[j]) * h, u.data());
        motion_.jacobian(direction, u.data(), &J[j * d * d]);
      }
      links.emplace_back(gauss, int(d), int(d) - 1, h, J.data(), beside);
    }
  };
  return_map_of(motion_, cycle_, wishes);
  return links;
}

std::vector<Complex> StickDeviations::of_wave(double kappa2) {
  const Scene& s = motion_.scene();
  const double own = std::sqrt(s.A() * s.K0()),
               wave = std::sqrt(std::max(0., s.A() * (s.K0() + s.K1() * kappa2)));
  const double fastest = std::max(wave, s.A() * s.N() * std::abs(kappa2));
  const int halvings = std::max(0, int(std::ceil(std::log2(fastest / own))));
  return multipliers_of(int(motion_.size()), links(halvings), std::vector<double>{-kappa2});
}

std::vector<Complex> StickDeviations::of_phase(double theta) {
  return multipliers_of(int(motion_.size()), links(0), phase_weights(rows_, at_ends_, theta));
}

}  // namespace stickslip
