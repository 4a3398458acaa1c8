#include "stickslip/study/nearest_sliding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/stability/growth_rate.hpp"
#include "stickslip/stability/steady_sliding.hpp"

namespace stickslip {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

bool has_held_end(const Scene& s) { return s.left == End::velocity || s.right == End::velocity; }

// Processor time, in seconds, of the search for the rightmost mode and of so many right-hand sides: dense matrices up to
// 200 unknowns, then banded ones.
double search_seconds(double unknowns) {
  return unknowns <= 200 ? 1.2e-8 * std::pow(unknowns, 3) : 0.1 + 1e-4 * unknowns;
}
double steps_seconds(double unknowns, long evaluations) { return double(evaluations) * (1e-6 + 1e-9 * unknowns); }

}  // namespace

std::function<double(PetscInt)> steady_velocity(const Scene& scene) {
  if (!has_held_end(scene)) return {};
  try {
    const auto psi = std::make_shared<std::vector<double>>(SteadySliding(scene).psi);
    return [psi](PetscInt node) { return (*psi)[static_cast<std::size_t>(node)]; };
  } catch (const Error&) {
    return {};
  }
}

NearestGrowth nearest_growth(const Model& model, const StepAudit::Verdict& audit, long evaluations) {
  const Scene& s = model.scene();
  const auto none = [](const std::string& why) { return NearestGrowth{unknown, unknown, why}; };
  if (s.load.varies()) return none("the plate's velocity varies, so that nothing slides steadily");
  if (s.v == 0 && s.friction.sticks() && !has_held_end(s)) return none("friction jumps at psi = 0: it has no slope there");
  if (s.same_friction() && !has_held_end(s))
    return std::isfinite(audit.growth) ? NearestGrowth{audit.growth, audit.growth_taken, ""}
                                       : none("there is no steady sliding: the state has no steady value at v = 0");
  const auto unknowns = double(model.unknowns());
  if (search_seconds(unknowns) > std::max(0.01, 0.05 * steps_seconds(unknowns, evaluations)))
    return none("the nodes differ, and with " + number_text(unknowns) +
                " unknowns it would take more than a twentieth of the time of the run's steps; `spectrum` computes it");
  try {
    GrowthRate growth(model.comm(), [&s](double, double) { return s; }, {{"growth_rate"}});
    const double found = growth(0);
    if (!std::isfinite(found)) return none("there is no steady sliding");
    const double shift = audit.growth_taken - audit.growth;
    return {found, found + (std::isfinite(shift) ? shift : 0), ""};
  } catch (const Failure& e) {
    return none(e.what());
  }
}

}  // namespace stickslip
