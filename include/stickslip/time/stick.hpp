// Friction that sticks: which nodes rest and which slide, and when that changes.
//
// A node at rest (psi = 0) stays there while its force eta lies in [-f, f], f = a_i fs(state) its static
// threshold (with friction_back_slip false: in (-infinity, f]); its friction is then eta, so that psi_t and
// the damping term vanish. Beyond, it begins to slip along sgn(eta). A node that slides stops when psi passes
// through zero. With viscosity between neighbours eta + N D2 psi is the force, here and below.
//
// Between such changes the direction of every node stands (1, -1, or 0 at rest; Model::set_direction) and the
// right-hand side is smooth, through psi = 0 too, so that a method keeps its order. After each step the
// changes in it are found: by sign at its end, and by the cubic through values and slopes at both ends where
// a node goes beyond and comes back (a stay shorter than the error of the step can be missed). The first
// change is located on the method's own polynomial between steps to 3e-13 of the step; the step is cut there,
// every node whose change lies within round-off of it changes too (its psi becomes exactly 0, or its eta
// exactly the threshold), and the method starts anew.
//
// The directions follow from the unknowns alone: the sign of psi, and at psi = 0 the force; at the threshold
// itself a node begins to slip if the force grows faster than the threshold. So a checkpoint need not hold
// them.
//
// While every node rests, nothing moves: eta is linear in time (with a load v(t), K0 times how far the plate
// has come) and the state known in closed form, and one step leads to the next release, however far it is, or
// with an oscillating load over some periods.
//
// Collective unless said otherwise; the same on any number of ranks.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "stickslip/model/model.hpp"

namespace stickslip {

namespace stick_rule {
struct Candidates;
struct Furthest;
struct NodeLimit;
struct StepOfNodes;
}  // namespace stick_rule
class StickEvents;

class Stick {
 public:
  // Whether this scene's friction sticks: a law with a threshold, not regularised. Without mass psi follows
  // from eta at rest, too, and nothing is to be decided.
  static bool applies_to(const Scene& scene);

  // The model computes with the directions of this object from decide() on, until another one decides or
  // engages, or this one is destroyed.
  explicit Stick(const Model& model);
  ~Stick();
  Stick(const Stick&) = delete;
  Stick& operator=(const Stick&) = delete;

  void engage() const { model_.set_direction(direction_.data()); }
  // Sets the directions from u. Costs one or two evaluations of the right-hand side.
  void decide(Vec u, double t);
  // Gives nodes without friction (of amplitude 0), which never rest, the direction of their psi in u, where
  // an accepted step ends. Whether one has turned, on any rank. Collective where the scene has such nodes.
  bool follow_frictionless(Vec u);
  // The right-hand side at u is another than decide() has seen, because the plate has halted.
  void renew_slope(Vec u);
  bool all_rest() const { return all_rest_; }
  const std::vector<double>& direction() const { return direction_; }  // of this rank's nodes; not collective
  long changes() const { return changes_; }  // of a node from rest to sliding or back, so far; over all ranks
  // The nodes of this rank that the last decide() changed so, by their number in the line; not collective.
  const std::vector<PetscInt>& changed() const { return changed_; }

  // The first change within a step of length dt from t and `before`, where decide() or the last call left
  // off, to `after`.
  struct Cut {
    enum class Kind { none, at, too_coarse } kind;
    double part;  // of the step that is left when it is cut there, in (0, 1]
  };
  // at(part, into) interpolates in the step. With Kind::at, `landed` is the state there, ready for decide().
  // `slope_known`: the method has left the right-hand side at `after` in slope_at_end(). too_coarse: a node
  // that began to slip stops in the same step, or runs backwards at once, which no exact solution does:
  // repeat with a shorter step.
  Cut first_change(Vec before, Vec after, double t, double dt,
                   const std::function<void(double part, Vec into)>& at, Vec landed,
                   bool slope_known = false);
  Vec slope_at_end() const { return next_slope_; }

  // While every node rests, from u at t on: time until the first begins to slip (infinite: never; with a
  // load: not within `longest`), and u after the time `wait`.
  double release_after(Vec u, double t, double longest);
  void rest(Vec u, double t, double wait, Vec into);
  // Over how long a time release_after() may be asked at once.
  static double longest_rest(const Scene& scene);

 private:
  void find_candidates(Vec before, Vec after, stick_rule::StepOfNodes step);
  stick_rule::Furthest furthest(Vec u, const stick_rule::StepOfNodes& step, double part);
  void snap(Vec before, Vec landed, stick_rule::StepOfNodes step, double part);
  void put_at_threshold(Vec u, const std::vector<stick_rule::NodeLimit>& limits, const NormalLoad& normal);
  // Of a viscous scene, in a Vec of this object, the one numbered so: N D2 psi of u in the place of eta.
  Vec viscous_force(Vec u, std::size_t number);
  // Likewise eta + N D2 psi, the force; nullptr where neighbours have no viscosity, and eta of u is the
  // force. Linear: of a slope it gives the rate.
  Vec total_force(Vec u, std::size_t number);

  const Model& model_;
  std::unique_ptr<StickEvents> events_;
  int dof_;
  bool frictionless_;  // a node of any rank has no friction
  std::vector<double> direction_, was_;
  std::vector<WithSlope> limit_, next_limit_;  // with a state, of resting nodes: both ends of the step
  bool all_rest_ = false;
  long changes_ = 0;
  std::vector<PetscInt> changed_;
  VecHandle slope_, next_slope_;  // right-hand side at the start and the end of the step
  std::array<VecHandle, 4> forces_;
  std::unique_ptr<stick_rule::Candidates> candidates_;  // of the step under way
  double unseen_;                                       // see there
};

}  // namespace stickslip
