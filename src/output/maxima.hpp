// The maxima of psi at one place: what a Poincare section shows of a motion. A cycle repeats after one of
// them (or as many as it has), a period that has doubled after twice as many, and chaos never.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/probe.hpp"

namespace stickslip {

// Of psi in the plate's direction (forward.hpp): where v < 0 they are minima of psi.
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

}  // namespace stickslip
