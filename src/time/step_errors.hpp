// What a step errs by: its new values weighed as ErrorNorm says.
#pragma once

#include <functional>

#include "model/kernel.hpp"
#include "time/step_taker.hpp"

namespace stickslip {

class StepErrors {
 public:
  struct Sums {
    double squares = 0, largest = 0, not_finite = 0;
    double unsolved = 0;  // equations without a solution
  };
  StepErrors();
  // Adds `count` new values u of an unknown (psi 0, eta 1, the state 2) with their errors; without an
  // estimate only whether they are finite.
  void add(int unknown, const double* u, const double* errors, PetscInt count, const ErrorNorm& norm,
           bool estimate, Sums& sums) const;
  // Over all ranks, of so many unknowns. Collective.
  static StepTaker::Outcome over_ranks(MPI_Comm comm, const Sums& sums, const ErrorNorm& norm, bool estimate,
                                       double unknowns);

 private:
  std::function<double(const kernel::Weighted&)> square_;
};

}  // namespace stickslip
