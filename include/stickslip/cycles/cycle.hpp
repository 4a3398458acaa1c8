// Periodic oscillations (cycles) of a cell of nodes: what is known of one, whatever method found it.
//
// A cell is one node (uniform motion), m nodes that repeat round a ring, or a whole scene. Its unknowns stand
// node by node as in Model: psi, eta and, with a state law, the stored state (friction.hpp). psi is a
// velocity, eta a number, times have the unit of time. Nothing here communicates.
#pragma once

#include <petscsys.h>

#include <complex>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/continuation.hpp"

namespace stickslip {

// A stretch of time in which friction holds a node at psi = 0: 0 <= begin < period, end may lie in the next
// period.
struct Rest {
  PetscInt node;
  double begin, end;
};

struct Cycle {
  PetscInt nodes = 1;
  int dof = 2;  // unknowns a node
  double period = 0;
  int forcing_periods = 0;     // of the load, in one of the cycle; 0: the plate goes evenly
  std::vector<double> times;   // 0 = first < ... < last = period; dense where the motion is steep
  std::vector<double> states;  // (times, nodes, dof), row-major; the last equals the first
  std::vector<Rest> rests;     // exact stick only, in order of `begin`
  // Floquet multipliers: what becomes of a deviation in one period. Largest modulus first, complex ones as
  // neighbours, the phase mode's (1 but for the error) included: number phase_mode of the list, or of none
  // under a load, which sets the phase. Directions that a rest wipes out have the multiplier 0.
  std::vector<std::complex<double>> multipliers;
  std::size_t phase_mode = 0;

  double psi_min = 0, psi_max = 0;  // over the nodes and one period
  double amplitude = 0;             // half the largest range of psi at a node, as `run` has it
  double rest_fraction = 0;         // of the time, mean over the nodes
  double force_drop = 0;            // largest less least mean of eta over the nodes
  double residual = 0;              // of the equations, in units of psi and eta
  double error_estimate = 0;        // of the period, relative; not below round-off
  // Functions whose change of sign along a branch is a special point of that name, e.g. `graze`; beside those
  // that follow from the multipliers (branch.hpp).
  std::map<std::string, double> tests;

  double psi(std::size_t time, PetscInt node = 0) const { return at(time, node)[0]; }
  double eta(std::size_t time, PetscInt node = 0) const { return at(time, node)[1]; }
  // psi, eta[, state] of a node.
  const double* at(std::size_t time, PetscInt node) const {
    return &states[(time * std::size_t(nodes) + std::size_t(node)) * std::size_t(dof)];
  }
};

// Largest growth rate ln|multiplier|/period but for the phase mode's; -infinity where every other deviation
// is wiped out.
double growth_rate(const Cycle& cycle);

// The least psi of a node along v: where it is positive none ever stops, and friction that sticks is that of
// sliding throughout.
double least_along(const Cycle& cycle, double v);

// psi_min, psi_max, amplitude and force_drop from `states`, which must be dense enough to show them;
// rest_fraction from `rests`.
void measure(Cycle& cycle);

// Branches of cycles in one parameter (numerics/continuation.hpp), for any kind of cycle: of smooth friction,
// or with rests. Computed alike on every rank.

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
  virtual std::vector<double> halves() const { return {}; }  // of Look
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
