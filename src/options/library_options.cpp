#include "stickslip/options/library_options.hpp"

#include <slepceps.h>
#include <petscts.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "base/failure.hpp"
#include "base/process.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"

namespace stickslip {

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();

std::vector<std::string> words_of(const std::string& text) { return split_words(text, ""); }

std::set<std::string> set_of(const std::string& text) {
  const std::vector<std::string> words = words_of(text);
  return {words.begin(), words.end()};
}

bool starts_with(const std::string& text, const std::string& prefix) { return text.rfind(prefix, 0) == 0; }
bool starts_with_any(const std::string& text, const std::vector<std::string>& prefixes) {
  return std::any_of(prefixes.begin(), prefixes.end(),
                     [&](const std::string& p) { return starts_with(text, p); });
}

// As the user wrote it.
std::string shown(const std::string& name, const std::string& text) {
  return "-" + name + (text.empty() ? "" : " " + quoted(text));
}

// The ranges within which the well-known numbers must lie, the words of two options, and what PETSc reads
// only at its end. All other values PETSc and SLEPc judge when their objects take them, before any work.
std::map<std::string, OptionSpec> make_ranges() {
  std::map<std::string, OptionSpec> known;
  const auto add = [&known](const char* names, OptionType type, double low, double high, bool open_low) {
    for (const std::string& name : words_of(names))
      known[name] = {name, type, "", "", "", low, high, open_low, {}, "", "", ""};
  };
  add("ts_dt ts_adapt_dt_min ts_adapt_dt_max eps_tol pep_tol bv_definite_tol pc_factor_fill ksp_divtol "
      "snes_divergence_tolerance ts_adapt_safety ts_adapt_reject_safety ts_adapt_scale_solve_failed",
      OptionType::real, 0, inf, true);
  add("ts_rtol snes_rtol snes_atol snes_stol snes_trtol ksp_rtol ksp_atol snes_linesearch_rtol "
      "snes_linesearch_atol snes_linesearch_ltol pc_factor_zeropivot pc_factor_shift_amount "
      "pc_factor_column_pivot",
      OptionType::real, 0, inf, false);
  add("ts_theta_theta eps_krylovschur_restart", OptionType::real, 0, 1, true);
  add("eps_ncv eps_mpd eps_max_it pep_nev pep_ncv pep_mpd pep_max_it eps_krylovschur_ncv "
      "eps_krylovschur_mpd eps_krylovschur_partitions ksp_gmres_restart ts_ssp_nstages ts_rk_dtratio",
      OptionType::integer, 1, int_max, false);
  add("snes_max_it snes_max_funcs ksp_max_it snes_linesearch_max_it snes_linesearch_order pc_factor_levels "
      "ts_adapt_time_step_increase_delay eps_balance_its ds_method ds_block_size snes_grid_sequence",
      OptionType::integer, 0, int_max, false);
  add("ts_max_reject ts_max_snes_failures ts_monitor_frequency snes_max_fail snes_max_linear_solve_fail "
      "ksp_check_norm_iteration ksp_matsolve_batch_size",
      OptionType::integer, -1, int_max, false);
  add("snes_lag_jacobian snes_lag_preconditioner", OptionType::integer, -2, int_max, false);
  add("snes_ksp_ew_version", OptionType::integer, 1, 4, false);
  add("ts_bdf_order", OptionType::integer, 1, 6, false);
  add("options_left", OptionType::boolean, 0, 0, false);
  const auto words = [&known](const char* name, const char* list) {
    known[name] = {name, OptionType::choice, "", "", "", 0, 0, false, words_of(list), "", "", ""};
  };
  words("ts_adapt_type", "none basic dsp cfl glee history");
  words("eps_type", "krylovschur arnoldi subspace lapack power jd");
  return known;
}

const std::map<std::string, OptionSpec>& ranges() {
  static const std::map<std::string, OptionSpec> specs = make_ranges();
  return specs;
}

bool is_known(const std::string& name) {
  static const std::set<std::string> short_names =
      set_of("citations checkfunctionlist checkstack display help info log malloc nox tmp version");
  return short_names.count(name) || library_reads(name_in_database(name));
}

// Read only when an object deep inside is first used, so that set-up is too early to ask whether it was read.
bool read_late(const std::string& name) {
  static const std::vector<std::string> prefixes = words_of(
      "mat_ vec_ sub_ redundant_ mg_ fieldsplit_ npc_ esteig_ inner_ snes_test_ snes_compare_ fn_ rg_ "
      "all_ksp_");
  return starts_with_any(name, prefixes);
}

// The object whose option this is: what stands before the first underscore.
std::string object_of(const std::string& name) {
  const std::string object = name.substr(0, name.find('_'));
  return object == "da" || object == "dmda" ? "dm" : object;
}

// Not of an object: PETSc itself reads it, at its start or at its end.
bool is_program_wide(const std::string& name) {
  static const std::set<std::string> objects = set_of(
      "ts snes ksp pc mat vec dm is sf eps st bv ds rg fn pep nep svd mfn lme sub redundant mg fieldsplit "
      "npc esteig inner all matmatmult matptap mattransposematmult vecscatter");
  return !objects.count(object_of(name));
}

bool is_used(const std::string& name) {
  PetscBool used = PETSC_FALSE;
  SS_TRY(PetscOptionsUsed(nullptr, name_in_database(name).c_str(), &used));
  return used;
}

// Takes TYPE:FILE:FORMAT.
bool is_view(const std::string& name) {
  return name == "log_view" ||
         (name.size() > 5 && name.compare(name.size() - 5, 5, "_view") == 0 && !is_program_wide(name));
}

// What the program does itself, in a way that these would upset.
const std::map<std::string, std::string>& taken() {
  static const std::map<std::string, std::string> reasons = [] {
    std::map<std::string, std::string> why = {
        {"ts_init_time", "time begins at 0"},
        {"ts_final_time", "the end time is ts_max_time"},
        {"ts_exact_final_time", "the end time ts_max_time is always hit exactly"},
        {"ts_time_span", "it would change the steps; out_times and out_probes give values at chosen times"},
        {"ts_fd_color", "Jacobians are written by hand; coloured differences are unsafe on a ring"},
        {"snes_fd_color", "Jacobians are written by hand; coloured differences are unsafe on a ring"},
        {"snes_mf_operator", "Jacobians are written by hand; snes_mf takes differences throughout"},
        {"ts_rk_multirate", "the scene is not partitioned by speed"},
        {"fp_trap",
         "a trap ends the program without a word of it; what is not finite is found after every step"},
        {"options_file", "it reads a scene file, from the command line"},
        {"options_file_yaml", "-options_file FILE reads a scene file, from the command line"},
        {"options_string_yaml", "-options_file FILE reads a scene file, from the command line"},
        {"eps_nev", "spectrum_count says how many eigenvalues are listed"}};
    for (const char* shift :
         {"st_type", "st_shift", "st_transform", "st_matmode", "st_matstructure", "eps_target"})
      why[shift] =
          "J - sigma is inverted by the program itself, at shifts that it chooses; use spectrum_method "
          "krylov";
    for (const char* which :
         {"all", "interval", "largest_real", "largest_imaginary", "largest_magnitude", "smallest_real",
          "smallest_imaginary", "smallest_magnitude", "target_real", "target_imaginary", "target_magnitude",
          "hermitian", "gen_hermitian", "gen_non_hermitian", "two_sided"})
      why["eps_" + std::string(which)] = "the rightmost eigenvalues of a matrix without symmetry are sought";
    return why;
  }();
  return reasons;
}

bool set_up = false;         // this command's objects have taken their options
std::set<std::string> told;  // options of which the user knows that they are without effect

}  // namespace

