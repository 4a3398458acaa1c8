
#include "stickslip/cycles/cycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "cycles/stick_motion.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/numerics/continuation.hpp"
#include "stickslip/numerics/linear_systems.hpp"

namespace stickslip {

double growth_rate(const Cycle& cycle) {
  if (!cycle.not_linear.empty()) return std::numeric_limits<double>::quiet_NaN();
  double largest = 0;
  for (std::size_t k = 0; k < cycle.multipliers.size(); ++k)
    if (k != cycle.phase_mode) largest = std::max(largest, std::abs(cycle.multipliers[k]));
  return largest > 0 ? std::log(largest) / cycle.period : -std::numeric_limits<double>::infinity();
}

double least_along(const Cycle& cycle, double v) { return v < 0 ? -cycle.psi_max : cycle.psi_min; }

void measure(Cycle& cycle) {
  const double inf = std::numeric_limits<double>::infinity();
  cycle.psi_min = inf;
  cycle.psi_max = -inf;
  double range = 0, low_force = inf, high_force = -inf;
  for (PetscInt i = 0; i < cycle.nodes; ++i) {
    double low = inf, high = -inf;
    for (std::size_t k = 0; k < cycle.times.size(); ++k) {
      low = std::min(low, cycle.psi(k, i));
      high = std::max(high, cycle.psi(k, i));
    }
    range = std::max(range, high - low);
    cycle.psi_min = std::min(cycle.psi_min, low);
    cycle.psi_max = std::max(cycle.psi_max, high);
  }
  for (std::size_t k = 0; k < cycle.times.size(); ++k) {
    double mean = 0;
    for (PetscInt i = 0; i < cycle.nodes; ++i) mean += cycle.eta(k, i) / double(cycle.nodes);
    low_force = std::min(low_force, mean);
    high_force = std::max(high_force, mean);
  }
  cycle.amplitude = range / 2;
  cycle.force_drop = high_force - low_force;
  double rest = 0;
  for (const Rest& r : cycle.rests) rest += r.end - r.begin;
  cycle.rest_fraction = rest / cycle.period / double(cycle.nodes);
}

std::shared_ptr<Look> CycleFamily::look() {
  auto seen = std::make_shared<CycleLook>();
  seen->cycle = cycle();
  const Cycle& c = seen->cycle;
  seen->value = place().back() * range_;
  seen->period = c.period;
  seen->amplitude = c.amplitude;
  seen->halves = halves();
  for (const auto& [name, value] : c.tests) {
    if (name != "hopf")
      seen->tests[name] = value;
    else if (value < 0)
      seen->amplitude = -c.amplitude;
  }
  for (std::size_t k = 0; k < c.multipliers.size(); ++k)
    if (k != c.phase_mode) seen->multipliers.push_back(c.multipliers[k]);
  seen->growth_rate = growth_rate(c);
  seen->stable = seen->growth_rate < 0;
  return seen;
}

// A slip that only grazes rest is named: its depth falls to zero like the distance of the parameter.
Family::Ending CycleFamily::ending(const Look& last) const {
  const auto depth = last.tests.find("graze");
  if (depth != last.tests.end() && std::abs(depth->second) < 1e-6)
    return {"graze", "a slip only grazes rest"};
  return {ends(), ""};
}

CycleBranch continue_cycle(CycleFamily& family, const Way& way, const CycleWatch& watch, Follow until) {
  std::function<void(Look&)> more;
  if (watch)
    more = [&watch](Look& look) {
      auto& seen = static_cast<CycleLook&>(look);
      const Watched watched = watch(seen.value, seen.cycle);
      seen.stable = watched.stable;
      seen.growth_rate = watched.growth_rate;
      seen.wavenumber = watched.wavenumber;
      seen.tests.insert(watched.tests.begin(), watched.tests.end());
    };
  Followed followed = follow(family, way, until, more);
  CycleBranch branch{{}, std::move(followed.special), std::move(followed.end)};
  for (const std::shared_ptr<Look>& look : followed.points) {
    auto& seen = static_cast<CycleLook&>(*look);
    branch.points.push_back(
        {seen.value, std::move(seen.cycle), seen.stable, seen.growth_rate, seen.wavenumber});
  }
  return branch;
}

// The branch of a cycle with rests: the return map with the parameter as one more unknown, so that the branch
// may turn round.

namespace {

using std::size_t;

constexpr double difference = 1e-6;  // of the parameter's range: the map's derivative by it, to a millionth
constexpr double settled = 1e-12;    // change of Newton's method

// What turns one sequence of starts and stops (StickCycle) into the next, by the first word that only one of
// them has; "" where it only begins elsewhere.
std::string change_of_sequence(const std::string& before, const std::string& after) {
  std::vector<std::string> was = split(before, ' '), is = split(after, ' ');
  const auto [lost, gained] = std::mismatch(was.begin(), was.end(), is.begin(), is.end());
  const auto more = [](const std::vector<std::string>& these, const std::vector<std::string>& those,
                       const std::string& word) {
    return std::count(these.begin(), these.end(), word) > std::count(those.begin(), those.end(), word);
  };
  const std::string word = gained != is.end() && more(is, was, *gained) ? *gained
                           : lost != was.end() && more(was, is, *lost)  ? *lost
                                                                        : "";
  if (word.empty()) return (before + before).find(after) == std::string::npos ? "order" : "";
  const bool reverses = before.find('!') != after.find('!');
  return reverses ? "pass" : word.back() == '.' ? "graze" : "release";
}

class StickFamily : public CycleFamily {
 public:
  StickFamily(std::function<Scene(double)> at, double from, double range, const StickCycle& first)
      : CycleFamily(range), scene_at_(std::move(at)) {
    there_.cycle = first;
    stand_at(StickMotion(scene_at_(from)), from, there_);
    here_ = there_;
  }

