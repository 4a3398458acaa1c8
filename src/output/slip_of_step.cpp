#include "output/slip_of_step.hpp"

#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

double SlipOfStep::sum_at(const ObservedStep& step, double t, int unknown) {
  if (t < step.t) step.interpolate(t, work_);
  const Reading u(t < step.t ? work_.get() : step.u);
  double sum = 0;
  for (PetscInt i = 0; i < model_.local(); ++i) sum += u[i * model_.dof() + unknown];
  return sum;
}

// No dense output has a degree of more than 9.
double SlipOfStep::between(const ObservedStep& step, double from, double to) {
  static const Tableau points = Tableau::gauss(5);
  double sum = 0;
  for (int i = 0; i < points.s && to > from; ++i)
    sum += (to - from) * points.b[i] * sum_at(step, from + (to - from) * points.c[i], 0);
  return sum;
}

}  // namespace stickslip
