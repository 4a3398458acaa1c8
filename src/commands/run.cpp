// The command `run`: advances a scene in time and writes frames, probes, series, checkpoints and the summary.
#include <cmath>
#include <map>

#include "base/progress.hpp"
#include "commands/quantities.hpp"
#include "commands/run_session.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/commands/commands.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/study/accuracy.hpp"

namespace stickslip {

namespace {

// The options to run with: those of the checkpoint where there is a restart.
Options effective_options(const Options& options) {
  if (!options.is_set("restart")) return options;
  const Checkpoint checkpoint = read_checkpoint(options.text("restart"));
  if (checkpoint.header.git != git_revision())
    warn("restart '" + options.text("restart") + "': was written by revision " + checkpoint.header.git +
         " of this program, and this is " + git_revision() + "; the last digits may differ");
  std::map<std::string, std::string> given;
  for (const auto& [name, text] : checkpoint.texts)
    if (name.rfind("given.", 0) == 0) given[name.substr(6)] = text;
  Options resumed = options.resumed_from(given);
  insert_library_options(resumed);
  return resumed;
}

// A run for -accuracy: chosen, run, its error estimated; again with stricter settings where that was too large.
int run_to_accuracy(const Options& options, Summary& summary) {
  const double wanted = options.real("accuracy");
  AccuracyPlan plan(options, wanted);
  double runs_before = 0;  // of attempts that were not good enough
  for (int attempt = 1;; ++attempt) {
    const Options chosen = plan.options();
    insert_library_options(chosen);
    Progress(chosen.text("progress"), "").tell("accuracy: " + plan.what() + "; choosing took " +
                                number_text(std::round(1e5 * (plan.seconds() + runs_before)) / 1e5) + " s");
    const double begin = largest_processor_seconds();
    Run run(chosen, Provenance::of("run", chosen.all()));
    const int code = run.advance(summary);
    const double seconds = largest_processor_seconds() - begin;
    const bool ended = code == 0 && summary.get("stopped_at").is_null();
    const double estimate = ended ? plan.estimate(run.end()) : NAN;
    summary.set("accuracy", Json::object({{"wanted", wanted},
                                          {"chosen", plan.what()},
                                          {"method", plan.setting().method.name()},
                                          {"tolerance", plan.setting().tolerance},
                                          {"order", plan.setting().order},
                                          {"n", plan.setting().n},
                                          {"trials", plan.trials()},
                                          {"attempts", attempt},
                                          {"choosing_seconds", plan.seconds() + runs_before},
                                          {"step_seconds", run.step_seconds()},
                                          {"run_seconds", seconds}}));
    if (!ended) return code;
    summary.set("error_estimate", estimate);
    if (!plan.refusal().empty())
      throw Failure(plan.refusal() + "; best reached " + rounded_text(estimate, 2));
    if (estimate <= wanted) return 0;
    if (attempt == 5)
      throw Failure("accuracy " + options.text("accuracy") + " was not reached: the error is about " +
                    number_text(estimate) + " with " + plan.what());
    plan.refine();
    runs_before += run.step_seconds();
  }
}

}  // namespace

int run_command(const Options& asked) {
  const Options options = effective_options(asked);
  const Provenance provenance = Provenance::of("run", options.all());
  check_outputs(options.text("out_file"), options.text("summary"));
  std::vector<std::string> keys = {"t_end", "steps", "rejections", "rhs_evaluations", "method", "implicit", "unknowns",
                                   "reduced"};
  for (const std::string& key : quantity_keys()) keys.push_back(key);
  for (const char* key : {"probes", "regime", "regime_rate", "growth_rate", "growth_rate_reason", "time_to_decide",
                          "amplitude", "wave_speed", "pulses", "measured_over", "stopped_at", "error_estimate", "events",
                          "events_per_s", "accuracy"})
    keys.push_back(key);
  Summary summary(provenance, keys, options.text("summary"));
  return with_summary(summary, [&] {
    if (options.is_set("accuracy") && !options.is_set("restart")) return run_to_accuracy(options, summary);
    Run run(options, provenance);
    return run.advance(summary);
  });
}

}  // namespace stickslip
