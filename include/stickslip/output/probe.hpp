// psi and eta at chosen points, interpolated from the nodes to the order of the scheme.
//
// In a spread continuum eta is no smoother than the medium: a(x) has two derivatives, and so has the part a F
// of eta. Interpolated are therefore eta - a F and F, which the medium reaches only through the waves that it
// gives off:
//     eta(x) = sum_i w_i [eta_i + (a(x) - a_i) F_i]
// and under a normal load N(t) a is N times that.
// Where the law itself differs along x, a(x) F(x; psi_i, state_i) - a_i F_i in the place of (a(x) - a_i) F_i.
// A state whose own law has corners has them too: no interpolation reaches over the corners of a profile.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

// The p + 1 nodes nearest to x with the weights of their interpolating polynomial (periodic on a ring,
// shifted inwards at an end and at a corner of a profile of friction, unless less than three nodes lie
// between two): error O(h^(p+1)). A point on a node takes that node alone, and so does one that round-off
// puts beyond an end.
class NodesAround {
 public:
  explicit NodesAround(const Scene& scene);
  // Throws UsageError outside the scene.
  Combination at(double x) const;
  // The first and the last node that a place may be interpolated from, whatever their number; on a ring they
  // may lie beyond its seam. Infinite where nothing is in the way.
  std::pair<double, double> range(double x) const;

 private:
  Scene scene_;
  std::vector<Corner> corners_;
};
Combination interpolation_at(const Scene& scene, double x);

// Friction at places of a continuum where it differs along x; without places none.
class FrictionAt {
 public:
  FrictionAt() = default;
  FrictionAt(const Scene& scene, const std::vector<double>& x);
  double force(std::size_t place, double psi, double state) const;  // a F

 private:
  std::vector<double> amplitude_;
  std::vector<std::shared_ptr<const Friction>> laws_;  // one, where it is the same everywhere
};

class Probes {
 public:
  // At points x of the scene `whole`, of which the model may be one of several equal cells. Collective.
  Probes(const Model& model, const Scene& whole, const std::vector<double>& x);

  struct Values {
    std::vector<double> psi, eta;  // in the order of x
  };
  // On every rank; loads are those of the time said last to the model. Collective.
  const Values& read(Vec u);
  // From node(i, unknowns), of one rank.
  const Values& read(const std::function<void(PetscInt, double*)>& node);
  const std::vector<PetscInt>& nodes() const { return nodes_; }  // that are looked at, of the model
  // psi at a place is a sum over some of them, by their places in that list: take(index, weight).
  template <class Take>
  void for_parts(std::size_t place, const Take& take) const {
    for (const Part& part : rows_[place]) take(part.index, part.weight);
  }

 private:
  struct Part {
    std::size_t index;  // into the fetched nodes
    double weight, excess;
  };
  std::shared_ptr<const Friction> friction_;  // where it is the same everywhere
  std::optional<FrictionAt> here_, own_;      // at the points and at the nodes, where it is not
  const Model& model_;
  int dof_;
  std::vector<std::vector<Part>> rows_;
  const Values& values_of(const double* nodes);
  std::vector<PetscInt> nodes_;
  std::optional<NodeFetch> fetch_;
  Values values_;
};

}  // namespace stickslip
