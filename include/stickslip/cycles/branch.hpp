// Branches of cycles: pseudo-arclength continuation in one parameter, for any kind of cycle that can be
// solved for along a direction (CyclePath), with the special points on the way.
//
// Source: H. B. Keller, in Applications of Bifurcation Theory, Academic Press 1977, 359-384; Yu. A.
// Kuznetsov, Elements of Applied Bifurcation Theory, Springer 2004, sections 4.4, 5.3 and 10.2. Computed
// alike on every rank.
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

// The cycles of a family beside the one where a branch stands.
class CyclePath : public BranchPath {
 public:
  virtual Cycle cycle() const = 0;      // the candidate
  virtual Place direction() const = 0;  // the tangent that was asked for last, once more
  // Where go() has thrown last since the cycle is of another kind there: the kind of special point between.
  virtual std::string ends() const { return ""; }
  // A path of another family, at() of its parameter, which has a cycle near `from`: go() starts there from a
  // mixture of candidates, this one with the weight that the others leave of 1. These are paths of the same
  // kind.
  using Others = std::vector<std::pair<const CyclePath*, double>>;
  virtual std::unique_ptr<CyclePath> beside(std::function<Scene(double)> at, double from, double range,
                                            const Others& others = {}) const = 0;
};

// A special point, between two points of the branch, located to 1e-8 of the parameter's range. Kinds:
//   fold             the parameter turns round (a multiplier passes 1)
//   flip             a multiplier passes -1: the period doubles
//   torus            a complex pair passes |mu| = 1
//   hopf             the amplitude vanishes: steady sliding; the branch ends
//   infinite-period  the period grows without bound: the branch ends; the parameter's limit, to 1e-8 of
//                    its range
//   long-wave        the phase diffusion changes its sign
//   wave             a wave of finite length begins or ceases to grow while long ones decay: `wavenumber`
//   graze            a slip just reaches rest: the branch of a cycle with rests ends, or of one under a load
//                    that never rests
//   pass             a slip swings back and just stops, or passes psi = 0 into the next: likewise
//   release          the force on a node at rest just reaches its threshold: likewise
//   order            two nodes start or stop at the same time, on either side of it one after the other: here
//                    too the branch ends
//   branch           a multiplier passes 1 and the parameter does not turn: other cycles branch off
// and the names of Cycle::tests.
struct SpecialPoint {
  std::string kind;
  double value = 0;  // of the parameter
  double period = 0;
  double wavenumber = 0;  // of `wave`
  std::size_t after = 0;  // it lies behind this point of the branch
};

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

// How far a branch is followed: to its end, or only to the first special point behind which a cycle does not
// attract any more. The path's candidate is that point then, with its tangent, and it is the one special
// point that is listed.
enum class Follow { whole, while_stable };

// Follows the branch from where `path` stands, whose cycle is `first`, towards the value `to` of the
// parameter `name`, which stands at `from`, in at most `steps` steps. Ends at `to`, at a Hopf point or an
// infinite period, where the parameter comes back past its start, where no cycle is found further on, or
// after `steps`.
CycleBranch continue_cycle(CyclePath& path, const Cycle& first, const std::string& name, double from,
                           double to, int steps, const CycleWatch& watch = nullptr,
                           Follow follow = Follow::whole);

// A function of a path's candidate that is zero at a special point of this kind (fold, flip, torus, branch,
// or a name of Cycle::tests) and smooth about it; NaN where the cycle has no multiplier that could pass
// there.
double special_test(const std::string& kind, CyclePath& path, const Place& row);

// The special point of this kind on a path that starts nearly there (beside()): the path's candidate then.
// `slope`: that of special_test along the branch there, if known, else NaN; afterwards that at the new point.
// Returns its parameter, or NaN where there is none within 0.2 along the branch.
double settle_on_special(const std::string& kind, CyclePath& path, double range, double& slope);

}  // namespace stickslip
