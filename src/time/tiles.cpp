#include "time/tiles.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "model/right_hand_side.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
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

namespace {

constexpr PetscInt tile_nodes = 256;  // a tile with its slopes: some 50 kB

// Whether every rank takes the whole grid as one tile. Fewer nodes a rank than the overlap would cost more
// than they save, and the closures of an end must lie within one tile. Collective.
bool is_closed(const Model& model, int stages) {
  const PetscInt least = 2 * stages * (model.scene().order / 2);
  const bool few = on_any_rank(model.comm(), model.local() < std::max(least, PetscInt(16)));
  return model.scene().n <= closed_nodes || few;
}

}  // namespace

Tiles::Tiles(const Model& model, int stages, int columns, bool sticking)
    : model_(model), dof_(model.dof()), half_width_(model.scene().order / 2), first_(model.first()),
      local_(model.local()), n_(model.scene().n), closed_(is_closed(model, stages)),
      to_columns_(kernel::copy_loop<true>(dof_)), from_columns_(kernel::copy_loop<false>(dof_)) {
  const bool open_ring = model.scene().ring() && !closed_;
  constexpr PetscInt none = std::numeric_limits<PetscInt>::max() / 2;
  low_ = open_ring ? -none : -first_;
  high_ = open_ring ? none : n_ - first_;
  const PetscInt reach = closed_ ? n_ : stages * half_width_;
  left_halo_ = std::min(reach, -low_);
  right_halo_ = std::min(reach, high_ - local_);
  for (int j = 1; j <= half_width_ && !open_ring; ++j) {
    left_end_.push_back(beyond(-j));
    right_end_.push_back(beyond(n_ - 1 + j));
  }
  set_amplitude();
  stride_ = ((closed_ ? n_ : std::min(tile_nodes, local_) + 2 * reach) + 2 * pad_ + 7) / 8 * 8;
  work_.assign(stride_ * dof_ * (columns + 2), 0.);
  zeros_.assign(stride_, 0.);
  if (left_halo_ + right_halo_ > 0) set_up_fetch();
  if (sticking) direction_.assign(left_halo_ + local_ + right_halo_, 0.);
}

void Tiles::set_amplitude() {
  if (model_.scene().unit_amplitude()) return;
  // the nodes of a ring go on at its beginning
  for (PetscInt i = -left_halo_; i < local_ + right_halo_;) {
    const PetscInt node = wrapped(first_ + i), count = std::min(local_ + right_halo_ - i, n_ - node);
    const auto part = friction_amplitude(model_.scene(), node, count);
    amplitude_.insert(amplitude_.end(), part.begin(), part.end());
    i += count;
  }
}

FrictionPlaces Tiles::places() const {
  return friction_places(model_.scene(), left_halo_ + local_ + right_halo_,
                         [this](PetscInt i) { return wrapped(first_ + i - left_halo_); });
}

std::vector<double> Tiles::links() const {
  std::vector<double> all;
  if (!model_.scene().medium.links_differ()) return all;
  for (PetscInt i = -left_halo_ - 1; i < local_ + right_halo_; ++i)
    all.push_back(model_.scene().link(model_.scene().ring() ? wrapped(first_ + i) : first_ + i));
  return all;
}

void Tiles::set_direction(const std::vector<double>& own) {
  std::copy(own.begin(), own.end(), direction_.begin() + left_halo_);
  if (!fetch_) return;
  going_.resize(std::size_t(local_ * dof_));
  for (PetscInt i = 0; i < local_; ++i) going_[std::size_t(i * dof_)] = own[i];
  fetch_->take(going_.data());
  const double* const halo = fetch_->values();
  for (PetscInt i = 0; i < left_halo_; ++i) direction_[i] = halo[i * dof_];
  for (PetscInt i = 0; i < right_halo_; ++i)
    direction_[left_halo_ + local_ + i] = halo[(left_halo_ + i) * dof_];
}

std::vector<std::pair<PetscInt, double>> Tiles::beyond(PetscInt node) const {
  std::vector<std::pair<PetscInt, double>> value;
  for (const auto& [inside, weight] : halo_node(model_.scene(), node))
    value.emplace_back(inside - first_, weight);
  return value;
}

void Tiles::set_up_fetch() {
  std::vector<PetscInt> nodes;
  for (PetscInt i = 0; i < left_halo_; ++i) nodes.push_back(wrapped(first_ - left_halo_ + i));
  for (PetscInt i = 0; i < right_halo_; ++i) nodes.push_back(wrapped(first_ + local_ + i));
  fetch_.emplace(NodeFetch::Layout{model_.comm(), local_, n_, dof_}, dof_, nodes);
}

