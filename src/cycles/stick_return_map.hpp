// The return map of friction that sticks and its fixed points; see stick_cycle.hpp.
#pragma once

#include <complex>
#include <optional>
#include <string>
#include <vector>

#include "cycles/stick_motion.hpp"
#include "stickslip/cycles/stick_cycle.hpp"

namespace stickslip {

// One time round: from a release to as many releases later as `from.releases` says.
struct StickReturnMap {
  StickState at;  // right after that release, with the deviations that were asked for
  double period = 0;
  std::string sequence;
  double depth = 0, clearance = 0;  // see StickCycle; depth with `turns`
  double excess = 0;                // see StickState
  std::vector<Rest> rests;
};
struct StickReturnMapOptions {
  std::vector<double> deviations = {};  // at the start, right after the release, each as long as the unknowns
  bool turns = false;
  StickMotion::Passed passed = nullptr;
  // Is called right after the release with the directions as they are, and at each change with those before
  // it.
  std::function<void(const std::vector<double>& was, const StickState& now)> changed = nullptr;
};

// Under a load: from its section on, over its periods.
//
// From `from.start` with eta of the node set to its threshold. Throws Failure where the node does not start
// there, or the motion does not come back.
StickReturnMap return_map_of(const StickMotion& motion, const StickCycle& from,
                             const StickReturnMapOptions& wishes);

// The coordinates that tell points of the section apart: all unknowns but those of held nodes, and psi and
// eta of the node that is released (under a load, all but psi of those that rest there).
std::vector<std::size_t> free_unknowns(const StickMotion& motion, const StickCycle& cycle);
std::vector<double> free_values(const StickMotion& motion, const StickCycle& cycle);
void set_free_values(const StickMotion& motion, const std::vector<double>& values, StickCycle& cycle);

// The return map in these coordinates: what comes back, and its derivative, row-major. Throws Failure as
// return_map_of().
struct MapAt {
  StickReturnMap round;
  std::vector<double> image, slopes;
};
MapAt map_at(const StickMotion& motion, const StickCycle& cycle);
// Sets what is known of a cycle whose start is a fixed point.
void close_cycle(const StickMotion& motion, StickCycle& cycle);

// The fixed point near a guess, by Newton's method. Throws Failure.
StickCycle polished(const StickMotion& motion, const StickCycle& guess);

// The places of the unknowns of nodes that are not held.
std::vector<std::size_t> moving_unknowns(const StickMotion& motion);
// The matrix that takes deviations of those right after the release round the cycle, column by column.
std::vector<double> monodromy_matrix(const StickMotion& motion, const StickCycle& cycle);

// Its eigenvalues, largest modulus first.
std::vector<std::complex<double>> multipliers_of(std::size_t size, const std::vector<double>& map);
// The cycle near what a motion has come to: made exact, and the shorter one where it has repeated within its
// releases (its periods of the load), as it seems to beside a doubling. Nothing where it is far from there;
// throws Failure as polished().
std::optional<StickCycle> cycle_near(const StickMotion& motion, const StickCycle& near);
// Of the deviation that grows most, or of that along the motion, which stays: the logarithm.
double growth_in_period(const StickMotion& motion, const StickCycle& cycle);

}  // namespace stickslip
