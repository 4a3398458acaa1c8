// What the normal load does to the state of each node, after Linker and Dieterich (Scene::state_response).
#pragma once

#include <vector>

#include "stickslip/model/scene.hpp"

namespace stickslip {

// Of the nodes first .. first + count - 1; empty where the state does not depend on the normal load.
inline std::vector<double> state_responses(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> all;
  for (PetscInt i = 0; i < count && scene.linker_dieterich != 0; ++i)
    all.push_back(scene.state_response(first + i));
  return all;
}

}  // namespace stickslip
