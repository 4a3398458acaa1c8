// A ladder of grids: where the solution is that of a differential equation in x.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/interpolation.hpp"
#include "stickslip/output/probe.hpp"
#include "study/ladder.hpp"

namespace stickslip {

namespace {

constexpr double telling = 50;  // a level predicts errors down to this part of its own
constexpr PetscInt most_nodes = 1 << 20;
// as share_of_space, where the order is known and twice the nodes cost four times
constexpr double share_beside_jump = 0.55;

// What the levels predict.
struct PredictedError {
  double error, order;  // of the last level, and at which rate errors come to it
  double factor;        // by which its grid is too coarse
  bool sure, resolved, within_reach;
};

class GridLadder final : public Ladder {
 public:
  using Ladder::Ladder;

  void choose() override;
  double estimate(const Answer& end) override;
  void refine() override;
  bool confirm() override;
  std::string predicted() const override;

 private:
  double steepest_fall(const Level& from, const Level& to) const override {
    return std::max(1., std::pow(cells_of(to.scene) / cells_of(from.scene), order_at_best()));
  }
  double first_cells() const;
  double second_cells() const;
  double order_at_best() const;
  double rate(std::size_t k) const;  // of the errors of levels k - 1 and k
  double order_beyond() const;       // expected between the last two levels,
  double order_behind_jump() const;
  // Where the solution jumps, or friction jumps or bends.
  std::string profile_word() const {
    const std::string what = request_.scene.medium.varies() ? "what differs " : "friction ";
    return what + (request_.corner_order == 1 ? "jumps" : "bends");
  }
  bool low_order() const { return runs_.jump() || request_.corner_order <= 2; }
  double next_order() const;  // and beyond the last
  double predicted_error(double cells) const;
  double between_nodes(const Level& level) const;
  double tolerance_of_level(double cells) const;
  PredictedError outlook() const;
  bool never_better(const PredictedError& ahead) const;
  bool place_or_go_on(double& next);
  bool climb_to(double& next, int& failures);
  void place_run(const PredictedError& ahead);
  void choose_tolerance_on(double cells, double in_space);
  double tolerance_seen();
  bool time_is_to_blame();
  bool level_errs_in_time() const;
  bool may_restart() const { return request_.tolerance_open && restarts_ < 4; }
  [[noreturn]] void give_up_on(const PredictedError& ahead, const std::string& limit) const;
  double estimate_in_space(const Level& now, double d) const;
  void take_last_run();

