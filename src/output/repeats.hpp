// Times at which a motion passes a level in one direction, counted: their mean distance, and how well it is
// known.
#pragma once

#include <cmath>
#include <optional>

#include "numerics/straight_line.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

class Repeats {
 public:
  // The time of the newest of `more` passages since the last one that was told.
  void add(double t, double more = 1) {
    if (count_ < 0) first_ = t;
    count_ += count_ < 0 ? 1 : more;
    last_ = t;
    if (count_ > 0 && spacing_ == 0) {
      spacing_ = (t - first_) / count_;
      off_line_.add(0, 0);
    }
    // beside equal distances, so that what is small stands alone
    if (spacing_ > 0) off_line_.add(count_, t - first_ - count_ * spacing_);
  }
  double passages() const { return count_ + 1; }
  double last() const { return last_; }
  double mean() const { return (last_ - first_) / count_; }  // of two passages or more
  // Of the mean, from how far passages lie beside equal distances; 0 for less than three.
  double error() const {
    return off_line_.count() > 2 ? std::sqrt(2 * off_line_.variance()) / count_ : 0;
  }

  template <class List>
  void archive(List& list) {
    list(count_, first_, last_, spacing_);
    off_line_.archive(list);
  }

 private:
  double count_ = -1, first_ = 0, last_ = 0, spacing_ = 0;  // of distances
  StraightLine off_line_;
};

// What steps add to the error of a period: a bound, often a hundred times what the period is off. An error of
// the force is not forgotten while a node rests or slides steadily, and delays its next slip. It is known as
// a whole where the run's error is (`passage`, the delay of a passage by it, 0: not known), else each step of
// the period may err by the part `step` (0: not known) of what it computes.
struct PeriodErrors {
  double step = 0, passage = 0;
  double of(double period, double steps, double periods) const {
    return passage > 0 ? 2 * passage / periods : step * steps * std::abs(period);
  }
};

// Puts a period into the summary with the digits that its error leaves, to the error's fourth, and the error,
// as `period_error`, with two.
void set_period(Summary& summary, double period, double error);

}  // namespace stickslip
