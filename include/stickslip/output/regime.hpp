// The regime of a run: where its motion goes, judged from every accepted step at up to 128 places (all nodes
// of smaller grids); and what the whole field shows in the last quarter of the run: amplitude, pulses, wave
// speed, steepest front.
//
// The motion is compared with steady sliding, psi = v (with held ends: its boundary layers). The scale of psi
// is |v|, or for v = 0 a 32nd of that of a slip (model/scales.hpp). The distance from sliding is taken over
// the last period of the motion (a sixteenth of the run where it has none): of every place the distance of
// the middle of its range, and 1/sqrt(2) of half its range, which is the root mean square of an oscillation.
// The size of the motion is the root mean square, over the places, of the largest |psi - steady| in a stretch
// of time; its rate of change is the slope of its logarithm over stretches of one or two periods each, with
// the error that the scatter about the straight line gives it, in the last quarter of the run where that
// holds six periods, else in its last half where that holds three, else in its last three quarters. Three
// such errors are what a rate must exceed to be believed (more where there are few stretches).
//
//   sliding     the distance is below 1 % of the scale and falls, or is at round-off,
//               or sliding is stable and it does not rise (noise that error control holds has not fallen in
//               three decay times of theory); and it is not sliding from which the steps let perturbations
//               grow
//   stuck       at rest throughout the last quarter, and nothing loads the medium; or sliding at v = 0
//   stick-slip  at least three periods in that part, at a distance of at least 5 % of the scale, whose size
//               does not change: where sliding is unstable or blocks stick in every period, by less than 5 %
//               or its error, in that part or over three quarters of the run in 8 to 24 stretches of several
//               slips each; where it is stable or not known to be unstable, by so little that at that rate,
//               its error added, it would keep more than half of its size over 20 times the time so far, and
//               not at the linear rate of decay
//   decaying    the size falls, and growing: it rises, by more than its error, in the second half of that
//               part too; what was smaller before, or is beside sliding that is known to be unstable, does
//               not decay
//   undecided   everything else, such as a loaded medium at rest, or fewer than three periods
//
// Memory: 4 numbers for each of 128 windows of time at each place, and 2 for each of the rank's own nodes in
// the last quarter. The same on any number of ranks, to round-off.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

enum class Motion { sliding, stick_slip, stuck, decaying, growing, undecided };
std::string to_string(Motion motion);

// What a run measures from its fields.
struct Measured {
  Motion motion = Motion::undecided;
  std::optional<double> rate;  // of change of the size, measured
  // a run as long as this, from its beginning, should decide; empty: decided
  std::optional<double> time_to_decide;
  std::optional<double> growth;  // linear, of sliding's perturbations, where it is known
  // at rest from the beginning, loaded, and about to slip at `loaded_until`
  bool never_moved = false;
  double loaded_until = 0;
  std::optional<double> amplitude;   // half the largest range of psi at a node in the last quarter
  std::optional<double> wave_speed;  // field_watch.hpp
  // on the whole scene, of which the model may be one of several equal cells
  std::optional<int> pulses;
  // between passages, where the motion repeats: all in the second half of the run, three or more, agree to
  // 1e-3
  std::optional<double> period;
  double period_error = 0;
  // Of a small oscillation about v, in parts of it: what the errors of its steps may have added up to.
  double amplitude_error = 0;
  // of psi at the places looked at, over the last period, that of the load if it has one, else the last
  // quarter
  double low = 0, high = 0;
  // largest step of psi between neighbours over its range, in the last quarter
  double steepest = 0;
};

class Regime : public Observer {
 public:
  // Of a run that ends at t_end. `steady`: psi of steady sliding at a node of the model; empty: v.
  Regime(const Model& model, double t_end, const std::function<double(PetscInt)>& steady = {});
  ~Regime() override;

  // To be called before result(): the largest growth rate of perturbations of steady sliding, the true one
  // and that of the steps taken; NaN: not known, for the reason given. `beyond`: where only waves grow that
  // the grid carries but does not resolve, their growth rate; growth_taken is then theirs, and the regime
  // follows them.
  void know(double growth, double growth_taken, const std::string& why_not = "",
            double beyond = std::numeric_limits<double>::quiet_NaN());

  // By how much a step may err, in parts of what it computes and of psi, in velocity; and by what a passage
  // is delayed for an error of the whole run. 0: not known.
  void errors_up_to(double step, double psi, double passage);

  void plan(ObservationPlan& plan) override;
  void step(const ObservedStep& step) override;
  void moved(const MovedNodes& nodes, const MediumNow& now) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;

  // As far as the run has come, u being its last state; the same on every rank, and valid until the next
  // step. Collective.
  const Measured& result(Vec u);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stickslip