  double least_stretch_ = 1;  // of the next run's grid against the last level's
  // What steps at a tolerance err by, on a grid of `cells` (0: a guess), and on finer ones by more, as noise
  // of the shortest waves does.
  struct InTime {
    double tolerance = 1, error = 5, cells = 0;
  };
  bool seen_in_time() const { return time_.cells > 0; }
  // Less strict ones err in proportion, stricter ones as slope_in_time() says.
  double error_in_time(double tolerance, double cells) const;
  double tolerance_for(double error, double cells) const;
  double grown_in_time(double cells) const { return seen_in_time() ? std::max(1., cells / time_.cells) : 1; }
  InTime time_;
  double in_time_ = 0, in_space_ = 0;  // predicted of the run
  double last_difference_ = 0;         // of the last run from the last level
  int restarts_ = 0;
};

// ---- between nodes ----

// Largest |difference| between the fields at nodes m - 2..m + 2 and what interpolation finds there from the
// scene.order + 1 nodes nearest of those at odd multiples of `reach` nodes away, none of them beyond a corner
// of friction.
double misfit_around(PetscInt m, PetscInt reach, const Fields& fields, const Scene& scene,
                     const NodesAround& around) {
  double largest = 0;
  for (PetscInt at = m - 2; at <= m + 2; ++at) {
    if (!scene.ring() && (at < 0 || at >= scene.n)) continue;
    const auto place = [&](PetscInt node) { return (node % scene.n + scene.n) % scene.n; };
    const PetscInt here = place(at);
    const auto [first, last] = around.range(scene.x(here));
    const double left = first - double(here), right = last - double(here);
    std::vector<double> offsets;
    for (PetscInt k = 1; int(offsets.size()) <= scene.order && k * reach < scene.n; k += 2)
      for (const PetscInt node : {at - k * reach, at + k * reach}) {
        const auto away = double(node - at);
        if ((scene.ring() || (node >= 0 && node < scene.n)) && away >= left && away <= right)
          offsets.push_back(away);
      }
    if (offsets.empty()) continue;
    std::vector<double> weights(offsets.size());
    Lagrange(offsets).weights(0, weights.data());
    Combination row;
    for (std::size_t i = 0; i < offsets.size(); ++i)
      row.emplace_back(place(at + PetscInt(offsets[i])), weights[i]);
    const FrictionAt friction = fields.friction.empty() ? FrictionAt() : FrictionAt(scene, {scene.x(here)});
    const Point found = combined(fields, row, friction, 0);
    largest =
        std::max({largest, std::abs(found.psi - fields.psi[here]), std::abs(found.eta - fields.eta[here])});
  }
  return largest;
}

// What interpolation adds at points x that are no nodes: the misfits at the nodes around, from every second
// and from every fourth node, carried to the grid itself by the rate between them. The medium's own corners,
// and those that waves carry away from them, let it fall to h^3.
double interpolation_error(const Fields& fields, const Scene& scene, const std::vector<double>& x) {
  if (x.empty()) return 0;
  const NodesAround around(scene);
  double largest = 0;
  for (const double at : x) {
    if (around.at(at).size() == 1) continue;
    const auto node = PetscInt(std::llround(at / scene.h()));
    const double near = misfit_around(node, 1, fields, scene, around);
    const double far = misfit_around(node, 2, fields, scene, around);
    const double rate = near > 0 ? std::clamp(std::log2(far / near), 3., scene.order + 1.) : scene.order + 1.;
    largest = std::max(largest, near * std::pow(2, -rate));
  }
  return largest;
}

// At the probes; not where a jump is.
double GridLadder::between_nodes(const Level& level) const {
  std::vector<double> x;
  for (const double at : request_.probes)
    if (!runs_.jump() || !runs_.jump()->extent(level.scene, runs_.pilot().t_end()).covers(at))
      x.push_back(at);
  return interpolation_error(level.answer.fields, level.scene, x);
}

// ---- where levels stand ----

// Few enough that hardly a request is met by them: they cost next to nothing. A grid that is set has one
// level below.
double GridLadder::first_cells() const {
  const Options& options = request_.options;
  const Scene& scene = request_.scene;
  if (!request_.grid_open) {
    const double set = cells_of(scene);
    return set / 2.25 < setting_.order + 2 ? 1.5 * set : set / 2.25;
  }
  const std::string type = options.text("init_type");
  double count = 12;
  if (type == "sine") count = 12 * std::max(1., options.real("init_mode"));
  if (type == "pulses" || type == "wave") count = 48 * options.real("init_pulses");
  if (type == "layer") count = 3 * scene.length / options.real("init_width");
  // where friction sets the steps, a step on few nodes costs as much as one on some fifty
  if (runs_.friction_sets_steps() && setting_.method.can().is_explicit) count = std::max(count, 48.);
  if (request_.corner_order <= 2) count = std::max(count, 48.);  // few nodes come near each other by chance
  if (request_.corner_distance > 0) count = std::max(count, 0.8 * scene.length / request_.corner_distance);
  if (runs_.jump()) count = std::max(count, runs_.jump()->least_cells(setting_.order, runs_.pilot().t_end()));
  return std::floor(std::min(count, 1e5));
}

double GridLadder::second_cells() const {
  const Level& before = levels_[0];
  const bool cheap = double(before.steps) * double(before.scene.n) < 5000 || runs_.friction_sets_steps();
  const double ratio = request_.grid_open                  ? (cheap ? 2 : 1.5)
                       : before.scene.n > request_.scene.n ? 1 / 1.5
                                                           : 1.5;
  return ratio * cells_of(before.scene);
}

// No finite differences of higher order converge faster than a medium or a start whose third derivative jumps
// lets them, or a jump.
double GridLadder::order_at_best() const {
  if (runs_.jump()) return std::min(setting_.order / (setting_.order + 1.), double(request_.corner_order));
  return std::min(request_.corner_order, setting_.order);
}

double GridLadder::rate(std::size_t k) const {
  return std::log(distances_[k - 1] / distances_[k]) /
         std::log(cells_of(levels_[k].scene) / cells_of(levels_[k - 1].scene));
}

double GridLadder::order_beyond() const {
  if (low_order()) return order_behind_jump();
  const std::size_t known = distances_.size();
  if (known < 2) return request_.corner_distance > 0 ? 0.75 * order_at_best() : order_at_best() / 2.;
  return expected_order(known > 2 ? rate(known - 2) : NAN, rate(known - 1), order_at_best());
}

// Where the finer grid of two errs by much of what the coarser does, rates are those of what distances mean
// at this order.
double GridLadder::order_behind_jump() const {
  const std::size_t known = distances_.size();
  const double best = order_at_best();
  if (known < 2) return best;
  const auto error = [&](std::size_t k) {
    return distances_[k] / (1 - std::pow(cells_of(levels_[k].scene) / cells_of(levels_[k + 1].scene), best));
  };
  const double seen = std::log(error(known - 2) / error(known - 1)) /
                      std::log(cells_of(levels_[known - 1].scene) / cells_of(levels_[known - 2].scene));
  return std::clamp(seen, 0.3, best);
}

double GridLadder::next_order() const {
  if (low_order() || distances_.size() < 2) return order_beyond();
  return expected_order(rate(distances_.size() - 1), order_beyond(), order_at_best());
}

double GridLadder::predicted_error(double at) const {
  const double before = cells_of(levels_[levels_.size() - 2].scene), last = cells_of(levels_.back().scene);
  const double near = std::min(at, last), far = std::max(at, last);
  // at the low order of a jump the finer grid of two errs by much of what the coarser does
  const double of_coarser =
      low_order() ? distances_.back() / (1 - std::pow(before / last, order_beyond())) : distances_.back();
  return of_coarser * std::pow(before / near, order_beyond()) * std::pow(last / far, next_order());
}

// Of a level on a grid of so many cells, for the least error in space that it may have: at the order of the
// scheme, or halfway to it from a low one that was seen.
double GridLadder::tolerance_of_level(double at) const {
  if (!request_.tolerance_open) return setting_.tolerance;
  const std::size_t count = levels_.size();
  double in_space = 1;
  const double p = order_at_best(), order = count >= 3 ? (p + std::clamp(rate(count - 2), 0., p)) / 2 : p;
  if (count >= 2)
    in_space = distances_.back() * std::pow(cells_of(levels_[count - 2].scene) / at, order);
  else if (seen_in_time() || (count == 1 && runs_.friction_sets_steps()))
    in_space = 0;
  return std::clamp(tolerance_for(share_of_level * std::max(in_space, share_of_space * aim_), at),
                    least_tolerance, 1e-4);
}

PredictedError GridLadder::outlook() const {
  const double p = order_at_best(), last = cells_of(levels_.back().scene), beyond = next_order();
  // where friction sets the steps, a finer grid costs little, and another run much
  const double share = runs_.friction_sets_steps() && setting_.method.can().is_explicit ? 0.12
                       : runs_.jump()                                               ? share_beside_jump
                                                                                    : share_of_space;
  PredictedError ahead;
  ahead.error = predicted_error(last);
  ahead.order = order_beyond();
  ahead.factor = std::pow(ahead.error / (share * aim_), 1 / beyond);
  const double between = between_nodes(levels_.back());
  ahead.factor = std::max(ahead.factor, std::cbrt(between / (share * aim_)));
  ahead.sure = ahead.order > 0.8 * p;
  // an order that has hardly begun to rise predicts nothing
  ahead.resolved = runs_.jump() ||
                   distances_.back() < (distances_.size() < 2 ? 20 : 3) * share_of_space * aim_ ||
                   (distances_.size() > 1 && rate(distances_.size() - 1) > 0.25 * p);
  ahead.within_reach =
      ahead.resolved && ahead.factor < std::clamp(std::pow(telling, 1 / beyond), 1.3, ahead.sure ? 8. : 2.2);
  return ahead;
}

// ---- the climb ----

void GridLadder::choose() {
  double next = first_cells();
  for (int failures = 0;;) {
    if (levels_.size() == 1) next = second_cells();
    if (levels_.size() >= 2 && place_or_go_on(next)) return;
    if (!climb_to(next, failures)) next = levels_.empty() && failures == 0 ? first_cells() : 2 * next;
  }
}

// A level on so many cells; false where it fails and the climb goes on otherwise: with explicit steps from
// the bottom, or on twice as fine a grid.
bool GridLadder::climb_to(double& next, int& failures) {
  std::string failed;
  Level made = runs_.run(request_.nodes(next), tolerance_of_level(next), failed);
  // what the run would cost on some 2/accuracy^(1/p) times as many nodes at a hundredth of the accuracy
  const double grown = 2 * std::pow(std::min(aim_, 1.), -1. / setting_.order);
  const bool slow =
      levels_.empty() && runs_.prefers_explicit(made, request_.nodes(next * grown), 0.01 * aim_);
  if (failed.empty() && !slow) {
    add(std::move(made));
    return true;
  }
  if (request_.method_open && !setting_.method.can().is_explicit) {
    runs_.take_explicit();
    begin_anew();
    failures = 0;
  } else if (!request_.grid_open || ++failures == 6) {
    throw OutOfReach{fmt::format("{} on {} nodes: {}", setting_.method.name(), request_.nodes(next), failed)};
  }
  return false;
}

// Places the run where the last level predicts it, or says where the next level is to be.
bool GridLadder::place_or_go_on(double& next) {
  const PredictedError ahead = outlook();
  const Level& last = levels_.back();
  const bool place = !request_.grid_open || ahead.within_reach;
  if (place) place_run(ahead);
  if (place ? runs_.prefers_explicit(last, setting_.n, setting_.tolerance)
            : runs_.prefers_explicit(last, 2 * last.scene.n, last.tolerance)) {
    runs_.take_explicit();
    begin_anew();
    next = first_cells();
    return false;
  }
  const auto beyond_budget = [&](double cells) {  // steps as short as cells
    const double ratio = std::max(1., cells / cells_of(last.scene));
    return !runs_.affords(last.seconds * ratio * ratio);
  };
  const std::string budget = "beyond accuracy_seconds " + request_.options.text("accuracy_seconds");
  if (place && request_.grid_open && beyond_budget(double(setting_.n)))
    give_up_on(ahead, fmt::format("the {} nodes that would do are {}", setting_.n, budget));
  if (place) return true;
  const double coarser = cells_of(levels_[levels_.size() > 2 ? levels_.size() - 3 : 0].scene);
  next = cells_of(last.scene) *
         (ahead.resolved ? std::clamp(ahead.factor / 1.45, 1.3, ahead.sure ? 4. : 2.) : 2);
  const bool far = last.scene.n > 2000 && cells_of(last.scene) * ahead.factor > double(most_nodes);
  const bool beyond_memory = next > double(most_nodes);
  if ((far || beyond_memory || beyond_budget(next)) && time_is_to_blame()) {
    next = coarser;
    return false;
  }
  const Start::Misfit jump = runs_.pilot().start().misfit(request_.scene);
  const double misfit = std::max(std::abs(jump.left), std::abs(jump.right));
  if (far && misfit > 1e-8) give_up_on(ahead, fmt::format("the start jumps by {:.3g} at a held end", misfit));
  if (far && never_better(ahead)) give_up_on(ahead, "four grids show the same");
  if (beyond_memory) give_up_on(ahead, fmt::format("no grid has more than {} nodes", most_nodes));
  if (beyond_budget(next)) give_up_on(ahead, "a finer grid is " + budget);
  return false;
}

// Whether the low rate of the last levels is there to stay, as at a corner: an error that is small already
// and has fallen at one rate three times. Otherwise fronts may be about to be resolved, and the climb goes
// on.
bool GridLadder::never_better(const PredictedError& ahead) const {
  if (distances_.size() < 4) return false;
  double low = INFINITY, high = 0, largest = 0;
  for (std::size_t k = distances_.size() - 3; k < distances_.size(); ++k) {
    low = std::min(low, rate(k));
    high = std::max(high, rate(k));
  }
  for (const double psi : levels_.back().answer.fields.psi) largest = std::max(largest, std::abs(psi));
  return high - low < 0.4 && high < 0.3 * order_at_best() && ahead.error < 0.01 * largest;
}

// Grid and tolerance of the run, as the last level predicts them.
void GridLadder::place_run(const PredictedError& ahead) {
  const double last = cells_of(levels_.back().scene);
  // Near the last level the distance from it would tell nothing.
  const double least = std::max(std::pow(0.4, -1 / next_order()), least_stretch_);
  if (request_.grid_open)
    setting_.n = request_.nodes(last * (ahead.factor > 0.93 ? std::max(ahead.factor, least) : ahead.factor));
  const double cells = cells_of(on_grid(request_.scene, setting_.n, setting_.order));
  in_space_ = predicted_error(cells);
  choose_tolerance_on(cells, in_space_);
}

// Whether it is the steps in time whose errors do not fall from grid to grid: then it is begun anew with
// stricter ones.
bool GridLadder::time_is_to_blame() {
  if (!may_restart() || levels_.back().tolerance <= 2 * least_tolerance) return false;
  ++restarts_;
  const Level& seen = levels_[levels_.size() - 2];
  const Level loose = runs_.run(seen.scene.n, loosened * seen.tolerance);
  const double d = runs_.difference(seen, loose);
  if (d <= 0.3 * loosened * distances_.back()) return false;
  time_ = {loose.tolerance, 3 * d, cells_of(seen.scene)};
  begin_anew();
  return true;
}

void GridLadder::give_up_on(const PredictedError& ahead, const std::string& limit) const {
  const double last = distances_.size() > 1 ? rate(distances_.size() - 1) : NAN, p = order_at_best();
  throw OutOfReach{fmt::format(
      "on {} nodes the error is about {:.2g} and {}, as it does at {}{}; {}", levels_.back().scene.n,
      ahead.error, last < 0.3 ? "does not fall from grid to grid" : fmt::format("falls like h^{:.2g}", last),
      request_.corner_order <= 2 ? "places where " + profile_word() + " and " : "",
      last < 0.3 * p ? "jumps, corners and fronts thinner than that grid" : "fronts that are not resolved",
      limit)};
}

bool GridLadder::confirm() {
  if (distances_.empty()) return false;
  setting_.n = levels_.back().scene.n;
  setting_.tolerance = levels_.back().tolerance;
  in_space_ = predicted_error(cells_of(levels_.back().scene));
  in_time_ = share_of_level * in_space_;
  return true;
}

double GridLadder::error_in_time(double tolerance, double cells) const {
  const double ratio = tolerance / time_.tolerance;
  return time_.error * grown_in_time(cells) *
         std::pow(ratio, ratio < 1 && seen_in_time() ? slope_in_time() : 1);
}

double GridLadder::tolerance_for(double error, double cells) const {
  const double ratio = error / (time_.error * grown_in_time(cells));
  return time_.tolerance * std::pow(ratio, ratio < 1 && seen_in_time() ? 1 / slope_in_time() : 1);
}

// What a tolerance costs, seen on the grid before the last (time_); returns the loosest that is worth it.
double GridLadder::tolerance_seen() {
  const Level& seen = levels_[levels_.size() - 2];
  const double most = std::min(loosened * seen.tolerance, setting_.method.can().is_explicit ? 3e-4 : 1e-2);
  // steps that hardly depend on grid and tolerance: a strict tolerance costs nothing, and nothing need be
  // known of it
  const bool bound = double(levels_.back().steps) < 1.1 * double(seen.steps) &&
                     levels_.back().tolerance < 0.1 * seen.tolerance;
  if (bound) {
    const double strict = levels_.back().tolerance, cells = cells_of(seen.scene);
    time_ = {strict, error_in_time(strict, cells), cells};
    return strict;
  }
  if (seen_in_time() && time_.cells >= 0.6 * cells_of(seen.scene)) return most;
  const bool loosen = request_.tolerance_open && seen.tolerance * loosened < 0.1;
  const PetscInt n = seen.scene.n;
  Level other = runs_.run(n, loosen ? loosened * seen.tolerance : std::max(seen.tolerance / loosened, 1e-14));
  const bool nothing_saved = loosen && double(other.steps) > 0.9 * double(seen.steps);
  // the same steps, which only grew: the difference tells nothing
  if (loosen && other.steps == seen.steps) other = runs_.run(n, std::max(seen.tolerance / 100, 1e-14));
  const double looser = std::max(seen.tolerance, other.tolerance);
  time_ = {looser, std::max(runs_.difference(seen, other), 0.1 * looser), cells_of(seen.scene)};
  return nothing_saved ? seen.tolerance : most;
}

void GridLadder::choose_tolerance_on(double run_cells, double in_space) {
  const double most = tolerance_seen();
  if (request_.tolerance_open) {
    const double in_time =
        std::clamp(share_in_all * aim_ - in_space, share_of_time * aim_, (share_in_all - 0.05) * aim_);
    setting_.tolerance = std::clamp(tolerance_for(in_time / 1.5, run_cells), least_tolerance, most);
  }
  in_time_ = error_in_time(setting_.tolerance, run_cells);
  if (in_time_ > request_.wanted) give_up_in_time(setting_.tolerance, in_time_);
}

// ---- the run ----

double GridLadder::estimate_in_space(const Level& now, double d) const {
  const double p = order_at_best(), last = cells_of(levels_.back().scene), x = cells_of(now.scene) / last;
  double r = next_order();
  // while orders are still far from p, more goes otherwise than predicted
  const auto careful = [&](double error) { return (1.3 + 1.5 * (1 - r / p)) * error; };
  const std::size_t known = distances_.size();
  if (x < 0.97) {
    const double slow = known > 1 ? std::clamp(rate(known - 1), 0.5, p) : r;
    return careful(std::max(d + predicted_error(last), d / (1 - std::pow(x, slow)) / 1.3));
  }
  if (x < 1.03) return careful(predicted_error(cells_of(now.scene)));
  double error = d;
  for (int round = 0; round < 3; ++round) {
    // two grids that are close may err alike
    const double of_last = std::max(d / (1 - std::pow(x, -r)), x < 1.5 ? 0.6 * predicted_error(last) : 0.);
    const double seen =
        std::log(distances_.back() / of_last) / std::log(last / cells_of(levels_[levels_.size() - 2].scene));
    if (!low_order()) r = expected_order(known > 1 ? rate(known - 1) : NAN, seen, order_at_best());
    error = of_last * std::pow(x, -r);
  }
  return careful(error);
}

double GridLadder::estimate(const Answer& end) {
  last_run_ = {on_grid(request_.scene, setting_.n, setting_.order), setting_.tolerance, end, 0, 0, 0};
  const bool elsewhere = setting_.n != levels_.back().scene.n;
  const double d = difference_of_run(elsewhere ? predicted_error(cells_of(levels_.back().scene)) : 0);
  last_difference_ = d;
  last_estimate_ = estimate_in_space(last_run_, d) + 1.5 * in_time_ + between_nodes(last_run_);
  return last_estimate_;
}

// Whether the last level differs from the last run by what its own looser steps err by: two levels that err
// alike in time say nothing of that.
bool GridLadder::level_errs_in_time() const {
  const Level& last = levels_.back();
  return may_restart() && seen_in_time() && last_run_.tolerance < last.tolerance &&
         error_in_time(last.tolerance, cells_of(last.scene)) > 0.3 * last_difference_;
}

// The last run becomes a level.
void GridLadder::take_last_run() {
  // too close to tell
  if (levels_.size() > 2 && cells_of(last_run_.scene) < 1.3 * cells_of(levels_.back().scene)) {
    levels_.pop_back();
    distances_.pop_back();
  }
  add(last_run_);
}

void GridLadder::refine() {
  const bool space = last_estimate_ - 1.5 * in_time_ > 0.5 * request_.wanted;
  const std::string about = fmt::format(" as set the error is about {:.2g}", last_estimate_);
  if (space && !request_.grid_open) throw OutOfReach{fmt::format("on grid_n {}{}", setting_.n, about)};
  if (!request_.tolerance_open && !space)
    throw OutOfReach{fmt::format("at the tolerance {:.2g}{}", setting_.tolerance, about)};
  aim_ *= 0.7;
  if (space && level_errs_in_time()) {
    ++restarts_;
    begin_anew();
  } else if (request_.grid_open && cells_of(last_run_.scene) > 1.03 * cells_of(levels_.back().scene))
    take_last_run();
  else
    aim_ *= 0.5;
  least_stretch_ =
      std::min(std::pow(last_estimate_ / (share_in_all * request_.wanted), 1 / next_order()), 2.);
  choose();
}

std::string GridLadder::predicted() const {
  return fmt::format("; error predicted in time {:.2g}, in space {:.2g} (falling like h^{:.2g}{})", in_time_,
                     in_space_, order_beyond(),
                     request_.corner_order <= 2 ? ", as " + profile_word() + " along x" : "");
}

}  // namespace

std::unique_ptr<Ladder> grid_ladder(const AccuracyRequest& request, Setting& setting, LevelRuns& runs) {
  return std::make_unique<GridLadder>(request, setting, runs);
}

}  // namespace stickslip
