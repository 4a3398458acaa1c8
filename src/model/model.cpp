#include "stickslip/model/model.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/failure.hpp"
#include "base/local_values.hpp"
#include "base/broadcast.hpp"
#include "model/massless_chain.hpp"
#include "model/psi_halo.hpp"
#include "model/state_response.hpp"
#include "model/viscosity.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/linear_point.hpp"

namespace stickslip {

using kernel::Coefficients;

struct Model::Impl {
  MPI_Comm comm;
  Scene scene;
  int dof, half_width;
  PetscInt first = 0, local = 0;
  std::optional<Frictions> law;
  SlopeBounds slope_bounds;
  std::vector<double> amplitude;
  mutable Coefficients coefficients{}, no_stencil{};  // v: of the load, at the time said last
  mutable int load_piece = 0, normal_piece = 0;
  mutable double time = 0;
  // of a normal load that varies, at the time said last: N a_i, and what it does to the rate of the state
  mutable std::vector<double> factors, ageing;
  std::vector<double> response;  // Scene::state_response() of each node, where it is not 0
  LinearPoint no_friction;
  std::vector<NodeCoefficients> medium;  // of this rank's nodes; none where all have the same
  RangeLoop full, pointwise, stencil, wave, reaction, sticking, sticking_pointwise;
  RangeLoop viscous_force;  // of a viscous scene
  const double* direction = nullptr;
  std::optional<MasslessChain> massless;
  mutable VecHandle settled;  // of a massless chain: u with its psi
  mutable long evaluations = 0;
  std::optional<PsiHalo> halo;

  Impl(MPI_Comm communicator, const Scene& s)
      : comm(communicator), scene(s), dof(s.friction.has_state() ? 3 : 2), half_width(s.order / 2),
        no_friction(s, 0) {
    const int ranks = ranks_in(comm);
    if (ranks > scene.n)
      throw usage_error("grid_n {} is less than the number of ranks {}; use at most one rank a node", scene.n,
                        ranks);
    share_nodes();
    amplitude = friction_amplitude(scene, first, local);
    set_up_law();
    if (scene.normal.varies()) {
      normal_piece = scene.normal.piece_from(0);
      response = state_responses(scene, first, local);
      set_normal({scene.normal(0), scene.normal.slope_in_piece(normal_piece, 0)});
    }

    coefficients = no_stencil = kernel::coefficients_of(scene);
    std::fill(std::begin(no_stencil.w), std::end(no_stencil.w), 0.);

    const FrictionParameters& p = scene.friction;
    const FrictionPlaces places = friction_places(scene, first, local);
    medium = coefficients_along(scene, first, local);
    stencil = medium_stencil(dof, wave_loop(dof, half_width, true), links_along(scene, first, local));
    const RangeLoop own_stencil = scene.medium.varies() ? stencil : RangeLoop();
    full = whole_loop(p, half_width, false, places, own_stencil);
    pointwise = whole_loop(p, 0, false, places);
    wave = own_stencil ? medium_wave(dof, stencil, medium) : wave_loop(dof, half_width, false);
    reaction = reaction_loop(p, places);
    if (p.sticks()) {
      sticking = whole_loop(p, half_width, true, places, own_stencil);
      sticking_pointwise = whole_loop(p, 0, true, places);
    }
    if (scene.N() > 0) add_viscosity();
    if (scene.massless()) set_up_massless();
    halo.emplace(scene, dof, first, local, create_vector());
  }

  void set_up_law() {
    law.emplace(scene, first, local);
    double slopes[2] = {0, 0};
    for (PetscInt i = 0; i < (law->vary() ? local : 1); ++i) {
      slopes[0] = std::max(slopes[0], (*law)[i].slope_bounds.falling);
      slopes[1] = std::max(slopes[1], (*law)[i].slope_bounds.rising);
    }
    if (law->vary()) SS_TRY(MPI_Allreduce(MPI_IN_PLACE, slopes, 2, MPI_DOUBLE, MPI_MAX, comm));
    slope_bounds = {slopes[0], slopes[1]};
  }

  // The loops of other scenes with A = 0, in which psi has no rate; without a state friction says no more
  // than psi does.
  void set_up_massless() {
    massless.emplace(comm, scene, *law, amplitude, first);
    if (dof == 2) full = wave;
    coefficients.A = 0;
  }
  // u with its psi.
  Vec settle_copy(Vec u) const {
    if (!settled) SS_TRY(VecDuplicate(u, settled.out()));
    SS_TRY(VecCopy(u, settled));
    massless->solve_velocities(settled);
    return settled;
  }

