#include "stickslip/waves/train_limits.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <memory>
#include <optional>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"
#include "waves/train_field.hpp"

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
    for (const SpecialPoint& special : branch_.special) {
      if (special.after != k || special.kind != "fold") continue;
      const SheetPlace fold = sheet_.place(train_at(special), special.value, value2_);
      return found_at(sheet_, LimitFunction(sheet_, true, fold, {}), towards(place(k), place(k + 1)),
                      stability_);
    }
    return std::nullopt;
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

// The box of both parameters as the unit square.
struct LimitBox {
  double from, to, from2, to2;
  PlanePoint place(const TrainLimit& limit) const {
    return {(limit.value - from) / (to - from), (limit.value2 - from2) / (to2 - from2)};
  }
  double value2(double y) const { return from2 + y * (to2 - from2); }
};

constexpr double longest_step = 0.15, first_step = 0.02;
constexpr double exactly = 1e-9, about = 1e-2;  // to which a place is on its line; the latter times the step

// The line of one limit, followed on the surface of trains: steps are measured in (alpha, y) about the train
// where it stands.
class LimitLine : public PlaneLine {
 public:
  LimitLine(std::shared_ptr<const TrainSheet> sheet, const Found& first, const LimitBox& box)
      : sheet_(std::move(sheet)), first_{first, {}, true}, box_(box) {}

  Way begin(bool forwards) override {
    if (std::isnan(heading_)) find_heading();
    way_ = &ways_[forwards ? 1 : 0];
    *way_ = {first_};
    turning_ = forwards ? frequency_slope_ : -frequency_slope_;
    if (std::isnan(heading_)) return {};
    const double y = box_.place(first_.found.limit).y;
    return {(forwards ? y >= 1 : y <= 0) ? Way::outwards : Way::inwards, heading_ + (forwards ? 0 : M_PI)};
  }

  std::optional<NextPoint> ahead(double radius, double heading) override {
    const PlanePoint here = box_.place(way_->back().found.limit), t = towards({0, 0}, heading, 1);
    const double rest = t.y > 0 ? (1 - here.y) / t.y : t.y < 0 ? -here.y / t.y : radius + 1;
    const bool arrives = rest <= radius;
    radius = std::min(rest, radius);
    if (!solve(radius, t, arrives, arrives)) return std::nullopt;
    PlanePoint at = box_.place(next_.found.limit);
    if (arrives) at.y = t.y > 0 ? 1 : 0;
    const bool leaves = at.x < 0 || at.x > 1;
    if (leaves) {  // the step to the border
      const double border = at.x < 0 ? 0 : 1;
      const auto beyond = [&](double length) {
        return solve(length, t, false, true) ? box_.place(next_.found.limit).x - border : nowhere;
      };
      const double length = root_near(beyond, radius, at.x - border,
                                      radius * (border - at.x) / (at.x - here.x), 1e-9, 5 * radius);
      if (!(length > 0) || std::isnan(beyond(length))) return std::nullopt;
      at = clamped({border, box_.place(next_.found.limit).y});
    }
    return NextPoint{at, std::atan2(next_.moved.y, next_.moved.x), arrives || leaves};
  }

  void accept() override {
    turning_ = (next_.found.mode.lambda.imag() - way_->back().found.mode.lambda.imag()) /
               std::hypot(next_.moved.x, next_.moved.y);
    way_->push_back(next_);
  }

  // Of all points of the piece.
  std::vector<TrainLimit> limits() const {
    std::vector<TrainLimit> all;
    for (const Step& step : steps()) all.push_back(step.found.limit);
    return all;
  }

  // The limit at a place of the piece, solved for from the train where the step that passes it began, and
  // whether it leads.
  std::optional<TrainLimit> at(const CurvePlace& place) const {
    const std::vector<Step> all = steps();
    const bool later = place.segment + 1 >= ways_[0].size();  // than the first point, on the way forwards
    const Step &begin = all[place.segment + (later ? 0 : 1)], &end = all[place.segment + (later ? 1 : 0)];
    const double part = later ? place.part : 1 - place.part, length = std::hypot(end.moved.x, end.moved.y);
    std::optional<Step> found = part < 0.5 ? begin : end;
    if ((part > 0 && part < 1) || !found->exact)
      found = beside(begin.found, {part * end.moved.x, part * end.moved.y},
                     {-end.moved.y / length, end.moved.x / length}, 0.3 * length, exactly);
    if (!found) return std::nullopt;
    ask_whether_it_leads(sheet_->train(found->found.place), found->found.limit);
    return found->found.limit;
  }

