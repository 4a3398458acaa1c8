#include "stickslip/options/library_options.hpp"

#include <slepceps.h>
#include <petscts.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "base/failure.hpp"
#include "base/paths.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/handle.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double int_max = std::numeric_limits<PetscInt>::max();

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

// What the well-known options take, by kind. (Names and words as `-help` of PETSc 3.18 and SLEPc 3.18 lists
// them.)
std::map<std::string, OptionSpec> make_known() {
  std::map<std::string, OptionSpec> known;
  const auto add = [&known](const char* names, OptionType type, double low, double high, bool open_low) {
    for (const std::string& name : words_of(names))
      known[name] = {name, type, "", "", "", low, high, open_low, {}, "", "", ""};
  };
  const auto words = [&known](const char* name, const char* list) {
    known[name] = {name, OptionType::choice, "", "", "", 0, 0, false, words_of(list), "", "", ""};
  };
  add("ts_dt ts_adapt_dt_min ts_adapt_dt_max eps_tol pep_tol bv_definite_tol pc_factor_fill ksp_divtol "
      "snes_divergence_tolerance ts_adapt_safety ts_adapt_reject_safety ts_adapt_scale_solve_failed",
      OptionType::real, 0, inf, true);
  add("ts_rtol ts_atol snes_rtol snes_atol snes_stol snes_trtol ksp_rtol ksp_atol snes_linesearch_rtol "
      "snes_linesearch_atol snes_linesearch_ltol pc_factor_zeropivot pc_factor_shift_amount "
      "pc_factor_column_pivot",
      OptionType::real, 0, inf, false);
  add("ts_theta_theta eps_krylovschur_restart", OptionType::real, 0, 1, true);
  add("ts_init_time ts_adapt_max_ignore pep_target eps_balance_cutoff rg_scale bv_orthog_eta "
      "ksp_gmres_haptol ksp_gmres_breakdown_tolerance snes_ksp_ew_alpha snes_ksp_ew_alpha2 snes_ksp_ew_gamma "
      "snes_ksp_ew_rtol0 snes_ksp_ew_rtolmax snes_ksp_ew_threshold snes_linesearch_alpha "
      "snes_linesearch_damping "
      "snes_linesearch_maxstep snes_linesearch_minlambda snes_tr_delta0 snes_tr_eta snes_tr_mu snes_tr_sigma",
      OptionType::real, -inf, inf, false);
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
  add("ts_adapt_always_accept ts_arkimex_fully_implicit ts_arkimex_initial_guess_extrapolate "
      "ts_error_if_step_fails "
      "ts_rk_multirate ts_rosw_recompute_jacobian ts_save_trajectory ts_theta_endpoint "
      "ts_theta_initial_guess_extrapolate ts_adapt_monitor ts_monitor_cancel "
      "snes_error_if_not_converged snes_fd snes_force_iteration snes_ksp_ew snes_lag_jacobian_persists "
      "snes_lag_preconditioner_persists snes_linesearch_keeplambda snes_linesearch_norms snes_mf "
      "snes_mf_operator "
      "ksp_constant_null_space ksp_converged_maxits ksp_diagonal_scale ksp_diagonal_scale_fix "
      "ksp_error_if_not_converged ksp_initial_guess_nonzero ksp_knoll ksp_lag_norm ksp_reuse_preconditioner "
      "pc_factor_diagonal_fill pc_factor_in_place pc_factor_pivot_in_blocks pc_factor_reuse_fill "
      "pc_factor_reuse_ordering pc_use_amat eps_krylovschur_detect_zeros eps_krylovschur_locking "
      "eps_purify eps_true_residual eps_non_hermitian eps_harmonic eps_refined eps_ritz eps_conv_abs "
      "eps_conv_rel eps_conv_norm "
      "ksp_gmres_classicalgramschmidt ksp_gmres_modifiedgramschmidt ksp_gmres_preallocate "
      "malloc_debug options_left no_signal_handler",
      OptionType::boolean, 0, 0, false);
  words("ts_glee_type", "BE1 23 24 25i 35 exrk2a rk32g1 rk285ex");
  words("ts_adapt_type", "none basic dsp cfl glee history");
  words("ksp_norm_type", "none preconditioned unpreconditioned natural");
  words("ksp_pc_side", "left right symmetric");
  words("pc_factor_shift_type", "none nonzero positive_definite inblocks");
  words("snes_norm_schedule", "none always initialonly finalonly initialfinalonly");
  words("eps_type", "krylovschur arnoldi subspace lapack power jd");
  words("eps_balance", "none oneside twoside user");
  return known;
}

