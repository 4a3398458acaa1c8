#include "output/regime_classifier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double finest = 1 << 20;  // windows that the whole run has when it begins

}  // namespace

Traces::Traces(const Model& model, const std::function<double(PetscInt)>& steady, double t_end)
    : model_(model), rates_(model), forward_(forward(model.scene())), t_end_(t_end) {
  const Scene& s = model.scene();
  const auto n = std::size_t(s.n), whole = n * std::size_t(s.copies), wanted = std::min(most_places, whole);
  std::set<std::size_t> nodes;
  for (std::size_t k = 0; k < wanted; ++k)
    nodes.insert(std::size_t(double(k) * double(whole) / double(wanted)) % n);
  for (const std::size_t node : nodes) {
    const PetscInt own = PetscInt(node) - model.first();
    if (own >= 0 && own < model.local()) places_.push_back({own, count_, forward_ * steady(PetscInt(node))});
    if (!model.held(PetscInt(node))) free_.push_back(count_);
    ++count_;
  }
}

// Of forward * psi.
StepCourse Traces::course(const Place& place, const Sample& from, const Sample& to, double dt) const {
  const double aside = from.psi + to.psi;
  const auto rate = [&](const Sample& at) {
    return forward_ * (std::isnan(at.rate) ? rates_.of(place.node, at, aside, dt) : at.rate);
  };
  return {forward_ * from.psi, forward_ * to.psi, rate(from), rate(to), dt};
}

