// A cell of nodes as a system of differential equations, and what carries its deviations.
#pragma once

#include <algorithm>
#include <complex>
#include <vector>

#include "model/kernel.hpp"
#include "model/right_hand_side.hpp"
#include "numerics/mesh_solve.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

// The chain that carries deviations round a cycle for many waves: each link a step by collocation or a jump.
//
// A wave changes the equations y' = J(t) y of a cell's deviations by what a few velocities feed into a few
// rates,
//     y' = J y + sum_ab w_ab u_a psi_b,
// w its weights (`LowRankCoupling`). What does not depend on w is eliminated once for each link; a wave
// leaves a system of as many unknowns as there are psi_b at the stages. Local to the process.

// u_a, each as long as the unknowns, and the places of psi_b among them; as many of the one as of the other,
// r. Where psi is no unknown it is a sum over `width` of them from there on, whose factors go with the
// motion: `by` has those of every b at each point of a step in turn.
struct LowRankCoupling {
  std::vector<std::vector<double>> into = {};
  std::vector<std::size_t> of = {};
  std::size_t width = 1;
  std::vector<double> by = {};  // empty: psi_b is the unknown
};

class IntervalPropagator {
 public:
  // A step of length h: J at the five points of `method`, d x d each, of half band `band`. Throws Failure
  // where it is singular.
  IntervalPropagator(const Collocation& method, int d, int band, double h, const double* J,
                     const LowRankCoupling& feed);
  // A matrix, d x d, with a jump that adds w_ab u_a psi_b to it.
  IntervalPropagator(int d, std::vector<double> matrix, const LowRankCoupling& feed);

  // Appends its matrix, d x d, with the weights w, r x r.
  template <class T>
  void carry(const T* w, std::vector<T>& matrices) const;

 private:
  std::size_t d_, r_, points_;  // points_ at which psi_b is fed back
  // row-major: of y at the beginning, of what u_a is given at the points
  std::vector<double> end_, end_of_u_, psi_, psi_of_u_;
};

// Floquet multipliers of a wave, largest first.
template <class T>
std::vector<std::complex<double>> multipliers_of(int d, const std::vector<IntervalPropagator>& links,
                                                 const std::vector<T>& w);

// A scene as one system of differential equations y' = f(y) of all its nodes, for collocation in time. Local
// to the process, which holds every node.
//
// Held nodes carry no unknown: their psi stands in their neighbours' equations. The nodes of a ring are
// ordered 0, n-1, 1, n-2, ..., so that neighbours stay near each other and the Jacobian is a band.
//
// The unknowns of a node are those of Model, psi, eta and the state; without mass eta
// and the state, from which psi follows. That takes friction that rises with psi at every state (a direct
// effect), so that there is one psi.
//
// Under loads that repeat (sines) the period is known, and the number q of the equations stands for the
// first unknown at phase 0 (plane.hpp). Friction that sticks is then that of sliding along v, which goes on
// smoothly through psi = 0: whoever asks sees whether the motion gets there.
class CellField : public VectorField {
 public:
  // `periods`: of the load, that are one of the motion; 0: a plate that goes evenly. Throws UsageError where
  // friction jumps at rest and nothing forces, every node is held, or psi does not follow without mass.
  explicit CellField(const Scene& scene, int periods = 0);

  int dim() const override { return width() * int(node_.size()); }
  int band() const override { return std::min(dim() - 1, width() * (reach_ + 1) - 1); }
  // Without a phase: under no sine.
  void rates(const double* y, double* f) const override { rates_under(steady_loads(), y, f); }
  void rates_at(double phase, const double* y, double* f) const override {
    rates_under(loads_at(phase), y, f);
  }
  Period period(double q) const override;
  void jacobian(const double* y, double* J) const override { jacobian_under(1, y, J); }
  void jacobian_at(double phase, const double* y, double* J) const override {
    jacobian_under(loads_at(phase).N, y, J);
  }
  void safeguard_step(double phase, const double* y, double h, double* dy) const override;

  double unit(int component) const override { return scales_.of(component % width() + dof_ - width()); }
  double unit_of_psi() const { return scales_.of(0); }

  int dof() const { return dof_; }                            // numbers of a node: psi, eta, the state
  int width() const { return massless_ ? dof_ - 1 : dof_; }  // of them unknowns, the last ones
  // psi of the k-th node; and all its numbers.
  double psi(const double* y, std::size_t k) const;
  void numbers(const double* y, std::size_t k, double* into) const;
  // Of its unknowns that are a psi: none without mass.
  Joints joints() const;
  int periods() const { return periods_; }
  std::size_t nodes() const { return node_.size(); }  // solved for
  // of the scene, in the order of the unknowns
  PetscInt node(std::size_t k) const { return node_[k]; }
  const Scene& scene() const { return scene_; }
  // y of steady sliding psi = v; of a uniform cell the exact one, else a start for it.
  std::vector<double> sliding() const;

