// Lyapunov exponents from the growth of tangent vectors: means over time, their errors, and the dimension
// that follows.
//
// The time of the measurement is cut into equal intervals; what a step of the run brings is shared out among
// those over which it stretches. The exponent lambda_k is the slope of the straight line through the
// logarithm of the length of vector k against time, by least squares: the mean of the growth rate, weighted
// with s (1 - s) at the part s of the time. Of a motion that repeats itself with the period P it errs by
// (P/time)^2, where the plain mean errs by P/time; of one that forgets, by sqrt(6/5) of what that does. The
// error given is the standard error of the same in 16 blocks, right to a fifth where the motion forgets
// within a block. Not in it: the error of the steps, and what a motion not yet settled is off by.
//
// Kaplan and Yorke's dimension, of exponents in decreasing order: D = j + (lambda_1 + ... +
// lambda_j)/|lambda_(j+1)|, j the largest number for which that sum is not negative. An exponent within its
// error of 0 counts as 0.
//
// Nothing here communicates. Units: exponents 1/time.
#pragma once

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace stickslip {

struct Estimate {
  // -infinity and NaN where a direction is lost; error NaN where the time is too short for one
  double value, error;
};

class GrowthAverage {
 public:
  static constexpr std::size_t intervals = 256;  // from `from` to `until`

  GrowthAverage(std::size_t exponents, double from, double until)
      : count_(exponents), from_(from), interval_((until - from) / double(intervals)) {}

  // Growth (logarithms) over [begin, end], which follows on the last call; what lies before `from` is left
  // out. Returns how many intervals are complete now.
  std::size_t add(double begin, double end, const std::vector<double>& growth);
  // Rate of vector k in a complete interval, and the time at which that ends.
  double rate(std::size_t interval, std::size_t k) const { return sums_[interval * count_ + k] / interval_; }
  double end_of(std::size_t interval) const { return from_ + interval_ * double(interval + 1); }

  double measured() const { return measured_; }  // time over which
  std::vector<Estimate> exponents() const;

  // All that a later object needs to go on, as a list of this name (output/archive.hpp).
  template <class Archive>
  void archive(const std::string& name, Archive& a) {
    a.list(name, [&](auto& x) {
      x(from_, interval_, measured_);
      x.rest(sums_);
    });
    if (sums_.size() % count_ != 0) throw std::runtime_error("its growth rates do not fit");
  }

 private:
  std::size_t whole() const;  // intervals that are complete
  double slope(std::size_t k, std::size_t first, std::size_t count) const;
  double error(std::size_t k) const;

  std::size_t count_;
  double from_, interval_, measured_ = 0;
  std::vector<double> sums_;  // of growth, interval by interval, the last one under way
};

// Empty where the exponents given, in decreasing order, do not reach as far. Of a motion of `unknowns`
// unknowns.
std::optional<Estimate> kaplan_yorke(const std::vector<Estimate>& exponents, std::size_t unknowns);

}  // namespace stickslip