bool is_library_option(const std::string& name) { return is_known(name); }

std::string nearest_option(const std::string& name) {
  const std::string meant = name_by_meaning(name);
  if (find_option(meant) || ranges().count(meant) || meant.find(" or ") != std::string::npos) return meant;
  std::vector<std::string> names;
  for (const OptionSpec& spec : option_table()) names.push_back(spec.name);
  for (const std::string& one : library_names())
    if (!taken().count(one)) names.push_back(one);
  const std::string own = without_nesting(name), near = nearest_name(name, names);
  if (!near.empty() || own.size() == name.size()) return near;
  const std::string inner = nearest_name(own, library_names());
  return inner.empty() ? "" : name.substr(0, name.size() - own.size()) + inner;
}

namespace {

void check_viewer(const std::string& name, const std::string& text, const std::string& place) {
  static const std::vector<std::string> viewers =
      words_of("ascii binary draw socket string vtk hdf5 glvis matlab saws");
  const std::string type = text.substr(0, text.find(':'));
  if (type.empty() || std::find(viewers.begin(), viewers.end(), type) != viewers.end()) return;
  const std::string near = suggestion(type, viewers);
  throw usage_error("-{} {}{}: no such viewer{}", name, quoted(text), place,
                    near.empty() ? ", e.g. ascii:file" : near);
}

}  // namespace

