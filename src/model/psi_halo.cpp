#include "model/psi_halo.hpp"

#include <algorithm>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

PsiHalo::PsiHalo(const Scene& scene, int dof, PetscInt first, PetscInt local, Vec pattern)
    : dof_(dof), half_width_(scene.order / 2), local_(local) {
  const auto index_of = [&](PetscInt node) {
    const auto found = std::find(fetched_.begin(), fetched_.end(), node);
    if (found != fetched_.end()) return static_cast<std::size_t>(found - fetched_.begin());
    fetched_.push_back(node);
    return fetched_.size() - 1;
  };
  const auto add = [&](PetscInt node) {
    Value value;
    if (node >= 0 && node < scene.n) {
      value.emplace_back(index_of(node), 1.);
    } else {
      for (const auto& [inside, weight] : halo_node(scene, node))
        value.emplace_back(index_of(inside), weight);
    }
    halo_.push_back(value);
  };
  for (int j = -half_width_; j < 0; ++j) add(first + j);
  for (int j = 0; j < half_width_; ++j) add(first + local + j);
  values_.resize(fetched_.size());
  const MPI_Comm comm = PetscObjectComm(reinterpret_cast<PetscObject>(pattern));
  is_local_ = ranks_in(comm) == 1;
  if (is_local_) return;

  std::vector<PetscInt> entries;
  for (const PetscInt node : fetched_) entries.push_back(node * dof);
  const auto count = static_cast<PetscInt>(entries.size());
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, count, fetched_psi_.out()));
  IsHandle from;
  SS_TRY(ISCreateGeneral(comm, count, entries.data(), PETSC_COPY_VALUES, from.out()));
  SS_TRY(VecScatterCreate(pattern, from, fetched_psi_, nullptr, scatter_.out()));
}

void PsiHalo::read(const double* u) const {
  for (std::size_t i = 0; i < fetched_.size(); ++i) values_[i] = u[fetched_[i] * dof_];
}

void PsiHalo::begin(Vec u) const {
  SS_TRY(VecScatterBegin(scatter_, u, fetched_psi_, INSERT_VALUES, SCATTER_FORWARD));
}

void PsiHalo::end(Vec u) const {
  SS_TRY(VecScatterEnd(scatter_, u, fetched_psi_, INSERT_VALUES, SCATTER_FORWARD));
  const Reading values(fetched_psi_);
  std::copy(values + 0, values + values_.size(), values_.begin());
}

}  // namespace stickslip
