#include "commands/run_control.hpp"

#include <limits>

#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

volatile std::sig_atomic_t caught_signal = 0;
volatile std::sig_atomic_t checkpoint_wanted = 0;
int watches = 0;

extern "C" void on_signal(int number) {
  if (number == SIGUSR1) checkpoint_wanted = 1;
  else caught_signal = number;
}

}  // namespace

SignalWatch::SignalWatch() {
  if (watches++ == 0) caught_signal = checkpoint_wanted = 0;
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  for (std::size_t i = 0; i < numbers.size(); ++i) sigaction(numbers[i], &action, &before_[i]);
}

SignalWatch::~SignalWatch() {
  --watches;
  for (std::size_t i = 0; i < numbers.size(); ++i) sigaction(numbers[i], &before_[i], nullptr);
}

int SignalWatch::caught() const { return caught_signal; }

RunControl::RunControl(const Options& options, PetscInt first_step)
    : every_(options.steps_or_seconds("out_checkpoint_every")),
      most_seconds_(options.steps_or_seconds("ts_max_wall").seconds), t_end_(options.real("ts_max_time")),
      begin_(MPI_Wtime()), last_checkpoint_(begin_), first_step_(first_step),
      most_steps_(options.is_set("ts_max_steps") ? options.integer("ts_max_steps")
                                                 : std::numeric_limits<PetscInt>::max() - 1) {}

RunControl::Decision RunControl::after(PetscInt step, double t) {
  const double now = MPI_Wtime();
  int flags[4] = {caught_signal, checkpoint_wanted, every_.seconds > 0 && now - last_checkpoint_ >= every_.seconds,
                  most_seconds_ > 0 && now - begin_ >= most_seconds_};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, flags, 4, MPI_INT, MPI_MAX, PETSC_COMM_WORLD));
  stopped_by_ = flags[0];
  wall_is_over_ = flags[3] && t < t_end_ && !stopped_by_;
  Decision decision;
  decision.stop = stopped_by_ != 0 || wall_is_over_;
  const bool by_steps = every_.steps > 0 && step > 0 && step != first_step_ && step % every_.steps == 0;
  const bool last = t == t_end_ || step >= most_steps_;
  const bool inside = t < t_end_ && (by_steps || decision.stop || flags[1] || flags[2]);
  decision.checkpoint = inside || (last && wants_checkpoints());
  decision.restart = inside && !decision.stop;
  return decision;
}

void RunControl::checkpoint_written() {
  checkpoint_wanted = 0;
  last_checkpoint_ = MPI_Wtime();
}

}  // namespace stickslip
