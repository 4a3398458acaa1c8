// All uniform motions of a chain that no spring ties to the plate (k0 = 0).
//
// The mean force of such a chain stays what it was at the start, on a ring and between free ends, and every
// velocity with
//     B psi + F_ss(psi) = stress
// is one at which it may slide: several where F_ss rises, falls and rises again (n-shaped friction). One that
// falls with velocity, B + dF_ss/dpsi < 0, is unstable to uniform changes; of the others each has its own
// waves. A front may run between two of them, since it leaves the force as it finds it.
//
// Not collective.
#pragma once

#include <optional>
#include <vector>

#include "stickslip/model/scene.hpp"

namespace stickslip {

struct UniformState {
  double psi = 0;
  std::optional<double> state;  // of the contact, as files show it
  double slope = 0;             // B + dF_ss/dpsi
  bool rests = false;           // held by friction with a threshold: no growth rate
  double growth_rate = 0;       // largest over the scene's waves, 1/time; the shift of the whole excepted
  double frequency = 0, wavenumber = 0;
  bool stable = false;
};

// Whether the scene is such a chain, uniform and without held ends.
bool has_uniform_states(const Scene& scene);

// Every one between 1e-290 and 1e8 of a slip's scale (model/scales.hpp), of either sign, and at rest, in
// ascending order of psi; of those nearer to each other than a sixteenth of a decade two may be missed.
// `stress`: the force over the friction amplitude.
std::vector<UniformState> uniform_states(const Scene& scene, double stress);

}  // namespace stickslip