const std::map<std::string, OptionSpec>& known_specs() {
  static const std::map<std::string, OptionSpec> specs = make_known();
  return specs;
}

// Names whose value is free text, or which take none; for suggestions, and so that they count as known.
const std::set<std::string>& other_names() {
  static const std::set<std::string> names = set_of(
      "ts_type ts_rk_type ts_arkimex_type ts_rosw_type ts_ssp_type ts_adapt_clip ts_adapt_wnormtype ts_view "
      "ts_view_solution ts_monitor "
      "ts_monitor_solution ts_time_span ts_monitor_solution_vtk ts_monitor_error ts_monitor_extreme "
      "ts_monitor_lg_solution "
      "snes_type snes_linesearch_type snes_view snes_monitor snes_monitor_short snes_converged_reason "
      "snes_linesearch_monitor snes_test_jacobian snes_test_jacobian_view snes_compare_explicit "
      "ksp_type ksp_view ksp_monitor ksp_monitor_true_residual ksp_converged_reason ksp_guess_type "
      "pc_type pc_view pc_factor_mat_ordering_type pc_factor_mat_solver_type "
      "pc_factor_nonzeros_along_diagonal "
      "mat_type mat_view mat_fd_type vec_type vec_view dm_view dm_mat_type dm_vec_type "
      "eps_view eps_view_values eps_view_vectors eps_monitor eps_monitor_all eps_monitor_conv "
      "eps_converged_reason eps_error_absolute eps_error_backward eps_error_relative "
      "st_view bv_type bv_orthog_type bv_orthog_refine bv_orthog_block ds_parallel "
      "pep_type pep_view pep_monitor pep_converged_reason "
      "rg_type rg_interval_endpoints");
  return names;
}

// What PETSc itself reads when it starts or ends.
const std::set<std::string>& global_names() {
  static const std::set<std::string> names = set_of(
      "log_view log_view_memory log_all log log_exclude log_trace log_sync log_mpe log_perfstubs "
      "options_left options_view options_monitor options_monitor_cancel "
      "malloc malloc_debug malloc_dump malloc_view malloc_view_threshold malloc_test malloc_coalesce "
      "malloc_hbw malloc_info malloc_log "
      "malloc_requested_size memory_view info citations version help display nox nox_warning x_virtual "
      "fp_trap no_signal_handler on_error_abort on_error_mpiabort on_error_attach_debugger on_error_emacs "
      "on_error_malloc_dump error_output_stdout error_output_none debug_terminal debugger_pause "
      "debugger_ranks start_in_debugger stop_for_debugger get_total_flops objects_dump tmp shared_tmp "
      "not_shared_tmp "
      "mpi_return_on_error petsc_sleep skip_petscrc use_gpu_aware_mpi checkfunctionlist "
      "check_pointer_intensity checkstack device_enable device_select device_view default_device_type "
      "draw_pause draw_save "
      "viewer_binary_skip_info blas_view");
  return names;
}

bool starts_with_prefix_of_library(const std::string& name) {
  static const std::vector<std::string> prefixes = words_of(
      "ts_ snes_ ksp_ pc_ mat_ vec_ da_ dm_ dmda_ is_ sf_ vecscatter_ eps_ st_ bv_ ds_ rg_ fn_ pep_ nep_ "
      "svd_ "
      "mfn_ lme_ log_ options_ malloc_ memory_ on_error_ debugger_ device_ root_device_context_ draw_ "
      "viewer_ petsc_ "
      "slepc_ info_ sub_ redundant_ mg_ fieldsplit_ npc_ esteig_ inner_ matmatmult_ matptap_ "
      "mattransposematmult_ "
      "all_ksp_");
  return starts_with_any(name, prefixes) && !std::count(prefixes.begin(), prefixes.end(), name);
}