  // What the copies of the cell beside it feed into its rates. Of one node alone a wave exp(ikx) adds kappa^2
  // to -D2; of a ring's cell the neighbours across its ends are exp(i theta) times as large.
  LowRankCoupling feed() const;
  // Of those nodes how psi changes with eta and the state at y, without mass; else nothing.
  std::vector<double> feed_slopes(const double* y) const;
  // A wave turns or decays in a step by its rate fastest() times how far the step reaches: its length, or
  // without mass, where rates go with the motion, its length times the largest dpsi/deta of `slopes`.
  double fastest(double kappa2) const;
  double reach(double h, const std::vector<double>& slopes) const;
  double speed(const double* y) const;  // of waves at y
  std::vector<std::complex<double>> weights_of_phase(double theta) const;

 private:
  struct Held {
    double weight = 0, sum = 0;  // of D2 at held neighbours: the weights, and these times their psi
  };
  const Friction& friction(std::size_t k) const { return friction_[node_[k]]; }
  Partials friction_at(std::size_t k, double psi, double state) const;
  RatePartials rate_at(std::size_t k, double psi, double state) const;
  struct Loads {
    double v, N, log_rate;  // of the plate; by which friction is multiplied, and N'/N
  };
  Loads steady_loads() const { return {scene_.v, 1, 0}; }
  Loads loads_at(double phase) const;
  void rates_under(const Loads& loads, const double* y, double* f) const;
  void jacobian_under(double N, const double* y, double* J) const;
  LinearPoint point(double N, const double* y, std::size_t k) const;
  LinearPoint without_friction(std::size_t k) const;
  kernel::Coefficients coefficients(std::size_t k, double v) const;
  void couple(PetscInt node);
  MasslessNode massless(std::size_t k) const {
    return {friction(k), amplitude_[k], without_friction(k).B, scene_.friction.back_slip};
  }
  double d2_of_psi(std::size_t k, const std::vector<double>& psi) const;
  void massless_rates(const Loads& loads, const double* y, double* f) const;
  void massless_jacobian(const double* y, double* J) const;

  Scales scales_;
  Scene scene_;
  Frictions friction_;  // of every node of the scene
  kernel::Coefficients coefficients_;
  LinearPoint no_friction_;
  std::vector<NodeCoefficients> own_;  // of the unknown nodes, where they differ
  NodeBlock by_d2_;                    // what a change of D2 psi does to the rates: psi_psi and eta_psi
  bool massless_;
  int dof_, periods_, reach_ = 0;
  double sliding_;  // the direction of friction that sticks, 0 for other
  std::vector<PetscInt> node_;
  std::vector<double> amplitude_, response_;  // the second: Scene::state_response(), where it is not 0
  std::vector<TurnedRow> row_;                // D2 among the unknown nodes, by their places
  std::vector<Held> held_;
  mutable std::vector<double> last_psi_;  // without mass: from which the next one is looked for
};

// What a solution by collocation shows: its values in the order of the scene's nodes, extrema, times of rest.

// Unknowns of the field from values node by node, and back.
std::vector<double> in_band_order(const CellField& field, const double* natural);
void unfold(const CellField& field, const double* y, double* natural);

// The motion with everything that is measured of it: times, states, psi_min to force_drop; multipliers and
// errors are left open.
Cycle cycle_of(const CellField& field, const std::vector<double>& mesh, const std::vector<double>& values,
               double period);

// The phase of a cycle.

// y_0 lies in the plane through y across the motion there.
Condition plane_across(const VectorField& field, const std::vector<double>& y);
// The same where the plane goes through the middle of the cycle too: smaller cycles about it still cross it.
Condition plane_through(const VectorField& field, const std::vector<double>& y,
                        const std::vector<double>& middle);
// The plane through y in which unknown k keeps its value.
Condition plane_of(std::size_t k, const std::vector<double>& y);
// Under a forcing no phase is left open: the number q is unknown k at phase 0.
Condition number_of(std::size_t unknowns, std::size_t k = 0);
// Mean over a period of a profile of d unknowns on a mesh.
std::vector<double> mean_of(const std::vector<double>& mesh, const double* x, std::size_t d);

}  // namespace stickslip
