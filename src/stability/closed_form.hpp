// What is known of the modes in closed form, where all nodes are alike.
#pragma once

#include <vector>

#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

// The eigenvalues by the exact discrete dispersion relation (LinearisedOperator::exact_waves).
class ExactModes {
 public:
  explicit ExactModes(const LinearisedOperator& s);
  bool apply() const { return !roots_.empty(); }
  // Eigenvalues with real part above a and |Im| up to `height`, the symmetry of a line that slides as a whole
  // included.
  long count(double a, double height) const;
  // Largest distance of a mode from the nearest eigenvalue of the relation, relative to the size of the
  // eigenvalue.
  double distance(const std::vector<Mode>& modes) const;
  // Guesses: sine waves, the rightmost first, equal ones by frequency; not polished.
  std::vector<Mode> rightmost(double height, std::size_t count) const;

 private:
  struct Root {
    Complex value;  // Im >= 0
    double k;
    int members;  // its conjugate and its multiplicity counted
  };
  const LinearisedOperator& s_;
  std::vector<Root> roots_;  // by frequency
};

// What ever shorter waves of a line of the continuum come to grow at: they see the mean damping alone (Cox
// and Zuazua 1994 for the wave equation), by the trapezoidal rule on the nodes. With viscosity between
// neighbours S/kappa^2 tends to (K1 + lambda N)(lambda + r): they decay, at -K1/N or with their state.
double short_wave_growth(const LinearisedOperator& s);

}  // namespace stickslip
