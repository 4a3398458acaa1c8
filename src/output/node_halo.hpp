// Values of nodes beside those of this rank that stencils of its own nodes reach.
#pragma once

#include <optional>
#include <vector>

#include "stickslip/base/node_fetch.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/output/checkpoint.hpp"

namespace stickslip {

class NodeHalo {
 public:
  // Collective.
  NodeHalo(const Scene& scene, const NodeRange& nodes);

  // One value of each of them, in the order of `at`, of one value of each own node. Collective.
  std::vector<double> fetch(const std::vector<double>& own) const;
  // The value of a node: of `own`, or of what was fetched.
  double at(PetscInt node, const std::vector<double>& own, const std::vector<double>& fetched) const {
    const PetscInt i = node - first_;
    return i >= 0 && i < count_ ? own[i] : fetched[place_of(node)];
  }

 private:
  std::size_t place_of(PetscInt node) const;

  PetscInt first_, count_;
  std::vector<PetscInt> nodes_;     // those beside, in order
  std::optional<NodeFetch> fetch_;  // none where the rank has all nodes
};

}  // namespace stickslip