// Inner objects have the names of the plain ones behind a prefix: st_ksp_rtol, sub_pc_type,
// mg_levels_ksp_type.
std::string without_nesting(std::string name) {
  for (bool again = true; again;) {
    again = false;
    for (const char* outer :
         {"st_ksp_", "st_pc_", "sub_", "redundant_", "mg_levels_", "mg_coarse_", "npc_"}) {
      if (!starts_with(name, outer)) continue;
      name = name.substr(starts_with(name, "st_") ? 3 : std::string(outer).size());
      again = true;
      break;
    }
  }
  return name;
}

bool is_known(const std::string& name) {
  const std::string plain = without_nesting(name);
  return known_specs().count(plain) || other_names().count(plain) || global_names().count(plain);
}

// Read only when an object deep inside is first used, so that set-up is too early to ask whether it was read.
bool read_late(const std::string& name) {
  static const std::vector<std::string> prefixes = words_of(
      "mat_ vec_ sub_ redundant_ mg_ fieldsplit_ npc_ esteig_ inner_ is_ sf_ vecscatter_ viewer_ draw_ "
      "matmatmult_ "
      "matptap_ mattransposematmult_ snes_test_ snes_compare_ fn_ rg_ all_ksp_");
  return starts_with_any(name, prefixes);
}

// The object whose option this is: what stands before the first underscore.
std::string object_of(const std::string& name) {
  const std::string object = name.substr(0, name.find('_'));
  return object == "da" || object == "dmda" ? "dm" : object;
}

// The objects that a command makes whatever it is asked.
std::set<std::string> made_by(const std::string& command) {
  if (command == "run") return {"ts", "snes", "ksp", "pc"};
  if (command == "wave") return {"snes"};
  return {};
}

// Of the whole program rather than of an object.
bool is_program_wide(const std::string& name) {
  return starts_with_any(name, {"log_", "options_", "malloc_", "memory_", "on_error_", "debugger_", "info_"});
}

[[noreturn]] void refuse_unknown(const std::string& name) {
  throw UsageError("unknown option -" + quoted(name) + ": neither this program nor PETSc or SLEPc reads it" +
                   suggestion(name, known_options(), "-"));
}

bool is_used(const std::string& name) {
  PetscBool used = PETSC_FALSE;
  SS_TRY(PetscOptionsUsed(nullptr, name.c_str(), &used));
  return used;
}

// Takes TYPE:FILE:FORMAT.
bool is_view(const std::string& name) {
  return name == "log_view" ||
         (name.size() > 5 && name.compare(name.size() - 5, 5, "_view") == 0 && !global_names().count(name));
}

bool set_up = false;  // this command's objects have taken their options

}  // namespace

bool is_library_option(const std::string& name) {
  return global_names().count(name) || starts_with_prefix_of_library(name);
}

std::vector<std::string> known_options() {
  std::vector<std::string> names;
  for (const OptionSpec& spec : option_table()) names.push_back(spec.name);
  for (const auto& [name, spec] : known_specs()) names.push_back(name);
  names.insert(names.end(), other_names().begin(), other_names().end());
  names.insert(names.end(), global_names().begin(), global_names().end());
  return names;
}

