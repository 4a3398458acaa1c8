// Steps, and starts and stops of nodes, that take no time. A motion that exists has few of them at one time;
// a loop over steps that they keep from getting on would never end, and would hear no signal, since what
// ends a run is asked behind steps. So every such loop tells one of these what it has done: of too many at
// one time it makes a Failure that says which nodes they are, and it hears signals meanwhile.
#pragma once

#include <petscsys.h>

#include <map>
#include <vector>

namespace stickslip {

class Idling {
 public:
  static constexpr int most_changes = 100;  // of one node at one time
  static constexpr int most_steps = 200;    // in which no node changes, at one time

  // On one rank, or on all of those of `comm` together.
  explicit Idling(MPI_Comm comm = MPI_COMM_SELF) : comm_(comm) {}

  // A step has ended at t, or was rejected where it begins there; in it nodes with these numbers (of the
  // whole line, those of this rank) began to slip or stopped. Up to `same` later than the first at one time
  // is that time still, and as much as round-off of t is. True where SIGINT or SIGTERM has come and no Pulse
  // ends the work: the caller then ends it. Throws Failure, and Interrupted where a Pulse lives. Collective.
  bool at(double t, const std::vector<PetscInt>& changed = {}, double same = 0);
  void restart() { steps_ = 0; }  // time is counted anew

 private:
  [[noreturn]] void end(double t, int changes) const;

  MPI_Comm comm_;
  double t_ = 0;
  int steps_ = 0, idle_ = 0;         // at one time, and those in a row in which no node changed
  std::map<PetscInt, int> changes_;  // of each node, then
};

}  // namespace stickslip
