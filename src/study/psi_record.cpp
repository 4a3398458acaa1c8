#include "study/psi_record.hpp"

#include <algorithm>
#include <cmath>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"

namespace stickslip {

namespace {
constexpr PetscInt most_nodes = 8;
constexpr std::size_t least_passages = 4;
}  // namespace

PsiRecord::PsiRecord(const Model& model)
    : first_(model.first()), local_(model.local()), dof_(model.dof()), comm_(model.comm()) {
  const PetscInt n = model.scene().n, count = std::min(n, most_nodes);
  for (PetscInt k = 0; k < count; ++k) nodes_.push_back((2 * k + 1) * n / (2 * count));
  psi_.resize(nodes_.size());
}

void PsiRecord::step(const ObservedStep& step) {
  std::vector<double> values(nodes_.size(), 0.);
  {
    const Reading a(step.u);
    for (std::size_t k = 0; k < nodes_.size(); ++k)
      if (nodes_[k] >= first_ && nodes_[k] < first_ + local_) values[k] = a[(nodes_[k] - first_) * dof_];
  }
  sum_over(comm_, values.data(), int(values.size()));
  t_.push_back(step.t);
  for (std::size_t k = 0; k < nodes_.size(); ++k) psi_[k].push_back(values[k]);
}

PsiRecord::Range PsiRecord::range(std::size_t node, double from) const {
  return within(node, from, t_.back());
}

PsiRecord::Range PsiRecord::within(std::size_t node, double from, double to) const {
  const double a = at(node, from), b = at(node, to);
  Range range{std::min(a, b), std::max(a, b)};
  for (auto i = std::upper_bound(t_.begin(), t_.end(), from); i != t_.end() && *i < to; ++i) {
    const double psi = psi_[node][i - t_.begin()];
    range = {std::min(range.low, psi), std::max(range.high, psi)};
  }
  return range;
}

double PsiRecord::at(std::size_t node, double t) const {
  const std::vector<double>& psi = psi_[node];
  const auto above = std::size_t(std::upper_bound(t_.begin(), t_.end(), t) - t_.begin());
  if (above == 0 || above == t_.size()) return above == 0 ? psi.front() : psi.back();
  const double part = (t - t_[above - 1]) / (t_[above] - t_[above - 1]);
  return psi[above - 1] + part * (psi[above] - psi[above - 1]);
}

std::optional<double> PsiRecord::leaves(const PsiRecord& truth, double room, double lag) const {
  double widest = 0;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const Range all = truth.range(k, truth.t_.front());
    widest = std::max(widest, (all.high - all.low) / 2);
  }
  for (std::size_t i = 0; i < t_.size(); ++i)
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const Range near = truth.within(k, (1 - lag) * t_[i], std::min((1 + lag) * t_[i], truth.t_.back()));
      const double psi = psi_[k][i];
      if (!(psi >= near.low - room * widest && psi <= near.high + room * widest)) return t_[i];
    }
  return std::nullopt;
}

std::optional<double> PsiRecord::period(double irregular) const {
  const double begin = (t_.front() + t_.back()) / 2;
  std::size_t widest = 0;
  for (std::size_t k = 1; k < nodes_.size(); ++k) {
    const Range one = range(k, begin), best = range(widest, begin);
    if (one.high - one.low > best.high - best.low) widest = k;
  }
  const Range all = range(widest, begin);
  const double middle = (all.low + all.high) / 2;
  const std::vector<double>& psi = psi_[widest];
  std::vector<double> passages;
  for (std::size_t i = 1; i < t_.size(); ++i)
    if (t_[i - 1] >= begin && psi[i - 1] < middle && psi[i] >= middle)
      passages.push_back(t_[i - 1] + (middle - psi[i - 1]) / (psi[i] - psi[i - 1]) * (t_[i] - t_[i - 1]));
  if (passages.size() < least_passages) return std::nullopt;
  const double mean = (passages.back() - passages.front()) / double(passages.size() - 1);
  for (std::size_t i = 1; i < passages.size(); ++i)
    if (std::abs(passages[i] - passages[i - 1] - mean) > irregular * mean) return std::nullopt;
  return mean;
}

}  // namespace stickslip
