#include "stickslip/cycles/branch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "cycles/infinite_period.hpp"
#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/numerics/interpolation.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

using std::size_t;

// Special points by the way in which a multiplier passes the unit circle; where the parameter turns as well,
// that at 1 is a fold.
constexpr const char* kinds[] = {"branch", "flip", "torus"};

// How many multipliers, conjugate pairs once, lie outside of the unit circle by each way to pass it; the
// phase mode's left out.
using Signature = std::array<int, 3>;
Signature signature(const Cycle& cycle) {
  Signature s{};
  for (size_t k = 0; k < cycle.multipliers.size(); ++k) {
    const std::complex<double> mu = cycle.multipliers[k];
    if (k == cycle.phase_mode || !(std::abs(mu) > 1)) continue;
    if (passing(mu) != Passing::as_pair || mu.imag() > 0) ++s[std::size_t(passing(mu))];
  }
  return s;
}

// Whether another multiplier than the phase mode's is near 1.
bool near_one(const Cycle& cycle) {
  constexpr double near = 0.2;
  for (size_t k = 0; k < cycle.multipliers.size(); ++k)
    if (k != cycle.phase_mode && std::abs(cycle.multipliers[k] - 1.) < near) return true;
  return false;
}

// How many of them that is.
int outside(const Signature& s) { return s[0] + s[1] + 2 * s[2]; }

// What is said of a cycle at a place of the branch.
struct BranchState {
  double value = 0;
  Cycle cycle;
  Watched watched;
};

constexpr double most_periods = 1e8;
constexpr double long_steps_from = 4, long_step = .3;  // times the first period

class Walk : public Continuation {
 public:
  Walk(CyclePath& path, const Cycle& first, const std::string& name, double from, double to, int steps,
       CycleWatch watch, Follow follow)
      : Continuation(path, name, from, to, steps), path_(path), watch_(std::move(watch)),
        first_amplitude_(first.amplitude), first_period_(first.period),
        while_stable_(follow == Follow::while_stable) {}
  CycleBranch follow(int steps);

 private:
  End reached(double distance) override;
  End turned(double distance, const Place& tangent) override;
  End accepted() override;
  std::string stuck(const std::string& refusal) override;
  double longest() const override;

  BranchState look();
  void add_point(const BranchState& seen);
  // Special points between where the branch stands and the candidate, at the distance `length`.
  void find_special(const Place& tangent, double length);
  void add_root(const std::string& kind, double length, const std::function<double()>& test, double before,
                double after);
  void locate_changes(Signature now, const Signature& after, double length, bool fold);
  void name_change(const Signature& before, const Signature& after, double s);
  void add_special(const std::string& kind, double s);
  std::string end_where_it_repels();
  std::string end_at_hopf(double length);
  std::optional<double> infinite_period() const;

  CyclePath& path_;
  CycleWatch watch_;
  CycleBranch branch_;
  BranchState last_, seen_;  // of where the branch stands, and of the candidate
  double first_amplitude_, first_period_;
  bool while_stable_;
  std::vector<SpecialPoint> passed_;  // in this step
  // distance along the step of the first of them, and its number
  double first_special_ = 0;
  std::size_t first_number_ = 0;
};

BranchState Walk::look() {
  BranchState seen;
  seen.value = value();
  seen.cycle = path_.cycle();
  if (watch_)
    seen.watched = watch_(seen.value, seen.cycle);
  else
    seen.watched.growth_rate = growth_rate(seen.cycle);
  if (!watch_) seen.watched.stable = seen.watched.growth_rate < 0;
  return seen;
}

void Walk::add_point(const BranchState& seen) {
  branch_.points.push_back(
      {seen.value, seen.cycle, seen.watched.stable, seen.watched.growth_rate, seen.watched.wavenumber});
}

CycleBranch Walk::follow(int steps) {
  try {
    begin();
  } catch (const Failure&) {
    throw Failure("the cycle does not change with " + name_ + ", or its branch turns back at once");
  }
  last_ = look();
  add_point(last_);
  try {
    branch_.end = Continuation::follow().value_or("cycle_steps " + std::to_string(steps) + " taken");
  } catch (const Interrupted& e) {  // the next beat tells it again
    branch_.end = std::string("stopped by ") + e.what();
  }
  return branch_;
}

