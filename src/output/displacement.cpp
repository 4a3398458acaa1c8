#include "stickslip/output/displacement.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/moved_nodes.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/linear_systems.hpp"

namespace stickslip {

namespace {

constexpr PetscInt many = 50000;  // nodes from which on no rank is to hold a factor of all of them

}  // namespace

Displacement::Displacement(const Model& model, const Plate& plate)
    : model_(model), plate_(plate), floats_(floats(model.scene())) {
  const Scene& s = model.scene();
  if (floats_) {
    SS_TRY(VecCreateMPI(model.comm(), model.local(), s.n, load_.out()));
    SS_TRY(VecDuplicate(load_, w_.out()));
    return;
  }
  const int ranks = ranks_in(model.comm());
  const double reach = nodes_to_forget(s) + 2 * s.order;
  if (ranks > 1 && s.n >= many && reach < double(s.n) / (4 * ranks))
    make_piece(static_cast<PetscInt>(reach));
  else
    make_whole();
}

// Its factor stands on every rank.
void Displacement::make_whole() {
  const Scene& s = model_.scene();
  const PetscInt first = model_.first(), local = model_.local();
  SS_TRY(MatCreateAIJ(model_.comm(), local, local, s.n, s.n, 2 * s.order + 1, nullptr, s.order + 1, nullptr,
                      matrix_.out()));
  for (PetscInt i = first; i < first + local; ++i) add_row(i, i, [](PetscInt node) { return node; });
  finish_matrix();
  SS_TRY(MatCreateVecs(matrix_, w_.out(), load_.out()));
}

// The nodes of this rank and so many at either side: beyond the cut w is taken for 0, which this rank's own
// nodes do not feel to the last digit.
void Displacement::make_piece(PetscInt margin) {
  const Scene& s = model_.scene();
  const bool ring = s.ring();
  const PetscInt begin = ring ? model_.first() - margin : std::max(PetscInt(0), model_.first() - margin);
  const PetscInt behind = model_.first() + model_.local() + margin,
                 count = (ring ? behind : std::min(behind, s.n)) - begin;
  own_ = model_.first() - begin;
  std::vector<PetscInt> nodes;
  for (PetscInt i = 0; i < count; ++i) nodes.push_back((begin + i + s.n) % s.n);
  SS_TRY(MatCreateSeqAIJ(PETSC_COMM_SELF, count, count, 2 * s.order + 1, nullptr, matrix_.out()));
  const auto place = [&](PetscInt node) {  // negative ones are left out
    const PetscInt at = ((node - begin) % s.n + s.n) % s.n;
    return at < count ? at : -1;
  };
  for (PetscInt i = 0; i < count; ++i) add_row(nodes[i], i, place);
  finish_matrix();
  SS_TRY(MatCreateVecs(matrix_, piece_w_.out(), nullptr));
  SS_TRY(VecCreateMPI(model_.comm(), model_.local(), s.n, load_.out()));
  SS_TRY(VecDuplicate(load_, w_.out()));
  fetch_.emplace(NodeFetch::Layout{model_.comm(), model_.local(), s.n, 1}, 1, nodes);
}

template <class Place>
void Displacement::add_row(PetscInt node, PetscInt row, const Place& place) {
  const Scene& s = model_.scene();
  const bool given = model_.held(node);
  SS_TRY(MatSetValue(matrix_, row, row, given ? 1 : s.coefficients(node).K0, ADD_VALUES));
  if (given) return;
  for (const auto& [column, weight] : coupling_row(s, node))
    if (place(column) >= 0) SS_TRY(MatSetValue(matrix_, row, place(column), -weight, ADD_VALUES));
}

void Displacement::finish_matrix() {
  SS_TRY(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
  SS_TRY(KSPCreate(PetscObjectComm(reinterpret_cast<PetscObject>(static_cast<Mat>(matrix_))), ksp_.out()));
  SS_TRY(KSPSetOperators(ksp_, matrix_, matrix_));
  solve_by_banded_lu(ksp_);
  SS_TRY(KSPSetUp(ksp_));
}

// s delta/A of a node of this rank.
double Displacement::damping(PetscInt local_node) const {
  const NodeCoefficients c = model_.coefficients(local_node);
  return c.s_delta / c.A;
}

VecHandle Displacement::create_vector() const {
  VecHandle chi;
  SS_TRY(VecDuplicate(w_, chi.out()));
  return chi;
}

double Displacement::end_velocity(PetscInt held) const {
  const Scene& s = model_.scene();
  return held == 0 ? s.left_value : s.right_value;
}

bool Displacement::count_is_better(Vec u, double t_end) const {
  constexpr double worse = 10;
  if (floats_) return true;
  const Scene& s = model_.scene();
  const bool loaded = s.load.varies() && !halts(s);
  const double gone = loaded ? s.load.integral(t_end) - s.push(t_end) / s.K0() : s.v * t_end;
  double fastest = std::abs(gone) / t_end;
  {
    const Reading a(u);
    const Writing b(load_);
    for (PetscInt i = 0; i < model_.local(); ++i) {
      fastest = std::max(fastest, std::abs(a[i * model_.dof()]));
      b[i] = model_.held(model_.first() + i) ? 0 : 1;
    }
  }
  solve_loaded(w_);
  double longest = 0;
  {
    const Reading w(w_);
    for (PetscInt i = 0; i < model_.local(); ++i) longest = std::max(longest, std::abs(w[i]));
  }
  return largest_over(model_.comm(), longest) > worse * largest_over(model_.comm(), fastest) * t_end;
}

void Displacement::count(std::vector<double> chi, std::vector<double> eta, Slip slip) {
  chi_at_start_ = std::move(chi);
  eta_at_start_ = std::move(eta);
  slip_ = std::move(slip);
}

void Displacement::solve_counted(double t, Vec chi) const {
  const std::vector<double>& slip = slip_(t);
  const Writing x(chi);
  for (PetscInt i = 0; i < model_.local(); ++i) {
    const PetscInt node = model_.first() + i;
    x[i] = model_.held(node) ? end_velocity(node) * t
                             : chi_at_start_[std::size_t(i)] + slip[std::size_t(i)];
  }
}

void Displacement::solve_at_start(Vec u, Vec chi) const {
  if (floats_)
    SS_TRY(VecSet(chi, 0));
  else
    solve_relative(u, 0, 0, chi);
}

void Displacement::solve(Vec u, double t, Vec chi) const {
  if (slip_) return solve_counted(t, chi);
  const double travelled = plate_.travel(model_.scene(), t);
  solve_relative(u, t, travelled, chi);
  SS_TRY(VecShift(chi, travelled));
}

// w = chi less how far the plate has come.
void Displacement::solve_relative(Vec u, double t, double travelled, Vec w) const {
  const Scene& s = model_.scene();
  const bool loaded = s.load.varies();
  {
    const Reading a(u);
    const Writing b(load_);
    for (PetscInt i = 0; i < model_.local(); ++i) {
      const double *at = a + i * model_.dof(), end = end_velocity(model_.first() + i);
      b[i] = model_.held(model_.first() + i) ? (loaded ? end * t - travelled : (end - s.v) * t)
                                             : -(at[1] + damping(i) * at[0]);
    }
  }
  solve_loaded(w);
}

void Displacement::solve_loaded(Vec w) const {
  if (!fetch_) {
    SS_TRY(KSPSolve(ksp_, load_, w));
  } else {
    fetch_->take(load_);
    SS_TRY(KSPSolve(ksp_, fetch_->vector(), piece_w_));
    const Reading found(piece_w_);
    std::copy(found + own_, found + own_ + model_.local(), static_cast<double*>(Writing(w)));
  }
}

bool Displacement::has_energy() const { return !model_.scene().any_held(); }

Energy Displacement::energy(Vec u, double t) const {
  const Scene& s = model_.scene();
  model_.set_time(t);  // friction may depend on it
  // the plate exerts the harmonic force in the equations alone
  const double push = s.push(t), v = velocity_of_plate_alone(s, model_.plate_velocity(t), t);
  double shift = push == 0 ? 0 : push / s.K0();
  if (slip_) {
    solve_counted(t, w_);
    shift = floats_ ? 0 : -plate_.travel(s, t) + shift;
  } else {
    solve_relative(u, 0, 0, w_);
  }
  VecHandle viscous;
  if (model_.viscous()) {
    viscous = model_.create_vector();
    model_.viscous_force(u, viscous);
  }
  const Reading a(u), w(w_), e(viscous);
  double sums[5] = {0, 0, 0, 0, 0};
  for (PetscInt i = 0; i < model_.local(); ++i) {
    const PetscInt node = model_.first() + i;
    const double weight = node_weight(s, node);
    const NodeCoefficients c = model_.coefficients(i);
    const double *at = a + i * model_.dof(), psi = at[0], z = at[1] - push + damping(i) * psi;
    const double F = model_.friction(i, psi, model_.dof() == 3 ? at[2] : 0).F;
    sums[0] += weight * psi * psi / (2 * c.A);
    sums[1] -= weight * (w[i] + shift) * (floats_ ? z + eta_at_start_[std::size_t(i)] : z) / 2;
    sums[2] += floats_ ? 0 : weight * v * z + weight * push * psi;
    sums[3] += weight * psi * F;
    sums[4] += weight * (c.B + damping(i)) * psi * psi;
    if (e) sums[4] -= weight * psi * e[i * model_.dof() + 1];
  }
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, sums, 5, MPI_DOUBLE, MPI_SUM, model_.comm()));
  return {sums[0], sums[1], sums[2], sums[3], sums[4]};
}

}  // namespace stickslip
