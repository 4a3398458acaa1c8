// What a run says of itself at its end (Run of run_session.hpp).
#include <fmt/format.h>

#include <cmath>
#include <csignal>

#include "base/broadcast.hpp"
#include "base/paths.hpp"
#include "commands/run_session.hpp"
#include "output/carried_frame.hpp"
#include "output/series.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/study/step_audit.hpp"

namespace stickslip {

// Why it ended, and the exit code.
int Run::ending(Summary& summary) const {
  const std::string checkpoint = last_checkpoint_.empty() ? "" : "; checkpoint " + last_checkpoint_;
  const int signal = control_->signal();
  const std::string limit = signal                                   ? ""
                            : control_->wall_is_over()               ? "ts_max_wall"
                            : time_report().reason == "ts_max_steps" ? "ts_max_steps"
                                                                     : "";
  if (!signal && limit.empty()) return 0;
  const std::string why =
      signal ? signal == SIGINT ? "SIGINT" : "SIGTERM" : limit + " " + options_.text(limit);
  summary.stopped(why + checkpoint);
  if (!signal) summary.set("stopped_at", why);
  const bool at_origin = origin_.resumed && time_report().t == origin_.t;
  const std::string from =
      last_checkpoint_.empty() && at_origin ? options_.text("restart") : last_checkpoint_;
  // The checkpoint holds the limit that has been reached; a clock begins anew.
  const std::string lifted = limit == "ts_max_steps" ? " -ts_max_steps unlimited" : "";
  summary.say(fmt::format("stopped at t = {:.6g} by {}; {}", time_report().t, why,
                          !from.empty() ? "to go on: stickslip run -restart " + shell_word(from) + lifted
                          : file_ ? "there is no checkpoint to go on from (-out_checkpoint_every)"
                                  : "without -out_file there is no checkpoint to go on from"));
  return signal ? 128 + signal : 0;
}

Columns<RunWork> work_columns(bool ran) {
  using W = const RunWork&;
  const Columns<RunWork> of_run = {
      {"t_end", "time", "where the run ended", [](W w) { return w.report.t; }},
      {"steps", "1", "steps accepted", [](W w) { return w.report.steps; }},
      {"plate_time", "time", "with `load_halt`: what the plate's clock shows then", &RunWork::plate_time},
      {"rejections", "1", "steps taken back for their error", &RunWork::rejections},
      {"rhs_evaluations", "1", "evaluations of the right-hand side, or of a part of it where steps are split",
       &RunWork::rhs_evaluations},
      {"clusters", "1",
       "where only what slides is advanced: most clusters at once, whose steps are counted then",
       &RunWork::clusters},
      {"clusters_reason", "",
       "where friction sticks exactly: null, or why each step is one of the whole medium",
       [](W w) { return w.no_clusters.empty() ? Json() : Json(w.no_clusters); }},
      {"node_steps", "1", "then: steps, each times the nodes of its cluster", &RunWork::node_steps}};
  return (ran ? of_run : Columns<RunWork>()) +
         Columns<RunWork>{
             {"method", "", "type and tableau, `rk:5dp`", [](W w) { return w.report.method; }},
             {"implicit", "", "what is solved for: `none`, `friction`, `wave`, `both`",
              [](W w) { return to_string(w.report.implicit); }},
             {"unknowns", "1", "numbers advanced in time", &RunWork::unknowns},
             {"reduced", "", "null, or the smaller problem that was solved for the scene, and why",
              &RunWork::reduced}};
}

RunWork Run::work() const {
  const TimeReport& r = time_report();
  RunWork work{r, rejections(), rhs_evaluations(), problem_.model.unknowns(), problem_.what};
  work.no_clusters = no_clusters_;
  if (halts(scene_)) work.plate_time = plate_.at(r.t);
  if (clusters_) {
    work.clusters = clusters_->most_at_once();
    work.node_steps = clusters_->node_steps();
  }
  return work;
}

void Run::report(Summary& summary, bool complete) {
  const TimeReport& r = time_report();
  set_keys(summary, work_columns(), work());
  if (file_ && file_->frames() > 0) summary.wrote(options_.text("out_file"));
  summary.wrote(last_checkpoint_);
  if (options_.is_set("snes_mf") && rejections() > std::int64_t(r.steps) / 4)
    warn(
        fmt::format("-snes_mf: {} steps were taken back beside {} accepted: without a matrix there is no "
                    "preconditioner, and GMRES does not come to the end of Newton's linear equations; "
                    "-snes_fd takes differences, too, and solves directly",
                    rejections(), r.steps));
  if (complete) {
    problem_.model.set_time(r.t);
    problem_.model.set_held(problem_.u);
    if (CarriedFrame* next = CarriedFrame::innermost()) next->keep(problem_.model, scene_, problem_.u, r.t);
    std::optional<StepAudit::Verdict> verdict;  // of every step
    if (!clusters_) verdict = step_audit_->verdict(problem_.u);
    const NearestGrowth near = nearest_growth(problem_.model, verdict ? *verdict : sound_, rhs_evaluations());
    regime_->know(near.growth, near.taken, near.why_not, near.beyond);
    for (const auto& observer : observers_) observer->summarise(summary, problem_.u);
    warn_of_answer(verdict, r.t);
  } else {
    for (const auto& observer : observers_) observer->summarise(summary, nullptr);
  }
}

// What in the answer cannot be believed.
void Run::warn_of_answer(const std::optional<StepAudit::Verdict>& verdict, double duration) {
  const Measured& m = regime_->result(problem_.u);
  if (!problem_.what.empty()) {
    const double psi_mean = statistics(problem_.model, problem_.u).psi_mean;
    std::string broken;
    if (rank_in(PETSC_COMM_WORLD) == 0)
      broken = broken_symmetry(scene_, problem_.model.scene(), m, psi_mean, duration);
    broadcast(broken);
    if (!broken.empty()) warn(broken);
  }
  if (verdict) step_audit_->warn_of(*verdict, m.motion);
  // A front of four or more nodes changes by at most a third of its height from node to node.
  if (scene_.form == Form::continuum && m.steepest > 0.34)
    warn("a front is not resolved: psi changes by " + std::to_string(std::lround(100 * m.steepest)) +
         " % of its range between two neighbouring nodes; wave speeds and heights depend on the grid (raise "
         "grid_n)");
}

}  // namespace stickslip
