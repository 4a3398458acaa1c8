// The program's own options: one table of names, types, defaults, ranges and help; and their values in one
// run.
//
// A value comes from the scene file, above it PETSC_OPTIONS, above it the command line (command_line.hpp
// reads all three). Options of PETSc and SLEPc travel in the same container, are checked where their type is
// known (library_options.hpp), and are handed to PETSc's database; own options never enter it.
//
// Options is a plain value: a copy with one value changed gives the scene that a continuation or a stability
// boundary needs, and values that depend on it (zeta `paper`, a held value that is model_v) follow.
// Names are case-blind, as PETSc's are. Nothing here communicates: every rank holds the same options.
#pragma once

#include <petscsys.h>

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/base/text.hpp"

namespace stickslip {

enum class OptionType {
  real,       // one finite number
  integer,    // exact; 1e6 is the integer 1000000; or a word (auto), which unsets it
  boolean,    // true/false, yes/no, on/off, 1/0; the name alone is true
  text,       // anything but empty
  choice,     // one of words
  real_list,  // numbers separated by commas
  integer_list,
  text_list,
  real_or_word,  // a number or one of words
  // x1:value1,x2:value2,... with x ascending, each at most twice; on the command line also the name of a
  pairs,
  // file of two columns, whose numbers then stand here
  steps_or_time,  // 500 (steps), or 30s, 10m, 2h (wall clock)
  wall_time       // 30s, 10m, 2h (wall clock)
};

class Options;

struct OptionSpec {
  std::string name;  // without the dash, e.g. "model_gamma"
  OptionType type;
  // "" where there is none (unset) or it depends on other options (see Options::text)
  std::string default_text;
  std::string default_help;  // what -help shows where default_text is empty, e.g. "model_v"
  std::string unit;          // "", or e.g. "time", "1/time"
  double low, high;          // closed range of a number (of each number of a list)
  bool open_low;             // low itself is excluded
  std::vector<std::string> words;
  std::string help;
  std::string group;     // heading in -help
  std::string commands;  // space-separated commands that read it, "" = all
  // the default where it depends on other options
  std::function<std::string(const Options&)> default_of = nullptr;
  // why its value changes nothing beside these options; "" where it may
  std::function<std::string(const Options&)> idle_of = nullptr;
  // of pairs: what is wrong with them, and with which; "" where nothing is
  std::string (*fault)(const std::vector<std::pair<double, double>>& pairs, std::size_t& at) = nullptr;
};

// The options that friction laws and state laws declare. Options know no law: the layer above, which lists
// them, defines this function (src/model/friction.cpp).
struct LawOptions {
  // words of friction_law and state_law; the first is the default
  std::vector<std::string> laws, states;
  // their parameters, each once; group and commands are left open
  std::vector<OptionSpec> of_laws, of_states;
  std::vector<OptionSpec> of_profiles;  // what says how these differ along x
  std::function<std::string(const Options&)> default_state;
  std::function<bool(const Options&)> has_threshold;  // the law chosen, at psi = 0
};
LawOptions law_options();

const std::vector<OptionSpec>& option_table();
const OptionSpec* find_option(const std::string& name);  // case-blind; null where it is not ours
// What serves in place of an option that earlier versions had; "" for any other name.
std::string instead_of_gone(const std::string& name);
bool reads_option(const std::string& command, const OptionSpec& spec);

// What the option takes, e.g. "a number > 0" or "one of cubic, coulomb".
std::string requirement(const OptionSpec& spec);

// Throws UsageError with the option, its value, `where` (file:line, "" for the command line) and what would
// be right.
void check_value(const OptionSpec& spec, const std::string& text, const std::string& where);

// One option as somebody gave it. No text: the name stood alone.
struct Given {
  std::string name;  // without the dash
  std::optional<std::string> text;
  std::string where;  // "scene.yaml:3", "PETSC_OPTIONS", or "" for the command line
};

struct StepsOrSeconds {
  PetscInt steps = 0;  // 0 where it is a time
  double seconds = 0;  // 0 where it is a number of steps
};

class Options {
 public:
  // Defaults only (used by tests and by scenes built in code).
  Options() = default;

  // Checks everything that was given (later entries stand above earlier ones) for a command; throws
  // UsageError with one line that names the option, its value and what would be right. Unknown names (not
  // ours for any command, and without the prefix of a PETSc or SLEPc object) are an error.
  static Options from(const std::string& command, const std::vector<Given>& given);

  // The same options read by another command; throws UsageError where they do not suit it.
  Options for_command(const std::string& command) const;

  // The same options with one changed; checked like one from the user. An empty text unsets it.
  Options with(const std::string& name, const std::string& text) const;
  Options with(const std::string& name, double value) const;

  // The settings for going on from a file that was written with `stored` (what given() was then): the stored
  // ones, where this command line may set ts_max_time, ts_max_steps, ts_max_wall, out_*, summary, progress,
  // restart and what only looks (views, monitors, log_*); another value of anything else is an error.
  Options resumed_from(const std::map<std::string, std::string>& stored) const;

  bool is_set(const std::string& name) const;  // by the user, not by default; library options too
  // "scene.yaml:3", or "" where the user did not set it in a scene file.
  std::string line_in_scene(const std::string& name) const;
  // The value's text. Where it is unset the default, also one that depends on others: bc_*_value is model_v,
  // the chain has model_delta 0, grid_order 2 and its own grid_length, an end is free where the other was
  // set, rate-and-state has state_law ageing, state_D and friction_D are one there, init_eta of a layer is
  // `steady`. "" where there is none.
  std::string text(const std::string& name) const;
  double real(const std::string& name) const;  // of a real_or_word only where the text is not a word
  PetscInt integer(const std::string& name) const;
  bool boolean(const std::string& name) const;
  std::vector<double> reals(const std::string& name) const;                     // empty where unset
  std::vector<PetscInt> integers(const std::string& name) const;                // empty where unset
  std::vector<std::string> words(const std::string& name) const;                // empty where unset
  std::vector<std::pair<double, double>> pairs(const std::string& name) const;  // empty where unset
  std::optional<double> real_if_set(const std::string& name) const;
  std::optional<PetscInt> integer_if_set(const std::string& name) const;
  // both zero where unset; of a wall_time too
  StepsOrSeconds steps_or_seconds(const std::string& name) const;

  // A text that check_value has accepted as an integer.
  static PetscInt integer_of(const std::string& text);

  // Those of the user's own options, read by the command, that change nothing beside the others, each with
  // the reason: `-init_width (init_type is sine)`. Nothing is said of what hangs on an option that the
  // command varies.
  std::vector<std::string> idle() const;

  const std::string& command() const { return command_; }
  // Every own option the command reads, with its text, defaults included; those the user set; and every
  // library option the user gave.
  std::map<std::string, std::string> all() const;
  // What the user set, own and library (an option that stood alone has the text "true").
  std::map<std::string, std::string> given() const;
  // "" where the name stood alone
  const std::map<std::string, std::string>& library() const { return library_; }

 private:
  void set(const Given& given);

  std::string command_;
  std::map<std::string, std::string> values_;   // own options that the user set
  std::map<std::string, std::string> library_;  // PETSc and SLEPc options that the user set
  std::map<std::string, std::string> lines_;    // of own options that a scene file set
};

}  // namespace stickslip
