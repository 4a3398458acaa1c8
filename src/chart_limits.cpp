#include "stickslip/limits.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "chart_log.hpp"
#include "progress.hpp"
#include "ranges.hpp"
#include "share.hpp"
#include "step_forecast.hpp"
#include "stickslip/error.hpp"
#include "stickslip/library_options.hpp"
#include "stickslip/measure.hpp"
#include "stickslip/methods.hpp"
#include "stickslip/start.hpp"
#include "stickslip/summary.hpp"
#include "stickslip/time.hpp"
#include "stickslip/trust.hpp"

namespace stickslip {

namespace {

const char* const prefix = "limits_";

// The options of PETSc that make a method, for as long as this lives.
class MethodOptions {
 public:
  MethodOptions() = default;
  MethodOptions(const MethodChoice& choice, double dt) {
    set("ts_type", choice.type);
    if (!choice.subtype.empty()) set(subtype_option(choice.type), choice.subtype);
    set("ts_adapt_type", "none");
    set("ts_dt", number_text(dt));
  }
  ~MethodOptions() {
    for (const std::string& name : set_) (void)PetscOptionsClearValue(nullptr, name.c_str());
  }
  MethodOptions(const MethodOptions&) = delete;
  MethodOptions& operator=(const MethodOptions&) = delete;
  void set(const std::string& name, const std::string& value) {
    set_.push_back(std::string("-") + prefix + name);
    SS_TRY(PetscOptionsSetValue(nullptr, set_.back().c_str(), value.c_str()));
  }

 private:
  std::vector<std::string> set_;
};

// What one run came to.
struct Outcome {
  std::string failure;  // the error that ended it
  std::string regime;
  double amplitude = NAN, speed = NAN, largest = 0;
  PetscInt steps = 0;
  bool warned = false;  // of the steps; fronts that the grid does not carry are another matter
};

bool is_of_steps(const std::string& warning) {
  return warning.find("a front is not resolved") == std::string::npos &&
         warning.find("with fixed steps the order is 2") == std::string::npos &&
         warning.find("chosen for stability") == std::string::npos;
}

double largest_psi(const Model& model, Vec u) {
  const double* a;
  SS_TRY(VecGetArrayRead(u, &a));
  double largest = 0;
  for (PetscInt i = 0; i < model.local(); ++i) largest = std::max(largest, std::abs(a[i * model.dof()]));
  SS_TRY(VecRestoreArrayRead(u, &a));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, model.comm()));
  return largest;
}

// Root mean square of psi - v; or of its part that alternates from node to node, with that of eta in the norm that
// waves of that length conserve.
double off_sliding(const Model& model, Vec u, bool alternating) {
  const Scene& s = model.scene();
  const double state = model.dof() == 3 ? model.steady_state(s.v) : 0;
  const double eta = s.B() * s.v + model.friction(0, s.v, state).F;
  const double* a;
  SS_TRY(VecGetArrayRead(u, &a));
  double sums[2] = {0, 0};
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double psi = a[i * model.dof()] - s.v, sign = (model.first() + i) % 2 == 0 ? 1 : -1;
    sums[0] += alternating ? sign * psi : psi * psi;
    sums[1] += sign * (a[i * model.dof() + 1] - eta);
  }
  SS_TRY(VecRestoreArrayRead(u, &a));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, sums, 2, MPI_DOUBLE, MPI_SUM, model.comm()));
  const double n = double(s.n);
  return alternating ? std::hypot(sums[0], sums[1] * s.A() / model.wave_frequency()) / n : std::sqrt(sums[0] / n);
}

