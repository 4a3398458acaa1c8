#include "stickslip/study/trial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <set>
#include <tuple>
#include <utility>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/output/run_file.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/study/start.hpp"
#include "study/simulate.hpp"
#include "study/step_forecast.hpp"

namespace stickslip {

std::int64_t most_steps(const Options& options) {
  return options.is_set("ts_max_steps") ? static_cast<std::int64_t>(options.real("ts_max_steps"))
                                        : std::numeric_limits<std::int64_t>::max();
}

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

double largest_processor_seconds() { return largest_over(PETSC_COMM_WORLD, processor_seconds()); }

Options options_for(const Options& options, const Setting& setting) {
  Options result = options.with("grid_n", std::to_string(setting.n));
  if (options.text("model_form") != "chain")
    result = result.with("grid_order", std::to_string(setting.order));
  if (setting.eps > 0)
    result = result.with("friction_stick", "regularised").with("friction_eps", number_text(setting.eps));
  return result;
}

Scene on_grid(Scene scene, PetscInt n, int order) {
  scene.n = n;
  scene.order = order;
  return scene;
}

// How a run of the setting is to be advanced.
MethodSpec spec_of(const Options& options, const Setting& setting) {
  MethodSpec spec = setting.method;
  // the user's own imex_implicit is for methods that split and say nothing themselves
  if (spec.can().splits && spec.implicit == "auto") spec.implicit = options.text("imex_implicit");
  if (spec.can().has_estimate)
    spec.tolerance = setting.tolerance;
  else
    spec.step = setting.step;
  spec.fused = options.boolean("rk_fused");
  return spec;
}

void check_settings(const Options& options, const std::vector<Setting>& settings) {
  std::set<std::tuple<std::string, std::string, double>> methods_seen;
  std::set<std::pair<PetscInt, int>> grids_seen;
  for (const Setting& s : settings) {
    const bool new_grid = grids_seen.emplace(s.n, s.order).second;
    const bool new_method = methods_seen.emplace(s.method.name(), s.method.implicit, s.eps).second;
    if (!new_grid && !new_method) continue;
    const Options here = options_for(options, s);
    std::vector<std::string> unheard;
    std::optional<WarningsKept> kept;
    if (!new_grid) kept.emplace(unheard);
    const Model model(PETSC_COMM_WORLD, Scene::from(here, false));
    VecHandle u = model.create_vector();
    set_start(model, here, u);
    if (!kept) kept.emplace(unheard);
    const Integrator integrator(model, spec_of(here, s), u);
  }
}

Trial run_trial(const Options& asked, const Setting& setting, const std::string& prefix, double limit,
                const MeasureMaker& measure) {
  const Options options = options_for(asked, setting);
  Trial trial;
  const Scene whole = Scene::from(options, false);
  const Problem problem = [&] {
    const WarningsKept kept(trial.warnings);
    return problem_of(whole, options, std::nullopt);
  }();
  const Model& model = problem.model;
  const double t_end = options.real("ts_max_time");
  const std::int64_t allowed =
      prefix.empty() ? most_steps(options) : std::numeric_limits<std::int64_t>::max();
  std::unique_ptr<Measure> measured;
  ObservationPlan plan;
  const double begin = processor_seconds();
  Experiment run{model, spec_of(options, setting), prefix, {0, t_end, allowed}};
  run.watch = [&](Integrator& integrator) {
    std::vector<Observer*> observers;
    if (measure) {
      measured = measure(model, whole);
      measured->plan(plan);
      integrator.set_output_times([&plan](double t) { return plan.next_time(t); });
      observers = {measured.get()};
    }
    warn_of_steps(model, integrator, problem.u, t_end);
    return observers;
  };
  run.goes_on = [&](const Integrator::Step& step, Outcome& outcome) {
    if (step.index + outcome.report.rejections >= setting.most_attempts)
      outcome.fail(Fault::too_many_steps, fmt::format("stopped after {} steps", step.index));
    if (step.index % 8 != 0 || step.index == 0 || !outcome.is_answer()) return outcome.is_answer();
    const double now = largest_over(PETSC_COMM_WORLD, processor_seconds() - begin);
    // no need to wait for the end of what cannot get there
    const bool hopeless = now > 0.25 * limit && now * t_end > 4 * limit * step.t;
    if (now > limit || hopeless)
      outcome.fail(Fault::too_slow, "stopped: it would take more than " + number_text(limit) + " s");
    return outcome.is_answer();
  };
  run.at_end = [&](const Integrator&) {
    if (measured) trial.measured = measured->values();
  };
  carry_out(run, problem.u, trial);
  if (trial.is_answer() && trial.report.t < t_end)
    trial.fail(Fault::too_many_steps,
               "stopped at ts_max_steps " + options.text("ts_max_steps") + ", before ts_max_time");
  if (!trial.is_answer()) return trial;

  model.set_held(problem.u);
  trial.end = fields_of(model, problem.u, whole.n);
  return trial;
}

Fields fields_with_friction(const Scene& scene, std::vector<double> psi, std::vector<double> eta,
                            std::vector<double> state) {
  Fields fields{std::move(psi), std::move(eta), {}, {}};
  if (scene.nodes_alike() || scene.form == Form::chain) return fields;
  const FrictionAt friction(scene, positions(scene, 0, scene.n));
  for (std::size_t i = 0; i < fields.psi.size(); ++i)
    fields.friction.push_back(friction.force(i, fields.psi[i], state.empty() ? 0 : state[i]));
  fields.state = std::move(state);
  return fields;
}

Fields fields_of(const Model& model, Vec u, PetscInt n) {
  Gather gather(u, model.dof());
  std::vector<std::vector<double>> whole(model.dof());
  const auto& components = gather.components(u);
  for (std::size_t c = 0; c < whole.size(); ++c) {
    if (!components.empty() && !components[c].empty())
      for (PetscInt i = 0; i < n; ++i) whole[c].push_back(components[c][i % model.scene().n]);
    broadcast(whole[c]);
  }
  return fields_with_friction(model.scene(), whole[0], whole[1],
                              whole.size() > 2 ? whole[2] : std::vector<double>());
}

bool has_grid_limit(const Options& options, const Scene& scene) {
  const bool noise_of_nodes = options.real("init_noise") != 0 && options.real("init_noise_length") == 0;
  return scene.form == Form::continuum && !noise_of_nodes && options.text("init_type") != "file" &&
         options.text("init_type") != "text";
}

std::vector<int> possible_orders(const Scene& scene) {
  if (scene.form == Form::chain || scene.medium.links_differ()) return {2};
  if (scene.left == End::velocity || scene.right == End::velocity) return {2, 4, 6};
  return {2, 4, 6, 8};
}

Point combined(const Fields& fields, const Combination& row, const FrictionAt& here, std::size_t place) {
  const bool between = !fields.friction.empty() && row.size() > 1;
  Point sum{0, 0};
  for (const auto& [index, weight] : row) {
    const double state = fields.state.empty() ? 0 : fields.state[index];
    const double excess = between ? here.force(place, fields.psi[index], state) - fields.friction[index] : 0;
    sum.psi += weight * fields.psi[index];
    sum.eta += weight * (fields.eta[index] + excess);
  }
  return sum;
}

Fields at_points(const Fields& fields, const Scene& scene, const std::vector<double>& x) {
  const FrictionAt friction = fields.friction.empty() ? FrictionAt() : FrictionAt(scene, x);
  const NodesAround around(scene);
  Fields result;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Point point = combined(fields, around.at(x[i]), friction, i);
    result.psi.push_back(point.psi);
    result.eta.push_back(point.eta);
  }
  return result;
}

Fields resample(const Fields& fields, const Scene& from, const Scene& to) {
  if (from.n == to.n) return fields;
  return at_points(fields, from, positions(to, 0, to.n));
}

double distance(const Fields& a, const Fields& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.psi.size(); ++i)
    largest = std::max({largest, std::abs(a.psi[i] - b.psi[i]), std::abs(a.eta[i] - b.eta[i])});
  return largest;
}

}  // namespace stickslip
