// Lyapunov exponents of a run (lyapunov_count): tangent vectors taken along its accepted steps, as an
// observer. Sets `lyapunov`, `lyapunov_...` in the summary and writes the group `lyapunov` of the file.
//
// An exponent is -infinity where nodes that came to rest in the time of the measurement took its direction
// away.
#pragma once

#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/stability/growth_average.hpp"
#include "stickslip/stability/tangents.hpp"

namespace stickslip {

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
