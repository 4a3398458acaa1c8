#include "output/traces.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "output/forward.hpp"

namespace stickslip {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double finest = 1 << 20;  // windows that the whole run has when it begins

}  // namespace

Traces::Traces(const Model& model, const std::function<double(PetscInt)>& steady, double t_end)
    : model_(model), forward_(forward(model.scene())), t_end_(t_end) {
  const Scene& s = model.scene();
  const auto n = std::size_t(s.n), whole = n * std::size_t(s.copies), wanted = std::min(most_places, whole);
  std::set<std::size_t> nodes;
  for (std::size_t k = 0; k < wanted; ++k)
    nodes.insert(std::size_t(double(k) * double(whole) / double(wanted)) % n);
  for (const std::size_t node : nodes) {
    const PetscInt own = PetscInt(node) - model.first();
    if (own >= 0 && own < model.local()) places_.push_back({own, count_, forward_ * steady(PetscInt(node))});
    ++count_;
  }
}

double Traces::slope(const Place& place, const Sample& at) const {
  if (!std::isnan(at.slope)) return at.slope;
  const Scene& s = model_.scene();
  if (model_.held(model_.first() + place.node) || at.psi == 0) return 0;  // at rest, or passing through it
  if (s.massless()) return 0;  // psi_t is not known from the node alone: no extreme is sought within the step
  const double force =
      model_.amplitude()[place.node] * model_.friction_law(place.node).force(at.psi, at.state);
  const NodeCoefficients c = model_.coefficients(place.node);
  return at.slope = c.A * (at.eta - c.B * at.psi - force);
}

Traces::Sample Traces::sample(const Place& place, const double* u) const {
  const int dof = model_.dof();
  const double* at = u + place.node * dof;
  Sample found;
  found.psi = forward_ * at[0];
  found.eta = forward_ * at[1];
  if (dof == 3) found.state = at[2];
  return found;
}

HermiteCubic Traces::cubic(const Place& place, const Sample& from, const Sample& to, double dt) const {
  return {from.psi, to.psi, dt * slope(place, from), dt * slope(place, to)};
}

// psi turns near now_: in the step that led there or in the one of dt that leaves it.
void Traces::refine(std::size_t k, double dt, double& low, double& high) const {
  const Sample &before = before_[k], &now = now_[k], &next = next_[k];
  // What turns within steps that resolve it goes beyond them by an eighth of what they cover, in a parabola;
  // where slopes are stiff and steps long, the cubic means nothing.
  const double reach = std::max(std::abs(now.psi - before.psi), std::abs(next.psi - now.psi)) / 3;
  const auto take = [&](double psi) {
    if (!(std::abs(psi - now.psi) <= reach)) return;
    low = std::min(low, psi);
    high = std::max(high, psi);
  };
  if ((slope(places_[k], now) > 0) == (now.psi > before.psi))
    cubic(places_[k], now, next, dt).extrema(take);
  else
    cubic(places_[k], before, now, last_dt_).extrema(take);
}

// The last one stands alone where their number is odd: it goes on.
void Traces::join_pairs() {
  const std::size_t count = places_.size(), left = (windows_ + 1) / 2;
  for (std::size_t w = 0; w < left && windows_ > 1; ++w)
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t to = w * count + k, from = 2 * w * count + k,
                        next = 2 * w + 1 < windows_ ? from + count : from;
      low_[to] = std::min(low_[from], low_[next]);
      high_[to] = std::max(high_[from], high_[next]);
      passages_[to] = passages_[from] + (next == from ? 0 : passages_[next]);
      passed_[to] = std::max(passed_[from], passed_[next]);
    }
  window_ *= 2;
  begin_windows(left);
}

// Memory is touched as windows are begun: a short run never sees the most of it.
void Traces::begin_windows(std::size_t until) {
  windows_ = until;
  const std::size_t size = windows_ * places_.size(), most = most_windows * places_.size();
  for (const auto& [values, empty] :
       {std::pair{&low_, infinity}, {&high_, -infinity}, {&passages_, 0.}, {&passed_, -infinity}}) {
    values->reserve(most);
    values->resize(size, empty);
  }
}

// A window is to hold two steps, unless the whole run needs finer ones.
void Traces::widen_windows(double t, double dt) {
  const double finest_of_all = (t_end_ - begin_) / double(most_windows) * (1 + 1e-12);
  while (window_ < 2 * dt && 2 * window_ <= finest_of_all) join_pairs();
  while (index_of(t) > double(most_windows)) join_pairs();
}

// The number, from 1 on, of the window that holds t or ends there.
double Traces::index_of(double t) const {
  return std::max(1., std::ceil((t - begin_) / window_ * (1 - 1e-12)));
}

