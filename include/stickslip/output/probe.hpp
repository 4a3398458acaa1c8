// psi and eta at chosen points, interpolated from the nodes to the order of the scheme.
#pragma once

#include <vector>

#include "stickslip/model.hpp"

namespace stickslip {

// The p + 1 nodes nearest to x with the weights of their interpolating polynomial (periodic on a ring, shifted
// inwards at an end): error O(h^(p+1)). A point on a node takes that node alone. Throws UsageError outside the scene.
Combination interpolation_at(const Scene& scene, double x);

class Probes {
 public:
  // At points x of the scene `whole`, of which the model may be one of several equal cells. Collective.
  Probes(const Model& model, const Scene& whole, const std::vector<double>& x);

  struct Values {
    std::vector<double> psi, eta;  // in the order of x
  };
  // On every rank. Collective.
  const Values& read(Vec u);

 private:
  int dof_;
  std::vector<std::vector<std::pair<std::size_t, double>>> rows_;  // index into the fetched nodes, weight
  ScatterHandle scatter_;
  VecHandle fetched_;
  Values values_;
};

}  // namespace stickslip
