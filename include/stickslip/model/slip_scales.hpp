// How fast slips of a scene are, and how large its states: what motions are measured by where they are asked
// whether they rest, repeat or stay, so that no answer depends on the units of the scene.
//
//     psi    |v| + sqrt(A/K0), the plate's velocity and the one that a friction force gives to a mass on its
//            spring, f0/sqrt(k0 m) (k1 where k0 is 0; without mass |v| + 1/B); 1 where all are 0
//     state  psi/sqrt(A K0) where it is a length, a slip or a bristle; 1 where it is a number or a logarithm
// rounded to powers of two, so that what is measured in them loses no digit and is the same in any units. eta
// is a number of its own. The mean medium's. Nothing here communicates.
#pragma once

namespace stickslip {

struct Scene;

struct SlipScales {
  double psi = 1, state = 1;
  double of(int component) const { return component == 0 ? psi : component == 2 ? state : 1; }
};

SlipScales slip_scales(const Scene& scene);

}  // namespace stickslip
