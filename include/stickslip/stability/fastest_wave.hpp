// The growth rate of uniform steady sliding: that of the fastest of the waves that fit a scene, in closed
// form.
//
// A wave of wavenumber k in a medium alike everywhere has the roots of a polynomial p(lambda; kappa^2) of
// degree one to three (linear_point.hpp), kappa^2 the symbol of -D2, and every coefficient is linear in
// kappa^2. So are those of p(lambda + sigma; kappa^2), and by Routh and Hurwitz a root with a real part above
// sigma comes or goes only where one of two of them, or c2 c1 - c0, changes its sign: at four values of
// kappa^2 at most, roots of equations of degree one and two. Between two of them either every wave grows
// faster than sigma or none does. One wave looked at in each stretch says which; a faster one raises sigma,
// and where none is left the fastest is found, be there ten waves or 10^12.
//
// Everything that speaks of the growth of uniform sliding asks here: `run` and its files, `spectrum`,
// `boundary`, the states of chains without k0. Nothing communicates.
#pragma once

#include <complex>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip {

// The wavenumbers k_j = factor (first + j)/span, j = 0, 1, ... count - 1, of waves that fit a line.
struct Waves {
  double factor = 0, first = 0, span = 1;  // 1, 1, length
  std::int64_t count = 0;
  int order = 2;
  double h = 1;  // the grid's spacing, length; 0: no grid, the symbol of -D2 is k^2

  double k(std::int64_t j) const { return first + double(j) == 0 ? 0 : factor * (first + double(j)) / span; }
  double kappa2(std::int64_t j) const;
  // The first from `from` on whose symbol is at least kappa2; `count` where none is.
  std::int64_t first_beyond(double kappa2, std::int64_t from = 0) const;

  // Those of a scene's own grid: whole waves on a ring; else standing ones, even about a free end and odd
  // about a held one. In the chain a free end lies half a spacing beyond its block. Exact where D2 is
  // symmetric (ring, free ends, order 2).
  static Waves of(const Scene& scene);
  // The same in the continuum without a grid, as many as asked for.
  static Waves of_continuum(const Scene& scene, std::int64_t count);
  // The first of them, up to the wavenumber that the grid resolves; in the chain all.
  Waves resolved(const Scene& scene) const;
};

// The largest wavenumber whose frequency the stencil has to 1 %, 1/length; that of the grid where it has them
// all so.
double resolved_wavenumber(int order, double h);

struct FastestWave {
  std::complex<double> value;  // lambda, Im >= 0, 1/time
  double wavenumber = 0;       // 1/length
  std::int64_t index = 0;      // of the wave
  bool degenerate = false;     // others grow as fast
};

// The rightmost root of a wave; nothing where it has none. Where nothing pulls a wave back (K0 = 0, k = 0)
// its root 0, the shift of everything, does not count.
std::optional<std::complex<double>> rightmost_root(const LinearPoint& medium, double kappa2);

// The fastest of the waves, from number `from` on; of those that grow alike, to `level` (1/time), the
// longest. Nothing where no wave has a root.
std::optional<FastestWave> fastest_wave(const LinearPoint& medium, const Waves& waves, double level,
                                        std::int64_t from = 0);

// The wave of first ... last that grows fastest on a motion, where each has to be asked for its growth rate:
// of all of the first hundred, further on of every fiftieth part; with `neighbours` then of those beside the
// fastest of these.
template <class Rate>
std::int64_t fastest_of(std::int64_t first, std::int64_t last, Rate&& rate, bool neighbours) {
  constexpr std::int64_t all_of_first = 100, part = 50;
  std::int64_t best = first;
  double largest = -std::numeric_limits<double>::infinity();
  const auto look = [&](std::int64_t j) {
    const double here = rate(j);
    if (!(here > largest)) return false;
    largest = here;
    best = j;
    return true;
  };
  const auto step_from = [](std::int64_t j) { return j < all_of_first ? 1 : j / part; };
  for (std::int64_t j = first; j <= last; j += step_from(j)) look(j);
  for (std::int64_t step = neighbours ? step_from(best) : 1; step > 1;) {
    step = (step + 1) / 2;
    while (best + step <= last && look(best + step)) continue;
    while (best - step >= first && look(best - step)) continue;
  }
  return best;
}

// Whether steady sliding is psi = v: no end is held away from it. And whether the force is the same
// everywhere too, as friction is.
bool slides_at_v(const Scene& scene);
inline bool slides_uniformly(const Scene& scene) { return scene.nodes_alike() && slides_at_v(scene); }

// The medium of uniform sliding at psi = v where friction is the same at every node; nothing where there is
// no such sliding: the state has no steady value, or friction jumps at v = 0.
std::optional<LinearPoint> sliding_medium(const Scene& scene);

// Growth rates that differ by less are called equal: 1e-9 of a frequency of the medium.
double same_growth(const LinearPoint& medium);

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
