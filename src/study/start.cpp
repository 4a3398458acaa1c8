#include "stickslip/study/start.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "base/failure.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/waves/train.hpp"
#include "study/step_audit.hpp"

namespace stickslip {

// ---- the start from a file: a frame of a run, an eigenvector added to steady sliding, a NetCDF-4 or HDF5
// file of anybody, or text in columns; collective ----

namespace {

constexpr std::size_t nearest = 4;  // points of which a value between is made

// ---- values at the nodes from values at other points

double tolerance(const Scene& s) { return 1e-9 * s.length; }

bool stands_on_nodes(const Scene& s, const std::vector<double>& x) {
  bool stands = PetscInt(x.size()) == s.n;
  for (PetscInt i = 0; i < s.n && stands; ++i) stands = std::abs(x[i] - s.x(i)) <= tolerance(s);
  return stands;
}

// The points ascend and reach over the scene; on a ring the last is not the first again.
void check_reach(const Scene& s, const std::vector<double>& x, const std::string& says) {
  for (std::size_t i = 1; i < x.size(); ++i)
    if (!(x[i] > x[i - 1]))
      throw UsageError(fmt::format("{}its points must ascend (point {} at x = {}, the one before at {})",
                                   says, i, number_text(x[i]), number_text(x[i - 1])));
  if (x.size() < nearest)
    throw UsageError(says + std::to_string(x.size()) +
                     " points that are not this scene's nodes; four are the least");
  double widest = 0;
  for (std::size_t i = 1; i < x.size(); ++i) widest = std::max(widest, x[i] - x[i - 1]);
  const double low = x.front(), high = x.back(), gap = low + s.length - high;
  const bool covers =
      s.ring() ? gap > 0 && gap < 1.5 * widest : low <= tolerance(s) && high >= s.length - tolerance(s);
  if (low < -tolerance(s) || high > s.length + tolerance(s) || !covers)
    throw UsageError(says + "its points reach from x = " + number_text(low) + " to " + number_text(high) +
                     ", this scene" + (s.ring() ? ", a ring," : "") + " from 0 to " + number_text(s.length) +
                     "; they must cover it and not go beyond");
}

// At every node the cubic through the four nearest points.
std::vector<double> at_nodes(const Scene& s, const std::vector<double>& x,
                             const std::vector<double>& values) {
  const auto count = static_cast<long>(x.size());
  std::vector<double> result;
  for (PetscInt i = 0; i < s.n; ++i) {
    const double at = s.x(i);
    long first = std::upper_bound(x.begin(), x.end(), at) - x.begin() - 2;
    if (!s.ring()) first = std::clamp(first, 0l, count - long(nearest));
    std::vector<double> points, near;
    for (long j = first; j < first + long(nearest); ++j) {
      const long turn = j < 0 ? -1 : j >= count ? 1 : 0, k = j - turn * count;
      points.push_back(x[k] + double(turn) * s.length);
      near.push_back(values[k]);
    }
    result.push_back(Lagrange(points).value(near.data(), at));
  }
  return result;
}

void bring_to_nodes(const Scene& s, Frame& frame, const std::string& says) {
  if (stands_on_nodes(s, frame.x)) return;
  if (s.form == Form::chain)
    throw UsageError(says + "its " + std::to_string(frame.x.size()) + " points are not this chain's " +
                     std::to_string(s.n) + " blocks, between which there is nothing to interpolate");
  if (s.ring() && frame.x.size() > 1 &&
      std::abs(frame.x.back() - frame.x.front() - s.length) <= tolerance(s)) {
    frame.x.pop_back();
    for (auto& [name, values] : frame.fields)
      if (values.size() > frame.x.size()) values.pop_back();
  }
  check_reach(s, frame.x, says);
  const std::string state = s.friction.has_state() ? state_name(s.friction.state) : "";
  for (auto& [name, values] : frame.fields) {
    if (name != "psi" && name != "eta" && name != state) continue;
    if (name == state)
      for (double& value : values) value = state_from_output(s.friction.state, value);
    values = at_nodes(s, frame.x, values);
    if (name == state)
      for (double& value : values) value = state_to_output(s.friction.state, value);
  }
  warn(says + "its " + std::to_string(frame.x.size()) + " points are not this scene's " +
       std::to_string(s.n) + " nodes: the start is interpolated by cubics through the four nearest");
}

// The end of the run before this one, where it is asked for by its name.
const Frame* carried(const Options& options) {
  const CarriedFrame* frame = CarriedFrame::innermost();
  return frame && frame->start && options.text("init_file") == CarriedFrame::name ? &*frame->start : nullptr;
}

// What the scene needs is there and finite; a contact's age is positive.
void check_fields(const Scene& s, const Options& options, const Frame& frame, const std::string& says) {
  const std::string state = s.friction.has_state() ? state_name(s.friction.state) : "";
  if (!state.empty() && !options.is_set("init_state") && frame.fields.count(state) == 0)
    throw UsageError(says + "it holds no " + state + " for state_law " + to_string(s.friction.state) +
                     "; give init_state");
  for (const auto& [option, field] :
       {std::pair<std::string, std::string>("init_eta", "eta"), {"init_state", state}}) {
    if (!options.is_set(option) || frame.fields.count(field) == 0 || carried(options)) continue;
    const std::string given = option + " " + options.text(option), line = options.line_in_scene(option);
    if (!line.empty())
      throw UsageError(says + "it holds " + field + ", and so does " + line + ": " + given +
                       "; take one of them out (on the command line -" + option +
                       " replaces what the file holds)");
    warn(says + "-" + given + " replaces the " + field + " that it holds");
  }
  for (const auto& [name, values] : frame.fields) {
    if (name != "psi" && name != "eta" && name != state) continue;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(name == state ? state_from_output(s.friction.state, values[i]) : values[i]))
        throw UsageError(says + name + " = " + number_text(values[i]) + " at x = " + number_text(frame.x[i]) +
                         (std::isfinite(values[i]) ? " is no contact state" : " is not finite"));
  }
}

// ---- the kinds of files

std::string file_of(const Options& options) {
  if (!options.is_set("init_file"))
    throw UsageError("init_type " + options.text("init_type") + " needs init_file" +
                     (options.text("init_type") == "text"
                          ? ", a file of columns x psi eta, and the state where there is one"
                          : ", an HDF5 or NetCDF-4 file"));
  return options.text("init_file");
}
Frame frame_of_text(const Scene& s, const Options& options) {
  const std::string path = file_of(options);
  if (options.is_set("init_frame")) throw UsageError("init_frame: init_type text has no frames");
  std::vector<double> numbers;
  std::size_t columns = 0;
  on_root(PETSC_COMM_WORLD, [&] {
    const Rows rows = read_columns("init_file", path, options.line_in_scene("init_file"), 3, 4);
    columns = rows.values.front().size();
    for (const std::vector<double>& row : rows.values) numbers.insert(numbers.end(), row.begin(), row.end());
  });
  broadcast(columns);
  broadcast(numbers);
  if (columns == 4 && !s.friction.has_state())
    throw UsageError("init_file " + quoted(path) +
                     ": a fourth column, but this scene has no state (state_law none)");
  Frame frame;
  for (std::size_t i = 0; i < numbers.size(); i += columns) {
    frame.x.push_back(numbers[i]);
    frame.fields["psi"].push_back(numbers[i + 1]);
    frame.fields["eta"].push_back(numbers[i + 2]);
    if (columns == 4) frame.fields[state_name(s.friction.state)].push_back(numbers[i + 3]);
  }
  return frame;
}

Frame frame_of_file(const Scene& s, const Options& options) {
  const std::string path = file_of(options);
  if (const Frame* frame = carried(options)) return *frame;
  Frame frame =
      read_frame("init_file", path, options.is_set("init_frame") ? options.integer("init_frame") : -1);
  const auto form = frame.options.find("model_form");
  if (form != frame.options.end() && form->second != to_string(s.form))
    throw UsageError("init_file " + quoted(path) + ": its model_form is " + form->second +
                     ", that of this scene " + to_string(s.form));
  return frame;
}

// An eigenvector of the file of `spectrum` (its real part, times init_amplitude) added to steady sliding, as
// a frame.
Frame frame_from_eigenvector(const Scene& s, const Options& options) {
  const std::string path = options.text("init_file"), what = "init_file";
  const std::size_t mode = options.is_set("init_mode") ? std::size_t(options.integer("init_mode")) : 0;
  std::vector<std::string> names{"psi", "eta"};
  if (s.friction.has_state()) names.push_back(state_name(s.friction.state));
  Frame frame;
  for (const std::string& name : names) {
    std::vector<double> steady = read_array(what, path, "steady_" + name).values;
    const DataArray vectors = read_array(what, path, name + "_re");
    if (vectors.shape.size() != 2 || vectors.shape[1] != steady.size() || mode >= vectors.shape[0])
      throw UsageError(fmt::format("init_mode {}: '{}' holds {} eigenvectors, from 0", mode, path,
                                   vectors.shape.empty() ? 0 : vectors.shape[0]));
    if (PetscInt(steady.size()) != s.n)
      throw UsageError("init_file '" + path + "': it has " + std::to_string(steady.size()) +
                       " nodes, this scene grid_n " + std::to_string(s.n));
    for (std::size_t i = 0; i < steady.size(); ++i) {
      steady[i] += options.real("init_amplitude") * vectors.values[mode * steady.size() + i];
      const bool is_state = name != "psi" && name != "eta";
      if (!std::isfinite(is_state ? state_from_output(s.friction.state, steady[i]) : steady[i]))
        throw UsageError("init_amplitude: with it the start is not finite, or a contact age is not positive");
    }
    frame.fields[name] = std::move(steady);
  }
  return frame;
}

}  // namespace

