#include "stickslip/options.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "stickslip/error.hpp"
#include "stickslip/library_options.hpp"

namespace stickslip {

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double int_max = std::numeric_limits<PetscInt>::max();
// Three unknowns a node must still be counted by a PetscInt.
constexpr PetscInt node_max = std::numeric_limits<PetscInt>::max() / 3;
constexpr double n_max = node_max;

// Builds the table; `in` gives the heading and the readers of the options that follow.
class TableBuilder {
 public:
  std::vector<OptionSpec> rows;

  void in(const char* group, const char* commands) {
    group_ = group;
    commands_ = commands;
  }
  OptionSpec& add(const char* name, OptionType type, const char* value, const char* help) {
    rows.push_back({name, type, value, "", "", -inf, inf, false, {}, help, group_, commands_});
    return rows.back();
  }
  OptionSpec& real(const char* name, const char* value, const char* help, const char* unit = "") {
    OptionSpec& spec = add(name, OptionType::real, value, help);
    spec.unit = unit;
    return spec;
  }
  OptionSpec& positive(const char* name, const char* value, const char* help, const char* unit = "") {
    OptionSpec& spec = real(name, value, help, unit);
    spec.low = 0;
    spec.open_low = true;
    return spec;
  }
  OptionSpec& not_negative(const char* name, const char* value, const char* help, const char* unit = "") {
    OptionSpec& spec = real(name, value, help, unit);
    spec.low = 0;
    return spec;
  }
  OptionSpec& integer(const char* name, const char* value, double low, double high, const char* help) {
    OptionSpec& spec = add(name, OptionType::integer, value, help);
    spec.low = low;
    spec.high = high;
    return spec;
  }
  OptionSpec& boolean(const char* name, const char* value, const char* help) {
    return add(name, OptionType::boolean, value, help);
  }
  OptionSpec& text(const char* name, const char* value, const char* help) {
    return add(name, OptionType::text, value, help);
  }
  OptionSpec& choice(const char* name, std::vector<std::string> words, const char* help) {
    OptionSpec& spec = add(name, OptionType::choice, words[0].c_str(), help);
    spec.words = std::move(words);
    return spec;
  }
  OptionSpec& real_or(const char* name, const char* word, const char* value, const char* help, const char* unit = "") {
    OptionSpec& spec = add(name, OptionType::real_or_word, value, help);
    spec.words = {word};
    spec.unit = unit;
    return spec;
  }

