// What a motion settles on: it is followed from passage to passage of a section, until one of the last
// passages comes again and the cycle since then, made exact, attracts. Local to the process.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "stickslip/numerics/linear_systems.hpp"

namespace stickslip {

// Sliding that loses or gains less than this in a turn of the motion is neither stable nor unstable.
constexpr double no_growth = 1e-6;
// Off sliding that is unstable a motion is pushed by so much of its size, along the deviation that grows
// most: it is not what the motion settles on.
constexpr double push_off = 1e-3;

// That deviation and its growth rate, from the Jacobian of the rates there, d by d, row-major.
inline Eigenpair leading_deviation(int d, const std::vector<double>& J) {
  std::vector<double> columns(J.size());
  for (std::size_t k = 0; k < J.size(); ++k)
    columns[k % std::size_t(d) * std::size_t(d) + k / std::size_t(d)] = J[k];
  return eigenpairs(d, columns).front();
}

constexpr int most_returns = 12;  // passages within a cycle: one of more is not looked for

struct SettleLimits {
  double passages;  // that are waited for
  double near;      // the return, in sizes of the motion, from which on a cycle is looked for
  bool repelling;   // one that repels is an answer too where the motion settles on no other
};

template <class Cycle>
struct Settled {
  std::optional<Cycle> cycle;
  double nearest = std::numeric_limits<double>::infinity();  // return
};

// A `Motion` has
//   Cycle            what is looked for
//   pass()           on to the next passage; false where there is none any more: it knows what it came to
//   returned(back)   how far it is from where it was `back` passages ago, in its sizes; infinite where these
//                    cannot be compared
//   close(back)      the exact cycle near the motion since then, of its shortest period; nothing where there
//                    is none
//   growth(cycle)    of the deviation from it that grows most, in a period: the logarithm
//
// Beside a fold a motion lingers where Newton's method finds the cycle that repels: that one is taken only
// where the motion stays. What only seems to repeat does so for long: it is looked at again where it has come
// nearer by a factor.
template <class Motion>
Settled<typename Motion::Cycle> settle(Motion& motion, const SettleLimits& limits) {
  constexpr double stays = 1e-6;    // return of a motion that is on its cycle, whatever the multipliers
  constexpr double repels = 1e-6;   // growth in a period, of what is not neutral but for round-off
  constexpr double nearer = 0.25;
  Settled<typename Motion::Cycle> result;
  double tried = limits.near;
  for (double passed = 0; passed < limits.passages && motion.pass(); ++passed) {
    for (int back = 1; back <= most_returns; ++back) {
      const double returned = motion.returned(back);
      result.nearest = std::min(result.nearest, returned);
      if (!(returned < tried)) continue;
      if (auto found = motion.close(back)) {
        const bool attracts = returned < stays || motion.growth(*found) < repels;
        if (attracts || limits.repelling) result.cycle = std::move(found);
        if (attracts) return result;
      }
      tried = nearer * returned;
    }
  }
  return result;
}

}  // namespace stickslip
