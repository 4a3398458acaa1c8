// Where steady sliding loses stability: the zeros of its growth rate in one option, and the curve of zeros in two.
#pragma once

#include <petscsys.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/growth_rate.hpp"

namespace stickslip {

// The growth rate sampled evenly: `side` values on each axis, the first axis fastest; NaN without steady sliding.
struct Samples {
  int side = 0;
  std::vector<double> growth;
};

// Every zero on the first axis, ascending in the coordinate. `notes`: what is not as it should be. Collective.
std::vector<Crossing> boundary_points(GrowthRate& growth, Samples& samples, std::vector<std::string>& notes);

// The curve in the box of both axes: about `points` points, even along it in the coordinates, ends on the borders of
// the box included; several pieces, closed ones too. `notes`: why a piece ended inside the box. `meetings`:
// the places (codimension two) where one mode takes over from another of different kind or frequency. Collective.
std::vector<Crossing> boundary_curve(GrowthRate& growth, PetscInt points, Samples& samples,
                                     std::vector<std::string>& notes, std::vector<Crossing>* meetings = nullptr);

// What time integration of the full system finds beside the curve.
struct Verified {
  double value = 0, value2 = 0;  // of the options
  double growth = 0;             // growth rate there
  std::string expected;          // what the linear answer says: sliding or stick-slip
  std::string from_sliding;      // regime reached from slightly perturbed sliding: sliding, stick-slip, undecided
  std::string from_stick_slip;   // the same from large oscillations
  std::string regime;            // both the same, or `both live` (hysteresis), or undecided
};

// `count` points of the curve, each checked on its unstable and its stable side; `before_each` gets the number of the
// check and of all. Collective over PETSC_COMM_WORLD.
std::vector<Verified> verify_boundary(GrowthRate& growth, const std::vector<Crossing>& points, PetscInt count,
                                      const std::function<void(std::size_t, std::size_t)>& before_each = {});

// The regime that a scene reaches in the time given, from psi = steady + amplitude (1 + cos(k x))/2. Collective.
std::string regime_from(const Options& options, const Sliding& sliding, double amplitude, double k, double duration);

// The plate velocity at which uniform sliding loses stability, in closed form, for the laws of velocity alone without
// spread: sqrt(1 - s delta/gamma), sqrt(1 - zeta/f0), sqrt(f0/zeta) - 1. Nothing for other scenes, or where there is
// none.
std::optional<double> closed_form_velocity(const Scene& scene);

}  // namespace stickslip