std::optional<std::string> check_library_value(const std::string& name,
                                               const std::optional<std::string>& text,
                                               const std::string& where) {
  const std::string place = in_place(where);
  if (const auto own = taken().find(name); own != taken().end())
    throw usage_error("-{}{}: not here: {}", name, place, own->second);
  if (text && is_view(name)) check_viewer(name, *text, place);
  const auto it = ranges().find(without_nesting(name));
  if (it == ranges().end()) return text;

  OptionSpec spec = it->second;
  spec.name = name;
  if (!text) {
    if (spec.type != OptionType::boolean)
      throw usage_error("-{}{}: needs a value, {}", name, place, requirement(spec));
    return text;
  }
  if (spec.type == OptionType::integer || spec.type == OptionType::real) {
    for (const char* word : {"default", "decide", "petsc_default", "petsc_decide"})
      if (lower_case(*text) == word) return text;
  }
  if (spec.type == OptionType::choice) {  // PETSc is case-blind here
    for (const std::string& word : spec.words)
      if (lower_case(word) == lower_case(*text)) return word;
  }
  check_value(spec, *text, where);
  // 1e3 is none to PETSc
  if (spec.type == OptionType::integer) return std::to_string(Options::integer_of(*text));
  return text;
}

bool only_looks(const std::string& name) {
  return name.find("_view") != std::string::npos || name.find("_monitor") != std::string::npos ||
         name.find("_converged_reason") != std::string::npos || starts_with(name, "eps_error_") ||
         starts_with(name, "pep_error_") || starts_with(name, "log_") || name == "info" ||
         name == "citations" || name == "options_left";
}

void insert_library_options(const Options& options) {
  for (const auto& [name, text] : options.library())
    SS_TRY(PetscOptionsSetValue(nullptr, ("-" + name_in_database(name)).c_str(),
                                text.empty() ? nullptr : text.c_str()));
  // An own option, of which PETSc knows the numbers.
  if (const std::string atol = options.text("ts_atol"); parse_number(atol))
    SS_TRY(PetscOptionsSetValue(nullptr, "-ts_atol", atol.c_str()));
}

void check_library_types(const Options& options) {
  on_root(PETSC_COMM_WORLD, [&options] {
    for (const auto& [name, text] : options.library()) {
      const auto from = text.find(':');
      if (from == std::string::npos || !(is_view(name) || name.find("_monitor") != std::string::npos))
        continue;
      const std::string file = text.substr(from + 1, text.find(':', from + 1) - from - 1);
      if (!file.empty()) paths::check_writable("-" + name, file);
    }
  });
  for (const auto initialize : {VecInitializePackage, MatInitializePackage, SNESInitializePackage,
                                KSPInitializePackage, PCInitializePackage, BVInitializePackage})
    SS_TRY(initialize());
  const std::vector<std::pair<const char*, PetscFunctionList>> lists = {
      {"snes_type", SNESList},  {"snes_linesearch_type", SNESLineSearchList},
      {"ksp_type", KSPList},    {"pc_type", PCList},
      {"bv_type", BVList},      {"mat_type", MatList},
      {"dm_mat_type", MatList}, {"vec_type", VecList},
      {"dm_vec_type", VecList}};
  for (const auto& [name, text] : options.library()) {
    const std::string plain = without_nesting(name);
    for (const auto& [key, list] : lists) {
      if (plain != key) continue;
      const char** registered = nullptr;
      int count = 0;
      SS_TRY(PetscFunctionListGet(list, &registered, &count));
      std::vector<std::string> words;  // `count` counts a null at the end
      for (int i = 0; i < count && registered[i]; ++i) words.push_back(registered[i]);
      SS_TRY(PetscFree(registered));
      // aij stands for seqaij or mpiaij
      const auto any_of = [&given = text](const std::string& word) {
        return word == given || word == "seq" + given;
      };
      if (std::any_of(words.begin(), words.end(), any_of)) continue;
      const std::string near = suggestion(text, words);
      throw usage_error("-{} {}: no such method{}", name, quoted(text),
                        near.empty() ? "; it is one of " + joined(words, " ") : near);
    }
  }
}

