// Values between the steps of a method that has no polynomial of its own for them.
//
// The cubic through u and its slopes at both ends of the step errs by dt^4. Slopes of that cubic inside the
// step err by as much, times dt in their integral: the quartic through them errs by dt^5, and so on, one
// order for each round of new slopes. Degrees above 3 only for explicit methods, whose steps are short enough
// for it.
#pragma once

#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/time/methods.hpp"

namespace stickslip {

class DenseOutput {
 public:
  DenseOutput(const Model& model, int degree)
      : model_(model), degree_(degree), work_(model.create_vector()) {}
  // The degree that a method needs here; 0: it has a polynomial of its own.
  static int degree_for(const Method& method);
  // Memory of a node whose unknowns take `unknowns` bytes: slopes only once values are asked for.
  static double bytes_a_node(double unknowns, int degree, bool asked) {
    return (1 + (asked ? 2 * degree : 0)) * unknowns;
  }
  int degree() const { return degree_; }
  // A new step, of which nothing is known.
  void forget() { degree_now_ = 0; }
  // u at the part s of the step of length dt from `before`, at the time t, to `after`. Collective; costs
  // evaluations of the right-hand side the first time in a step.
  void interpolate(Vec before, Vec after, double t, double dt, double s, Vec into);

 private:
  void refine(Vec before, Vec after, double t, double dt);
  void polynomial(Vec before, Vec after, double dt, double s, Vec into) const;

  const Model& model_;
  int degree_;
  int degree_now_ = 0;                             // of the polynomial that slopes_ stand for; 0: none yet
  std::vector<VecHandle> slopes_, better_slopes_;  // at equal distances over the step
  VecHandle work_;
};

}  // namespace stickslip
