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
// ends in is held against the linearised operator (step_forecast.hpp) at the steps that the run has taken.
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

#include "stickslip/model/model.hpp"
#include "stickslip/output/regime.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

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

}  // namespace stickslip
