// Meshes of one period of a train, and profiles on them: interval by interval the left node and the Gauss points, dim
// values each, as PeriodicMotion and TrainEquations have them. Phases run from 0 = mesh[0] to mesh[N] = 1. Not collective.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

constexpr int train_stages = 5;   // Gauss points an interval
constexpr int train_max_dim = 3;  // f, z and the state

// Writes y = (f, z[, s]) at a phase; room for train_max_dim values.
using Profile = std::function<void(double phase, double* y)>;

// y (d values) at any phase, taken modulo 1, from values x on a mesh: at the points of `method`.
void evaluate(const Collocation& method, const std::vector<double>& mesh, const double* x, int d, double phase,
              double* y);

// The size of the derivative of order train_stages + 1 on each interval, each component by its own range: from the
// jumps of the derivative of order `train_stages` between neighbours.
std::vector<double> roughness(const std::vector<double>& mesh, const double* x, int d);

// Mesh of `intervals` intervals that carry equal shares of roughness^(1/(train_stages + 1)).
std::vector<double> equidistribute(const std::vector<double>& mesh, const std::vector<double>& rough, size_t intervals);

// How many intervals make the interpolation error `error` of the range, once they are spread so.
double intervals_for(const std::vector<double>& mesh, const std::vector<double>& rough, double error);

std::vector<double> halved(const std::vector<double>& mesh);

}  // namespace stickslip
