#include "time/leapfrog.hpp"

#include <algorithm>

namespace stickslip {

namespace {
// Columns: K1 D2 psi, in the place of eta; what the middle of the step begins from; the slope there.
constexpr int pull = 2, known = 3, slope = 4;
constexpr int reaches = 2;  // stencils, one after the other
// Newton's method, against 1 + |psi|: nobody gives a tolerance, and round-off is in reach.
constexpr double target = 1e-13;
}  // namespace

Leapfrog::Leapfrog(const Model& model, bool sticking)
    : TiledStep(model, reaches, 1, 1, sticking), solve_(tiles_, sticking) {
  static_assert(pull == slopes_from && slope == slopes_from + reaches);
  times_ = {0.5};  // where the plate's velocity is taken
}

long Leapfrog::through(const Tile& t, const Step& step) const {
  const int half_width = tiles_.half_width();
  const PetscInt begin = std::max(t.begin - half_width, tiles_.low()),
                 end = std::min(t.end + half_width, tiles_.high());
  const double half = step.dt / 2;
  kick(t, 0, 0, known, half, begin, end);
  for (int d = 0; d < tiles_.dof(); ++d) {
    const double* const u = at(t, 0, d, begin);
    if (d != 1) std::copy(u, u + (end - begin), at(t, known, d, begin));
    std::copy(u, u + (end - begin), at(t, 1, d, begin));  // a guess
  }
  const long unsolved = solve_(t, {known, slope, -1}, {at_stage(step, 0), half, target, false}, begin, end);
  for (int d = 0; d < tiles_.dof(); ++d) {
    const double* const z = at(t, known, d, begin);
    double* const y = at(t, 1, d, begin);
#pragma GCC ivdep
    for (PetscInt i = 0; i < end - begin; ++i) y[i] = 2 * y[i] - z[i];
  }
  kick(t, 1, 1, 1, half, t.begin, t.end);
  return unsolved;
}

// eta of columns `into` = that of columns `from` + half_dt K1 D2 psi of columns `psi`, on [begin, end).
void Leapfrog::kick(const Tile& t, int psi, int from, int into, double half_dt, PetscInt begin,
                    PetscInt end) const {
  stretch(t, psi, pull, begin, end);
  if (is_continuum()) tiles_.for_held(begin, end, [&](PetscInt node) { *at(t, pull, 1, node) = 0; });
  const double *const d2 = at(t, pull, 1, begin), *const eta = at(t, from, 1, begin);
  double* const sum = at(t, into, 1, begin);
#pragma GCC ivdep
  for (PetscInt i = 0; i < end - begin; ++i) sum[i] = eta[i] + half_dt * d2[i];
}

}  // namespace stickslip
