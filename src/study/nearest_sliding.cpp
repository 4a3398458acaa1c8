#include "stickslip/study/nearest_sliding.hpp"

#include <memory>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/stability/sliding.hpp"

namespace stickslip {

std::function<double(PetscInt)> steady_velocity(const Scene& scene) {
  if (scene.left != End::velocity && scene.right != End::velocity) return {};
  try {
    const auto psi = std::make_shared<std::vector<double>>(Sliding(scene).psi);
    return [psi](PetscInt node) { return (*psi)[static_cast<std::size_t>(node)]; };
  } catch (const Error&) {
    return {};
  }
}

}  // namespace stickslip
