// Trains in a medium with viscosity between neighbours.
//
// With psi(x, t) = f(t - x/V) it adds (N/V^2) f'' to the force on a node, so that in t alone (oscillator.hpp,
// r2 = 1 - c^2/V^2)
//     f' = g,   g' = (V^2/N) [r2 g/A - z + Bd f + F(f, s)],   z' = K0 (v - f),   s' = g(f, s)
// one order more than without: deviations that grow at about r2 V^2/(A N) stand beside those that decay,
// which a method that goes along t cannot follow and collocation over a period can. |V| > c holds as before
// (multiply the equation of psi by f - v and integrate over a period).
//
// The train is reached from that of the plain medium, at the same speed or length, by making N larger step by
// step. Computed alike on every rank.
#pragma once

#include <cmath>
#include <vector>

#include "stickslip/waves/train.hpp"

namespace stickslip {

// The right-hand side above over y = (f, z[, s], g); J (null, or row-major) = d(dy)/dy. r2 = 1 - c^2/V^2.
void viscous_rhs(const Oscillator& oscillator, double N, double V, double r2, const double* y, double* dy,
                 double* J);

// Gives a train, whose speed, r2 and oscillator are set, these values of y: `viscous_values`, and `values`
// with f, a z from which eta follows as it does without viscosity, and s.
void set_viscous_values(Train& train, std::vector<double> y);

// A profile is measured by its psi alone.
const std::vector<double> units_of_psi{1, HUGE_VAL, HUGE_VAL, HUGE_VAL};

// As solve_train(), which calls it where the scene has viscosity.
Train solve_viscous_train(const Scene& scene, const TrainRequest& request, double tolerance);

}  // namespace stickslip