// Windows up to the one that holds the end of the step. psi where one ends and the next begins belongs to
// both; it never lies beyond both ends of the step, where slopes are stiff and the cubic means nothing.
void Traces::open_windows(const ObservedStep& step) {
  const double dt = step.t - step.t_before;
  widen_windows(step.t, dt);
  const auto needed = static_cast<std::size_t>(index_of(step.t));
  const std::size_t begun = windows_, count = places_.size();
  if (needed <= begun) return;
  begin_windows(needed);
  std::vector<HermiteCubic> cubics;
  std::vector<double> least, largest;
  for (std::size_t k = 0; k < count; ++k) {
    cubics.push_back(cubic(places_[k], now_[k], next_[k], dt));
    least.push_back(std::min(now_[k].psi, next_[k].psi));
    largest.push_back(std::max(now_[k].psi, next_[k].psi));
  }
  for (std::size_t w = begun; w < needed; ++w) {
    const double s = std::clamp((begin_ + double(w) * window_ - step.t_before) / dt, 0., 1.);
    double *const low = &low_[w * count], *const high = &high_[w * count];
    for (std::size_t k = 0; k < count; ++k)
      low[k] = high[k] = std::min(std::max(cubics[k](s), least[k]), largest[k]);
    double *const low_before = low - count, *const high_before = high - count;
    for (std::size_t k = 0; k < count; ++k) low_before[k] = std::min(low_before[k], low[k]);
    for (std::size_t k = 0; k < count; ++k) high_before[k] = std::max(high_before[k], high[k]);
  }
}

void Traces::step(const ObservedStep& step) {
  const Reading values(step.u);
  next_.clear();
  for (const Place& place : places_) next_.push_back(sample(place, &values[0]));
  if (!started_) {
    started_ = true;
    begin_ = step.t_before;
    window_ = std::max(t_end_ - begin_, std::numeric_limits<double>::min()) / finest;
    begin_windows(1);
    for (std::size_t k = 0; k < places_.size(); ++k) low_[k] = high_[k] = next_[k].psi;
    now_ = next_;
  } else {
    open_windows(step);
    take_in(step);
  }
  before_.swap(now_);
  now_.swap(next_);
  t_ = step.t;
  last_dt_ = step.t - step.t_before;
}

void Traces::take_in(const ObservedStep& step) {
  const double dt = step.t - step.t_before;
  const std::size_t first = (windows_ - 1) * places_.size();
  for (std::size_t k = 0; k < places_.size(); ++k) {
    const double before = before_[k].psi, now = now_[k].psi, next = next_[k].psi, steady = places_[k].steady;
    double &low = low_[first + k], &high = high_[first + k];
    low = std::min(low, next);
    high = std::max(high, next);
    if (now < steady && next >= steady) {
      passages_[first + k] += 1;
      passed_[first + k] = step.t_before + dt * (steady - now) / (next - now);
    }
    if ((next - now) * (now - before) < 0) refine(k, dt, low, high);
  }
}

MotionRecord Traces::record() const {
  MotionRecord r;
  r.begin = begin_;
  r.window = window_;
  r.t = t_;
  r.windows = started_ ? windows_ : 0;
  r.places = count_;
  r.steady.assign(count_, -infinity);  // every place has one owner: beside it the others have minus infinity
  for (const Place& place : places_) r.steady[place.index] = place.steady;
  const std::array<const std::vector<double>*, 4> parts = {&low_, &high_, &passages_, &passed_};
  const std::array<const double**, 4> ours = {&r.low, &r.high, &r.passages, &r.passed};
  if (ranks_in(model_.comm()) == 1) {
    for (std::size_t a = 0; a < 4; ++a) *ours[a] = parts[a]->data();
    return r;
  }
  const std::size_t own = places_.size(), size = r.windows * count_;
  r.of_all_ranks.assign(4 * size, -infinity);
  for (std::size_t a = 0; a < 4; ++a) {
    double* const all = r.of_all_ranks.data() + a * size;
    *ours[a] = all;
    for (std::size_t w = 0; w < r.windows; ++w)
      for (std::size_t k = 0; k < own; ++k) all[w * count_ + places_[k].index] = (*parts[a])[w * own + k];
  }
  largest_over(model_.comm(), r.of_all_ranks.data(), int(r.of_all_ranks.size()));
  largest_over(model_.comm(), r.steady.data(), int(r.steady.size()));
  return r;
}

bool Traces::archive(Archive& a) {
  const std::string name = seen_from(model_.scene(), "traces.windows");
  if (!a.has(name)) return false;
  std::size_t windows = started_ ? windows_ : 0;
  a(name, begin_, window_, t_, last_dt_, windows);
  if (windows == 0) return false;
  if (windows > most_windows) throw std::runtime_error("its measurements do not fit the scene");
  started_ = true;
  begin_windows(windows);
  now_.resize(places_.size());
  before_.resize(places_.size());
  for (const auto& [part, values] : {std::pair{"traces.low", &low_},
                                     {"traces.high", &high_},
                                     {"traces.passages", &passages_},
                                     {"traces.passed", &passed_}}) {
    std::vector<Archive::Own> own;
    for (std::size_t i = 0; i < values->size(); ++i)
      own.push_back({i / places_.size() * count_ + places_[i % places_.size()].index, &(*values)[i]});
    a.spread(part, windows * count_, own);
  }
  std::vector<Archive::Own> samples;
  for (std::size_t k = 0; k < places_.size(); ++k) {
    std::size_t at = 6 * places_[k].index;
    for (Sample* sample : {&now_[k], &before_[k]})
      for (double* value : {&sample->psi, &sample->eta, &sample->state}) samples.push_back({at++, value});
  }
  a.spread("traces.samples", 6 * count_, samples);
  return true;
}

}  // namespace stickslip
