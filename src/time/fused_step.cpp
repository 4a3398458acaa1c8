#include "time/fused_step.hpp"

#include <algorithm>

#include "stickslip/base/error.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip {

SlopeArrays::SlopeArrays(const std::vector<VecHandle>& slopes, Vec last)
    : slopes_(slopes), last_(last), arrays_(slopes.size()) {
  for (std::size_t i = 0; i < arrays_.size(); ++i) SS_TRY(VecGetArrayWrite(slopes_[i], &arrays_[i]));
  if (last_) SS_TRY(VecGetArrayWrite(last_, &last_array_));
}
SlopeArrays::~SlopeArrays() {
  if (last_) (void)VecRestoreArrayWrite(last_, &last_array_);
  for (std::size_t i = 0; i < arrays_.size(); ++i) (void)VecRestoreArrayWrite(slopes_[i], &arrays_[i]);
}
void SlopeArrays::store(const Tiles& tiles, const Tile& tile, int first, int stages) const {
  for (std::size_t i = 0; i < arrays_.size(); ++i) tiles.store(tile, first + static_cast<int>(i), arrays_[i]);
  if (last_array_) tiles.store(tile, first + stages - 1, last_array_);
}

struct FusedStep::Impl {
  int stages;
  Tiles tiles;
  std::vector<Row> rows;  // of A
  Row solution, error;
  bool last_is_solution;  // the last stage is taken at the new u
  kernel::Coefficients coefficients;
  tile::Stencil stencil;
  tile::Pointwise pointwise;

  Impl(const Model& m, const RungeKutta& method, bool sticking)
      : stages(method.stages), tiles(m, stages, stages, sticking), rows(std::size_t(stages)),
        coefficients(kernel::coefficients_of(m.scene())), stencil(tile::stencil(m.scene())),
        pointwise(tile::pointwise(m.scene(), sticking)) {
    for (int i = 0; i < stages; ++i)
      add_to_row(rows[std::size_t(i)], &method.A[static_cast<std::size_t>(i * stages)], i, 2);
    add_to_row(solution, method.b.data(), stages, 2);
    last_is_solution = rows.back().column == solution.column && rows.back().weight == solution.weight;
    if (method.embedded.empty()) return;
    std::vector<double> difference = method.b;
    for (std::size_t i = 0; i < difference.size(); ++i) difference[i] -= method.embedded[i];
    add_to_row(error, difference.data(), stages, 2);
  }

  // k_i on [begin, end) of the values in column `index`, psi of which holds half_width more nodes at either side.
  void slope(const Tile& t, int index, int i, PetscInt begin, PetscInt end) const {
    double* const psi = tiles.column(index, 0) - t.from;
    tiles.close_ends(psi, begin, end);
    const bool has_state = tiles.dof() == 3;
    const PetscInt at = begin - t.from;
    double* const k_psi = tiles.column(2 + i, 0) - t.from;
    double* const k_eta = tiles.column(2 + i, 1) - t.from;
    stencil(coefficients, {psi + begin, k_eta + begin, end - begin});
    pointwise(coefficients,
             {psi + begin, tiles.column(index, 1) + at, has_state ? tiles.column(index, 2) + at : nullptr,
              tiles.amplitude(begin), k_psi + begin, k_eta + begin, has_state ? tiles.column(2 + i, 2) + at : nullptr,
              end - begin, tiles.direction(begin)});
    tiles.for_held(begin, end, [&](PetscInt node) {
      k_psi[node] = 0;
      if (tiles.model().scene().form == Form::continuum) k_eta[node] = 0;
    });
  }

  // Through all stages, of which the first `taken` need their slope; the new values end in column 1.
  void through(const Tile& t, double dt, int taken) const {
    const int dof = tiles.dof(), half_width = tiles.half_width();
    const PetscInt low = tiles.low(), high = tiles.high();
    for (int i = 0; i < stages; ++i) {
      const bool is_taken = i < taken;
      if (!is_taken && !last_is_solution) break;
      const PetscInt margin = is_taken ? (taken - 1 - i) * half_width : 0;
      const PetscInt begin = std::max(t.begin - margin, low), end = std::min(t.end + margin, high);
      if (i > 0) {
        const PetscInt beyond_it = is_taken ? half_width : 0;
        const Row& row = rows[static_cast<std::size_t>(i)];
        const PetscInt psi_begin = std::max(begin - beyond_it, low), psi_end = std::min(end + beyond_it, high);
        tiles.sum(t, 0, tiles.column(0, 0), row, dt, psi_begin, psi_end, tiles.column(1, 0));
        for (int d = 1; d < dof; ++d) tiles.sum(t, d, tiles.column(0, d), row, dt, begin, end, tiles.column(1, d));
      }
      if (is_taken) slope(t, i > 0 ? 1 : 0, i, begin, end);
    }
    if (!last_is_solution)
      for (int d = 0; d < dof; ++d) tiles.sum(t, d, tiles.column(0, d), solution, dt, t.begin, t.end, tiles.column(1, d));
  }
};

FusedStep::FusedStep(const Model& model, const RungeKutta& method, bool sticking)
    : impl_(std::make_unique<Impl>(model, method, sticking)) {}
FusedStep::~FusedStep() = default;

TiledStep::Outcome FusedStep::take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                                   const std::vector<VecHandle>& slopes, Vec last_slope) const {
  const Impl& m = *impl_;
  const bool last_wanted = !m.last_is_solution || estimate || !slopes.empty() || last_slope;
  const int taken = last_wanted ? m.stages : m.stages - 1;
  Tiles::Sums sums;
  {
    const SlopeArrays kept(slopes, last_slope);
    m.tiles.pass(u, u_new, taken * m.tiles.half_width(), [&](const Tile& t) { m.through(t, dt, taken); },
                 [&](const Tile& t) {
                   kept.store(m.tiles, t, 2, m.stages);
                   m.tiles.measure(t, m.error, dt, norm, estimate, sums);
                 });
  }
  m.tiles.model().count_evaluations(taken);
  const Tiles::Measured measured = m.tiles.over_ranks(sums, norm, estimate);
  return {measured.finite, measured.error};
}
void FusedStep::set_direction(const std::vector<double>& direction) { impl_->tiles.set_direction(direction); }
bool FusedStep::last_is_solution() const { return impl_->last_is_solution; }
int FusedStep::stages() const { return impl_->stages; }

}  // namespace stickslip
