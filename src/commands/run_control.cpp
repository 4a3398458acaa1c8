#include "commands/run_control.hpp"

#include <algorithm>

#include "base/broadcast.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/study/trial.hpp"

namespace stickslip {

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

}  // namespace stickslip
