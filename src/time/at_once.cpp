#include "time/at_once.hpp"

#include <cmath>

#include "base/broadcast.hpp"
#include "base/local_copy.hpp"
#include "base/local_values.hpp"
#include "model/massless.hpp"
#include "stickslip/base/error.hpp"
#include "time/allowed_error.hpp"

namespace stickslip {

bool balance_at_once(const Model& model, const Tolerances& tolerances, double moment, Vec u) {
  const Scene& s = model.scene();
  if (s.massless() || !model.friction_law(0).steep) return false;
  VecHandle viscous;
  if (model.viscous()) {
    viscous = model.create_vector();
    model.viscous_force(u, viscous);
  }
  const std::vector<double> from_neighbours = viscous ? local_values(viscous) : std::vector<double>();
  const int dof = model.dof();
  const double normal = model.normal_load(model.time()).N;
  bool any = false;
  {
    const Writing a(u);
    for (PetscInt i = 0; i < model.local(); ++i) {
      if (s.held(model.first() + i)) continue;
      double* const at = a + i * dof;
      const double psi = at[0], state = dof == 3 ? at[2] : 0;
      const double eta = at[1] + (viscous ? from_neighbours[std::size_t(i * dof + 1)] : 0);
      const NodeCoefficients c = model.coefficients(i);
      const double off = eta - c.B * psi - model.friction(i, psi, state).F;
      if (std::abs(off) <= allowed_error(tolerances, 1, eta)) continue;
      const MasslessNode node{model.friction_law(i), normal * model.amplitude()[i], c.B, true};
      const double balanced = node.velocity(eta, state, psi);
      // psi beyond 0, where a law of psi > 0 says no force, has come from there
      if (std::isnan(balanced) || std::abs(balanced - psi) > moment * c.A * std::abs(off)) continue;
      at[0] = balanced;
      any = true;
    }
  }
  return on_any_rank(model.comm(), any);
}

}  // namespace stickslip
