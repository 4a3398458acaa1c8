#include "stickslip/study/start.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "base/broadcast.hpp"
#include "base/failure.hpp"
#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/study/nearest_sliding.hpp"
#include "stickslip/waves/train.hpp"
#include "study/start_file.hpp"

namespace stickslip {

namespace {

// Data fit a held end of the continuum where psi is psi_e there and psi_t is 0. Otherwise the exact solution
// has a jump, or a jump in its slope, that runs inwards at the speed c and that finite differences cannot
// follow at their order. `jump` and `slope`: largest misfits over the held ends, of this rank.
void warn_of_misfit(const Model& model, double jump, double slope) {
  double misfit[2] = {jump, slope};
  largest_over(model.comm(), misfit, 2);
  const double scale = scales_of(model.scene()).slip.psi + std::abs(model.scene().left_value) +
                       std::abs(model.scene().right_value);
  const std::string order = std::to_string(model.scene().order);
  if (misfit[0] > 1e-8 * scale && model.viscous()) {
    warn("the start does not fit the held end: psi jumps by " + number_text(misfit[0]) +
         " there, a front that viscosity widens like sqrt(nu t); expect order " + order +
         " once it is wide against the nodes' spacing (init_type layer fits)");
  } else if (misfit[0] > 1e-8 * scale) {
    warn("the start does not fit the held end: psi jumps by " + number_text(misfit[0]) +
         " there, and the jump runs inwards without smoothing; expect convergence like h^(p/(p+1)), p = " +
         order + ", behind it and none at it (init_type layer fits)");
  } else if (!model.viscous() && misfit[1] > 1e-8 * model.scene().averaged().A() * scale) {
    warn("the start does not fit the held end: psi_t = " + number_text(misfit[1]) +
         " there instead of 0, a corner that runs inwards; expect convergence like h^(2p/(p+1)), p = " +
         order + " (init_eta steady fits)");
  }
}

// The state that is steady at psi; at rest, where a contact ages without bound, the one of steady sliding.
double steady_start(const Model& model, PetscInt local_node, double psi) {
  const double state = model.steady_state(local_node, psi);
  return std::isfinite(state) ? state : model.steady_state(local_node, model.scene().v);
}

// The force on a chain's held blocks: K1 times the displacement of the block beside it, since its own is 0 at
// the start. It enters no equation. Collective.
void set_held_force(const Model& model, Vec u) {
  const Scene& s = model.scene();
  if (s.form != Form::chain || !(model.held(0) || model.held(s.n - 1))) return;
  const Plate plate;
  const Displacement displacement(model, plate);
  const VecHandle chi = displacement.create_vector();
  displacement.solve(u, 0, chi);
  const auto is_here = [&](PetscInt node) {
    return node >= model.first() && node < model.first() + model.local();
  };
  const PetscInt ends[2] = {0, s.n - 1}, neighbours[2] = {1, s.n - 2};
  double beside[2] = {0, 0};
  const Reading x(chi);
  for (int k = 0; k < 2; ++k)
    if (is_here(neighbours[k])) beside[k] = x[neighbours[k] - model.first()];
  sum_over(model.comm(), beside, 2);
  const Writing a(u);
  for (int k = 0; k < 2; ++k)
    if (model.held(ends[k]) && is_here(ends[k]))
      a[(ends[k] - model.first()) * model.dof() + 1] = s.link(k == 0 ? 0 : s.n - 2) * beside[k];
}

// eta at which psi_t = 0, where it was that without viscosity between neighbours.
void balance_viscosity(const Model& model, Vec u) {
  const VecHandle force = model.create_vector();
  model.viscous_force(u, force);
  const Reading viscous(force);
  const Writing a(u);
  for (PetscInt i = 0; i < model.local(); ++i)
    if (!model.held(model.first() + i)) a[i * model.dof() + 1] -= viscous[i * model.dof() + 1];
}

// A law that does not hold for every velocity (Dieterich's logarithm) must hold for those of the start.
void check_law(const Model& model, Vec u) {
  const Law law = model.scene().friction.law;
  if (law->only_for.empty()) return;
  const Reading a(u);
  const int dof = model.dof();
  constexpr double none = std::numeric_limits<double>::infinity();
  double least = none;  // of the velocities without friction
  for (PetscInt i = 0; i < model.local(); ++i)
    if (!std::isfinite(model.friction(i, a[i * dof], dof == 3 ? a[i * dof + 2] : 0).F))
      least = std::min(least, a[i * dof]);
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &least, 1, MPI_DOUBLE, MPI_MIN, model.comm()));
  if (least < none)
    throw usage_error(
        "friction_law {} holds for {} alone, and the start goes down to psi = {}; give another "
        "init_psi, or init_noise",
        to_string(law), law->only_for, rounded_text(least, 6));
}

}  // namespace

