// The command `run`: advances a scene in time and writes frames, probes, series, checkpoints and the summary.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <memory>
#include <set>

#include "progress.hpp"
#include "ranges.hpp"
#include "share.hpp"
#include "stickslip/accuracy.hpp"
#include "stickslip/checkpoint.hpp"
#include "stickslip/commands.hpp"
#include "stickslip/displacement.hpp"
#include "stickslip/error.hpp"
#include "stickslip/events.hpp"
#include "stickslip/file.hpp"
#include "stickslip/library_options.hpp"
#include "stickslip/measure.hpp"
#include "stickslip/probe.hpp"
#include "stickslip/reduce.hpp"
#include "stickslip/root.hpp"
#include "stickslip/start.hpp"
#include "stickslip/stick.hpp"
#include "stickslip/summary.hpp"
#include "stickslip/time.hpp"
#include "stickslip/trust.hpp"

namespace stickslip {

namespace {

volatile std::sig_atomic_t caught_signal = 0;
volatile std::sig_atomic_t checkpoint_wanted = 0;

extern "C" void on_signal(int number) {
  if (number == SIGUSR1) checkpoint_wanted = 1;
  else caught_signal = number;
}

// While it lives, SIGINT and SIGTERM ask for a checkpoint and an end, SIGUSR1 for a checkpoint.
class SignalWatch {
 public:
  SignalWatch() {
    caught_signal = checkpoint_wanted = 0;
    struct sigaction action {};
    action.sa_handler = on_signal;
    sigemptyset(&action.sa_mask);
    action.sa_flags = SA_RESTART;
    for (std::size_t i = 0; i < numbers.size(); ++i) sigaction(numbers[i], &action, &before_[i]);
  }
  ~SignalWatch() {
    for (std::size_t i = 0; i < numbers.size(); ++i) sigaction(numbers[i], &before_[i], nullptr);
  }
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

 private:
  static constexpr std::array<int, 3> numbers{SIGINT, SIGTERM, SIGUSR1};
  std::array<struct sigaction, 3> before_{};
};

// Whether rank 0 sees this file. Collective.
bool exists(const std::string& path) {
  int there = access(path.c_str(), F_OK) == 0 ? 1 : 0;
  SS_TRY(MPI_Bcast(&there, 1, MPI_INT, 0, PETSC_COMM_WORLD));
  return there != 0;
}

// When frames are written, those up to and including `after` left out.
std::vector<double> frame_times(const Options& options, double t_end, double after) {
  std::vector<double> times;
  if (options.is_set("out_times")) {
    times = options.reals("out_times");
    for (const double t : times)
      if (t < 0 || t > t_end)
        throw UsageError("out_times " + options.text("out_times") + ": " + number_text(t) +
                         " lies outside 0 to ts_max_time " + number_text(t_end));
  } else if (options.is_set("out_every")) {
    const double every = options.real("out_every");
    for (PetscInt i = 0; double(i) * every <= t_end * (1 + 1e-12); ++i)
      times.push_back(std::min(double(i) * every, t_end));
  } else {
    const PetscInt frames = options.integer("out_frames");
    for (PetscInt i = 0; i < frames; ++i)
      times.push_back(i == frames - 1 ? t_end : t_end * double(i) / double(frames - 1));
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  times.erase(std::remove_if(times.begin(), times.end(), [&](double t) { return t <= after || t > t_end; }),
              times.end());
  return times;
}

// Minimum, maximum and means over all nodes.
struct FieldStatistics {
  double psi_min, psi_max, psi_mean, eta_mean;
};

FieldStatistics statistics(const Model& model, Vec u) {
  const double* a;
  SS_TRY(VecGetArrayRead(u, &a));
  const int dof = model.dof();
  double extremes[2] = {-1e300, -1e300}, sums[2] = {0, 0};  // of -psi and psi; of psi and eta
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double psi = a[i * dof];
    extremes[0] = std::max(extremes[0], -psi);
    extremes[1] = std::max(extremes[1], psi);
    sums[0] += psi;
    sums[1] += a[i * dof + 1];
  }
  SS_TRY(VecRestoreArrayRead(u, &a));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, extremes, 2, MPI_DOUBLE, MPI_MAX, model.comm()));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, sums, 2, MPI_DOUBLE, MPI_SUM, model.comm()));
  const auto n = double(model.scene().n);
  return {-extremes[0], extremes[1], sums[0] / n, sums[1] / n};
}

