// By how much a step may err: an unknown u by absolute + relative |u|, with numbers of its own for psi, eta
// and the state.
//
//     automatic   `parts` of the scene's own scales (model/scales.hpp), so that it does not matter in what
//                 units a scene is written; of a state that is a logarithm `relative` counts as of 1
//     as set      one number for all of them, in the units of each, as PETSc has it
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "stickslip/model/scales.hpp"

namespace stickslip {

struct Tolerances {
  static constexpr double usual = 1e-6;  // relative, and in parts of the scales

  std::array<double, 3> absolute{usual, usual, usual}, relative{usual, usual, usual};
  Scales scales;

  static Tolerances automatic(const Scales& scales, double relative, double parts) {
    Tolerances t;
    t.scales = scales;
    t.absolute = {parts * scales.psi, parts * scales.eta, parts * scales.state};
    t.relative.fill(relative);
    if (scales.state_is_logarithm) {
      t.absolute[2] += relative;
      t.relative[2] = 0;
    }
    return t;
  }
  static Tolerances as_set(const Scales& scales, double relative, double absolute) {
    Tolerances t;
    t.scales = scales;
    t.absolute.fill(absolute);
    t.relative.fill(relative);
    return t;
  }

  // Of a step as a whole: the relative one, and the absolute ones in parts of the scales.
  double largest() const { return over_all([](double a, double b) { return std::max(a, b); }); }
  double least() const { return over_all([](double a, double b) { return std::min(a, b); }); }
  // To which implicit equations are solved, in parts of scale and value, far below what a step may err by; at
  // least to near round-off.
  static constexpr double least_target = 1e-14;
  double solver_target() const { return std::clamp(1e-3 * least(), least_target, 1e-9); }

 private:
  template <class Choose>
  double over_all(const Choose& choose) const {
    double value = choose(relative[0], absolute[0] / scales.psi);
    value = choose(value, absolute[1] / scales.eta);
    return choose(value, absolute[2] / scales.state);
  }
};

// What an unknown of this value (psi 0, eta 1, the state 2) may be off by at the end of a step.
inline double allowed_error(const Tolerances& tolerances, int unknown, double value) {
  return tolerances.absolute[unknown] + tolerances.relative[unknown] * std::abs(value);
}

}  // namespace stickslip
