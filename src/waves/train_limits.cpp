#include "stickslip/waves/train_limits.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"
#include "waves/train_sheet.hpp"

namespace stickslip {

namespace {

// A limit with the place of the surface where it stands, and the mode that crosses (folds: none).
struct Found {
  TrainLimit limit;
  SheetPlace place;
  SheetChart chart;
  TrainMode mode;
};

constexpr double nowhere = std::numeric_limits<double>::quiet_NaN();

// The function whose zero a limit is, on the surface of trains. It starts from where it was asked last.
class LimitFunction {
 public:
  LimitFunction(const TrainSheet& sheet, bool fold, SheetPlace place, const TrainMode& mode)
      : sheet_(sheet), fold_(fold), place_(std::move(place)), mode_(mode) {}

  // NaN where there is no train, or the mode is lost.
  double operator()(const SheetChart& chart, double alpha, double value2) {
    const std::optional<SheetPlace> there = sheet_.at(chart, place_, alpha, value2);
    if (!there) return nowhere;
    TrainMode mode = mode_;
    if (!fold_ && !follow_mode(sheet_.train(*there), mode)) return nowhere;
    place_ = *there;
    mode_ = mode;
    return fold_ ? sheet_.slope(place_, chart) : mode_.lambda.real();
  }
  const SheetPlace& place() const { return place_; }
  const TrainMode& mode() const { return mode_; }
  bool fold() const { return fold_; }

 private:
  const TrainSheet& sheet_;
  bool fold_;
  SheetPlace place_;
  TrainMode mode_;
};

// Whether no other mode grows there. A count of all modes costs more than the limit itself.
void ask_whether_it_leads(const Train& train, TrainLimit& limit) {
  try {
    const std::vector<int> growing = growing_modes(train);
    limit.leads = std::accumulate(growing.begin(), growing.end(), 0) == 0;
  } catch (const Failure&) {
    limit.leads = false;
  }
}

Found found_at(const TrainSheet& sheet, const LimitFunction& f, const SheetChart& chart, bool stability) {
  Found found{{}, f.place(), sheet.along(f.place(), chart), f.mode()};
  const Train train = sheet.train(f.place());
  TrainLimit& limit = found.limit;
  limit.value = f.place().value();
  limit.value2 = f.place().value2;
  limit.speed = train.speed;
  limit.length = train.length;
  limit.period = train.period;
  limit.kind = "fold";
  if (!f.fold()) {
    limit.frequency = std::abs(f.mode().lambda.imag());
    limit.kind = limit.frequency < 1e-6 / train.period ? "zero" : "hopf";
    limit.wavenumber = f.mode().wavenumber;
    limit.bloch = f.mode().bloch;
  }
  if (stability) ask_whether_it_leads(train, limit);
  return found;
}

// The limits of a branch.
class LimitsOfBranch {
 public:
  enum class Count { none, all, when_asked };
  LimitsOfBranch(const TrainSheet& sheet, const Branch& branch, double value2, Count modes)
      : sheet_(sheet), branch_(branch), value2_(value2), stability_(modes != Count::none) {
    counts_.resize(branch.points.size());
    counted_.resize(branch.points.size(), false);
    for (std::size_t k = 0; modes == Count::all && k < counts_.size(); ++k) count(k);
  }

  // Whether the train of a point is stable; empty where that is not known.
  std::optional<bool> stable(std::size_t k) const {
    if (counts_[k].empty()) return std::nullopt;
    return std::accumulate(counts_[k].begin(), counts_[k].end(), 0) == 0;
  }