namespace {

// -ts_max_tim carries a prefix of PETSc and is meant for the program.
void refuse_misspelt(const std::string& name, const std::string& place) {
  if (is_known(name)) return;
  const std::string near = nearest_name(name, known_options());
  if (find_option(near) && object_of(near) == object_of(name))
    throw usage_error("unknown option -{}{}; did you mean -{}?", quoted(name), place, near);
}

// What the program does itself, in a way that these would upset.
void refuse_taken(const std::string& name, const std::string& place) {
  static const std::map<std::string, std::string> taken = [] {
    std::map<std::string, std::string> why = {
        {"ts_init_time", "time begins at 0"},
        {"ts_exact_final_time", "the end time ts_max_time is always hit exactly"},
        {"ts_time_span", "it would change the steps; out_times and out_probes give values at chosen times"},
        {"ts_fd_color", "Jacobians are written by hand; coloured differences are unsafe on a ring"},
        {"snes_fd_color", "Jacobians are written by hand; coloured differences are unsafe on a ring"},
        {"snes_mf_operator", "Jacobians are written by hand; snes_mf takes differences throughout"},
        {"ts_rk_multirate", "the scene is not partitioned by speed"},
        {"fp_trap",
         "a trap ends the program without a word of it; what is not finite is found after every step"},
        {"options_file", "it reads either form of a file, from the command line"},
        {"options_file_yaml", "-options_file FILE reads either form, from the command line"},
        {"options_string_yaml", "-options_file FILE reads either form, from the command line"},
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
  const auto own = taken.find(name);
  if (own != taken.end()) throw usage_error("-{}{}: not here: {}", name, place, own->second);
}

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
  refuse_misspelt(name, place);
  refuse_taken(name, place);
  if (text && is_view(name)) check_viewer(name, *text, place);
  const auto it = known_specs().find(without_nesting(name));
  if (it == known_specs().end()) return text;

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
    SS_TRY(PetscOptionsSetValue(nullptr, ("-" + name).c_str(), text.empty() ? nullptr : text.c_str()));
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
      const auto any_of = [&](const std::string& word) { return word == text || word == "seq" + text; };
      if (std::any_of(words.begin(), words.end(), any_of)) continue;
      const std::string near = suggestion(text, words);
      throw usage_error("-{} {}: no such method{}", name, quoted(text),
                        near.empty() ? "; it is one of " + joined(words, " ") : near);
    }
  }
}

void check_library_names(const Options& options) {
  std::vector<std::string> doubtful;
  for (const auto& [name, text] : options.library())
    if (!is_known(name) && !read_late(name) && (is_program_wide(name) || !only_looks(name)))
      doubtful.push_back(name);
  if (doubtful.empty()) return;

  // Objects without a problem, of the types that the user wants or the usual ones: what do they read?
  for (const char* type : {TSRK, TSARKIMEX}) {
    TsHandle ts;
    SS_TRY(TSCreate(PETSC_COMM_WORLD, ts.out()));
    SS_TRY(TSSetType(ts, type));
    SS_TRY(TSSetFromOptions(ts));
  }
  SnesHandle snes;
  SS_TRY(SNESCreate(PETSC_COMM_WORLD, snes.out()));
  SS_TRY(SNESSetFromOptions(snes));
  KspHandle ksp;
  SS_TRY(KSPCreate(PETSC_COMM_WORLD, ksp.out()));
  SS_TRY(KSPSetFromOptions(ksp));
  EpsHandle eps;
  SS_TRY(EPSCreate(PETSC_COMM_WORLD, eps.out()));
  SS_TRY(EPSSetFromOptions(eps));

  for (const std::string& name : doubtful) {
    static const std::set<std::string> objects = {"ts", "snes", "ksp", "pc", "eps", "st", "bv", "ds"};
    if (!is_used(name) && (objects.count(object_of(name)) || is_program_wide(name))) refuse_unknown(name);
  }
  for (const auto& [name, text] : options.library())
    SS_TRY(PetscOptionsClearValue(nullptr, ("-" + name).c_str()));
  insert_library_options(options);  // unread again
}

void check_unused_after_setup(const Options& options, const std::string& not_made) {
  set_up = true;
  std::set<std::string> made = made_by(options.command());
  for (const std::string& object : words_of(not_made)) made.erase(object);
  for (const auto& [name, text] : options.library()) {
    if (is_used(name) || global_names().count(name) || only_looks(name) || read_late(name)) continue;
    if (!made.count(object_of(name))) continue;
    throw UsageError(shown(name, text) + ": nothing reads it in this " + options.command() +
                     "; the methods and types chosen have no such option");
  }
}

void warn_unused_at_end(const Options& options) {
  for (const auto& [name, text] : options.library())
    if (!global_names().count(name) && !is_used(name)) warn(shown(name, text) + " was not used");
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
