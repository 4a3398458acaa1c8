#include "output/measures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "base/json_values.hpp"
#include "model/moved_nodes.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Announces every time from `begin` on: where psi passes or turns is known only afterwards.
void announce_from(double begin, ObservationPlan& plan) {
  plan.next_times.push_back([begin](double t) { return std::max(std::nextafter(t, infinity), begin); });
}

// The extrema of Chebyshev's polynomial of degree 8 on [0, 1]: no method here has dense output of a higher
// degree.
const Lagrange& through_step() {
  static const Lagrange through([] {
    std::vector<double> points;
    for (int i = 0; i <= 8; ++i) points.push_back((1 - std::cos(M_PI * i / 8)) / 2);
    return points;
  }());
  return through;
}

// The largest value of the polynomial in [low, high].
double largest_of(const Lagrange& through, const double* values, double low, double high) {
  const auto below = [&](double at) { return -through.value(values, at); };
  return -find_least(below, low, high, 1e-9 * (high - low), [](double) { return false; }).value;
}

}  // namespace

// ---- period ----

Period::Period(const Model& model, const Scene& whole, const std::vector<double>& x, double t_end, bool exact)
    : model_(model), probes_(model, whole, x), attention_(probes_.nodes(), model.scene().n),
      work_(model.create_vector()),
      name_(seen_from(whole, "period")), forward_(forward(whole)), level_(whole.v),
      depth_(0.01 * scales_of(whole).velocity), begin_(t_end / 2), exact_(exact),
      places_(x.size()), rates_(model) {
  for (std::size_t p = 0; p < places_.size() && !exact; ++p)
    probes_.for_parts(p, [&](std::size_t index, double weight) {
      const PetscInt own = probes_.nodes()[index] - model.first();
      if (own >= 0 && own < model.local()) parts_.push_back({p, index, own, weight, {}, {}});
    });
}

void Period::plan(ObservationPlan& plan) {
  by_clusters_ = plan.by_clusters;
  if (exact_ && !places_.empty()) announce_from(begin_, plan);
}

void Period::step(const ObservedStep& step) {
  if (step.t < begin_ || places_.empty()) return;
  if (by_clusters_) return see(step.t, probes_.read(step.u).psi);
  if (!exact_) {
    if (!seen_.empty() && !(step.t > seen_.back().t)) return;
    look_at_parts(step.u, step.t);
    seen_.push_back({step.t, probes_.read(step.u).psi});
    steps_ += 1;
    if (seen_.size() > 2) seen_.erase(seen_.begin());
    for (std::size_t p = 0; p < places_.size() && seen_.size() == 2; ++p) {
      std::optional<StepCourse> psi;
      pass(p, [&](double t) {
        if (!psi) psi = course(p);
        return (*psi)((t - seen_[0].t) / (seen_[1].t - seen_[0].t));
      });
    }
    return;
  }
  if (step.t_before < begin_) {  // the first one: from the beginning of the half on
    step.interpolate(begin_, work_);
    seen_.push_back({begin_, probes_.read(work_).psi});
  }
  seen_.push_back({step.t, probes_.read(step.u).psi});
  if (seen_.size() > 4) seen_.erase(seen_.begin());
  if (seen_.size() < 2) return;
  for (std::size_t p = 0; p < places_.size(); ++p)
    pass(p, [&](double t) {
      step.interpolate(t, work_);
      return probes_.read(work_).psi[p];
    });
}

void Period::look_at_parts(Vec u, double t) {
  const Reading values(u);
  const int dof = model_.dof();
  if (rates_.ask_beside()) rates_.look_beside(&values[0]);
  for (OwnPart& part : parts_) {
    const double* const at = &values[part.node * dof];
    part.before = part.now;
    part.now = {at[0], at[1], dof == 3 ? at[2] : 0, model_.normal_load(t).N,
                rates_.ask_beside() ? rates_.beside(part.node) : 0};
  }
}

StepCourse Period::course(std::size_t place) const {
  const double dt = seen_[1].t - seen_[0].t;
  double rates[2] = {0, 0};
  for (const OwnPart& part : parts_) {
    if (part.place != place) continue;
    const double aside = part.before.psi + part.now.psi;
    rates[0] += part.weight * rates_.of(part.node, part.before, aside, dt);
    rates[1] += part.weight * rates_.of(part.node, part.now, aside, dt);
  }
  sum_over(model_.comm(), rates, 2);
  return {seen_[0].psi[place], seen_[1].psi[place], rates[0], rates[1], dt};
}

