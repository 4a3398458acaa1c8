#include "time/step_errors.hpp"

#include <algorithm>
#include <cmath>

#include "base/broadcast.hpp"
#include "stickslip/model/frictions.hpp"

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

SlaveErrors::SlaveErrors(const Scene& scene, const FrictionPlaces& places) {
  if (!scene.massless() && Frictions(scene, 0, 1)[0].steep)
    law_ = kernel::law_columns(scene.friction, false, places);
}

void SlaveErrors::operator()(const Columns& c,
                             const std::function<NodeCoefficients(PetscInt)>& coefficients) const {
  for (std::vector<double>& column : columns_) column.resize(std::size_t(c.count));
  const auto at = [&](int j) { return columns_[j].data(); };
  const kernel::LawValues law{at(0), at(1), at(2), at(3), at(4), at(5)};
  law_.partials({c.psi, c.state, nullptr, c.count, c.number}, law);
  for (PetscInt i = 0; i < c.count; ++i) {
    const NodeCoefficients own = coefficients(i);
    const double amplitude = c.amplitude ? c.amplitude[i] : 1, hA = c.h * own.A;
    const double a = 1 + hA * (own.B + amplitude * law.F_psi[i]), b = hA * (amplitude * law.F_state[i]);
    const double of_psi_from_state = c.h * law.g_psi[i], d = 1 - c.h * law.g_state[i];
    const double determinant = a * d + b * of_psi_from_state;
    if (!(determinant > 0)) continue;  // no slave: friction falls
    const double known = c.of_psi[i] + hA * c.of_eta[i], of_state = c.of_state[i];
    c.of_psi[i] = (known * d - b * of_state) / determinant;
    c.of_state[i] = (a * of_state + of_psi_from_state * known) / determinant;
  }
}

}  // namespace stickslip
