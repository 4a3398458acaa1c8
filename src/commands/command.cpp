#include "commands/command.hpp"

#include <unistd.h>

#include <fmt/format.h>
#include <algorithm>
#include <exception>
#include <string>

#include "base/failure.hpp"
#include "base/pulse.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/study/trial.hpp"

namespace stickslip {

Names names_of(const Options& options) {
  Names names{options.text("units_length"),
              options.text("units_time"),
              options.text("units_force"),
              options.text("model_form") == "chain",
              {}};
  for (const std::string& label : options.words("labels")) {
    const std::size_t colon = label.find(':');
    const std::string name = trimmed(label.substr(0, colon));
    const OptionSpec* spec = find_option(name);
    if (!spec)
      throw usage_error("labels: {}: no such option{}", stickslip::quoted(name),
                        did_you_mean(nearest_option(name)));
    if (colon == std::string::npos || trimmed(label.substr(colon + 1)).empty())
      throw usage_error("labels: {}: no words for it; write {}: WORDS", stickslip::quoted(label), name);
    names.labels[spec->name] = trimmed(label.substr(colon + 1));
  }
  return names;
}

CommandRun::CommandRun(const std::string& command, const Options& asked, const std::vector<SummaryKey>& keys)
    : options((note_names(names_of(asked)), asked)), provenance(Provenance::of(command, options.all())),
      lock_(check_outputs(options.text("out_file"), options.text("summary"))),
      summary(provenance, keys, options.text("summary")) {}

void say_beyond_table(const Options& options, double low, double high, Summary& summary) {
  if (options.text("friction_law") != "table") return;
  const std::vector<std::pair<double, double>> points = options.pairs("friction_table");
  if (points.empty()) return;
  const double last = points.back().first;
  const double first = points.front().first < 0 ? points.front().first : -last;  // else odd
  if (first <= low && high <= last) return;
  const double reached = high > last ? high : low;
  const bool goes_on = options.text("friction_table_beyond") == "slope";
  summary.say(fmt::format("psi comes to {}, beyond the end of friction_table at {}: there friction {}",
                          in_unit(reached, 4, "velocity"), in_unit(high > last ? last : first, 4, "velocity"),
                          goes_on ? "goes on with the last slope, not below 0" : "is taken as constant"));
}

void CommandRun::end_at_signal(ResultFile& file) const {
  keeping_what_is_found([] { beat("branches"); },
                        [&] {
                          if (provenance.ranks == 1) file.write();
                        });
}

void check_continuation(const Options& options, const std::string& command, const std::string& suffix) {
  const std::string which = command + "_continue" + suffix, end = command + "_to" + suffix,
                    name = options.text(which);
  if (options.is_set(which) != options.is_set(end))
    throw UsageError(which + " and " + end + " belong together: which option to vary, and up to which value");
  if (!options.is_set(which)) return;
  const OptionSpec& spec = real_option(which, name, "a branch follows a real option");
  if (options.text(name).empty())
    throw UsageError(which + " " + name + ": needs -" + name + " as the start of the branch");
  for (const std::string& word : spec.words)
    if (lower_case(options.text(name)) == word)
      throw UsageError(which + " " + name + ": the branch starts at a number, not at `" + word + "`");
  if (options.real(end) == options.real(name))
    throw UsageError(end + " " + options.text(end) + ": the branch starts there");
  (void)options.with(name, options.real(end));  // must be a value that the option can take
}

RunControl::RunControl(const Options& options, std::int64_t first_step)
    : every_(options.steps_or_seconds("out_checkpoint_every")),
      most_seconds_(options.steps_or_seconds("ts_max_wall").seconds), t_end_(options.real("ts_max_time")),
      begin_(MPI_Wtime()), last_checkpoint_(begin_), asked_(begin_), first_step_(first_step),
      most_steps_(stickslip::most_steps(options)) {
  alone_ = ranks_in(PETSC_COMM_WORLD) == 1;
}

// What only some rank may know is asked after so many steps that about 20 ms lie between: every rank counts
// alike, since all go by the longest time that one of them has seen.
std::array<int, 4> RunControl::ask() {
  if (++steps_since_ < steps_between_) return {};
  const double now = MPI_Wtime();
  const auto passed = int(std::min(1e9, 1e6 * (now - asked_)));
  int flags[5] = {SignalWatch::caught(), SignalWatch::checkpoint_wanted(),
                  every_.seconds > 0 && now - last_checkpoint_ >= every_.seconds,
                  most_seconds_ > 0 && now - begin_ >= most_seconds_, passed};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, flags, 5, MPI_INT, MPI_MAX, PETSC_COMM_WORLD));
  const double steps = 2e4 * double(steps_since_) / std::max(1, flags[4]);
  steps_between_ = alone_ ? 1 : int(std::clamp(steps, 1., std::min(100., 2. * double(steps_since_))));
  steps_since_ = 0;
  asked_ = now;
  return {flags[0], flags[1], flags[2], flags[3]};
}

