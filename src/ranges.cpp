#include "ranges.hpp"

#include <algorithm>

#include "stickslip/error.hpp"

namespace stickslip {

void Ranges::after(double t, Vec u) {
  if (t < 0.5 * t_end_) return;
  const std::size_t part = t < 0.75 * t_end_ ? 0 : 1, dof = std::size_t(model_.dof());
  std::vector<double>&low = low_[part], &high = high_[part];
  const auto n = std::size_t(model_.local());
  const double* a;
  SS_TRY(VecGetArrayRead(u, &a));
  if (low.empty()) {
    low.resize(n);
    for (std::size_t i = 0; i < n; ++i) low[i] = a[i * dof];
    high = low;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double psi = a[i * dof];
    low[i] = std::min(low[i], psi);
    high[i] = std::max(high[i], psi);
  }
  SS_TRY(VecRestoreArrayRead(u, &a));
}

void Ranges::into(Measurement& measurement, Gather& gather, Vec work) const {
  const auto dof = std::size_t(model_.dof());
  for (const int part : {0, 1}) {
    // Every rank has seen the same steps; one without nodes has nothing to say.
    int seen = low_[part].empty() ? 0 : 1;
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &seen, 1, MPI_INT, MPI_MAX, model_.comm()));
    if (!seen) continue;
    double* a;
    SS_TRY(VecGetArray(work, &a));
    for (std::size_t i = 0; i < low_[part].size(); ++i) {
      a[i * dof] = low_[part][i];
      a[i * dof + 1] = high_[part][i];
    }
    SS_TRY(VecRestoreArray(work, &a));
    const auto& fields = gather.components(work);
    if (!fields.empty() && !fields[0].empty()) measurement.widen(part, fields[0], fields[1]);
  }
}

}  // namespace stickslip
