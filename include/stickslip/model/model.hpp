// The semi-discrete system on a distributed grid: right-hand side, Jacobian, start, steady sliding.
//
// The unknowns stand node by node: psi, eta and, with a state law, the stored state (see friction.hpp) of
// node 0, then of node 1, ... in one Vec, in equal parts on the ranks. A held node stands in the Vec too, but
// psi there is constant (right-hand side 0); its eta is output: constant in the continuum, where set_held()
// makes it B psi_e + F(psi_e, state) - N D2 psi, and the elastic force (a quadrature that nothing depends on)
// in the chain.
//
// Time stepping, steady states, eigenvalues and waves share this object; it is the only thing they share.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/base/vectors.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/load.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

// N(t), by which friction and its threshold are multiplied, and its rate.
struct NormalLoad {
  double N = 1, rate = 0;
};

class Model {
 public:
  // Sets up the grid over `comm`. Collective. Throws UsageError where there are more ranks than nodes.
  Model(MPI_Comm comm, const Scene& scene);
  ~Model();
  Model(Model&&) noexcept;

  const Scene& scene() const { return scene_; }
  MPI_Comm comm() const { return comm_; }
  int dof() const { return dof_; }           // 2, or 3 with a state law
  PetscInt first() const { return first_; }  // first node of this rank
  PetscInt local() const { return local_; }  // nodes of this rank
  bool held(PetscInt node) const { return scene_.held(node); }
  PetscInt unknowns() const;  // solved for, over all ranks: held nodes' psi and eta are not

  VecHandle create_vector() const;  // block size dof(). Collective

  // Friction that sticks (stick.hpp): while `direction` is given, one value a node of this rank that stays
  // the caller's, nodes with 0 rest (psi_t = 0, friction is eta) and the others slide with the friction of
  // that direction, +1 or -1, whatever the sign of psi. Heeded by rhs() and jacobian() for Part::full,
  // pointwise and stencil, not by wave and reaction, in each of which eta and F stand alone. nullptr: the
  // sign of psi decides, and nothing sticks.
  void set_direction(const double* direction) const;
  const double* direction() const { return direction_; }  // as it was given; not collective

  // With loads v(t), N(t) (load.hpp), which rhs() takes at the time said last: at t, in the piece of the load
  // that begin_load() has said, the one that begins at its t or holds it. Friction and its slopes, below, are
  // those of that time too. Without a load they do nothing. Not collective.
  void begin_load(double t) const;
  void set_time(double t) const;
  double time() const { return time_; }    // said last
  double plate_velocity(double t) const;   // v, or v(t) in that piece
  NormalLoad normal_load(double t) const;  // likewise
  // What a step of the normal load at t, where one piece ends and another begins, does to the state.
  void pass_corner(Vec u, double t) const;

  // f = the terms `part` of the right-hand side at u. Collective; no allocation. Order p in space. Of a
  // massless chain (MasslessChain) Part::full alone: eta and the state have rates, psi has the rate
  // 0 and follows from them, from psi in u as a first guess; not a number where it would jump.
  void rhs(Part part, Vec u, Vec f) const;
  // Puts into u the psi that its eta and state say in a massless chain; else does nothing. Not collective.
  void solve_velocities(Vec u) const;
  // Where the last rhs() or solve_velocities() of a massless chain found no psi, or where the psi in u is
  // about to jump or runs away, in words; "" where nothing is so. Collective.
  std::string velocity_jump(Vec u) const;
  // Whether neighbours have viscosity (nu > 0). What drives a node then is e = eta + N D2 psi; at rest that
  // is the force held against the threshold.
  bool viscous() const { return scene_.N() > 0; }
  // N D2 psi in the place of eta, 0 elsewhere; of a viscous scene alone. At a held end of the continuum D2 is
  // of order p - 2 (stencil.hpp). Collective.
  void viscous_force(Vec u, Vec into) const;
  long rhs_evaluations() const { return evaluations_; }                // of every part, since the start
  void count_evaluations(long count) const { evaluations_ += count; }  // made by others (time/tiles)

  // A matrix with the pattern of the Jacobian of `part` (block size dof(); BAIJ, AIJ without a stencil).
  MatHandle create_jacobian(Part part) const;
  // J = alpha I + beta d(rhs part)/du at u. Collective.
  void jacobian(Part part, Vec u, double alpha, double beta, Mat J) const;

  // The block of that Jacobian of node `local_node` of this rank, whose unknowns are u, by those unknowns,
  // without its share of the coupling K1 D2; rows of what is held are 0. Not collective.
  NodeBlock node_block(Part part, PetscInt local_node, const double* u) const;

  // For Newton's method on  shift u - rhs(u) = given  (the stages of implicit methods): replaces its step
  // -`minus_step` at u by one that converges where friction is steep. False where the law needs nothing of
  // the kind; then minus_step is as it was. Local to each rank.
  bool safeguard_newton_step(Vec u, double shift, Vec minus_step) const;

  // Sets psi, eta of held nodes to their values, with the state as it stands. Collective.
  void set_held(Vec u) const;

  // The amplitude a_i of friction at this rank's nodes (all 1 without spread and profile), without N(t).
  const std::vector<double>& amplitude() const { return amplitude_; }

  // The coefficients of a node of this rank, which are those of the scene where they do not differ along x;
  // the largest A (B + slope) over all nodes, collective.
  NodeCoefficients coefficients(PetscInt local_node) const;
  double largest_resistance(double slope) const;

