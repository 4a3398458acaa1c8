#include "stickslip/numerics/continuation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

double dot(const Place& a, const Place& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

Place of_length_one(Place p) {
  const double length = std::sqrt(dot(p, p));
  for (double& value : p) value /= length;
  return p;
}

Passing passing(std::complex<double> mu) {
  if (std::abs(mu.imag()) > 1e-6 * std::abs(mu)) return Passing::as_pair;
  return mu.real() > 0 ? Passing::at_one : Passing::at_minus_one;
}

namespace {

using std::size_t;

// Special points by the way in which a multiplier passes the unit circle; where the parameter turns as well,
// that at 1 is a fold.
constexpr const char* kinds[] = {"branch", "flip", "torus"};

// How many multipliers, conjugate pairs once, lie outside of the unit circle by each way to pass it.
using Signature = std::array<int, 3>;
Signature signature(const Look& look) {
  Signature s{};
  for (const std::complex<double> mu : look.multipliers)
    if (std::abs(mu) > 1 && (passing(mu) != Passing::as_pair || mu.imag() > 0)) ++s[size_t(passing(mu))];
  return s;
}

// How many of them that is.
int outside(const Signature& s) { return s[0] + s[1] + 2 * s[2]; }

std::complex<double> nearest_to_circle(const Look& look) {
  return *std::min_element(look.multipliers.begin(), look.multipliers.end(), [](auto a, auto b) {
    return std::abs(std::abs(a) - 1) < std::abs(std::abs(b) - 1);
  });
}

bool near_one(const Look& look) {
  constexpr double near = 0.2;
  return std::any_of(look.multipliers.begin(), look.multipliers.end(),
                     [](std::complex<double> mu) { return std::abs(mu - 1.) < near; });
}

constexpr double most_periods = 1e8;
constexpr double long_steps_from = 4, long_step = .3;  // times the first period
constexpr double shortest = 1e-9;                      // step
// The parameter's share of the tangent that is a direction: a canard's parameter stands still to the last
// digit.
constexpr double directed = 1e-9;
// Changes nearer to each other are one: where other solutions branch off, the solution itself is known to
// some 1e-7 only, by which two multipliers that pass 1 together come apart by up to 1e-6.
constexpr double beyond = 1e-5;
constexpr const char* what_changes = "a multiplier on the unit circle";

// Halves of a period so near to each other may change places within a step, and a step that leaves so little
// of what they differ by has gone over to the solutions of half the period.
constexpr double few_alike = .2, least_left = .1;
double halves_apart(const Look& look) {
  return look.halves.empty() ? std::numeric_limits<double>::infinity()
                             : std::sqrt(dot(look.halves, look.halves));
}

class Walk {
 public:
  Walk(Family& family, const Way& way, Follow until, const std::function<void(Look&)>& watch)
      : family_(family), words_(family.words()), way_(way), watch_(watch),
        while_stable_(until == Follow::while_stable), range_(std::abs(way.to - way.from)),
        longest_(std::max(.02, std::min(.2, 4. / way.steps))), ds_(longest_ / 2) {}
  Followed along();

 private:
  using End = std::optional<std::string>;  // why a branch ends, in words

  void begin();
  std::string steps();
  End step();
  void accept();  // the branch stands at the candidate
  double longest() const;
  std::string stuck(const std::string& refusal);
  std::shared_ptr<Look> look();

  void go(double distance);  // the candidate at this distance along the tangent
  void add(const std::string& kind, double distance);
  void insert(double distance, SpecialPoint point);
  double locate(const std::string& kind, const std::function<double()>& test, double before, double after);
  [[noreturn]] static void passed_unseen(const std::string& kind, const std::string& why);
  void find_special(const Place& tangent);
  double find_fold(const Place& tangent);
  void find_tests();
  struct Seen {  // a place of the step
    double distance;
    std::shared_ptr<Look> look;
  };
  Seen seen_at(double distance);
  void find_changes(Seen from, const Seen& to);
  Seen behind_change(double distance, const Seen& to);
  void add_change(const Seen& last, const Seen& next);
  void refine(double distance, SpecialPoint& point);
  std::string end_where_it_repels();
  std::string end_at_hopf();
  std::optional<double> infinite_period() const;
  End halves_alike();
  const Look& first() const { return *branch_.points.front(); }

  Family& family_;
  const Family::Words words_;
  const Way& way_;
  const std::function<void(Look&)>& watch_;
  const bool while_stable_;
  const double range_, longest_;
  double ds_;

  Followed branch_;
  Place here_, t_;                      // where the branch stands, and its tangent
  double heading_ = 0;                  // of the parameter, as it was known last
  std::shared_ptr<Look> last_, seen_;   // there, and of the candidate
  double length_ = 0;                   // at which go() finds the candidate of this step
  bool strayed_ = false;                // the family has been elsewhere since
  std::vector<std::pair<double, SpecialPoint>> passed_;  // in this step, by their distances
};

std::shared_ptr<Look> Walk::look() {
  std::shared_ptr<Look> seen = family_.look();
  if (watch_) watch_(*seen);
  return seen;
}

void Walk::begin() {
  here_ = family_.place();
  Place ahead(here_.size());
  ahead.back() = way_.to > way_.from ? 1 : -1;
  t_ = family_.tangent(ahead);
  heading_ = ahead.back();
  accept();
}

void Walk::accept() {
  family_.accept();
  here_ = family_.place();
  if (const std::optional<Place> renewed = family_.renewed()) t_ = *renewed;
  if (std::abs(t_.back()) > directed) heading_ = t_.back() < 0 ? -1 : 1;
}

Followed Walk::along() {
  try {
    begin();
  } catch (const Failure&) {
    throw Failure("the " + words_.solution + " does not change with " + way_.name +
                  ", or its branch turns back at once");
  }
  last_ = look();
  branch_.points.push_back(last_);
  try {
    branch_.end = steps();
  } catch (const Interrupted& e) {  // the next beat tells it again
    branch_.end = std::string("stopped by ") + e.what();
  }
  return std::move(branch_);
}

std::string Walk::steps() {
  std::string refusal;
  for (int taken = 0; taken < way_.steps;) {
    if (ds_ < shortest) return stuck(refusal);
    try {
      if (End end = step()) return *end;
      ++taken;
      beat("points of branches");
    } catch (const Error& e) {
      ds_ /= 2;
      refusal = e.what();
    }
  }
  return words_.steps + " " + std::to_string(way_.steps) + " taken";
}

Walk::End Walk::step() {
  // the last step goes to the end value exactly
  const double ahead = t_.back() != 0 ? (way_.to / range_ - here_.back()) / t_.back() : -1;
  const bool arrive = ahead > 0 && ahead <= 1.5 * ds_;
  const double length = arrive ? ahead : ds_;
  Place row = t_;
  if (arrive) {
    std::fill(row.begin(), row.end(), 0.);
    row.back() = 1;
  }
  const auto to_the_end = [&] {
    family_.solve(length, row, arrive ? way_.to / range_ : dot(t_, here_) + length);
  };
  to_the_end();
  Place moved = family_.place();
  for (size_t k = 0; k < moved.size(); ++k) moved[k] -= here_[k];
  if (std::sqrt(dot(moved, moved)) > 2 * length) throw Failure("the step left the branch");
  length_ = dot(t_, moved);  // `length`, but not on arrival
  passed_.clear();
  seen_ = look();
  if ((seen_->amplitude < 0) != (last_->amplitude < 0)) return end_at_hopf();
  if (halves_apart(*last_) < few_alike &&
      !(dot(seen_->halves, last_->halves) > least_left * dot(last_->halves, last_->halves)))
    throw Failure("the halves of the period change places, or are alike from here on");
  Place tangent = family_.tangent(t_);
  // turning by more than a quarter of a right angle: the step was too long to trust
  const double cosine = dot(t_, tangent);
  if (cosine < .92 && ds_ > 1e-4 && !arrive) throw Failure("the branch turns within the step");
  strayed_ = false;
  find_special(tangent);
  if (while_stable_ && last_->stable && !seen_->stable) return end_where_it_repels();
  if (strayed_) {
    to_the_end();
    tangent = family_.tangent(t_);
  }
  t_ = tangent;
  accept();
  for (auto& [distance, point] : passed_) branch_.special.push_back(std::move(point));
  last_ = seen_;
  branch_.points.push_back(last_);
  if (End end = halves_alike()) return end;
  if (const std::optional<double> limit = infinite_period()) {
    branch_.special.push_back({"infinite-period", *limit, std::numeric_limits<double>::infinity(), 0,
                               branch_.points.size() - 1});
    return "the period grows without bound at " + way_.name + " = " + rounded_text(*limit, 8) +
           ": the limit of the branch, left at a period of " + rounded_text(last_->period, 8);
  }
  if (last_->period > most_periods * first().period)
    return "the period has grown to " + rounded_text(last_->period, 4) + ", and where " + way_.name +
           " goes to is not known to 1e-8 of its range";
  if (arrive) return "reached " + way_.name + " = " + rounded_text(way_.to, 8);
  if ((last_->value - way_.from) * (way_.to - way_.from) < 0)
    return "the branch came back past its start, " + way_.name + " = " + rounded_text(way_.from, 8);
  if (cosine > .98) ds_ = std::min(longest(), 1.4 * ds_);
  return std::nullopt;
}

// A straight branch towards an infinite period is a curve of ln T alone.
double Walk::longest() const {
  return last_->period > long_steps_from * first().period ? std::max(longest_, long_step) : longest_;
}

std::string Walk::stuck(const std::string& refusal) {
  const Family::Ending ending = family_.ending(*last_);
  if (!ending.kind.empty())
    branch_.special.push_back({ending.kind, last_->value, last_->period, 0, branch_.points.size() - 1});
  if (!ending.words.empty())
    return ending.words + " at " + way_.name + " = " + rounded_text(last_->value, 10);
  return "no " + words_.solution + " is found beyond " + way_.name + " = " + rounded_text(last_->value, 12) +
         ": " + refusal;
}

void Walk::go(double distance) {
  strayed_ = true;
  family_.solve(distance, t_, dot(t_, here_) + distance);
}

// A point that cannot be reached from here: a shorter step may reach it, and is not taken past it in
// silence.
void Walk::passed_unseen(const std::string& kind, const std::string& why) {
  throw Failure("a special point (" + kind + ") is passed that cannot be located: " + why);
}

// The candidate, at this distance, is special. In order along the step.
void Walk::add(const std::string& kind, double distance) {
  const std::shared_ptr<Look> there = kind == "wave" ? look() : family_.look();
  insert(distance, {kind, there->value, there->period, kind == "wave" ? there->wavenumber : 0,
                    branch_.points.size() - 1, there});
}

void Walk::insert(double distance, SpecialPoint point) {
  const auto behind = std::find_if(passed_.begin(), passed_.end(),
                                   [&](const auto& other) { return other.first > distance; });
  passed_.insert(behind, {distance, std::move(point)});
}

// The distance at which the test function of the candidate, whose values at the ends of the step are given,
// changes its sign.
double Walk::locate(const std::string& kind, const std::function<double()>& test, double before,
                    double after) {
  std::string why = "its test function is not known everywhere";
  const auto at = [&](double distance) {
    try {
      go(distance);
      return test();
    } catch (const Error& e) {
      why = e.what();
      return std::nan("");
    }
  };
  const double zero = find_root(at, {0, before, length_, after}, 1e-11);
  if (std::isnan(zero)) passed_unseen(kind, why);
  go(zero);
  return zero;
}

// Special points between where the branch stands and the candidate.
void Walk::find_special(const Place& tangent) {
  const Seen begin{0, last_}, end{length_, seen_};
  const double fold = find_fold(tangent);
  if (std::isnan(fold)) {
    find_changes(begin, end);
  } else {  // the multiplier that passes 1 there is its own
    const Seen there = fold - beyond > 0 ? seen_at(fold - beyond) : begin,
               behind = fold + beyond < length_ ? seen_at(fold + beyond) : end;
    find_changes(begin, there);
    find_changes(behind, end);
    // beside its own, one that passes at the same place; two that meet outside of the circle and part do not
    const Signature before = signature(*there.look), after = signature(*behind.look);
    const bool more = std::abs(outside(after) - outside(before)) != 1;
    for (const size_t kind : {1, 2})
      if (more && before[kind] != after[kind]) {
        go(fold);
        add(kinds[kind], fold);
      }
  }
  find_tests();
}

// The distance of the place where the parameter turns round; NaN where it does not. A branch that breaks off
// turns in its last steps by what Newton's method leaves, without a multiplier near 1.
double Walk::find_fold(const Place& tangent) {
  constexpr double breaks_off = 1e-6;
  const double now = tangent.back();
  if (!(now * heading_ < -directed)) return std::nan("");
  if (length_ < breaks_off && !last_->multipliers.empty() && !near_one(*last_) && !near_one(*seen_))
    return std::nan("");
  double fold = 0;  // it stood still before, to the last digit
  if (t_.back() * now < 0)
    fold = locate("fold", [&] { return family_.tangent(t_).back(); }, t_.back(), now);
  else
    go(0);
  add("fold", fold);
  return fold;
}

// Of the tests whose sign changes; where one jumps through zero that is none.
void Walk::find_tests() {
  constexpr double jump = 1e-4;
  const auto value = [](const Look& look, const std::string& name) {
    const auto found = look.tests.find(name);
    return found == look.tests.end() ? std::nan("") : found->second;
  };
  for (const auto& [name, before] : last_->tests) {
    const double after = value(*seen_, name);
    if (!(before * after < 0)) continue;
    const auto test = [&, &name = name] {
      const double own = value(*family_.look(), name);
      return std::isnan(own) && watch_ ? value(*look(), name) : own;
    };
    const double zero = locate(name, test, before, after);
    if (std::abs(test()) < jump * std::max(std::abs(before), std::abs(after))) add(name, zero);
  }
}

Walk::Seen Walk::seen_at(double distance) {
  go(distance);
  return {distance, family_.look()};
}

// Changes of the multipliers' places, by halving, one after the other. Where other solutions branch off the
// equations are singular, and whether they are solved near by is a matter of chance: another place near the
// middle does as well, and where none does, so near, the change lies between the last two that did.
void Walk::find_changes(Seen from, const Seen& to) {
  constexpr int most = 8;  // that one step may have
  constexpr double parts[] = {.5, .4, .6, .3, .7}, within = 1e-10;
  for (int count = 0; signature(*from.look) != signature(*to.look) && from.distance < to.distance; ++count) {
    if (count == most)
      passed_unseen(what_changes, "there are more than " + std::to_string(most) + " in one step");
    const Signature now = signature(*from.look);
    Seen last = from, next = to;
    std::string why;
    const auto between = [&]() -> std::optional<Seen> {
      for (const double part : parts) {
        try {
          return seen_at(last.distance + part * (next.distance - last.distance));
        } catch (const Error& e) {
          why = e.what();
        }
      }
      return std::nullopt;
    };
    while (next.distance - last.distance > within) {
      const std::optional<Seen> middle = between();
      if (!middle && next.distance - last.distance > beyond) passed_unseen(what_changes, why);
      if (!middle) break;
      (signature(*middle->look) == now ? last : next) = *middle;
    }
    const Seen behind = behind_change(last.distance, to);
    // two that meet outside of the circle and part do not change how many are there
    if (outside(signature(*behind.look)) != outside(now)) add_change(last, next);
    from = behind;
  }
}

// Where what passes together with a multiplier that passes here has passed, too.
Walk::Seen Walk::behind_change(double distance, const Seen& to) {
  for (double past = beyond; distance + past < to.distance; past *= 2) {
    try {
      return seen_at(distance + past);
    } catch (const Error&) {
    }
  }
  return to;
}

// Which multiplier passes the unit circle between two places, and where: the nearest to it.
void Walk::add_change(const Seen& last, const Seen& next) {
  constexpr double jumps = 1e-3;  // further off
  const std::complex<double> mu = nearest_to_circle(*last.look);
  const double before = std::abs(std::abs(mu) - 1),
               behind = std::abs(std::abs(nearest_to_circle(*next.look)) - 1);
  const double part = before + behind > 0 ? before / (before + behind) : 0;
  SpecialPoint point{before < jumps ? kinds[size_t(passing(mu))] : "corner",
                     last.look->value + part * (next.look->value - last.look->value),
                     last.look->period + part * (next.look->period - last.look->period),
                     0,
                     branch_.points.size() - 1,
                     last.look};
  if (point.kind == kinds[size_t(Passing::at_one)]) refine(last.distance, point);
  insert(last.distance, std::move(point));
}

// Where others branch off, the solution itself is known to some 1e-7 only. So the place is that of the cubic
// through the multiplier that passes, at solutions further off on both sides.
void Walk::refine(double distance, SpecialPoint& point) {
  constexpr double off = 1e-4;
  std::vector<double> at, turns, values, periods;
  try {
    for (const int side : {-2, -1, 1, 2}) {
      const Seen seen = seen_at(distance + side * off);
      at.push_back(seen.distance);
      turns.push_back(std::log(std::abs(nearest_to_circle(*seen.look))));
      values.push_back(seen.look->value);
      periods.push_back(seen.look->period);
    }
  } catch (const Error&) {
    return;
  }
  if (!(turns[0] * turns[1] > 0 && turns[1] * turns[2] < 0 && turns[2] * turns[3] > 0)) return;
  const Lagrange cubic(at);
  const double zero = find_root([&](double x) { return cubic.value(turns.data(), x); },
                                {at[1], turns[1], at[2], turns[2]}, 1e-13);
  if (std::isnan(zero)) return;
  point.value = cubic.value(values.data(), zero);
  point.period = cubic.value(periods.data(), zero);
}

std::string Walk::end_where_it_repels() {
  if (passed_.empty())
    throw Failure("the " + words_.solution + " ceases to attract at a point that is not located");
  branch_.special = {passed_.front().second};
  go(passed_.front().first);
  family_.tangent(t_);
  return "the " + words_.solution + " ceases to attract at " + way_.name + " = " +
         rounded_text(branch_.special[0].value, 10);
}

// The parameter is even in the amplitude: extrapolated to zero from three solutions, as small as can be
// solved for.
std::string Walk::end_at_hopf() {
  const double side = last_->amplitude < 0 ? -1 : 1, a0 = side * last_->amplitude,
               a1 = side * seen_->amplitude;
  std::shared_ptr<Look> there;
  const auto signed_amplitude = [&](double s) {
    try {
      go(s);
      there = family_.look();
      return side * there->amplitude;
    } catch (const Error&) {
      return -1e-3 * a0;  // too near to zero to have a phase: beyond what is sought
    }
  };
  constexpr double vanishing = 1e-2;
  const double whole = std::abs(first().amplitude);
  double hopf = std::nan(""), period = 0;
  for (double small = 3e-4 * whole; small < a0 / 3; small *= 2) {
    double square[3], values[3], periods[3];
    bool known = true;
    for (int k = 0; k < 3 && known; ++k) {
      const double target = small * (1 + .5 * k);
      const double s = find_root([&](double at) { return signed_amplitude(at) - target; },
                                 {0, a0 - target, length_, a1 - target}, 1e-2 * small / whole);
      const double a = std::isnan(s) ? s : signed_amplitude(s);
      known = std::abs(a - target) < .2 * target;
      if (!known) break;
      square[k] = a * a;
      values[k] = there->value;
      periods[k] = there->period;
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
  if (std::isnan(hopf) && a0 < vanishing * whole && std::abs(a1) < a0) {  // no smaller ones: by both ends
    const double part = a1 * a1 / (a0 * a0 - a1 * a1);
    hopf = seen_->value + part * (seen_->value - last_->value);
    period = seen_->period + part * (seen_->period - last_->period);
  }
  if (std::isnan(hopf))
    throw Failure("the " + words_.solution +
                  " runs the other way round, and not because its amplitude has vanished");
  branch_.special.push_back({"hopf", hopf, period, 0, branch_.points.size() - 1});
  return "the amplitude vanishes at " + way_.name + " = " + rounded_text(hopf, 10) + words_.vanished;
}

// The parameter and the period are even in the difference of the halves: extrapolated to zero from the last
// three solutions, before the equations become singular.
Walk::End Walk::halves_alike() {
  constexpr double alike = 1e-2, known = 1e-9;
  const size_t n = branch_.points.size();
  if (n < 3 || !(halves_apart(*last_) < alike)) return std::nullopt;
  double square[3];
  for (size_t k = 0; k < 3; ++k)
    square[k] = dot(branch_.points[n - 1 - k]->halves, branch_.points[n - 1 - k]->halves);
  if (!(square[0] < square[1] && square[1] < square[2])) return std::nullopt;
  double weights[3], value = 0, period = 0;
  Lagrange({square[0], square[1], square[2]}).weights(0, weights);
  for (size_t k = 0; k < 3; ++k) {
    value += weights[k] * branch_.points[n - 1 - k]->value;
    period += weights[k] * branch_.points[n - 1 - k]->period;
  }
  const double slope = (branch_.points[n - 2]->value - last_->value) / (square[1] - square[0]);
  if (!(std::abs(last_->value - square[0] * slope - value) < known * range_)) return std::nullopt;
  branch_.special.push_back({"halves", value, period, 0, n - 1});
  return "the two halves of the period become alike at " + way_.name + " = " + rounded_text(value, 10) +
         ": the flip of a " + words_.solution + " of half the period";
}

// The limit of the parameter where the period grows without bound: far beyond that of a canard, in which
// the amplitude grows with it.
std::optional<double> Walk::infinite_period() const {
  constexpr double long_period = 30, part = 1.5, settled = 0.02, known = 1e-8;
  const Look& now = *last_;
  if (now.period < long_period * first().period) return std::nullopt;
  std::vector<double> periods, values;
  for (const std::shared_ptr<Look>& point : branch_.points) {
    if (point->period > now.period / part && std::abs(point->amplitude / now.amplitude - 1) > settled)
      return std::nullopt;
    periods.push_back(point->period);
    values.push_back(point->value);
  }
  const std::optional<InfinitePeriodLimit> limit = infinite_period_limit(periods, values);
  if (!limit || !(limit->error < known * range_)) return std::nullopt;
  return limit->value;
}

}  // namespace

Followed follow(Family& family, const Way& way, Follow until, const std::function<void(Look&)>& watch) {
  return Walk(family, way, until, watch).along();
}

double special_test(const std::string& kind, Family& family, const Place& row) {
  if (kind == "fold") return family.tangent(row).back();
  const std::shared_ptr<Look> look = family.look();
  if (const auto named = look->tests.find(kind); named != look->tests.end()) return named->second;
  const double from = kind == "flip" ? -1 : 1;
  double nearest = std::nan("");
  for (const std::complex<double> mu : look->multipliers) {
    const bool pair = passing(mu) == Passing::as_pair;
    if (pair != (kind == "torus")) continue;
    const double off = pair ? std::abs(mu) - 1 : mu.real() - from;
    if (!(std::abs(off) > std::abs(nearest))) nearest = off;  // the first is compared with NaN
  }
  return nearest;
}

double settle_on_special(const std::string& kind, Family& family, const Place& tangent, double range,
                         double& slope) {
  constexpr double first_step = 1e-4, reach = 0.2;
  const double tolerance = kind == "fold" ? 1e-7 : 1e-10;  // the parameter of a fold is known to the square
  Place row = tangent, here = family.place();
  family.solve(0, row, dot(row, here));
  row = family.tangent(row);
  family.accept();
  here = family.place();
  const double level = dot(row, here);
  double stands = 0;  // the family's candidate, along the branch
  const auto test = [&](double s) {
    try {
      family.solve(s, row, level + s);
      stands = s;
      return special_test(kind, family, row);
    } catch (const Failure&) {
      return std::nan("");
    }
  };
  const double first = special_test(kind, family, row), step = slope == slope ? -first / slope : first_step;
  const double s =
      root_near(test, 0, first, std::abs(step) < reach / 10 ? step : first_step, tolerance, reach, &slope);
  if (std::isnan(s)) return s;
  if (!(std::abs(s - stands) < 1e-2 * tolerance)) family.solve(s, row, level + s);
  family.tangent(row);
  return family.place().back() * range;
}

}  // namespace stickslip
