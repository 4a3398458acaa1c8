// The fastest growing wave of the continuum itself, whatever the grid, where all its nodes are alike.
//
// A wave of wavenumber k grows like exp(lambda t) with
//     (lambda^2/A + beta lambda + K) (lambda + r) + q lambda = 0,   K = K0 + K1 k^2
// (sliding.hpp; without a state only the first bracket). Solved for K this is a function K(lambda), so that a
// real root moves with K at the rate 1/K'(lambda): one way, until it meets another. Where the roots meet from
// the side of real ones, the larger comes down to the meeting, so that the growth rate has no maximum there.
// And since the three roots add up to -(A beta + r), the real part of an oscillating pair moves with K as
// -1/2 of the real root does: one way, too. The growth rate as a function of K therefore has no maximum
// inside any interval. Its supremum is that of the longest wave, or the limit of short ones, max(-A beta/2,
// -r): a closed question, not a search.
//
// With viscosity between neighbours, beta + N k^2 for beta, short waves tend to max(-K1/N, -r). Without a
// state an oscillating wave grows at -A (beta + N k^2)/2 and a real root moves with k^2 one way, towards
// -K1/N: the longest wave leads, or the limit. With a state a wave between may lead, the fastest of those
// that fit (fastest_wave.hpp).
#pragma once

#include <optional>

#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip {

struct ContinuumLead {
  double growth = 0;  // the supremum over all waves, 1/time
  // of the wave that has it, 1/time; infinite where short oscillating waves approach it
  double frequency = 0;
  // the smallest one that has it, 1/length; infinite where it is approached as k grows
  double wavenumber = 0;
  bool degenerate = false;  // other waves have it too, to 1e-9 of a frequency of the scene
};

// Over all whole waves of a ring, all standing waves between free ends or ends held at v (odd about a held
// end, even about a free one). Empty in the chain, whose blocks are the matter, and where nodes differ. Not
// collective.
std::optional<ContinuumLead> continuum_lead(const LinearisedOperator& J);

// The frequency of all springs at a node, of K0 + K1 in the chain, of K0 in the continuum, where K1 has
// another unit; where there is none the scene's own rate.
double spring_frequency(const LinearisedOperator& J);
// The slower of the rates that springs and damping of the mean medium give, w^2/(w + |C|) with w the
// frequency of all springs: beside it growth rates are small or large, whatever the unit of time.
double own_rate(const LinearisedOperator& J);
// The size of the damping C of the mean medium, for tolerances; 0 without mass, where growth has that unit
// alone.
double damping_scale(const LinearisedOperator& J);

}  // namespace stickslip
