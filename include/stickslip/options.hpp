// The program's own options: one table of names, types, defaults, ranges and help; and their values in one run.
//
// A value comes from the scene file, above it PETSC_OPTIONS, above it the command line; all three pass through
// PETSc's options database. Options is a plain value: a copy with one value changed gives the scene that a
// continuation or a stability boundary needs, and values that depend on it (zeta `paper`) follow.
#pragma once

#include <petscsys.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace stickslip {

enum class OptionType { real, integer, boolean, text, choice, real_list, text_list, real_or_word };

struct OptionSpec {
  std::string name;           // without the dash, e.g. "model_gamma"
  OptionType type;
  std::string default_text;   // "" where there is none (unset)
  std::string unit;           // "", or e.g. "time", "1/time"
  double low, high;           // closed range of a number; open_low: low itself is excluded
  bool open_low;
  std::vector<std::string> words;  // of a choice, or the words a real_or_word takes beside numbers
  std::string help;
  std::string commands;       // space-separated commands that read it, "" = all
};

const std::vector<OptionSpec>& option_table();

// The name in `names` nearest to `name` by edit distance, or "" where none is near.
std::string nearest_name(const std::string& name, const std::vector<std::string>& names);

class Options {
 public:
  // Defaults only (used by tests and by scenes built in code).
  Options() = default;

  // Reads and checks everything the database holds; throws UsageError with one line that names the option, its
  // value and what would be right. Unknown names (not ours, no prefix of a PETSc/SLEPc object) are an error.
  // Collective.
  static Options from_database(const std::string& command);

  // The same options with one changed; checked like one from the user.
  Options with(const std::string& name, const std::string& text) const;
  Options with(const std::string& name, double value) const;  // text with 17 digits

  bool is_set(const std::string& name) const;        // by the user, not by default
  std::string text(const std::string& name) const;   // the value's text, default included
  double real(const std::string& name) const;
  PetscInt integer(const std::string& name) const;
  bool boolean(const std::string& name) const;
  std::vector<double> reals(const std::string& name) const;        // empty where unset
  std::vector<std::string> words(const std::string& name) const;   // empty where unset
  std::optional<double> real_if_set(const std::string& name) const;

  // Every own option with its text, defaults included, and every library option the user gave.
  std::map<std::string, std::string> all() const;

 private:
  std::map<std::string, std::string> values_;   // own options that the user set
  std::map<std::string, std::string> library_;  // PETSc and SLEPc options that the user set
};

}  // namespace stickslip