  void add_viscosity() {
    const Viscosity viscosity(scene, dof);
    full = viscosity.around(pointwise);
    wave = viscosity.around(wave);
    if (scene.friction.sticks()) sticking = viscosity.around(sticking_pointwise);
    stencil = viscosity.alone();
    viscous_force = viscosity.force();
  }

  // As PETSc would: equal parts, the first ranks with one node more.
  void share_nodes() {
    PetscInt all = scene.n;
    local = PETSC_DECIDE;
    SS_TRY(PetscSplitOwnership(comm, &local, &all));
    SS_TRY(MPI_Exscan(&local, &first, 1, MPIU_INT, MPI_SUM, comm));
    if (rank_in(comm) == 0) first = 0;
  }

  VecHandle create_vector() const {
    VecHandle u;
    SS_TRY(VecCreate(comm, u.out()));
    SS_TRY(VecSetBlockSize(u, dof));
    SS_TRY(VecSetSizes(u, local * dof, scene.n * dof));
    SS_TRY(VecSetType(u, VECSTANDARD));
    return u;
  }

  // Runs `loop` over nodes [begin, end) of this rank; `u` and `f` hold all of them.
  void over_range(const RangeLoop& loop, const Coefficients& c, const double* u, double* f, PetscInt begin,
                  PetscInt end) const {
    std::array<double, 4> before{}, behind{};
    for (int j = 0; j < half_width; ++j) {
      before[j] = halo->psi_at(u, begin - half_width + j);
      behind[j] = halo->psi_at(u, end + j);
    }
    const double* const own = !factors.empty()         ? &factors[begin]
                              : scene.unit_amplitude() ? nullptr
                                                       : &amplitude[begin];
    loop(c, {u + begin * dof, own, f + begin * dof, end - begin, before.data(), behind.data(),
             direction ? direction + begin : nullptr, begin});
  }

  const RangeLoop& loop_of(Part part) const {
    switch (part) {
      case Part::full: return direction ? sticking : full;
      case Part::pointwise: return direction ? sticking_pointwise : pointwise;
      case Part::stencil: return stencil;
      case Part::wave: return wave;
      default: return reaction;
    }
  }

  // Held nodes of this rank, as local numbers.
  template <class Body>
  void for_held(const Body& body) const {
    if (local == 0) return;
    if (first == 0 && scene.held(0)) body(PetscInt(0));
    if (first + local == scene.n && scene.n > 1 && scene.held(scene.n - 1)) body(local - 1);
  }

  void rhs(Part part, Vec u, Vec f) const {
    ++evaluations;
    if (massless) u = settle_copy(u);
    apply(loop_of(part), has_stencil(part), u, f);
    const Writing b(f);
    for_held([&](PetscInt i) {
      b[i * dof] = 0;
      if (scene.form == Form::continuum) b[i * dof + 1] = 0;
    });
    for (std::size_t i = 0; i < ageing.size() && has_friction(part); ++i)
      b[PetscInt(i) * dof + 2] += ageing[i];
  }

  double factor(PetscInt i) const { return factors.empty() ? amplitude[i] : factors[i]; }
  void set_normal(const NormalLoad& normal) const {
    factors.resize(std::size_t(local));
    for (PetscInt i = 0; i < local; ++i) factors[i] = normal.N * amplitude[i];
    ageing.resize(response.size());
    for (std::size_t i = 0; i < ageing.size(); ++i) ageing[i] = -response[i] * normal.rate / normal.N;
  }

  // f = what the loop makes of u, held nodes like others.
  void apply(const RangeLoop& loop, bool with_stencil, Vec u, Vec f) const {
    const Reading a(u);
    const Writing b(f);
    const Coefficients& c = with_stencil ? coefficients : no_stencil;
    const PetscInt hw = half_width;
    if (!with_stencil || halo->is_local()) {
      if (halo->is_local()) halo->read(a);
      over_range(loop, c, a, b, 0, local);
    } else {
      // some nodes do not need the halo: they are done while it is under way
      const bool wide = local > 2 * hw;
      halo->begin(u);
      if (wide) over_range(loop, c, a, b, hw, local - hw);
      halo->end(u);
      over_range(loop, c, a, b, 0, wide ? hw : local);
      if (wide) over_range(loop, c, a, b, local - hw, local);
    }
  }

