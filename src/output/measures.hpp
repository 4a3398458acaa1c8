// Period, amplitude and wave speed of a run as functionals of its solution alone: they are read from the
// method's dense output, at times that do not depend on where steps fall, so that they converge as the
// solution does. What the regime (regime.hpp) measures in passing depends on the steps a little, and costs
// less.
//
//   period      mean time between upward passages of psi through v (in the plate's direction, forward.hpp:
//               downward ones where v < 0) at a place, in the second half of the run. A passage counts after
//               psi was below v by a hundredth of its scale (scales.hpp, velocity), so that round-off about
//               steady sliding has no period. Of several places: the mean of their periods.
//   amplitude   half of the largest range of psi at any x in the last quarter of the run: extrema in time
//               from nine values of every step, their largest over x by the scheme's polynomial about the
//               largest node (a chain's largest block).
//   wave speed  that of field_watch.hpp, which is shown the last quarter at fixed times.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "output/cluster_rows.hpp"
#include "output/field_watch.hpp"
#include "output/repeats.hpp"
#include "output/step_course.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/measure.hpp"
#include "stickslip/output/probe.hpp"

namespace stickslip {

// At each of x, in one over time. `exact`: passages from the dense output (every step of the second half is
// then kept for it); else from the course of psi in the step that passes (step_course.hpp), which costs next
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

}  // namespace stickslip
