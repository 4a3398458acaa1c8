// How the rows of the option table are written (option_table.cpp).

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "options/values.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// What else a row says, in words that can be strung together.
class OptionRow {
 public:
  explicit OptionRow(OptionSpec& spec) : spec_(spec) {}
  OptionRow& at_least(double low) {
    spec_.low = low;
    return *this;
  }
  OptionRow& above(double low) {
    spec_.open_low = true;
    return at_least(low);
  }
  OptionRow& at_most(double high) {
    spec_.high = high;
    return *this;
  }
  OptionRow& words(std::vector<std::string> list) {
    spec_.words = std::move(list);
    return *this;
  }
  OptionRow& unit(const char* text) {
    spec_.unit = text;
    return *this;
  }
  OptionRow& read_by(const char* commands) {
    spec_.commands = commands;
    return *this;
  }
  // What holds where it is unset, in words; and as a text, where it depends on other options.
  OptionRow& unset(const char* help, std::function<std::string(const Options&)> value = nullptr) {
    spec_.default_text = "";
    spec_.default_help = help;
    spec_.default_of = std::move(value);
    return *this;
  }
  // It changes something only where another option has one of these values ("": is set), and says else what
  // that option is.
  OptionRow& where(const char* other, std::vector<std::string> values) {
    spec_.idle_of = [name = std::string(other), list = std::move(values)](const Options& o) {
      const bool flag = find_option(name)->type == OptionType::boolean;
      const std::string text = flag ? (o.boolean(name) ? "true" : "false") : o.text(name),
                        is = " is " + (text.empty() ? "not set" : text);
      for (const std::string& value : list)
        if (value.empty() ? !text.empty() : text == value) return std::string();
      return name + is;
    };
    return *this;
  }
  OptionRow& where_not_zero(const char* other) {
    spec_.idle_of = [name = std::string(other)](const Options& o) {
      return o.real(name) == 0 ? name + " is 0" : "";
    };
    return *this;
  }
  OptionRow& idle_of(std::function<std::string(const Options&)> reason) {
    spec_.idle_of = std::move(reason);
    return *this;
  }

 private:
  OptionSpec& spec_;
};

// Builds the table; `in` gives the heading and the readers of the options that follow.
class OptionTableBuilder {
 public:
  std::vector<OptionSpec> rows;

  void in(const char* group, const char* commands) {
    group_ = group;
    commands_ = commands;
  }
  OptionRow add(OptionSpec spec) {
    spec.group = group_;
    spec.commands = commands_;
    rows.push_back(std::move(spec));
    return OptionRow(rows.back());
  }
  OptionRow add(const char* name, OptionType type, const char* value, const char* help) {
    return add({name, type, value, "", "", -all, all, false, {}, help, "", ""});
  }
  OptionRow real(const char* name, const char* value, const char* help, const char* unit = "") {
    return add(name, OptionType::real, value, help).unit(unit);
  }
  OptionRow positive(const char* name, const char* value, const char* help, const char* unit = "") {
    return real(name, value, help, unit).above(0);
  }
  OptionRow not_negative(const char* name, const char* value, const char* help, const char* unit = "") {
    return real(name, value, help, unit).at_least(0);
  }
  OptionRow reals(const char* name, const char* help, const char* unit = "") {
    return add(name, OptionType::real_list, "", help).unit(unit);
  }
  OptionRow integer(const char* name, const char* value, double low, double high, const char* help) {
    return add(name, OptionType::integer, value, help).at_least(low).at_most(high);
  }
  OptionRow integers(const char* name, double low, double high, const char* help) {
    return add(name, OptionType::integer_list, "", help).at_least(low).at_most(high);
  }
  OptionRow boolean(const char* name, const char* value, const char* help) {
    return add(name, OptionType::boolean, value, help);
  }
  OptionRow text(const char* name, const char* value, const char* help) {
    return add(name, OptionType::text, value, help);
  }
  OptionRow choice(const char* name, std::vector<std::string> words, const char* help) {
    return add(name, OptionType::choice, words[0].c_str(), help).words(words);
  }
  OptionRow real_or(const char* name, const char* word, const char* value, const char* help,
                    const char* unit = "") {
    return add(name, OptionType::real_or_word, value, help).words({word}).unit(unit);
  }