void Period::see(double t, const std::vector<double>& psi) {
  if (!seen_.empty() && !(t > seen_.back().t)) return;
  seen_.push_back({t, psi});
  steps_ += 1;
  if (seen_.size() > 4) seen_.erase(seen_.begin());
  if (seen_.size() < 2) return;
  std::vector<double> times;
  for (const Moment& moment : seen_) times.push_back(moment.t);
  for (std::size_t p = 0; p < places_.size(); ++p)
    pass(p, [&](double at) {
      std::vector<double> values;
      for (const Moment& moment : seen_) values.push_back(moment.psi[p]);
      return Lagrange(times).value(values.data(), at);
    });
}

void Period::see(double t, const MediumNow& now) {
  see(t, probes_.read([&](PetscInt i, double* u) { now.node(i, t, u); }).psi);
}

void Period::moved(const MovedNodes& nodes, const MediumNow& now) {
  if (nodes.t1 >= begin_ && attention_.moved(nodes)) see(nodes.t1, now);
}

void Period::changed(double t, const MediumNow& now) {
  if (attention_.changed(now) && t >= begin_) see(t, now);
}

// Looks for a passage between the last two moments.
void Period::pass(std::size_t index, const std::function<double(double)>& psi_at) {
  Place& place = places_[index];
  const Moment &before = seen_[seen_.size() - 2], &now = seen_.back();
  const double a = forward_ * (before.psi[index] - level_), b = forward_ * (now.psi[index] - level_);
  if (a < -depth_) place.armed = 1;
  if (!(place.armed > 0 && a < 0 && b >= 0)) return;
  place.armed = 0;
  place.passages.add(
      find_root([&](double t) { return forward_ * (psi_at(t) - level_); }, {before.t, a, now.t, b}, 0));
}

std::vector<double> Period::values() const {
  std::vector<double> periods;
  for (const Place& place : places_)
    if (place.passages.passages() > 1) periods.push_back(place.passages.mean());
  if (periods.size() < places_.size()) periods.clear();
  return periods;
}

void Period::summarise(Summary& summary, Vec u) {
  const std::vector<double> periods = values();
  if (!u || periods.empty()) return;
  const double mean = std::accumulate(periods.begin(), periods.end(), 0.) / double(periods.size());
  double error = 0;
  for (const Place& place : places_) error = std::max(error, place.passages.error());
  const double count = places_[0].passages.passages() - 1;
  set_period(summary, mean, error + errors_.of(mean, steps_ / count, count));
  if (!exact_) return;
  summary.set("period", mean);
  summary.set("period_error", Json());  // error_estimate has it
}

void Period::archive(Archive& a) {
  if (!a.has(name_ + ".passages")) return;
  a.list(name_ + ".passages", [&](NumberList& x) {
    x(steps_);
    for (Place& p : places_) {
      x(p.armed);
      p.passages.archive(x);
    }
    x.rest(seen_, [&](Moment& moment) {
      moment.psi.resize(places_.size());
      x(moment.t, moment.psi);
    });
  });
  if (!exact_) {
    std::vector<Archive::Own> own;
    for (OwnPart& part : parts_) {
      std::size_t at = 5 * part.index;
      NodeMoment& now = part.now;
      for (double* value : {&now.psi, &now.eta, &now.state, &now.normal, &now.beside})
        own.push_back({at++, value});
    }
    a.spread(name_ + ".nodes", 5 * probes_.nodes().size(), own);
  }
  if (a.restores() ? a.has("period.advanced") : by_clusters_)
    a.list("period.advanced", [&](NumberList& x) { attention_.archive(x); });
}

// ---- amplitude ----

Amplitude::Amplitude(const Model& model, double t_end)
    : model_(model), work_(model.create_vector()), begin_(0.75 * t_end) {}

void Amplitude::plan(ObservationPlan& plan) { announce_from(begin_, plan); }

void Amplitude::step(const ObservedStep& step) {
  const double from = std::max(step.t_before, begin_), length = step.t - from;
  if (length <= 0) return;
  const auto n = static_cast<std::size_t>(model_.local());
  const std::vector<double>& parts = through_step().points();
  if (low_.empty()) {
    low_.assign(n, infinity);
    high_.assign(n, -infinity);
    seen_.assign(parts.size(), std::vector<double>(n));
  }
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const bool is_end = k + 1 == parts.size();
    if (!is_end) step.interpolate(from + length * parts[k], work_);
    const Reading u(is_end ? step.u : static_cast<Vec>(work_));
    for (std::size_t i = 0; i < n; ++i) seen_[k][i] = u[i * std::size_t(model_.dof())];
  }
  std::array<double, 9> samples;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < parts.size(); ++k) samples[k] = seen_[k][i];
    take(i, samples.data());
  }
}

