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

// Noise that is drawn by length, not by node, so that it does not change with the grid.

// Uniform on [-1, 1] at points `length` apart, with the interpolation of friction_amplitude() between them;
// in the chain, and where length is 0, one draw a node. The same on any number of ranks. Not collective.
double noise_at(const Scene& scene, double length, PetscInt seed, PetscInt node);

// What the normal load does to the state of each node, after Linker and Dieterich (Scene::state_response).

// Of the nodes first .. first + count - 1; empty where the state does not depend on the normal load.
inline std::vector<double> state_responses(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> all;
  for (PetscInt i = 0; i < count && scene.linker_dieterich != 0; ++i)
    all.push_back(scene.state_response(first + i));
  return all;
}

}  // namespace stickslip
