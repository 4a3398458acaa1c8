#include "output/field_watch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include "numerics/straight_line.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

namespace {

constexpr double most_tracked = 1024;
constexpr std::int64_t phase_places_of_ring = 8192;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

FieldWatch::FieldWatch(const Model& model, double t_end)
    : model_(model), t_begin_(0.75 * t_end), t_end_(t_end), next_look_(t_begin_) {
  const Scene& s = model.scene();
  if (s.ring()) return;
  const auto quarter = s.n / 4;
  const double from = double(quarter), to = double(s.n - quarter);
  tracked_first_ = from;
  tracked_stride_ = std::max(1., std::ceil((to - from) / most_tracked));
  for (double node = from; node < to; node += tracked_stride_) {
    ++tracked_count_;
    const auto own = static_cast<PetscInt>(node) - model.first();
    if (own >= 0 && own < model.local()) tracked_.push_back({own, nan, nan});
  }
}

void FieldWatch::step(const ObservedStep& step) {
  if (step.t < t_begin_) return;
  const Reading values(step.u);
  const double* u = &values[0];
  if (steps_ == 0) first_step_t_ = step.t;
  const Extremes extremes = widen_to(u, step.t >= t_end_);
  for (Tracked& node : tracked_)
    if (moved_steps_ == 0) pass(node, last_t_, step.t, u[node.node * model_.dof()]);
  if (steps_ == 0 || (steps_ >= 4 && step.t >= next_look_) || step.t >= t_end_) look(step.t, u, extremes);
  if (model_.scene().ring() && mode_ > 0 && phase_is_due(step.t)) take_phase(step.t, u);
  ++steps_;
  last_t_ = step.t;
}

void FieldWatch::pass(Tracked& node, double from, double to, double psi) const {
  const double v = model_.scene().v, side = forward(model_.scene());
  const double a = side * (node.psi - v), b = side * (psi - v);
  if (a < 0 && b >= 0) node.passed = from + (to - from) * a / (a - b);
  node.psi = psi;
}

void FieldWatch::moved(const MovedNodes& m) {
  if (m.t1 < t_begin_ || low_.empty()) return;
  if (high_.empty()) high_ = low_;
  const PetscInt n = model_.scene().n;
  const auto stride = PetscInt(tracked_stride_), first = PetscInt(tracked_first_);
  for (PetscInt k = 0; k < m.count; ++k) {
    if (m.direction[k] == 0) continue;
    const PetscInt i = m.first + k < n ? m.first + k : m.first + k - n;
    const double psi0 = m.t0 >= t_begin_ ? m.begin.psi[k] : m.end.psi[k], psi1 = m.end.psi[k];
    low_[i] = std::min({low_[i], psi0, psi1});
    high_[i] = std::max({high_[i], psi0, psi1});
    const PetscInt beyond = i - first, place = beyond / stride;
    if (tracked_.empty() || beyond < 0 || beyond % stride != 0 || place >= PetscInt(tracked_.size()))
      continue;
    tracked_[place].psi = m.begin.psi[k];
    pass(tracked_[place], m.t0, m.t1, psi1);
  }
  moved_steps_ += 1;
  moved_time_ += m.t1 - m.t0;
}

// On a ring a phase is followed, from the start of the quarter on, at a few times and then ever fewer.
double FieldWatch::next_look(double t) const {
  constexpr double first = 8, parts = 4096, growth = 1.03, looks = 16;
  if (t < t_begin_) return t_begin_;
  const double whole = t_end_ - t_begin_, part = (t - t_begin_) / whole, margin = 1e-9;
  double next = (std::floor(looks * part * (1 + margin) + margin) + 1) / looks;
  if (model_.scene().ring() && mode_ > 0)
    next = parts * part < first - margin
               ? (std::floor(parts * part + margin) + 1) / parts
               : first / parts *
                     std::pow(growth,
                              std::floor(std::log(part * parts / first) / std::log(growth) + margin) + 1);
  return next < 1 - margin ? t_begin_ + whole * next : t < t_end_ ? t_end_ : HUGE_VAL;
}

FieldRange FieldWatch::range(const double* u) const { return {u, model_.local(), model_.dof()}; }

// Behind the last step no range will be asked for but the largest: nothing is kept. Up to the second step one
// array holds the least and the largest psi: touching new memory takes longer than a pass.
Extremes FieldWatch::widen_to(const double* u, bool at_end) {
  if (at_end) {
    const double* const low = low_.empty() ? nullptr : low_.data();
    const LastExtremes last = widest(range(u), low, high_.empty() ? low : high_.data());
    largest_range_ = std::max(largest_range_, last.range);
    return {last.low, last.high};
  }
  if (low_.empty()) {
    const auto n = static_cast<std::size_t>(model_.local()), dof = static_cast<std::size_t>(model_.dof());
    low_.resize(n);
    for (std::size_t i = 0; i < n; ++i) low_[i] = u[i * dof];
    const FieldSums sums = sums_of(range(u));
    return {sums.low, sums.high};
  }
  if (high_.empty()) high_ = low_;
  return widen(range(u), low_.data(), high_.data());
}

void FieldWatch::look(double t, const double* u, const Extremes& own) {
  const Scene& s = model_.scene();
  double extremes[2] = {-own.low, own.high};
  largest_over(model_.comm(), extremes, 2);
  const double width = extremes[1] + extremes[0], scale = scales_of(s).velocity;
  const Fronts fronts = fronts_of(range(u), s.v, 0.05 * width);
  const double steepest = largest_over(model_.comm(), std::max(step_to_next_rank(u), fronts.steepest));
  // what lies nearer to sliding than stick-slip does (regime.hpp) has no front, be it as rough as noise
  if (width > 0.05 * scale) steepest_ = std::max(steepest_, steepest / width);
  pulses_ = width > 1e-3 * scale ? count_pulses(fronts.passages) : 0;
  if (mode_ < 0) mode_ = pulses_;
  // not before the fifth step, then ever later
  next_look_ = t + 0.2 * (t - first_step_t_);
}

// At the first eight steps, and then so densely that it can be followed.
bool FieldWatch::phase_is_due(double t) const {
  if (moments_.empty() || steps_ < 8 || t >= t_end_) return true;
  const double last = moments_.back().t;
  return t >= last + 0.03 * (last - first_step_t_);
}

void FieldWatch::take_phase(double t, const double* u) {
  double phase = phase_of(u);
  if (!moments_.empty()) {
    const Moment &first = moments_.front(), &last = moments_.back();
    const double speed = last.t > first.t ? (last.phase - first.phase) / (last.t - first.t) : 0;
    const double expected = last.phase + speed * (t - last.t);
    phase = expected + std::remainder(phase - expected, 2 * M_PI);
  }
  moments_.push_back({t, phase});
}

// From this rank's last node to the next rank's first; between the last and the first of all only on a ring.
double FieldWatch::step_to_next_rank(const double* u) const {
  const int rank = rank_in(model_.comm()), ranks = ranks_in(model_.comm());
  double next = 0;
  SS_TRY(MPI_Sendrecv(u, 1, MPI_DOUBLE, (rank + ranks - 1) % ranks, 0, &next, 1, MPI_DOUBLE,
                      (rank + 1) % ranks, 0, model_.comm(), MPI_STATUS_IGNORE));
  const bool joined = rank + 1 < ranks || model_.scene().ring();
  return joined ? std::abs(next - u[(model_.local() - 1) * model_.dof()]) : 0;
}

int FieldWatch::count_pulses(const Passages& own) const {
  std::vector<Passages> all(ranks_in(model_.comm()));
  SS_TRY(MPI_Allgather(&own, 3, MPI_INT, all.data(), 3, MPI_INT, model_.comm()));
  Passages line;
  for (const Passages& part : all) line.append(part);
  if (model_.scene().ring()) return line.up + (line.last == -1 && line.first == 1 ? 1 : 0);  // as many down
  const int down = line.up + (line.last == -1 ? 1 : 0) - (line.first == -1 ? 1 : 0);
  return model_.scene().v < 0 ? down : line.up;
}

// 8192 nodes round the ring, and 512 at least for each turn, all nodes of smaller ones; with the sine and
// cosine of mode_ turns there. From one place to the next the node moves on by n/count or by one more, and
// its angle by one of two that are known; what round-off adds stays below 1e-11.
void FieldWatch::choose_phase_places() {
  const std::int64_t n = model_.scene().n, mode = mode_, begin = model_.first(), end = begin + model_.local();
  const std::int64_t count = std::min(n, std::max<std::int64_t>(phase_places_of_ring, 512 * mode)),
                     stride = n / count, rest = n % count;
  const auto turn_of = [&](std::int64_t nodes) {
    return std::polar(1., 2 * M_PI * double(nodes * mode % n) / double(n));
  };
  const std::complex<double> short_way = turn_of(stride), long_way = turn_of(stride + 1);
  std::int64_t k = (begin * count + n - 1) / n, node = k * n / count, part = k * n % count;
  std::complex<double> turn = turn_of(node);
  phase_places_.reserve(std::size_t(model_.local() * count / n) + 2);
  for (; k < count && node < end; ++k) {
    phase_places_.push_back({PetscInt(node - begin), turn.real(), turn.imag()});
    part += rest;
    const bool is_long = part >= count;
    node += stride + (is_long ? 1 : 0);
    part -= is_long ? count : 0;
    turn *= is_long ? long_way : short_way;
  }
}

// Of the Fourier coefficient of psi with mode_ turns round the ring. What other harmonics add to it at so
// many places falls with their number a turn, and turns with the wave, which the slope over many moments
// levels.
double FieldWatch::phase_of(const double* u) {
  if (moments_.empty() || phase_places_.empty()) {
    phase_places_.clear();
    choose_phase_places();
  }
  double sums[2] = {0, 0};
  for (const PhasePlace& place : phase_places_) {
    const double psi = u[place.node * model_.dof()];
    sums[0] += psi * place.cosine;
    sums[1] -= psi * place.sine;
  }
  sum_over(model_.comm(), sums, 2);
  return std::atan2(sums[1], sums[0]);
}

// Each moment stands for the time around it, since they are denser at first.
std::optional<double> FieldWatch::ring_speed() const {
  const std::size_t count = moments_.size();
  if (count < 4) return std::nullopt;
  StraightLine line;
  for (std::size_t k = 0; k < count; ++k)
    line.add(moments_[k].t, moments_[k].phase,
             moments_[std::min(k + 1, count - 1)].t - moments_[k == 0 ? 0 : k - 1].t);
  const double slope = line.slope();
  // Phases have errors of round-off: a pattern that has moved by less stands, and has no speed.
  const double way = std::abs(slope) * (moments_.back().t - moments_.front().t);
  if (!(std::sqrt(line.left() / line.weight()) < 0.3) || way < 1e-9)
    return std::nullopt;
  return -slope * model_.scene().length / (2 * M_PI * mode_);
}

// Among those on all ranks.
std::size_t FieldWatch::place_of(const Tracked& node) const {
  return static_cast<std::size_t>((double(node.node + model_.first()) - tracked_first_) / tracked_stride_);
}

// The times of passage climb along one pulse and drop by about a period where the next one takes over. A
// passage is known to a fraction of a step, so the slope is taken over whole climbs, never node by node.
std::optional<double> FieldWatch::passage_speed() const {
  std::vector<double> passed(tracked_count_, 0);
  for (const Tracked& node : tracked_) passed[place_of(node)] = node.passed;
  sum_over(model_.comm(), passed.data(), int(passed.size()));
  const std::size_t n = passed.size();
  if (steps_ < 2 || n < 4) return std::nullopt;
  const double interval = moved_steps_ > 0 ? moved_time_ / moved_steps_
                                           : (last_t_ - first_step_t_) / double(steps_ - 1),
               h = model_.scene().h() * tracked_stride_;
  std::vector<double> slowness;
  for (std::size_t i = 0; i + 1 < n; ++i) {
    const double s = (passed[i + 1] - passed[i]) / h;
    if (std::isfinite(s)) slowness.push_back(s);
  }
  if (slowness.size() < n / 2) return std::nullopt;
  const auto middle = slowness.begin() + static_cast<std::ptrdiff_t>(slowness.size() / 2);
  std::nth_element(slowness.begin(), middle, slowness.end());
  const double largest_climb = 4 * (interval + h * std::abs(*middle));

  // Least squares with one slope for all climbs and a constant for each; `up`, `down`: nodes by the sign of
  // their climb.
  double xx = 0, xt = 0, tt = 0, up = 0, down = 0;
  for (std::size_t begin = 0; begin < n;) {
    std::size_t end = begin + 1;
    while (end < n && std::abs(passed[end] - passed[end - 1]) < largest_climb) ++end;
    StraightLine climb;
    for (std::size_t i = std::exchange(begin, end); i < end; ++i) climb.add(h * double(i), passed[i]);
    if (!(climb.count() > 4)) continue;
    (climb.product() > 0 ? up : down) += climb.count();
    xx += climb.width();
    xt += climb.product();
    tt += climb.height();
  }
  if (std::max(up, down) < 0.8 * double(n) || xt == 0) return std::nullopt;
  // Root mean squares: what is left beside the line, and the line itself.
  if (tt - xt * xt / xx > 0.01 * xt * xt / xx) return std::nullopt;
  return xx / xt;
}

FieldWatch::Result FieldWatch::result() const {
  Result r;
  if (steps_ == 0) return r;
  double widest_so_far = largest_range_;
  for (std::size_t i = 0; i < high_.size() && last_t_ < t_end_; ++i)
    widest_so_far = std::max(widest_so_far, high_[i] - low_[i]);
  r.amplitude = largest_over(model_.comm(), widest_so_far) / 2;
  r.steepest = steepest_;
  r.pulses = pulses_;
  if (pulses_ == 0) return r;
  if (!model_.scene().ring())
    r.wave_speed = passage_speed();
  else if (pulses_ == mode_)
    r.wave_speed = ring_speed();
  return r;
}

void FieldWatch::archive(Archive& a, bool by_clusters) {
  if (!a.has("watch.measured")) return;
  double t_end = t_end_;
  bool has_ranges = !low_.empty();
  if (high_.empty()) high_ = low_;
  largest_range_ = largest_over(model_.comm(), largest_range_);
  a.list("watch.measured", [&](NumberList& x) {
    x(t_end);
    if (t_end != t_end_) return x.skip_rest();
    x(next_look_, steps_, last_t_, first_step_t_, mode_, pulses_, steepest_, largest_range_, has_ranges);
    x.rest(moments_, [&](Moment& moment) { x(moment.t, moment.phase); });
  });
  if (t_end != t_end_) return;  // the last quarter of another run
  if (has_ranges) {
    a.nodes("watch.low", {&low_});
    a.nodes("watch.high", {&high_});
  }
  if (a.restores() ? a.has("watch.moved") : by_clusters) a("watch.moved", moved_steps_, moved_time_);
  if (steps_ == 0 || tracked_count_ == 0) return;
  const std::string name = seen_from(model_.scene(), "watch.tracked");
  if (!a.has(name)) throw std::runtime_error("its passages were not seen in the plate's direction");
  std::vector<Archive::Own> own;
  for (Tracked& node : tracked_) {
    own.push_back({2 * place_of(node), &node.psi});
    own.push_back({2 * place_of(node) + 1, &node.passed});
  }
  a.spread(name, 2 * tracked_count_, own);
}

namespace {
// no row of any order reaches further, the one-sided ones at held ends included
constexpr PetscInt widest_row = 16;
}  // namespace

NodeHalo::NodeHalo(const Scene& scene, const NodeRange& nodes)
    : first_(static_cast<PetscInt>(nodes.first)), count_(static_cast<PetscInt>(nodes.count)) {
  if (nodes.count == nodes.all) return;
  std::set<PetscInt> beside;
  for (PetscInt i = 0; i < count_; ++i) {
    if (i == widest_row) i = std::max(i, count_ - widest_row);
    for (const auto& term : second_difference_row(scene, first_ + i))
      if (term.first < first_ || term.first >= first_ + count_) beside.insert(term.first);
  }
  nodes_.assign(beside.begin(), beside.end());
  fetch_.emplace(NodeFetch::Layout{nodes.comm, count_, static_cast<PetscInt>(nodes.all), 1}, 1, nodes_);
}

std::vector<double> NodeHalo::fetch(const std::vector<double>& own) const {
  if (!fetch_) return {};
  fetch_->take(own.data());
  return {fetch_->values(), fetch_->values() + nodes_.size()};
}

std::size_t NodeHalo::place_of(PetscInt node) const {
  return static_cast<std::size_t>(std::lower_bound(nodes_.begin(), nodes_.end(), node) - nodes_.begin());
}

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// Steeper than three times the way from end to end a cubic between two values is not monotone: slopes that
// are (of stiff steps) say nothing of where it passes between them.
double bounded(double slope, double way) { return std::clamp(slope, -3 * std::abs(way), 3 * std::abs(way)); }

}  // namespace