// The columns of index `index` at node i.
std::array<double*, 3> Tiles::columns(const Tile& t, int index, PetscInt i) const {
  std::array<double*, 3> all{};
  for (int d = 0; d < dof_; ++d) all[d] = column(index, d) + (i - t.from);
  return all;
}

// u and halo are only read
void Tiles::load(const Tile& t, const double* u, const double* halo) const {
  const auto part = [&](PetscInt begin, PetscInt end, const double* from, PetscInt node) {
    if (begin < end)
      to_columns_({const_cast<double*>(from + node * dof_), columns(t, 0, begin).data(), end - begin});
  };
  const PetscInt inside = std::max(t.from, PetscInt(0)), behind = std::max(t.from, local_);
  part(t.from, std::min(t.to, PetscInt(0)), halo, t.from + left_halo_);
  part(inside, std::min(t.to, local_), u, inside);
  part(behind, t.to, halo, left_halo_ + behind - local_);
}

void Tiles::store(const Tile& t, int index, double* u) const {
  from_columns_({u + t.own_begin * dof_, columns(t, index, t.own_begin).data(), t.own_end - t.own_begin});
}

void Tiles::sum(const Tile& t, int d, const double* base, const SlopeSum& row, double dt, PetscInt begin,
                PetscInt end, double* into) const {
  const PetscInt at = begin - t.from;
  add_(base + at, row, dt, end - begin, into + at, [&](int index) { return column(index, d) + at; });
}

void Tiles::close_ends(double* psi, PetscInt begin, PetscInt end) const {
  for (PetscInt j = 1; j <= half_width_ && begin - half_width_ < low_; ++j) {
    psi[low_ - j] = 0;
    for (const auto& [node, weight] : left_end_[j - 1]) psi[low_ - j] += weight * psi[node];
  }
  for (PetscInt j = 1; j <= half_width_ && end + half_width_ > high_; ++j) {
    double value = 0;
    for (const auto& [node, weight] : right_end_[j - 1]) value += weight * psi[node];
    psi[high_ - 1 + j] = value;
  }
}

PetscInt Tiles::count() const { return closed_ ? 1 : (local_ + tile_nodes - 1) / tile_nodes; }

Tile Tiles::tile(PetscInt number, PetscInt reach) const {
  if (closed_) return {low_, high_, 0, local_, low_, high_};
  const auto split_at = [&](PetscInt part) { return PetscInt(std::int64_t(part) * local_ / count()); };
  const PetscInt begin = split_at(number), end = split_at(number + 1);
  return {begin, end, begin, end, std::max(begin - reach, low_), std::min(end + reach, high_)};
}

void Tiles::measure(const Tile& t, const SlopeSum& error, double dt, const ErrorNorm& norm, bool estimate,
                    StepErrors::Sums& sums, const std::function<void()>& refine) const {
  const PetscInt at = t.own_begin - t.from, count = t.own_end - t.own_begin;
  for (int d = 0; d < dof_ && estimate; ++d)  // u itself is not needed any more
    sum(t, d, zeros(), error, dt, t.own_begin, t.own_end, column(0, d));
  if (estimate) refine();
  for (int d = 0; d < dof_; ++d)
    errors_.add(d, column(1, d) + at, column(0, d) + at, count, norm, estimate, sums);
}

namespace {

// The arrays of Vecs that hold slopes while a step is taken; each may be absent.
class SlopeArrays {
 public:
  SlopeArrays(const std::vector<VecHandle>& slopes, Vec last) : last_(last) {
    for (const VecHandle& slope : slopes) slopes_.emplace_back(slope);
  }

  // From the columns first, first + 1, ..., last of the tile.
  void store(const Tiles& tiles, const Tile& tile, int first, int last) const {
    for (std::size_t i = 0; i < slopes_.size(); ++i) tiles.store(tile, first + int(i), slopes_[i]);
    if (last_) tiles.store(tile, last, last_);
  }

 private:
  std::vector<Writing> slopes_;
  Writing last_;
};

// Whether slope j has a weight in a row of a matrix or in a sum.
bool has_weight(const std::vector<double>& rows, int stages, int j) {
  for (std::size_t k = j; k < rows.size(); k += stages)
    if (!is_no_weight(rows[k])) return true;
  return false;
}

}  // namespace

