#include "time/leapfrog.hpp"

namespace stickslip {

const StageProgram& leapfrog() {
  static const StageProgram method = [] {
    StageProgram m{3, {0, 0, 0, 0.5, 0, 0, 0.5, 0, 0}, {0.5, 0, 0.5}, {}};
    m.At = {0, 0, 0, 0, 0.5, 0, 0, 1, 0};
    m.bt = {0, 1, 0};
    m.order = 2;
    m.dense = false;
    m.target = 1e-13;  // nobody gives a tolerance, and round-off is in reach
    return m;
  }();
  return method;
}

}  // namespace stickslip