NodeRates::NodeRates(const Model& model) : model_(model) {
  const bool steep = model.local() > 0 && model.friction_law(0).steep && model.scene().K1() != 0;
  if (model.viscous() || model.scene().massless() || steep)
    halo_.emplace(model.scene(), NodeRange::of(model));
}

void NodeRates::look_beside(const double* u) {
  psi_.resize(std::size_t(model_.local()));
  for (std::size_t i = 0; i < psi_.size(); ++i) psi_[i] = u[i * std::size_t(model_.dof())];
  fetched_ = halo_->fetch(psi_);
}

double NodeRates::beside(PetscInt local_node) const {
  const Scene& s = model_.scene();
  const PetscInt node = model_.first() + local_node;
  double sum = 0;
  for (const auto& [j, factor] : model_.viscous() ? second_difference_row(s, node) : coupling_row(s, node))
    sum += factor * halo_->at(j, psi_, fetched_);
  return model_.viscous() ? s.N() * sum : sum;
}

double NodeRates::of(PetscInt local_node, const NodeMoment& at, double aside, double dt) const {
  if (model_.held(model_.first() + local_node)) return 0;
  const Scene& s = model_.scene();
  const double least = std::copysign(std::numeric_limits<double>::min(), aside);
  const double psi = at.psi == 0 && s.friction.sticks() ? least : at.psi;
  const NodeCoefficients c = model_.coefficients(local_node);
  Partials F = model_.friction_law(local_node).partials(psi, at.state);
  const double factor = at.normal * model_.amplitude()[local_node];
  F = {factor * F.F, factor * F.F_psi, factor * F.F_state};
  if (!s.massless() && (model_.viscous() || !(4. / 27 * dt * c.A * (c.B + F.F_psi) > 1)))
    return c.A * (at.eta + (model_.viscous() ? at.beside : 0) - c.B * psi - F.F);
  // the balance, along which psi goes: that of eta and the state, of neighbours too
  if (s.forced() || (!halo_ && s.n > 1)) return unknown;
  const double of_state = model_.dof() == 3 ? F.F_state * model_.state_rate(local_node, psi, at.state).g : 0;
  return (c.K0 * (s.v - psi) + at.beside - of_state) / (c.B + F.F_psi);
}