std::vector<TiledStep::Stage> TiledStep::stages_of(const StageProgram& m) {
  const int s = m.stages;
  const std::vector<double> new_u = m.lacking();
  std::vector<Stage> stages(s);
  int column = slopes_from;
  for (int i = 0; i < s; ++i) {
    const auto is_there = [&](const auto&... rows) { return m.dense || (has_weight(rows, s, i) || ...); };
    if (m.additive() && is_there(m.At, m.bt, m.embedded_t)) stages[i].g = column++;
    if (is_there(m.A, m.b, m.embedded)) stages[i].f = column++;
    stages[i].time = m.time(i);
    if (m.additive()) stages[i].diagonal = m.At[i * s + i];
  }
  for (int j = s; j-- > 0;) {  // also by way of later stages
    stages[j].used = !is_no_weight(new_u[j]);
    for (int i = j + 1; i < s; ++i) {
      const bool is_needed = m.additive() || stages[i].used || (i + 1 == s && m.ends_at_last_stage());
      if (is_needed && !is_no_weight(m.A[i * s + j])) stages[j].used = true;
    }
  }
  return stages;
}

int TiledStep::explicit_slopes(bool all) const {
  return int(std::count_if(stages_.begin(), stages_.end(), [&](const Stage& s) { return takes(s, all); }));
}

int TiledStep::implicit_slopes() const {
  return int(std::count_if(stages_.begin(), stages_.end(), [](const Stage& s) { return s.g >= 0; }));
}

TiledStep::TiledStep(const Model& model, const StageProgram& method, bool sticking)
    : stages_(stages_of(method)), known_(slopes_from + explicit_slopes(true) + implicit_slopes()),
      driving_(known_ + (method.additive() ? 1 : 0)),
      tiles_(model, explicit_slopes(true), driving_ - slopes_from + (model.viscous() ? 1 : 0), sticking),
      coefficients_(kernel::coefficients_with(model.scene(), model.viscous() ? 1 : model.scene().mean_K1())),
      additive_(method.additive()), last_is_new_(method.ends_at_last_stage()), target_(method.target),
      K1_(model.scene().mean_K1()), N_(model.scene().N()), solve_(tiles_, sticking),
      stencil_(stencil_loop(model.scene(), tiles_.links())),
      pointwise_(loop_for<PointwiseLoop>(model.scene().friction, sticking, tiles_.places())) {
  const int s = method.stages;
  for (int i = 0; i < s; ++i) {
    const double* const of_g = additive_ ? &method.At[i * s] : nullptr;
    stages_[i].sum[0] = row_of(nullptr, of_g, i);
    stages_[i].sum[1] = row_of(&method.A[i * s], of_g, i);
  }
  const double* const of_g = additive_ && !last_is_new_ ? method.bt.data() : nullptr;
  solution_[0] = row_of(nullptr, of_g, s);
  solution_[1] = row_of(method.lacking().data(), of_g, s);
  if (method.embedded.empty()) return;
  if (additive_) slaves_ = SlaveErrors(model.scene(), tiles_.places());
  error_ = row_of(method.error_of_f().data(), additive_ ? method.error_of_g().data() : nullptr, s);
}

// The sum of the first `count` slopes; either part may be absent.
SlopeSum TiledStep::row_of(const double* of_f, const double* of_g, int count) const {
  SlopeSum row;
  for (int j = 0; j < count; ++j) {
    if (of_g) row.add(stages_[j].g, of_g[j]);
    if (of_f) row.add(stages_[j].f, of_f[j]);
  }
  return row;
}

TiledStep::Outcome TiledStep::take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                                   const std::vector<VecHandle>& slopes, Vec last_slope, double begin) const {
  const Step step{dt, norm, estimate, estimate || !slopes.empty() || last_slope, begin};
  StepErrors::Sums sums;
  {
    const SlopeArrays kept(slopes, last_slope);
    tiles_.pass(
        u, u_new, explicit_slopes(step.all) * tiles_.half_width(),
        [&](const Tile& t) { sums.unsolved += double(through(t, step)); },
        [&](const Tile& t) {
          kept.store(tiles_, t, slopes_from, known_ - 1);
          tiles_.measure(t, error_, dt, norm, estimate, sums, [&] { follow_force(t, dt); });
        });
  }
  const Model& model = tiles_.model();
  const long evaluations = explicit_slopes(step.all) + implicit_slopes();
  model.count_evaluations(evaluations);
  log_flops(model, evaluations);
  return StepErrors::over_ranks(model.comm(), sums, norm, estimate, double(model.scene().n) * model.dof());
}

