// What takes a whole step of a method for the types of TS of fused_ts.hpp.
#pragma once

#include <vector>

#include "stickslip/base/handle.hpp"
#include "stickslip/time/tolerances.hpp"

namespace stickslip {

// How errors are weighed: |error_i|/(absolute + relative |u_i|), root mean square or the largest.
struct ErrorNorm {
  Tolerances tolerances;
  NormType type;
};

class StepTaker {
 public:
  virtual ~StepTaker() = default;

  struct Outcome {
    bool finite;
    double error;  // as ErrorNorm weighs it; -1 without an estimate
    bool solved;   // every implicit equation, by the root that the step leads to
  };
  // `u_new` = u after a step dt; u and u_new differ. `slopes`: empty, or a Vec for every slope of the method,
  // to keep them for values between steps. `last_slope`: nullptr, or takes the last of them. `t`: where the
  // step begins, which a load alone asks for. Collective; no allocation.
  virtual Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                       const std::vector<VecHandle>& slopes, Vec last_slope = nullptr,
                       double t = 0) const = 0;
  // With friction that sticks (stick.hpp): 1, -1 or 0 for every node of this rank, from now on. Collective.
  virtual void set_direction(const std::vector<double>& direction) = 0;
  // The last stage is taken at the new u: its slope is the right-hand side there.
  virtual bool last_is_solution() const { return false; }
  virtual int stages() const = 0;
};

}  // namespace stickslip
