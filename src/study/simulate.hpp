// One run: an integrator advances u, and observers see every step of it.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "stickslip/output/observer.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

// How far a run goes, and what went before it.
struct TimeSpan {
  double begin, end;
  std::int64_t most_steps = std::numeric_limits<std::int64_t>::max();  // in all
  std::int64_t rejections = 0;                                         // before it
  double* watching = nullptr;  // if given, takes the processor seconds of this rank for all but the steps
};

// Advances u. The observers see each step in this order, as their contract says; then `asked`, if given, says
// whether to go on. Throws what Integrator::advance, an observer or `asked` throws. Collective.
void simulate(Integrator& integrator, Vec u, const TimeSpan& span, const std::vector<Observer*>& observers,
              const Integrator::Observer& asked = {});

}  // namespace stickslip
