#include "stickslip/trial.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <utility>

#include "share.hpp"
#include "stickslip/error.hpp"
#include "stickslip/file.hpp"
#include "stickslip/methods.hpp"
#include "stickslip/probe.hpp"
#include "stickslip/reduce.hpp"
#include "stickslip/start.hpp"
#include "stickslip/time.hpp"

namespace stickslip {

namespace {

std::vector<std::string> split_at_colons(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text)
    if (c == ':') parts.emplace_back();
    else parts.back() += c;
  return parts;
}

// Options in PETSc's database while it lives; what stood there before stands there again afterwards.
class LibrarySetting {
 public:
  explicit LibrarySetting(std::string prefix) : prefix_(std::move(prefix)) {}
  ~LibrarySetting() {
    for (auto it = before_.rbegin(); it != before_.rend(); ++it)
      if (it->second) (void)PetscOptionsSetValue(nullptr, it->first.c_str(), it->second->c_str());
      else (void)PetscOptionsClearValue(nullptr, it->first.c_str());
  }
  LibrarySetting(const LibrarySetting&) = delete;
  LibrarySetting& operator=(const LibrarySetting&) = delete;
  void set(const std::string& name, const std::string& value) {
    char old[256];
    PetscBool was_set;
    SS_TRY(PetscOptionsGetString(nullptr, prefix_.c_str(), ("-" + name).c_str(), old, sizeof old, &was_set));
    const std::string key = "-" + prefix_ + name;
    before_.emplace_back(key, was_set ? std::optional<std::string>(old) : std::nullopt);
    SS_TRY(PetscOptionsSetValue(nullptr, key.c_str(), value.c_str()));
  }

 private:
  std::string prefix_;
  std::vector<std::pair<std::string, std::optional<std::string>>> before_;
};

struct TooSlow {};

const Method& entry_of(const MethodChoice& choice) { return offered_method(choice.type, choice.subtype); }

}  // namespace

std::string MethodChoice::name() const { return entry_of(*this).name(); }
int MethodChoice::order() const { return entry_of(*this).order; }
bool MethodChoice::has_estimate() const { return entry_of(*this).adaptivity == Adaptivity::yes; }
bool MethodChoice::splits() const { return entry_of(*this).kind == MethodKind::imex; }
bool MethodChoice::is_explicit() const { return entry_of(*this).kind == MethodKind::explicit_; }

MethodChoice MethodChoice::parse(const std::string& what, const std::string& text) {
  const std::vector<std::string> parts = split_at_colons(text);
  const std::string says = what + " " + quoted(text) + ": ";
  if (parts.size() > 3)
    throw UsageError(says + "a method is type[:subtype[:implicit]], e.g. rk:5dp or arkimex:4:friction");
  MethodChoice choice;
  choice.type = parts[0];
  // the first of its type where no subtype is given
  const Method* first = nullptr;
  std::string subtypes, types;
  for (const Method& m : methods()) {
    if (choice.type == m.type) {
      if (!first) first = &m;
      subtypes += std::string(subtypes.empty() ? "" : ", ") + m.subtype;
    }
    if ((" " + types + ",").find(" " + std::string(m.type) + ",") == std::string::npos)
      types += (types.empty() ? "" : ", ") + std::string(m.type);
  }
  try {
    check_type_offered(choice.type);
    choice.subtype = parts.size() > 1 ? parts[1] : first->subtype;
    if (*first->subtype == '\0' && parts.size() == 3 && parts[1].empty()) choice.subtype = "";
    (void)entry_of(choice);
  } catch (const UsageError& e) {
    throw UsageError(says + e.what() + (first && *first->subtype ? "; " + choice.type + " has " + subtypes
                                        : first                 ? "; " + choice.type + " has no subtypes"
                                                                : "; types are " + types));
  }
  if (parts.size() < 3) return choice;
  choice.implicit = parts[2];
  const std::string& wish = choice.implicit;
  const bool known = wish == "auto" || wish == "none" || wish == "friction" || wish == "wave" || wish == "both";
  if (!known) throw UsageError(says + "what is implicit is one of auto, none, friction, wave, both");
  if (choice.is_explicit() && wish != "none" && wish != "auto")
    throw UsageError(says + choice.type + " is explicit; use arkimex, or none");
  if (!choice.is_explicit() && !choice.splits() && wish != "both" && wish != "auto")
    throw UsageError(says + choice.type + " takes everything implicitly; use arkimex, or both");
  return choice;
}

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

