// Who of the ranks works: as many as there is work for, or all of them in groups of equal size, each of which
// takes the next number when it is free.
#pragma once

#include <petscsys.h>

#include <functional>

#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// What body() returns, on the first `count` ranks of PETSC_COMM_WORLD, which are that while it lasts; the
// others rest, without a processor, until those are done, and return the same. So what `body` computes and
// writes is what it is on `count` ranks. Collective.
int on_ranks(int count, const std::function<int()>& body);
// Whether ranks may: those of a group of a sweep all want what its point gives.
inline bool may_rest() { return PETSC_COMM_WORLD == MPI_COMM_WORLD; }
// On no more ranks than the scene has nodes, where they may rest.
int on_ranks_of(const Options& options, const std::function<int()>& body);

// Thrown where what is to be done is done by one rank, which finds out in setting up. Collective; before
// anything is written.
class OneRankWorks : public Error {
 public:
  OneRankWorks() : Error(2, true, "this runs on one rank") {}
};

// While it lives, PETSC_COMM_WORLD is the group of this rank (PETSc's sub-communicator), so that whatever
// runs here runs on the group alone. The numbers are counted in memory of rank 0 that all reach without its
// help.
class RankGroups {
 public:
  // `ranks_each` must have passed check(). Collective over all ranks.
  explicit RankGroups(PetscInt ranks_each);
  static void check(PetscInt ranks_each);  // throws UsageError where the ranks cannot be shared out evenly
  ~RankGroups();                           // collective, unless an exception passes
  RankGroups(const RankGroups&) = delete;
  RankGroups& operator=(const RankGroups&) = delete;

  int index() const { return index_; }
  int count() const { return count_; }
  int ranks_each() const { return size_; }
  bool leads() const { return rank_ == 0; }  // is this the first rank of its group?

  // 0, 1, 2, ...: each number once, to one group; -1, for good, from the moment that a rank of the group
  // stops. Collective in the group.
  long take(bool stops);
  bool any(bool here) const;  // is it so on a rank of the group? Collective in the group.
  void from_zero();           // collective over all ranks

 private:
  PetscSubcomm parts_ = nullptr;
  MPI_Win window_ = MPI_WIN_NULL;
  long* counter_ = nullptr;
  long own_counter_ = 0;  // of a single group
  int index_ = 0, count_ = 1, size_ = 1, rank_ = 0, exceptions_ = 0;
};

}  // namespace stickslip
