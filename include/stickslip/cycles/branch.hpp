// Branches of cycles in one parameter (numerics/continuation.hpp), for any kind of cycle: of smooth friction,
// or with rests. Computed alike on every rank.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/continuation.hpp"

namespace stickslip {

// A cycle as a point of its branch is seen.
struct CycleLook : Look {
  Cycle cycle;
  double growth_rate = 0;  // largest, the phase mode left out; with `watch`: its waves' too
};

// The cycles of a cell in one parameter.
class CycleFamily : public Family {
 public:
  virtual Cycle cycle() const = 0;      // the candidate
  virtual Place direction() const = 0;  // the tangent that was asked for last, once more
  std::shared_ptr<Look> look() override;
  Words words() const override { return {"cycle", "cycle_steps", ": steady sliding"}; }
  Ending ending(const Look& last) const override;
  // Another family, at() of its parameter, which has a cycle near `from`: solve() starts there from a mixture
  // of candidates, this one with the weight that the others leave of 1. These are of the same kind.
  using Others = std::vector<std::pair<const CycleFamily*, double>>;
  virtual std::unique_ptr<CycleFamily> beside(std::function<Scene(double)> at, double from, double range,
                                              const Others& others = {}) const = 0;

 protected:
  explicit CycleFamily(double range) : range_(range) {}
  // Where solve() has thrown last since the cycle is of another kind there: the kind of special point
  // between.
  virtual std::string ends() const { return ""; }
  double range_;  // of the parameter
};

// Special points of cycles (SpecialPoint), beside those of every branch:
//   long-wave        the phase diffusion changes its sign
//   wave             a wave of finite length begins or ceases to grow while long ones decay: `wavenumber`
//   graze            a slip just reaches rest: the branch of a cycle with rests ends, or of one under a load
//                    that never rests
//   pass             a slip swings back and just stops, or passes psi = 0 into the next: likewise
//   release          the force on a node at rest just reaches its threshold: likewise
//   order            two nodes start or stop at the same time, on either side of it one after the other: here
//                    too the branch ends
// and the names of Cycle::tests. At `hopf` the motion is steady sliding.

struct CyclePoint {
  double value = 0;
  Cycle cycle;
  bool stable = false;     // with `watch`: to its waves too
  double growth_rate = 0;  // largest, the phase mode left out
  double wavenumber = 0;   // which grows so; 0 without waves
};

struct CycleBranch {
  std::vector<CyclePoint> points;
  std::vector<SpecialPoint> special;
  std::string end;  // why it ends, in words
};

// What is said of every cycle of a branch besides its own multipliers, and functions whose changes of sign
// are special points: `long-wave` and `wave`.
struct Watched {
  bool stable = false;
  double growth_rate = 0, wavenumber = 0;
  std::map<std::string, double> tests;
};
using CycleWatch = std::function<Watched(double value, const Cycle& cycle)>;

// Follows the branch of a cycle (numerics/continuation.hpp).
CycleBranch continue_cycle(CycleFamily& family, const Way& way, const CycleWatch& watch = nullptr,
                           Follow until = Follow::whole);

}  // namespace stickslip
