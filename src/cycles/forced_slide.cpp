#include "stickslip/cycles/forced_slide.hpp"

#include "cycles/cell_field.hpp"
#include "cycles/profile.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

using std::size_t;

namespace {

CycleGuess guess_of(const SmoothCycle& slide, const Scene& cell) {
  CycleGuess guess;
  guess.periods = 1;
  guess.period = cell.forcing_period();
  guess.mesh = slide.mesh;
  guess.at = [&slide, d = size_t(slide.field->dim())](double phase, double* y) {
    std::vector<double> there(d);
    evaluate(Collocation::gauss5(), slide.mesh, slide.values.data(), int(d), phase, there.data());
    unfold(*slide.field, there.data(), y);
  };
  return guess;
}

}  // namespace

SmoothCycle forced_slide_near(const SmoothCycle& other, const Scene& cell, double tolerance) {
  return solve_cycle(cell, guess_of(other, cell), tolerance);
}

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
    guess = guess_of(found, cell);
  }
  return found;
}

}  // namespace stickslip