// Runs as the command `run` would, by the method that stands in the database under the prefix.
Outcome observe(const Options& options, const Model& model, Vec start, double t_end) {
  Outcome outcome;
  std::vector<std::string> said;
  {
    WarningsKept kept(said);
    VecHandle u = model.create_vector(), work = model.create_vector();
    SS_TRY(VecCopy(start, u));
    int rank;
    MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
    Measurement measurement(model.scene(), t_end);
    Ranges ranges(model, t_end);
    Gather gather(u, model.dof());
    std::size_t next = 0;
    try {
      Integrator integrator(model, options, u, prefix);
      integrator.set_output_times(measurement.times());
      Trust trust(model, options, integrator, 0, t_end);
      integrator.advance(u, 0, t_end, [&](const Integrator::Step& step) {
        trust.after(step);
        ranges.after(step.t, step.u);
        outcome.steps = step.index;
        for (; next < measurement.times().size() && measurement.times()[next] <= step.t; ++next) {
          step.interpolate(measurement.times()[next], work);
          const auto& fields = gather.components(work);
          if (rank == 0) measurement.sample(measurement.times()[next], fields[0]);
        }
        outcome.largest = std::max(outcome.largest, largest_psi(model, step.u));
        return Integrator::Verdict::go_on;
      });
      ranges.into(measurement, gather, work);
      if (rank == 0) {
        const Measurement::Result r = measurement.result();
        outcome.regime = r.regime;
        outcome.amplitude = r.amplitude.value_or(NAN);
        outcome.speed = r.wave_speed.value_or(NAN);
      }
      share(outcome.regime);
      share(outcome.amplitude);
      share(outcome.speed);
      trust.warn_of(trust.verdict(u), outcome.regime);
    } catch (const Failure& e) {
      outcome.failure = e.what();
    }
  }
  outcome.warned = std::any_of(said.begin(), said.end(), is_of_steps);
  return outcome;
}

std::string rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

}  // namespace

struct Limits::Impl {
  Options options;
  double t_end;
  Scene scene;
  Model model;
  VecHandle start;
  Outcome truth;

  explicit Impl(const Options& o)
      : options(o.with("imex_implicit", "auto")), t_end(o.real("ts_max_time")), scene(Scene::from(options, false)),
        model(PETSC_COMM_WORLD, scene), start(model.create_vector()) {
    set_start(model, options, start);
    MethodOptions accurate;
    accurate.set("ts_rtol", "1e-8");
    accurate.set("ts_atol", "1e-8");
    truth = observe(options, model, start, t_end);
    if (!truth.failure.empty()) throw Failure("the accurate run of the scene failed: " + truth.failure);
  }

  Outcome run(const MethodChoice& method, double dt) const {
    const MethodOptions set(method, dt);
    return observe(options.with("imex_implicit", method.implicit), model, start, t_end);
  }

  // Why a run is no answer at all ("" where it is one), and why it is a wrong one.
  std::string breakdown(const Outcome& o) const {
    if (o.failure.find("not finite") != std::string::npos) return "blow-up";
    if (o.failure.find("Newton") != std::string::npos) return "Newton's method fails";
    if (!o.failure.empty()) return o.failure;
    return o.largest > 2 * truth.largest ? "psi out of bounds" : "";
  }
  std::string mistake(const Outcome& o) const {
    if (std::string b = breakdown(o); !b.empty()) return b;
    if (o.regime != truth.regime) return "regime " + o.regime;
    if (!(std::abs(o.amplitude - truth.amplitude) <= 0.1 * truth.amplitude) && truth.regime != "sliding")
      return "amplitude " + rounded(o.amplitude / truth.amplitude) + " times the true one";
    if (std::isfinite(truth.speed) && !(std::abs(o.speed - truth.speed) <= 0.02 * std::abs(truth.speed)))
      return std::isfinite(o.speed) ? "wave speed " + rounded(o.speed / truth.speed) + " times the true one"
                                    : "no wave speed";
    return "";
  }

  struct Found {
    std::optional<double> good, bad;  // the largest step below the first bad one, and that one
    std::string why;
  };
  // Narrows the gap to 5 %.
  template <class Why>
  void bisect(Found& f, const Why& why) const {
    while (f.good && f.bad && *f.bad > 1.05 * *f.good) {
      const double middle = std::sqrt(*f.good * *f.bad);
      const std::string now = why(middle);
      if (now.empty()) {
        f.good = middle;
      } else {
        f.bad = middle;
        f.why = now;
      }
    }
  }

