// The ranks in groups of equal size, each of which takes the next number when it is free.
#pragma once

#include <petscsys.h>

namespace stickslip {

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