const std::vector<Field> series_fields = {{"psi_mean", "length/time", "mean of psi over the nodes"},
                                          {"psi_min", "length/time", "least psi"},
                                          {"psi_max", "length/time", "largest psi"},
                                          {"eta_mean", "1", "mean of eta over the nodes"},
                                          {"dt", "time", "step taken"},
                                          {"step", "1", "steps so far"},
                                          {"rejections", "1", "rejected steps so far"}};

// With out_displacement; see displacement.hpp.
const std::vector<Field> energy_fields = {
    {"energy_kinetic", "amplitude*length", "kinetic energy in units of the friction amplitude"},
    {"energy_elastic", "amplitude*length", "elastic energy"},
    {"power_input", "amplitude*length/time", "power of the driving plate"},
    {"power_friction", "amplitude*length/time", "power lost in friction"},
    {"power_viscous", "amplitude*length/time", "power lost in damping"}};

// A run under way. The order of members is the order of set-up: everything that can be refused is refused before the
// first file is touched.
class Run {
 public:
  Run(const Options& options, const Provenance& provenance)
      : options_(options), provenance_(provenance), scene_(Scene::from(options, false)),
        checkpoint_(asked_for(options)), problem_(problem_of(scene_, events_need_all(options), nodes_of(checkpoint_))),
        model_(problem_.model), u_(problem_.u),
        t_end_(options.real("ts_max_time")), work_(model_.create_vector()), gather_(u_, model_.dof()),
        probes_(model_, scene_, options.reals("out_probes")), measurement_(model_.scene(), t_end_),
        ranges_(model_, t_end_), events_(events_of(options, scene_)),
        checkpoint_every_(options.steps_or_seconds("out_checkpoint_every")),
        most_seconds_(options.steps_or_seconds("ts_max_wall").seconds) {
    MPI_Comm_rank(PETSC_COMM_WORLD, &rank_);
    // Every rank solves alike, and one of them prints for -ts_monitor.
    if (model_.comm() == PETSC_COMM_SELF && rank_ != 0) PETSC_STDOUT = std::fopen("/dev/null", "w");
    if (checkpoint_) restore(*checkpoint_);
    checkpoint_.reset();
    const double begin = processor_seconds();
    make_integrator();
    step_seconds_ = processor_seconds() - begin;
    plan_output();
  }

  const Scene& scene() const { return scene_; }
  // Processor time of this rank for setting the method up and for its steps, as in a row of `chart`.
  double step_seconds() const { return step_seconds_; }
  Fields end() const { return fields_of(model_, u_, scene_.n); }  // as far as it has come

  // Returns the exit code; the summary holds what is known, also when it throws.
  int advance(Summary& summary) {
    SignalWatch watch;
    Progress progress(options_, "");
    progress_ = &progress;
    first_t_ = t_;
    if (!problem_.what.empty()) progress.tell("scene_reduce: " + problem_.what);
    if (options_.is_set("ts_max_steps")) most_steps_ = options_.integer("ts_max_steps");
    last_checkpoint_wall_ = MPI_Wtime();
    trust_ = std::make_unique<Trust>(model_, options_, *integrator_, t_, t_end_);
    try {
      const double begin = processor_seconds();
      double watching = 0;
      integrator_->advance(u_, t_, t_end_, [&](const Integrator::Step& step) {
        const double now = processor_seconds();
        const Integrator::Verdict verdict = after(step);
        watching += processor_seconds() - now;
        return verdict;
      }, most_steps_);
      step_seconds_ += processor_seconds() - begin - watching;
    } catch (const RankFailure&) {
      throw;  // the others may not know of it, and closing the file takes all; it can be read as it is
    } catch (...) {
      if (file_) file_->close();
      report(summary, false);
      throw;
    }
    if (file_) file_->close();
    report(summary, true);
    if (stopped_by_ != 0) {
      summary.stopped(std::string(stopped_by_ == SIGINT ? "SIGINT" : "SIGTERM") +
                      (last_checkpoint_.empty() ? "" : "; checkpoint " + last_checkpoint_));
      return 128 + stopped_by_;
    }
    const std::string limit = wall_is_over_                                        ? "ts_max_wall"
                              : integrator_->report().reason == "ts_max_steps" ? "ts_max_steps"
                                                                                   : "";
    if (!limit.empty()) {
      summary.set("stopped_at", limit + " " + options_.text(limit));
      summary.set("reason", limit + " " + options_.text(limit) +
                                (last_checkpoint_.empty() ? "" : "; checkpoint " + last_checkpoint_));
    }
    return 0;
  }

