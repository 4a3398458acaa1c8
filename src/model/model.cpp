#include "stickslip/model/model.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/failure.hpp"
#include "model/right_hand_side.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/frictions.hpp"

namespace stickslip {

namespace {

Partials times(double a, const Partials& p) { return {a * p.F, a * p.F_psi, a * p.F_state}; }

}  // namespace

Model::Model(MPI_Comm comm, const Scene& s)
    : comm_(comm), scene_(s), dof_(s.friction.has_state() ? 3 : 2), no_friction_(s, 0), v_(s.v) {
  const int ranks = ranks_in(comm);
  if (ranks > s.n)
    throw usage_error("grid_n {} is less than the number of ranks {}; use at most one rank a node", s.n,
                      ranks);
  share_nodes();
  amplitude_ = friction_amplitude(scene_, first_, local_);
  law_.emplace(scene_, first_, local_);
  bound_slopes();
  if (scene_.normal.varies()) {
    normal_piece_ = scene_.normal.piece_from(0);
    response_ = state_responses(scene_, first_, local_);
    set_normal({scene_.normal(0), scene_.normal.slope_in_piece(normal_piece_, 0)});
  }
  medium_ = coefficients_along(scene_, first_, local_);
  right_hand_side_ = std::make_unique<const RightHandSide>(scene_, first_, local_);
  if (scene_.massless())
    massless_ = std::make_unique<const MasslessChain>(comm_, scene_, *law_, amplitude_, first_);
  halo_ = std::make_unique<const PsiHalo>(scene_, NodeFetch::Layout{comm_, local_, scene_.n, dof_}, first_);
}
Model::~Model() = default;
Model::Model(Model&&) noexcept = default;

// As PETSc would: equal parts, the first ranks with one node more.
void Model::share_nodes() {
  PetscInt all = scene_.n;
  local_ = PETSC_DECIDE;
  SS_TRY(PetscSplitOwnership(comm_, &local_, &all));
  SS_TRY(MPI_Exscan(&local_, &first_, 1, MPIU_INT, MPI_SUM, comm_));
  if (rank_in(comm_) == 0) first_ = 0;
}

void Model::bound_slopes() {
  double slopes[2] = {0, 0};
  for (PetscInt i = 0; i < (law_->vary() ? local_ : 1); ++i) {
    slopes[0] = std::max(slopes[0], (*law_)[i].slope_bounds.falling);
    slopes[1] = std::max(slopes[1], (*law_)[i].slope_bounds.rising);
  }
  if (law_->vary()) SS_TRY(MPI_Allreduce(MPI_IN_PLACE, slopes, 2, MPI_DOUBLE, MPI_MAX, comm_));
  slope_bounds_ = {slopes[0], slopes[1]};
}

PetscInt Model::unknowns() const {
  const PetscInt ends = (held(0) ? 1 : 0) + (scene_.n > 1 && held(scene_.n - 1) ? 1 : 0);
  // of a massless chain psi is none, a held node's eta is as ever
  return scene_.massless() ? scene_.n * (dof_ - 1) - ends : scene_.n * dof_ - 2 * ends;
}

VecHandle Model::create_vector() const {
  VecHandle u;
  SS_TRY(VecCreate(comm_, u.out()));
  SS_TRY(VecSetBlockSize(u, dof_));
  SS_TRY(VecSetSizes(u, local_ * dof_, scene_.n * dof_));
  SS_TRY(VecSetType(u, VECSTANDARD));
  return u;
}

void Model::set_direction(const double* direction) const {
  if (direction && !scene_.friction.sticks()) throw std::logic_error("this law does not stick");
  direction_ = direction;
}

// ---- loads

void Model::begin_load(double t) const {
  if (!scene_.forced()) return;
  if (scene_.load.varies()) load_piece_ = scene_.load.piece_from(t);
  if (scene_.normal.varies()) normal_piece_ = scene_.normal.piece_from(t);
  set_time(t);
}
void Model::set_time(double t) const {
  time_ = t;
  if (scene_.normal.varies()) set_normal(normal_load(t));
  if (scene_.load.varies()) v_ = plate_velocity(t);
}
double Model::plate_velocity(double t) const {
  return scene_.load.varies() ? scene_.load.in_piece(load_piece_, t) : scene_.v;
}
NormalLoad Model::normal_load(double t) const {
  const Load& normal = scene_.normal;
  if (!normal.varies()) return {};
  return {normal.in_piece(normal_piece_, t), normal.slope_in_piece(normal_piece_, t)};
}
void Model::set_normal(const NormalLoad& normal) const {
  factors_.resize(std::size_t(local_));
  for (PetscInt i = 0; i < local_; ++i) factors_[i] = normal.N * amplitude_[i];
  ageing_.resize(response_.size());
  for (std::size_t i = 0; i < ageing_.size(); ++i) ageing_[i] = -response_[i] * normal.rate / normal.N;
}
void Model::pass_corner(Vec u, double t) const {
  if (response_.empty()) return;
  const double step = std::log(scene_.normal(t) / normal_load(t).N);
  const Writing a(u);
  for (PetscInt i = 0; i < local_ && step != 0; ++i) a[i * dof_ + 2] -= response_[std::size_t(i)] * step;
}

// ---- the right-hand side

// Held nodes of this rank, as local numbers.
template <class Body>
void Model::for_held(const Body& body) const {
  if (local_ == 0) return;
  if (first_ == 0 && held(0)) body(PetscInt(0));
  if (first_ + local_ == scene_.n && scene_.n > 1 && held(scene_.n - 1)) body(local_ - 1);
}

// Calls take(range) for ranges that make up this rank's nodes, f = what it makes of u. Where nodes are
// coupled, those that do not need the halo are done while it is under way.
template <class Take>
void Model::over_ranges(Vec u, Vec f, bool coupled, const Take& take) const {
  const Reading a(u);
  const Writing b(f);
  const PetscInt hw = scene_.order / 2;
  const auto range = [&](PetscInt begin, PetscInt end) {
    std::array<double, 4> before{}, behind{};
    for (int j = 0; j < hw && coupled; ++j) {
      before[j] = halo_->psi_at(a, begin - hw + j);
      behind[j] = halo_->psi_at(a, end + j);
    }
    const double* const own = !factors_.empty()         ? &factors_[begin]
                              : scene_.unit_amplitude() ? nullptr
                                                        : &amplitude_[begin];
    take(InterleavedRange{a + begin * dof_, own, b + begin * dof_, end - begin, before.data(), behind.data(),
                          direction_ ? direction_ + begin : nullptr, begin});
  };
  if (!coupled) return range(0, local_);
  const NodeFetch& fetch = halo_->fetch();
  fetch.begin(a);
  if (fetch.is_local()) return range(0, local_);
  const bool wide = local_ > 2 * hw;
  if (wide) range(hw, local_ - hw);
  fetch.end();
  range(0, wide ? hw : local_);
  if (wide) range(local_ - hw, local_);
}

void Model::rhs(Part part, Vec u, Vec f) const {
  ++evaluations_;
  log_flops(*this, 1);
  if (massless_) u = settle_copy(u);
  over_ranges(u, f, has_stencil(part),
              [&](const InterleavedRange& r) { right_hand_side_->take(part, v_, r); });
  const Writing b(f);
  for_held([&](PetscInt i) { hold(scene_, b[i * dof_], b[i * dof_ + 1]); });
  for (std::size_t i = 0; i < ageing_.size() && has_friction(part); ++i)
    b[PetscInt(i) * dof_ + 2] += ageing_[i];
}

void Model::viscous_force(Vec u, Vec into) const {
  over_ranges(u, into, true, [&](const InterleavedRange& r) { right_hand_side_->viscous_force(r); });
}

Vec Model::settle_copy(Vec u) const {
  if (!settled_) SS_TRY(VecDuplicate(u, settled_.out()));
  SS_TRY(VecCopy(u, settled_));
  massless_->solve_velocities(settled_);
  return settled_;
}
void Model::solve_velocities(Vec u) const {
  if (massless_) massless_->solve_velocities(u);
}
std::string Model::velocity_jump(Vec u) const { return massless_ ? massless_->velocity_jump(u) : ""; }

void Model::set_held(Vec u) const {
  for_held([&, a = Writing(u)](PetscInt i) {
    double* at = a + i * dof_;
    at[0] = first_ + i == 0 ? scene_.left_value : scene_.right_value;
    if (scene_.form == Form::continuum)
      at[1] = coefficients(i).B * at[0] + friction(i, at[0], dof_ == 3 ? at[2] : 0).F;
  });
  if (!viscous() || scene_.form == Form::chain || !scene_.any_held()) return;
  const VecHandle force = create_vector();
  viscous_force(u, force);
  const Reading b(force);
  const Writing a(u);
  for_held([&](PetscInt i) { a[i * dof_ + 1] -= b[i * dof_ + 1]; });
}

// ---- its derivatives

LinearPoint Model::without_friction(PetscInt i) const {
  return medium_.empty() ? no_friction_ : LinearPoint(scene_, medium_[std::size_t(i)]);
}

NodeBlock Model::node_block(Part part, PetscInt i, const double* u) const {
  const bool fixed = held(first_ + i), rests = direction_ && direction_[i] == 0;
  const double psi = u[0], s = dof_ == 3 ? u[2] : 0;
  const Friction& law = (*law_)[i];
  LinearPoint point = without_friction(i);
  if (has_friction(part) && !direction_)
    point.set(friction(i, psi, s), law.rate_partials(psi, s));
  else if (has_friction(part))
    point.set(rests ? Partials{0, 0, 0} : times(factor(i), law.sliding_partials(psi, s, direction_[i])),
              law.sliding_rate(psi, s, direction_[i]));
  NodeBlock b = rests ? point.block_at_rest(part) : point.block(part);
  if (fixed) b.psi_psi = b.psi_eta = b.psi_state = 0;
  if (fixed && scene_.form == Form::continuum) b.eta_psi = b.eta_eta = b.eta_state = 0;
  return b;
}

MatHandle Model::create_jacobian(Part part) const {
  MatHandle J;
  SS_TRY(MatCreate(comm_, J.out()));
  SS_TRY(MatSetSizes(J, local_ * dof_, local_ * dof_, scene_.n * dof_, scene_.n * dof_));
  SS_TRY(MatSetBlockSize(J, dof_));
  SS_TRY(MatSetType(J, MATBAIJ));
  SS_TRY(MatSetFromOptions(J));
  std::vector<PetscInt> inside(local_, 1), outside(local_, 0);
  for (PetscInt i = 0; i < local_ && has_stencil(part); ++i) {
    bool has_diagonal = false;
    inside[i] = 0;
    for (const auto& [node, weight] : second_difference_row(scene_, first_ + i)) {
      ++(node >= first_ && node < first_ + local_ ? inside : outside)[i];
      has_diagonal = has_diagonal || node == first_ + i;
    }
    if (!has_diagonal) ++inside[i];
  }
  SS_TRY(MatXAIJSetPreallocation(J, dof_, inside.data(), outside.data(), nullptr, nullptr));
  SS_TRY(MatSetOption(J, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_TRUE));
  return J;
}

namespace {

// A row of blocks of a Jacobian: dof rows of columns.size() * dof entries.
struct BlockRow {
  std::vector<PetscInt> columns;
  std::vector<double> values;
  std::size_t own = 0;              // where the diagonal block begins in `values`
  double own_psi = 0, own_eta = 0;  // of D2 psi there, in the rows of psi and eta