struct Start::Impl {
  enum class Kind { uniform, sine, layer, pulses, wave, file };  // asked for at every node
  std::string type;
  Kind kind = Kind::uniform;
  bool from_file, from_eigenvector, eta_steady, eta_given, state_given, state_steady = false, psi_steady,
                                                                        noise_of_eta;
  double psi_given, eta = 0, state = 0, noise, noise_length, amplitude, width = 1, turns = 0;
  PetscInt seed, mode;
  Orbit orbit;
  Train train;
  std::optional<Frame> frame;

  Impl(const Scene& s, const Options& o)
      : type(o.text("init_type")), eta_given(o.is_set("init_eta")), state_given(o.is_set("init_state")),
        psi_steady(o.text("init_psi") == "steady"), noise_of_eta(o.text("init_noise_of") == "eta"),
        psi_given(psi_steady ? s.v : o.real("init_psi")), noise(o.real("init_noise")),
        noise_length(o.real("init_noise_length")), amplitude(o.real("init_amplitude")),
        seed(o.integer("init_seed")), mode(o.integer("init_mode")) {
    from_file = type == "file" || type == "text";
    for (const auto& [name, same] : {std::pair{"sine", Kind::sine},
                                     {"layer", Kind::layer},
                                     {"pulses", Kind::pulses},
                                     {"wave", Kind::wave},
                                     {"file", Kind::file},
                                     {"text", Kind::file}})
      if (type == name) kind = same;
    from_eigenvector = starts_from_eigenvector(o);
    if (from_eigenvector) {  // which says everything
      eta_steady = eta_given = state_given = false;
      frame = start_frame(s, o);
      return;
    }
    const bool psi_says = type == "layer" || (s.massless() && !from_file);
    eta_steady = o.text("init_eta") == "steady" || (psi_says && !eta_given);
    if (s.massless() && !eta_steady && o.is_set("init_psi"))
      throw UsageError("init_psi " + o.text("init_psi") + " with init_eta " + o.text("init_eta") +
                       ": with model_m 0 one follows from the other; give one of them (init_eta: psi is its "
                       "nearest to 0.1)");
    if (s.massless() && noise_of_eta && noise != 0)
      throw UsageError("init_noise_of eta: with model_m 0 eta follows from psi, to which noise is added");
    if (!eta_steady) eta = o.real("init_eta");
    if (s.friction.has_state()) {
      state_steady = o.text("init_state") == "steady";
      if (!state_steady) state = state_from_output(s.friction.state, o.real("init_state"));
    }
    if (type == "layer") width = o.real("init_width");
    if (from_file) frame = start_frame(s, o);
    if (from_file && noise != 0)
      warn("init_noise " + o.text("init_noise") + " with init_type " + type +
           " is added to what the file holds, each time that a "
           "run goes on from another in this way");
    if (type == "wave" && !s.ring())
      throw UsageError("init_type wave needs a ring: bc_left periodic, not " + to_string(s.left));
    if (type == "wave") train = solve_train(s, {o.integer("init_pulses"), s.length, {}});
    if (type == "pulses") orbit = uniform_orbit(s);
    // f(t - x/V): to the right the phase falls with x
    if (type == "pulses" || type == "wave")
      turns = double(o.integer("init_pulses")) * (o.text("init_direction") == "left" ? 1 : -1);
    if (type == "layer" && s.left != End::velocity)
      throw UsageError("init_type layer fits a held left end: it needs bc_left velocity, not " +
                       to_string(s.left));
  }

  // psi of steady sliding at a node, where init_psi is `steady`: beside ends held away from v it differs from
  // node to node. Empty elsewhere: the same for all.
  using Base = std::function<double(PetscInt)>;
  Base base_of(const Scene& s) const {
    if (!psi_steady || (kind != Kind::uniform && kind != Kind::sine) || slides_at_v(s)) return {};
    if (Base layers = steady_velocity(s)) return layers;
    warn("init_psi steady: the scene has no steady sliding beside its held ends; psi begins at model_v");
    return {};
  }

  double psi_at(const Scene& s, double length, PetscInt node, const Base& base) const {
    const double x = s.x(node), psi_i = base ? base(node) : psi_given;
    switch (kind) {
      case Kind::sine: return psi_i + amplitude * std::sin(2 * M_PI * double(mode) * x / length);
      case Kind::layer: return psi_i + (s.left_value - psi_i) * std::exp(-(x / width) * (x / width));
      case Kind::pulses: return orbit.psi_at(turns * x / length);
      case Kind::wave: return train.psi_at(turns * x / length);
      case Kind::file: return frame->fields.at("psi")[node];
      default: return psi_i;
    }
  }