 private:
  std::string group_, commands_;
};

std::vector<OptionSpec> make_table() {
  TableBuilder t;
  const char* physics = "run spectrum boundary wave chart";

  t.in("Model", physics);
  t.choice("model_form", {"continuum", "chain"}, "continuum, or chain of blocks");
  t.positive("model_gamma", "3", "continuum: friction amplitude gamma");
  t.not_negative("model_delta", "", "continuum: damping delta").default_help = "0.2; the chain has none";
  t.not_negative("model_c", "1", "continuum: speed of sound c", "length/time");
  t.choice("model_delta_sign", {"derived", "printed"},
           "continuum: sign of the damping in the force equation, +1 as derived or -1 as printed in the paper");
  t.positive("model_m", "1", "chain: mass of a block");
  t.not_negative("model_k0", "0.2", "chain: stiffness to the driving plate");
  t.not_negative("model_k1", "0.2", "chain: stiffness between neighbours");
  t.positive("model_f0", "1", "chain: friction amplitude");
  t.real_or("model_zeta", "paper", "0", "chain: viscosity; `paper` is sqrt(0.1 m k1)").low = 0;
  t.real("model_v", "0.2", "velocity of the driving plate", "velocity");

  t.in("Friction", "run spectrum boundary wave chart laws");
  t.choice("friction_law", {"cubic", "carlson-langer", "coulomb", "rate-and-state"}, "friction law F(psi)");
  t.choice("friction_stick", {"exact", "regularised"},
           "laws with a threshold: exact stick, or sgn(psi) smoothed to tanh(psi/eps)");
  t.positive("friction_eps", "1e-3", "regularised stick: velocity of the smoothing", "velocity");
  t.boolean("friction_back_slip", "true", "exact stick: false lets no force drive a stuck node backwards");
  t.not_negative("friction_sigma", "0", "carlson-langer: friction drops from 1 to 1 - sigma as motion begins");
  t.not_negative("friction_alpha", "0.5", "carlson-langer: (1 - sigma)/(1 + 2 alpha |psi|/(1 - sigma))");
  t.positive("friction_fs", "1", "coulomb: static threshold");
  t.not_negative("friction_fd", "0.5", "coulomb: dynamic friction, at most friction_fs");
  t.positive("friction_slip_velocity", "1e-2", "coulomb, regularised: velocity over which fs falls to fd", "velocity");
  t.positive("friction_a", "0.05", "rate-and-state: direct effect a");
  t.not_negative("friction_b", "0.1", "rate-and-state: evolution effect b");
  t.positive("friction_D", "", "rate-and-state: slip distance D", "length").default_help = "0.1, or state_D";
  t.not_negative("friction_mu0", "0.6", "rate-and-state: friction at the reference velocity");
  t.positive("friction_psi0", "1", "rate-and-state: reference velocity", "velocity");
  t.not_negative("friction_spread", "0", "spread of the friction amplitude from node to node (mean 1)");
  t.choice("friction_spread_kind", {"uniform", "lognormal"}, "distribution: uniform on [1 - spread, 1 + spread], or "
           "exp(spread z - spread^2/2) with z normal");
  t.positive("friction_spread_length", "1", "continuum: distance between independent draws", "length");
  t.integer("friction_seed", "1", 0, int_max, "seed of the spread");

  t.in("State of the contact", "run spectrum boundary wave chart laws");
  OptionSpec& state = t.choice("state_law", {"none", "healing", "contact-age", "ageing", "slip"},
                               "kinetic equation of the contact; ageing and slip belong to rate-and-state");
  state.default_text = "";
  state.default_help = "none; ageing with rate-and-state";
  t.positive("state_t_h", "1", "healing: healing time", "time");
  t.positive("state_tau_inf", "2", "healing: strength reached at rest, in units of the moving contact's");
  t.positive("state_D", "", "healing, contact-age: slip distance that renews the contact", "length").default_help =
      "1; friction_D with rate-and-state";
  t.not_negative("state_b", "0.1", "contact-age: growth of friction with ln(1 + theta/theta0)");
  t.positive("state_theta0", "1", "contact-age: age at which growth begins", "time");

  t.in("Grid and ends", physics);
  t.integer("grid_n", "512", 1, n_max, "nodes; the chain's blocks");
  t.positive("grid_length", "", "length of the medium", "length").default_help =
      "60; the chain: n on a ring, else n - 1";
  OptionSpec& order = t.choice("grid_order", {"4", "2", "6", "8"}, "continuum: order of the second difference");
  order.default_text = "";
  order.default_help = "4; the chain: 2";
  for (const char* end : {"bc_left", "bc_right"}) {
    OptionSpec& spec = t.choice(end, {"periodic", "velocity", "free"},
                                "end of the medium: periodic (both or neither), held at a velocity, or free");
    spec.default_text = "";
    spec.default_help = "periodic; free where the other end is set";
  }
  t.real("bc_left_value", "", "velocity of a held left end", "velocity").default_help = "model_v";
  t.real("bc_right_value", "", "velocity of a held right end", "velocity").default_help = "model_v";

  t.in("Start", "run chart");
  t.choice("init_type", {"uniform", "sine", "layer", "pulses", "wave", "file"},
           "uniform; sine: psi = init_psi + init_amplitude sin(2 pi init_mode x/L); layer: psi falls from "
           "bc_left_value to init_psi like exp(-(x/init_width)^2); pulses: turns of the uniform oscillation laid "
           "round the ring; wave: the travelling train; file: a frame or an eigenvector of init_file");
  t.real_or("init_psi", "steady", "0.1", "psi at the start; `steady` is steady sliding", "velocity");
  t.real_or("init_eta", "steady", "", "eta at the start; `steady` makes psi_t = 0").default_help =
      "0.1; steady for a layer";
  t.real_or("init_state", "steady", "steady", "state at the start: tau for healing, else theta").low = 0;
  t.real("init_amplitude", "0.5", "sine: amplitude (file: of an eigenvector)", "velocity");
  t.integer("init_mode", "1", 0, int_max,
            "sine: whole waves in L (file: number of the eigenvector, from 0; there 0 is the default)");
  t.positive("init_width", "2", "layer: width", "length");
  t.integer("init_pulses", "1", 1, int_max, "pulses, wave: number of pulses on the ring");
  t.choice("init_direction", {"right", "left"}, "pulses, wave: direction of travel");
  t.not_negative("init_noise", "0", "amplitude of noise added to psi, uniform on [-1, 1] times this", "velocity");
  t.integer("init_seed", "1", 0, int_max, "seed of the noise");
  t.text("init_file", "", "HDF5 file of this program to start from").default_help = "none";
  t.integer("init_frame", "", 0, int_max, "frame of init_file, from 0").default_help = "the last";

  t.in("Time stepping", "run chart boundary");
  t.not_negative("ts_max_time", "60", "end time, hit exactly", "time");
  t.integer("ts_max_steps", "", 0, int_max, "most steps").default_help = "unlimited";
  t.add("ts_max_wall", OptionType::wall_time, "",
        "wall clock after which the run ends, with a checkpoint to go on from").default_help = "unlimited";
  t.rows.back().commands = "run";
  t.choice("imex_implicit", {"auto", "none", "friction", "wave", "both"},
           "terms that an IMEX method takes implicitly");
  t.in("Time stepping", "run");
  t.positive("accuracy", "", "largest error wanted in psi and eta at the end; chooses what is not set otherwise")
      .default_help = "none";
  t.in("Time stepping", "run chart");
  t.boolean("rk_fused", "true",
            "take all stages of a Runge-Kutta step tile by tile in the cache; false: PETSc's own step");
  t.choice("scene_reduce", {"auto", "off"}, "solve the smaller problem where the scene allows it");

  t.in("Output", "");
  t.text("out_file", "", "HDF5 file for the results").default_help = "none";
  t.text("summary", "", "JSON file for the summary, - for standard output").default_help = "none";
  t.choice("progress", {"auto", "on", "off"}, "progress on standard error");
  t.in("Output", "run");
  t.positive("out_every", "", "time between frames", "time").default_help = "none";
  t.integer("out_frames", "200", 2, int_max, "frames, equally spaced, both ends included");
  OptionSpec& times = t.add("out_times", OptionType::real_list, "", "times of the frames");
  times.unit = "time";
  times.low = 0;
  times.default_help = "none";
  OptionSpec& probes = t.add("out_probes", OptionType::real_list, "", "positions of the probes");
  probes.unit = "length";
  probes.low = 0;
  probes.default_help = "none";
  t.boolean("out_displacement", "false", "write the displacement chi as well");
  OptionSpec& seeds = t.add("run_seeds", OptionType::integer_list, "",
                            "as many runs side by side, each with its friction_seed and init_seed, on its share of the "
                            "ranks; FILE.h5 becomes FILE-seed7.h5, the summary likewise");
  seeds.low = 0;
  seeds.high = int_max;
  seeds.default_help = "none";
  t.boolean("out_series", "true", "write the group series, a row for every step");
  t.boolean("out_events", "false", "catalogue of slip events: group events, a row for every event that has ended");
  t.not_negative("out_events_velocity", "", "events: velocity above which a node moves", "velocity").default_help =
      "0 with friction that sticks, else 2 |model_v|";
  t.add("out_checkpoint_every", OptionType::steps_or_time, "", "steps or wall clock (30s, 10m, 2h) between checkpoints")
      .default_help = "none";
  t.integer("out_checkpoint_keep", "2", 1, int_max, "checkpoints kept");
  t.text("restart", "", "checkpoint to go on from").default_help = "none";

  t.in("Spectrum", "spectrum");
  t.integer("spectrum_count", "12", 1, int_max, "eigenvalues wanted").commands = "spectrum wave";
  t.choice("spectrum_method", {"auto", "dense", "krylov"}, "eigensolver");
  t.choice("spectrum_refine", {"auto", "off"}, "auto compares grids; off takes every mode of the matrix as resolved");
  t.boolean("spectrum_transient", "false", "also the largest transient growth and the numerical abscissa, energy norm");
  t.integer("spectrum_pseudo", "0", 0, 1000,
            "points a side of a picture of the resolvent norm beside the rightmost eigenvalues, energy norm; 0: none");

  t.in("Boundary", "boundary");
  t.text("boundary_parameter", "", "real option to vary, e.g. model_v").default_help = "required";
  t.real("boundary_from", "", "start of its range").default_help = "required";
  t.real("boundary_to", "", "end of its range").default_help = "required";
  t.boolean("boundary_log", "false", "logarithmic in the first parameter");
  t.text("boundary_parameter2", "", "second option: the boundary is traced as a curve").default_help = "none";
  t.real("boundary_from2", "", "start of its range").default_help = "none";
  t.real("boundary_to2", "", "end of its range").default_help = "none";
  t.boolean("boundary_log2", "false", "logarithmic in the second parameter");
  t.add("boundary_same", OptionType::text_list, "", "options that take the value of boundary_parameter, e.g. model_k0")
      .default_help = "none";
  t.integer("boundary_points", "41", 2, int_max, "points on the curve, about");
  t.integer("boundary_verify", "0", 0, int_max, "points checked by time integration on both sides");

  t.in("Wave", "wave");
  t.integer("wave_pulses", "1", 1, int_max, "pulses on the ring");
  t.positive("wave_length", "", "length of the whole ring (this or wave_speed)", "length").default_help = "none";
  t.real("wave_speed", "", "speed; negative runs left (this or wave_length)", "length/time").default_help = "none";
  t.boolean("wave_spectrum", "false", "eigenvalues of the wave");
  t.text("wave_continue", "", "real option to vary along a branch").default_help = "none";
  t.real("wave_to", "", "end of the branch").default_help = "none";
  t.integer("wave_steps", "100", 1, int_max, "steps along the branch, at most");

  t.in("Chart", "chart");
  t.choice("chart_kind", {"error", "limits"}, "error against seconds, or where each method fails");
  t.add("chart_methods", OptionType::text_list, "", "methods type[:subtype[:implicit]], e.g. rk:5dp,arkimex:4:friction")
      .default_help = "a choice of good ones";
  OptionSpec& tolerances = t.add("chart_tolerances", OptionType::real_list, "", "tolerances of the methods");
  tolerances.low = 0;
  tolerances.open_low = true;
  tolerances.default_help = "1e-3,1e-5,1e-7,1e-9";
  OptionSpec& steps = t.add("chart_steps", OptionType::real_list, "", "steps of methods without an error estimate");
  steps.unit = "time";
  steps.low = 0;
  steps.open_low = true;
  steps.default_help = "tolerance^(1/order)/sqrt(A K0)";
  OptionSpec& orders = t.add("chart_orders", OptionType::integer_list, "", "grid orders");
  orders.low = 2;
  orders.high = 8;
  orders.default_help = "grid_order; where that is unset 2,4,8 (2,4,6 with held ends)";
  OptionSpec& grids = t.add("chart_grids", OptionType::integer_list, "", "grid sizes");
  grids.low = 1;
  grids.high = n_max;
  grids.default_help = "grid_n/2,grid_n";
  t.text("chart_reference", "auto", "reference: auto, or an HDF5 file of this program's `run`");
  t.text("chart_parameter", "", "limits: an option that takes each of chart_values").default_help = "none";
  t.add("chart_values", OptionType::real_list, "", "limits: values of chart_parameter").default_help = "none";
  t.integer("chart_repeats", "3", 1, int_max, "runs of each row, of which the median time counts");
  t.positive("chart_row_seconds", "10", "processor time after which a row is given up", "seconds");
  t.positive("chart_reference_seconds", "20",
             "processor time that a reference solution on one grid may take", "seconds");

  t.in("Laws", "laws");
  t.real("laws_from", "-3", "smallest velocity of the table", "velocity");
  t.real("laws_to", "3", "largest velocity of the table", "velocity");
  t.integer("laws_points", "601", 2, int_max, "velocities, equally spaced, both ends included");
  return std::move(t.rows);
}

// A decimal number, nothing before or after it. Also returns the infinities and nan, and overflow as infinity.
std::optional<double> parse_number(const std::string& text) {
  const char *first = text.data(), *last = first + text.size();
  if (first != last && *first == '+' && text.size() > 1 && text[1] != '-' && text[1] != '+') ++first;
  double value = 0;
  const auto [end, error] = std::from_chars(first, last, value);
  if (error == std::errc::invalid_argument || end != last) return std::nullopt;
  if (error == std::errc::result_out_of_range) {
    // The library does not say whether it was too large or too small: an exponent sign of minus is too small.
    return lower_case(text).find("e-") == std::string::npos ? inf : 0;
  }
  return value;
}

// Exact: decimal digits, or a number such as 1e6 whose value is an integer below 2^53.
std::optional<double> parse_integer(const std::string& text) {
  const std::optional<double> value = parse_number(text);
  if (!value || !std::isfinite(*value) || *value != std::floor(*value)) return std::nullopt;
  return value;
}

std::optional<bool> parse_boolean(const std::string& text) {
  const std::string word = lower_case(text);
  for (const char* yes : {"true", "yes", "on", "1"})
    if (word == yes) return true;
  for (const char* no : {"false", "no", "off", "0"})
    if (word == no) return false;
  return std::nullopt;
}

std::vector<std::string> split_list(const std::string& text) {
  std::vector<std::string> parts;
  std::string::size_type from = 0;
  while (true) {
    const auto comma = text.find(',', from);
    std::string part = text.substr(from, comma == std::string::npos ? comma : comma - from);
    const auto begin = part.find_first_not_of(" \t"), end = part.find_last_not_of(" \t");
    parts.push_back(begin == std::string::npos ? "" : part.substr(begin, end - begin + 1));
    if (comma == std::string::npos) return parts;
    from = comma + 1;
  }
}

std::optional<StepsOrSeconds> parse_steps_or_time(const std::string& text) {
  if (text.empty()) return std::nullopt;
  double factor = 0;
  switch (text.back()) {
    case 's': factor = 1; break;
    case 'm': factor = 60; break;
    case 'h': factor = 3600; break;
    default: break;
  }
  StepsOrSeconds result;
  if (factor > 0) {
    const std::optional<double> value = parse_number(text.substr(0, text.size() - 1));
    if (!value || !std::isfinite(*value) || *value <= 0) return std::nullopt;
    result.seconds = *value * factor;
  } else {
    const std::optional<double> value = parse_integer(text);
    if (!value || *value < 1 || *value > int_max) return std::nullopt;
    result.steps = PetscInt(*value);
  }
  return result;
}

bool in_range(const OptionSpec& spec, double value) {
  return (spec.open_low ? value > spec.low : value >= spec.low) && value <= spec.high;
}

bool is_word(const OptionSpec& spec, const std::string& text) {
  return std::find(spec.words.begin(), spec.words.end(), text) != spec.words.end();
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

bool is_acceptable(const OptionSpec& spec, const std::string& text) {
  const auto real = [&spec](const std::string& part) {
    const std::optional<double> value = parse_number(part);
    return value && std::isfinite(*value) && in_range(spec, *value);
  };
  const auto integer = [&spec](const std::string& part) {
    const std::optional<double> value = parse_integer(part);
    return value && in_range(spec, *value);
  };
  const auto every = [&text](const auto& accepts) {
    const std::vector<std::string> parts = split_list(text);
    return std::all_of(parts.begin(), parts.end(), accepts);
  };
  switch (spec.type) {
    case OptionType::real: return real(text);
    case OptionType::integer: return integer(text);
    case OptionType::boolean: return bool(parse_boolean(text));
    case OptionType::text: return !text.empty();
    case OptionType::choice: return is_word(spec, text);
    case OptionType::real_list: return every(real);
    case OptionType::integer_list: return every(integer);
    case OptionType::text_list: return every([](const std::string& part) { return !part.empty(); });
    case OptionType::real_or_word: return is_word(spec, text) || real(text);
    case OptionType::steps_or_time: return bool(parse_steps_or_time(text));
    case OptionType::wall_time: {
      const std::optional<StepsOrSeconds> value = parse_steps_or_time(text);
      return value && value->seconds > 0;
    }
  }
  return false;
}

std::string range_text(const OptionSpec& spec) {
  if (spec.high < inf && spec.low > -inf) return " from " + number_text(spec.low) + " to " + number_text(spec.high);
  if (spec.low > -inf) return (spec.open_low ? " > " : " >= ") + number_text(spec.low);
  if (spec.high < inf) return " <= " + number_text(spec.high);
  return "";
}

std::string in_place(const std::string& where) { return where.empty() ? "" : " (" + where + ")"; }

int edit_distance(const std::string& a, const std::string& b) {
  // with exchange of neighbours as one step
  std::vector<std::vector<int>> d(a.size() + 1, std::vector<int>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = int(i + j);
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

const std::map<std::string, const OptionSpec*>& index() {
  static const std::map<std::string, const OptionSpec*> by_name = [] {
    std::map<std::string, const OptionSpec*> result;
    for (const OptionSpec& spec : option_table()) result[lower_case(spec.name)] = &spec;
    return result;
  }();
  return by_name;
}

std::vector<std::string> own_names() {
  std::vector<std::string> names;
  for (const OptionSpec& spec : option_table()) names.push_back(spec.name);
  return names;
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

bool reads_option(const std::string& command, const OptionSpec& spec) {
  if (spec.commands.empty() || command.empty()) return true;
  return (" " + spec.commands + " ").find(" " + command + " ") != std::string::npos;
}

std::string requirement(const OptionSpec& spec) {
  switch (spec.type) {
    case OptionType::real: return "a finite number" + range_text(spec);
    case OptionType::integer: return "an integer" + range_text(spec);
    case OptionType::boolean: return "true or false";
    case OptionType::text: return "not empty";
    case OptionType::choice: return "one of " + joined(spec.words);
    case OptionType::real_list: return "finite numbers" + range_text(spec) + ", separated by commas";
    case OptionType::integer_list: return "integers" + range_text(spec) + ", separated by commas";
    case OptionType::text_list: return "words separated by commas";
    case OptionType::real_or_word:
      return "a finite number" + range_text(spec) + (spec.words.empty() ? "" : ", or " + joined(spec.words));
    case OptionType::steps_or_time: return "a number of steps (500) or a time (30s, 10m, 2h)";
    case OptionType::wall_time: return "a time (30s, 10m, 2h)";
  }
  return "";
}

void check_value(const OptionSpec& spec, const std::string& text, const std::string& where) {
  if (is_acceptable(spec, text)) return;
  std::string message = "-" + spec.name + " " + quoted(text) + in_place(where) + ": must be " + requirement(spec);
  const std::string near = spec.type == OptionType::choice || spec.type == OptionType::real_or_word
                               ? nearest_name(text, spec.words) : "";
  if (!near.empty()) message += "; did you mean " + near + "?";
  throw UsageError(message);
}

std::string nearest_name(const std::string& name, const std::vector<std::string>& names) {
  const std::string wanted = lower_case(name.substr(0, 200));
  std::string best;
  int least = std::min(int(wanted.size()), std::max(1, std::min(4, int(wanted.size()) / 3)) + 1);
  for (const std::string& candidate : names) {
    const int d = edit_distance(wanted, lower_case(candidate));
    if (d < least) {
      least = d;
      best = candidate;
    }
  }
  if (!best.empty() || wanted.empty()) return best;
  for (const std::string& candidate : names) {  // the prefix left out: gamma for model_gamma
    const std::string low = lower_case(candidate), tail = "_" + wanted;
    if (low.size() > tail.size() && low.compare(low.size() - tail.size(), tail.size(), tail) == 0) return candidate;
  }
  for (const std::string& candidate : names)  // cut short: print for printed
    if (wanted.size() > 2 && lower_case(candidate).rfind(wanted, 0) == 0) return candidate;
  return "";
}

std::string number_text(double value) {
  char buffer[40];
  const auto result = std::to_chars(buffer, buffer + sizeof buffer, value);
  return std::string(buffer, result.ptr);
}

std::string quoted(const std::string& text) {
  if (text.empty()) return "''";
  std::string result = text.substr(0, 80);
  while (result.size() < text.size() && !result.empty() && (result.back() & 0xC0) == 0x80) result.pop_back();
  for (char& c : result)
    if ((unsigned char)c < 0x20 || c == 0x7f) c = '?';
  return text.size() > 80 ? result + "..." : result;
}

std::string lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  return text;
}

void Options::set(const Given& given) {
  const OptionSpec* spec = find_option(given.name);
  if (spec) {
    std::string text = given.text.value_or("");
    if (!given.text) {
      if (spec->type != OptionType::boolean)
        throw UsageError("-" + spec->name + in_place(given.where) + ": needs a value, " + requirement(*spec));
      text = "true";
    }
    check_value(*spec, text, given.where);
    values_[spec->name] = text;
    return;
  }
  const std::string name = lower_case(given.name);
  if (!is_library_option(name)) {
    std::string message = "unknown option -" + quoted(given.name) + in_place(given.where);
    const auto equals = given.name.find('=');
    if (equals != std::string::npos && (find_option(given.name.substr(0, equals)) ||
                                        is_library_option(lower_case(given.name.substr(0, equals))))) {
      message += "; write the value as a word of its own: -" + given.name.substr(0, equals) + " " +
                 quoted(given.name.substr(equals + 1));
    } else {
      std::vector<std::string> names = own_names();
      for (const std::string& known : known_library_options()) names.push_back(known);
      const std::string near = nearest_name(given.name, names);
      message += near.empty() ? "; -help lists the options" : "; did you mean -" + near + "?";
    }
    throw UsageError(message);
  }
  library_[name] = check_library_value(name, given.text, given.where).value_or("");
}

Options Options::from(const std::string& command, const std::vector<Given>& given) {
  Options options;
  options.command_ = command;
  for (const Given& one : given) options.set(one);

  const auto only_one = [&options](const std::vector<const char*>& names) {
    std::string set;
    int count = 0;
    for (const char* name : names) {
      if (!options.is_set(name)) continue;
      set += (count++ ? " and -" : "-") + std::string(name) + " " + quoted(options.text(name));
    }
    if (count > 1) throw UsageError(set + ": give only one of them");
  };
  if (command == "run") only_one({"out_every", "out_frames", "out_times"});
  if (command == "wave") only_one({"wave_length", "wave_speed"});
  return options;
}

Options Options::with(const std::string& name, const std::string& text) const {
  Options copy = *this;
  const OptionSpec* spec = find_option(name);
  if (text.empty()) {
    copy.values_.erase(spec ? spec->name : name);
    copy.library_.erase(lower_case(name));
  } else {
    copy.set({name, text, ""});
  }
  return copy;
}

Options Options::with(const std::string& name, double value) const { return with(name, number_text(value)); }

Options Options::resumed_from(const std::map<std::string, std::string>& stored) const {
  const auto may_differ = [](const std::string& name) {
    static const std::set<std::string> names = {"ts_max_time", "ts_max_steps", "ts_max_wall",
                                                "summary",     "progress",     "restart"};
    return names.count(name) || name.rfind("out_", 0) == 0 || only_looks(name);
  };
  Options merged;
  merged.command_ = command_;
  for (const auto& [name, text] : stored) {
    if (name == "restart") continue;
    // A frame rule of this command line replaces that of the file.
    const bool frames = name == "out_every" || name == "out_frames" || name == "out_times";
    if (frames && (is_set("out_every") || is_set("out_frames") || is_set("out_times"))) continue;
    if (only_looks(name)) continue;
    merged.set({name, text, "the checkpoint"});
  }
  for (const auto& [name, text] : given()) {
    if (may_differ(name)) {
      if (find_option(name)) {
        merged.values_[name] = text;
      } else {
        merged.library_[name] = library_.at(name);
      }
      continue;
    }
    const auto it = stored.find(name);
    if (it == stored.end() || it->second != text)
      throw UsageError("-" + name + " " + quoted(text) + ": a restart takes its settings from the checkpoint (" +
                       (it == stored.end() ? "where it is not set" : quoted(it->second)) +
                       "); only ts_max_time, ts_max_steps, ts_max_wall, out_*, summary and progress may differ");
  }
  return merged;
}

bool Options::is_set(const std::string& name) const {
  const OptionSpec* spec = find_option(name);
  return spec ? values_.count(spec->name) > 0 : library_.count(lower_case(name)) > 0;
}

std::string Options::text(const std::string& name) const {
  const OptionSpec* spec = find_option(name);
  if (!spec) {
    const auto it = library_.find(lower_case(name));
    return it == library_.end() ? "" : it->second;
  }
  const auto it = values_.find(spec->name);
  if (it != values_.end()) return it->second;
  if (!spec->default_text.empty()) return spec->default_text;

  const std::string& key = spec->name;
  const bool chain = text("model_form") == "chain", rate_and_state = text("friction_law") == "rate-and-state";
  if (key == "bc_left_value" || key == "bc_right_value") return text("model_v");
  if (key == "model_delta") return chain ? "0" : "0.2";
  if (key == "grid_order") return chain ? "2" : "4";
  if (key == "grid_length") {
    if (!chain) return "60";
    const PetscInt n = integer("grid_n");
    return std::to_string(text("bc_left") == "periodic" ? n : std::max<PetscInt>(n - 1, 1));
  }
  if (key == "bc_left" || key == "bc_right") {
    const std::string other = key == "bc_left" ? "bc_right" : "bc_left";
    return is_set(other) && text(other) != "periodic" ? "free" : "periodic";
  }
  if (key == "state_law") return rate_and_state ? "ageing" : "none";
  if (key == "friction_D") return rate_and_state && is_set("state_D") ? text("state_D") : "0.1";
  if (key == "state_D") return rate_and_state ? text("friction_D") : "1";
  if (key == "init_eta") return text("init_type") == "layer" ? "steady" : "0.1";
  return "";
}

double Options::real(const std::string& name) const {
  const std::optional<double> value = parse_number(text(name));
  if (!value) throw std::logic_error("option " + name + " is not a number: " + quoted(text(name)));
  return *value;
}

PetscInt Options::integer(const std::string& name) const {
  const std::optional<double> value = parse_integer(text(name));
  if (!value) throw std::logic_error("option " + name + " is not an integer: " + quoted(text(name)));
  return PetscInt(*value);
}

PetscInt Options::integer_of(const std::string& text) { return PetscInt(*parse_integer(text)); }

bool Options::boolean(const std::string& name) const {
  const std::optional<bool> value = parse_boolean(text(name));
  if (!value) throw std::logic_error("option " + name + " is not a boolean: " + quoted(text(name)));
  return *value;
}

std::vector<double> Options::reals(const std::string& name) const {
  std::vector<double> values;
  for (const std::string& word : words(name)) values.push_back(*parse_number(word));
  return values;
}

std::vector<PetscInt> Options::integers(const std::string& name) const {
  std::vector<PetscInt> values;
  for (const std::string& word : words(name)) values.push_back(PetscInt(*parse_integer(word)));
  return values;
}

std::vector<std::string> Options::words(const std::string& name) const {
  const std::string list = text(name);
  return list.empty() ? std::vector<std::string>() : split_list(list);
}

std::optional<double> Options::real_if_set(const std::string& name) const {
  return is_set(name) ? std::optional<double>(real(name)) : std::nullopt;
}

std::optional<PetscInt> Options::integer_if_set(const std::string& name) const {
  return is_set(name) ? std::optional<PetscInt>(integer(name)) : std::nullopt;
}

StepsOrSeconds Options::steps_or_seconds(const std::string& name) const {
  return parse_steps_or_time(text(name)).value_or(StepsOrSeconds());
}

std::map<std::string, std::string> Options::all() const {
  std::map<std::string, std::string> result;
  for (const OptionSpec& spec : option_table())
    if (reads_option(command_, spec) || is_set(spec.name)) result[spec.name] = text(spec.name);
  for (const auto& [name, text] : given()) result[name] = text;
  return result;
}

std::map<std::string, std::string> Options::given() const {
  std::map<std::string, std::string> result = values_;
  for (const auto& [name, text] : library_) result[name] = text.empty() ? "true" : text;
  return result;
}

}  // namespace stickslip