 private:
  static constexpr double all = std::numeric_limits<double>::infinity();
  std::string group_, commands_;
};

// The table of the program's own options.

namespace {

constexpr const char* physics = "run spectrum boundary wave cycle chart fit";
constexpr double n_max = double(std::int64_t(int_max) / 3);  // three unknowns a node are still counted

bool is_chain(const Options& options) { return options.text("model_form") == "chain"; }

// A cell of one block that is repeated (cycle_spectrum) has neighbours.
std::string one_block(const Options& options) {
  const bool alone = is_chain(options) && options.text("grid_n") == "1" && !options.boolean("cycle_spectrum");
  return alone ? "grid_n is 1, and one block has no neighbour" : "";
}

std::string one_block_without_paper(const Options& options) {
  return options.text("model_zeta") == "paper" ? "" : one_block(options);  // which is of sqrt(0.1 m k1)
}

std::string no_threshold(const Options& options) {
  const std::string law = options.text("friction_law");
  return law_options().has_threshold(options) ? "" : "friction_law is " + law + ", which has no threshold";
}

void model_options(OptionTableBuilder& t) {
  t.in("Model", physics);
  t.choice("model_form", {"continuum", "chain"}, "continuum, or chain of blocks");
  t.positive("model_gamma", "3", "continuum: friction amplitude gamma");
  t.not_negative("model_delta", "", "continuum: damping delta")
      .unset("0.2; the chain has none", [](const Options& o) { return is_chain(o) ? "0" : "0.2"; });
  t.not_negative("model_c", "1", "continuum: speed of sound c", "length/time");
  t.choice(
      "model_delta_sign", {"derived", "printed"},
      "continuum: sign of the damping in the force equation, +1 as derived or -1 as printed in the paper");
  t.not_negative("model_m", "1",
                 "chain: mass of a block; 0: the massless limit, where B psi + F = eta says what psi is",
                 "force*time^2/length");
  t.not_negative("model_k0", "0.2", "chain: stiffness to the driving plate", "force/length");
  t.not_negative("model_k1", "0.2", "chain: stiffness between neighbours", "force/length")
      .idle_of(one_block_without_paper);
  t.positive("model_f0", "1", "chain: friction amplitude", "force");
  t.real_or("model_zeta", "paper", "0", "chain: viscosity; `paper` is sqrt(0.1 m k1)", "force/velocity")
      .at_least(0);
  t.not_negative("model_nu", "0", "viscosity between neighbours: nu psi_xx in the force",
                 "length^2/time; chain: force/velocity")
      .idle_of(one_block);
  t.not_negative("model_drag", "0", "drag c3: the force c3 psi |psi| added to friction", "1/velocity^2");
  t.real("model_v", "0.2", "velocity of the driving plate", "velocity");
}

void friction_options(OptionTableBuilder& t) {
  t.in("Friction", "run spectrum boundary wave cycle chart laws fit");
  const LawOptions laws = law_options();
  t.choice("friction_law", laws.laws,
           "friction law F(psi): velocity weakening (carlson-langer, stribeck, table), slip weakening, rate "
           "and state, bristles (LuGre, Dahl)");
  t.choice("friction_stick", {"exact", "regularised"},
           "laws with a threshold: exact stick, or sgn(psi) smoothed to tanh(psi/eps)")
      .idle_of(no_threshold);
  t.positive("friction_eps", "1e-3", "regularised stick: velocity of the smoothing", "velocity")
      .idle_of(no_threshold);
  t.boolean("friction_back_slip", "true", "exact stick: false lets no force drive a stuck node backwards")
      .idle_of(no_threshold);
  for (const OptionSpec& parameter : laws.of_laws) t.add(parameter);
  t.not_negative("friction_spread", "0", "spread of the friction amplitude from node to node (mean 1)");
  t.choice("friction_spread_kind", {"uniform", "lognormal"},
           "distribution: uniform on [1 - spread, 1 + spread], or "
           "exp(spread z - spread^2/2) with z normal")
      .where_not_zero("friction_spread");
  t.positive("friction_spread_length", "1", "continuum: distance between independent draws", "length")
      .where_not_zero("friction_spread");
  t.integer("friction_seed", "1", 0, int_max, "seed of the spread").where_not_zero("friction_spread");
}

void profile_options(OptionTableBuilder& t) {
  t.in("Profiles along x", physics);
  t.choice("profile_kind", {"linear", "smooth", "step"},
           "between the places of a profile: straight, smoothly, or a value until the next place");
  for (const OptionSpec& spec : law_options().of_profiles) t.add(spec);
}

void load_options(OptionTableBuilder& t) {
  t.in("Loading", physics);
  t.add("load_v", OptionType::pairs, "",
        "run: v(t) in place of model_v, t1:v1,t2:v2,... or a file of two columns; straight between, a step "
        "where a "
        "time stands twice")
      .unset("none")
      .unit("velocity");
  t.real("load_sine_amplitude", "0", "run cycle boundary: a sine on top of v(t): its amplitude", "velocity");
  t.positive("load_sine_period", "1", "run cycle boundary: its period", "time")
      .where_not_zero("load_sine_amplitude");
  t.real("load_force_sine_amplitude", "0",
         "run cycle boundary: p of a force p sin(2 pi t/T) on every node, beside eta", "1");
  t.positive("load_force_sine_period", "1", "run cycle boundary: its period T", "time")
      .where_not_zero("load_force_sine_amplitude");
  t.add("load_normal", OptionType::pairs, "",
        "run: N(t), by which friction and its threshold are multiplied, t1:N1,t2:N2,... or a file of two "
        "columns, as load_v takes them; N > 0")
      .unset("none")
      .unit("1");
  t.real("load_normal_sine_amplitude", "0",
         "run cycle boundary: a sine on top of N(t), or of 1: its amplitude", "1");
  t.positive("load_normal_sine_period", "1", "run cycle boundary: its period", "time")
      .where_not_zero("load_normal_sine_amplitude");
  t.boolean("load_halt", "false",
            "run: the plate and its clock stop while any node slips (friction that sticks exactly)");
}

void contact_options(OptionTableBuilder& t) {
  t.in("State of the contact", "run spectrum boundary wave cycle chart laws fit");
  const LawOptions laws = law_options();
  t.choice("state_law", laws.states,
           "kinetic equation of the contact; ageing, slip, ageing-cutoff and prz belong to rate-and-state, "
           "n-shaped and dieterich; slip-memory, slip-since-stop and slip-healed-at-rest to slip-weakening, "
           "bristles to lugre and dahl")
      .unset(
          "none; ageing with rate-and-state and dieterich, ageing-cutoff with n-shaped, slip-memory with "
          "slip-weakening, bristles with lugre and dahl",
          laws.default_state);
  for (const OptionSpec& parameter : laws.of_states) t.add(parameter);
  t.real("state_linker_dieterich", "0",
         "alpha: ageing and slip lose alpha N'/(b N) of ln theta with a normal load N(t), load_normal", "1");
}

void grid_options(OptionTableBuilder& t) {
  t.in("Grid and ends", physics);
  t.integer("grid_n", "512", 1, n_max, "nodes; the chain's blocks (auto: as if it were not set)")
      .words({"auto"});
  t.positive("grid_length", "", "length of the medium", "length")
      .unset("60; the chain: n on a ring, else n - 1", [](const Options& o) {
        const PetscInt n = o.integer("grid_n");
        if (!is_chain(o)) return std::string("60");
        return std::to_string(o.text("bc_left") == "periodic" ? n : std::max<PetscInt>(n - 1, 1));
      });
  t.choice("grid_order", {"4", "2", "6", "8"}, "continuum: order of the second difference")
      .unset("4; the chain and a profile of c: 2",
             [](const Options& o) { return is_chain(o) || o.is_set("model_c_profile") ? "2" : "4"; });
  for (const auto& [end, other] : {std::pair("bc_left", "bc_right"), std::pair("bc_right", "bc_left")})
    t.choice(end, {"periodic", "velocity", "free"},
             "end of the medium: periodic (both or neither), held at a velocity, or free")
        .unset("periodic; free where the other end is set", [name = other](const Options& o) {
          return o.is_set(name) && o.text(name) != "periodic" ? "free" : "periodic";
        });
  const auto v = [](const Options& o) { return o.text("model_v"); };
  t.real("bc_left_value", "", "velocity of a held left end", "velocity").unset("model_v", v);
  t.real("bc_right_value", "", "velocity of a held right end", "velocity").unset("model_v", v);
}

void start_options(OptionTableBuilder& t) {
  t.in("Start", "run cycle chart fit");
  t.choice(
      "init_type", {"uniform", "sine", "layer", "pulses", "wave", "file", "text"},
      "uniform; sine: psi = init_psi + init_amplitude sin(2 pi init_mode x/L); layer: psi falls from "
      "bc_left_value to init_psi like exp(-(x/init_width)^2); pulses: turns of the uniform oscillation laid "
      "round the ring; wave: the travelling train; file: a frame or an eigenvector of init_file; text: its "
      "columns");
  t.choice("init", {"rest", "sliding"},
           "where it starts, unless init_psi and init_eta say: at rest under no force, or on steady sliding")
      .unset("rest for laws with a threshold and for tables; else psi and eta are 0.1",
             [laws = law_options()](const Options& o) {
               return laws.has_threshold(o) || o.text("friction_law") == "table" ? "rest" : "";
             })
      .where("init_type", {"uniform", "sine", "layer"});
  const auto by_start = [](const Options& o) {
    const std::string start = o.text("init");
    return start == "rest" ? "0" : start == "sliding" ? "steady" : "0.1";
  };
  t.real_or("init_psi", "steady", "", "psi at the start; `steady` is steady sliding", "velocity")
      .unset("by init: 0, steady or 0.1", by_start)
      .where("init_type", {"uniform", "sine", "layer"});
  t.real_or("init_eta", "steady", "", "eta at the start; `steady` makes psi_t = 0")
      .unset("by init: 0, steady or 0.1; steady for a layer", [by_start](const Options& o) {
        return o.text("init_type") == "layer" ? "steady" : by_start(o);
      });
  t.real_or("init_state", "steady", "steady", "state at the start: tau for healing, else theta").at_least(0);
  t.real("init_amplitude", "0.5", "sine: amplitude (file: of an eigenvector)", "velocity")
      .where("init_type", {"sine", "file"});
  t.integer("init_mode", "1", 0, int_max,
            "sine: whole waves in L (file: number of the eigenvector, from 0; there 0 is the default)")
      .where("init_type", {"sine", "file"});
  t.positive("init_width", "2", "layer: width", "length").where("init_type", {"layer"});
  t.integer("init_pulses", "1", 1, int_max, "pulses, wave: number of pulses on the ring")
      .where("init_type", {"pulses", "wave"});
  t.choice("init_direction", {"right", "left"}, "pulses, wave: direction of travel")
      .where("init_type", {"pulses", "wave"});
  t.not_negative("init_noise", "0",
                 "amplitude of noise added to psi (init_noise_of), uniform on [-1, 1] times this",
                 "velocity");
  t.choice("init_noise_of", {"psi", "eta"}, "what the noise is added to").where_not_zero("init_noise");
  t.not_negative(
       "init_noise_length", "1",
       "distance between its independent values, with a smooth course between them; 0: one value a node, "
       "which changes with the grid (in the chain always one a block)",
       "length")
      .where_not_zero("init_noise");
  t.integer("init_seed", "1", 0, int_max, "seed of the noise").where_not_zero("init_noise");
  t.text("init_file", "",
         "file to start from: HDF5 of this program, or any HDF5 or NetCDF-4 file with x, psi, eta and the "
         "state; "
         "text: columns x psi eta, and the state where there is one")
      .unset("none")
      .where("init_type", {"file", "text"});
  t.integer("init_frame", "", 0, int_max, "frame of init_file, from 0")
      .unset("the last")
      .where("init_type", {"file"});
}

void time_options(OptionTableBuilder& t) {
  t.in("Time stepping", "run chart boundary fit");
  t.not_negative("ts_max_time", "60", "end time, hit exactly", "time");
  t.integer("ts_max_steps", "", 0, count_max, "most steps").unset("unlimited");
  t.add("ts_max_wall", OptionType::wall_time, "",
        "wall clock after which the run ends, with a checkpoint to go on from")
      .unset("unlimited")
      .read_by("run");
  t.positive("ts_max_plate", "", "with load_halt: the run ends where the plate's clock shows this", "time")
      .unset("none")
      .where("load_halt", {"true"})
      .read_by("run");
  t.real_or("ts_atol", "auto", "auto",
            "absolute tolerance of a step. auto: 1e-6 of the scene's own scales of velocity, force and "
            "state; auto:NUMBER: such a part of them; a number: of every unknown, in its own unit")
      .words({"auto", "auto:NUMBER"})
      .at_least(0);
  t.choice("imex_implicit", {"auto", "none", "friction", "wave", "both"},
           "terms that an IMEX method takes implicitly");
  t.in("Time stepping", "run");
  t.positive("accuracy", "",
             "largest error wanted in psi and eta at the end; chooses what is not set otherwise")
      .unset("none");
  t.text("accuracy_of", "fields",
         "what -accuracy is wanted of: fields, probe:x (psi and eta at x, at the end), speed (wave_speed), "
         "period (at out_probes), amplitude or events (when they begin and end)");
  t.positive("accuracy_seconds", "60", "processor time that choosing for -accuracy may take")
      .where("accuracy", {""});
  t.in("Time stepping", "run chart fit");
  t.boolean("rk_fused", "true",
            "take all stages of a step of rk, and of arkimex, tile by tile in the "
            "cache; false: PETSc's own step");
  t.choice("stick_clusters", {"auto", "on", "off"},
           "friction that sticks exactly: auto advances only what slides, each cluster by its own steps, "
           "where that can be had; on refuses to run elsewhere; off: steps of the whole medium")
      .idle_of(no_threshold)
      .read_by("run");
  t.choice("scene_reduce", {"auto", "off"}, "solve the smaller problem where the scene allows it");
}

void output_options(OptionTableBuilder& t) {
  t.in("Output", "");
  t.text("out_file", "", "HDF5 file for the results").unset("none");
  t.text("summary", "", "JSON file for the summary, - for standard output").unset("none");
  t.choice("progress", {"auto", "on", "off"},
           "progress on standard error, and at the end some lines on the results; off: neither");
  t.in("Output", "run");
  t.boolean("check", "false", "check the scene and print size, cost and method without running");
  t.positive("out_every", "", "time between frames", "time").unset("none");
  t.integer("out_frames", "200", 2, int_max, "frames, equally spaced, both ends included");
  t.positive("out_limit", "20", "frames that would need more are refused", "GB");
  t.reals("out_times", "times of the frames", "time").at_least(0).unset("none");
  t.reals("out_probes", "positions of the probes", "length").at_least(0).unset("none");
  t.not_negative("out_maxima", "",
                 "position where the maxima of psi in the second half of the run go into the summary",
                 "length")
      .unset("none");
  t.boolean("out_displacement", "false", "write the displacement chi as well");
  t.boolean("out_series", "true", "write the group series, a row for every step");
  t.integer("out_series_every", "1", 1, int_max,
            "series: a row for every so many steps; with clusters, for so many times at which nodes begin to "
            "slide or stop")
      .where("out_series", {"true"});
  t.boolean("out_events", "false",
            "catalogue of slip events: group events, a row for every event that has ended");
  t.not_negative("out_events_velocity", "", "events: velocity above which a node moves", "velocity")
      .unset("0 with friction that sticks, else 2 |model_v|")
      .where("out_events", {"true"});
  t.boolean(
       "out_rupture", "false",
       "events: when each node of an event first slips, group events/rupture, and the speeds of its fronts")
      .where("out_events", {"true"});
  t.add("out_checkpoint_every", OptionType::steps_or_time, "",
        "steps or wall clock (30s, 10m, 2h) between checkpoints")
      .unset("none");
  t.integer("out_checkpoint_keep", "2", 1, int_max, "checkpoints kept").where("out_checkpoint_every", {""});
  t.text("restart", "", "checkpoint to go on from; of `sweep` its table").unset("none").read_by("run sweep");
}

void lyapunov_options(OptionTableBuilder& t) {
  t.in("Lyapunov exponents", "run");
  t.integer(
      "lyapunov_count", "0", 0, int_max,
      "number of Lyapunov exponents, the largest ones, measured in the run (the whole scene is solved); "
      "0: none");
  t.not_negative("lyapunov_from", "", "time at which the measurement begins", "time")
      .unset("a quarter of ts_max_time",
             [](const Options& o) { return number_text(0.25 * o.real("ts_max_time")); })
      .where_not_zero("lyapunov_count");
}

void spectrum_options(OptionTableBuilder& t) {
  t.in("Spectrum", "spectrum");
  t.integer("spectrum_count", "12", 1, int_max, "eigenvalues wanted").read_by("spectrum wave");
  t.choice("spectrum_method", {"auto", "dense", "krylov"}, "eigensolver");
  t.choice("spectrum_refine", {"auto", "off"},
           "auto compares grids (or takes the continuum's waves where all nodes are equal); off counts every "
           "mode "
           "of the matrix "
           "as resolved")
      .read_by("spectrum boundary");
}

void boundary_options(OptionTableBuilder& t) {
  t.in("Boundary", "boundary");
  t.text("boundary_parameter", "", "real option to vary, e.g. model_v").unset("required");
  t.real("boundary_from", "", "start of its range").unset("required");
  t.real("boundary_to", "", "end of its range").unset("required");
  t.boolean("boundary_log", "false", "logarithmic in the first parameter");
  t.text("boundary_parameter2", "", "second option: the boundary is traced as a curve").unset("none");
  t.real("boundary_from2", "", "start of its range").unset("none");
  t.real("boundary_to2", "", "end of its range").unset("none");
  t.boolean("boundary_log2", "false", "logarithmic in the second parameter");
  t.add("boundary_same", OptionType::text_list, "",
        "options that take the value of boundary_parameter, e.g. model_k0")
      .unset("none");
  t.choice("boundary_of", {"both", "sliding", "stick-slip", "all"},
           "whose end: where sliding loses stability, where the stick-slip of uniform motion (with "
           "cycle_cell, of a cell) ends, "
           "or both; all: also where the latter and trains of wave_pulses withstand waves on the ring, in "
           "two options");
  t.integer("boundary_points", "41", 2, int_max, "points on the curve, about");
  t.integer("boundary_verify", "0", 0, int_max, "points checked by time integration on both sides");
}

void wave_options(OptionTableBuilder& t) {
  t.in("Wave", "wave");
  t.integer("wave_pulses", "1", 1, int_max, "pulses on the ring");
  t.positive("wave_length", "", "length of the whole ring (this or wave_speed)", "length").unset("none");
  t.real("wave_speed", "", "speed; negative runs left (this or wave_length)", "length/time").unset("none");
  t.boolean("wave_spectrum", "false", "eigenvalues of the wave");
  t.text("wave_continue", "", "real option to vary along a branch").unset("none");
  t.real("wave_to", "", "end of the branch").unset("none");
  t.integer("wave_steps", "100", 1, int_max, "steps along the branch, at most");
  t.text("wave_continue2", "",
         "second real option, in which folds and changes of stability of the branch are followed")
      .unset("none");
  t.real("wave_to2", "", "end of those curves; they begin at the value of that option").unset("none");
}

void cycle_options(OptionTableBuilder& t) {
  t.in("Cycle", "cycle");
  t.integer("cycle_cell", "1", 0, int_max,
            "nodes or blocks of the cell that repeats; 1: all move in the same way; 0: the whole scene");
  t.boolean("cycle_spectrum", "false",
            "stability to waves too: Floquet-Bloch multipliers over the wavenumber");
  t.integer("cycle_wavenumbers", "200", 2, 1000000, "wavenumbers of cycle_spectrum");
  t.text("cycle_continue", "", "real option to vary along a branch").unset("none");
  t.real("cycle_to", "", "end of the branch").unset("none");
  t.integer("cycle_steps", "100", 1, int_max, "steps along the branch, at most");
}

void chart_options(OptionTableBuilder& t) {
  t.in("Chart", "chart");
  t.choice("chart_kind", {"error", "limits"}, "error against seconds, or where each method fails");
  t.add("chart_methods", OptionType::text_list, "",
        "methods type[:subtype[:implicit]], e.g. rk:5dp,arkimex:4:friction")
      .unset("a choice of good ones");
  t.text("chart_of", "fields",
         "what errors are of: fields (psi and eta at the end), probe:x, speed, period, amplitude or events "
         "(when they begin and end)")
      .where("chart_kind", {"error"});
  t.reals("chart_tolerances", "tolerances of the methods").above(0).unset("1e-3,1e-5,1e-7,1e-9");
  t.reals("chart_steps", "steps of methods without an error estimate", "time")
      .above(0)
      .unset("tolerance^(1/order)/sqrt(A K0)");
  t.reals("chart_smoothing",
          "of exact stick: velocities over which the threshold is smoothed (friction_eps), each with rows of "
          "its own",
          "velocity")
      .above(0)
      .unset("none");
  t.integers("chart_orders", 2, 8, "grid orders")
      .unset("grid_order; where that is unset 2,4,8 (2,4,6 with held ends)");
  t.integers("chart_grids", 1, n_max, "grid sizes").unset("grid_n/2,grid_n");
  t.text("chart_reference", "auto", "reference: auto, or an HDF5 file of this program's `run`");
  t.text("chart_parameter", "", "limits: an option that takes each of chart_values").unset("none");
  t.reals("chart_values", "limits: values of chart_parameter").unset("none");
  t.integer("chart_repeats", "3", 1, int_max, "runs of each row, of which the median time counts");
  t.positive("chart_row_seconds", "10", "processor time after which a row is given up", "seconds");
  t.positive("chart_reference_seconds", "20", "processor time that a reference solution on one grid may take",
             "seconds");
}

void laws_options(OptionTableBuilder& t) {
  t.in("Laws", "laws");
  t.real("laws_from", "-3", "smallest velocity of the table", "velocity");
  t.real("laws_to", "3", "largest velocity of the table", "velocity");
  t.integer("laws_points", "601", 2, int_max, "velocities, equally spaced, both ends included");
}

void sweep_options(OptionTableBuilder& t) {
  t.in("Sweep", "sweep");
  t.text("sweep_command", "run", "command of every point");
  for (const char* number : {"1", "2", "3", "4"}) {
    const auto name = [number](const char* begin) { return begin + std::string(number); };
    t.add(name("sweep_parameter").c_str(), OptionType::text_list, "",
          "option to vary, e.g. model_v; several take the same value, and the first names the dimension")
        .unset("none");
    t.real(name("sweep_from").c_str(), "", "start of its range").unset("none");
    t.real(name("sweep_to").c_str(), "", "end of its range").unset("none");
    t.integer(name("sweep_points").c_str(), "11", 1, 1e7, "values on a grid, both ends included");
    t.boolean(name("sweep_log").c_str(), "false", "equal ratios between them, or logarithmic draws");
    t.add(name("sweep_values").c_str(), OptionType::text_list, "", "its values, instead of a range")
        .unset("none");
  }
  t.choice("sweep_sample", {"grid", "list", "random", "sobol"},
           "grid: every value with every other; list: first values, second values, ... together; random; "
           "sobol: draws "
           "that fill the ranges evenly");
  t.integer("sweep_count", "", 1, 1e7, "random, sobol: number of points").unset("none");
  t.integer("sweep_seed", "0", 0, int_max,
            "random, sobol: seed of the draws; 0 of sobol: Sobol's points as they are");
  t.integer("sweep_group_ranks", "1", 1, int_max,
            "ranks that share a point; results depend on it by round-off");
  t.boolean("sweep_follow", "false",
            "run: along the first option each point starts where its neighbour ended, forwards and back");
  t.positive("sweep_refine", "",
             "grid of one or two options: divide where sweep_key changes between neighbours, until they are "
             "this part "
             "of the ranges apart")
      .at_most(1)
      .unset("none");
  t.text("sweep_key", "", "refine: key of the summary whose change is sought")
      .unset("regime; stable of other commands");
  t.boolean("sweep_files", "false",
            "also the file of every point: NAME.h5 and point 123 make NAME-000123.h5");
}

void fit_options(OptionTableBuilder& t) {
  t.in("Fit", "fit");
  t.add("fit_data", OptionType::pairs, "",
        "what was measured: a file of two columns, or t1:y1,t2:y2,...; the first ascends")
      .unset("none");
  t.choice("fit_of", {"force", "psi", "displacement"},
           "its second column: the force of the springs (eta), the velocity psi or the displacement since "
           "the start, "
           "the mean over the nodes");
  t.choice("fit_against", {"time", "displacement"},
           "its first column: time, or the displacement of the load point");
  t.reals("fit_weights",
          "weight of each row, by which its squared difference counts: a column of fit_data, by number or "
          "name")
      .at_least(0)
      .unset("every row counts alike");
  t.choice("fit_trend", {"none", "linear"},
           "a drift of the measurement that is sought beside the parameters: none, or one that grows evenly "
           "with the first column");
  t.add("fit_parameters", OptionType::text_list, "", "options that are sought, e.g. friction_a,friction_b")
      .unset("none");
  t.integer("fit_starts", "4", 1, 1e6, "starts of the search: the scene's values, and draws around them");
  t.integer("fit_seed", "1", 0, int_max, "seed of the draws");
}

void name_options(OptionTableBuilder& t) {
  t.in("Units and names", "");
  for (const auto& [name, what] : {std::pair("units_length", "what lengths are measured in, e.g. m"),
                                   std::pair("units_time", "what times are measured in, e.g. s"),
                                   std::pair("units_force", "what forces are measured in, e.g. N")})
    t.text(name, "", (std::string(what) + ": a name, no number depends on it").c_str()).unset("none");
  t.add("labels", OptionType::text_list, "",
        "what options are called in results and pictures: model_v: disc speed, ...; in a scene `labels: "
        "{model_v: disc speed}`")
      .unset("none");
}

std::vector<OptionSpec> make_table() {
  OptionTableBuilder t;
  model_options(t);
  friction_options(t);
  contact_options(t);
  profile_options(t);
  grid_options(t);
  load_options(t);
  start_options(t);
  time_options(t);
  output_options(t);
  lyapunov_options(t);
  spectrum_options(t);
  boundary_options(t);
  wave_options(t);
  cycle_options(t);
  chart_options(t);
  laws_options(t);
  sweep_options(t);
  fit_options(t);
  name_options(t);
  return std::move(t.rows);
}

const std::unordered_map<std::string, const OptionSpec*>& index() {
  static const std::unordered_map<std::string, const OptionSpec*> by_name = [] {
    std::unordered_map<std::string, const OptionSpec*> result;
    for (const OptionSpec& spec : option_table()) result[lower_case(spec.name)] = &spec;
    // The first of several may stand with its number or without: sweep_parameter, boundary_parameter1.
    for (const OptionSpec& spec : option_table()) {
      const std::string name = lower_case(spec.name);
      if (name.back() == '2') {
        const std::string bare = name.substr(0, name.size() - 1);
        if (result.count(bare)) result.emplace(bare + "1", result[bare]);
        if (result.count(bare + "1")) result.emplace(bare, result[bare + "1"]);
      }
    }
    return result;
  }();
  return by_name;
}

}  // namespace

const std::vector<OptionSpec>& option_table() {
  static const std::vector<OptionSpec> table = make_table();
  return table;
}

const OptionSpec* find_option(const std::string& name) {
  const auto it = index().find(lower_case(name));
  return it == index().end() ? nullptr : it->second;
}

// Options that earlier versions had. Whoever removes one says here what serves in its place.
std::string instead_of_gone(const std::string& name) {
  static const std::unordered_map<std::string, const char*> advice = {
      {"out_writers", "rank 0 writes what the other ranks send it"},
      {"spectrum_transient", "a run from the perturbation shows how far it grows (init_type file)"},
      {"spectrum_pseudo",
       "resolvent norms are those of the matrix of docs/theory.md, which a few lines of Python make"}};
  const auto it = advice.find(lower_case(name));
  return it == advice.end() ? "" : it->second;
}

bool reads_option(const std::string& command, const OptionSpec& spec) {
  if (spec.commands.empty() || command.empty()) return true;
  return (" " + spec.commands + " ").find(" " + command + " ") != std::string::npos;
}

}  // namespace stickslip
