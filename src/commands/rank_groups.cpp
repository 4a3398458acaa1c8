#include "commands/rank_groups.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <exception>
#include <string>

#include "base/broadcast.hpp"
#include "base/pulse.hpp"

namespace stickslip {

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
