#include "stickslip/cycles/branch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "cycles/infinite_period.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/numerics/interpolation.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

double dot(const Place& a, const Place& b) {
  double sum = 0;
  for (size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

Place of_length_one(Place p) {
  const double length = std::sqrt(dot(p, p));
  for (double& value : p) value /= length;
  return p;
}

namespace {

using std::size_t;

// Two real multipliers that are equal by symmetry (of waves that run either way round a cell) come out as a
// pair with an imaginary part that is round-off; one of a torus is far above it.
bool is_real(std::complex<double> mu) { return std::abs(mu.imag()) <= 1e-6 * std::abs(mu); }

// How many multipliers lie beyond 1, beyond -1, and, as conjugate pairs, outside of the unit circle; the
// phase mode's left out.
using Signature = std::array<int, 3>;
Signature signature(const Cycle& cycle) {
  Signature s{};
  for (size_t k = 0; k < cycle.multipliers.size(); ++k) {
    const std::complex<double> mu = cycle.multipliers[k];
    if (k == cycle.phase_mode || !(std::abs(mu) > 1)) continue;
    if (is_real(mu))
      ++s[mu.real() > 0 ? 0 : 1];
    else if (mu.imag() > 0)
      ++s[2];
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
  Place tangent;
};

constexpr double most_periods = 1e8;
constexpr double long_steps_from = 4, long_step = .3;  // times the first period

// The walk along a branch: where it stands, and which way it goes.
class Walk {
 public:
  Walk(CyclePath& path, const Cycle& first, const std::string& name, double from, double to, int steps,
       const CycleWatch& watch, Follow follow);
  CycleBranch follow();

 private:
  bool step();  // false where the branch ends; throws Error where a shorter step may help
  // The candidate at the distance s from where the branch stands.
  void go(double s);
  BranchState look();
  void add_point(const BranchState& seen);
  // Special points between where the branch stands and `seen`, at the distance `length`.
  void find_special(const BranchState& seen, double length);
  void locate_root(const std::string& kind, double length, const std::function<double()>& test, double before,
                   double after);
  void locate_changes(Signature now, const Signature& after, double length, bool fold);
  void name_change(const Signature& before, const Signature& after, double s);
  void add_special(const std::string& kind, double s);
  bool end_where_it_repels(size_t found);
  void end_at_hopf(const BranchState& seen, double length);
  void end_where_none_is_found();
  std::optional<double> infinite_period() const;

  CyclePath& path_;
  std::string name_;
  double from_, to_, range_, longest_, ds_ = 0;
  int steps_;
  CycleWatch watch_;
  CycleBranch branch_;
  Place here_, t_;    // where the branch stands, and its tangent
  BranchState last_;  // of that place
  double first_amplitude_, first_period_;
  bool folded_ = false;
  bool while_stable_;
  // distance along the step of the first special point that was found in it, and its number
  double first_special_ = 0;
  size_t first_number_ = 0;
  std::string refusal_;  // why the last step was not taken
};

Walk::Walk(CyclePath& path, const Cycle& first, const std::string& name, double from, double to, int steps,
           const CycleWatch& watch, Follow follow)
    : path_(path), name_(name), from_(from), to_(to), range_(std::abs(to - from)), steps_(steps),
      watch_(watch), first_amplitude_(first.amplitude), first_period_(first.period),
      while_stable_(follow == Follow::while_stable) {
  longest_ = std::max(.02, std::min(.2, 4. / steps));
  ds_ = longest_ / 2;
  here_ = path_.place();
  Place ahead(here_.size());
  ahead.back() = to > from ? 1 : -1;
  try {
    t_ = path_.tangent(ahead);
  } catch (const Failure&) {
    throw Failure("the cycle does not change with " + name_ + ", or its branch turns back at once");
  }
  last_ = look();
  add_point(last_);
  path_.accept();
}

BranchState Walk::look() {
  BranchState seen;
  seen.value = path_.place().back() * range_;
  seen.cycle = path_.cycle();
  if (watch_)
    seen.watched = watch_(seen.value, seen.cycle);
  else
    seen.watched.growth_rate = growth_rate(seen.cycle);
  if (!watch_) seen.watched.stable = seen.watched.growth_rate < 0;
  seen.tangent = t_;
  return seen;
}

void Walk::add_point(const BranchState& seen) {
  branch_.points.push_back(
      {seen.value, seen.cycle, seen.watched.stable, seen.watched.growth_rate, seen.watched.wavenumber});
}

void Walk::go(double s) { path_.go(s, t_, dot(t_, here_) + s); }

CycleBranch Walk::follow() {
  while (branch_.points.size() <= size_t(steps_)) {
    if (ds_ < 1e-9) {
      end_where_none_is_found();
      return branch_;
    }
    const size_t known = branch_.special.size();
    try {
      if (!step()) return branch_;
    } catch (const Error& e) {
      branch_.special.resize(known);
      ds_ /= 2;
      refusal_ = e.what();
    }
  }
  branch_.end = "cycle_steps " + std::to_string(steps_) + " taken";
  return branch_;
}

// A slip that only grazes rest is named: its depth falls to zero like the distance of the parameter.
void Walk::end_where_none_is_found() {
  const auto depth = last_.cycle.tests.find("graze");
  if (depth != last_.cycle.tests.end() && std::abs(depth->second) < 1e-6) {
    branch_.special.push_back({"graze", last_.value, last_.cycle.period, 0, branch_.points.size() - 1});
    branch_.end = "a slip only grazes rest at " + name_ + " = " + rounded_text(last_.value, 10);
  } else {
    branch_.end =
        "no cycle is found beyond " + name_ + " = " + rounded_text(last_.value, 12) + ": " + refusal_;
  }
}

bool Walk::step() {
  // the last step goes to the end value exactly
  const double ahead = t_.back() != 0 ? (to_ / range_ - here_.back()) / t_.back() : -1;
  const bool arrive = ahead > 0 && ahead <= 1.5 * ds_;
  const double length = arrive ? ahead : ds_;
  Place row = t_;
  if (arrive) {
    std::fill(row.begin(), row.end(), 0.);
    row.back() = 1;
  }
  const auto to_the_end = [&] { path_.go(length, row, arrive ? to_ / range_ : dot(t_, here_) + length); };
  to_the_end();
  Place moved = path_.place();
  for (size_t k = 0; k < moved.size(); ++k) moved[k] -= here_[k];
  if (std::sqrt(dot(moved, moved)) > 2 * length) throw Failure("the step left the branch");
  // the distance at which go() finds this place: length, but not on arrival
  const double distance = dot(t_, moved);
  BranchState seen = look();
  const auto sign = seen.cycle.tests.find("hopf");
  if (sign != seen.cycle.tests.end() && (sign->second < 0) != (last_.cycle.tests["hopf"] < 0)) {
    end_at_hopf(seen, distance);
    return false;
  }
  seen.tangent = path_.tangent(t_);
  // turning by more than a quarter of a right angle: the step was too long to trust
  const double cosine = dot(t_, seen.tangent);
  if (cosine < .92 && ds_ > 1e-4 && !arrive) throw Failure("the branch turns within the step");
  const size_t found = branch_.special.size();
  first_special_ = distance;
  find_special(seen, distance);
  if (while_stable_ && last_.watched.stable && !seen.watched.stable) return end_where_it_repels(found);
  if (branch_.special.size() > found || folded_) {  // the path has been elsewhere
    to_the_end();
    seen.tangent = path_.tangent(t_);
  }
  folded_ = false;
  path_.accept();
  here_ = path_.place();
  t_ = seen.tangent;
  last_ = seen;
  add_point(seen);
  if (const std::optional<double> limit = infinite_period()) {
    branch_.special.push_back(
        {"infinite-period", *limit, std::numeric_limits<double>::infinity(), 0, branch_.points.size() - 1});
    branch_.end = "the period grows beyond all bounds at " + name_ + " = " + rounded_text(*limit, 8) +
                  ": the limit of the "
                  "branch, left at a period of " +
                  rounded_text(seen.cycle.period, 8);
    return false;
  }
  if (seen.cycle.period > most_periods * first_period_) {
    branch_.end = "the period has grown to " + rounded_text(seen.cycle.period, 4) + ", and where " + name_ +
                  " goes to is not "
                  "known to 1e-8 of its range";
    return false;
  }
  if (arrive) {
    branch_.end = "reached " + name_ + " = " + rounded_text(to_, 8);
    return false;
  }
  if ((seen.value - from_) * (to_ - from_) < 0) {
    branch_.end = "the branch came back past its start, " + name_ + " = " + rounded_text(from_, 8);
    return false;
  }
  // a straight branch towards an infinite period is a curve of ln T alone
  const double longest =
      seen.cycle.period > long_steps_from * first_period_ ? std::max(longest_, long_step) : longest_;
  if (cosine > .98) ds_ = std::min(longest, 1.4 * ds_);
  return true;
}

// False: the branch ends.
bool Walk::end_where_it_repels(size_t found) {
  if (branch_.special.size() == found)
    throw Failure("the cycle ceases to attract at a point that is not located");
  branch_.special = {branch_.special[first_number_]};
  go(first_special_);
  path_.tangent(t_);
  branch_.end =
      "the cycle ceases to attract at " + name_ + " = " + rounded_text(path_.place().back() * range_, 10);
  return false;
}

// The point of the step at the distance s is special.
void Walk::add_special(const std::string& kind, double s) {
  const Cycle cycle = path_.cycle();
  SpecialPoint point{kind, path_.place().back() * range_, cycle.period, 0, branch_.points.size() - 1};
  if (kind == "wave" && watch_) point.wavenumber = watch_(point.value, cycle).wavenumber;
  branch_.special.push_back(point);
  if (s < first_special_) {
    first_special_ = s;
    first_number_ = branch_.special.size() - 1;
  }
}

// A point between two cycles that cannot be reached from here: a shorter step may reach it, and is not taken
// past it in silence.
[[noreturn]] void passed_unseen(const std::string& kind, const std::string& why) {
  throw Failure("a special point (" + kind + ") is passed that cannot be located: " + why);
}

void Walk::locate_root(const std::string& kind, double length, const std::function<double()>& test,
                       double before, double after) {
  folded_ = true;
  std::string why;
  const auto at = [&](double s) {
    try {
      go(s);
    } catch (const Error& e) {
      why = e.what();
      return std::nan("");
    }
    return test();
  };
  const double s = find_root(at, {0, before, length, after}, 1e-11);
  if (std::isnan(s) && !why.empty()) passed_unseen(kind, why);
  if (std::isnan(s)) return;
  go(s);
  // a jump through zero is none
  if (std::abs(test()) < 1e-4 * std::max(std::abs(before), std::abs(after))) add_special(kind, s);
}

// Changes of the multipliers' places, by halving, one after the other. Beside a fold the multiplier that
// passes 1 is not looked at.
void Walk::locate_changes(Signature now, const Signature& after, double length, bool fold) {
  folded_ = true;
  // Changes nearer to each other are one: where other cycles branch off, the cycle itself is known to some
  // 1e-7 only, by which two multipliers that pass 1 together come apart.
  constexpr double beyond = 1e-6;
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
    kind = !is_real(mu) ? "torus" : mu.real() < 0 ? "flip" : "branch";
  }
  if (!kind.empty()) add_special(kind, s);
}

void Walk::find_special(const BranchState& seen, double length) {
  const Signature before = signature(last_.cycle), after = signature(seen.cycle);
  // A canard's parameter stands still to the last digit: only a change of direction beyond round-off is a
  // fold. A multiplier passes 1 there; where none does, a branch that breaks off has turned by what Newton's
  // method leaves.
  const bool fold = t_.back() * seen.tangent.back() < 0 &&
                    std::max(std::abs(t_.back()), std::abs(seen.tangent.back())) > 1e-9 &&
                    (before[0] != after[0] || near_one(last_.cycle) || near_one(seen.cycle));
  if (fold)
    locate_root(
        "fold", length, [&] { return path_.tangent(t_).back(); }, t_.back(), seen.tangent.back());
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
  changes(last_.cycle.tests, seen.cycle.tests, [&](const std::string& name, double a, double b) {
    locate_root(
        name, length, [&] { return value_of(name, path_.cycle().tests); }, a, b);
  });
  changes(last_.watched.tests, seen.watched.tests, [&](const std::string& name, double a, double b) {
    locate_root(
        name, length, [&] { return value_of(name, look().watched.tests); }, a, b);
  });
}

// The parameter is even in the amplitude: extrapolated to zero from three cycles, as small as can be solved
// for.
void Walk::end_at_hopf(const BranchState& seen, double length) {
  const double a0 = last_.cycle.amplitude, a1 = -seen.cycle.amplitude,
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
    double square[3], value[3], periods[3];
    bool known = true;
    for (int k = 0; k < 3 && known; ++k) {
      const double target = small * (1 + .5 * k);
      const double s = find_root([&](double at) { return signed_amplitude(at) - target; },
                                 {0, a0 - target, length, a1 - target}, 1e-2 * small / first_amplitude_);
      const double a = std::isnan(s) ? s : signed_amplitude(s);
      known = std::abs(a - target) < .2 * target;
      square[k] = a * a;
      value[k] = path_.place().back() * range_;
      periods[k] = path_.cycle().period;
    }
    if (!known) continue;
    double weights[3];
    Lagrange({square[0], square[1], square[2]}).weights(0, weights);
    hopf = period = 0;
    for (int k = 0; k < 3; ++k) {
      hopf += weights[k] * value[k];
      period += weights[k] * periods[k];
    }
    break;
  }
  if (std::isnan(hopf))
    throw Failure("the cycle runs the other way round, and not because its amplitude has vanished");
  branch_.special.push_back({"hopf", hopf, period, 0, branch_.points.size() - 1});
  branch_.end = "the amplitude vanishes at " + name_ + " = " + rounded_text(hopf, 10) + ": steady sliding";
}

// The limit of the parameter where the period grows beyond all bounds: far beyond that of a canard, in which
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
  return Walk(path, first, name, from, to, steps, watch, follow).follow();
}

double special_test(const std::string& kind, CyclePath& path, const Place& row) {
  if (kind == "fold") return path.tangent(row).back();
  const Cycle cycle = path.cycle();
  if (const auto named = cycle.tests.find(kind); named != cycle.tests.end()) return named->second;
  const double from = kind == "flip" ? -1 : 1;
  double nearest = std::nan("");
  for (size_t k = 0; k < cycle.multipliers.size(); ++k) {
    const std::complex<double> mu = cycle.multipliers[k];
    if (k == cycle.phase_mode || is_real(mu) == (kind == "torus")) continue;
    const double off = kind == "torus" ? std::abs(mu) - 1 : mu.real() - from;
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
  const auto test = [&](double s) {
    try {
      path.go(s, row, level + s);
      return special_test(kind, path, row);
    } catch (const Failure&) {
      return std::nan("");
    }
  };
  const double first = special_test(kind, path, row), step = slope == slope ? -first / slope : first_step;
  const double s =
      root_near(test, 0, first, std::abs(step) < reach / 10 ? step : first_step, tolerance, reach, &slope);
  if (std::isnan(s)) return s;
  path.go(s, row, level + s);
  path.tangent(row);
  return path.place().back() * range;
}

}  // namespace stickslip
