#include "stickslip/start.hpp"

#include <cmath>

#include "stickslip/error.hpp"
#include "stickslip/file.hpp"
#include "stickslip/ode.hpp"
#include "stickslip/wave.hpp"

namespace stickslip {

namespace {

// Data fit a held end of the continuum where psi is psi_e there and psi_t is 0. Otherwise the exact solution has a
// jump, or a jump in its slope, that runs inwards at the speed c and that finite differences cannot follow at their
// order. `jump` and `slope`: largest misfits over the held ends, of this rank.
void warn_of_misfit(const Model& model, double jump, double slope) {
  double misfit[2] = {jump, slope};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, misfit, 2, MPI_DOUBLE, MPI_MAX, model.comm()));
  const double scale = 1 + std::abs(model.scene().left_value) + std::abs(model.scene().right_value);
  const std::string order = std::to_string(model.scene().order);
  if (misfit[0] > 1e-8 * scale) {
    warn("the start does not fit the held end: psi jumps by " + number_text(misfit[0]) +
         " there, and the jump runs inwards without smoothing; expect convergence like h^(p/(p+1)), p = " + order +
         ", behind it and none at it (init_type layer fits)");
  } else if (misfit[1] > 1e-8 * model.scene().A() * scale) {
    warn("the start does not fit the held end: psi_t = " + number_text(misfit[1]) +
         " there instead of 0, a corner that runs inwards; expect convergence like h^(2p/(p+1)), p = " + order +
         " (init_eta steady fits)");
  }
}

// The state that is steady at psi; at rest, where a contact's age grows for ever, the one of steady sliding.
double steady_start(const Model& model, double psi) {
  const double state = model.steady_state(psi);
  return std::isfinite(state) ? state : model.steady_state(model.scene().v);
}

// A frame of a run's file, for the nodes of this scene.
Frame frame_for(const Scene& s, const Options& options) {
  if (!options.is_set("init_file")) throw UsageError("init_type file needs init_file, an HDF5 file of `run`");
  const std::string path = options.text("init_file");
  Frame frame = read_frame("init_file", path, options.is_set("init_frame") ? options.integer("init_frame") : -1);
  const std::string says = "init_file " + quoted(path) + ": ";
  const auto form = frame.options.find("model_form");
  if (form != frame.options.end() && form->second != to_string(s.form))
    throw UsageError(says + "its model_form is " + form->second + ", that of this scene " + to_string(s.form));
  const auto n = static_cast<std::size_t>(s.n);
  if (frame.x.size() != n)
    throw UsageError(says + "it has " + std::to_string(frame.x.size()) + " nodes, this scene grid_n " +
                     std::to_string(s.n));
  for (std::size_t i = 0; i < n; ++i)
    if (std::abs(frame.x[i] - s.x(static_cast<PetscInt>(i))) > 1e-9 * (1 + s.length))
      throw UsageError(says + "its nodes stand elsewhere (node " + std::to_string(i) + " at x = " +
                       number_text(frame.x[i]) + ", here " + number_text(s.x(static_cast<PetscInt>(i))) +
                       "); grid_length and ends must be the same");
  if (s.friction.state != StateLaw::none && !options.is_set("init_state")) {
    const auto state = frame.fields.find(state_name(s.friction.state));
    if (state == frame.fields.end())
      throw UsageError(says + "it holds no " + state_name(s.friction.state) + " for state_law " +
                       to_string(s.friction.state) + "; give init_state");
  }
  return frame;
}