  // `notes`: what was seen and not located.
  std::vector<Found> all(std::vector<std::string>& notes) const {
    std::vector<Found> list;
    const auto note = [&](std::size_t k, const std::string& what) {
      notes.push_back(fmt::format("{} between {:.8g} and {:.8g} was seen and not located: more wave_steps",
                                  what, branch_.points[k].value, branch_.points[k + 1].value));
    };
    for (std::size_t k = 0; k + 1 < branch_.points.size(); ++k) {
      const bool fold = branch_.points[k + 1].fold;
      if (fold) {
        if (const auto found = fold_between(k))
          list.push_back(*found);
        else
          note(k, "a fold");
      }
      if (!stability_) continue;
      if (counts_[k].empty() || counts_[k + 1].empty()) {
        note(
            k,
            "whether stability changes is not known, since growing modes could not be counted; what happens");
        continue;
      }
      for (std::size_t m = 0; m < counts_[k].size(); ++m) {
        const int change = counts_[k + 1][m] - counts_[k][m] - (fold && m == 0 ? sign_at_fold(k) : 0);
        if (change == 0) continue;
        int located = 0;
        for (Found& found : changes_between(k, PetscInt(m), change < 0)) {
          located += own_conjugate(m) && found.limit.kind == "hopf" ? 2 : 1;
          list.push_back(std::move(found));
        }
        if (located < std::abs(change)) note(k, "a change of stability");
      }
    }
    return list;
  }

  // Those alone that part stable trains from others; `lost`: how many were seen and not located. Trains are
  // looked at where the parameter has moved by `apart` since the last: in a canard explosion it hardly moves.
  std::vector<Found> of_stable(double apart, int& lost) {
    const std::vector<BranchPoint>& points = branch_.points;
    std::vector<Found> list;
    std::size_t last = 0;
    count(0);
    for (std::size_t k = 1; k < points.size(); ++k) {
      if (k + 1 < points.size() && std::abs(points[k].value - points[last].value) < apart) continue;
      count(k);
      if (stable(last).value_or(false) != stable(k).value_or(false))
        for (std::size_t between = last; between < k; ++between) add_edge(between, list, lost);
      last = k;
    }
    return list;
  }

 private:
  void count(std::size_t k) {
    if (counted_[k]) return;
    counted_[k] = true;
    try {
      counts_[k] = growing_modes(branch_.points[k].train);
    } catch (const Failure&) {  // nothing is known of it, as too near V = c
    }
  }

  // What parts a stable train from its neighbour behind, if one of them is.
  void add_edge(std::size_t k, std::vector<Found>& list, int& lost) {
    count(k);
    count(k + 1);
    const bool before = stable(k).value_or(false);
    if (before == stable(k + 1).value_or(false)) return;
    std::optional<Found> found;
    if (branch_.points[k + 1].fold) found = fold_between(k);
    if (!found || !found->limit.leads.value_or(false)) found = edge(before ? k : k + 1, before ? k + 1 : k);
    if (found && found->limit.leads.value_or(false))
      list.push_back(std::move(*found));
    else
      ++lost;
  }

  // Between a stable train and one that is not: a place where one mode alone grows, by halving, and from
  // there where it begins to.
  std::optional<Found> edge(std::size_t stable, std::size_t other) const {
    const SheetPlace a = place(stable);
    SheetPlace b = place(other);
    const SheetChart chart = towards(a, b);
    double low = 0, high = chart.alpha(b);
    try {
      for (int halvings = 0; halvings < 40; ++halvings) {
        const std::optional<SheetPlace> middle = sheet_.at(chart, b, (low + high) / 2, value2_);
        if (!middle) return std::nullopt;
        const std::vector<int> growing = growing_modes(sheet_.train(*middle));
        const int all = std::accumulate(growing.begin(), growing.end(), 0);
        (all == 0 ? low : high) = (low + high) / 2;
        if (all > 0) b = *middle;
        if (halvings > 1 && all > 0 && all <= 2) break;  // a mode and its conjugate
      }
      for (const TrainMode& mode : train_spectrum(sheet_.train(b), 4).modes) {
        if (mode.translation || mode.lambda.imag() < 0 || !(mode.lambda.real() > 0)) continue;
        LimitFunction f(sheet_, false, b, mode);
        double end = low, far = f(chart, low, value2_);
        // growing_modes leaves out 1e-5
        for (int k = 0; k < 6 && far > 0; ++k) far = f(chart, end -= high - low, value2_);
        auto found = zero(f, chart, high, end, mode.lambda.real(), far);
        if (found && found->limit.leads.value_or(false)) return found;
      }
    } catch (const Failure&) {  // too near V = c
    }
    return std::nullopt;
  }