// A slip that only grazes rest is named: its depth falls to zero like the distance of the parameter.
std::string Walk::stuck(const std::string& refusal) {
  const auto depth = last_.cycle.tests.find("graze");
  const bool grazes = depth != last_.cycle.tests.end() && std::abs(depth->second) < 1e-6;
  const std::string kind = grazes ? "graze" : path_.ends();
  if (!kind.empty())
    branch_.special.push_back({kind, last_.value, last_.cycle.period, 0, branch_.points.size() - 1});
  if (grazes) return "a slip only grazes rest at " + name_ + " = " + rounded_text(last_.value, 10);
  return "no cycle is found beyond " + name_ + " = " + rounded_text(last_.value, 12) + ": " + refusal;
}

Continuation::End Walk::reached(double distance) {
  passed_.clear();
  seen_ = look();
  const auto sign = seen_.cycle.tests.find("hopf");
  if (sign != seen_.cycle.tests.end() && (sign->second < 0) != (last_.cycle.tests["hopf"] < 0))
    return end_at_hopf(distance);
  return std::nullopt;
}

Continuation::End Walk::turned(double distance, const Place& tangent) {
  first_special_ = distance;
  find_special(tangent, distance);
  if (while_stable_ && last_.watched.stable && !seen_.watched.stable) return end_where_it_repels();
  return std::nullopt;
}

Continuation::End Walk::accepted() {
  branch_.special.insert(branch_.special.end(), passed_.begin(), passed_.end());
  last_ = seen_;
  add_point(last_);
  const double period = last_.cycle.period;
  if (const std::optional<double> limit = infinite_period()) {
    branch_.special.push_back(
        {"infinite-period", *limit, std::numeric_limits<double>::infinity(), 0, branch_.points.size() - 1});
    return "the period grows without bound at " + name_ + " = " + rounded_text(*limit, 8) +
           ": the limit of the branch, left at a period of " + rounded_text(period, 8);
  }
  if (period > most_periods * first_period_)
    return "the period has grown to " + rounded_text(period, 4) + ", and where " + name_ +
           " goes to is not known to 1e-8 of its range";
  return std::nullopt;
}

// A straight branch towards an infinite period is a curve of ln T alone.
double Walk::longest() const {
  const double usual = Continuation::longest();
  return last_.cycle.period > long_steps_from * first_period_ ? std::max(usual, long_step) : usual;
}

std::string Walk::end_where_it_repels() {
  if (passed_.empty()) throw Failure("the cycle ceases to attract at a point that is not located");
  branch_.special = {passed_[first_number_]};
  go(first_special_);
  path_.tangent(t_);
  return "the cycle ceases to attract at " + name_ + " = " + rounded_text(value(), 10);
}

// The point of the step at the distance s is special.
void Walk::add_special(const std::string& kind, double s) {
  const Cycle cycle = path_.cycle();
  SpecialPoint point{kind, value(), cycle.period, 0, branch_.points.size() - 1};
  if (kind == "wave" && watch_) point.wavenumber = watch_(point.value, cycle).wavenumber;
  passed_.push_back(point);
  if (s < first_special_) {
    first_special_ = s;
    first_number_ = passed_.size() - 1;
  }
}

void Walk::add_root(const std::string& kind, double length, const std::function<double()>& test,
                    double before, double after) {
  if (const auto s = locate(kind, test, length, before, after)) add_special(kind, *s);
}