void Amplitude::take(std::size_t node, const double* samples) {
  const std::vector<double>& parts = through_step().points();
  const auto last = parts.size() - 1;
  std::array<double, 9> negative;
  for (const bool upwards : {true, false}) {
    const double* values = samples;
    if (!upwards) {
      std::transform(samples, samples + last + 1, negative.begin(), [](double psi) { return -psi; });
      values = negative.data();
    }
    const auto top = static_cast<std::size_t>(std::max_element(values, values + last + 1) - values);
    double largest = values[top];
    double& known = upwards ? high_[node] : low_[node];
    // what turns between two of nine values hardly rises above both
    const double reach =
        (top > 0 ? largest - values[top - 1] : 0) + (top < last ? largest - values[top + 1] : 0);
    if (largest + reach <= (upwards ? known : -known)) continue;
    if (reach > 0) {
      const double low = parts[top > 0 ? top - 1 : 0], high = parts[std::min(top + 1, last)];
      largest = std::max(largest, largest_of(through_step(), values, low, high));
    }
    known = upwards ? std::max(known, largest) : std::min(known, -largest);
  }
}

std::vector<double> Amplitude::values() const {
  if (low_.empty()) return {};
  const Scene& scene = model_.scene();
  std::vector<double> half(scene.n, 0.);
  for (std::size_t i = 0; i < low_.size(); ++i)
    half[std::size_t(model_.first()) + i] = (high_[i] - low_[i]) / 2;
  sum_over(model_.comm(), half.data(), int(half.size()));
  return {largest_about(PetscInt(std::max_element(half.begin(), half.end()) - half.begin()), half)};
}

double Amplitude::largest_about(PetscInt node, const std::vector<double>& half_ranges) const {
  const Scene& scene = model_.scene();
  const double at_node = half_ranges[node];
  const PetscInt reach = scene.order / 2, n = scene.n;
  if (scene.form == Form::chain || n < 2 * reach + 1) return at_node;
  std::vector<double> places, values;
  for (PetscInt k = -reach; k <= reach; ++k) {
    PetscInt at = node + k;
    if (scene.ring())
      at = (at + n) % n;
    else if ((at < 0 && scene.left != End::free) || (at >= n && scene.right != End::free))
      return at_node;
    else
      at = at < 0 ? -at : at >= n ? 2 * (n - 1) - at : at;
    places.push_back(double(k));
    values.push_back(half_ranges[at]);
  }
  return std::max(at_node, largest_of(Lagrange(places), values.data(), -1, 1));
}

void Amplitude::summarise(Summary& summary, Vec u) {
  const std::vector<double> found = values();
  if (u && !found.empty()) summary.set("amplitude", found[0]);
}

// ---- wave speed ----

WaveSpeed::WaveSpeed(const Model& model, double t_end)
    : field_(model, t_end), work_(model.create_vector()), ring_(model.scene().ring()), begin_(0.75 * t_end),
      t_end_(t_end) {}

// On a ring a phase is followed, from the start of the quarter on, at a few times and then ever fewer
// (field_watch.hpp takes no more than it needs); between ends passages are timed, at equally spaced ones.
double WaveSpeed::time(long index) const {
  constexpr double parts = 4096, equal = 1024, first = 8, growth = 1.03;
  const double whole = t_end_ - begin_;
  double part = double(index) / (ring_ ? parts : equal);
  if (ring_ && double(index) > first) part = first / parts * std::pow(growth, double(index) - first);
  return part < 1 ? begin_ + whole * part : t_end_;
}

void WaveSpeed::plan(ObservationPlan& plan) {
  plan.next_times.push_back([this](double t) {
    long index = next_;
    while (time(index) <= t && time(index) < t_end_) ++index;
    return time(index) > t ? time(index) : infinity;
  });
}

void WaveSpeed::step(const ObservedStep& step) {
  for (bool more = true; more && time(next_) <= step.t; ++next_) {
    const double t = time(next_);
    more = t < t_end_;
    const bool inside = t > step.t_before && t < step.t;
    if (inside) step.interpolate(t, work_);
    if (t < step.t && !inside) continue;  // of an earlier part of the run
    field_.step({step.index, next_ > 0 ? time(next_ - 1) : t, t, inside ? static_cast<Vec>(work_) : step.u,
                 step.rejections, step.interpolate});
  }
}

std::vector<double> WaveSpeed::values() const {
  const auto speed = field_.result().wave_speed;
  return speed ? std::vector<double>{*speed} : std::vector<double>{};
}

void WaveSpeed::summarise(Summary& summary, Vec u) {
  if (!u) return;
  const std::vector<double> found = values();
  if (!found.empty()) summary.set("wave_speed", found[0]);
}

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