TiledStep::Range TiledStep::around(const Tile& t, int stencils) const {
  const PetscInt margin = stencils * tiles_.half_width();
  return {std::max(t.begin - margin, tiles_.low()), std::min(t.end + margin, tiles_.high())};
}

long TiledStep::through(const Tile& t, const Step& step) const {
  long unsolved = 0;
  int ahead = explicit_slopes(step.all);  // stencils of this stage and those that follow
  for (int i = 0; i < stages(); ++i) {
    const Stage& stage = stages_[i];
    const bool is_taken = takes(stage, step.all);
    if (!is_taken && !additive_ && !(last_is_new_ && i + 1 == stages())) continue;
    const Range wide = around(t, ahead);
    if (is_taken) --ahead;
    const Range own = around(t, ahead);
    unsolved += values_of(t, i, step, wide, own);
    if (!is_taken) continue;
    const int index = i == 0 && !additive_ ? 0 : 1;
    stretch(t, index, stage.f, own.begin, own.end);
    if (additive_)
      finish_explicit(t, stage.f, own.begin, own.end);
    else
      add_pointwise(t, index, stage.f, at_stage(step, stage), own.begin, own.end);
  }
  for (int d = 0; d < tiles_.dof(); ++d) {
    const SlopeSum& row = solution_[has_explicit(d)];
    if (last_is_new_ && row.columns.empty()) continue;
    tiles_.sum(t, d, tiles_.column(last_is_new_ ? 1 : 0, d), row, step.dt, t.begin, t.end,
               tiles_.column(1, d));
  }
  return unsolved;
}

// The values of stage i in columns 1 (columns 0 where it is u and nothing else), psi on `wide` for the
// stencil and the rest on `own`; and its g.
long TiledStep::values_of(const Tile& t, int i, const Step& step, Range wide, Range own) const {
  const Stage& stage = stages_[i];
  if (!additive_ && i == 0) return 0;
  const bool solved = stage.diagonal != 0;
  for (int d = 0; d < tiles_.dof(); ++d) {
    const Range range = solved || d == 0 ? wide : own;
    tiles_.sum(t, d, tiles_.column(0, d), stage.sum[has_explicit(d)], step.dt, range.begin, range.end,
               tiles_.column(solved ? known_ : 1, d));
  }
  if (!solved) {
    if (stage.g < 0) return 0;
    std::fill(at(t, stage.g, 1, own.begin), at(t, stage.g, 1, own.end), 0.);
    add_pointwise(t, 1, stage.g, at_stage(step, stage), own.begin, own.end);
    return 0;
  }
  for (int d = 0; d < tiles_.dof() && i == 0; ++d)
    std::copy(at(t, 0, d, wide.begin), at(t, 0, d, wide.end), at(t, 1, d, wide.begin));  // a guess
  return solve_(t, {known_, stage.g, i > 0 ? stages_[i - 1].g : -1},
                {at_stage(step, stage), step.dt * stage.diagonal,
                 target_ > 0 ? target_ : step.norm.tolerances.solver_target(), step.norm.tolerances.scales,
                 step.estimate},
                wide.begin, wide.end);
}

void TiledStep::stretch(const Tile& t, int index, int slope, PetscInt begin, PetscInt end) const {
  double* const psi = tiles_.column(index, 0) - t.from;
  tiles_.close_ends(psi, begin, end);
  stencil_(coefficients_, {psi + begin, at(t, slope, 1, begin), end - begin, tiles_.number(begin)});
}

kernel::Coefficients TiledStep::at_stage(const Step& step, const Stage& stage) const {
  kernel::Coefficients c = coefficients_;
  c.v = tiles_.model().plate_velocity(step.t + stage.time * step.dt);
  return c;
}

void TiledStep::add_pointwise(const Tile& t, int index, int slope, const kernel::Coefficients& c,
                              PetscInt begin, PetscInt end) const {
  const bool has_state = tiles_.dof() == 3;
  double* const f_eta = at(t, slope, 1, begin);
  const kernel::Columns columns{at(t, index, 0, begin),
                                at(t, index, 1, begin),
                                has_state ? at(t, index, 2, begin) : nullptr,
                                tiles_.amplitude(begin),
                                f_eta,
                                at(t, slope, 0, begin),
                                f_eta,
                                has_state ? at(t, slope, 2, begin) : nullptr,
                                end - begin,
                                tiles_.direction(begin),
                                tiles_.number(begin)};
  if (viscous())
    ViscousTerms{N_, K1_}(pointwise_, c, columns, f_eta, at(t, driving_, 0, begin),
                          at(t, driving_, 1, begin));
  else
    pointwise_(c, columns);
  hold(t, slope, begin, end);
}

