#include "time/fused_imex.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip {

struct FusedImex::Impl {
  static constexpr int slopes_from = 2;  // columns: implicit slope of stage i at 2 + 2 i, explicit one behind it
  int stages;
  Tiles tiles;
  int known;                      // column of what an implicit equation is given
  std::vector<double> diagonal;   // of At
  std::vector<Row> implicit_rows, all_rows;  // of the stages, for psi and the state, and for eta
  // The new u: a stiffly accurate method has it in its last stage but for what is explicit.
  bool stiffly_accurate;
  Row solution, eta_solution, error;
  kernel::Coefficients coefficients;
  tile::Stencil stencil;
  tile::Pointwise pointwise;
  tile::SolveStage solve_stage;

  Impl(const Model& m, const ImexTableau& method, bool sticking)
      : stages(method.stages), tiles(m, stages, 2 * stages + 1, sticking), known(slopes_from + 2 * stages),
        coefficients(kernel::coefficients_of(m.scene())), stencil(tile::stencil(m.scene())),
        pointwise(tile::pointwise(m.scene(), sticking)), solve_stage(tile::solve_stage(m.scene(), sticking)) {
    const auto s = static_cast<std::size_t>(stages);
    for (std::size_t i = 0; i < s; ++i) {
      diagonal.push_back(method.At[i * s + i]);
      implicit_rows.push_back(row_of(&method.At[i * s], nullptr, int(i)));
      all_rows.push_back(row_of(&method.At[i * s], &method.A[i * s], int(i)));
    }
    stiffly_accurate = std::equal(method.bt.begin(), method.bt.end(), &method.At[(s - 1) * s], is_near);
    std::vector<double> of_explicit = method.b;
    if (stiffly_accurate)
      for (std::size_t j = 0; j < s; ++j) of_explicit[j] -= method.A[(s - 1) * s + j];
    solution = row_of(method.bt.data(), nullptr, stages);
    eta_solution = row_of(stiffly_accurate ? nullptr : method.bt.data(), of_explicit.data(), stages);
    if (method.embedded.empty()) return;
    std::vector<double> f(s), g(s);
    for (std::size_t j = 0; j < s; ++j) {
      f[j] = method.b[j] - method.embedded[j];
      g[j] = method.bt[j] - method.embedded_t[j];
    }
    error = row_of(g.data(), f.data(), stages);
  }

  static bool is_near(double a, double b) { return std::abs(a - b) < 1e-14; }

  // The sum of the first `count` slopes; either part may be absent. Weights of round-off, which the tableau was read
  // with, are 0.
  static Row row_of(const double* of_implicit, const double* of_explicit, int count) {
    Row row;
    for (int j = 0; j < count; ++j)
      for (const double* weights : {of_implicit, of_explicit}) {
        if (!weights || is_near(weights[j], 0)) continue;
        row.column.push_back(slopes_from + 2 * j + (weights == of_explicit ? 1 : 0));
        row.weight.push_back(weights[j]);
      }
    return row;
  }

  double* at(const Tile& t, int column, int d, PetscInt node) const { return tiles.column(column, d) + (node - t.from); }

  struct Step {
    double dt;
    double target;  // of the residuals, against 1 + |psi|
    bool strict;
  };

  // Stage i on [begin, end): its values in column 1, its implicit slope in its column.
  long stage(const Tile& t, int i, const Step& step, PetscInt begin, PetscInt end) const {
    const int dof = tiles.dof(), g = slopes_from + 2 * i;
    const double dt = step.dt, h = dt * diagonal[static_cast<std::size_t>(i)];
    const bool is_explicit = h == 0;
    const int z = is_explicit ? 1 : known;
    for (int d = 0; d < dof; ++d) {
      const Row& row = d == 1 ? all_rows[static_cast<std::size_t>(i)] : implicit_rows[static_cast<std::size_t>(i)];
      tiles.sum(t, d, tiles.column(0, d), row, dt, begin, end, tiles.column(z, d));
    }
    const bool has_state = dof == 3;
    if (is_explicit) {
      std::fill(at(t, g, 1, begin), at(t, g, 1, end), 0.);
      pointwise(coefficients,
                {at(t, 1, 0, begin), at(t, 1, 1, begin), has_state ? at(t, 1, 2, begin) : nullptr,
                 tiles.amplitude(begin), at(t, g, 0, begin), at(t, g, 1, begin),
                 has_state ? at(t, g, 2, begin) : nullptr, end - begin, tiles.direction(begin)});
      tiles.for_held(begin, end, [&](PetscInt node) { hold(t, i, node); });
      return 0;
    }
    if (i == 0)
      for (int d = 0; d < dof; ++d) std::copy(at(t, 0, d, begin), at(t, 0, d, end), at(t, 1, d, begin));  // a guess
    const auto solve = [&](PetscInt from, PetscInt to, bool held) {
      return solve_stage(coefficients,
                           {at(t, known, 0, from), at(t, known, 1, from), has_state ? at(t, known, 2, from) : nullptr,
                            at(t, 0, 0, from), has_state ? at(t, 0, 2, from) : nullptr, tiles.amplitude(from),
                            tiles.direction(from), at(t, 1, 0, from), at(t, 1, 1, from),
                            has_state ? at(t, 1, 2, from) : nullptr, i > 0 ? at(t, g - 2, 0, from) : nullptr, at(t, g, 0, from),
                            at(t, g, 1, from), has_state ? at(t, g, 2, from) : nullptr, h, step.target, step.strict, held, to - from});
    };
    // held nodes apart: their psi is given
    PetscInt first = begin, last = end;
    long unsolved = 0;
    tiles.for_held(begin, end, [&](PetscInt node) {
      *at(t, 1, 0, node) = *at(t, 0, 0, node);
      unsolved += solve(node, node + 1, true);
      hold(t, i, node);
      (node == begin ? first : last) = node == begin ? node + 1 : node;
    });
    return unsolved + (first < last ? solve(first, last, false) : 0);
  }

