#include "output/rest_fraction.hpp"

#include <algorithm>
#include <cmath>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "model/moved_nodes.hpp"

namespace stickslip {

namespace {

constexpr double soon = 16;  // of a step: no next one is longer

}  // namespace

SummaryKey RestFraction::key() {
  return {
      "rest_fraction", "1",
      "part of `measured_over` at rest, a mean over the nodes; 0: nothing rests. With regularised friction "
      "a node rests where abs(psi) is below 4 `friction_eps`"};
}

RestFraction::RestFraction(const Model& model, double t_end)
    : model_(model), t_end_(t_end),
      slow_(model.scene().friction.jumps_at_rest() && model.scene().friction.regularised
                ? 4 * model.scene().friction.eps
                : 0),
      rests_(std::size_t(model.local())), rested_(1), rates_{NodeRates(model), NodeRates(model)} {}

void RestFraction::step(const ObservedStep& step) {
  const double begin = std::max(step.t_before, 0.75 * t_end_), dt = std::max(step.t - begin, 0.);
  if (by_clusters_) {
    measured_ += dt;
    rested_[0] +=
        dt * (model_.scene().n - double(model_.held(0)) - double(model_.held(model_.scene().n - 1)));
    return;
  }
  const double whole = step.t - step.t_before;
  // of what is looked at closely only what is measured, and the step before it
  if (slow_ > 0 && step.t + soon * whole < 0.75 * t_end_) return last_.clear();
  const Reading u(step.u);
  if (slow_ == 0 || !last_.empty()) measured_ += dt;
  rested_[0] += dt * (slow_ > 0 ? look_within(u + 0, step.t, whole, whole > 0 ? 1 - dt / whole : 0)
                                : double(look_at(u + 0)));
}

std::pair<PetscInt, PetscInt> RestFraction::free_nodes() const {
  PetscInt begin = 0, end = model_.local();  // held are ends of the line alone
  if (begin < end && model_.held(model_.first())) ++begin;
  if (begin < end && model_.held(model_.first() + end - 1)) --end;
  return {begin, end};
}

long RestFraction::look_at(const double* psi) {
  const PetscInt dof = model_.dof();
  const auto [begin, end] = free_nodes();
  long both = 0;
  for (PetscInt i = begin; i < end; ++i) {
    const std::uint8_t rests = psi[i * dof] == 0;
    both += rests & rests_[i];
    rests_[i] = rests;
  }
  return both;
}

double RestFraction::look_within(const double* u, double t, double dt, double begin) {
  const double slow = slow_, normal = model_.normal_load(t).N;
  const PetscInt dof = model_.dof();
  const auto [from, to] = free_nodes();
  now_ = 1 - now_;
  if (rates_[now_].ask_beside()) rates_[now_].look_beside(u);
  long both = 0;
  double some = 0;
  for (PetscInt i = from; i < to && !last_.empty(); ++i) {
    const double before = last_[i * dof], psi = u[i * dof];
    const std::uint8_t rests = std::abs(psi) <= slow;
    both += rests & rests_[i];
    // what passes through rest within the step comes near it at its ends, or turns round
    const bool is_near = std::min(std::abs(before), std::abs(psi)) <= 2 * slow || (before < 0) != (psi < 0);
    if (is_near && !(rests & rests_[i])) some += part_at_rest(i, u, normal, dt, begin);
    rests_[i] = rests;
  }
  if (last_.empty())
    for (PetscInt i = from; i < to; ++i) rests_[i] = std::abs(u[i * dof]) <= slow;
  last_.assign(u, u + model_.local() * dof);
  last_normal_ = normal;
  return double(both) + (begin < 1 ? some / (1 - begin) : 0);
}

double RestFraction::part_at_rest(PetscInt i, const double* u, double normal, double dt, double begin) const {
  const PetscInt dof = model_.dof();
  const auto moment = [&](const double* at, double load, const NodeRates& rates) {
    return NodeMoment{at[0], at[1], dof == 3 ? at[2] : 0, load, rates.ask_beside() ? rates.beside(i) : 0};
  };
  const NodeMoment a = moment(&last_[i * dof], last_normal_, rates_[1 - now_]),
                   b = moment(&u[i * dof], normal, rates_[now_]);
  const double rate_a = rates_[now_].of(i, a, 0, dt);
  // what is outside at both ends, on one side, comes in only if it begins by that
  if (std::abs(a.psi) > slow_ && std::abs(b.psi) > slow_ && a.psi * b.psi > 0 && rate_a * a.psi > 0) return 0;
  const double rate_b = rates_[now_].of(i, b, 0, dt);
  return StepCourse(a.psi, b.psi, rate_a, rate_b, dt).part_within(slow_, begin);
}

// What is advanced and slides does not rest.
void RestFraction::moved(const MovedNodes& m, const MediumNow&) {
  const double dt = m.t1 - std::max(m.t0, 0.75 * t_end_);
  for (PetscInt k = 0; k < m.count && dt > 0; ++k)
    if (m.direction[k] != 0 && !model_.held((m.first + k) % model_.scene().n)) rested_[0] -= dt;
}

void RestFraction::archive(Archive& a) {
  if (!a.has("rest.rested")) return;
  double t_end = t_end_;
  a("rest.measured", t_end, measured_);
  std::vector<double> rests(rests_.begin(), rests_.end());
  a.nodes("rest.rests", {&rests});
  rests_.assign(rests.begin(), rests.end());
  if (slow_ > 0 && a.has("rest.within")) {
    double slow = slow_;
    if (last_.empty()) last_normal_ = 0;
    a("rest.within", slow, last_normal_);
    const auto dof = std::size_t(model_.dof()), n = std::size_t(model_.local());
    std::vector<std::vector<double>> columns(dof, std::vector<double>(n));
    std::vector<std::vector<double>*> lists;
    for (std::size_t d = 0; d < dof; ++d) {
      for (std::size_t i = 0; i < n && !last_.empty(); ++i) columns[d][i] = last_[i * dof + d];
      lists.push_back(&columns[d]);
    }
    a.nodes("rest.last", lists);
    last_.resize(dof * n);
    for (std::size_t i = 0; i < dof * n; ++i) last_[i] = columns[i % dof][i / dof];
    if (last_normal_ == 0) last_.clear();  // not looked at
    if (!last_.empty() && rates_[now_].ask_beside()) rates_[now_].look_beside(last_.data());
  }
  a.by_rank("rest.rested", rested_);
  if (t_end == t_end_) return;
  measured_ = 0;  // the last quarter of another run
  rested_ = {0};
}

void RestFraction::summarise(Summary& summary, Vec u) {
  if (!u || !(measured_ > 0)) return;
  double all[2] = {rested_[0], 0};
  for (PetscInt i = 0; i < model_.local(); ++i) all[1] += model_.held(model_.first() + i) ? 0 : 1;
  sum_over(model_.comm(), all, 2);
  if (all[1] > 0) summary.set("rest_fraction", all[0] / all[1] / measured_);
}

}  // namespace stickslip
