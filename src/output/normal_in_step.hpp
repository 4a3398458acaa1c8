// The normal load at the beginning, in the middle and at the end of a step, for observers: a step lies in one
// piece of the load, and where one ends and the next begins N may jump.
#pragma once

#include <array>
#include <cmath>

#include "stickslip/model/scene.hpp"

namespace stickslip {

struct NormalInStep {
  std::array<double, 3> N{1, 1, 1};
  std::array<double, 2> log_rate{0, 0};  // N'/N at the beginning and at the end

  // From t to t + dt, behind a step that ended at t. By how much ln N has jumped at t.
  double begin_step(const Load& normal, double t, double dt) {
    if (!normal.varies()) return 0;
    const int piece = normal.piece_from(t);
    const double before = N[2];
    N = {normal.in_piece(piece, t), normal.in_piece(piece, t + dt / 2), normal.in_piece(piece, t + dt)};
    log_rate = {normal.slope_in_piece(piece, t) / N[0], normal.slope_in_piece(piece, t + dt) / N[2]};
    return N[0] == before ? 0 : std::log(N[0] / before);
  }
  // At the end of a step that ends at t.
  void end_at(const Load& normal, double t) {
    if (normal.varies()) N.fill(normal.before(t));
  }
};

}  // namespace stickslip
