#include "stickslip/output/gather.hpp"

#include <stdexcept>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

Gather::Gather(Vec like, PetscInt dof) : components_(static_cast<std::size_t>(dof)) {
  SS_TRY(VecScatterCreateToZero(like, scatter_.out(), on_root_.out()));
}

const std::vector<std::vector<double>>& Gather::components(Vec v) {
  const std::vector<double> values = interleaved(v);
  const std::size_t dof = components_.size();
  for (std::size_t d = 0; d < dof; ++d) {
    components_[d].resize(values.size() / dof);
    for (std::size_t i = 0; i < components_[d].size(); ++i) components_[d][i] = values[i * dof + d];
  }
  return components_;
}

std::vector<double> Gather::interleaved(Vec v) {
  SS_TRY(VecScatterBegin(scatter_, v, on_root_, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecScatterEnd(scatter_, v, on_root_, INSERT_VALUES, SCATTER_FORWARD));
  PetscInt size = 0;
  const PetscScalar* values = nullptr;
  SS_TRY(VecGetLocalSize(on_root_, &size));
  SS_TRY(VecGetArrayRead(on_root_, &values));
  std::vector<double> out(static_cast<std::size_t>(size));
  for (PetscInt i = 0; i < size; ++i) out[static_cast<std::size_t>(i)] = PetscRealPart(values[i]);
  SS_TRY(VecRestoreArrayRead(on_root_, &values));
  return out;
}

void Gather::spread(const std::vector<double>& values, Vec v) {
  PetscInt size = 0;
  PetscScalar* array = nullptr;
  SS_TRY(VecGetLocalSize(on_root_, &size));
  on_root(PetscObjectComm(reinterpret_cast<PetscObject>(v)), [&] {
    if (values.size() != static_cast<std::size_t>(size)) throw std::logic_error("a vector of another length");
  });
  SS_TRY(VecGetArray(on_root_, &array));
  for (PetscInt i = 0; i < size; ++i) array[i] = values[static_cast<std::size_t>(i)];
  SS_TRY(VecRestoreArray(on_root_, &array));
  SS_TRY(VecScatterBegin(scatter_, on_root_, v, INSERT_VALUES, SCATTER_REVERSE));
  SS_TRY(VecScatterEnd(scatter_, on_root_, v, INSERT_VALUES, SCATTER_REVERSE));
}

}  // namespace stickslip
