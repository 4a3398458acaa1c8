// What a fixed step of a method does to the waves of the linearised operator: whether it explodes, and
// whether it makes growing perturbations of steady sliding decay or decaying ones grow.
//
// Uniform motion at velocity psi splits into waves exp(ikx); each is a system of dof equations (one less
// without mass) with K = K0 + K1 kappa^2(k). A one-step method itself advances a set of them - kappa^2 from 0
// to the grid's largest, friction at its least and largest slope - by one step from every unit vector, so
// that the propagator P over one step is known for any method, split as it will be; its rate is ln rho(P)/dt.
// The multistep methods bdf and alpha take everything implicitly and are known by the roots of their
// characteristic polynomial at dt lambda; leapfrog, which the library does not have, by its stability matrix
// (numerics/stage_program.hpp).
//
// A wave explodes when the excess of its growth over the exact one, ln rho(P) - max(0, dt Re lambda),
// multiplies errors by more than a million in the time asked for. A growing wave that an implicit method lets
// grow by less than twice as fast as it should is not counted: that is an error, not an explosion.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "numerics/tableau.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/study/step_audit.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

class StepForecast {
 public:
  // For the method of `like` about steady sliding and about the motion at u, with the steepest friction that
  // the law has where sliding is unstable and the motion comes to it; without a u about sliding alone, for
  // which no node is looked at but where nodes differ. Collective.
  StepForecast(const Model& model, Vec u, const Integrator& like);
  // About motions that meet the least and the largest slope of friction that there is.
  static StepForecast anywhere(const Model& model, const Integrator& like);

  bool explodes(double dt, double duration);
  // The largest step found, up to dt, that does not explode.
  double limit(double dt, double duration);

  // Of perturbations of steady sliding psi = v, over the waves that fit the scene
  // (stability/fastest_wave.hpp): the true growth, and the method's for steps as long as the keys, each taken
  // for the time that is its value, over some of them with the fastest among them; the true one without
  // steps.
  SlidingGrowth sliding_growth() const { return growth_; }
  SlidingGrowth sliding_growth(const std::map<double, double>& time_at_step);

  // The method's growth rate of the shortest wave about sliding, less the true one. NaN as above.
  double shortest_wave_excess(double dt);
  double shortest_growth() const { return waves_[about_sliding_ - 1].growth; }

  double least_slope() const { return least_slope_; }  // dF/dpsi over the nodes at u

  // 1/(a dt), a the diagonal entry of the stages: the shift of the implicit equations (shift I - dG/du) at
  // step dt, 0 for explicit methods.
  double shift(double dt);

 private:
  struct Wave {
    std::vector<double> explicit_part, implicit_part;  // dof x dof, row-major
    std::vector<Complex> lambda;                       // of the whole
    bool resolved;                                     // its wavelength, by the grid
    double growth;                                     // largest real part
  };
  void add_wave(const LinearPoint& medium, Implicit implicit, double kappa2, bool resolved);
  StepForecast(const Model& model, Vec u, const Integrator& like, bool anywhere);
  void add_waves_about(const Model& model, Vec u, Implicit implicit);
  void add_waves_about_sliding(const Model& model, Implicit implicit);
  std::vector<double> rates(double dt);       // growth of every wave, per unit time, as the method has it
  double multistep_modulus(Complex z) const;  // largest root of the characteristic polynomial
  double excess_rate(double dt);              // largest over the waves about the motion, per unit time

  void make_ts(const Integrator& like, Implicit implicit);
  void add_product(double factor, std::vector<double> Wave::*part, const double* a, double* out) const;

  static PetscErrorCode RHSFunction(TS, PetscReal, Vec, Vec, void*);
  static PetscErrorCode IFunction(TS, PetscReal, Vec, Vec, Vec, void*);
  static PetscErrorCode IJacobian(TS, PetscReal, Vec, Vec, PetscReal, Mat, Mat, void*);

  int dof_;
  bool all_implicit_ = false;
  int bdf_order_ = 0;  // 0: not bdf
  bool is_alpha_ = false;
  const StageProgram* stages_ = nullptr;  // of a method that the library does not have
  double alpha_m_ = 0, alpha_f_ = 0, alpha_gamma_ = 0;
  double last_shift_ = 0, least_slope_ = 0;
  SlidingGrowth growth_;
  std::vector<Wave> waves_;        // about sliding, the shortest last; then those about the motion
  std::size_t about_sliding_ = 0;  // so many
  std::map<double, std::vector<double>> rates_at_;  // of the steps that have been asked for
  TsHandle ts_;
  VecHandle u_;
  MatHandle J_;
};

// Warns, before it happens, of fixed steps of `integrator`, about to advance u through `duration`, that will
// explode, whose implicit equations have several solutions, or at which the method's order falls; and of
// others that stability makes far shorter, after a slip, than an implicit method's. True where it did.
// Collective.
bool warn_of_steps(const Model& model, const Integrator& integrator, Vec u, double duration);

// Of steps that made a run grow beyond all numbers: their stability limit, in words to follow the message,
// with the steepest friction that the law has; "" where they are below it. Collective.
std::string limit_in_words(const Integrator& integrator, double duration);

}  // namespace stickslip
