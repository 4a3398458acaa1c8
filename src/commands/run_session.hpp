// A run under way: the scene's start, the method that advances it, and the observers that watch it.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "base/pulse.hpp"
#include "commands/command.hpp"
#include "output/catalogue.hpp"
#include "output/measures.hpp"
#include "output/table.hpp"
#include "stickslip/base/provenance.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/checkpoint.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/regime.hpp"
#include "stickslip/output/run_file.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/study/trial.hpp"
#include "stickslip/time/time.hpp"
#include "study/lyapunov.hpp"
#include "study/simulate.hpp"
#include "study/step_audit.hpp"

namespace stickslip {

// How far a run came and what it took.
struct RunWork {
  TimeReport report;
  std::int64_t rejections;
  long rhs_evaluations;
  PetscInt unknowns;
  std::string reduced;
  std::optional<std::int64_t> clusters = {}, node_steps = {};  // with stick_clusters
  std::string no_clusters = {};                                // why not
  std::optional<double> plate_time = {};                       // with load_halt
};
// `ran`: not only checked.
Columns<RunWork> work_columns(bool ran = true);

class Run {
 public:
  // Sets everything up, in an order in which all that can be refused is refused before the first file is
  // touched. Goes on from the checkpoint that option `restart` names. options must outlive it.
  // Collective. `measure`, if given, makes one more observer, whose result end() holds.
  Run(const Options& options, const Provenance& provenance, const MeasureMaker& measure = nullptr);

  // Returns the exit code; the summary holds what is known, also when it throws. Collective.
  int advance(Summary& summary);

  // Says what the run would take, from steps of about a second, and writes no file. Nothing else may follow.
  // Collective.
  int check(Summary& summary);

  // Processor time of this rank for setting the method up and for its steps, as in a row of `chart`; 0
  // without -accuracy.
  double step_seconds() const { return step_seconds_; }
  Answer end() const;  // as far as it has come; collective

 private:
  // Where it begins.
  struct Origin {
    bool resumed = false;
    double t = 0, dt = 0;
    std::int64_t step = 0, rejections = 0;
    long evaluations = 0;
  };

  Run(const Options& options, const Provenance& provenance, const MeasureMaker& measure,
      std::optional<Checkpoint> checkpoint);
  double spent() const { return timed_ ? processor_seconds() : 0; }
  void make_observers(const MeasureMaker& measure, const std::optional<Checkpoint>& checkpoint);
  void make_displacement(const std::optional<Checkpoint>& checkpoint);
  // What a checkpoint holds: the state and how far the run has come (`at`, but for what every checkpoint
  // has). Not what -accuracy measures, which a restart does not.
  void archive(Archive a, Origin& at, Vec state);
  void restore(const Checkpoint& checkpoint);
  void make_integrator(const std::optional<Checkpoint>& checkpoint);
  void limit_steps();
  bool limit_holds(Vec u) const;
  void follow_limit(Vec u);
  double delay_of_passages() const;
  ObservationPlan plan();
  void open_file();
  bool plate_ends_at(double t) const { return halts(scene_) && plate_.at(t) >= plate_.end; }
  Integrator::Verdict after(const Integrator::Step& step);
  void advance_whole(Progress& progress);
  // Where only what slides is advanced (run_clusters.cpp): whether it is; UsageError where it cannot be.
  void choose_clusters(const std::optional<Checkpoint>& checkpoint);
  std::string no_clusters() const;
  std::string no_gain_of_clusters() const;
  void set_up_clusters(const std::optional<Checkpoint>& checkpoint);
  ClusterPlan cluster_plan() const;
  void advance_clusters(Progress& progress);
  bool goes_on(std::int64_t steps, double t);
  const TimeReport& time_report() const { return clusters_ ? clusters_->report : integrator_->report(); }
  void write_checkpoint_at(std::int64_t step, double t, double next_dt, Vec u);
  std::int64_t rejections() const;
  long rhs_evaluations() const;
  RunWork work() const;
  int ending(Summary& summary) const;
  void report(Summary& summary, bool complete);
  void warn_of_answer(const std::optional<StepAudit::Verdict>& verdict, double duration);

  const Options& options_;
  const Provenance provenance_;
  Scene scene_;      // the whole
  Problem problem_;  // what is solved for it
  Plate plate_;
  std::unique_ptr<Displacement> displacement_;  // with out_displacement
  bool counts_displacement_ = false;            // not by forces
  std::vector<std::unique_ptr<Observer>> observers_;
  Regime* regime_ = nullptr;                // one of them
  Period* period_ = nullptr;                // another, with out_probes
  Maxima* maxima_ = nullptr;                // another, with out_maxima
  LyapunovExponents* exponents_ = nullptr;  // another, with lyapunov_count
  const Measure* measure_ = nullptr;        // another, or none
  Origin origin_;
  std::optional<RunControl> control_;
  std::unique_ptr<Integrator> integrator_;
  std::unique_ptr<ClusterRun> clusters_;  // with stick_clusters, which takes the steps then
  std::string no_clusters_;               // why not, where friction sticks
  StepAudit::Verdict sound_;              // of steps that answer for themselves, with clusters
  Catalogue* catalogue_ = nullptr;        // one of the observers, with out_events
  std::unique_ptr<StepAudit> step_audit_;
  std::unique_ptr<RunFile> file_;
  // with -accuracy: reading the clock is a call of the system, which short steps would feel
  bool timed_;
  double step_seconds_ = 0;
  // StepAudit::longest_near_sliding at the start; and the longest elsewhere, 0 where no limit is set
  double longest_step_ = std::numeric_limits<double>::infinity(), longest_anywhere_ = 0;
  std::string last_checkpoint_;
};

}  // namespace stickslip