StepCourse::StepCourse(double psi0, double psi1, double rate0, double rate1, double dt)
    : HermiteCubic(psi0, psi1, std::isfinite(rate0) ? dt * rate0 : psi1 - psi0,
                   std::isfinite(rate1) ? dt * rate1 : psi1 - psi0) {}

double StepCourse::rise_to(double level) const {
  const double y1 = (*this)(1), m1 = slope(1), way = y1 - y0;
  const HermiteCubic between(y0, y1, bounded(m0, way), bounded(m1, way));
  return find_root([&](double s) { return between(s) - level; },
                   {0, y0 - level, 1, std::max(0., y1 - level)}, 0);
}

double StepCourse::part_below(double level, double begin) const {
  std::array<double, 4> turns = {begin, 1, 1, 1};  // from one to the next it is monotone
  std::size_t count = 1;
  extrema([&](double s) { turns[count++] = std::max(s, begin); });
  if (count == 3 && turns[2] < turns[1]) std::swap(turns[1], turns[2]);
  double sum = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double a = turns[k], b = turns[k + 1], at_a = (*this)(a) - level, at_b = (*this)(b) - level;
    if ((at_a <= 0) == (at_b <= 0)) {
      sum += at_a <= 0 ? b - a : 0;
    } else {
      const double s = find_root([&](double x) { return (*this)(x) - level; }, {a, at_a, b, at_b}, 0);
      sum += at_a <= 0 ? s - a : b - s;
    }
  }
  return sum;
}

double StepCourse::part_within(double level, double begin) const {
  return part_below(level, begin) - part_below(-level, begin);
}

void set_period(Summary& summary, double period, double error) {
  constexpr double round_off = 1e-15;
  const double all = std::max(error, round_off * std::abs(period));
  const double digits = std::floor(std::log10(std::abs(period))) - std::floor(std::log10(all)) + 4;
  const auto rounded = [](double value, double to) {
    return std::stod(rounded_text(value, int(std::clamp(to, 1., 17.))));
  };
  summary.set("period", rounded(period, digits));
  summary.set("period_error", rounded(all, 2));
}

}  // namespace stickslip