// psi turns near now_: in the step that led there or in the one of dt that leaves it, whose windows are
// begun; its extremum belongs to the window in which it lies.
void Traces::refine(std::size_t k, double dt, const Sample& next) {
  const double before = forward_ * before_[k].psi, now = forward_ * now_[k].psi, then = forward_ * next.psi;
  const StepCourse behind = course(places_[k], now_[k], next, dt);
  const bool turns_behind = (behind.slope(0) > 0) == (now > before);
  const StepCourse psi = turns_behind ? behind : course(places_[k], before_[k], now_[k], last_dt_[k]);
  const double from = turns_behind ? time_[k] : time_[k] - last_dt_[k],
               length = turns_behind ? dt : last_dt_[k];
  // What turns within steps that resolve it goes beyond them by an eighth of what they cover, in a parabola;
  // where slopes are stiff and steps long, the cubic means nothing.
  const double reach = std::max(std::abs(now - before), std::abs(then - now)) / 3;
  psi.extrema([&](double s) {
    if (!(std::abs(psi(s) - now) <= reach)) return;
    const auto at = (static_cast<std::size_t>(index_of(from + s * length)) - 1) * places_.size() + k;
    low_[at] = std::min(low_[at], psi(s));
    high_[at] = std::max(high_[at], psi(s));
  });
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

// The window that holds t is begun.
void Traces::begin_windows_for(double t, double dt) {
  widen_windows(t, dt);
  begin_windows(std::max(windows_, static_cast<std::size_t>(index_of(t))));
}

// Of a place, windows from the one that it has come to on. psi where one ends and the next begins belongs to
// both; it never lies beyond both ends of the step, where slopes are stiff and the cubic means nothing.
void Traces::open_windows(std::size_t k, double t, const Sample& next) {
  const auto begun = static_cast<std::size_t>(index_of(time_[k])),
             needed = static_cast<std::size_t>(index_of(t));
  if (needed <= begun) return;
  const double dt = t - time_[k], now = forward_ * now_[k].psi, then = forward_ * next.psi,
               least = std::min(now, then), largest = std::max(now, then);
  const StepCourse psi = course(places_[k], now_[k], next, dt);
  const std::size_t count = places_.size();
  for (std::size_t w = begun; w < needed; ++w) {
    const double s = std::clamp((begin_ + double(w) * window_ - time_[k]) / dt, 0., 1.);
    const double at_border = std::min(std::max(psi(s), least), largest);
    double &low_before = low_[(w - 1) * count + k], &high_before = high_[(w - 1) * count + k];
    low_[w * count + k] = high_[w * count + k] = at_border;
    low_before = std::min(low_before, at_border);
    high_before = std::max(high_before, at_border);
  }
}

void Traces::start(double t) {
  started_ = true;
  begin_ = t;
  window_ = std::max(t_end_ - begin_, std::numeric_limits<double>::min()) / finest;
  begin_windows(1);
  time_.assign(places_.size(), t);
  last_dt_.assign(places_.size(), 0.);
}

void Traces::step(const ObservedStep& step) {
  const Reading values(step.u);
  const bool begins = !started_;
  if (begins) {
    start(step.t_before);
    now_.resize(places_.size());
    before_.resize(places_.size());
  } else {
    begin_windows_for(step.t, step.t - step.t_before);
  }
  const int dof = model_.dof();
  const double normal = model_.normal_load(step.t).N;
  if (rates_.ask_beside()) rates_.look_beside(&values[0]);
  for (std::size_t k = 0; k < places_.size(); ++k) {
    const double* const at = &values[places_[k].node * dof];
    Sample next;
    next.psi = at[0];
    next.eta = at[1];
    next.state = dof == 3 ? at[2] : 0;
    next.normal = normal;
    if (rates_.ask_beside()) next.beside = rates_.beside(places_[k].node);
    if (begins) {
      low_[k] = high_[k] = forward_ * next.psi;
      before_[k] = now_[k] = next;
    } else if (step.t > time_[k]) {
      advance(k, step.t, next);
    }
  }
  t_ = step.t;
}

// Places lie in the order of their nodes.
void Traces::moved(const MovedNodes& m) {
  const PetscInt n = model_.scene().n;
  const auto take = [&](PetscInt first, PetscInt last) {
    auto place = std::lower_bound(places_.begin(), places_.end(), first,
                                  [](const Place& one, PetscInt node) { return one.node < node; });
    for (; place != places_.end() && place->node <= last; ++place)
      follow(std::size_t(place - places_.begin()), m, m.place(place->node, n));
  };
  take(m.first, std::min(m.first + m.count, n) - 1);
  if (m.first + m.count > n) take(0, m.first + m.count - n - 1);
}

void Traces::follow(std::size_t k, const MovedNodes& m, PetscInt at) {
  if (!(m.t1 > time_[k])) return;
  begin_windows_for(m.t1, m.t1 - m.t0);
  const auto of = [&](const MovedNodes::End& end) {
    Sample found;
    found.psi = end.psi[at];
    found.eta = end.eta[at];
    found.state = end.state ? end.state[at] : 0;
    found.rate = end.psi_rate[at];
    return found;
  };
  if (m.t0 > time_[k]) advance(k, m.t0, of(m.begin));
  advance(k, m.t1, of(m.end));
}

// The place has `next` at t.
void Traces::advance(std::size_t k, double t, const Sample& next) {
  advanced_ += 1;
  open_windows(k, t, next);
  take_in(k, t, next);
  last_dt_[k] = t - time_[k];
  time_[k] = t;
  before_[k] = now_[k];
  now_[k] = next;
}

void Traces::take_in(std::size_t k, double t, const Sample& sample) {
  const double dt = t - time_[k], before = forward_ * before_[k].psi, now = forward_ * now_[k].psi,
               next = forward_ * sample.psi, steady = places_[k].steady;
  const std::size_t at = (static_cast<std::size_t>(index_of(t)) - 1) * places_.size() + k;
  low_[at] = std::min(low_[at], next);
  high_[at] = std::max(high_[at], next);
  if (now < steady && next >= steady) {
    passages_[at] += 1;
    passed_[at] = time_[k] + dt * course(places_[k], now_[k], sample, dt).rise_to(steady);
  }
  if ((next - now) * (now - before) < 0) refine(k, dt, sample);
}

double Traces::steps() const {
  return largest_over(model_.comm(), places_.empty() ? 0 : advanced_ / double(places_.size()));
}

MotionRecord Traces::record() const {
  MotionRecord r;
  r.begin = begin_;
  r.window = window_;
  r.t = t_;
  r.windows = started_ ? windows_ : 0;
  r.places = count_;
  r.free = free_;
  r.steps = steps();
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

bool Traces::archive(Archive& a, bool by_clusters) {
  const std::string name = seen_from(model_.scene(), "traces.windows");
  if (!a.has(name) || !a.has("traces.moments")) return false;
  std::size_t windows = started_ ? windows_ : 0;
  double last_dt = last_dt_.empty() ? 0 : last_dt_[0];
  a(name, begin_, window_, t_, last_dt, windows);
  if (windows == 0) return false;
  if (windows > most_windows) throw std::runtime_error("its measurements do not fit the scene");
  started_ = true;
  begin_windows(windows);
  now_.resize(places_.size());
  before_.resize(places_.size());
  time_.resize(places_.size(), t_);
  last_dt_.resize(places_.size(), last_dt);
  for (const auto& [part, values] : {std::pair{"traces.low", &low_},
                                     {"traces.high", &high_},
                                     {"traces.passages", &passages_},
                                     {"traces.passed", &passed_}}) {
    std::vector<Archive::Own> own;
    for (std::size_t i = 0; i < values->size(); ++i)
      own.push_back({i / places_.size() * count_ + places_[i % places_.size()].index, &(*values)[i]});
    a.spread(part, windows * count_, own);
  }
  std::vector<Archive::Own> moments;
  for (std::size_t k = 0; k < places_.size(); ++k) {
    std::size_t at = 12 * places_[k].index;
    for (Sample* m : {&now_[k], &before_[k]})
      for (double* value : {&m->psi, &m->eta, &m->state, &m->normal, &m->beside, &m->rate})
        moments.push_back({at++, value});
  }
  a.spread("traces.moments", 12 * count_, moments);
  double steps = a.restores() ? 0 : this->steps();
  a("traces.steps", steps);
  advanced_ = steps * double(places_.size());
  if (a.restores() ? !a.has("traces.times") : !by_clusters) return true;
  std::vector<Archive::Own> times;
  for (std::size_t k = 0; k < places_.size(); ++k) {
    times.push_back({2 * places_[k].index, &time_[k]});
    times.push_back({2 * places_[k].index + 1, &last_dt_[k]});
  }
  a.spread("traces.times", 2 * count_, times);
  return true;
}

}  // namespace stickslip
