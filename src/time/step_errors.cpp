#include "time/step_errors.hpp"

#include <algorithm>
#include <cmath>

#include "base/broadcast.hpp"

namespace stickslip {

StepErrors::StepErrors()
    : square_(kernel::compiled<std::function<double(const kernel::Weighted&)>>(kernel::SumOfSquares{})) {}

void StepErrors::add(int unknown, const double* u, const double* errors, PetscInt count,
                     const ErrorNorm& norm, bool estimate, Sums& sums) const {
  const double atol = norm.tolerances.absolute[unknown], rtol = norm.tolerances.relative[unknown];
  if (estimate && norm.type != NORM_INFINITY) {
    sums.squares += square_({u, errors, atol, rtol, count});
    return;
  }
  double not_finite = sums.not_finite, largest = sums.largest;
  for (PetscInt i = 0; i < count; ++i) not_finite += u[i] - u[i];
  for (PetscInt i = 0; i < count && estimate; ++i) {
    const double size = std::max(std::abs(u[i]), std::abs(u[i] - errors[i]));
    largest = std::max(largest, std::abs(errors[i]) / (atol + rtol * size));
  }
  sums.not_finite = not_finite;
  sums.largest = largest;
}

StepTaker::Outcome StepErrors::over_ranks(MPI_Comm comm, const Sums& sums, const ErrorNorm& norm,
                                          bool estimate, double unknowns) {
  double total[3] = {sums.squares, sums.not_finite, sums.unsolved};
  sum_over(comm, total, 3);
  const double error = !estimate                    ? -1
                       : norm.type == NORM_INFINITY ? largest_over(comm, sums.largest)
                                                    : std::sqrt(total[0] / unknowns);
  return {std::isfinite(total[0]) && std::isfinite(total[1]), error, total[2] == 0};
}

}  // namespace stickslip