  // The modes of a Bloch factor that is real come in pairs of conjugates.
  bool own_conjugate(std::size_t m) const {
    return m == 0 || 2 * PetscInt(m) == branch_.points.front().train.pulses;
  }
  // By how much a fold between two points changes the count of modes that repeat from pulse to pulse.
  int sign_at_fold(std::size_t k) const {
    const int change = counts_[k + 1][0] - counts_[k][0];
    return change % 2 == 0 ? 0 : change > 0 ? 1 : -1;
  }
  SheetPlace place(std::size_t k) const {
    return sheet_.place(branch_.points[k].train, branch_.points[k].value, value2_);
  }

  // The zero of f between two points of the branch, which it has left and right values of different sign at.
  std::optional<Found> zero(LimitFunction f, const SheetChart& chart, double begin, double end, double f0,
                            double f1) const {
    if (!(f0 * f1 < 0)) return std::nullopt;
    const auto at = [&](double alpha) { return f(chart, alpha, value2_); };
    const double alpha = find_root(at, {begin, f0, end, f1}, 1e-9 * std::max(std::abs(begin), std::abs(end)));
    if (std::isnan(alpha) || std::isnan(at(alpha))) return std::nullopt;
    return found_at(sheet_, f, chart, stability_);
  }
  SheetChart towards(const SheetPlace& from, const SheetPlace& to) const {
    return sheet_.chart(from, (to.z() - from.z()) / sheet_.z_scale(), to.q() - from.q());
  }

  std::optional<Found> fold_between(std::size_t k) const {
    const SheetPlace a = place(k), b = place(k + 1);
    const SheetChart chart = towards(a, b);
    return zero(LimitFunction(sheet_, true, a, {}), chart, 0, chart.alpha(b), sheet_.slope(a, chart),
                sheet_.slope(b, chart));
  }

  // The modes with this Bloch factor that grow on one side (`before`: the first) and not on the other.
  std::vector<Found> changes_between(std::size_t k, PetscInt m, bool before) const {
    const std::size_t grows = before ? k : k + 1, decays = before ? k + 1 : k;
    const SheetPlace a = place(grows), b = place(decays);
    const SheetChart chart = towards(a, b);
    const double end = chart.alpha(b);
    const Train& train = branch_.points[grows].train;
    std::vector<Found> list;
    const TrainSpectrum spectrum = train_spectrum(train, 16);
    for (const TrainMode& mode : spectrum.modes) {
      const bool image = own_conjugate(std::size_t(m)) && mode.lambda.imag() < 0;
      if ((mode.bloch - m) % train.pulses != 0 || mode.translation || image || !(mode.lambda.real() > 0))
        continue;
      LimitFunction f(sheet_, false, a, mode);
      double far = mode.lambda.real();
      int part = 0;  // by steps: it must not be lost
      while (part < 8) far = f(chart, ++part / 8. * end, value2_);
      // what is not counted may still grow a little (growing_modes): then the zero lies beyond the neighbour
      while (far > 0 && far < 2e-5 && part < 32) far = f(chart, ++part / 8. * end, value2_);
      auto found = zero(f, chart, 0, part / 8. * end, mode.lambda.real(), far);
      const bool again = found && std::any_of(list.begin(), list.end(), [&](const Found& other) {
                           return std::abs(other.mode.lambda - found->mode.lambda) <
                                  1e-6 * (1 + std::abs(found->mode.lambda));
                         });
      if (found && !again) list.push_back(std::move(*found));
    }
    return list;
  }

  const TrainSheet& sheet_;
  const Branch& branch_;
  double value2_;
  bool stability_;
  std::vector<std::vector<int>> counts_;
  std::vector<char> counted_;
};

// The walk along one curve.
class LimitWalk {
 public:
  LimitWalk(const TrainSheet& sheet, const Found& start, double from, double to, double from2, double to2)
      : sheet_(sheet), at_(start), low_(std::min(from, to)), high_(std::max(from, to)), from2_(from2),
        to2_(to2) {}