void TiledStep::follow_force(const Tile& t, double dt) const {
  if (!slaves_.any()) return;
  const PetscInt begin = t.own_begin, end = t.own_end;
  const auto of = [&](int index, int d) { return d < tiles_.dof() ? at(t, index, d, begin) : nullptr; };
  slaves_({of(1, 0), of(1, 2), tiles_.amplitude(begin), of(0, 0), of(0, 1), of(0, 2),
           dt * stages_.back().diagonal, end - begin, tiles_.number(begin)},
          [&](PetscInt i) { return tiles_.model().coefficients(begin + i); });
  tiles_.for_held(begin, end, [&](PetscInt node) { *at(t, 0, 0, node) = 0; });
}

void TiledStep::hold(const Tile& t, int slope, PetscInt begin, PetscInt end) const {
  tiles_.for_held(begin, end, [&](PetscInt node) {
    stickslip::hold(tiles_.model().scene(), *at(t, slope, 0, node), *at(t, slope, 1, node));
  });
}

// K1 D2 psi, or D2 psi where neighbours have viscosity, in the eta of columns `slope` becomes f.
void TiledStep::finish_explicit(const Tile& t, int slope, PetscInt begin, PetscInt end) const {
  if (viscous()) {
    const kernel::Coefficients& c = coefficients_;
    double *const psi = at(t, slope, 0, begin), *const eta = at(t, slope, 1, begin);
    const double* const direction = tiles_.direction(begin);
    for (PetscInt j = 0; j < end - begin; ++j) {
      const double d2 = eta[j], viscous = direction && direction[j] == 0 ? 0 : N_ * d2;
      psi[j] = c.A * viscous;
      eta[j] = K1_ * d2 - c.s_delta * viscous;
    }
  }
  hold(t, slope, begin, end);
}

PointwiseSolve::PointwiseSolve(const Tiles& tiles, bool sticking)
    : tiles_(tiles),
      solve_stage_(loop_for<StageLoop>(tiles.model().scene().friction, sticking, tiles.places())) {}

long PointwiseSolve::operator()(const Tile& t, const Where& where, const Asked& asked, PetscInt begin,
                                PetscInt end) const {
  const auto at = [&](int index, int d, PetscInt node) -> double& {
    return tiles_.column(index, d)[node - t.from];
  };
  PetscInt first = begin, last = end;  // held nodes apart: their psi is given
  long unsolved = 0;
  tiles_.for_held(begin, end, [&](PetscInt node) {
    at(1, 0, node) = at(0, 0, node);
    unsolved += solve(t, where, asked, node, node + 1, true);
    hold(tiles_.model().scene(), at(where.slope, 0, node), at(where.slope, 1, node));
    if (tiles_.model().scene().form == Form::continuum) at(1, 1, node) = at(0, 1, node);
    (node == begin ? first : last) = node == begin ? node + 1 : node;
  });
  return unsolved + (first < last ? solve(t, where, asked, first, last, false) : 0);
}

long PointwiseSolve::solve(const Tile& t, const Where& where, const Asked& asked, PetscInt begin,
                           PetscInt end, bool held) const {
  const auto at = [&](int index, int d) { return tiles_.column(index, d) + (begin - t.from); };
  const auto state = [&](int index) { return tiles_.dof() == 3 ? at(index, 2) : nullptr; };
  kernel::Stage s{};
  s.z_psi = at(where.known, 0);
  s.z_eta = at(where.known, 1);
  s.z_state = state(where.known);
  s.start = at(0, 0);
  s.start_state = state(0);
  s.amplitude = tiles_.amplitude(begin);
  s.direction = tiles_.direction(begin);
  s.psi = at(1, 0);
  s.eta = at(1, 1);
  s.state = state(1);
  s.slope = where.slope_before >= 0 ? at(where.slope_before, 0) : nullptr;
  s.g_psi = at(where.slope, 0);
  s.g_eta = at(where.slope, 1);
  s.g_state = state(where.slope);
  s.h = asked.h;
  s.target = asked.target;
  s.scales = asked.scales;
  s.strict = asked.strict;
  s.held = held;
  s.count = end - begin;
  s.node = tiles_.number(begin);
  return solve_stage_(asked.c, s);
}

}  // namespace stickslip