  // d(rhs part)/du of node i by its own unknowns, without the stencil's share.
  NodeBlock node_block(Part part, PetscInt i, const double* u) const {
    const bool fixed = scene.held(first + i), has_eta = !(fixed && scene.form == Form::continuum);
    const double psi = u[0], s = dof == 3 ? u[2] : 0, going = direction ? direction[i] : 0;
    LinearPoint point = point_of(i);
    if (has_friction(part) && !direction) {
      point.set(friction_at(i, psi, s), (*law)[i].rate_partials(psi, s));
    } else if (has_friction(part)) {
      const Partials p = going == 0 ? Partials{0, 0, 0} : (*law)[i].sliding_partials(psi, s, going);
      point.set(times(factor(i), p), (*law)[i].sliding_rate(psi, s, going));
    }
    const bool rests = direction && going == 0;
    NodeBlock b = rests ? point.block_at_rest(part) : point.block(part);
    if (fixed) b.psi_psi = b.psi_eta = b.psi_state = 0;
    if (!has_eta) b.eta_psi = b.eta_eta = b.eta_state = 0;
    return b;
  }

  // Node i's own block of beta d(rhs part)/du + alpha I, its rows `width` apart. Sums stand in variables and
  // are stored once: adding to what was just stored costs more than all the arithmetic.
  void diagonal_block(Part part, PetscInt i, const double* u, double alpha, double beta, double* block,
                      std::size_t width) const {
    const NodeBlock b = node_block(part, i, u);
    double* const eta = block + width;
    block[0] = beta * b.psi_psi + alpha;
    block[1] = beta * b.psi_eta;
    eta[0] = beta * b.eta_psi;
    eta[1] = beta * b.eta_eta + alpha;
    if (dof == 2) return;
    double* const state = eta + width;
    block[2] = beta * b.psi_state;
    eta[2] = beta * b.eta_state;
    state[0] = beta * b.state_psi;
    state[1] = 0;
    state[2] = beta * b.state_state + alpha;
  }

