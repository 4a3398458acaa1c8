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

#include <limits>
#include <map>
#include <string>
#include <vector>

#include "numerics/tableau.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

class StepForecast {
 public:
  // For the method of `like` about the motion at u and about steady sliding; without a u about sliding alone,
  // for which no node is looked at but where nodes differ. Collective.
  StepForecast(const Model& model, Vec u, const Integrator& like);

  bool explodes(double dt, double duration);
  // The largest step found, up to dt, that does not explode.
  double limit(double dt, double duration);

  // Largest growth rate of a perturbation of steady sliding psi = v over the waves that fit the scene
  // (stability/fastest_wave.hpp): the true one, and the method's for steps as long as the keys, each taken
  // for the time that is its value, over some of them with the fastest among them. `resolved`: of wavelengths
  // that the grid resolves alone (all in the chain; all too where it resolves none), which are the
  // continuum's own. NaN where there is no steady sliding (a contact age at v = 0).
  double sliding_growth(bool resolved) const { return resolved ? growth_ : growth_of_all_; }
  double sliding_growth_of(const std::map<double, double>& time_at_step, bool resolved);

  // The method's growth rate of the shortest wave about sliding, less the true one. NaN as above.
  double shortest_wave_excess(double dt);
  double shortest_growth() const { return waves_.back().growth; }

  double least_slope() const { return least_slope_; }  // dF/dpsi over the nodes at u

  // 1/(a dt), a the diagonal entry of the stages: the shift of the implicit equations (shift I - dG/du) at
  // step dt, 0 for explicit methods.
  double shift(double dt);

 private:
  struct Wave {
    std::vector<double> explicit_part, implicit_part;  // dof x dof, row-major
    std::vector<Complex> lambda;                       // of the whole
    bool sliding, resolved;                            // about steady sliding; its wavelength is
    double growth;                                     // largest real part
  };
  void add_wave(const LinearPoint& medium, Implicit implicit, double kappa2, bool sliding, bool resolved);
  void add_waves_about(const Model& model, Vec u, Implicit implicit);
  void add_waves_about_sliding(const Model& model, Implicit implicit);
  std::vector<double> rates(double dt);       // growth of every wave, per unit time, as the method has it
  double multistep_modulus(Complex z) const;  // largest root of the characteristic polynomial
  double excess_rate(double dt);              // largest over the waves about the motion, per unit time

  void make_ts(const Integrator& like, Implicit implicit);
  void add_product(double factor, std::vector<double> Wave::*part, const double* a, double* out) const;
  double largest_about_sliding(const std::vector<double>& rate, bool resolved) const;  // NaN: no such wave

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
  double growth_ = std::numeric_limits<double>::quiet_NaN(), growth_of_all_ = growth_;  // of sliding
  std::vector<Wave> waves_;
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

// Roots of a polynomial, coefficients highest power first.
std::vector<Complex> characteristic_roots(const std::vector<Complex>& coefficients);
// Of the eigenvalues of a matrix (row-major), the largest real part and modulus.
struct SpectralBounds {
  double real_part, modulus;
};
SpectralBounds spectral_bounds(int dim, const std::vector<double>& matrix);

}  // namespace stickslip