  TrainLimitCurve walk(const std::string& name, const std::string& name2, int steps) {
    TrainLimitCurve curve;
    curve.points.push_back(at_.limit);
    double ds = 0.02;
    while (curve.end.empty() && curve.points.size() <= std::size_t(steps)) {
      const Found before = at_;
      const std::optional<double> turn = step(ds);
      if (!turn || *turn < 0.9) {
        at_ = before;
        ds /= 2;
        if (ds < 1e-4)
          curve.end = fmt::format("no way on is found at {} = {:.8g}, {} = {:.8g}", name, at_.limit.value,
                                  name2, at_.limit.value2);
        continue;
      }
      const double v = share(at_.limit.value2);
      if (at_.limit.value >= low_ && at_.limit.value <= high_ && v >= 0)
        ask_whether_it_leads(sheet_.train(at_.place), at_.limit);
      if (at_.limit.value < low_ || at_.limit.value > high_)
        curve.end = name + " leaves its range";
      else if (v < 0)
        curve.end = name2 + " comes back past its start";
      else
        curve.points.push_back(at_.limit);
      if (v >= 1) curve.end = "reached " + name2 + " = " + rounded_text(to2_, 8);
      if (*turn > 0.99) ds = std::min(0.15, 1.5 * ds);
    }
    if (curve.end.empty()) curve.end = "wave_steps " + std::to_string(steps) + " taken";
    return curve;
  }

 private:
  struct Vector {
    double alpha, v;
  };
  struct Way {
    Vector forwards, slope;  // along the curve, of length 1; the gradient of f
    double frequency_slope;  // of the mode, along the curve
  };
  double share(double value2) const { return (value2 - from2_) / (to2_ - from2_); }
  double value2(double v) const { return from2_ + v * (to2_ - from2_); }

  std::optional<Way> way(LimitFunction& f) const {
    constexpr double h = 1e-4;  // f vanishes here to 1e-9 of its slope
    const double v = share(at_.place.value2), frequency = at_.mode.lambda.imag();
    const auto slopes = [&](Vector d) {  // of f and of the frequency
      const double there = f(at_.chart, h * d.alpha, value2(v + h * d.v));
      return std::pair{there / h, (f.mode().lambda.imag() - frequency) / h};
    };
    const auto [by_alpha, w_alpha] = slopes({1, 0});
    const auto [by_v, w_v] = slopes({0, 1});
    const double size = std::hypot(by_alpha, by_v);
    if (!(size > 0)) return std::nullopt;
    Vector t{-by_v / size, by_alpha / size};
    const double ahead = last_ ? t.alpha * last_->alpha + t.v * last_->v : t.v;
    if (ahead < 0) t = {-t.alpha, -t.v};
    return Way{t, {by_alpha, by_v}, t.alpha * w_alpha + t.v * w_v};
  }

  // It is the mode that was followed, not another that Newton's method fell upon.
  bool same_mode(double predicted) const {
    constexpr double part = 0.03;  // of the frequency of the train
    return std::abs(at_.mode.lambda.imag() - predicted) < part * 2 * M_PI / at_.limit.period;
  }

  // A step of at most this length; the cosine of the angle by which the curve turned, nothing where it fails.
  std::optional<double> step(double ds) {
    LimitFunction f(sheet_, at_.limit.kind == "fold", at_.place, at_.mode);
    const auto here = way(f);
    if (!here) return std::nullopt;
    const auto& [t, g, frequency_slope] = *here;
    const double frequency = at_.mode.lambda.imag();
    const double v = share(at_.place.value2);
    // at the end of value2 the corrector moves along it
    const bool arrive = t.v > 0 && v + ds * t.v >= 1;
    if (arrive) ds = (1 - v) / t.v;
    const Vector across = arrive ? Vector{1, 0} : Vector{-t.v, t.alpha};
    const Vector ahead{ds * t.alpha, arrive ? 1 - v : ds * t.v};
    const auto beside = [&](double s) {
      return f(at_.chart, ahead.alpha + s * across.alpha, value2(v + ahead.v + s * across.v));
    };
    const double f0 = beside(0), slope = g.alpha * across.alpha + g.v * across.v;
    if (std::isnan(f0)) return std::nullopt;
    const double s = root_near(beside, 0, f0, -f0 / slope, 1e-9, std::max(0.5 * ds, 1e-4));
    if (std::isnan(s) || std::isnan(beside(s))) return std::nullopt;
    const Vector moved{ahead.alpha + s * across.alpha, ahead.v + s * across.v};
    const double length = std::hypot(moved.alpha, moved.v);
    const SheetChart old = at_.chart;
    at_ = found_at(sheet_, f, old, false);  // its modes are counted where the step stands
    if (!same_mode(frequency + frequency_slope * length)) return std::nullopt;
    last_ = moved;
    return (moved.alpha * t.alpha + moved.v * t.v) / length;
  }