std::string name_in_database(const std::string& name) {
  static const std::map<std::string, std::string> newer = {
#if PETSC_VERSION_GE(3, 25, 0)
    {"ts_dt", "ts_time_step"},
    {"ts_max_reject", "ts_max_step_rejections"},
    {"ts_ssp_nstages", "ts_ssp_num_stages"},
#endif
  };
  const auto found = newer.find(name);
  return found == newer.end() ? name : found->second;
}

void clear_library_option(const std::string& name) {
  SS_TRY(PetscOptionsClearValue(nullptr, ("-" + name_in_database(name)).c_str()));
}

// Takes what `before` has out of the database, and puts in what `after` has.
static void replace_library_options(const Options& before, const Options& after) {
  if (before.library() == after.library() && before.text("ts_atol") == after.text("ts_atol")) return;
  for (const auto& [name, text] : before.library())
    if (!after.library().count(name)) clear_library_option(name);
  if (before.is_set("ts_atol")) SS_TRY(PetscOptionsClearValue(nullptr, "-ts_atol"));
  insert_library_options(after);
}

LibraryOptionsHeld::LibraryOptionsHeld(const Options& before, const Options& after)
    : before_(before), after_(after) {
  replace_library_options(before_, after_);
}

LibraryOptionsHeld::~LibraryOptionsHeld() {
  try {
    replace_library_options(after_, before_);
  } catch (const Error&) {  // of a text that was there already: out of memory alone
  }
}

void check_unused_after_setup(const Options& options, const std::string& objects) {
  set_up = true;
  const std::set<std::string> made = set_of(objects);
  for (const auto& [name, text] : options.library()) {
    const bool chooses = name.size() > 5 && name.compare(name.size() - 5, 5, "_type") == 0;
    if (!chooses || !made.count(object_of(name)) || is_used(name) || read_late(name)) continue;
    throw UsageError(shown(name, text) + ": nothing reads it in this " + options.command() +
                     "; the methods and types chosen have no such option");
  }
}

std::vector<std::string> options_of_solvers(const Options& options) {
  static const std::set<std::string> solvers = {"snes", "ksp", "pc", "mat"};
  for (const auto& [name, text] : options.library())
    if (solvers.count(object_of(name))) told.insert(name);
  return {told.begin(), told.end()};
}

void warn_unused_at_end(const Options& options) {
  for (const auto& [name, text] : options.library())
    if (!is_program_wide(name) && !told.count(name) && !is_used(name))
      warn(shown(name, text) + " was not used");
}

std::string option_behind(const std::string& message, const Options& options) {
  if (set_up) return "";
  const auto part_of_word = [&message](std::size_t i) {
    return i < message.size() && (std::isalnum((unsigned char)message[i]) || message[i] == '_');
  };
  const auto mentions = [&](const std::string& word) {
    const auto at = message.find(word);
    return !word.empty() && at != std::string::npos && !(at > 0 && part_of_word(at - 1)) &&
           !part_of_word(at + word.size());
  };
  for (const auto& [name, text] : options.library())
    if (mentions("-" + name)) return name;
  std::string best, longest;
  for (const auto& [name, text] : options.library()) {
    // the value, or one part of a list or of TYPE:FILE
    std::vector<std::string> parts = {text};
    for (const char separator : {',', ':'})
      for (const std::string& part : split(text, separator)) parts.push_back(part);
    for (const std::string& part : parts)
      if (part.size() > longest.size() && mentions(part)) {
        best = name;
        longest = part;
      }
  }
  return best;
}

}  // namespace stickslip