  // The scene's friction, of amplitude 1. Where it varies along x there is no one friction: UsageError.
  const Friction& friction_law() const;
  const Friction& friction_law(PetscInt local_node) const { return (*law_)[local_node]; }
  SlopeBounds slope_bounds() const { return slope_bounds_; }  // the largest over all nodes
  // Pointwise response of node `local_node` of this rank: F and partials are multiplied by a_i.
  Partials friction(PetscInt local_node, double psi, double state) const;
  LinearPoint linear_point(PetscInt local_node, double psi, double state) const;
  RatePartials state_rate(PetscInt local_node, double psi, double state) const {
    return friction_law(local_node).rate_partials(psi, state);
  }
  RatePartials state_rate(double psi, double state) const { return friction_law().rate_partials(psi, state); }
  // The stored state at which g = 0.
  double steady_state(PetscInt local_node, double psi) const {
    return friction_law(local_node).steady_state(psi);
  }
  double steady_state(double psi) const { return friction_law().steady_state(psi); }

  // Largest explicit frequencies, for step sizes: sqrt(A (K0 + K1 kappa^2_max)) of the wave, and max |A (B +
  // F_psi)| + |s delta| over the nodes at u. Of a massless chain: that of wave_frequency() below, and the
  // rate of the state. Collective.
  double wave_frequency() const;
  double friction_rate(Vec u) const;

 private:
  double factor(PetscInt i) const { return factors_.empty() ? amplitude_[i] : factors_[i]; }
  LinearPoint without_friction(PetscInt local_node) const;
  void share_nodes();
  void bound_slopes();
  void set_normal(const NormalLoad& normal) const;
  Vec settle_copy(Vec u) const;
  template <class Take>
  void over_ranges(Vec u, Vec f, bool coupled, const Take& take) const;
  template <class Body>
  void for_held(const Body& body) const;

  MPI_Comm comm_;
  Scene scene_;
  int dof_;
  PetscInt first_ = 0, local_ = 0;
  std::optional<Frictions> law_;
  SlopeBounds slope_bounds_;
  std::vector<double> amplitude_;
  LinearPoint no_friction_;
  std::vector<NodeCoefficients> medium_;  // of this rank's nodes; none where all have the same
  mutable int load_piece_ = 0, normal_piece_ = 0;
  mutable double time_ = 0, v_;  // said last; v(t) then
  // of a normal load that varies, at the time said last: N a_i, and what it does to the rate of the state
  mutable std::vector<double> factors_, ageing_;
  std::vector<double> response_;  // Scene::state_response() of each node, where it is not 0
  mutable const double* direction_ = nullptr;
  mutable VecHandle settled_;  // of a massless chain: u with its psi
  mutable long evaluations_ = 0;
  std::unique_ptr<const class RightHandSide> right_hand_side_;
  std::unique_ptr<const class MasslessChain> massless_;
  std::unique_ptr<const class PsiHalo> halo_;
};

// Frequency of the shortest wave on the scene's grid, sqrt(A (K0 + K1 kappa^2_max)). A massless chain has no
// waves: the rate (K0 + K1 kappa^2_max)/resistance (scales.hpp) at which its shortest deviation from sliding
// at psi = v dies away.
double wave_frequency(const Scene& scene);
// The rate at which viscosity damps the shortest wave, A N kappa^2_max, 0 without it; and the larger of the
// two, which explicit steps obey.
double viscous_rate(const Scene& scene);
double stencil_rate(const Scene& scene);

// Counter-based random numbers keyed by (seed, index): uniform on (0, 1), and standard normal.
double counter_uniform(PetscInt seed, PetscInt index);
double counter_normal(PetscInt seed, PetscInt index);

// Friction amplitude a_i of every node first..first+count-1: one draw a block in the chain; in the continuum
// draws at spacing spread_length, interpolated smoothly, the same medium on every grid. The ensemble mean of
// a is 1, times the profile friction_amplitude_profile where there is one.
std::vector<double> friction_amplitude(const Scene& scene, PetscInt first, PetscInt count);
// a(x) of the continuum anywhere between its ends.
double friction_amplitude_at(const Scene& scene, double x);

// A driving plate that halts (load_halt): it stands while any node slips, and goes at v while none does.
//
// Its load (load.hpp) has one corner, before all times of a run: the piece before it is that of a plate that
// stands, the one behind it that of a plate that goes. Which of them holds is said to the model by
// Plate::set(), not by the time.
//
// The plate has a clock of its own, which stands with it. That of the run, t everywhere else, goes on: psi is
// the rate of the displacement by it.
//
// Nothing here communicates; every rank has the same clock.
inline constexpr double before_all_times = -1;  // where the load of a plate that halts has its corner

inline Load halting_load(double v) { return {v, {{before_all_times, 0.}, {before_all_times, v}}}; }
inline bool halts(const Scene& scene) {
  return scene.load.next_corner(-std::numeric_limits<double>::infinity()) < 0;
}

// The plate of a run; where it does not halt its clock is that of the run.
struct Plate {
  double t = 0, time = 0;  // at the run's time t its clock shows `time`, and from there on it goes or stands
  bool goes = true;
  double end = std::numeric_limits<double>::infinity();  // the run ends where its clock shows this

  double at(double when) const { return goes ? time + (when - t) : time; }
  void set(const Model& model, double now, double shows, bool from_now_on_goes) {
    t = now;
    time = shows;
    goes = from_now_on_goes;
    model.begin_load(goes ? 0 : 2 * before_all_times);
  }
  // How far it has come when the run's clock shows that.
  double travel(const Scene& scene, double when) const {
    return halts(scene) || !scene.load.varies() ? scene.v * at(when) : scene.load.integral(when);
  }
};

}  // namespace stickslip
