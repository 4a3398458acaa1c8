// A ladder of tolerances: where there is no grid to refine (the chain, uniform motion).
//
// The last level is stricter than the run, so that the run's error is its distance from that level. How
// errors fall with the tolerance says only where the run is to be placed: on a ladder of few levels they fall
// now faster, now slower, and in chains a run may come near a looser one by chance while both are wrong.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "study/ladder.hpp"

namespace stickslip {

namespace {

class ToleranceLadder final : public Ladder {
 public:
  using Ladder::Ladder;

  void choose() override;
  double estimate(const Answer& end) override;
  void refine() override;
  bool confirm() override;
  std::string predicted() const override {
    return std::isnan(in_time_) ? "" : fmt::format("; error predicted in time {:.2g}", in_time_);
  }

 private:
  double steepest_fall(const Level& from, const Level& to) const override {
    return std::max(1., std::pow(from.tolerance / to.tolerance, 1.25));
  }
  // Implicit steps err by far more than their tolerance where friction or waves are stiff.
  double first() const {
    return std::clamp((setting_.method.can().is_explicit ? 10 : 0.1) * aim_, 1e-12, loosest());
  }
  // Explicit steps meet a threshold now sooner, now later in a step.
  bool scatters() const { return setting_.method.can().is_explicit && !smooth(); }
  double loosest() const { return setting_.method.can().is_explicit ? 1e-2 : 1e-4; }
  // By how much the last level is stricter than the run, at least, so that it errs by little beside it.
  double lead() const { return scatters() ? 10 : setting_.method.can().is_explicit ? 5 : 2.5; }
  bool leads(double wish) const {
    return wish >= lead() * levels_.back().tolerance || levels_.back().tolerance <= 2 * least_tolerance;
  }
  // Of the level that is to lead a run at `wish`.
  double next_tolerance(double wish) const {
    const double last = levels_.back().tolerance, goal = std::min(wish / (2 * lead()), last / lead());
    return std::max({goal, last / 1000, least_tolerance});
  }
  double wished() const;
  double slope() const;
  double predicted_time(double tolerance) const;
  bool place_or_go_on(double& next);
  void place(double wish);
  void look_beyond_own_steps();
  double estimate_in_time(const Level& now, double d) const;

