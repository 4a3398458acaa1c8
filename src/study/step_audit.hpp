// Whether the steps of a run can be believed, looked at while it goes on.
//
// An adaptive method with sound tolerances answers for its own steps. Steps of fixed size, and those of
// tolerances of 1e-3 and looser, may follow something else than the equations - run at a wrong speed, jump to
// a spurious root of the implicit equations, damp away an instability - and look perfectly well behaved. So
// some of them are made a second time, accurately, from the same u: at 16 equal times of the run, and
// whenever psi changes by more than it has so far. What the run's own steps miss, in relation to the change
// of psi and eta in the accurate ones (root mean squares over nodes and steps), is `miss`; its part along the
// motion, a shift in time, is `shift`, the fraction by which the motion runs too fast, and with it a wave.
//
// What no error estimate sees is a perturbation of steady sliding that stays below the tolerance: a damping
// method then takes steps so long that the perturbation decays where it should grow. So the regime that a run
// ends in is held against the linearised operator (StepForecast) at the steps that the run has taken.
// While psi stands near sliding a perturbation that should grow like exp(g t) and grows like exp(g' t) comes
// out wrong by a factor of exp((g' - g) t), and reaches stick-slip too early or too late.
//
// Everything is collective. The run is not touched: what is computed here has a model and an integrator of
// its own.
#pragma once

#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/base/vectors.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/output/regime.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

struct StageProgram;  // src/numerics/tableau.hpp

// Largest growth rates, 1/time, of perturbations of steady sliding: of the wavelengths that the grid
// resolves, which are the continuum's own (all in the chain; all too where it resolves none), and of all. NaN
// where there is no steady sliding (a contact age at v = 0).
struct SlidingGrowth {
  double resolved = NAN, of_all = NAN;
};

class StepAudit : public Observer {
 public:
  // `integrator` is about to advance `model` from t_begin to t_end.
  StepAudit(const Model& model, const Options& options, const Integrator& integrator, double t_begin,
            double t_end);
  ~StepAudit() override;

  // Whether half of the nodes slide at v, to a tenth. Collective.
  static bool is_near_sliding(const Model& model, Vec u);

  // The longest step with which an adaptive explicit method that begins at u, near steady sliding, lets no
  // perturbation grow much faster than it should: above it steps that the error estimate allows make those of
  // a few nodes explode slowly. Infinity where the start is elsewhere, or any step will do.
  static double longest_near_sliding(const Model& model, const Integrator& integrator, Vec u,
                                     double duration);

  void step(const ObservedStep& step) override;

  struct Verdict {
    std::optional<double> miss, shift;  // empty where no step was repeated, or nothing moved
    int repeated = 0;                   // steps that were
    int beyond = 0;                     // steps given up on: too far for an accurate repetition
    bool near_sliding = false;          // does psi stand within a tenth of v at half the nodes?
    double near_time = 0;               // so long the motion was near sliding, as seen at the 16 times
    SlidingGrowth truly, taken, near;   // of the steps taken in the second half; of those taken near sliding
  };
  // At the end, at u.
  Verdict verdict(Vec u) const;
  // Warns where the regime that was measured, speeds or periods cannot be believed. True where it did.
  bool warn_of(const Verdict& verdict, Motion motion) const;

  // Warnings begin where the logarithm of a perturbation of sliding is wrong by the first; for
  // waves that the grid does not resolve, which need not be there, where it is too large by the second.
  static constexpr double largest_growth_error = 0.1, largest_short_growth_error = 0.5;
  // A step that misses more than this of its change is not believed.
  static constexpr double largest_miss = 0.03;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The steady sliding that the motion of a scene is compared with.

// psi of steady sliding at a node: v without held ends (an empty function says so), else the boundary layers
// at them, solved for as far as they reach (over the whole line where that is a quarter of it). v too where
// there is no steady sliding. Not collective.
std::function<double(PetscInt)> steady_velocity(const Scene& scene);

// Largest growth rate of perturbations of that steady sliding (1/time), of the wavelengths that the grid
// resolves, all in the chain: the true one and that of the steps taken. NaN where it is not known, and then
// `why_not` says why. `beyond`: where those decay, that of shorter waves of the grid that grow; else NaN.
struct NearestGrowth {
  double growth = NAN, taken = NAN;
  std::string why_not;
  double beyond = NAN;
};

// Of a run that has taken so many evaluations of the right-hand side. Where all nodes slide alike the audit
// of the steps has it, in closed form (stability/fastest_wave.hpp); where friction is spread or ends are held
// away from v it is computed (stability/boundary.hpp) if that is estimated to take less than 10 ms or a
// twentieth of the steps' time. The method's part is taken from the mean medium then. The estimate is by
// counts, so that the same run gives the same answer on any machine. Collective over the model's ranks.
NearestGrowth nearest_growth(const Model& model, const StepAudit::Verdict& audit, long evaluations);

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
