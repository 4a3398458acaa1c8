#include "output/regime_classifier.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "numerics/straight_line.hpp"
#include "output/field_watch.hpp"

namespace stickslip {

namespace {

constexpr double near = 0.01;    // of the scale: sliding
constexpr double moving = 0.05;  // of the scale: the least distance of stick-slip
constexpr double least_periods = 3;
constexpr double settled = 3e-5;  // of the scale: what error control leaves of a motion that has died away
// times the run so far: how long stick-slip must last where sliding is stable
constexpr double ahead = 20;
constexpr double decay_times = 3;    // of linear theory, after which what has not decayed is noise
constexpr double factor_two = 0.7;   // of a logarithm
constexpr double unchanged = 0.05;   // relative change of size that counts as none where sliding is unstable
constexpr double peak_error = 1e-4;  // of a size: extrema between steps

// The size of the motion over stretches of time: the slope of its logarithm, and twice its error and more.
struct Trend {
  double rate = 0, error = std::numeric_limits<double>::infinity(), span = 0;
  double early = 0, late = 0;          // the same in the first and the second half of the stretches
  bool known = false, halves = false;  // halves: of three stretches and more

  bool rises() const { return known && rate > error; }
  bool falls() const { return known && rate < -error; }
  // The second half no longer shows what the whole does: the motion has arrived.
  bool has_ended() const { return known && late / rate < 0.1; }
  // By how much the logarithm will still change if every half of the span multiplies the rate as the last one
  // did; infinite where it does not calm down.
  double to_come() const {
    const double q = late / early;
    return halves && q >= 0 && q < 0.6 ? std::abs(late) * span / 2 * q / (1 - q)
                                       : std::numeric_limits<double>::infinity();
  }
};

double slope_of(const std::vector<double>& x, const std::vector<double>& y, std::size_t from, std::size_t to,
                double* error) {
  StraightLine line;
  for (std::size_t i = from; i < to; ++i) line.add(x[i], y[i]);
  if (error) *error = std::sqrt((line.variance() + peak_error * peak_error) / line.width());
  return line.slope();
}

// 0 of none.
template <class T>
T middle_of(std::vector<T> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class RegimeClassifier {
 public:
  RegimeClassifier(const MotionRecord& record, const SceneContext& around)
      : r_(record), a_(around), scale_(around.scale) {
    // a window that has only begun says little
    end_ = r_.windows;
    find_passages();
    if (end_ > 8 && r_.begin + double(end_) * r_.window > r_.t * (1 + 1e-9)) --end_;
    half_ = end_ / 2;
    quarter_ = end_ - (end_ + 3) / 4;
    period_ = period();
    // the last part of the run that holds enough periods, and three whole stretches of one for a trend
    from_ = quarter_;
    if (!is_enough(from_, 6)) from_ = half_;
    if (!is_enough(from_, least_periods)) from_ = end_ / 4;
    from_ = std::max(from_, first_passage());
    // what has not passed for two periods has stopped to oscillate
    const double wanted =
        period_ > 0 && passages(end_ - std::min(end_, 2 * stretch())) > 0 ? 1.05 * period_ : r_.t / 16;
    last_ = std::size_t(std::clamp(std::ceil(wanted / r_.window), 1., std::max(1., double(half_))));
  }

  Judgement judgement() const {
    Judgement j;
    const Trend t = trend();
    if (t.known && size(end_ - last_, end_) > settled * scale_) j.rate = t.rate;
    j.motion = word(t);
    find_repeating_period(j);
    const double period = a_.forcing > 0 ? a_.forcing : j.period.value_or(0);
    const auto wanted = period > 0 ? std::size_t(std::ceil(period / r_.window)) : end_ - quarter_;
    for (std::size_t w = end_ - std::min(wanted, end_); w < r_.windows; ++w)
      for (std::size_t k = w * r_.places; k < (w + 1) * r_.places; ++k) {
        j.low = std::min(j.low, r_.low[k]);
        j.high = std::max(j.high, r_.high[k]);
      }
    if (j.motion == Motion::sliding || j.motion == Motion::stick_slip || j.motion == Motion::stuck) return j;
    j.time_to_decide = time_to_decide(j.motion, t);
    return j;
  }

 private:
  // Where nothing passes, as mostly in short runs, nothing is to be looked at.
  void find_passages() {
    for (std::size_t w = 0; w < end_; ++w) {
      const double *const row = r_.passages + w * r_.places, *const behind = row + r_.places;
      if (std::any_of(row, behind, [](double passages) { return passages > 0; })) passing_.push_back(w);
    }
  }

  // Of every place.
  struct Ranges {
    std::vector<double> low, high;
  };
  Ranges ranges(std::size_t from, std::size_t to) const {
    const std::size_t n = r_.places;
    Ranges x{{r_.low + from * n, r_.low + (from + 1) * n}, {r_.high + from * n, r_.high + (from + 1) * n}};
    for (std::size_t w = from + 1; w < to; ++w) {
      const double *const low = r_.low + w * n, *const high = r_.high + w * n;
      for (std::size_t p = 0; p < n; ++p) x.low[p] = std::min(x.low[p], low[p]);
      for (std::size_t p = 0; p < n; ++p) x.high[p] = std::max(x.high[p], high[p]);
    }
    return x;
  }
  double size(std::size_t from, std::size_t to) const {
    const Ranges x = ranges(from, to);
    double sum = 0;
    for (std::size_t p = 0; p < r_.places; ++p) {
      const double furthest = std::max(x.high[p] - r_.steady[p], r_.steady[p] - x.low[p]);
      sum += furthest * furthest;
    }
    return std::sqrt(sum / double(r_.places));
  }
  double distance(std::size_t from, std::size_t to) const {
    const Ranges x = ranges(from, to);
    double largest = 0;
    for (std::size_t p = 0; p < r_.places; ++p)
      largest = std::max(largest, std::abs((x.low[p] + x.high[p]) / 2 - r_.steady[p]) +
                                      (x.high[p] - x.low[p]) / std::sqrt(8.));
    return largest;
  }
  // Of the middle place that is not held, from a window to the end.
  double passages(std::size_t from) const {
    std::vector<double> counts(r_.free.size(), 0.);
    for (const std::size_t w : passing_)
      for (std::size_t k = 0; k < counts.size() && w >= from && w < end_; ++k)
        counts[k] += r_.passages[w * r_.places + r_.free[k]];
    return middle_of(counts);
  }

  bool is_enough(std::size_t from, double periods) const {
    return passages(from) >= periods && (end_ - from) / stretch() >= 3;
  }

  // The window by which half of the places have passed for the first time: what is before is loading. 0: they
  // have not.
  std::size_t first_passage() const {
    std::vector<std::size_t> first(r_.free.size(), end_);
    for (const std::size_t w : passing_)
      for (std::size_t k = 0; k < first.size(); ++k)
        if (r_.passages[w * r_.places + r_.free[k]] > 0) first[k] = std::min(first[k], w);
    const std::size_t middle = middle_of(first);
    return middle < end_ ? middle : 0;
  }

  // From the first to the last passage in the last three quarters, of the middle place among those that have
  // two.
  double period() const {
    std::vector<double> periods;
    for (const std::size_t p : r_.free) {
      double first = 0, last = 0, count = -1;
      for (const std::size_t w : passing_) {
        const double passages = r_.passages[w * r_.places + p];
        if (w < end_ / 4 || w >= end_ || passages == 0) continue;
        last = r_.passed[w * r_.places + p];
        if (count < 0) first = last;
        count = count < 0 ? 0 : count + passages;
      }
      if (count >= 1) periods.push_back((last - first) / count);
    }
    return 2 * periods.size() < r_.free.size() ? 0 : middle_of(periods);
  }

  // The time between passages where it is the same all through the second half, at every place that passes
  // and at half of the places at least. Windows with several passages have their mean.
  void find_repeating_period(Judgement& j) const {
    constexpr double same = 1e-3;
    double least = HUGE_VAL, most = 0, sum = 0, error = 0;
    std::size_t repeat = 0;
    for (const std::size_t p : r_.free) {
      Repeats repeats;
      for (const std::size_t w : passing_) {
        const double passages = r_.passages[w * r_.places + p], last = r_.passed[w * r_.places + p];
        if (w < half_ || w >= end_ || passages == 0) continue;
        if (repeats.passages() > 0) {
          const double time = (last - repeats.last()) / passages;
          least = std::min(least, time);
          most = std::max(most, time);
        }
        repeats.add(last, passages);
      }
      if (repeats.passages() == 0) continue;
      if (repeats.passages() < 4) return;
      sum += repeats.mean();
      error = std::max(error, repeats.error());
      ++repeat;
    }
    if (repeat == 0 || 2 * repeat < r_.free.size() || most - least > same * most) return;
    j.period = sum / double(repeat);
    j.period_error = error;
  }

  std::size_t stretch() const {  // windows that hold a period
    return std::max<std::size_t>(1, std::size_t(std::ceil(1.05 * period_ / r_.window)));
  }

  // Over the last part of the run that holds enough periods.
  Trend trend() const {
    const std::size_t windows = end_ - from_;
    // two periods where that leaves enough stretches: slips differ from one to the next
    std::size_t length = stretch();
    const auto twice = std::size_t(std::ceil(2.1 * period_ / r_.window));
    if (twice > 0 && windows / twice >= 6) length = twice;
    if (period_ == 0) length = std::max<std::size_t>(1, windows / 8);
    return trend(from_, length);
  }

  // Over whole stretches of so many windows, from a window on.
  Trend trend(std::size_t from, std::size_t length) const {
    const std::size_t count = (end_ - from) / length;
    Trend t;
    if (count < 3) return t;
    std::vector<double> x, y;
    for (std::size_t g = 0; g < count; ++g) {
      const std::size_t begin = end_ - (count - g) * length;
      const double s = size(begin, begin + length);
      if (!(s > 0)) return t;
      x.push_back((double(begin) + double(length) / 2) * r_.window);
      y.push_back(std::log(s / scale_));  // the same bits in any units
    }
    t.rate = slope_of(x, y, 0, count, &t.error);
    t.error *= 3 + 12. / double(count - 2);
    t.span = double(end_ - from) * r_.window;
    t.known = true;
    const std::size_t half = std::max<std::size_t>(2, count / 2);
    t.early = slope_of(x, y, 0, half, nullptr);
    t.late = slope_of(x, y, count - half, count, nullptr);
    t.halves = count >= 6;
    return t;
  }

  bool rests() const {
    const Ranges x = ranges(quarter_, end_);
    double fastest = a_.speed_now;
    for (std::size_t p = 0; p < r_.places; ++p) fastest = std::max({fastest, x.high[p], -x.low[p]});
    return fastest <= 1e-9 * scale_;
  }

  Motion word(const Trend& t) const {
    if (end_ < 8) return Motion::undecided;
    if (rests() && a_.v != 0) return a_.unloaded ? Motion::stuck : Motion::undecided;
    const bool unstable = a_.growth && *a_.growth > 0;
    if (distance(end_ - last_, end_) < near * scale_ && a_.distance_now < 1.5 * near * scale_ && !unstable) {
      const std::size_t earlier = std::min(half_, end_ - 2 * last_);
      const double now = size(end_ - last_, end_), before = size(earlier, earlier + last_);
      // steps so long that they let perturbations grow are held at the size of the tolerance by error control
      const bool stable = a_.growth ? *a_.growth < 0 : a_.stable && !t.rises();
      if ((now <= settled * scale_ && (!t.rises() || a_.stable)) || now < 0.9 * before || is_noise(t) ||
          (stable && (now < 1.02 * before || now <= 3 * settled * scale_)))
        return a_.v == 0 ? Motion::stuck : Motion::sliding;
    }
    if (passages(from_) >= least_periods && distance(end_ - last_, end_) >= moving * scale_ &&
        (stands(t, unstable) || wanders(unstable)))
      return Motion::stick_slip;
    if (t.has_ended()) return Motion::undecided;
    // what sliding repels does not decay to it, and what was smaller before has grown since, as bursts do
    if (t.falls() && !unstable && !a_.unstable && !was_smaller()) return Motion::decaying;
    if (t.rises() && (period_ > 0 || unstable)) return Motion::growing;
    return Motion::undecided;
  }

  // Beside sliding that is stable a motion decays; what has had the time to and has not is noise, which the
  // error control of the steps holds at the size of its tolerance.
  bool is_noise(const Trend& t) const {
    return a_.stable && t.known && !t.rises() && -a_.linear * t.span > decay_times;
  }

  // Whether some stretch before the last one, since the motion began, was clearly smaller.
  bool was_smaller() const {
    const double now = 0.9 * size(end_ - last_, end_);
    for (std::size_t end = end_ - last_; end >= first_passage() + last_; end -= last_)
      if (size(end - last_, end) < now) return true;
    return false;
  }

  // Whether an oscillation keeps its size.
  bool stands(const Trend& t, bool unstable) const {
    if (!t.known) return false;
    const double change = std::abs(t.rate) * t.span, error = t.error * t.span;
    if (unstable || sticks_each_time(half_, last_)) {
      // sliding repels, or every period forgets the one before: what changes still is the approach to the
      // oscillation
      if (unstable && t.rises() && t.rate > 0.3 * *a_.growth) return false;
      return ((change < unchanged || change <= error) && error < factor_two) ||
             (t.to_come() < unchanged && error < 0.3);
    }
    const double linear = a_.growth ? std::min(*a_.growth, 0.) : 0;
    if (linear < 0 && t.rate - t.error < 0.5 * linear) return false;
    if ((std::abs(t.rate) + t.error) * ahead * r_.t < std::log(2.)) return true;
    return t.to_come() < unchanged && t.error * ahead * r_.t < std::log(2.) && t.late > 0.3 * linear;
  }

  // Does nearly every place come to rest in every stretch of so many windows?
  bool sticks_each_time(std::size_t from, std::size_t length) const {
    if (!a_.sticks || a_.v == 0 || period_ == 0) return false;
    std::size_t resting = 0, all = 0;
    for (std::size_t begin = from; begin + length <= end_; begin += length) {
      const Ranges x = ranges(begin, begin + length);
      for (const std::size_t p : r_.free) {
        ++all;
        if ((a_.v > 0 ? x.low[p] : -x.high[p]) <= 0) ++resting;
      }
    }
    return double(resting) >= 0.9 * double(all);
  }

  // Whether a motion whose slips differ from one to the next keeps its size as a whole: over three quarters
  // of the run, in stretches of at least four slips each, it never comes near sliding and shows no trend
  // beyond its error, which must tell a factor of two.
  bool wanders(bool unstable) const {
    const std::size_t length = wandering_stretch();
    if (length == 0 || !(unstable || sticks_each_time(end_ / 4, length))) return false;
    for (std::size_t begin = end_ / 4; begin + length <= end_; begin += length)
      if (size(begin, begin + length) < moving * scale_) return false;
    const Trend t = trend(end_ / 4, length);
    return t.known && std::abs(t.rate) <= t.error && t.error * t.span < factor_two;
  }
  // In windows; 0 where there are too few slips. More than 24 stretches would say no more.
  std::size_t wandering_stretch() const {
    const double slips = passages(end_ / 4);
    return slips < 32 ? 0 : (end_ - end_ / 4) / std::size_t(std::clamp(slips / 8, 8., 24.));
  }

  double time_to_decide(Motion motion, const Trend& t) const {
    const double cycle = std::max({period_, a_.cycle, 2 * a_.loading});
    // the period of what was seen first may be that of a part only
    const double periods = 12 * (period_ > 0 && r_.t > cycle / 2 ? period_ : cycle);
    if (motion == Motion::decaying) {
      const double d = distance(end_ - last_, end_) / (near * scale_);
      return std::max(r_.t * 1.2, r_.t + std::log(std::max(1., d)) / -t.rate);
    }
    if (motion == Motion::growing)
      return 2 * (r_.t + std::log(std::max(1., scale_ / size(end_ - last_, end_))) / t.rate) + periods;
    if (rests() || passages(from_) < least_periods) return r_.t + a_.loading + periods;
    if (a_.growth && *a_.growth > 0 && a_.distance_now < near * scale_)
      return r_.t + std::log(scale_ / std::max(1e-16 * scale_, a_.distance_now)) / *a_.growth + periods;
    if ((a_.growth && *a_.growth > 0) || a_.sticks) {
      // the longer stretches are, the more alike: the error falls about as fast as the run grows
      const std::size_t length = wandering_stretch();
      const Trend w = length > 0 ? trend(end_ / 4, length) : Trend{};
      if (w.known) return r_.t * std::clamp(w.error * w.span / factor_two, 1.5, 10.);
      return 2 * r_.t + periods;
    }
    const double bound = std::log(2.) / (ahead * r_.t);
    return t.known ? r_.t * std::clamp(2 * std::pow(t.error / bound, 0.7), 2., 100.)
                   : std::max(2 * r_.t, periods);
  }

  const MotionRecord& r_;
  const SceneContext& a_;
  double scale_, period_ = 0;  // 0: none seen
  std::size_t end_ = 0, half_ = 0, quarter_ = 0;
  std::vector<std::size_t> passing_;  // windows in which some place passes
  std::size_t from_ = 0;              // of the stretch that trends are taken over
  std::size_t last_ = 1;              // windows in the last stretch
};

}  // namespace

Judgement judge(const MotionRecord& record, const SceneContext& around) {
  if (record.windows == 0) return {};
  return RegimeClassifier(record, around).judgement();
}

}  // namespace stickslip