  // What a held node's slopes are: psi stands, and in the continuum eta, which is output, does too.
  void hold(const Tile& t, int i, PetscInt node) const {
    const int g = slopes_from + 2 * i;
    *at(t, g, 0, node) = 0;
    if (tiles.model().scene().form != Form::continuum) return;
    *at(t, g, 1, node) = 0;
    *at(t, 1, 1, node) = *at(t, 0, 1, node);
  }

  // The explicit slope of stage i, whose values stand in column 1.
  void stretch(const Tile& t, int i, PetscInt begin, PetscInt end) const {
    double* const psi = tiles.column(1, 0) - t.from;
    tiles.close_ends(psi, begin, end);
    double* const f = tiles.column(slopes_from + 2 * i + 1, 1) - t.from;
    stencil(coefficients, {psi + begin, f + begin, end - begin});
    if (tiles.model().scene().form == Form::continuum)
      tiles.for_held(begin, end, [&](PetscInt node) { f[node] = 0; });
  }

  long through(const Tile& t, const Step& step) const {
    const int half_width = tiles.half_width();
    long unsolved = 0;
    for (int i = 0; i < stages; ++i) {
      const PetscInt margin = (stages - 1 - i) * half_width;
      const PetscInt begin = std::max(t.begin - margin, tiles.low()), end = std::min(t.end + margin, tiles.high());
      unsolved += stage(t, i, step, std::max(begin - half_width, tiles.low()), std::min(end + half_width, tiles.high()));
      stretch(t, i, begin, end);
    }
    for (int d = 0; d < tiles.dof(); ++d) {
      if (d != 1 && stiffly_accurate) continue;
      const int base = stiffly_accurate ? 1 : 0;
      tiles.sum(t, d, tiles.column(base, d), d == 1 ? eta_solution : solution, step.dt, t.begin, t.end, tiles.column(1, d));
    }
    return unsolved;
  }
};

FusedImex::FusedImex(const Model& model, const ImexTableau& method, bool sticking)
    : impl_(std::make_unique<Impl>(model, method, sticking)) {}
FusedImex::~FusedImex() = default;

TiledStep::Outcome FusedImex::take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                                   const std::vector<VecHandle>& slopes, Vec) const {
  const Impl& m = *impl_;
  const Impl::Step step{dt, std::clamp(1e-3 * std::min(norm.atol, norm.rtol), 1e-13, 1e-9), estimate};
  Tiles::Sums sums;
  {
    const SlopeArrays kept(slopes, nullptr);
    m.tiles.pass(u, u_new, m.stages * m.tiles.half_width(),
                 [&](const Tile& t) { sums.unsolved += double(m.through(t, step)); },
                 [&](const Tile& t) {
                   kept.store(m.tiles, t, Impl::slopes_from, 2 * m.stages);
                   m.tiles.measure(t, m.error, dt, norm, estimate, sums);
                 });
  }
  m.tiles.model().count_evaluations(2 * m.stages);
  const Tiles::Measured measured = m.tiles.over_ranks(sums, norm, estimate);
  return {measured.finite, measured.error, measured.solved};
}
void FusedImex::set_direction(const std::vector<double>& direction) { impl_->tiles.set_direction(direction); }
int FusedImex::stages() const { return impl_->stages; }

}  // namespace stickslip