  void scan(const MethodChoice& method, LimitRow& row, double first) const {
    const auto check = [&](double dt, bool breaks) {
      const Outcome o = run(method, dt);
      ++row.runs;
      const std::string wrong = mistake(o);
      if (!wrong.empty() && o.failure.empty() && !o.warned) {
        row.warned = false;
        row.silent.push_back(dt);
      }
      return breaks ? breakdown(o) : wrong;
    };
    Found breaks, errs;
    const auto note = [](Found& f, double dt, const std::string& why) {
      if (f.bad) return;
      if (why.empty()) {
        f.good = dt;
      } else {
        f.bad = dt;
        f.why = why;
      }
    };
    for (double dt = first; dt <= t_end / 8 && !breaks.bad; dt *= 2) {
      const Outcome o = run(method, dt);
      ++row.runs;
      row.longest = dt;
      const std::string wrong = mistake(o);
      if (!wrong.empty() && o.failure.empty() && !o.warned) {
        row.warned = false;
        row.silent.push_back(dt);
      }
      note(breaks, dt, breakdown(o));
      note(errs, dt, wrong);
    }
    // Methods of low order fail below the first step already.
    for (double dt = first / 4; !errs.good && dt > first / 100; dt /= 4) {
      const std::string why = check(dt, false);
      if (why.empty()) errs.good = dt;
      else errs.bad = dt, errs.why = why;
    }
    for (double dt = first / 4; !breaks.good && dt > first / 100; dt /= 4) {
      const std::string why = check(dt, true);
      if (why.empty()) breaks.good = dt;
      else breaks.bad = dt, breaks.why = why;
    }
    bisect(breaks, [&](double dt) { return check(dt, true); });
    bisect(errs, [&](double dt) { return check(dt, false); });
    row.limit = breaks.bad ? breaks.good : std::nullopt;
    row.how = breaks.why;
    row.followed = errs.good;
    row.wrong = errs.why;
  }

  // Growth rate of noise about sliding in the second half of so many steps; infinite where the run breaks down.
  double rate_of_noise(const MethodChoice& method, double dt, int steps, double noise, bool alternating) const {
    std::vector<std::string> ignored;
    const WarningsKept kept(ignored);
    const Options calm = options.with("init_type", "uniform").with("init_psi", "steady").with("init_eta", "steady")
                             .with("init_noise", noise).with("imex_implicit", method.implicit);
    VecHandle u = model.create_vector();
    set_start(model, calm, u);
    const MethodOptions set(method, dt);
    double middle = 0, end = 0;
    const int window = std::max(1, steps / 4);
    try {
      Integrator integrator(model, calm, u, prefix);
      integrator.advance(u, 0, steps * dt, [&](const Integrator::Step& step) {
        // the largest over a while, since waves go up and down
        const double now = off_sliding(model, step.u, alternating);
        if (step.index > steps / 2 - window && step.index <= steps / 2) middle = std::max(middle, now);
        if (step.index > steps - window) end = std::max(end, now);
        return Integrator::Verdict::go_on;
      });
    } catch (const Failure&) {
      return HUGE_VAL;
    }
    const auto second_half = steps - steps / 2;
    return std::log(end / middle) / (double(second_half) * dt);
  }

  // The x between low and high from which on `beyond` holds, to 2 %; empty where it holds at low or not at high.
  template <class Beyond>
  std::optional<double> edge(double low, double high, const Beyond& beyond) const {
    if (beyond(low) || !beyond(high)) return std::nullopt;
    while (high > 1.02 * low) {
      const double middle = std::sqrt(low * high);
      (beyond(middle) ? high : low) = middle;
    }
    return std::sqrt(low * high);
  }

  void find_shortest(const MethodChoice& method, LimitRow& row, StepForecast& forecast) const {
    const double frequency = model.wave_frequency(), allowed = 0.02 * frequency;
    const double growth = forecast.sliding_growth(false);
    const auto grows = [&](double dt) { return forecast.shortest_wave_excess(dt) > allowed; };
    double dt = 0.003 / frequency;
    while (dt < 100 / frequency && !grows(dt)) dt *= 1.1;
    if (dt >= 100 / frequency) return;
    row.shortest_theory = edge(dt / 1.5, dt, grows);
    if (!row.shortest_theory) return;
    row.shortest = edge(*row.shortest_theory / 1.25, *row.shortest_theory * 1.25, [&](double step) {
      ++row.runs;
      // so few steps that the noise stays small where it grows as it should, and other waves do not feed this one
      const double steps = growth > 0 ? 14 / (growth * step) : 400;
      const double rate = rate_of_noise(method, step, int(std::clamp(steps, 8., 400.)), 1e-11, true);
      return rate - forecast.shortest_growth() > allowed;
    });
  }

  void find_damping(const MethodChoice& method, LimitRow& row, StepForecast& forecast) const {
    const double growth = forecast.sliding_growth(false);
    if (!(growth > 0)) return;
    const auto hides = [&](double dt) { return forecast.sliding_growth_of({{dt, 1.}}, false) < 0; };
    // The step from which on it is so: sought from long steps down.
    const double longest = 300 / growth, shortest = 1e-3 / growth;
    double dt = longest;
    while (dt > shortest && hides(dt)) dt /= 1.25;
    if (dt == longest || dt <= shortest) return;
    row.damps_theory = edge(dt, 1.25 * dt, hides);
    row.damps = edge(*row.damps_theory / 1.25, *row.damps_theory * 1.25, [&](double step) {
      ++row.runs;
      return rate_of_noise(method, step, 160, 1e-8, false) < 0;
    });
  }
};