double largest_processor_seconds() {
  double now = processor_seconds();
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &now, 1, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD));
  return now;
}

Options options_for(const Options& options, const Setting& setting) {
  Options result = options.with("grid_n", std::to_string(setting.n));
  if (options.text("model_form") != "chain") result = result.with("grid_order", std::to_string(setting.order));
  // the user's own imex_implicit is for methods that split and say nothing themselves
  if (setting.method.splits() && setting.method.implicit == "auto") return result;
  return result.with("imex_implicit", setting.method.implicit);
}

namespace {

// The options of PETSc that choose a method.
void set_method(LibrarySetting& library, const Setting& setting) {
  const MethodChoice& choice = setting.method;
  library.set("ts_type", choice.type);
  if (!choice.subtype.empty()) library.set(subtype_option(choice.type), choice.subtype);
  if (choice.has_estimate()) {
    library.set("ts_rtol", number_text(setting.tolerance));
    library.set("ts_atol", number_text(setting.tolerance));
  } else {
    library.set("ts_dt", number_text(setting.step));
  }
}

}  // namespace

void check_settings(const Options& options, const std::vector<Setting>& settings) {
  std::vector<std::string> methods_seen, grids_seen;
  const auto is_new = [](std::vector<std::string>& seen, const std::string& key) {
    if (std::find(seen.begin(), seen.end(), key) != seen.end()) return false;
    seen.push_back(key);
    return true;
  };
  for (const Setting& s : settings) {
    const bool new_grid = is_new(grids_seen, std::to_string(s.n) + " " + std::to_string(s.order));
    const bool new_method = is_new(methods_seen, s.method.name() + " " + s.method.implicit);
    if (!new_grid && !new_method) continue;
    const Options here = options_for(options, s);
    std::vector<std::string> unheard;
    std::optional<WarningsKept> kept;
    if (!new_grid) kept.emplace(unheard);
    const Model model(PETSC_COMM_WORLD, Scene::from(here, false));
    VecHandle u = model.create_vector();
    set_start(model, here, u);
    if (!kept) kept.emplace(unheard);
    LibrarySetting library("");
    set_method(library, s);
    Integrator integrator(model, here, u);
  }
}

Trial run_trial(const Options& asked, const Setting& setting, const std::string& prefix, double limit) {
  const Options options = options_for(asked, setting);
  const MethodChoice& choice = setting.method;
  Trial trial;
  trial.method = choice.name();
  trial.implicit = choice.implicit;
  WarningsKept kept(trial.warnings);

  LibrarySetting library(prefix);
  set_method(library, setting);

  const Scene whole = Scene::from(options, false);
  const Problem problem = problem_of(whole, options, std::nullopt);
  const Model& model = problem.model;
  const Vec u = problem.u;
  const double t_end = options.real("ts_max_time");
  const PetscInt max_steps = prefix.empty() && options.is_set("ts_max_steps")
                                 ? options.integer("ts_max_steps")
                                 : std::numeric_limits<PetscInt>::max() - 1;
  const double begin = processor_seconds();
  const auto spent = [&] {
    double seconds = processor_seconds() - begin;
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &seconds, 1, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD));
    return seconds;
  };
  try {
    Integrator integrator(model, options, u, prefix);
    const auto take_report = [&] {
      const TimeReport& r = integrator.report();
      trial.steps = r.steps;
      trial.rejections = r.rejections;
      trial.rhs_evaluations = r.rhs_evaluations;
      trial.method = r.method;
      trial.implicit = to_string(r.implicit);
    };
    try {
      integrator.advance(u, 0, t_end, [&](const Integrator::Step& step) {
        if (step.index % 8 != 0 || step.index == 0) return Integrator::Verdict::go_on;
        const double now = spent();
        // no need to wait for the end of what cannot get there
        const bool hopeless = now > 0.25 * limit && now * t_end > 4 * limit * step.t;
        if (now > limit || hopeless) throw TooSlow();
        return Integrator::Verdict::go_on;
      }, max_steps);
    } catch (...) {
      take_report();
      throw;
    }
    take_report();
    if (integrator.report().reason == "ts_max_steps")
      trial.failed = "stopped at ts_max_steps " + options.text("ts_max_steps") + ", before ts_max_time";
  } catch (const TooSlow&) {
    trial.failed = "stopped: it would take more than " + number_text(limit) + " s";
  } catch (const UsageError&) {
    throw;
  } catch (const Error& e) {
    int ranks;
    MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
    if (!e.collective() && ranks > 1) throw;
    trial.failed = e.what();
  }
  trial.seconds = spent();
  if (!trial.failed.empty()) return trial;

  model.set_held(u);
  trial.end = fields_of(model, u, whole.n);
  return trial;
}