  double in_time_ = NAN;  // predicted of the run
};

double ToleranceLadder::slope() const {
  const double most = smooth() ? 1.25 : 0.75;
  const std::size_t known = distances_.size();
  if (known < 2) return slope_in_time();
  return std::clamp(std::log(distances_[known - 2] / distances_[known - 1]) /
                        std::log(levels_[known - 2].tolerance / levels_[known - 1].tolerance),
                    0.5, most);
}

double ToleranceLadder::predicted_time(double tolerance) const {
  return distances_.back() * std::pow(tolerance / levels_[levels_.size() - 2].tolerance, slope());
}

// The tolerance that should do.
double ToleranceLadder::wished() const {
  return levels_[levels_.size() - 2].tolerance *
         std::pow(share_in_all * aim_ / distances_.back(), 1 / slope());
}

void ToleranceLadder::choose() {
  double next = request_.tolerance_open ? first() : setting_.tolerance / loosened;
  for (;;) {
    std::string failed;
    Level made = runs_.run(request_.scene.n, next, failed);
    if (!failed.empty()) {
      if (!request_.method_open || setting_.method.can().is_explicit)
        throw OutOfReach{fmt::format("{} at tolerance {:.2g}: {}", setting_.method.name(), next, failed)};
      runs_.take_explicit();
      next = first();
      continue;
    }
    if (!request_.tolerance_open) {
      levels_ = {std::move(made)};
      return;
    }
    // they only grew: the difference tells nothing
    if (!levels_.empty() && made.steps == levels_.back().steps) {
      if (next <= 2 * least_tolerance) {
        levels_.push_back(made);
        distances_.push_back(1e-15);
        setting_.tolerance = next;
        in_time_ = 1e-15;
        return;
      }
      next = std::max(next / 100, least_tolerance);
      continue;
    }
    add(std::move(made));
    if (levels_.size() == 1)
      next =
          std::max(levels_.back().tolerance / (setting_.method.can().is_explicit ? 1000 : 10),
                   least_tolerance);
    else if (place_or_go_on(next))
      return;
  }
}

// Places the run where the last level leads it, or says where the next level is to be.
bool ToleranceLadder::place_or_go_on(double& next) {
  const Level& last = levels_.back();
  const double d = distances_.back(), wish = wished();
  if (last.tolerance <= 2 * least_tolerance && d > aim_ && wish < last.tolerance)
    give_up_in_time(last.tolerance, d);
  if (runs_.prefers_explicit(last, request_.scene.n, wish)) {
    runs_.take_explicit();
    begin_anew();
    next = first();
    return false;
  }
  if (leads(wish))
    place(wish);
  else
    next = next_tolerance(wish);
  return leads(wish);
}

void ToleranceLadder::place(double wish) {
  // so close to the last level, which nothing can be stricter than, the distance from it would tell nothing
  const double last = levels_.back().tolerance;
  if (wish > last / 2 && wish < last * 2) wish = last;
  setting_.tolerance = std::clamp(wish, least_tolerance, 3 * loosest());
  in_time_ = predicted_time(setting_.tolerance);
}

bool ToleranceLadder::confirm() {
  if (distances_.empty()) return false;
  setting_.tolerance = levels_.back().tolerance;
  in_time_ = predicted_time(setting_.tolerance);
  return true;
}

double ToleranceLadder::estimate_in_time(const Level& now, double d) const {
  if (!request_.tolerance_open) return 1.2 * d;
  const Level& last = levels_.back();
  const double x = last.tolerance / now.tolerance;
  if (x < 0.7) return d / (1 - std::pow(x, slope()));
  return std::max(d, predicted_time(now.tolerance));  // at the last level's own tolerance, or next to it
}

// A run of a few steps may take nearly those of the last level, whatever its tolerance: their distance, far
// below what was predicted, then tells little of the error, and only stricter levels do, which cost next to
// nothing.
void ToleranceLadder::look_beyond_own_steps() {
  constexpr PetscInt few = 50;
  for (int k = 0; k < 3 && request_.tolerance_open && levels_.back().steps < few; ++k) {
    if (levels_.back().tolerance <= 2 * least_tolerance) return;
    const double predicted = predicted_time(std::max(last_run_.tolerance, levels_.back().tolerance));
    if (runs_.difference(levels_.back(), last_run_) >= 0.2 * predicted) return;
    add(runs_.run(request_.scene.n, std::max(levels_.back().tolerance / 100, least_tolerance)));
  }
}

double ToleranceLadder::estimate(const Answer& end) {
  last_run_ = {request_.scene, setting_.tolerance, end, 0, 0, 0};
  look_beyond_own_steps();
  const bool elsewhere = setting_.tolerance != levels_.back().tolerance && !distances_.empty();
  const double d = difference_of_run(elsewhere ? predicted_time(levels_.back().tolerance) : 0);
  // they may err alike by chance
  const double least = elsewhere ? 0.3 * predicted_time(setting_.tolerance) : 0;
  const bool beside = last_run_.tolerance > levels_.back().tolerance;
  last_estimate_ = (scatters() ? 1.3 : beside ? 1.1 : 1.4) * std::max(estimate_in_time(last_run_, d), least);
  return last_estimate_;
}

void ToleranceLadder::refine() {
  const double before = setting_.tolerance;
  if (!request_.tolerance_open)
    throw OutOfReach{
        fmt::format("at the tolerance {:.2g} as set the error is about {:.2g}", before, last_estimate_)};
  aim_ *= 0.7;
  const Level& last = levels_.back();
  if (before < last.tolerance / 2) {
    add(last_run_);
  } else if (before > 1.5 * last.tolerance && before < levels_[levels_.size() - 2].tolerance) {
    distances_.back() = runs_.difference(last, last_run_);
    levels_[levels_.size() - 2] = last_run_;
    if (distances_.size() > 1)
      distances_[distances_.size() - 2] = runs_.difference(levels_[levels_.size() - 3], last_run_);
  }
  if (before <= 2 * least_tolerance) give_up_in_time(before, last_estimate_);
  const double seen = before * std::pow(share_in_all * aim_ / last_estimate_, 1 / slope());
  double wish = std::min({wished(), seen, before / 3});
  while (!leads(wish)) {
    add(runs_.run(request_.scene.n, next_tolerance(wish)));
    wish = std::min(wished(), before / 3);
  }
  place(wish);
  setting_.tolerance = std::min(setting_.tolerance, before / 2);
  in_time_ = predicted_time(setting_.tolerance);
}

}  // namespace

std::unique_ptr<Ladder> tolerance_ladder(const AccuracyRequest& request, Setting& setting, LevelRuns& runs) {
  return std::make_unique<ToleranceLadder>(request, setting, runs);
}

}  // namespace stickslip
