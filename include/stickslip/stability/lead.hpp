// The leading mode of steady sliding, as a function of the scene and of what is known of a place nearby.
//
// Where all modes are known in closed form, and in small matrices, nothing else is asked. Elsewhere the few
// modes that lead at another place, or nearly do, are followed to this one: w S(lambda) p = 0, with their
// left and right eigenvectors w and p, gives each eigenvalue with an error of second order in what has
// changed, and those that might lead are taken along by Rayleigh's quotient iteration on both eigenvectors,
// one banded factorisation a step, which cubes errors (Parlett, Mathematics of Computation 28 (1974) 679). A
// count of the modes further right says whether one is missing; it is sought where the count sees it, then by
// all means of compute_spectrum.
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "stickslip/stability/continuum.hpp"
#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

// The rightmost mode; psi empty where it comes from a dispersion relation.
struct LeadingMode {
  Mode mode;
  bool degenerate = false;  // others have the same growth rate
};

// Its real part; NaN where there is none.
inline double growth_of(const std::optional<LeadingMode>& leading) {
  return leading ? leading->mode.value.real() + 0. : std::numeric_limits<double>::quiet_NaN();  // + 0.: no -0
}

// A mode with its left eigenvector, as they were where the mode was polished last.
struct FollowedMode {
  Mode mode;
  std::vector<Complex> left;
};

// What is known of the modes about a place: those that lead there or nearly do, the leading one first. Empty
// where nothing is known, or where nobody needs to know it.
struct KnownModes {
  std::vector<FollowedMode> modes;
  bool sure = true;  // false: one was lost on the way here, or the count gave no answer
};

struct LeadSettings {
  bool refine = true;  // modes beyond the frequency that the grid resolves do not count
  // how far behind another mode, in parts of the frequency, one may be taken for the leading one
  double slack = 1e-7;
  // The sign need be right only: where a mode known grows, those that lead it are not sought, and elsewhere
  // only those that grow.
  bool only_sign = false;
};

// The leading mode; nothing where none is found. `counted`: none leads it, else it is the best of those
// known. `known`: guesses, which save work and, where it is counted, change no answer; they become what is
// known here. Collective over comm; every rank gets the same.
std::optional<LeadingMode> lead(MPI_Comm comm, const LinearisedOperator& J, KnownModes& known, bool counted,
                                const LeadSettings& settings);

// Adds modes known at another place to those known here, followed to this one.
void take_up(const LinearisedOperator& J, KnownModes& known, const std::vector<FollowedMode>& more,
             const LeadSettings& settings);

// The number of modes right of `a` that count; empty where an eigenvalue stands too near that line. `where`:
// as of count_right(). Collective.
std::optional<long> count_leading(MPI_Comm comm, const LinearisedOperator& J, double a, bool refine,
                                  std::vector<Complex>* where = nullptr);

// The answer without a grid, where there is one: of a continuum whose nodes are all alike, with `refine`.
std::optional<ContinuumLead> lead_without_grid(const LinearisedOperator& J, bool refine);
// Whether the leading mode is the largest of all in closed form; and whether it is followed at all.
bool all_known(const LinearisedOperator& J, bool refine);
bool is_followed(const LinearisedOperator& J, bool refine);

// As far right of a mode as it and the count may be wrong.
double count_margin(const LinearisedOperator& J, double frequency, double part = 1e-7);
// Growth rates closer than this are equal to round-off.
double same_growth(const LinearisedOperator& J);

}  // namespace stickslip
