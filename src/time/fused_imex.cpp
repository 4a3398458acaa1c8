#include "time/fused_imex.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace stickslip {

namespace {

bool is_near(double a, double b) { return std::abs(a - b) < 1e-14; }

// The sum of the first `count` slopes, which begin at column `from`; either part may be absent. Weights of
// round-off, which the tableau was read with, are 0.
Row row_of(int from, const double* of_implicit, const double* of_explicit, int count) {
  Row row;
  for (int j = 0; j < count; ++j)
    for (const double* weights : {of_implicit, of_explicit}) {
      if (!weights || is_near(weights[j], 0)) continue;
      row.column.push_back(from + 2 * j + (weights == of_explicit ? 1 : 0));
      row.weight.push_back(weights[j]);
    }
  return row;
}

}  // namespace

FusedImex::FusedImex(const Model& model, const ImexTableau& method, bool sticking)
    : TiledStep(model, method.stages, 2, 1, sticking), known_(implicit_slope(method.stages)),
      solve_(tiles_, sticking) {
  const std::size_t s = stages_;
  for (std::size_t i = 0; i < s; ++i) {
    diagonal_.push_back(method.At[i * s + i]);
    times_.push_back(std::accumulate(&method.At[i * s], &method.At[i * s] + i + 1, 0.));
    implicit_rows_.push_back(row_of(slopes_from, &method.At[i * s], nullptr, int(i)));
    all_rows_.push_back(row_of(slopes_from, &method.At[i * s], &method.A[i * s], int(i)));
  }
  stiffly_accurate_ = std::equal(method.bt.begin(), method.bt.end(), &method.At[(s - 1) * s], is_near);
  std::vector<double> of_explicit = method.b;
  if (stiffly_accurate_)
    for (std::size_t j = 0; j < s; ++j) of_explicit[j] -= method.A[(s - 1) * s + j];
  solution_ = row_of(slopes_from, method.bt.data(), nullptr, stages_);
  all_solution_ =
      row_of(slopes_from, stiffly_accurate_ ? nullptr : method.bt.data(), of_explicit.data(), stages_);
  if (method.embedded.empty()) return;
  std::vector<double> f(s), g(s);
  for (std::size_t j = 0; j < s; ++j) {
    f[j] = method.b[j] - method.embedded[j];
    g[j] = method.bt[j] - method.embedded_t[j];
  }
  error_ = row_of(slopes_from, g.data(), f.data(), stages_);
}

long FusedImex::through(const Tile& t, const Step& step) const {
  const int half_width = tiles_.half_width();
  const PetscInt low = tiles_.low(), high = tiles_.high();
  long unsolved = 0;
  for (int i = 0; i < stages_; ++i) {
    const PetscInt margin = (stages_ - 1 - i) * half_width;
    const PetscInt begin = std::max(t.begin - margin, low), end = std::min(t.end + margin, high);
    unsolved += stage(t, i, step, std::max(begin - half_width, low), std::min(end + half_width, high));
    take_explicit(t, i, begin, end);
  }
  const int base = stiffly_accurate_ ? 1 : 0;
  for (int d = 0; d < tiles_.dof(); ++d) {
    if (!has_explicit(d) && stiffly_accurate_) continue;
    const Row& row = has_explicit(d) ? all_solution_ : solution_;
    tiles_.sum(t, d, tiles_.column(base, d), row, step.dt, t.begin, t.end, tiles_.column(1, d));
  }
  return unsolved;
}

// The explicit slope of stage i on [begin, end).
void FusedImex::take_explicit(const Tile& t, int i, PetscInt begin, PetscInt end) const {
  const int slope = implicit_slope(i) + 1;
  stretch(t, 1, slope, begin, end);
  if (viscous()) {
    const kernel::Coefficients& c = coefficients_;
    double *const psi = at(t, slope, 0, begin), *const eta = at(t, slope, 1, begin);
    const double* const direction = tiles_.direction(begin);
    for (PetscInt j = 0; j < end - begin; ++j) {
      const double d2 = eta[j], viscous = direction && direction[j] == 0 ? 0 : N_ * d2;
      psi[j] = c.A * viscous;
      eta[j] = K1_ * d2 - c.s_delta * viscous;
    }
    tiles_.for_held(begin, end, [&](PetscInt node) { *at(t, slope, 0, node) = 0; });
  }
  if (is_continuum()) tiles_.for_held(begin, end, [&](PetscInt node) { *at(t, slope, 1, node) = 0; });
}

// Stage i on [begin, end): its values in columns 1, its implicit slope in its columns.
long FusedImex::stage(const Tile& t, int i, const Step& step, PetscInt begin, PetscInt end) const {
  const int g = implicit_slope(i);
  const bool is_explicit = diagonal_[i] == 0;
  for (int d = 0; d < tiles_.dof(); ++d) {
    const auto& rows = has_explicit(d) ? all_rows_ : implicit_rows_;
    const Row& row = rows[i];
    tiles_.sum(t, d, tiles_.column(0, d), row, step.dt, begin, end,
               tiles_.column(is_explicit ? 1 : known_, d));
  }
  if (is_explicit) {
    std::fill(at(t, g, 1, begin), at(t, g, 1, end), 0.);
    add_pointwise(t, 1, g, at_stage(step, i), begin, end);
    return 0;
  }
  for (int d = 0; d < tiles_.dof() && i == 0; ++d)
    std::copy(at(t, 0, d, begin), at(t, 0, d, end), at(t, 1, d, begin));  // a guess
  return solve_(t, {known_, g, i > 0 ? implicit_slope(i - 1) : -1},
                {at_stage(step, i), step.dt * diagonal_[i], step.norm.solver_target(), step.estimate}, begin,
                end);
}

}  // namespace stickslip
