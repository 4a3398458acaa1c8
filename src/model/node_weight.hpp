// What a node counts in a sum over the system.
#pragma once

#include "stickslip/model/scene.hpp"

namespace stickslip {

// 1 in the chain; in the continuum h, and half of it at an end of the line (the trapezoidal rule, in whose
// inner product D2 is symmetric between free ends: stencil.hpp).
inline bool counts_half(const Scene& s, PetscInt node) {
  return s.form == Form::continuum && !s.ring() && (node == 0 || node == s.n - 1);
}
inline double node_weight(const Scene& s, PetscInt node) {
  return (s.form == Form::chain ? 1 : s.h()) * (counts_half(s, node) ? 0.5 : 1);
}

}  // namespace stickslip
