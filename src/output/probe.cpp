#include "stickslip/probe.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/error.hpp"

namespace stickslip {

Combination interpolation_at(const Scene& scene, double x) {
  const double end = scene.ring() ? scene.length : scene.x(scene.n - 1);
  if (!(x >= 0 && x <= end))
    throw UsageError("out_probes: x = " + number_text(x) + " lies outside the scene, which reaches from 0 to " +
                     number_text(end));
  const double at = x / scene.h();
  const PetscInt nearest = static_cast<PetscInt>(std::llround(at));
  const PetscInt n = scene.n;
  const auto inside = [&](PetscInt i) { return scene.ring() ? ((i % n) + n) % n : i; };
  if (std::abs(at - double(nearest)) < 1e-12 * (1 + at)) return {{inside(nearest), 1.}};
  const PetscInt count = std::min<PetscInt>(scene.order + 1, n);
  PetscInt first = nearest - count / 2;
  if (!scene.ring()) first = std::clamp<PetscInt>(first, 0, n - count);
  Combination row;
  for (PetscInt k = 0; k < count; ++k) {
    double weight = 1;
    for (PetscInt l = 0; l < count; ++l)
      if (l != k) weight *= (at - double(first + l)) / double(k - l);
    row.emplace_back(inside(first + k), weight);
  }
  return row;
}

Probes::Probes(const Model& model, const Scene& whole, const std::vector<double>& x) : dof_(model.dof()) {
  std::vector<PetscInt> nodes;
  for (const double at : x) {
    std::vector<std::pair<std::size_t, double>> row;
    for (const auto& [node, weight] : interpolation_at(whole, at)) {
      row.emplace_back(nodes.size(), weight);
      nodes.push_back(node % model.scene().n);
    }
    rows_.push_back(std::move(row));
  }
  std::vector<PetscInt> entries;
  for (const PetscInt node : nodes)
    for (PetscInt d = 0; d < 2; ++d) entries.push_back(node * dof_ + d);
  const auto count = static_cast<PetscInt>(entries.size());
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, count, fetched_.out()));
  IsHandle from;
  SS_TRY(ISCreateGeneral(model.comm(), count, entries.data(), PETSC_COPY_VALUES, from.out()));
  VecHandle pattern = model.create_vector();
  SS_TRY(VecScatterCreate(pattern, from, fetched_, nullptr, scatter_.out()));
  values_.psi.resize(x.size());
  values_.eta.resize(x.size());
}

const Probes::Values& Probes::read(Vec u) {
  if (rows_.empty()) return values_;
  SS_TRY(VecScatterBegin(scatter_, u, fetched_, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecScatterEnd(scatter_, u, fetched_, INSERT_VALUES, SCATTER_FORWARD));
  const double* a;
  SS_TRY(VecGetArrayRead(fetched_, &a));
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    double psi = 0, eta = 0;
    for (const auto& [index, weight] : rows_[row]) {
      psi += weight * a[2 * index];
      eta += weight * a[2 * index + 1];
    }
    values_.psi[row] = psi;
    values_.eta[row] = eta;
  }
  SS_TRY(VecRestoreArrayRead(fetched_, &a));
  return values_;
}

}  // namespace stickslip
