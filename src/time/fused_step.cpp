#include "time/fused_step.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

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

}  // namespace

// v = w + a sine, w straight in a piece of the load: over a whole period the sine is gone, over half of one
// it turns.
double plate_acceleration(const Model& model, double t) {
  const auto v = [&](double at) { return model.plate_velocity(at); };
  const double half = model.scene().load.smooth_time();
  if (!std::isfinite(half)) return model.scene().load.varies() ? v(t + 1) - v(t) : 0;
  const double slope = (v(t + 2 * half) - v(t)) / (2 * half);
  // by a quarter of its period
  const double sine_ahead = (v(t + half / 2) - v(t + 1.5 * half) + slope * half) / 2;
  return slope + M_PI / half * sine_ahead;
}

TiledStep::TiledStep(const Model& model, int stages, int slopes, int others, bool sticking)
    : stages_(stages), slopes_(slopes),
      tiles_(model, stages, stages * slopes + others + (model.viscous() ? 1 : 0), sticking),
      coefficients_(kernel::coefficients_with(model.scene(), model.viscous() ? 1 : model.scene().K1())),
      K1_(model.scene().K1()), N_(model.scene().N()), driving_(slopes_from + stages * slopes + others),
      stencil_(tile::stencil(model.scene())),
      pointwise_(tile::pointwise(model.scene(), sticking, tiles_.places())) {}

TiledStep::Outcome TiledStep::take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                                   const std::vector<VecHandle>& slopes, Vec last_slope, double begin) const {
  const bool last_wanted = !last_is_solution_ || estimate || !slopes.empty() || last_slope;
  const Step step{dt, norm, estimate, last_wanted ? stages_ : stages_ - 1, begin};
  StepErrors::Sums sums;
  {
    const SlopeArrays kept(slopes, last_slope);
    tiles_.pass(
        u, u_new, step.taken * tiles_.half_width(),
        [&](const Tile& t) { sums.unsolved += double(through(t, step)); },
        [&](const Tile& t) {
          kept.store(tiles_, t, slopes_from, slopes_from + stages_ * slopes_ - 1);
          tiles_.measure(t, error_, dt, norm, estimate, sums);
        });
  }
  tiles_.model().count_evaluations(step.taken * slopes_);
  const Model& model = tiles_.model();
  return StepErrors::over_ranks(model.comm(), sums, norm, estimate, double(model.scene().n) * model.dof());
}

void TiledStep::stretch(const Tile& t, int index, int slope, PetscInt begin, PetscInt end) const {
  double* const psi = tiles_.column(index, 0) - t.from;
  tiles_.close_ends(psi, begin, end);
  stencil_(coefficients_, {psi + begin, at(t, slope, 1, begin), end - begin});
}

kernel::Coefficients TiledStep::at_stage(const Step& step, int i) const {
  kernel::Coefficients c = coefficients_;
  const Model& model = tiles_.model();
  c.v = model.plate_velocity(step.t + times_[i] * step.dt);
  if (!rates_.empty() && model.scene().load.varies())
    c.v += rates_[i] * step.dt * plate_acceleration(model, step.t);
  return c;
}

void TiledStep::add_pointwise(const Tile& t, int index, int slope, const kernel::Coefficients& c,
                              PetscInt begin, PetscInt end) const {
  const bool has_state = tiles_.dof() == 3, resists = viscous();
  const double* eta = at(t, index, 1, begin);
  double *const d2 = resists ? at(t, driving_, 0, begin) : nullptr, *const f_eta = at(t, slope, 1, begin);
  if (resists) {  // in the order of model/viscosity.hpp, so that it is the same to the last bit
    double* const driving = at(t, driving_, 1, begin);
#pragma GCC ivdep
    for (PetscInt i = 0; i < end - begin; ++i) {
      d2[i] = f_eta[i];
      driving[i] = eta[i] + N_ * d2[i];
      f_eta[i] = 0;
    }
    eta = driving;
  }
  pointwise_(
      c, {at(t, index, 0, begin), eta, has_state ? at(t, index, 2, begin) : nullptr, tiles_.amplitude(begin),
          at(t, slope, 0, begin), at(t, slope, 1, begin), has_state ? at(t, slope, 2, begin) : nullptr,
          end - begin, tiles_.direction(begin), tiles_.number(begin)});
  for (PetscInt i = 0; i < end - begin && resists; ++i) f_eta[i] += K1_ * d2[i];
  tiles_.for_held(begin, end, [&](PetscInt node) { hold(t, slope, node); });
}

void TiledStep::hold(const Tile& t, int slope, PetscInt node) const {
  *at(t, slope, 0, node) = 0;
  if (is_continuum()) *at(t, slope, 1, node) = 0;
}

FusedStep::FusedStep(const Model& model, const RungeKutta& method, bool sticking, int others)
    : TiledStep(model, method.stages, 1, others, sticking), rows_(method.stages) {
  for (int i = 0; i < stages_; ++i) add_to_row(rows_[i], &method.A[i * stages_], i, slopes_from);
  for (const Row& row : rows_) times_.push_back(std::accumulate(row.weight.begin(), row.weight.end(), 0.));
  add_to_row(solution_, method.b.data(), stages_, slopes_from);
  last_is_solution_ = rows_.back().column == solution_.column && rows_.back().weight == solution_.weight;
  if (method.embedded.empty()) return;
  std::vector<double> difference = method.b;
  for (std::size_t i = 0; i < difference.size(); ++i) difference[i] -= method.embedded[i];
  add_to_row(error_, difference.data(), stages_, slopes_from);
}

long FusedStep::through(const Tile& t, const Step& step) const {
  const int dof = tiles_.dof(), half_width = tiles_.half_width();
  const PetscInt low = tiles_.low(), high = tiles_.high();
  const long unsolved = prepare(t, step);
  for (int i = 0; i < stages_; ++i) {
    const bool is_taken = i < step.taken;
    if (!is_taken && !last_is_solution_) break;
    const PetscInt margin = is_taken ? (step.taken - 1 - i) * half_width : 0;
    const PetscInt begin = std::max(t.begin - margin, low), end = std::min(t.end + margin, high);
    if (i > 0) {
      const PetscInt beyond_it = is_taken ? half_width : 0;
      const Row& row = rows_[i];
      const PetscInt psi_begin = std::max(begin - beyond_it, low), psi_end = std::min(end + beyond_it, high);
      tiles_.sum(t, 0, tiles_.column(0, 0), row, step.dt, psi_begin, psi_end, tiles_.column(1, 0));
      for (int d = 1; d < dof; ++d)
        tiles_.sum(t, d, tiles_.column(0, d), row, step.dt, begin, end, tiles_.column(1, d));
    }
    if (!is_taken) continue;
    const int index = i > 0 ? 1 : 0;
    stretch(t, index, slopes_from + i, begin, end);
    add_pointwise(t, index, slopes_from + i, at_stage(step, i), begin, end);
    finish_stage(t, i, step, begin, end);
  }
  for (int d = 0; d < dof && !last_is_solution_; ++d)
    tiles_.sum(t, d, tiles_.column(0, d), solution_, step.dt, t.begin, t.end, tiles_.column(1, d));
  return unsolved;
}

}  // namespace stickslip
