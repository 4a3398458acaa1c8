// How large the velocities, forces and states of a law are by itself (stickslip/model/scales.hpp).
#pragma once

namespace stickslip {

struct LawScales {
  double velocity = 1;  // 0: it has none
  double force = 1, state = 1;
  double length = 0;  // 0: it has none
};

}  // namespace stickslip
