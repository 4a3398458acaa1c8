// Meshes of one period of a periodic function, and its values on them: interval by interval the left node and
// the Gauss points, d values each. Phases run from 0 = mesh[0] to mesh[N] = 1. Local to the process.
#pragma once

#include <cstddef>
#include <vector>

#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

constexpr int mesh_stages = 5;  // Gauss points an interval

// y (d values) at any phase, taken modulo 1, from values x on a mesh: at the points of `method`.
void evaluate(const Collocation& method, const std::vector<double>& mesh, const double* x, int d,
              double phase, double* y);

// The size of the derivative of order mesh_stages + 1 on each interval, each component by its own range: from
// the jumps of the derivative of order `mesh_stages` between neighbours.
std::vector<double> roughness(const std::vector<double>& mesh, const double* x, int d);

// Mesh of `intervals` intervals that carry equal shares of roughness^(1/(mesh_stages + 1)).
std::vector<double> equidistribute(const std::vector<double>& mesh, const std::vector<double>& rough,
                                   size_t intervals);

// How many intervals make the interpolation error `error` of the range, once they are spread so.
double intervals_for(const std::vector<double>& mesh, const std::vector<double>& rough, double error);

// A mesh that carries nearly equal shares already, and about as many intervals as make that error: no better
// one is needed.
bool suits(const std::vector<double>& mesh, const std::vector<double>& rough, double error);

std::vector<double> halved(const std::vector<double>& mesh);

// How many points a mesh has on which values stand.
inline std::size_t points_on(const std::vector<double>& mesh) {
  return (mesh.size() - 1) * (mesh_stages + 1);
}

// Largest less least of each of the d components of `points` values.
std::vector<double> ranges(const double* x, std::size_t points, int d);

// Of one component at all points: its value `part` of the way through an interval, and its largest (sign 1)
// or least (-1) over the period, between the points too.
double value_within(const std::vector<double>& values, std::size_t interval, double part);
double extremum(const std::vector<double>& values, int sign);

}  // namespace stickslip