  void solve(double length, const Place& row, double right) override {
    ends_.clear();
    Stand next = here_;
    for (size_t k = 0; k < next.x.size(); ++k) next.x[k] += length * here_.t[k] * unit(k);
    double last = StickMotion::never;
    for (int iteration = 0;; ++iteration) {
      std::vector<double> matrix, change;
      linearise(next, row, right, matrix, change);
      if (!solve_dense(int(next.x.size()), matrix.data(), 1, change.data()))
        throw Failure("the return map is singular");
      double largest = 0;
      for (size_t k = 0; k < next.x.size(); ++k) {
        next.x[k] += change[k] * unit(k);
        largest = std::max(largest, std::abs(change[k]));
      }
      if (!std::isfinite(largest) || iteration > 12) throw Failure("Newton's method on the return map fails");
      if (largest < settled || (largest < 1e-9 && largest >= last)) break;
      last = largest;
    }
    const StickMotion m(scene_at_(next.x.back()));
    set_free_values(m, free_of(next), next.cycle);
    close_cycle(m, next.cycle);
    if (next.cycle.sequence != here_.cycle.sequence) {
      ends_ = change_of_sequence(here_.cycle.sequence, next.cycle.sequence);
      throw Failure("the sequence of starts and stops changes: " + next.cycle.sequence);
    }
    there_ = std::move(next);
  }

  Place place() const override {
    Place p;
    for (size_t k = 0; k < there_.x.size(); ++k) p.push_back(there_.x[k] / unit(k));
    return p;
  }

  Place tangent(const Place& row) override {
    std::vector<double> matrix, right;
    linearise(there_, row, 0, matrix, right);
    std::fill(right.begin(), right.end(), 0.);
    right.back() = 1;
    if (!solve_dense(int(there_.x.size()), matrix.data(), 1, right.data()))
      throw Failure("the branch has no tangent");
    there_.t = of_length_one(right);
    return there_.t;
  }

  Place direction() const override { return of_length_one(there_.t); }
  Cycle cycle() const override { return described(scene_at_(there_.x.back()), there_.cycle); }
  const StickCycle& candidate() const { return there_.cycle; }
  void accept() override {
    here_ = there_;
    renewed_.reset();
    try {
      move_section();
    } catch (const Failure&) {  // the phase at hand still serves
      there_ = here_;
    }
  }
  std::optional<Place> renewed() const override { return renewed_; }
  std::unique_ptr<CycleFamily> beside(std::function<Scene(double)> at, double from, double range,
                                    const Others& others) const override {
    auto other = std::make_unique<StickFamily>(*this);
    for (const auto& [path, weight] : others) {
      const std::vector<double>& x = dynamic_cast<const StickFamily&>(*path).there_.x;
      for (size_t k = 0; k < x.size(); ++k) other->there_.x[k] += weight * (x[k] - there_.x[k]);
    }
    other->scene_at_ = std::move(at);
    other->there_.t.back() *= range_ / range;
    other->range_ = range;
    other->there_.x.back() = from;
    other->here_ = other->there_;
    return other;
  }

 protected:
  std::string ends() const override { return ends_; }

