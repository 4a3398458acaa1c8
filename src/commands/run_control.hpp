// What may stop a run or make it write a checkpoint: signals, the clock, a number of steps.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "base/pulse.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

class RunControl {
 public:
  // `first_step`: from which this command goes on. The wall clock starts here.
  RunControl(const Options& options, std::int64_t first_step);

  // What to do after an accepted step, the same on every rank.
  struct Decision {
    bool stop = false;        // end the run here
    bool checkpoint = false;  // write one
    bool restart = false;     // and let the method forget what it remembers of earlier steps
  };
  // Of several ranks, what only one of them may know (a signal, the clock) is found after 20 ms or 100 steps
  // at the latest, by one reduction over all. Collective.
  // `over`: the run ends here, also where t is not ts_max_time.
  Decision after(std::int64_t step, double t, bool over = false);
  void checkpoint_written();

  bool wants_checkpoints() const { return every_.steps > 0 || every_.seconds > 0; }
  bool checkpoints_by_steps() const { return every_.steps > 0; }  // after() is to see every step then
  std::int64_t most_steps() const { return most_steps_; }
  int signal() const { return stopped_by_; }           // that ended the run, 0: none
  bool wall_is_over() const { return wall_is_over_; }  // ts_max_wall came before the end

 private:
  std::array<int, 4> ask();

  SignalWatch watch_;
  StepsOrSeconds every_;
  double most_seconds_, t_end_, begin_, last_checkpoint_, asked_;  // 0 seconds: no limit
  bool alone_ = true;                                              // one rank
  int steps_since_ = 0, steps_between_ = 1;                        // the ranks asked each other
  std::int64_t first_step_, most_steps_;
  int stopped_by_ = 0;
  bool wall_is_over_ = false;
};

}  // namespace stickslip