 private:
  struct Step {
    Found found;
    PlanePoint moved;  // in (alpha, y) about the train of the step before
    bool exact;        // not only about on the line
  };

  std::vector<Step> steps() const { return joined(ways_[0], ways_[1]); }

  // The tangent of the line, which is zero along it, by differences.
  void find_heading() {
    constexpr double h = 1e-4;  // f vanishes here to 1e-9 of its slope
    const Found& here = first_.found;
    const double y = box_.place(here.limit).y;
    LimitFunction f(*sheet_, here.limit.kind == "fold", here.place, here.mode);
    const auto slopes = [&](double alpha, double up) {  // of f and of the frequency
      const double there = f(here.chart, h * alpha, box_.value2(y + h * up));
      return std::pair{there / h, (f.mode().lambda.imag() - here.mode.lambda.imag()) / h};
    };
    const auto [by_alpha, turning_alpha] = slopes(1, 0);
    const auto [by_y, turning_y] = slopes(0, 1);
    const double size = std::hypot(by_alpha, by_y), side = by_alpha < 0 ? -1 : 1;
    if (!(size > 0)) return;
    heading_ = std::atan2(side * by_alpha, -side * by_y);
    frequency_slope_ = side * (by_alpha * turning_y - by_y * turning_alpha) / size;
  }

  // The limit on the line through `moved`, about a limit, along `across`, no further than `reach` from there.
  std::optional<Step> beside(const Found& from, PlanePoint moved, PlanePoint across, double reach,
                             double tolerance) const {
    LimitFunction f(*sheet_, from.limit.kind == "fold", from.place, from.mode);
    const double y = box_.place(from.limit).y;
    const auto on = [&](double s) { return PlanePoint{moved.x + s * across.x, moved.y + s * across.y}; };
    const auto off = [&](double s) { return f(from.chart, on(s).x, box_.value2(y + on(s).y)); };
    const double here = off(0);
    if (std::isnan(here)) return std::nullopt;
    const double first = std::isfinite(slope_) ? -here / slope_ : 1e-3 * reach;
    const double s = root_near(off, 0, here, first, tolerance, reach, &slope_);
    if (std::isnan(s) || std::isnan(off(s))) return std::nullopt;
    return Step{found_at(*sheet_, f, from.chart, false), on(s), tolerance <= exactly};
  }

  // The limit a step further on; false where none is found, or another mode, which Newton's method fell upon.
  bool solve(double length, PlanePoint t, bool along_border, bool exact) {
    constexpr double part = 0.03;  // of the frequency of the train
    const Found& here = way_->back().found;
    const auto next =
        beside(here, {length * t.x, length * t.y}, along_border ? PlanePoint{1, 0} : PlanePoint{-t.y, t.x},
               std::max(0.5 * length, 1e-4), exact ? exactly : about * length);
    if (!next) return false;
    next_ = *next;
    const double expected = here.mode.lambda.imag() + turning_ * std::hypot(next_.moved.x, next_.moved.y);
    return std::abs(next_.found.mode.lambda.imag() - expected) < part * 2 * M_PI / here.limit.period;
  }

  std::shared_ptr<const TrainSheet> sheet_;
  Step first_, next_;
  LimitBox box_;
  std::vector<Step> ways_[2], *way_ = nullptr;      // backwards, forwards; the one that is gone
  double heading_ = nowhere, frequency_slope_ = 0;  // at the first point, forwards
  double turning_ = 0;                              // change of the frequency along the last step
  mutable double slope_ = nowhere;                  // of the function across the line, where it was seen last
};