  LinearPoint point_of(PetscInt i) const {
    return medium.empty() ? no_friction : LinearPoint(scene, medium[std::size_t(i)]);
  }
  static Partials times(double a, const Partials& p) { return {a * p.F, a * p.F_psi, a * p.F_state}; }
  Partials friction_at(PetscInt i, double psi, double state) const {
    return times(factor(i), (*law)[i].partials(psi, state));
  }
};

Model::Model(MPI_Comm comm, const Scene& scene) : impl_(std::make_unique<Impl>(comm, scene)) {}
Model::~Model() = default;
Model::Model(Model&&) noexcept = default;

const Scene& Model::scene() const { return impl_->scene; }
MPI_Comm Model::comm() const { return impl_->comm; }
int Model::dof() const { return impl_->dof; }
PetscInt Model::first() const { return impl_->first; }
PetscInt Model::local() const { return impl_->local; }
bool Model::held(PetscInt node) const { return scene().held(node); }
long Model::rhs_evaluations() const { return impl_->evaluations; }
void Model::count_evaluations(long count) const { impl_->evaluations += count; }
const std::vector<double>& Model::amplitude() const { return impl_->amplitude; }

PetscInt Model::unknowns() const {
  const PetscInt ends = (scene().held(0) ? 1 : 0) + (scene().n > 1 && scene().held(scene().n - 1) ? 1 : 0);
  // of a massless chain psi is none, a held node's eta is as ever
  return scene().massless() ? scene().n * (dof() - 1) - ends : scene().n * dof() - 2 * ends;
}

VecHandle Model::create_vector() const { return impl_->create_vector(); }

void Model::set_direction(const double* direction) const {
  if (direction && !impl_->sticking) throw std::logic_error("this law does not stick");
  impl_->direction = direction;
}
const double* Model::direction() const { return impl_->direction; }
NodeBlock Model::node_block(Part part, PetscInt local_node, const double* u) const {
  return impl_->node_block(part, local_node, u);
}
void Model::rhs(Part part, Vec u, Vec f) const { impl_->rhs(part, u, f); }
void Model::solve_velocities(Vec u) const {
  if (impl_->massless) impl_->massless->solve_velocities(u);
}
std::string Model::velocity_jump(Vec u) const {
  return impl_->massless ? impl_->massless->velocity_jump(u) : "";
}
bool Model::viscous() const { return static_cast<bool>(impl_->viscous_force); }
void Model::viscous_force(Vec u, Vec into) const { impl_->apply(impl_->viscous_force, true, u, into); }

void Model::begin_load(double t) const {
  if (!scene().forced()) return;
  if (scene().load.varies()) impl_->load_piece = scene().load.piece_from(t);
  if (scene().normal.varies()) impl_->normal_piece = scene().normal.piece_from(t);
  set_time(t);
}
double Model::time() const { return impl_->time; }
void Model::set_time(double t) const {
  impl_->time = t;
  if (scene().normal.varies()) impl_->set_normal(normal_load(t));
  if (scene().load.varies()) impl_->coefficients.v = impl_->no_stencil.v = plate_velocity(t);
}
double Model::plate_velocity(double t) const {
  return scene().load.varies() ? scene().load.in_piece(impl_->load_piece, t) : scene().v;
}

NormalLoad Model::normal_load(double t) const {
  const Load& normal = scene().normal;
  if (!normal.varies()) return {};
  return {normal.in_piece(impl_->normal_piece, t), normal.slope_in_piece(impl_->normal_piece, t)};
}
void Model::pass_corner(Vec u, double t) const {
  const std::vector<double>& response = impl_->response;
  if (response.empty()) return;
  const double step = std::log(scene().normal(t) / normal_load(t).N);
  const Writing a(u);
  for (PetscInt i = 0; i < local() && step != 0; ++i) a[i * dof() + 2] -= response[std::size_t(i)] * step;
}

MatHandle Model::create_jacobian(Part part) const {
  const PetscInt dof = impl_->dof, first = impl_->first, local = impl_->local;
  MatHandle J;
  SS_TRY(MatCreate(impl_->comm, J.out()));
  SS_TRY(MatSetSizes(J, local * dof, local * dof, scene().n * dof, scene().n * dof));
  SS_TRY(MatSetBlockSize(J, dof));
  SS_TRY(MatSetType(J, MATBAIJ));
  SS_TRY(MatSetFromOptions(J));
  std::vector<PetscInt> inside(local, 1), outside(local, 0);
  if (has_stencil(part)) {
    for (PetscInt i = 0; i < local; ++i) {
      PetscInt own = 0, other = 0;
      bool has_diagonal = false;
      for (const auto& [node, weight] : second_difference_row(scene(), first + i)) {
        const bool mine = node >= first && node < first + local;
        (mine ? own : other)++;
        has_diagonal = has_diagonal || node == first + i;
      }
      inside[i] = own + (has_diagonal ? 0 : 1);
      outside[i] = other;
    }
  }
  SS_TRY(MatXAIJSetPreallocation(J, dof, inside.data(), outside.data(), nullptr, nullptr));
  SS_TRY(MatSetOption(J, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_TRUE));
  return J;
}

void Model::jacobian(Part part, Vec u, double alpha, double beta, Mat J) const {
  const Impl& m = *impl_;
  if (m.massless) return m.massless->jacobian(m.settle_copy(u), alpha, beta, J);
  const PetscInt dof = m.dof;
  const Reading a(u);
  SS_TRY(MatZeroEntries(J));
  const PetscInt hw = m.half_width, n = m.scene.n;
  std::vector<PetscInt> columns;    // of the row at hand
  std::vector<double> values;       // dof rows of columns.size() * dof entries
  std::size_t width = 0;            // length of these rows
  std::size_t own = 0;              // where the diagonal block begins in `values`
  double own_psi = 0, own_eta = 0;  // of D2, in the rows of psi and eta
  enum class Row { none, alone, inner, end } laid_out = Row::none;
  bool was_moving = true;
  // of D2 psi in the rows of psi and eta; viscosity does not move a held node, nor one at rest
  const auto lay_out = [&](PetscInt row, const Combination& d2, bool moves) {
    const double N = moves ? m.scene.N() : 0, of_psi = N > 0 ? m.scene.A() * N : 0,
                 of_eta = m.scene.medium.varies() ? 1 : m.scene.K1() - m.scene.s_delta() * N;
    columns.clear();
    for (const auto& term : d2) columns.push_back(term.first);
    width = columns.size() * dof;
    values.assign(width * dof, 0.);
    for (std::size_t j = 0; j < columns.size(); ++j) {
      double* const at = &values[j * dof];
      at[width] = beta * of_eta * d2[j].second;  // eta_t by psi
      if (N > 0) at[0] = beta * of_psi * d2[j].second;
      if (columns[j] == row) {
        own = j * dof;
        own_psi = at[0];
        own_eta = at[width];
      }
    }
  };
  for (PetscInt i = 0; i < m.local; ++i) {
    const PetscInt row = m.first + i;
    const Row kind = !has_stencil(part) || (m.scene.held(row) && m.scene.form == Form::continuum) ? Row::alone
                     : row >= hw && row < n - hw && !m.scene.medium.links_differ()                ? Row::inner
                                                                                                  : Row::end;
    const bool moves = !m.scene.held(row) && !(m.direction && m.direction[i] == 0 && part != Part::wave);
    // but for its place and diagonal block the same
    if (kind == laid_out && kind != Row::end && moves == was_moving) {
      for (PetscInt& column : columns) ++column;
    } else {
      lay_out(row,
              kind == Row::alone        ? Combination{{row, 0.}}
              : m.scene.medium.varies() ? coupling_row(m.scene, row)
                                        : second_difference_row(m.scene, row),
              moves);
    }
    laid_out = kind;
    was_moving = moves;
    m.diagonal_block(part, i, a + i * dof, alpha, beta, &values[own], width);
    values[own] += own_psi;
    values[own + width] += own_eta;
    SS_TRY(MatSetValuesBlocked(J, 1, &row, static_cast<PetscInt>(columns.size()), columns.data(),
                               values.data(), INSERT_VALUES));
  }
  SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
}

Partials Model::friction(PetscInt local_node, double psi, double state) const {
  return impl_->friction_at(local_node, psi, state);
}
LinearPoint Model::linear_point(PetscInt local_node, double psi, double state) const {
  LinearPoint point = impl_->point_of(local_node);
  point.set(friction(local_node, psi, state), state_rate(local_node, psi, state));
  return point;
}
NodeCoefficients Model::coefficients(PetscInt local_node) const {
  const LinearPoint& same = impl_->no_friction;
  return impl_->medium.empty() ? NodeCoefficients{same.A, same.B, same.K0, same.s_delta}
                               : impl_->medium[std::size_t(local_node)];
}
const Friction& Model::friction_law() const {
  if (impl_->law->vary()) (void)Friction::of(scene().friction);  // which says why not
  return (*impl_->law)[0];
}
const Friction& Model::friction_law(PetscInt local_node) const { return (*impl_->law)[local_node]; }
SlopeBounds Model::slope_bounds() const { return impl_->slope_bounds; }
RatePartials Model::state_rate(PetscInt local_node, double psi, double state) const {
  return friction_law(local_node).rate_partials(psi, state);
}
RatePartials Model::state_rate(double psi, double state) const {
  return friction_law().rate_partials(psi, state);
}
double Model::steady_state(PetscInt local_node, double psi) const {
  return friction_law(local_node).steady_state(psi);
}
double Model::steady_state(double psi) const { return friction_law().steady_state(psi); }

bool Model::safeguard_newton_step(Vec u, double shift, Vec minus_step) const {
  const Impl& m = *impl_;
  if (!(*m.law)[0].steep || m.scene.massless()) return false;
  // the slope of psi's own row without friction, eta = ... - K0 psi/shift put into it, over A a_i
  const Reading a(u);
  const Writing step(minus_step);
  for (PetscInt i = 0; i < m.local; ++i) {
    if (m.scene.held(m.first + i) || m.amplitude[i] == 0) continue;
    const double *at = a + i * m.dof, psi = at[0], state = at[2];
    const NodeCoefficients c = coefficients(i);
    const double mass = shift / c.A + c.B + c.K0 / shift;
    double* d = step + i * m.dof;
    d[0] = psi - (*m.law)[i].newton_psi(psi, state, psi - d[0], state - d[2], mass / m.factor(i));
  }
  return true;
}

void Model::set_held(Vec u) const {
  const Impl& m = *impl_;
  m.for_held([&, a = Writing(u)](PetscInt i) {
    double* at = a + i * m.dof;
    at[0] = m.first + i == 0 ? m.scene.left_value : m.scene.right_value;
    if (m.scene.form == Form::continuum)
      at[1] = m.point_of(i).B * at[0] + m.friction_at(i, at[0], m.dof == 3 ? at[2] : 0).F;
  });
  if (!viscous() || m.scene.form == Form::chain || !m.scene.any_held()) return;
  const VecHandle force = create_vector();
  viscous_force(u, force);
  const Reading b(force);
  const Writing a(u);
  m.for_held([&](PetscInt i) { a[i * m.dof + 1] -= b[i * m.dof + 1]; });
}

}  // namespace stickslip
