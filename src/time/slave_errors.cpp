#include "time/slave_errors.hpp"

#include "stickslip/model/frictions.hpp"

namespace stickslip {

SlaveErrors::SlaveErrors(const Scene& scene, const FrictionPlaces& places) {
  if (!scene.massless() && Frictions(scene, 0, 1)[0].steep) tangents_ = loop_for<TangentLoop>(scene.friction, false, places);
}

void SlaveErrors::operator()(const Columns& c,
                             const std::function<NodeCoefficients(PetscInt)>& coefficients) const {
  for (std::vector<double>* all : {&F_psi_, &F_state_, &g_psi_, &g_state_}) all->resize(std::size_t(c.count));
  tangents_({c.psi, c.state, c.amplitude, c.direction, F_psi_.data(), F_state_.data(), g_psi_.data(),
             g_state_.data(), c.count, c.number});
  for (PetscInt i = 0; i < c.count; ++i) {
    const NodeCoefficients own = coefficients(i);
    const double hA = c.h * own.A, a = 1 + hA * (own.B + F_psi_[i]), b = hA * F_state_[i];
    const double of_psi_from_state = c.h * g_psi_[i], d = 1 - c.h * g_state_[i];
    const double determinant = a * d + b * of_psi_from_state;
    if (!(determinant > 0)) continue;  // no slave: friction falls
    const double known = c.of_psi[i] + hA * c.of_eta[i], of_state = c.of_state[i];
    c.of_psi[i] = (known * d - b * of_state) / determinant;
    c.of_state[i] = (a * of_state + of_psi_from_state * known) / determinant;
  }
}

}  // namespace stickslip