Limits::Limits(const Options& options) : impl_(std::make_unique<Impl>(options)) {}
Limits::~Limits() = default;

LimitRow Limits::row(const MethodChoice& method) {
  const Impl& m = *impl_;
  LimitRow row;
  row.order = m.scene.order;
  row.n = m.scene.n;
  // as long as the accurate run's own steps
  double first = m.t_end / double(std::max<PetscInt>(m.truth.steps, 16));
  std::vector<std::string> ignored;
  const WarningsKept kept(ignored);
  const MethodOptions set(method, first);
  VecHandle u = m.model.create_vector();
  SS_TRY(VecCopy(m.start, u));
  row.method = method.name();
  row.implicit = method.implicit;
  std::unique_ptr<Integrator> made;
  try {
    made = std::make_unique<Integrator>(m.model, m.options.with("imex_implicit", method.implicit), u, prefix);
  } catch (const UsageError& e) {
    row.how = row.wrong = std::string("refused: ") + e.what();
    return row;
  }
  const Integrator& integrator = *made;
  row.implicit = to_string(integrator.report().implicit);
  StepForecast forecast(m.model, u, integrator.report().implicit, integrator.ts());
  const double longest = m.t_end / 8;
  if (forecast.explodes(longest, m.t_end)) {
    row.theory = forecast.limit(longest, m.t_end);
    first = std::min(first, *row.theory / 2);
  }
  m.find_shortest(method, row, forecast);
  m.find_damping(method, row, forecast);
  m.scan(method, row, first);
  return row;
}

