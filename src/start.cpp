#include "stickslip/start.hpp"

#include <cmath>

#include "stickslip/error.hpp"
#include "stickslip/ode.hpp"
#include "stickslip/wave.hpp"

namespace stickslip {

void set_start(const Model& model, const Options& options, Vec u) {
  const Scene& s = model.scene();
  const int dof = model.dof();
  const std::string type = options.text("init_type");
  const bool psi_steady = options.text("init_psi") == "steady";
  const double psi_i = psi_steady ? s.v : options.real("init_psi");
  const bool eta_steady = options.text("init_eta") == "steady" || (type == "layer" && !options.is_set("init_eta"));
  const double noise = options.real("init_noise");
  const PetscInt seed = options.integer("init_seed");
  Orbit orbit;
  Train train;
  double turns = 0;
  if (type == "wave" && !s.ring())
    throw UsageError("init_type wave needs a ring: bc_left periodic, not " + to_string(s.left));
  if (type == "wave") train = solve_train(s, {options.integer("init_pulses"), s.length, {}});
  if (type == "pulses") orbit = uniform_orbit(s);
  if (type == "pulses" || type == "wave") {
    // f(t - x/V): to the right the phase falls with x
    turns = double(options.integer("init_pulses")) * (options.text("init_direction") == "left" ? 1 : -1);
  }
  if (type == "layer" && s.left != End::velocity)
    throw UsageError("init_type layer fits a held left end: it needs bc_left velocity, not " + to_string(s.left));

  double* a;
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double x = s.x(model.first() + i);
    double* at = a + i * dof;
    double psi = psi_i;
    if (type == "sine") {
      psi += options.real("init_amplitude") * std::sin(2 * M_PI * double(options.integer("init_mode")) * x / s.length);
    } else if (type == "layer") {
      const double r = x / options.real("init_width");
      psi += (s.left_value - psi_i) * std::exp(-r * r);
    } else if (type == "pulses") {
      psi = orbit.psi_at(turns * x / s.length);
    } else if (type == "wave") {
      psi = train.psi_at(turns * x / s.length);
    }
    if (noise != 0) psi += noise * (2 * counter_uniform(seed, model.first() + i) - 1);
    at[0] = psi;
    double state = 0;
    if (dof == 3) {
      state = options.is_set("init_state") ? state_from_output(s.friction.state, options.real("init_state"))
                                           : model.steady_state(psi != 0 ? psi : s.v);
      if (!std::isfinite(state)) throw UsageError("init_state: no steady state at psi = 0 and v = 0; set init_state");
      at[2] = state;
    }
    if (type == "pulses") {
      at[1] = orbit.eta_at(turns * x / s.length);
    } else if (type == "wave") {
      at[1] = train.eta_at(turns * x / s.length);
      if (dof == 3) at[2] = train.state_at(turns * x / s.length);
    } else {
      at[1] = eta_steady ? s.B() * psi + model.friction(i, psi, state).F : options.real("init_eta");
    }
  }
  SS_TRY(VecRestoreArray(u, &a));
  model.set_held(u);
}

}  // namespace stickslip