 private:
  struct Stand {
    std::vector<double> x, t;  // free coordinates and the parameter; the tangent, in units of the places
    StickCycle cycle;
  };
  // Under a load starts and stops move along the branch, and the phase at which the map is taken is to stay
  // clear of them: where one has come near it becomes the middle of the longest time without any, and the
  // coordinates are others.
  void move_section() {
    const StickMotion m(scene_at_(here_.x.back()));
    if (!m.forced() || std::abs(here_.t.back()) < 1e-3) return;  // beside a fold the way is not told by it
    std::vector<double> times;
    StickReturnMapOptions wishes;
    wishes.changed = [&times](const std::vector<double>&, const StickState& now) {
      if (now.t > 0) times.push_back(now.t);
    };
    return_map_of(m, here_.cycle, wishes);
    if (times.empty()) return;
    const double whole = here_.cycle.period, nearest = std::min(times.front(), whole - times.back());
    double longest = 0, middle = 0;
    for (size_t k = 0; k < times.size(); ++k) {
      const double next = k + 1 < times.size() ? times[k + 1] : times[0] + whole;
      if (next - times[k] <= longest) continue;
      longest = next - times[k];
      middle = std::fmod(times[k] + longest / 2, whole);
    }
    if (nearest > 0.15 * longest) return;
    StickState p{0, here_.cycle.start, {}, {}, 0};
    m.decide(p);
    while (p.t < middle) m.advance(p, middle);
    Stand moved = here_;
    moved.cycle.start = p.u;
    moved.cycle.load.time = std::fmod(here_.cycle.load.time + middle, whole);
    for (size_t i = 0; i < p.direction.size(); ++i) moved.cycle.load.rests[i] = p.direction[i] == 0;
    moved.cycle = polished(m, moved.cycle);
    const double side = here_.t.back() < 0 ? -1 : 1;
    stand_at(m, here_.x.back(), moved);
    here_ = there_ = std::move(moved);
    Place row(here_.x.size());
    row.back() = side;
    renewed_ = tangent(row);
    here_ = there_;
  }
  // The coordinates of its cycle, and their units.
  void stand_at(const StickMotion& m, double parameter, Stand& s) {
    s.x = free_values(m, s.cycle);
    const std::vector<size_t> free = free_unknowns(m, s.cycle);
    scale_.clear();
    for (size_t k = 0; k < free.size(); ++k) scale_.push_back(m.scale(free[k]) + std::abs(s.x[k]));
    s.x.push_back(parameter);
    s.t.assign(s.x.size(), 0.);
  }
  double unit(size_t k) const { return k < scale_.size() ? scale_[k] : range_; }
  static std::vector<double> free_of(const Stand& s) { return {s.x.begin(), s.x.end() - 1}; }

  std::vector<double> image(const Stand& s, double parameter) const {
    StickMotion m(scene_at_(parameter));
    if (std::isinf(s.cycle.clearance)) m.stop_at_turns();  // beside a graze the map goes on smoothly
    StickCycle c(s.cycle);
    set_free_values(m, free_of(s), c);
    c.start = return_map_of(m, c, {}).at.u;
    return free_values(m, c);
  }

  // The linear system of a step of Newton's method, in units of the places: (DP - 1, dP/dparameter; row)
  // change = right.
  void linearise(const Stand& s, const Place& row, double level, std::vector<double>& matrix,
                 std::vector<double>& right) const {
    const size_t n = scale_.size(), all = n + 1;
    matrix.assign(all * all, 0.);
    right.assign(all, 0.);
    if (n > 0) {
      const StickMotion m(scene_at_(s.x.back()));
      StickCycle c(s.cycle);
      set_free_values(m, free_of(s), c);
      const MapAt map = map_at(m, c);
      const auto sides = beside_of<UsageError>([&](double at) { return image(s, at); }, s.x.back(),
                                               difference * range_, map.image);
      for (size_t i = 0; i < n; ++i) {
        for (size_t j = 0; j < n; ++j)
          matrix[i * all + j] = (map.slopes[i * n + j] - (i == j ? 1 : 0)) * scale_[j] / scale_[i];
        matrix[i * all + n] = (sides.above[i] - sides.below[i]) / sides.width * range_ / scale_[i];
        right[i] = (s.x[i] - map.image[i]) / scale_[i];
      }
    }
    double here = 0;
    for (size_t k = 0; k < all; ++k) {
      matrix[n * all + k] = row[k];
      here += row[k] * s.x[k] / unit(k);
    }
    right[n] = level - here;
  }

  std::function<Scene(double)> scene_at_;
  std::vector<double> scale_;
  Stand here_, there_;
  std::optional<Place> renewed_;
  std::string ends_;
};

}  // namespace

std::unique_ptr<CycleFamily> stick_family(std::function<Scene(double)> at, double from, double range,
                                          const StickCycle& first) {
  return std::make_unique<StickFamily>(std::move(at), from, range, first);
}

const StickCycle& stick_candidate(const CycleFamily& path) {
  return dynamic_cast<const StickFamily&>(path).candidate();
}

}  // namespace stickslip
