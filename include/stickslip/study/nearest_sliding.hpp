// The steady sliding that the motion of a scene is compared with.
#pragma once

#include <functional>
#include <limits>
#include <string>

#include "stickslip/model/model.hpp"
#include "stickslip/study/step_audit.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

// psi of steady sliding at a node: v without held ends (an empty function says so), else the boundary layers
// at them, solved for as far as they reach (over the whole line where that is a quarter of it). v too where
// there is no steady sliding. Not collective.
std::function<double(PetscInt)> steady_velocity(const Scene& scene);

// Largest growth rate of perturbations of that steady sliding (1/time), of the wavelengths that the grid
// resolves, all in the chain: the true one and that of the steps taken. NaN where it is not known, and then
// `why_not` says why. `beyond`: where those decay, that of shorter waves of the grid that grow; else NaN.
struct NearestGrowth {
  double growth, taken;
  std::string why_not;
  double beyond = std::numeric_limits<double>::quiet_NaN();
};

// Of a run that has taken so many evaluations of the right-hand side. Where all nodes slide alike the audit
// of the steps has it, in closed form (stability/fastest_wave.hpp); where friction is spread or ends are held
// away from v it is computed (stability/growth_rate.hpp) if that is estimated to take less than 10 ms or a
// twentieth of the steps' time. The method's part is taken from the mean medium then. The estimate is by
// counts, so that the same run gives the same answer on any machine. Collective over the model's ranks.
NearestGrowth nearest_growth(const Model& model, const StepAudit::Verdict& audit, long evaluations);

}  // namespace stickslip
