// The catalogue of slip events (events.hpp) of a run in which only what slides is advanced: fed with the
// steps of clusters and with the nodes that start and stop, so that an event costs what its own nodes cost.
//
// The numbers are those of `Events` but for how they are had. eta before an event is eta behind it less (K1
// D2 - K0) d and less K0 times the plate's displacement, so no field is remembered; the work of friction is
// that of eta less what goes into motion and damping. The largest kinetic energy adds up that of clusters
// at their own ends of steps.
#pragma once

#include <functional>
#include <vector>

#include "model/moved_nodes.hpp"
#include "output/regions.hpp"
#include "stickslip/output/archive.hpp"

namespace stickslip {

class ClusterEvents {
 public:
  explicit ClusterEvents(const Scene& scene, bool ruptures = false);

  void step(const MovedNodes& nodes);
  // Nodes that begin to slide and that stop at t; eta(i): at t, of a node that rests then.
  void change(double t, const std::vector<PetscInt>& starts, const std::vector<PetscInt>& stops,
              const std::function<double(PetscInt)>& eta);
  std::vector<SlipEvent> ended();  // since the last call, in order of the ends
  void archive(Archive& a);        // what is under way; asked for when no events wait for that call

 private:
  PetscInt beside(PetscInt node, int side) const;  // -1: none
  const NodeCoefficients& own(PetscInt i) const {
    return coefficients_[coefficients_.size() == 1 ? 0 : std::size_t(i)];
  }
  void claim(const SlipRegion& stretch, double t);
  void finish(int id, double t, const std::function<double(PetscInt)>& eta);

  Scene scene_;
  std::vector<NodeCoefficients> coefficients_;  // of the nodes; one where all have the same
  Regions regions_;
  std::vector<int> owner_;              // event under way in whose region a node is; -1: none
  std::vector<double> slip_, squares_;  // of a node in a region: in this event; psi^2 at its last end of step
  std::vector<double> rupture_;         // where asked for: when a node in a region first slid in this event
  std::vector<SlipEvent> ended_;
};

}  // namespace stickslip