  const TrainSheet& sheet_;
  Found at_;
  double low_, high_, from2_, to2_;
  std::optional<Vector> last_;  // the last step
};

TrainSheet sheet_of(const TrainFamily2& family, const Branch& branch) {
  const Train& first = branch.points.front().train;
  const double z_scale = ranges(first.values.data(), points_on(first.mesh), first.oscillator->dim())[1];
  double low = 1e300, high = -1e300;
  for (const BranchPoint& p : branch.points) {
    low = std::min(low, p.value);
    high = std::max(high, p.value);
  }
  return TrainSheet(family, high - low, z_scale);
}

}  // namespace

std::vector<TrainLimit> train_limits(const TrainFamily2& family, const Branch& branch, double value2,
                                     bool stability, std::vector<std::string>& notes) {
  const TrainSheet sheet = sheet_of(family, branch);
  const auto modes = stability ? LimitsOfBranch::Count::all : LimitsOfBranch::Count::none;
  std::vector<TrainLimit> limits;
  for (const Found& found : LimitsOfBranch(sheet, branch, value2, modes).all(notes))
    limits.push_back(found.limit);
  return limits;
}

std::vector<TrainLimitCurve> train_limit_curves(const TrainFamily2& family, const Branch& branch, double from,
                                                double to, double from2, double to2, int steps,
                                                std::vector<std::string>& notes) {
  const TrainSheet sheet = sheet_of(family, branch);
  std::vector<TrainLimitCurve> curves;
  for (const Found& found : LimitsOfBranch(sheet, branch, from2, LimitsOfBranch::Count::all).all(notes))
    curves.push_back(LimitWalk(sheet, found, from, to, from2, to2).walk(family.name, family.name2, steps));
  return curves;
}

StableTrains stable_trains(const TrainFamily2& family, const Branch& branch, double at2, int steps,
                           const std::function<bool(const TrainLimit&)>& known) {
  const TrainSheet sheet = sheet_of(family, branch);
  constexpr double apart = 1e-2;  // of the box: what is narrower is not seen in it
  LimitsOfBranch limits(sheet, branch, at2, LimitsOfBranch::Count::when_asked);
  StableTrains out;
  const std::vector<Found> edges = limits.of_stable(apart, out.lost);
  for (std::size_t k = 0; k < branch.points.size(); ++k)
    if (const std::optional<bool> stable = limits.stable(k))
      out.samples.push_back({branch.points[k].value, at2, *stable});
  for (const Found& found : edges) {
    if (known(found.limit)) continue;
    TrainLimitCurve line{{found.limit}, ""};
    if (at2 > 0) line = LimitWalk(sheet, found, 0, 1, 1, 0).walk(family.name, family.name2, steps);
    std::reverse(line.points.begin(), line.points.end());
    if (at2 < 1) {
      const TrainLimitCurve up = LimitWalk(sheet, found, 0, 1, 0, 1).walk(family.name, family.name2, steps);
      line.points.insert(line.points.end(), up.points.begin() + 1, up.points.end());
      line.end += (line.end.empty() ? "" : "; ") + up.end;
    }
    out.lines.push_back(std::move(line));
  }
  return out;
}

}  // namespace stickslip
