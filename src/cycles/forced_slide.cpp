#include "stickslip/cycles/forced_slide.hpp"

#include "cycles/cell_field.hpp"
#include "cycles/profile.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

using std::size_t;

SmoothCycle forced_slide(const Scene& cell, double tolerance) {
  constexpr int intervals = 12;
  constexpr double least_step = 1. / 64, rough = 1e-4;  // what is only on the way need not be known well
  CycleGuess guess;
  guess.periods = 1;
  guess.period = cell.forcing_period();
  for (int i = 0; i <= intervals; ++i) guess.mesh.push_back(double(i) / intervals);
  const CellField at_rest_of_load(cell, 1);
  const std::vector<double> sliding = at_rest_of_load.sliding();
  guess.at = [&](double, double* y) { unfold(at_rest_of_load, sliding.data(), y); };
  SmoothCycle found;
  Scene scene = cell;
  for (double grown = 0, step = 1; grown < 1;) {
    scene.load = cell.load.scaled(grown + step);
    scene.normal = cell.normal.scaled(grown + step);
    try {
      found = solve_cycle(scene, guess, grown + step < 1 ? rough : tolerance);
    } catch (const Failure&) {
      if ((step /= 2) < least_step) throw;
      continue;
    }
    grown += step;
    guess.mesh = found.mesh;
    guess.at = [&found, d = size_t(found.field->dim())](double phase, double* y) {
      std::vector<double> there(d);
      evaluate(Collocation::gauss5(), found.mesh, found.values.data(), int(d), phase, there.data());
      unfold(*found.field, there.data(), y);
    };
  }
  return found;
}

}  // namespace stickslip
