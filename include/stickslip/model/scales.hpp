// What a velocity, a force, a state and a rate of a scene are measured by: a difference is small where it is
// small against these, whatever units the scene is written in.
//
//     least     the smallest scales, which errors of steps are parts of.
//       psi     the least of: five times the largest velocity of the plate (of a held end, where the plate
//               stands), or, where friction drops as slip begins and that is larger, what the drop gives a
//               lone node, drop/(B + sqrt((K0 + 2 K1/h^2)/A)); the law's own velocity (vs of stribeck, 1 of
//               the cubic); sqrt(A/K0) = f0/sqrt(k0 m) times the scale of eta, the velocity that such a force
//               gives to a mass on a spring (1/B without mass; k1 where k0 is 0); and sqrt(A K0) times the
//               law's own length (Dc, fc/sigma0). A law without a velocity of its own has none to give:
//               rate-and-state's psi0 says only where friction is mu0. 1 where there is none at all.
//       eta     the law's own force (its threshold, mu0, 1 of the cubic), times the largest amplitude along x
//               and the largest normal load
//       state   that of the law (Dc, fc/sigma0); 1 where it is a strength, a factor of friction, or the
//               logarithm of an age
//     slip      how fast slips are, and how large states: what motions are measured by where they are asked
//               whether they rest, repeat or stay. Rounded to powers of two, so that what is measured in them
//               loses no digit.
//       psi     |v| + sqrt(A/K0) (without mass |v| + 1/B; k1 where k0 is 0)
//       eta     1
//       state   psi/sqrt(A K0) where it is a length, a slip or a bristle; 1 where it is a number or a
//               logarithm
//     velocity  |v|; where the plate stands a 32nd of slip.psi
//     rate      that of a node by itself, sqrt(A K0), without mass K0/resistance (k1 where k0 is 0); where no
//               spring holds it, the rate at which a force of the least scale makes such a velocity, without
//               mass that of its state
//
// Powers of two in the units of length, time and force come out as such powers, to the last bit. Velocity;
// force over the friction amplitude; the stored state; 1/time. Of a medium that differs along x the mean.
// Nothing here communicates.
#pragma once

#include "stickslip/model/scene.hpp"

namespace stickslip {

struct Scene;

struct Scales {
  double psi = 1, eta = 1, state = 1;
  // The state is a logarithm, whose size says nothing: it changes with the unit of time.
  bool state_is_logarithm = false;
  double of(int component) const { return component == 0 ? psi : component == 1 ? eta : state; }
};

struct SceneScales {
  Scales least, slip;
  double velocity, rate;
  // Without mass B + F_psi of the first node's sliding at v; where that is no positive number B, or else a
  // force over a velocity of the scales. 0 with mass.
  double resistance = 0;
};

SceneScales scales_of(const Scene& scene);

// Motions that grow without bound: where the linear terms of a node drive its oscillation more than friction
// can hold it.
//
// In one node the deviation from sliding gains the energy -(A B + s delta)/A psi^2 a unit of time and loses F
// psi to friction, so that with A B + s delta < 0 (model_delta_sign printed) and friction that grows more
// slowly than psi everything beyond some size grows without bound, like exp(-(A B + s delta) t/2).

// A |psi|, length/time, beyond which a motion that oscillates grows without bound, on the safe side; infinite
// where friction or viscosity holds every motion.
double escape_velocity(const Scene& scene);

}  // namespace stickslip