RunControl::Decision RunControl::after(std::int64_t step, double t, bool over) {
  const std::array<int, 4> flags = ask();
  stopped_by_ = flags[0];
  over = over || t == t_end_;
  wall_is_over_ = flags[3] && !over && !stopped_by_;
  Decision decision;
  decision.stop = stopped_by_ != 0 || wall_is_over_;
  const bool by_steps = every_.steps > 0 && step > 0 && step != first_step_ && step % every_.steps == 0;
  const bool last = over || step >= most_steps_;
  const bool inside = !over && (by_steps || decision.stop || flags[1] || flags[2]);
  decision.checkpoint = inside || (last && wants_checkpoints());
  decision.restart = inside && !decision.stop;
  return decision;
}

void RunControl::checkpoint_written() {
  SignalWatch::checkpoint_written();
  last_checkpoint_ = MPI_Wtime();
}

namespace {

constexpr int tag_of_end = 7190;

// Asks every two milliseconds whether the others are done, and leaves signals to them.
int rest_until_done(MPI_Comm all) {
  const SignalWatch watch;
  MPI_Request request;
  int code = 0, done = 0;
  SS_TRY(MPI_Irecv(&code, 1, MPI_INT, 0, tag_of_end, all, &request));
  for (;;) {
    SS_TRY(MPI_Test(&request, &done, MPI_STATUS_IGNORE));
    if (done) return code;
    usleep(2000);
  }
}

}  // namespace

int on_ranks(int count, const std::function<int()>& body) {
  const MPI_Comm all = PETSC_COMM_WORLD;
  const int ranks = ranks_in(all), rank = rank_in(all);
  if (count >= ranks) return body();
  MPI_Comm working;
  SS_TRY(MPI_Comm_split(all, rank < count ? 0 : MPI_UNDEFINED, rank, &working));
  if (rank >= count) return rest_until_done(all);
  PETSC_COMM_WORLD = working;
  const auto end = [&](int code) {
    PETSC_COMM_WORLD = all;
    SS_TRY(MPI_Comm_free(&working));
    for (int other = count; other < ranks && rank == 0; ++other)
      SS_TRY(MPI_Send(&code, 1, MPI_INT, other, tag_of_end, all));
    return code;
  };
  try {
    return end(body());
  } catch (const Error& e) {  // where the working ranks do not know of it main ends all
    if (e.collective()) end(e.exit_code());
    throw;
  }
}

int on_ranks_of(const Options& options, const std::function<int()>& body) {
  const PetscInt ranks = ranks_in(PETSC_COMM_WORLD);
  return may_rest() ? on_ranks(int(std::min(options.integer("grid_n"), ranks)), body) : body();
}

void RankGroups::check(PetscInt ranks_each) {
  const int ranks = ranks_in(MPI_COMM_WORLD);
  if (ranks % ranks_each != 0)
    throw UsageError(fmt::format("sweep_group_ranks {}: {} {} cannot be shared out in groups of that size",
                                 ranks_each, ranks, ranks == 1 ? "rank" : "ranks"));
}

RankGroups::RankGroups(PetscInt ranks_each)
    : size_(int(ranks_each)), exceptions_(std::uncaught_exceptions()) {
  count_ = ranks_in(MPI_COMM_WORLD) / size_;
  SS_TRY(PetscSubcommCreate(MPI_COMM_WORLD, &parts_));
  SS_TRY(PetscSubcommSetNumber(parts_, count_));
  SS_TRY(PetscSubcommSetType(parts_, PETSC_SUBCOMM_CONTIGUOUS));
  PETSC_COMM_WORLD = PetscSubcommChild(parts_);
  index_ = int(parts_->color);
  rank_ = rank_in(PETSC_COMM_WORLD);
  if (count_ == 1) return;
  SS_TRY(MPI_Win_allocate(rank_in(MPI_COMM_WORLD) == 0 ? sizeof(long) : 0, sizeof(long), MPI_INFO_NULL,
                          MPI_COMM_WORLD, &counter_, &window_));
  from_zero();
}

RankGroups::~RankGroups() {
  PETSC_COMM_WORLD = MPI_COMM_WORLD;
  if (std::uncaught_exceptions() > exceptions_) return;  // others may wait elsewhere
  if (window_ != MPI_WIN_NULL) MPI_Win_free(&window_);
  (void)PetscSubcommDestroy(&parts_);
}

void RankGroups::from_zero() {
  own_counter_ = 0;
  if (window_ == MPI_WIN_NULL) return;
  MPI_Barrier(MPI_COMM_WORLD);
  if (rank_in(MPI_COMM_WORLD) == 0) {
    MPI_Win_lock(MPI_LOCK_EXCLUSIVE, 0, 0, window_);
    *counter_ = 0;
    MPI_Win_unlock(0, window_);
  }
  MPI_Barrier(MPI_COMM_WORLD);
}

bool RankGroups::any(bool here) const { return size_ > 1 ? on_any_rank(PETSC_COMM_WORLD, here) : here; }

long RankGroups::take(bool stops) {
  if (any(stops)) return -1;
  long number = own_counter_++;
  if (window_ != MPI_WIN_NULL && leads()) {
    const long one = 1;
    MPI_Win_lock(MPI_LOCK_SHARED, 0, 0, window_);
    MPI_Fetch_and_op(&one, &number, MPI_LONG, 0, 0, MPI_SUM, window_);
    MPI_Win_unlock(0, window_);
  }
  if (size_ > 1) broadcast(number);
  return number;
}

}  // namespace stickslip