  // Of a held node: steady at the velocity that it is held at, whatever the others start with.
  double state_at(const Model& model, double phase, PetscInt node, double psi) const {
    const StateLaw law = model.scene().friction.state;
    const bool is_given = state_given && !state_steady, in_file = from_file && !state_given;
    if (model.held(node) && !is_given && !in_file)
      return steady_start(model, node - model.first(),
                          node == 0 ? model.scene().left_value : model.scene().right_value);
    if (kind == Kind::pulses) return orbit.state_at(phase);
    if (kind == Kind::wave) return train.state_at(phase);
    if (from_file && !state_given) return state_from_output(law, frame->fields.at(state_name(law))[node]);
    return state_steady ? steady_start(model, node - model.first(), psi) : state;
  }

  // Whether eta is B psi + F(psi), and with viscosity between neighbours balances that too.
  bool makes_eta_steady() const {
    return eta_steady && kind != Kind::pulses && kind != Kind::wave && (!from_file || eta_given);
  }

  double eta_at(double phase, PetscInt node, double resistance) const {
    if (kind == Kind::pulses) return orbit.eta_at(phase);
    if (kind == Kind::wave) return train.eta_at(phase);
    if (from_file && !eta_given) return frame->fields.at("eta")[node];
    return eta_steady ? resistance : eta;
  }

  // The start on this rank's nodes, and how far it misses held ends there (warn_of_misfit). False: at some of
  // them no state is steady.
  bool fill(const Model& model, double* a, double& jump, double& slope) const {
    const Scene& s = model.scene();
    const double length = s.length * double(s.copies);
    const int dof = model.dof();
    bool has_state = true;
    const bool follows_friction = makes_eta_steady();
    const Base base = base_of(s);
    for (PetscInt i = 0; i < model.local(); ++i) {
      const PetscInt node = model.first() + i;
      double* at = a + i * dof;
      double psi = psi_at(s, length, node, base);
      const bool held_end = s.form == Form::continuum && model.held(node) && !from_eigenvector;
      if (held_end) jump = std::max(jump, std::abs(psi - (node == 0 ? s.left_value : s.right_value)));
      const double drawn = noise != 0 && !held_end ? noise * noise_at(s, noise_length, seed, node) : 0;
      if (drawn != 0 && !noise_of_eta) psi += drawn;
      at[0] = psi;
      const double phase = turns != 0 ? turns * s.x(node) / length : 0,
                   here = dof == 3 ? state_at(model, phase, node, psi) : 0;
      if (!std::isfinite(here)) has_state = false;
      if (dof == 3) at[2] = here;
      const double resistance =
          follows_friction || held_end ? model.coefficients(i).B * psi + model.friction(i, psi, here).F : 0;
      at[1] = eta_at(phase, node, resistance);
      if (noise_of_eta) at[1] += drawn;
      if (held_end) slope = std::max(slope, std::abs(s.A() * (at[1] - resistance)));
    }
    return has_state;
  }
};

Start::Start(const Scene& scene, const Options& options) : impl_(std::make_unique<Impl>(scene, options)) {}
Start::~Start() = default;

void Start::fill(const Model& model, Vec u) const {
  double jump = 0, slope = 0;
  const bool has_state = impl_->fill(model, Writing(u), jump, slope);
  if (on_any_rank(model.comm(), !has_state))
    throw UsageError(
        "init_state steady: at psi = 0 and model_v 0 no state is steady; give init_state a number");
  const Scene& s = model.scene();
  if (s.left == End::velocity || s.right == End::velocity) warn_of_misfit(model, jump, slope);
  model.set_held(u);
  set_held_force(model, u);
  if (model.viscous() && impl_->makes_eta_steady()) balance_viscosity(model, u);
  model.solve_velocities(u);
  if (const std::string lost = model.velocity_jump(u); !lost.empty())
    throw UsageError("model_m 0 at the start: " + lost);
  check_law(model, u);
}

Start::Misfit Start::misfit(const Scene& scene) const {
  Misfit misfit;
  if (impl_->from_file || scene.form == Form::chain) return misfit;
  const double length = scene.length * double(scene.copies);
  const Impl::Base base = impl_->base_of(scene);
  if (scene.left == End::velocity) misfit.left = scene.left_value - impl_->psi_at(scene, length, 0, base);
  if (scene.right == End::velocity)
    misfit.right = scene.right_value - impl_->psi_at(scene, length, scene.n - 1, base);
  return misfit;
}

void set_start(const Model& model, const Options& options, Vec u) {
  Start(model.scene(), options).fill(model, u);
}

}  // namespace stickslip
