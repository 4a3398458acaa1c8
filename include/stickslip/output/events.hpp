// The catalogue of slip events of a run.
//
// A node moves while psi is not 0 (friction that sticks) or while |psi| exceeds a velocity (any other friction). An
// event begins when a node moves that neither lies in nor stands beside the region of an event under way; whatever
// begins to move in or beside that region belongs to it, and events whose regions meet become one, which keeps the
// earlier beginning. It ends when nothing in its region moves. The region, all nodes that have moved, is connected.
//
// Starts and ends of friction that sticks are exact, since the steps are cut there; otherwise they are ends of steps.
// Integrals are taken over each step by Simpson's rule on the cubic of psi (error dt^4 relative to the event).
//
// Of a region of nodes i, of weight w = 1 in the chain and h in the continuum, with the slip d_i = integral of psi_i
// and the force eta before (eta0) and behind (eta1), in units of the friction amplitude. Before: when the event begins,
// also for nodes that it reaches later; events that have become one begin with the earlier. Where other events have
// slipped in or near the region meanwhile (they ended before this one came there, or go on a few nodes away, within the
// stencil), eta0 contains what their slip did, K1 D2 d - K0 d, so that what lies between before and behind is this
// event's own.
//     extent         number of blocks; length in the continuum: nodes times h
//     slip           largest d_i                            moment     sum w d_i
//     magnitude      ln(moment); NaN where it is not positive
//     stress_drop    mean of eta0 - eta1
//     strain_energy  sum w d_i (eta0 + eta1)/2, what the springs give away
//     friction_work  sum w integral of psi F
//     radiated       sum w integral of (B + s delta/A) psi^2 - psi N D2 psi, what damping and the viscosity between
//                    neighbours take: with neither nothing is radiated
//     kinetic        largest kinetic energy sum w psi^2/(2 A) on the way; of events that become one, that of the
//                    larger until then
// With friction that sticks strain_energy = friction_work + radiated but for what the plate does meanwhile, which is at
// most K0 |v| (end - begin) moment/2 where no node slips back.
//
// Needs memory for two values a node for each event under way (those that begin together share them).
//
// Works on whole fields, on the rank that has them; not collective.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "stickslip/output/field.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

struct SlipEvent {
  double begin = 0, end = 0;
  PetscInt first = 0, left = 0, count = 0;  // first node to move, left end of the region (round the ring), its nodes
  double slip = 0, moment = 0, stress_drop = 0, strain_energy = 0, friction_work = 0, radiated = 0, kinetic = 0;
};

class Events {
 public:
  // `velocity`: above it a node moves; 0 for friction that sticks.
  Events(const Scene& scene, double velocity);

  // The fields psi, eta (and the stored state) of all nodes at t; the first call is the start.
  void step(double t, const std::vector<std::vector<double>>& fields);
  // What has ended since the last call, in order of the ends.
  std::vector<SlipEvent> ended();
  long count() const { return count_; }  // ended so far

  // The columns of the table, without its time, the end; and the row of an event.
  static std::vector<Field> columns();
  std::vector<double> row(const SlipEvent& event) const;

  // Everything under way, for a checkpoint.
  std::map<std::string, std::vector<double>> save() const;
  void restore(const std::map<std::string, std::vector<double>>& saved);

 private:
  // All nodes when an event begins: eta, and how far each had slipped in events until then.
  struct Before {
    std::vector<double> eta, slipped;
  };
  struct Live {
    SlipEvent event;
    double kinetic_now = 0;
    std::vector<PetscInt> nodes;
    bool moves = false;
    std::shared_ptr<const Before> before;
  };
  bool moves(std::size_t i, const std::vector<std::vector<double>>& fields) const;
  int owner_beside(std::size_t i, int step) const;
  void claim(std::size_t i, std::shared_ptr<const Before>& now);
  void join(int kept, int taken);
  void find_viscous_forces(double dt, const std::vector<std::vector<double>>& now);
  double middle(std::size_t i, double dt, const std::vector<std::vector<double>>& now) const;
  double force(std::size_t i, double psi, double state, double direction) const;
  void accumulate(std::size_t i, Live& live, double dt, const std::vector<std::vector<double>>& now);
  void accumulate_side_by_side(std::size_t first, std::size_t count, Live& live, double dt,
                               const std::vector<std::vector<double>>& now);
  void forces_at(std::size_t first, std::size_t count, const double* psi, const double* state, const double* direction,
                 double* F) const;
  void find_moving(const std::vector<std::vector<double>>& now);
  void accumulate_moving(double dt, const std::vector<std::vector<double>>& now);
  double eta_before(PetscInt node, int id, const Before& before) const;
  void finish(int id);

  Scene scene_;
  double velocity_, weight_, damping_;
  std::vector<double> amplitude_;
  Frictions friction_;
  std::function<void(PetscInt, PetscInt, const double*, const double*, double*)> forces_;  // of nodes side by side
  double A_, B_;
  std::vector<Combination> d2_;       // rows of N D2, where neighbours have viscosity
  std::array<std::vector<double>, 3> viscous_;  // then N D2 psi at the beginning, in the middle and at the end of a step
  bool started_ = false;
  double t_ = 0;
  std::vector<std::vector<double>> last_;
  std::vector<int> owner_;            // event under way in whose region a node is; -1: none
  std::vector<double> slip_;          // of a node in a region: in this event
  std::vector<double> slipped_;       // of any node: in all events so far
  std::vector<double> last_force_;    // friction at the end of the last step of nodes that moved in it
  std::vector<unsigned char> moving_, moved_;  // which nodes move in the step under way, and did in the last one
  std::map<int, Live> live_;
  int next_id_ = 0;
  std::vector<SlipEvent> ended_;
  long count_ = 0;
};

}  // namespace stickslip
