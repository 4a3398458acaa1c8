#include "stickslip/study/nearest_sliding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/stability/growth_rate.hpp"
#include "stickslip/stability/steady_sliding.hpp"

namespace stickslip {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

bool has_held_end(const Scene& s) { return s.left == End::velocity || s.right == End::velocity; }

// Processor time, in seconds, of the search for the rightmost mode and of so many right-hand sides: dense
// matrices up to 200 unknowns, then banded ones.
double search_seconds(double unknowns) {
  return unknowns <= 200 ? 1.2e-8 * std::pow(unknowns, 3) : 0.1 + 1e-4 * unknowns;
}
double steps_seconds(double unknowns, long evaluations) {
  return double(evaluations) * (1e-6 + 1e-9 * unknowns);
}

// So many nodes beside a held end that what it does to steady sliding, (K0 - K1 D2)(psi - v) = 0, is
// forgotten behind them; the whole line where nothing makes it fall.
PetscInt nodes_of_layer(const Scene& s) {
  if (s.medium.varies() || s.K0() == 0 || s.K1() == 0) return s.n;
  const double nodes = nodes_to_forget(s) + 4 * s.order;
  return nodes < double(s.n) ? static_cast<PetscInt>(nodes) : s.n;
}

// psi of the nodes beside one held end, in their order along the line.
std::vector<double> layer(const Scene& whole, PetscInt nodes, bool at_left) {
  if ((at_left ? whole.left : whole.right) != End::velocity) return {};
  Scene part = whole;
  part.n = nodes;
  part.length = whole.h() * double(nodes - 1);
  (at_left ? part.right : part.left) = End::free;
  return SteadySliding(part).psi;
}

}  // namespace

std::function<double(PetscInt)> steady_velocity(const Scene& scene) {
  if (!has_held_end(scene)) return {};
  try {
    const PetscInt nodes = nodes_of_layer(scene);
    if (scene.v == 0 || nodes > scene.n / 4) {
      const auto psi = std::make_shared<std::vector<double>>(SteadySliding(scene).psi);
      return [psi](PetscInt node) { return (*psi)[node]; };
    }
    const auto left = std::make_shared<std::vector<double>>(layer(scene, nodes, true));
    const auto right = std::make_shared<std::vector<double>>(layer(scene, nodes, false));
    return [left, right, v = scene.v, n = scene.n](PetscInt node) {
      const auto from_left = std::size_t(node), from_right = std::size_t(n - 1 - node);
      return from_left < left->size()     ? (*left)[from_left]
             : from_right < right->size() ? (*right)[right->size() - 1 - from_right]
                                          : v;
    };
  } catch (const Error&) {
    return {};
  }
}

NearestGrowth nearest_growth(const Model& model, const StepAudit::Verdict& audit, long evaluations) {
  const Scene& s = model.scene();
  const auto none = [](const std::string& why) { return NearestGrowth{unknown, unknown, why, unknown}; };
  if (s.force.amplitude != 0) return none("a harmonic force acts, so that nothing slides steadily");
  if (s.load.varies()) return none("the plate's velocity varies, so that nothing slides steadily");
  if (s.normal.varies()) return none("the normal load varies, so that nothing slides steadily");
  if (s.v == 0 && s.friction.sticks() && (slides_uniformly(s) || !has_held_end(s)))
    return none("friction jumps at psi = 0: it has no slope there");
  if (slides_uniformly(s)) {
    if (!std::isfinite(audit.growth))
      return none("there is no steady sliding: the state has no steady value at v = 0");
    if (audit.growth > 0 || !(audit.growth_of_all > 0))
      return {audit.growth, audit.growth_taken, "", unknown};
    return {audit.growth, audit.growth_taken_of_all, "", audit.growth_of_all};
  }
  const auto unknowns = double(model.unknowns());
  if (search_seconds(unknowns) > std::max(0.01, 0.05 * steps_seconds(unknowns, evaluations)))
    return none("the nodes differ, and with " + number_text(unknowns) +
                " unknowns it would take more than a twentieth of the time of the run's steps; `spectrum` "
                "computes it");
  try {
    GrowthRate growth(model.comm(), [&s](double, double) { return s; }, {{"growth_rate"}});
    const double found = growth(0);
    if (!std::isfinite(found)) return none("there is no steady sliding");
    const double shift = audit.growth_taken - audit.growth;
    return {found, found + (std::isfinite(shift) ? shift : 0), "", unknown};
  } catch (const Failure& e) {
    return none(e.what());
  }
}

}  // namespace stickslip
