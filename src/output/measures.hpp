// Period, amplitude and wave speed of a run as functionals of its solution alone: they are read from the
// method's dense output, at times that do not depend on where steps fall, so that they converge as the
// solution does. What the regime (regime.hpp) measures in passing depends on the steps a little, and costs
// less.
//
//   period      mean time between upward passages of psi through v (in the plate's direction, observer.hpp:
//               downward ones where v < 0) at a place, in the second half of the run. A passage counts after
//               psi was below v by a hundredth of its scale (scales.hpp, velocity), so that round-off about
//               steady sliding has no period. Of several places: the mean of their periods.
//   amplitude   half of the largest range of psi at any x in the last quarter of the run: extrema in time
//               from nine values of every step, their largest over x by the scheme's polynomial about the
//               largest node (a chain's largest block).
//   wave speed  that of field_watch.hpp, which is shown the last quarter at fixed times.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "output/field_watch.hpp"
#include "output/series.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/probe.hpp"

namespace stickslip {

// At each of x, in one over time. `exact`: passages from the dense output (every step of the second half is
// then kept for it); else from the course of psi in the step that passes (field_watch.hpp), which costs next
// to nothing and errs by dt^4; of clusters, from the cubic through the values at four steps. What is not
// exact is rounded to its error, which stands beside it.
class Period final : public Measure {
 public:
  Period(const Model& model, const Scene& whole, const std::vector<double>& x, double t_end, bool exact);

  void plan(ObservationPlan& plan) override;
  void step(const ObservedStep& step) override;
  void moved(const MovedNodes& nodes, const MediumNow& now) override;
  void changed(double t, const MediumNow& now) override;
  void errors_up_to(const PeriodErrors& errors) { errors_ = errors; }  // of steps whose error is controlled
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;  // `period`, `period_error`
  std::vector<double> values() const override;       // one at each place

 private:
  struct Place {
    double armed = 0;
    Repeats passages;
  };
  struct OwnPart {  // of psi at a place, a node of this rank
    std::size_t place, index;
    PetscInt node;
    double weight;
    NodeMoment before, now;
  };
  struct Moment {
    double t;
    std::vector<double> psi;
  };
  void see(double t, const std::vector<double>& psi);
  void see(double t, const MediumNow& now);
  void pass(std::size_t place, const std::function<double(double)>& psi_at);
  void look_at_parts(Vec u, double t);
  StepCourse course(std::size_t place) const;  // between the last two moments, which are those of a step

  const Model& model_;
  Probes probes_;
  Attention attention_;
  VecHandle work_;
  std::string name_;  // of the passages in a checkpoint
  double forward_, level_, depth_, begin_, steps_ = 0;
  PeriodErrors errors_;
  bool exact_, by_clusters_ = false;
  std::vector<Place> places_;
  NodeRates rates_;
  std::vector<OwnPart> parts_;
  std::vector<Moment> seen_;  // up to four, the newest last
};

class Amplitude final : public Measure {
 public:
  Amplitude(const Model& model, double t_end);

  void plan(ObservationPlan& plan) override;
  void step(const ObservedStep& step) override;
  void summarise(Summary& summary, Vec u) override;  // `amplitude`
  std::vector<double> values() const override;

 private:
  void take(std::size_t node, const double* samples);
  double largest_about(PetscInt node, const std::vector<double>& half_ranges) const;

  const Model& model_;
  VecHandle work_;
  double begin_;
  std::vector<double> low_, high_;         // of this rank's nodes
  std::vector<std::vector<double>> seen_;  // psi of this rank's nodes at the nine times of a step
};

class WaveSpeed final : public Measure {
 public:
  WaveSpeed(const Model& model, double t_end);

  void plan(ObservationPlan& plan) override;
  void step(const ObservedStep& step) override;
  void summarise(Summary& summary, Vec u) override;  // `wave_speed`
  std::vector<double> values() const override;

 private:
  double time(long index) const;