// Changes of the multipliers' places, by halving, one after the other. Beside a fold the multiplier that
// passes 1 is not looked at.
void Walk::locate_changes(Signature now, const Signature& after, double length, bool fold) {
  // Changes nearer to each other are one: where other cycles branch off, the cycle itself is known to some
  // 1e-7 only, by which two multipliers that pass 1 together come apart by up to 1e-6.
  constexpr double beyond = 1e-5;
  constexpr int most = 8;  // that one step may have
  const auto seen = [&](double s) {
    go(s);
    Signature there = signature(path_.cycle());
    if (fold) there[0] = now[0];
    return there;
  };
  double from = 0;
  for (int count = 0; count < most && now != after && from < length; ++count) {
    std::string why;
    double refused = -1;
    const auto same = [&](double s) {
      try {
        return seen(s) == now;
      } catch (const Error& e) {
        why = e.what();
        refused = s;
        return false;
      }
    };
    const double s = last_place(same, from, length, 1e-10);
    if (refused >= 0 && refused - s < 2e-10) passed_unseen("a multiplier on the unit circle", why);
    from = std::min(length, s + beyond);
    const Signature next = from < length ? seen(from) : after;
    name_change(now, next == now ? after : next, s);
    now = next == now ? after : next;
  }
}

// Which multiplier passes the unit circle at the distance s, and where: the nearest to it. Two that meet
// outside of it and part do not change the number of those outside.
void Walk::name_change(const Signature& before, const Signature& after, double s) {
  if (outside(before) == outside(after)) return;
  go(s);
  const Cycle cycle = path_.cycle();
  double nearest = 1e-3;  // further off, the multipliers have jumped
  std::string kind;
  for (size_t k = 0; k < cycle.multipliers.size(); ++k) {
    const std::complex<double> mu = cycle.multipliers[k];
    const double off = std::abs(std::abs(mu) - 1);
    if (k == cycle.phase_mode || !(off < nearest)) continue;
    nearest = off;
    kind = kinds[std::size_t(passing(mu))];
  }
  if (!kind.empty()) add_special(kind, s);
}

void Walk::find_special(const Place& tangent, double length) {
  const Signature before = signature(last_.cycle), after = signature(seen_.cycle);
  // A canard's parameter stands still to the last digit: only a change of direction beyond round-off is a
  // fold. A multiplier passes 1 there; where none does, a branch that breaks off has turned by what Newton's
  // method leaves.
  const bool fold = t_.back() * tangent.back() < 0 &&
                    std::max(std::abs(t_.back()), std::abs(tangent.back())) > 1e-9 &&
                    (before[0] != after[0] || near_one(last_.cycle) || near_one(seen_.cycle));
  if (fold)
    add_root(
        "fold", length, [&] { return path_.tangent(t_).back(); }, t_.back(), tangent.back());
  Signature beside = after;
  if (fold) beside[0] = before[0];
  if (before != beside) locate_changes(before, beside, length, fold);
  const auto value_of = [](const std::string& name, const std::map<std::string, double>& tests) {
    const auto found = tests.find(name);
    return found == tests.end() ? std::nan("") : found->second;
  };
  const auto changes = [](const std::map<std::string, double>& a, const std::map<std::string, double>& b,
                          const auto& found) {
    for (const auto& [name, value] : a) {
      const auto other = b.find(name);
      if (name != "hopf" && other != b.end() && value * other->second < 0) found(name, value, other->second);
    }
  };
  changes(last_.cycle.tests, seen_.cycle.tests, [&](const std::string& name, double a, double b) {
    add_root(
        name, length, [&] { return value_of(name, path_.cycle().tests); }, a, b);
  });
  changes(last_.watched.tests, seen_.watched.tests, [&](const std::string& name, double a, double b) {
    add_root(
        name, length, [&] { return value_of(name, look().watched.tests); }, a, b);
  });
}