 private:
  // A catalogue is that of all nodes.
  static Options events_need_all(const Options& options) {
    return options.boolean("out_events") ? options.with("scene_reduce", "off") : options;
  }

  static std::unique_ptr<Events> events_of(const Options& options, const Scene& scene) {
    if (!options.boolean("out_events")) return nullptr;
    double velocity = Stick::applies_to(scene) ? 0 : 2 * std::abs(scene.v);
    if (options.is_set("out_events_velocity")) velocity = options.real("out_events_velocity");
    else if (velocity == 0 && !Stick::applies_to(scene))
      throw UsageError("out_events: with model_v 0 it needs out_events_velocity, above which a node moves");
    return std::make_unique<Events>(scene, velocity);
  }

  void make_integrator() {
    integrator_ = std::make_unique<Integrator>(model_, options_, u_);
    if (resumed_) integrator_->continue_from(first_step_, first_dt_);
    const bool is_explicit = integrator_->report().implicit == Implicit::none;
    check_unused_after_setup(options_, is_explicit ? "snes ksp pc" : "");
    if (resumed_ || options_.is_set("out_checkpoint_every")) warn_of_memory();
  }

  // What PETSc's solvers keep from one step to the next is not in a checkpoint; what the methods keep they forget
  // there.
  void warn_of_memory() const {
    for (const auto& [name, text] : options_.library()) {
      static const std::set<std::string> always = {
          "snes_lag_jacobian_persists", "snes_lag_preconditioner_persists", "ksp_initial_guess_nonzero",
          "ksp_guess_type", "ksp_reuse_preconditioner"};
      const bool lags = (name == "snes_lag_jacobian" || name == "snes_lag_preconditioner") && text[0] == '-';
      const bool solver = name == "snes_type" && text != "newtonls" && text != "newtontr" && text != "ksponly";
      if (always.count(name) || lags || solver)
        warn("-" + name + (text.empty() ? "" : " " + text) +
             " keeps what the solver learnt in earlier steps, which is in no checkpoint: a continued run agrees with "
             "an uninterrupted one to the solver's tolerances, not to the last bit");
    }
  }

  void plan_output() {
    const double after = resumed_ ? t_ : -1;
    if (options_.is_set("out_file")) frames_ = frame_times(options_, t_end_, after);
    std::vector<double> samples;
    for (const double t : measurement_.times())
      if (t > after) samples.push_back(t);
    std::vector<double> all = frames_;
    all.insert(all.end(), samples.begin(), samples.end());
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    integrator_->set_output_times(all);
    if (!frames_.empty() && !integrator_->interpolation_caveat().empty()) warn(integrator_->interpolation_caveat());
    samples_ = std::move(samples);
    if (!options_.is_set("out_file")) {
      if (checkpoint_every_.steps > 0 || checkpoint_every_.seconds > 0)
        warn("out_checkpoint_every without out_file: no checkpoints are written");
      return;
    }
    RunLayout layout = RunLayout::of(scene_);
    layout.probe_x = options_.reals("out_probes");
    if (options_.boolean("out_series")) layout.series = series_fields;
    if (events_) layout.events = Events::columns();
    if (!problem_.what.empty()) layout.texts["reduced"] = problem_.what;
    if (options_.boolean("out_displacement")) {
      displacement_ = std::make_unique<Displacement>(model_);
      chi_ = displacement_->create_vector();
      gather_chi_ = std::make_unique<Gather>(chi_, 1);
      layout.fields.push_back(standard_field("chi"));
      if (displacement_->has_energy() && !layout.series.empty())
        layout.series.insert(layout.series.end(), energy_fields.begin(), energy_fields.end());
    }
    layout.frames = static_cast<std::int64_t>(frames_.size());
    std::optional<RunFile::Resume> resume;
    if (resumed_ && exists(options_.text("out_file"))) resume = RunFile::Resume{options_.text("out_file"), t_};
    file_ = std::make_unique<RunFile>(PETSC_COMM_WORLD, options_.text("out_file"), provenance_, layout, resume);
  }