namespace {

const std::vector<std::string>& default_methods() {
  static const std::vector<std::string> list = {
      "rk:5dp",           "rk:3bs",          "rk:4",           "rk:8vr",         "euler",        "ssp:rks3",
      "arkimex:3:friction", "arkimex:3:wave",  "arkimex:3:both", "arkimex:4:friction", "arkimex:4:wave",
      "arkimex:4:both",   "arkimex:1bee:both", "rosw:ra34pw2", "rosw:4l",        "bdf:2",        "bdf:4",
      "theta",            "cn",              "beuler",         "alpha"};
  return list;
}

std::vector<MethodChoice> wanted_methods(const Options& options) {
  std::vector<MethodChoice> choices;
  std::vector<std::string> names = options.words("chart_methods");
  if (names.empty()) names = default_methods();
  if (names == std::vector<std::string>{"all"}) {
    names.clear();
    for (const Method& m : methods()) {
      if (m.kind != MethodKind::imex) names.push_back(m.name());
      else
        for (const char* split : {"friction", "wave", "both"}) names.push_back(m.name() + ":" + split);
    }
  }
  for (const std::string& name : names) choices.push_back(MethodChoice::parse("-chart_methods", name));
  return choices;
}

std::string key_of(std::size_t scene, const MethodChoice& choice) {
  return std::to_string(scene) + "|" + choice.name() + "|" + choice.implicit;
}

Texts texts_of(const std::string& key, const LimitRow& r) {
  return {{"row", key},
          {"method", r.method},
          {"implicit", r.implicit},
          {"order", std::to_string(r.order)},
          {"n", std::to_string(r.n)},
          {"value", number_text(r.value)},
          {"theory", optional_text(r.theory)},
          {"limit", optional_text(r.limit)},
          {"followed", optional_text(r.followed)},
          {"shortest_theory", optional_text(r.shortest_theory)},
          {"shortest", optional_text(r.shortest)},
          {"damps_theory", optional_text(r.damps_theory)},
          {"damps", optional_text(r.damps)},
          {"how", r.how},
          {"wrong", r.wrong},
          {"silent", numbers_text(r.silent)},
          {"runs", std::to_string(r.runs)},
          {"longest", number_text(r.longest)}};
}

LimitRow row_of(const Texts& texts) {
  LimitRow r;
  r.method = texts.at("method");
  r.implicit = texts.at("implicit");
  r.order = int(number_of(texts.at("order")));
  r.n = PetscInt(number_of(texts.at("n")));
  r.value = number_of(texts.at("value"));
  r.theory = optional_of(texts.at("theory"));
  r.limit = optional_of(texts.at("limit"));
  r.followed = optional_of(texts.at("followed"));
  r.shortest_theory = optional_of(texts.at("shortest_theory"));
  r.shortest = optional_of(texts.at("shortest"));
  r.damps_theory = optional_of(texts.at("damps_theory"));
  r.damps = optional_of(texts.at("damps"));
  r.how = texts.at("how");
  r.wrong = texts.at("wrong");
  r.silent = numbers_of(texts.at("silent"));
  r.warned = r.silent.empty();
  r.runs = int(number_of(texts.at("runs")));
  r.longest = number_of(texts.at("longest"));
  return r;
}

Json json_of(const LimitRow& r, bool varied) {
  return Json::object({{"method", r.method},
                       {"implicit", r.implicit},
                       {"order", r.order},
                       {"n", r.n},
                       {"value", varied ? Json(r.value) : Json()},
                       {"theory", r.theory},
                       {"limit", r.limit},
                       {"how", r.how.empty() ? Json() : Json(r.how)},
                       {"followed", r.followed},
                       {"wrong", r.wrong.empty() ? Json() : Json(r.wrong)},
                       {"shortest_theory", r.shortest_theory},
                       {"shortest", r.shortest},
                       {"damps_theory", r.damps_theory},
                       {"damps", r.damps},
                       {"longest", r.longest},
                       {"warned", r.warned},
                       {"silent", r.silent},
                       {"runs", r.runs}});
}

void write_file(const Options& options, const Provenance& provenance, const std::vector<LimitRow>& rows,
                const std::string& parameter) {
  ResultFile file(PETSC_COMM_WORLD, options.text("out_file"), provenance);
  file.attribute("chart_kind", "limits");
  file.attribute("parameter", parameter);
  std::vector<double> number;
  for (const LimitRow& r : rows) (void)r, number.push_back(double(number.size()));
  file.scale({"row", "1", "number of the row"}, number);
  const auto texts = [&](const Field& field, std::string LimitRow::*member) {
    std::vector<std::string> values;
    for (const LimitRow& r : rows) values.push_back(r.*member);
    file.add_text(field, {"row"}, values);
  };
  const auto numbers = [&](const Field& field, const auto& value) {
    std::vector<double> values;
    for (const LimitRow& r : rows) values.push_back(value(r));
    file.add(field, {"row"}, values);
  };
  texts({"method", "1", "method"}, &LimitRow::method);
  texts({"implicit", "1", "what is implicit"}, &LimitRow::implicit);
  texts({"how", "1", "what happens beyond limit"}, &LimitRow::how);
  texts({"wrong", "1", "what is wrong beyond followed"}, &LimitRow::wrong);
  numbers({"order", "1", "order in space"}, [](const LimitRow& r) { return double(r.order); });
  numbers({"n", "1", "nodes"}, [](const LimitRow& r) { return double(r.n); });
  numbers({"value", "1", parameter.empty() ? "nothing varies" : parameter}, [](const LimitRow& r) { return r.value; });
  const auto step = [&](const char* name, const char* what, std::optional<double> LimitRow::*member) {
    numbers({name, "time", what}, [&](const LimitRow& r) { return (r.*member).value_or(NAN); });
  };
  step("theory", "stability limit of the linearised operator", &LimitRow::theory);
  step("limit", "longest step of a run that ends within bounds", &LimitRow::limit);
  step("followed", "longest step with the true regime, amplitude and speed", &LimitRow::followed);
  step("shortest_theory", "step from which the shortest wave should grow falsely", &LimitRow::shortest_theory);
  step("shortest", "step from which it does", &LimitRow::shortest);
  step("damps_theory", "step from which sliding's perturbations should decay", &LimitRow::damps_theory);
  step("damps", "step from which they do", &LimitRow::damps);
  numbers({"longest", "time", "longest step tried"}, [](const LimitRow& r) { return r.longest; });
  numbers({"warned", "1", "1 where every failure was told"}, [](const LimitRow& r) { return double(r.warned); });
  file.write();
}

}  // namespace