// An eigenvector of the file of `spectrum` (its real part, times init_amplitude) added to steady sliding.
void start_from_eigenvector(const Model& model, const Options& options, Vec u) {
  const Scene& s = model.scene();
  const std::string path = options.text("init_file"), what = "init_file";
  const PetscInt mode = options.is_set("init_mode") ? options.integer("init_mode") : 0;
  std::vector<std::string> names{"psi", "eta"};
  if (model.dof() == 3) names.push_back(state_is_logarithmic(s.friction.state) ? "theta" : "tau");
  std::vector<std::vector<double>> values;
  for (const std::string& name : names) {
    std::vector<double> steady = read_array(what, path, "steady_" + name).values;
    const DataArray vectors = read_array(what, path, name + "_re");
    if (vectors.shape.size() != 2 || vectors.shape[1] != steady.size() || std::size_t(mode) >= vectors.shape[0])
      throw UsageError("init_mode " + std::to_string(mode) + ": '" + path + "' holds " +
                       std::to_string(vectors.shape.empty() ? 0 : vectors.shape[0]) + " eigenvectors, from 0");
    if (steady.size() != std::size_t(s.n))
      throw UsageError("init_file '" + path + "': it has " + std::to_string(steady.size()) +
                       " nodes, this scene grid_n " + std::to_string(s.n));
    for (std::size_t i = 0; i < steady.size(); ++i)
      steady[i] += options.real("init_amplitude") * vectors.values[std::size_t(mode) * steady.size() + i];
    values.push_back(std::move(steady));
  }
  const double noise = options.real("init_noise");
  double* a;
  SS_TRY(VecGetArray(u, &a));
  int bad = 0;
  for (PetscInt i = 0; i < model.local(); ++i) {
    const std::size_t g = std::size_t(model.first() + i);
    double* at = a + i * model.dof();
    at[0] = values[0][g];
    if (noise != 0) at[0] += noise * (2 * counter_uniform(options.integer("init_seed"), model.first() + i) - 1);
    at[1] = values[1][g];
    if (model.dof() == 3) at[2] = state_from_output(s.friction.state, values[2][g]);
    for (int c = 0; c < model.dof(); ++c)
      if (!std::isfinite(at[c])) bad = 1;
  }
  SS_TRY(VecRestoreArray(u, &a));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &bad, 1, MPI_INT, MPI_MAX, model.comm()));
  if (bad) throw UsageError("init_amplitude: with it the start is not finite, or a contact age is not positive");
  model.set_held(u);
}

}  // namespace

void set_start(const Model& model, const Options& options, Vec u) {
  if (options.text("init_type") == "file" && options.is_set("init_file") &&
      read_header("init_file", options.text("init_file")).kind == "spectrum")
    return start_from_eigenvector(model, options, u);
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
  Frame frame;
  if (type == "file") frame = frame_for(s, options);
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

  double jump = 0, slope = 0;
  bool no_state = false;
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
    } else if (type == "file") {
      psi = frame.fields["psi"][static_cast<std::size_t>(model.first() + i)];
    }
    const bool held_end = s.form == Form::continuum && model.held(model.first() + i);
    if (held_end) jump = std::max(jump, std::abs(psi - (model.first() + i == 0 ? s.left_value : s.right_value)));
    if (noise != 0 && !held_end) psi += noise * (2 * counter_uniform(seed, model.first() + i) - 1);
    at[0] = psi;
    double state = 0;
    const double phase = turns * x / s.length;
    if (dof == 3) {
      if (type == "pulses") state = orbit.state_at(phase);
      else if (type == "wave") state = train.state_at(phase);
      else if (type == "file" && !options.is_set("init_state"))
        state = state_from_output(s.friction.state, frame.fields[state_name(s.friction.state)]
                                                        [static_cast<std::size_t>(model.first() + i)]);
      else if (options.text("init_state") == "steady") state = steady_start(model, psi);
      else state = state_from_output(s.friction.state, options.real("init_state"));
      if (!std::isfinite(state)) no_state = true;
      at[2] = state;
    }
    const double resistance = s.B() * psi + model.friction(i, psi, state).F;
    if (type == "pulses") at[1] = orbit.eta_at(phase);
    else if (type == "wave") at[1] = train.eta_at(phase);
    else if (type == "file" && !options.is_set("init_eta"))
      at[1] = frame.fields["eta"][static_cast<std::size_t>(model.first() + i)];
    else at[1] = eta_steady ? resistance : options.real("init_eta");
    if (held_end) slope = std::max(slope, std::abs(s.A() * (at[1] - resistance)));
  }
  SS_TRY(VecRestoreArray(u, &a));
  int missing = no_state ? 1 : 0;
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &missing, 1, MPI_INT, MPI_MAX, model.comm()));
  if (missing)
    throw UsageError("init_state steady: at psi = 0 and model_v 0 no state is steady; give init_state a number");
  if (s.left == End::velocity || s.right == End::velocity) warn_of_misfit(model, jump, slope);
  model.set_held(u);
}

}  // namespace stickslip