  static std::optional<Checkpoint> asked_for(const Options& options) {
    if (!options.is_set("restart")) return std::nullopt;
    return read_checkpoint(options.text("restart"));
  }
  // The grid that a checkpoint goes on with, whatever its start would now be reduced to.
  std::optional<PetscInt> nodes_of(const std::optional<Checkpoint>& checkpoint) const {
    if (!checkpoint) return std::nullopt;
    const auto nodes = checkpoint->numbers.find("nodes");
    if (nodes == checkpoint->numbers.end()) return scene_.n;
    if (!(nodes->second >= 1 && nodes->second <= scene_.n) || std::fmod(scene_.n, nodes->second) != 0)
      throw UsageError("restart '" + options_.text("restart") + "': is not a whole checkpoint: its nodes do not fit");
    return static_cast<PetscInt>(nodes->second);
  }

  void restore(Checkpoint& checkpoint) {
    on_root(PETSC_COMM_WORLD, [&] {
      try {
        if (checkpoint.state.size() != std::size_t(model_.dof()) * std::size_t(model_.scene().n))
          throw std::runtime_error("its state does not fit the scene");
        for (const char* name : {"rejections", "rhs_evaluations", "t_end"}) (void)checkpoint.numbers.at(name);
        if (checkpoint.numbers.at("t_end") == t_end_) measurement_.restore(checkpoint.arrays);
        if (events_ && checkpoint.arrays.count("events.last")) events_->restore(checkpoint.arrays);
      } catch (const std::exception& e) {
        throw UsageError("restart '" + options_.text("restart") + "': is not a whole checkpoint: " + e.what());
      }
    });
    t_ = checkpoint.t;
    first_step_ = static_cast<PetscInt>(checkpoint.step);
    first_dt_ = checkpoint.dt;
    if (t_ > t_end_)
      throw UsageError("ts_max_time " + options_.text("ts_max_time") + " lies before the time " + number_text(t_) +
                       " of checkpoint '" + options_.text("restart") + "'");
    if (t_ == t_end_)
      warn("restart '" + options_.text("restart") + "': this run is at its end already, ts_max_time " +
           options_.text("ts_max_time") + "; nothing is left to do");
    if (model_.comm() == PETSC_COMM_SELF) share(checkpoint.state);
    gather_.spread(checkpoint.state, u_);
    rejections_before_ = static_cast<PetscInt>(checkpoint.numbers.at("rejections"));
    evaluations_before_ = static_cast<long>(checkpoint.numbers.at("rhs_evaluations"));
    resumed_ = true;
  }

