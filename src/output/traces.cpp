#include "output/traces.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"

namespace stickslip {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double finest = 1 << 20;  // windows that the whole run has when it begins

// The cubic with values y0, y1 and slopes m0, m1 (times the step) at 0 and 1: its values where its slope is 0 between.
template <class Take>
void take_extrema(double y0, double y1, double m0, double m1, const Take& take) {
  const double a = 3 * (2 * (y0 - y1) + m0 + m1), b = 2 * (3 * (y1 - y0) - 2 * m0 - m1);  // slope a s^2 + b s + m0
  const double root = b * b - 4 * a * m0;
  if (!(root >= 0)) return;
  const double q = -(b + std::copysign(std::sqrt(root), b)) / 2;
  for (const double s : {a != 0 ? q / a : -1., q != 0 ? m0 / q : -1.})
    if (s > 0 && s < 1) take(y0 + s * (m0 + s * (b / 2 + s * a / 3)));
}

}  // namespace

Traces::Traces(const Model& model, const std::function<double(PetscInt)>& steady, double t_end)
    : model_(model), t_end_(t_end) {
  const Scene& s = model.scene();
  const auto n = std::size_t(s.n), whole = n * std::size_t(s.copies), wanted = std::min(most_places, whole);
  std::set<std::size_t> nodes;
  for (std::size_t k = 0; k < wanted; ++k) nodes.insert(std::size_t(double(k) * double(whole) / double(wanted)) % n);
  for (const std::size_t node : nodes) {
    const PetscInt own = PetscInt(node) - model.first();
    if (own >= 0 && own < model.local()) places_.push_back({own, count_, steady(PetscInt(node)), {}, {}});
    ++count_;
  }
  for (std::vector<double>* values : {&low_, &high_, &passages_, &passed_})
    values->resize(most_windows * places_.size());
}

double Traces::slope(const Place& place, const Sample& at) const {
  const Scene& s = model_.scene();
  if (model_.held(model_.first() + place.node) || at.psi == 0) return 0;  // at rest, or passing through it
  if (s.massless()) return 0;  // psi_t is not known from the node alone: no extreme is sought within the step
  return s.A() * (at.eta - s.B() * at.psi - model_.friction(place.node, at.psi, at.state).F);
}

Traces::Sample Traces::sample(const Place& place, const double* u) const {
  const int dof = model_.dof();
  const double* at = u + place.node * dof;
  return {at[0], at[1], dof == 3 ? at[2] : 0};
}

// psi at a part of the step from place.now to `next`, by the cubic; never beyond both ends, where slopes are stiff and it
// means nothing.
std::function<double(double)> Traces::within(const Place& place, const Sample& next, double dt) const {
  const double y0 = place.now.psi, y1 = next.psi, m0 = dt * slope(place, place.now), m1 = dt * slope(place, next);
  return [=](double s) {
    const double cubic = y0 + s * (m0 + s * (3 * (y1 - y0) - 2 * m0 - m1 + s * (2 * (y0 - y1) + m0 + m1)));
    return s <= 0 ? y0 : s >= 1 ? y1 : std::clamp(cubic, std::min(y0, y1), std::max(y0, y1));
  };
}

// psi turns near `place.now`: in the step that led there or in the one that leaves it.
void Traces::refine(const Place& p, const Sample& next, double dt_before, double dt, double& low, double& high) const {
  const double there = slope(p, p.now);
  // What turns within steps that resolve it goes beyond them by an eighth of what they cover, in a parabola; where
  // slopes are stiff and steps long, the cubic means nothing.
  const double reach = std::max(std::abs(p.now.psi - p.before.psi), std::abs(next.psi - p.now.psi)) / 3;
  const auto take = [&](double psi) {
    if (!(std::abs(psi - p.now.psi) <= reach)) return;
    low = std::min(low, psi);
    high = std::max(high, psi);
  };
  if ((there > 0) == (p.now.psi > p.before.psi))
    take_extrema(p.now.psi, next.psi, dt * there, dt * slope(p, next), take);
  else
    take_extrema(p.before.psi, p.now.psi, dt_before * slope(p, p.before), dt_before * there, take);
}

void Traces::begin_window(std::size_t window, std::size_t place, double low, double high) {
  const std::size_t at = window * places_.size() + place;
  low_[at] = low;
  high_[at] = high;
  passages_[at] = 0;
  passed_[at] = -infinity;
}

void Traces::join_pairs() {
  const std::size_t count = places_.size();
  for (std::size_t w = 0; w < most_windows / 2; ++w)
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t to = w * count + k, from = 2 * w * count + k;
      low_[to] = std::min(low_[from], low_[from + count]);
      high_[to] = std::max(high_[from], high_[from + count]);
      passages_[to] = passages_[from] + passages_[from + count];
      passed_[to] = std::max(passed_[from], passed_[from + count]);
    }
  windows_ = (windows_ + 1) / 2;
  window_ *= 2;
}