// The parameter is even in the amplitude: extrapolated to zero from three cycles, as small as can be solved
// for.
std::string Walk::end_at_hopf(double length) {
  const double a0 = last_.cycle.amplitude, a1 = -seen_.cycle.amplitude,
               side = last_.cycle.tests["hopf"] < 0 ? -1 : 1;
  const auto signed_amplitude = [&](double s) {
    try {
      go(s);
      return side * path_.cycle().tests.at("hopf");
    } catch (const Error&) {
      return -1e-3 * a0;  // too near to zero to have a phase: beyond what is sought
    }
  };
  double hopf = std::nan(""), period = 0;
  for (double small = 3e-4 * first_amplitude_; small < a0 / 3; small *= 2) {
    double square[3], values[3], periods[3];
    bool known = true;
    for (int k = 0; k < 3 && known; ++k) {
      const double target = small * (1 + .5 * k);
      const double s = find_root([&](double at) { return signed_amplitude(at) - target; },
                                 {0, a0 - target, length, a1 - target}, 1e-2 * small / first_amplitude_);
      const double a = std::isnan(s) ? s : signed_amplitude(s);
      known = std::abs(a - target) < .2 * target;
      square[k] = a * a;
      values[k] = value();
      periods[k] = path_.cycle().period;
    }
    if (!known) continue;
    double weights[3];
    Lagrange({square[0], square[1], square[2]}).weights(0, weights);
    hopf = period = 0;
    for (int k = 0; k < 3; ++k) {
      hopf += weights[k] * values[k];
      period += weights[k] * periods[k];
    }
    break;
  }
  if (std::isnan(hopf))
    throw Failure("the cycle runs the other way round, and not because its amplitude has vanished");
  branch_.special.push_back({"hopf", hopf, period, 0, branch_.points.size() - 1});
  return "the amplitude vanishes at " + name_ + " = " + rounded_text(hopf, 10) + ": steady sliding";
}

// The limit of the parameter where the period grows without bound: far beyond that of a canard, in which
// the amplitude grows with it.
std::optional<double> Walk::infinite_period() const {
  constexpr double long_period = 30, part = 1.5, settled = 0.02, known = 1e-8;
  const Cycle& now = last_.cycle;
  if (now.period < long_period * first_period_) return std::nullopt;
  std::vector<double> periods, values;
  for (const CyclePoint& point : branch_.points) {
    if (point.cycle.period > now.period / part &&
        std::abs(point.cycle.amplitude / now.amplitude - 1) > settled)
      return std::nullopt;
    periods.push_back(point.cycle.period);
    values.push_back(point.value);
  }
  const std::optional<InfinitePeriodLimit> limit = infinite_period_limit(periods, values);
  if (!limit || !(limit->error < known * range_)) return std::nullopt;
  return limit->value;
}

}  // namespace

CycleBranch continue_cycle(CyclePath& path, const Cycle& first, const std::string& name, double from,
                           double to, int steps, const CycleWatch& watch, Follow follow) {
  return Walk(path, first, name, from, to, steps, watch, follow).follow(steps);
}

double special_test(const std::string& kind, CyclePath& path, const Place& row) {
  if (kind == "fold") return path.tangent(row).back();
  const Cycle cycle = path.cycle();
  if (const auto named = cycle.tests.find(kind); named != cycle.tests.end()) return named->second;
  const double from = kind == "flip" ? -1 : 1;
  double nearest = std::nan("");
  for (size_t k = 0; k < cycle.multipliers.size(); ++k) {
    const std::complex<double> mu = cycle.multipliers[k];
    const bool pair = passing(mu) == Passing::as_pair;
    if (k == cycle.phase_mode || pair != (kind == "torus")) continue;
    const double off = pair ? std::abs(mu) - 1 : mu.real() - from;
    if (!(std::abs(off) > std::abs(nearest))) nearest = off;  // the first is compared with NaN
  }
  return nearest;
}

double settle_on_special(const std::string& kind, CyclePath& path, double range, double& slope) {
  constexpr double first_step = 1e-4, reach = 0.2;
  const double tolerance = kind == "fold" ? 1e-7 : 1e-10;  // the parameter of a fold is known to the square
  Place row = path.direction(), here = path.place();
  path.go(0, row, dot(row, here));
  row = path.tangent(row);
  path.accept();
  here = path.place();
  const double level = dot(row, here);
  double stands = 0;  // the path's candidate, along the branch
  const auto test = [&](double s) {
    try {
      path.go(s, row, level + s);
      stands = s;
      return special_test(kind, path, row);
    } catch (const Failure&) {
      return std::nan("");
    }
  };
  const double first = special_test(kind, path, row), step = slope == slope ? -first / slope : first_step;
  const double s =
      root_near(test, 0, first, std::abs(step) < reach / 10 ? step : first_step, tolerance, reach, &slope);
  if (std::isnan(s)) return s;
  if (!(std::abs(s - stands) < 1e-2 * tolerance)) path.go(s, row, level + s);
  path.tangent(row);
  return path.place().back() * range;
}

}  // namespace stickslip