  Integrator::Verdict after(const Integrator::Step& step) {
    trust_->after(step);
    ranges_.after(step.t, step.u);
    if (events_) note_events(step);
    if (file_) write_rows(step);
    while (next_sample_ < samples_.size() && samples_[next_sample_] <= step.t) {
      step.interpolate(samples_[next_sample_], work_);
      const auto& fields = gather_.components(work_);
      if (rank_ == 0) measurement_.sample(samples_[next_sample_], fields[0]);
      ++next_sample_;
    }
    while (next_frame_ < frames_.size() && frames_[next_frame_] <= step.t) {
      step.interpolate(frames_[next_frame_], work_);
      write_frame(frames_[next_frame_]);
      ++next_frame_;
    }
    if (progress_->due()) {
      const double part = (step.t - first_t_) / (t_end_ - first_t_);
      char text[160];
      std::snprintf(text, sizeof text, "t = %.6g of %.6g (%.0f %%), step %lld, dt %.2g", step.t, t_end_, 100 * part,
                    static_cast<long long>(step.index), step.next_dt);
      progress_->show(text + progress_->left(part));
    }

    const double now = MPI_Wtime(), every = checkpoint_every_.seconds;
    int flags[4] = {caught_signal, checkpoint_wanted, every > 0 && now - last_checkpoint_wall_ >= every,
                    most_seconds_ > 0 && now - begin_ >= most_seconds_};
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, flags, 4, MPI_INT, MPI_MAX, PETSC_COMM_WORLD));
    stopped_by_ = flags[0];
    wall_is_over_ = flags[3] && step.t < t_end_ && !stopped_by_;
    const bool stop = stopped_by_ != 0 || wall_is_over_;
    const bool by_steps = checkpoint_every_.steps > 0 && step.index > 0 && step.index != first_step_ &&
                          step.index % checkpoint_every_.steps == 0;
    if (file_ && (step.t < t_end_ && (by_steps || stop || flags[1] || flags[2]))) {
      checkpoint(step);
      return stop ? Integrator::Verdict::stop : Integrator::Verdict::restart;
    }
    const bool last = step.t == t_end_ || step.index >= most_steps_;
    if (file_ && last && (checkpoint_every_.steps > 0 || every > 0)) checkpoint(step);
    return stop ? Integrator::Verdict::stop : Integrator::Verdict::go_on;
  }

  void note_events(const Integrator::Step& step) {
    const auto& fields = gather_.components(step.u);
    if (rank_ != 0) return;
    events_->step(step.t, fields);
    for (const SlipEvent& event : events_->ended())
      if (file_) file_->event(event.end, events_->row(event));
  }

  void write_rows(const Integrator::Step& step) {
    if (!options_.reals("out_probes").empty()) {
      const Probes::Values& values = probes_.read(step.u);
      file_->probes(step.t, values.psi, values.eta);
    }
    if (!options_.boolean("out_series")) return;
    const FieldStatistics s = statistics(model_, step.u);
    PetscInt rejections;
    SS_TRY(TSGetStepRejections(integrator_->ts(), &rejections));
    std::vector<double> row = {s.psi_mean, s.psi_min, s.psi_max, s.eta_mean, step.t - step.t_before,
                               double(step.index), double(rejections_before_ + rejections)};
    if (displacement_ && displacement_->has_energy()) {
      const Energy e = displacement_->energy(step.u);
      const Scene& cell = model_.scene();
      const PetscInt blocks = scene_.n / cell.n;  // whole cells
      const double cells = scene_.form == Form::chain ? blocks : scene_.length / cell.length;
      for (const double part : {e.kinetic, e.elastic, e.input, e.friction, e.viscous}) row.push_back(cells * part);
    }
    file_->series(step.t, row);
  }

  void write_frame(double t) {
    model_.set_held(work_);
    std::vector<std::vector<double>> fields = gather_.components(work_);
    if (fields.size() == 3)
      std::transform(fields[2].begin(), fields[2].end(), fields[2].begin(),
                     [&](double s) { return state_to_output(scene_.friction.state, s); });
    if (displacement_) {
      displacement_->solve(work_, t, chi_);
      fields.push_back(gather_chi_->components(chi_)[0]);
    }
    std::vector<const double*> rows;
    if (rank_ == 0) {
      for (std::vector<double>& field : fields) {
        const std::size_t cell = field.size();  // one of several equal ones
        field.resize(static_cast<std::size_t>(scene_.n));
        for (std::size_t i = cell; i < field.size(); ++i) field[i] = field[i - cell];
        rows.push_back(field.data());
      }
    }
    file_->frame(t, rows);
  }

  void checkpoint(const Integrator::Step& step) {
    checkpoint_wanted = 0;
    last_checkpoint_wall_ = MPI_Wtime();
    file_->flush();
    Checkpoint c;
    c.t = step.t;
    c.dt = step.next_dt;
    c.step = step.index;
    PetscInt rejections;
    SS_TRY(TSGetStepRejections(integrator_->ts(), &rejections));
    c.numbers = {{"rejections", double(rejections_before_ + rejections)},
                 {"rhs_evaluations", double(evaluations_before_ + model_.rhs_evaluations())},
                 {"nodes", double(model_.scene().n)},
                 {"t_end", t_end_}};
    for (const auto& [name, text] : options_.given()) c.texts["given." + name] = text;
    ranges_.into(measurement_, gather_, work_);
    c.arrays = measurement_.save();
    if (events_ && rank_ == 0)
      for (auto& [name, values] : events_->save()) c.arrays[name] = std::move(values);
    last_checkpoint_ = write_checkpoint(options_.text("out_file"), options_.integer("out_checkpoint_keep"), provenance_,
                                        c, gather_, step.u);
  }

  void report(Summary& summary, bool complete) {
    const TimeReport& r = integrator_->report();
    summary.set("t_end", r.t);
    summary.set("steps", r.steps);
    summary.set("rejections", rejections_before_ + r.rejections);
    summary.set("rhs_evaluations", evaluations_before_ + r.rhs_evaluations);
    summary.set("method", r.method);
    summary.set("implicit", to_string(r.implicit));
    summary.set("unknowns", model_.unknowns());
    if (!problem_.what.empty()) summary.set("reduced", problem_.what);
    if (events_ && rank_ == 0) {
      summary.set("events", events_->count());
      summary.set("events_per_s", double(events_->count()) / (MPI_Wtime() - begin_));
    }
    if (!complete) return;
    model_.set_held(u_);
    const FieldStatistics s = statistics(model_, u_);
    summary.set("psi_min", s.psi_min);
    summary.set("psi_max", s.psi_max);
    summary.set("psi_mean", s.psi_mean);
    summary.set("eta_mean", s.eta_mean);
    const std::vector<double> x = options_.reals("out_probes");
    const Probes::Values& values = probes_.read(u_);
    Json probes = Json::array();
    for (std::size_t i = 0; i < x.size(); ++i)
      probes.push(Json::object({{"x", x[i]}, {"psi", values.psi[i]}, {"eta", values.eta[i]}}));
    summary.set("probes", probes);
    double steepest = 0;
    std::string broken, regime;
    ranges_.into(measurement_, gather_, work_);
    if (rank_ == 0) {
      Measurement::Result m = measurement_.result();
      if (m.pulses && !problem_.what.empty()) *m.pulses *= static_cast<int>(model_.scene().copies);
      summary.set("regime", m.regime);
      summary.set("amplitude", m.amplitude);
      summary.set("wave_speed", m.wave_speed);
      summary.set("pulses", m.pulses);
      summary.set("measured_over", std::vector<double>{m.window_begin, m.window_end});
      steepest = m.steepest;
      regime = m.regime;
      if (!problem_.what.empty())
        broken = broken_symmetry(scene_, model_.scene(), m, s.psi_mean, r.t);
    }
    share(broken);
    if (!broken.empty()) warn(broken);
    share(regime);
    trust_->warn_of(trust_->verdict(u_), regime);
    SS_TRY(MPI_Bcast(&steepest, 1, MPI_DOUBLE, 0, PETSC_COMM_WORLD));
    // A front of four or more nodes changes by at most a third of its height from node to node.
    if (scene_.form == Form::continuum && steepest > 0.34)
      warn("a front is not resolved: psi changes by " + std::to_string(int(std::lround(100 * steepest))) +
           " % of its range between two neighbouring nodes; wave speeds and heights depend on the grid (raise grid_n)");
  }

  const Options& options_;
  const Provenance& provenance_;
  Scene scene_;                           // the whole
  std::optional<Checkpoint> checkpoint_;  // with restart, until its values are in place
  Problem problem_;                       // what is solved for it
  Model& model_;
  VecHandle& u_;
  double t_end_;
  VecHandle work_;
  Gather gather_;
  Probes probes_;
  Measurement measurement_;
  Ranges ranges_;
  std::unique_ptr<Events> events_;  // with out_events
  StepsOrSeconds checkpoint_every_;
  double begin_ = MPI_Wtime(), most_seconds_;  // 0: no limit
  PetscInt most_steps_ = std::numeric_limits<PetscInt>::max() - 1;
  int rank_ = 0;

  bool resumed_ = false;
  double t_ = 0, first_dt_ = 0;
  PetscInt first_step_ = 0, rejections_before_ = 0;
  long evaluations_before_ = 0;
  std::unique_ptr<Integrator> integrator_;
  std::unique_ptr<Trust> trust_;
  std::unique_ptr<RunFile> file_;
  std::unique_ptr<Displacement> displacement_;  // with out_displacement
  VecHandle chi_;
  std::unique_ptr<Gather> gather_chi_;
  std::vector<double> frames_, samples_;
  std::size_t next_frame_ = 0, next_sample_ = 0;
  Progress* progress_ = nullptr;
  double first_t_ = 0;  // of this command: a restart begins later than 0
  double last_checkpoint_wall_ = 0;
  int stopped_by_ = 0;
  double step_seconds_ = 0;
  bool wall_is_over_ = false;
  std::string last_checkpoint_;
};

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
    Progress(chosen, "").tell("accuracy: " + plan.what() + "; choosing took " +
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
  Summary summary(provenance, {"t_end",      "steps",    "rejections",    "rhs_evaluations", "method",
                               "implicit",   "unknowns", "reduced",       "psi_min",         "psi_max",
                               "psi_mean",   "eta_mean", "probes",        "regime",          "amplitude",
                               "wave_speed", "pulses",   "measured_over", "stopped_at",      "error_estimate",
                               "events",     "events_per_s", "accuracy"},
                  options.text("summary"));
  return with_summary(summary, [&] {
    if (options.is_set("accuracy") && !options.is_set("restart")) return run_to_accuracy(options, summary);
    Run run(options, provenance);
    return run.advance(summary);
  });
}

}  // namespace stickslip