Fields fields_of(const Model& model, Vec u, PetscInt n) {
  Fields fields;
  Gather gather(u, model.dof());
  const auto& components = gather.components(u);
  if (!components.empty() && !components[0].empty())
    for (PetscInt i = 0; i < n; ++i) {
      fields.psi.push_back(components[0][std::size_t(i % model.scene().n)]);
      fields.eta.push_back(components[1][std::size_t(i % model.scene().n)]);
    }
  share(fields.psi);
  share(fields.eta);
  return fields;
}

bool has_grid_limit(const Options& options, const Scene& scene) {
  return scene.form == Form::continuum && options.real("init_noise") == 0 && options.text("init_type") != "file";
}

std::vector<int> possible_orders(const Scene& scene) {
  if (scene.form == Form::chain) return {2};
  if (scene.left == End::velocity || scene.right == End::velocity) return {2, 4, 6};
  return {2, 4, 6, 8};
}

Fields resample(const Fields& fields, const Scene& from, const Scene& to) {
  if (from.n == to.n) return fields;
  const PetscInt n = from.n, count = std::min<PetscInt>(from.order + 1, n);
  std::vector<double> binomial(std::size_t(count), 1);  // with alternating signs: barycentric weights
  for (std::size_t k = 1; k < binomial.size(); ++k)
    binomial[k] = -binomial[k - 1] * double(std::size_t(count) - k) / double(k);
  Fields result;
  for (PetscInt i = 0; i < to.n; ++i) {
    const double at = std::min(to.x(i) / from.h(), double(from.ring() ? n : n - 1));
    const PetscInt nearest = PetscInt(std::llround(at));
    PetscInt first = nearest - count / 2;
    if (!from.ring()) first = std::clamp<PetscInt>(first, 0, n - count);
    double psi = 0, eta = 0, sum = 0;
    const bool on_node = std::abs(at - double(nearest)) < 1e-12 * (1 + at);
    for (PetscInt k = 0; k < count; ++k) {
      if (on_node && first + k != nearest) continue;
      const double weight = on_node ? 1 : binomial[std::size_t(k)] / (at - double(first + k));
      const auto node = std::size_t(((first + k) % n + n) % n);
      psi += weight * fields.psi[node];
      eta += weight * fields.eta[node];
      sum += weight;
    }
    result.psi.push_back(psi / sum);
    result.eta.push_back(eta / sum);
  }
  return result;
}

double distance(const Fields& a, const Fields& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.psi.size(); ++i)
    largest = std::max({largest, std::abs(a.psi[i] - b.psi[i]), std::abs(a.eta[i] - b.eta[i])});
  return largest;
}

Converged converge_in_time(const Options& options, int order, PetscInt n, double limit) {
  struct Attempt {
    MethodChoice method;
    double tolerance;
  };
  static const std::vector<std::pair<Attempt, Attempt>> pairs = {
      {{{"rk", "8vr", "auto"}, 1e-13}, {{"rk", "7vr", "auto"}, 1e-12}},
      {{{"arkimex", "5", "both"}, 1e-11}, {{"rosw", "4l", "auto"}, 1e-10}}};
  Converged result;
  result.scene = Scene::from(options_for(options, {pairs[0].first.method, 0, 0, order, n}), false);
  for (const auto& [best, second] : pairs) {
    const Trial a = run_trial(options, {best.method, best.tolerance, 0, order, n}, "reference_", limit);
    result.seconds += a.seconds;
    if (!a.failed.empty()) {
      result.failed += (result.failed.empty() ? "" : "; ") + a.method + ": " + a.failed;
      continue;
    }
    const Trial b = run_trial(options, {second.method, second.tolerance, 0, order, n}, "reference_", 3 * limit);
    result.seconds += b.seconds;
    if (!b.failed.empty()) {
      result.failed += (result.failed.empty() ? "" : "; ") + b.method + ": " + b.failed;
      continue;
    }
    result.fields = a.end;
    result.time_error = distance(a.end, b.end);
    result.method = a.method;
    result.failed.clear();
    return result;
  }
  return result;
}

}  // namespace stickslip
