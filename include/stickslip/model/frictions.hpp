// The friction of nodes that follow each other: one law for all, or with profiles along x
// (friction_*_profile, state_*_profile) one for each, of the same law with parameters of its own. Amplitudes
// stand apart (friction_amplitude).
//
// Nothing here communicates.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "stickslip/model/scene.hpp"

namespace stickslip {

class Frictions {
 public:
  // Of the nodes first .. first + count - 1. Throws UsageError where the parameters at some place contradict
  // each other.
  Frictions(const Scene& scene, PetscInt first, PetscInt count);

  const Friction& operator[](PetscInt i) const { return *list_[list_.size() == 1 ? 0 : i]; }
  bool vary() const { return vary_; }  // by more than their amplitudes

 private:
  bool vary_;
  std::vector<std::shared_ptr<const Friction>> list_;
};

// Where the loops over nodes are to take friction, or coefficients, that are each node's own
// (model/loops.hpp): of `count` nodes, the i-th of number node(i). None where one law says all; one place
// where all nodes are alike with a term beside it; else all of them.
FrictionPlaces friction_places(const Scene& scene, PetscInt count,
                               const std::function<PetscInt(PetscInt)>& node);
FrictionPlaces friction_places(const Scene& scene, PetscInt first, PetscInt count);

}  // namespace stickslip