std::shared_ptr<const TrainSheet> sheet_of(const TrainFamily2& family, const Branch& branch) {
  const Train& first = branch.points.front().train;
  const double z_scale = ranges(first.values.data(), points_on(first.mesh), first.oscillator->dim())[1];
  const auto [low, high] =
      std::minmax_element(branch.points.begin(), branch.points.end(),
                          [](const BranchPoint& a, const BranchPoint& b) { return a.value < b.value; });
  return std::make_shared<const TrainSheet>(family, high->value - low->value, z_scale);
}

std::string why_it_ends(LineEnd end, PlanePoint at, const TrainLimit& last, const TrainFamily2& family,
                        const LimitBox& box, int steps) {
  if (end == LineEnd::steps) return "wave_steps " + std::to_string(steps) + " taken";
  if (end == LineEnd::closed) return "comes back to its start";
  if (end != LineEnd::border)
    return fmt::format("no way on is found at {} = {:.8g}, {} = {:.8g}", family.name, last.value,
                       family.name2, last.value2);
  if (at.y >= 1) return "reached " + family.name2 + " = " + rounded_text(box.to2, 8);
  return at.y <= 0 ? family.name2 + " comes back past its start" : family.name + " leaves its range";
}

}  // namespace

std::vector<TrainLimit> train_limits(const TrainFamily2& family, const Branch& branch, double value2,
                                     bool stability, std::vector<std::string>& notes) {
  const std::shared_ptr<const TrainSheet> sheet = sheet_of(family, branch);
  const auto modes = stability ? LimitsOfBranch::Count::all : LimitsOfBranch::Count::none;
  std::vector<TrainLimit> limits;
  for (const Found& found : LimitsOfBranch(*sheet, branch, value2, modes).all(notes))
    limits.push_back(found.limit);
  return limits;
}

std::vector<TrainLimitCurve> train_limit_curves(const TrainFamily2& family, const Branch& branch, double from,
                                                double to, double from2, double to2, int steps,
                                                std::vector<std::string>& notes) {
  const std::shared_ptr<const TrainSheet> sheet = sheet_of(family, branch);
  const LimitBox box{from, to, from2, to2};
  std::vector<TrainLimitCurve> curves;
  for (const Found& found : LimitsOfBranch(*sheet, branch, from2, LimitsOfBranch::Count::all).all(notes)) {
    LimitLine line(sheet, found, box);
    CurvePiece piece;
    const LineEnd end = follow(line, box.place(found.limit), line.begin(true),
                               {longest_step, first_step, steps}, piece.points);
    TrainLimitCurve curve{{found.limit},
                          why_it_ends(end, piece.points.back(), line.limits().back(), family, box, steps)};
    const std::vector<CurvePlace> places = even_places({piece}, PetscInt(piece.points.size()))[0];
    for (std::size_t k = 1; k < places.size(); ++k)
      if (const std::optional<TrainLimit> limit = line.at(places[k])) curve.points.push_back(*limit);
    curves.push_back(std::move(curve));
  }
  return curves;
}

StableTrains stable_trains(const TrainFamily2& family, const Branch& branch, double at2, int steps,
                           const std::function<bool(const TrainLimit&)>& known) {
  const std::shared_ptr<const TrainSheet> sheet = sheet_of(family, branch);
  constexpr double apart = 1e-2;  // of the box: what is narrower is not seen in it
  LimitsOfBranch limits(*sheet, branch, at2, LimitsOfBranch::Count::when_asked);
  StableTrains out;
  const std::vector<Found> edges = limits.of_stable(apart, out.lost);
  for (std::size_t k = 0; k < branch.points.size(); ++k)
    if (const std::optional<bool> stable = limits.stable(k))
      out.samples.push_back({branch.points[k].value, at2, *stable});
  for (const Found& found : edges) {
    if (known(found.limit)) continue;
    const LimitBox box{0, 1, 0, 1};
    const auto line = std::make_shared<LimitLine>(sheet, found, box);
    CurvePiece piece = follow_both_ways(*line, box.place(found.limit), {longest_step, first_step, steps});
    out.lines.push_back(
        {std::move(piece), line->limits(), [line](const CurvePlace& place) { return line->at(place); }});
  }
  return out;
}

}  // namespace stickslip
