#include "time/pointwise_solve.hpp"

namespace stickslip {

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
    at(where.slope, 0, node) = 0;
    if (tiles_.model().scene().form == Form::continuum) {  // eta is output there
      at(where.slope, 1, node) = 0;
      at(1, 1, node) = at(0, 1, node);
    }
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