  std::size_t width(int dof) const { return columns.size() * std::size_t(dof); }
  // Of D2 psi, times these in the rows of psi and eta.
  void lay_out(PetscInt row, const Combination& d2, double of_psi, double of_eta, int dof) {
    columns.clear();
    for (const auto& term : d2) columns.push_back(term.first);
    values.assign(width(dof) * std::size_t(dof), 0.);
    for (std::size_t j = 0; j < columns.size(); ++j) {
      double* const at = &values[j * std::size_t(dof)];
      at[0] = of_psi * d2[j].second;
      at[width(dof)] = of_eta * d2[j].second;
      if (columns[j] != row) continue;
      own = j * std::size_t(dof);
      own_psi = at[0];
      own_eta = at[width(dof)];
    }
  }
};

}  // namespace

void Model::jacobian(Part part, Vec u, double alpha, double beta, Mat J) const {
  if (massless_) return massless_->jacobian(settle_copy(u), alpha, beta, J);
  const Reading a(u);
  SS_TRY(MatZeroEntries(J));
  const PetscInt hw = scene_.order / 2;
  BlockRow row;
  enum class Kind { none, alone, inner, end } last = Kind::none;
  bool last_moves = true;
  for (PetscInt i = 0; i < local_; ++i) {
    const PetscInt node = first_ + i;
    const Kind kind = !has_stencil(part) || (held(node) && scene_.form == Form::continuum)  ? Kind::alone
                      : node >= hw && node < scene_.n - hw && !scene_.medium.links_differ() ? Kind::inner
                                                                                            : Kind::end;
    // viscosity does not move a held node, nor one at rest
    const bool moves = !held(node) && !(direction_ && direction_[i] == 0 && part != Part::wave);
    if (kind == last && kind != Kind::end && moves == last_moves) {
      for (PetscInt& column : row.columns) ++column;  // but for its place and diagonal block the same
    } else {
      const bool medium = scene_.medium.varies();
      const double N = moves ? scene_.N() : 0;
      row.lay_out(node,
                  kind == Kind::alone ? Combination{{node, 0.}}
                  : medium            ? coupling_row(scene_, node)
                                      : second_difference_row(scene_, node),
                  N > 0 ? beta * scene_.A() * N : 0, beta * (medium ? 1 : scene_.K1() - scene_.s_delta() * N),
                  dof_);
    }
    last = kind;
    last_moves = moves;
    node_block(part, i, a + i * dof_)
        .write(dof_, &row.values[row.own], row.width(dof_), beta, alpha, row.own_psi, row.own_eta);
    SS_TRY(MatSetValuesBlocked(J, 1, &node, PetscInt(row.columns.size()), row.columns.data(),
                               row.values.data(), INSERT_VALUES));
  }
  SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
}

bool Model::safeguard_newton_step(Vec u, double shift, Vec minus_step) const {
  if (!(*law_)[0].steep || scene_.massless()) return false;
  // the slope of psi's own row without friction, eta = ... - K0 psi/shift put into it, over A a_i
  const Reading a(u);
  const Writing step(minus_step);
  for (PetscInt i = 0; i < local_; ++i) {
    if (held(first_ + i) || amplitude_[i] == 0) continue;
    const double *at = a + i * dof_, psi = at[0], state = at[2];
    const NodeCoefficients c = coefficients(i);
    const double mass = shift / c.A + c.B + c.K0 / shift;
    double* d = step + i * dof_;
    d[0] = psi - (*law_)[i].newton_psi(psi, state, psi - d[0], state - d[2], mass / factor(i));
  }
  return true;
}

// ---- at a node

Partials Model::friction(PetscInt i, double psi, double state) const {
  return times(factor(i), (*law_)[i].partials(psi, state));
}
LinearPoint Model::linear_point(PetscInt i, double psi, double state) const {
  LinearPoint point = without_friction(i);
  point.set(friction(i, psi, state), state_rate(i, psi, state));
  return point;
}
NodeCoefficients Model::coefficients(PetscInt i) const {
  const LinearPoint& same = no_friction_;
  return medium_.empty() ? NodeCoefficients{same.A, same.B, same.K0, same.s_delta} : medium_[std::size_t(i)];
}
const Friction& Model::friction_law() const {
  if (law_->vary()) (void)Friction::of(scene_.friction);  // which says why not
  return (*law_)[0];
}

}  // namespace stickslip
