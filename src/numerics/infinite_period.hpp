// Where the parameter of a branch goes to as the period grows without bound.
//
// With T the period, the parameter lambda differs from its limit by powers of T (1/T where loading takes ever
// longer, 1/T^2 where a place of rest is born on the cycle, and higher ones that go with them) or by
// exp(-T/...) (where the cycle passes a place of rest ever nearer). At T, T/r, T/r^2, ... the powers are
// geometric sequences, which Wynn's epsilon algorithm sums whatever the powers are, and the exponentials have
// died out.
//
// Source: P. Wynn, On a device for computing the e_m(S_n) transformation, MTAC 10 (1956) 91. Local to the
// process.
#pragma once

#include <optional>
#include <vector>

namespace stickslip {

struct InfinitePeriodLimit {
  double value, error;
};
// Of the points of a branch, the last of which has the largest period of all behind the last turn of the
// period. Nothing where these do not span a factor of ten or the parameter does not settle.
std::optional<InfinitePeriodLimit> infinite_period_limit(const std::vector<double>& periods,
                                                         const std::vector<double>& values);

}  // namespace stickslip
