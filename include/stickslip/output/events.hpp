// The catalogue of slip events of a run.
//
// A node moves while psi is not 0 (friction that sticks) or while |psi| exceeds a velocity (any other
// friction). An event begins when a node moves that neither lies in nor stands beside the region of an event
// under way; whatever begins to move in or beside that region belongs to it, and events whose regions meet
// become one, which keeps the earlier beginning. It ends when nothing in its region moves. The region, all
// nodes that have moved, is connected.
//
// Starts and ends of friction that sticks are exact, since the steps are cut there; otherwise they are ends
// of steps. Integrals are taken over each step by Simpson's rule on the cubic of psi (error dt^4 relative to
// the event).
//
// Of a region of nodes i, of weight w = 1 in the chain and h in the continuum (h/2 at an end of the line),
// with the slip d_i = integral of psi_i while node i moves and the force eta before (eta0) and behind (eta1),
// in units of the friction amplitude. Before: when the event begins, also for nodes that it reaches later;
// events that have become one begin with the earlier. Where other events slip in or near the region between
// begin and end (they end before this one comes there, or go on a few nodes away, within the stencil), eta0
// contains what they do to eta until the end, K1 D2 d - K0 d of their slip d since the beginning and s delta
// psi/A of nodes that move in them then, so that what lies between before and behind is this event's own:
// with friction that sticks eta0 = eta1 - (K1 D2 - K0) d - K0 integral of v.
//     direction      1 or -1, the sign of sum w d_i; 0 where it is 0
//     extent         number of blocks; length in the continuum: nodes times h
//     slip           largest d_i along the direction        moment     |sum w d_i|
//     magnitude      ln(moment); NaN where it is 0
//     stress_drop    mean of eta0 - eta1, times the direction
//     strain_energy  sum w d_i (eta0 + eta1)/2, what the springs give away
//     friction_work  sum w integral of psi F
//     radiated       sum w integral of (B + s delta/A) psi^2 - psi N D2 psi, what damping and the viscosity
//                    between neighbours take: with neither nothing is radiated
//     kinetic        largest kinetic energy sum w psi^2/(2 A) on the way; of events that become one, that of
//                    the larger until then
// Asked for, each event also has the times at which its nodes first slipped, from which the speeds of its
// fronts follow (output/catalogue.hpp). With friction that sticks these times are exact; otherwise |psi| is
// taken to rise linearly within a step.
// A scene and its mirror image (v, loads, held values and starts negated) have the same events but for the
// direction. With friction that sticks strain_energy = friction_work + radiated but for what the plate does
// meanwhile, which is at most K0 |v| (end - begin) moment/2 where no node slips back, and but for nodes that
// a stencil of order 4 or 6 reaches from a held end, where D2 is not symmetric.
//
// Needs memory for two values a node for each event under way (those that begin together share them), and for
// one a node where ruptures are asked for.
//
// Every rank sees its own nodes, and all keep the same list of regions: a step costs two small messages all
// round, one of the stretches that begin to move and one of what the events under way add up, and where
// events end one more, with the nodes beside a rank's own. The same on any number of ranks but for round-off
// in sums.
#pragma once

#include <petscvec.h>

#include <functional>
#include <memory>
#include <vector>

#include "stickslip/model/scene.hpp"
#include "stickslip/output/checkpoint.hpp"

namespace stickslip {

struct SlipEvent {
  double begin = 0, end = 0;
  // first node to move, left end of the region (round the ring), its nodes
  PetscInt first = 0, left = 0, count = 0;
  int direction = 0;
  double slip = 0, moment = 0, stress_drop = 0, strain_energy = 0, friction_work = 0, radiated = 0,
         kinetic = 0;
  // where asked for: when each node of the region first slipped, from `left` on
  std::vector<double> rupture = {};
};

class Events {
 public:
  // `velocity`: above it a node moves; 0 for friction that sticks. `nodes`: of this rank. Collective.
  Events(const Scene& scene, double velocity, const NodeRange& nodes, bool ruptures = false);
  Events(const Scene& scene, double velocity);                                // this rank has all nodes
  Events(Events&&) noexcept;
  ~Events();

  // The fields psi, eta (and the stored state) of this rank's nodes at t; the first call is the start.
  // Collective.
  void step(double t, const std::vector<std::vector<double>>& fields);
  // Node by node, dof of a node. `middle`: gives the same in the middle of the step, of friction that is
  // stiff (else what nodes go through is the cubic through their values and slopes); asked for where an event
  // is under way, on all ranks.
  void step(double t, Vec u, int dof, const std::function<Vec()>& middle = nullptr);
  // What has ended since the last call, in order of the ends; the same on every rank.
  std::vector<SlipEvent> ended();
  long count() const;  // ended so far

  void archive(Archive& a);  // everything under way; collective

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stickslip
