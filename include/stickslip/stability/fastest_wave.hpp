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

#include "stickslip/model/linear_point.hpp"

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

}  // namespace stickslip