// Windows up to the one that holds the end of the step, with psi where they begin and end within it.
void Traces::open_windows(const ObservedStep& step, const double* u) {
  const auto index = [&] { return std::max(1., std::ceil((step.t - begin_) / window_ * (1 - 1e-12))); };
  while (index() > double(most_windows)) {
    // all that are passed are begun before they are joined
    const std::size_t count = places_.size();
    for (; windows_ < most_windows; ++windows_)
      for (std::size_t k = 0; k < count; ++k) begin_window(windows_, k, places_[k].now.psi, places_[k].now.psi);
    join_pairs();
  }
  const auto needed = static_cast<std::size_t>(index());
  const std::size_t count = places_.size();
  for (std::size_t k = 0; k < count && windows_ < needed; ++k) {
    const Place& p = places_[k];
    const auto psi = [&, cubic = within(p, sample(p, u), step.t - step.t_before)](std::size_t window) {
      return cubic((begin_ + double(window) * window_ - step.t_before) / (step.t - step.t_before));
    };
    for (std::size_t w = windows_; w < needed; ++w) {
      const double begin = psi(w), end = w + 1 < needed ? psi(w + 1) : begin;
      begin_window(w, k, std::min(begin, end), std::max(begin, end));
    }
  }
  windows_ = std::max(windows_, needed);
}

void Traces::step(const ObservedStep& step) {
  const Reading values(step.u);
  const double* u = &values[0];
  const double dt = step.t - step.t_before;
  if (!started_) {
    started_ = true;
    begin_ = step.t_before;
    window_ = std::max(t_end_ - begin_, std::numeric_limits<double>::min()) / finest;
    for (std::size_t k = 0; k < places_.size(); ++k) {
      places_[k].now = places_[k].before = sample(places_[k], u);
      begin_window(0, k, places_[k].now.psi, places_[k].now.psi);
    }
  } else {
    open_windows(step, u);
    const std::size_t first = (windows_ - 1) * places_.size();
    for (std::size_t k = 0; k < places_.size(); ++k) {
      Place& p = places_[k];
      const Sample next = sample(p, u);
      double &low = low_[first + k], &high = high_[first + k];
      low = std::min(low, next.psi);
      high = std::max(high, next.psi);
      if (p.now.psi < p.steady && next.psi >= p.steady) {
        passages_[first + k] += 1;
        passed_[first + k] = step.t_before + dt * (p.steady - p.now.psi) / (next.psi - p.now.psi);
      }
      if ((next.psi - p.now.psi) * (p.now.psi - p.before.psi) < 0) refine(p, next, last_dt_, dt, low, high);
      p.before = p.now;
      p.now = next;
    }
  }
  t_ = step.t;
  last_dt_ = dt;
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
  const std::size_t own = places_.size();
  for (const auto& [all, part] : {std::pair{&r.low, &low_}, {&r.high, &high_}, {&r.passages, &passages_},
                                  {&r.passed, &passed_}}) {
    all->assign(r.windows * count_, -infinity);
    for (std::size_t w = 0; w < r.windows; ++w)
      for (std::size_t k = 0; k < own; ++k) (*all)[w * count_ + places_[k].index] = (*part)[w * own + k];
  }
  for (std::vector<double>* values : {&r.low, &r.high, &r.passages, &r.passed, &r.steady})
    largest_over(model_.comm(), values->data(), int(values->size()));
  return r;
}

void Traces::save(Checkpoint& checkpoint) const {
  const MotionRecord r = record();
  std::vector<double> samples(6 * count_);
  for (const Place& p : places_) {
    const double values[6] = {p.now.psi, p.now.eta, p.now.state, p.before.psi, p.before.eta, p.before.state};
    std::copy(values, values + 6, &samples[6 * p.index]);
  }
  sum_over(model_.comm(), samples.data(), int(samples.size()));
  checkpoint.arrays["traces.low"] = r.low;
  checkpoint.arrays["traces.high"] = r.high;
  checkpoint.arrays["traces.passages"] = r.passages;
  checkpoint.arrays["traces.passed"] = r.passed;
  checkpoint.arrays["traces.samples"] = samples;
  checkpoint.arrays["traces.windows"] = {begin_, window_, t_, last_dt_, double(r.windows)};
}

bool Traces::restore(const Checkpoint& checkpoint) {
  const auto found = checkpoint.arrays.find("traces.windows");
  if (found == checkpoint.arrays.end() || found->second.size() != 5 || found->second[4] == 0) return false;
  const std::vector<double>&scalars = found->second, &samples = checkpoint.arrays.at("traces.samples");
  const auto windows = static_cast<std::size_t>(scalars[4]);
  const std::size_t own = places_.size();
  bool fits = windows <= most_windows && samples.size() == 6 * count_;
  for (const auto& [name, part] : {std::pair{"traces.low", &low_}, {"traces.high", &high_},
                                   {"traces.passages", &passages_}, {"traces.passed", &passed_}}) {
    const std::vector<double>& all = checkpoint.arrays.at(name);
    fits = fits && all.size() == windows * count_;
    if (!fits) throw std::runtime_error("its measurements do not fit the scene");
    for (std::size_t w = 0; w < windows; ++w)
      for (std::size_t k = 0; k < own; ++k) (*part)[w * own + k] = all[w * count_ + places_[k].index];
  }
  started_ = true;
  begin_ = scalars[0];
  window_ = scalars[1];
  t_ = scalars[2];
  last_dt_ = scalars[3];
  windows_ = windows;
  for (Place& p : places_) {
    const double* at = &samples[6 * p.index];
    p.now = {at[0], at[1], at[2]};
    p.before = {at[3], at[4], at[5]};
  }
  return true;
}

}  // namespace stickslip
