// Lyapunov exponents of a run: the mean growth of tangent vectors, and the observer that takes it.
#pragma once

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/stability/tangents.hpp"

namespace stickslip {

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

  // All that a later object needs to go on, as a list of this name (output/checkpoint.hpp).
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

// Lyapunov exponents of a run (lyapunov_count): tangent vectors taken along its accepted steps, as an
// observer. Sets `lyapunov`, `lyapunov_...` in the summary and writes the group `lyapunov` of the file.
//
// An exponent is -infinity where nodes that came to rest in the time of the measurement took its direction
// away.
class LyapunovExponents : public Observer {
 public:
  // The model is the whole scene. Throws UsageError where it has fewer unknowns than exponents are asked for.
  LyapunovExponents(const Model& model, const Options& options);

  // Of the steps: an absolute error that they allow. A slope of friction that it changes makes the exponents
  // those of another motion, of which summarise() warns.
  void errors_up_to(double absolute) { allowed_ = absolute; }

  void plan(ObservationPlan& plan) override;
  void start(RunFile* file) override { file_ = file; }
  void step(const ObservedStep& step) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;

 private:
  void judge(Vec u);

  const Model& model_;
  std::size_t count_;
  double from_;
  Tangents tangents_;
  GrowthAverage average_;  // of the exponents, and behind them of the divergence
  bool measuring_ = false;
  std::size_t written_ = 0;  // rows
  double allowed_ = 0;
  double least_psi_ = 0;  // of |psi| where the slope of friction is not known; 0: nowhere
  RunFile* file_ = nullptr;
};

// A line for a person; "" where nothing was measured.
std::string lyapunov_words(const Summary& summary);

}  // namespace stickslip