  FieldWatch field_;
  VecHandle work_;
  bool ring_;
  double begin_, t_end_;
  long next_ = 0;  // time to come
};

// The maxima of psi at one place: what a Poincare section shows of a motion. A cycle repeats after one of
// them (or as many as it has), a period that has doubled after twice as many, and chaos never.

// Of psi in the plate's direction (observer.hpp): where v < 0 they are minima of psi.
//
// `maxima` in the summary: the last of those in the second half of the run, in their order; and
// `maxima_period`: after how many they repeat to 1e-3 of the largest |maximum|, 0 where not within a quarter
// of their number, null with fewer than 8. Each is that of the quartic through five values of the method's
// dense output over its step. A maximum counts where psi rises to it and falls from it by `maxima_prominence`
// at least, a thousandth of psi's range there over that half, or ten times what error control lets psi err by
// in a step if that is more: less are ripples, of which a rest has any number.
class Maxima : public Observer {
 public:
  static constexpr std::size_t most = 128;                     // in the list
  static constexpr double prominence = 1e-3, tolerances = 10;  // of the range; of an allowed error

  // At x, interpolated as a probe is, of a run that ends at t_end.
  Maxima(const Model& model, const Scene& whole, double x, double t_end);

  // The tolerances of the steps, where their error is controlled.
  void errors_up_to(double absolute, double relative) {
    absolute_ = absolute;
    relative_ = relative;
  }

  void plan(ObservationPlan& plan) override;
  void step(const ObservedStep& step) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;

 private:
  double psi(Vec u) { return forward_ * probe_.read(u).psi[0]; }

  void visit(double value, bool is_maximum);
  double least_prominence() const;

  Probes probe_;
  VecHandle work_;
  double forward_;
  std::string name_;                     // of the list in a checkpoint
  double begin_, last_ = 0, slope_ = 0;  // psi and its slope where the last step ended
  // Extremes so far; of what comes after the last maximum that counts the least value, and a maximum that
  // will count once psi has fallen far enough from it (NaN: none).
  double highest_ = -HUGE_VAL, lowest_ = HUGE_VAL, low_ = HUGE_VAL, candidate_ = NAN;
  double absolute_ = 0, relative_ = 0;
  std::vector<double> maxima_, lows_;  // and the least value before each
};

// Of the maxima of a row, with the least value before each and after the last, those to which it rises and
// from which it falls by so much at least.
std::vector<double> prominent(const std::vector<double>& maxima, const std::vector<double>& lows,
                              double last_low, double least);

// After how many entries the list repeats, as maxima_period has it; -1 for null.
int period_of(const std::vector<double>& maxima);

// How much of the last quarter of a run its nodes rest, in the mean over those that are not held:
// `rest_fraction`. A node rests over a step at both ends of which its psi is 0: steps end where a node comes
// to rest or slips. With regularised friction it rests while |psi| is at most 4 eps, as in cycles; where it
// comes to that and leaves it lies within steps, on the course of psi there (field_watch.hpp).
class RestFraction : public Observer {
 public:
  static SummaryKey key();
  // Of a run that ends at t_end.
  RestFraction(const Model& model, double t_end);

  void plan(ObservationPlan& plan) override { by_clusters_ = plan.by_clusters; }
  void step(const ObservedStep& step) override;
  void moved(const MovedNodes& nodes, const MediumNow& now) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;

 private:
  // Takes u as the end of a step; how many nodes of this rank rest there and did at the end before.
  long look_at(const double* u);
  // The same for nodes that come slowly to rest: how many there are in the mean over the part of the step of
  // length dt that begins at `begin`, a part of it, over that part.
  double look_within(const double* u, double t, double dt, double begin);
  double part_at_rest(PetscInt node, const double* u, double normal, double dt, double begin) const;
  std::pair<PetscInt, PetscInt> free_nodes() const;  // of this rank: from, to

  const Model& model_;
  double t_end_, slow_;              // at most this fast at rest
  std::vector<std::uint8_t> rests_;  // 1 or 0 of each of this rank's nodes, at the end of the last step
  std::vector<double> rested_;       // the time that they did, added up
  double measured_ = 0;              // time that was looked at
  std::vector<double> last_;         // u at the end of the last step, with slow_ > 0
  double last_normal_ = 1;
  std::array<NodeRates, 2> rates_;  // of the last two ends of steps
  int now_ = 0;                     // the newer of them
  bool by_clusters_ = false;
};

}  // namespace stickslip