int chart_limits(const Options& options) {
  const Provenance provenance = Provenance::of("chart", options.all());
  check_outputs(options.text("out_file"), options.text("summary"));
  Summary summary(provenance, {"rows", "best", "reference_error", "silent", "rows_taken_over"}, options.text("summary"));
  const std::vector<MethodChoice> choices = wanted_methods(options);
  const std::string parameter = options.text("chart_parameter");
  std::vector<double> values = options.reals("chart_values");
  if (parameter.empty() != values.empty())
    throw UsageError(parameter.empty() ? "-chart_values " + options.text("chart_values") + ": without chart_parameter"
                                       : "-chart_parameter " + parameter + ": needs chart_values, e.g. 3,30,300");
  const OptionSpec* spec = parameter.empty() ? nullptr : find_option(parameter);
  if (!parameter.empty() && (!spec || (spec->type != OptionType::real && spec->type != OptionType::integer)))
    throw UsageError("-chart_parameter " + quoted(parameter) +
                     ": no such option that takes a number; give one, such as model_gamma");
  if (values.empty()) values = {0};
  std::vector<PetscInt> orders = options.integers("chart_orders"), grids = options.integers("chart_grids");
  if (orders.empty()) orders = {options.integer("grid_order")};
  if (grids.empty()) grids = {options.integer("grid_n")};
  std::vector<Options> scenes;
  std::vector<double> scene_values;
  for (const double value : values)
    for (const PetscInt order : orders)
      for (const PetscInt n : grids) {
        Options o = spec ? options.with(spec->name, value) : options;
        o = o.with("grid_n", std::to_string(n));
        if (o.text("model_form") != "chain") o = o.with("grid_order", std::to_string(order));
        (void)Scene::from(o, false);
        scenes.push_back(o);
        scene_values.push_back(value);
      }
  check_unused_after_setup(options, "ts snes ksp pc");
  return with_summary(summary, [&] {
    std::vector<LimitRow> rows;
    Progress progress(options, "limits: ");
    const std::size_t all = scenes.size() * choices.size();
    int silent = 0;
    Json list = Json::array();
    ChartLog log(options, provenance);
    std::map<std::string, Texts> known;
    for (const Texts& line : log.lines()) known[line.at("row")] = line;
    summary.set("rows_taken_over", known.size());
    std::size_t done_now = 0;
    for (std::size_t k = 0; k < scenes.size(); ++k) {
      std::optional<Limits> limits;
      for (const MethodChoice& choice : choices) {
        if (progress.due())
          progress.show("row " + std::to_string(rows.size() + 1) + " of " + std::to_string(all) +
                        progress.left(double(done_now) / double(all - known.size())) + " (" + choice.name() +
                        (choice.splits() ? ":" + choice.implicit : "") + ")");
        const std::string key = key_of(k, choice);
        if (const auto it = known.find(key); it != known.end()) {
          rows.push_back(row_of(it->second));
        } else {
          if (!limits) limits.emplace(scenes[k]);
          rows.push_back(limits->row(choice));
          rows.back().value = scene_values[k];
          log.add(texts_of(key, rows.back()));
          ++done_now;
        }
        silent += rows.back().warned ? 0 : 1;
        list.push(json_of(rows.back(), spec != nullptr));
        summary.set("rows", list);
      }
    }
    summary.set("silent", silent);
    for (const LimitRow& r : rows)
      if (!r.warned)
        warn(r.method + " (" + r.implicit + " implicit) went wrong at ts_dt " + number_text(r.silent.front()) +
             " (" + r.wrong + ") without a word");
    write_file(options, provenance, rows, spec ? spec->name : "");
    log.remove();
    if (options.text("summary") != "-") {
      const char* format = spec ? "%-6s %-16s %-9s %5s %6s %9s %9s %9s %9s %-22s %9s %-36s %9s %9s\n"
                                : "%s%-16s %-9s %5s %6s %9s %9s %9s %9s %-22s %9s %-36s %9s %9s\n";
      SS_TRY(PetscPrintf(PETSC_COMM_WORLD, format, spec ? "value" : "", "method", "implicit", "order", "n", "shortest:",
                         "theory", "limit:", "theory", "beyond", "followed", "beyond", "damps:", "theory"));
      const auto shown = [](const std::optional<double>& x) { return x ? rounded(*x) : std::string("-"); };
      for (const LimitRow& r : rows)
        SS_TRY(PetscPrintf(PETSC_COMM_WORLD, format, spec ? rounded(r.value).c_str() : "", r.method.c_str(),
                           r.implicit.c_str(), std::to_string(r.order).c_str(), std::to_string(r.n).c_str(),
                           shown(r.shortest).c_str(), shown(r.shortest_theory).c_str(), shown(r.limit).c_str(),
                           shown(r.theory).c_str(),
                           r.how.c_str(), shown(r.followed).c_str(), r.wrong.c_str(), shown(r.damps).c_str(),
                           shown(r.damps_theory).c_str()));
    }
    return 0;
  });
}

}  // namespace stickslip