// Whether init_file is one of `spectrum`; then start_frame() gives steady sliding with init_amplitude times
// the real part of eigenvector init_mode.
static bool starts_from_eigenvector(const Options& options) {
  return options.text("init_type") == "file" && options.is_set("init_file") && !carried(options) &&
         kind_of("init_file", options.text("init_file")) == "spectrum";
}

// Fields psi, eta and, where the scene has one, the state (as files show it) at every node of the scene, of
// init_type `file` (init_file, init_frame) or `text`. Where the points of the file are not the nodes, values
// between them lie on the cubic through the four nearest points, the state's on that of its logarithm where
// it is an age; a warning says so. Throws UsageError where the file cannot be read, does not reach over the
// scene or holds too little.
static Frame start_frame(const Scene& scene, const Options& options) {
  if (starts_from_eigenvector(options)) return frame_from_eigenvector(scene, options);
  Frame frame =
      options.text("init_type") == "text" ? frame_of_text(scene, options) : frame_of_file(scene, options);
  const std::string says = "init_file " + quoted(options.text("init_file")) + ": ";
  check_fields(scene, options, frame, says);
  bring_to_nodes(scene, frame, says);
  return frame;
}

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
  if (std::isfinite(state)) return state;
  // or, where it grows without end in motion too, that of rest
  const Scene& s = model.scene();
  return model.steady_state(local_node, s.friction.state->needs_stops ? 0 : s.v);
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
