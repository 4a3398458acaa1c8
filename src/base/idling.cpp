#include "base/idling.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/broadcast.hpp"
#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

namespace {

constexpr int few = 8;  // that any motion may have at one time: nobody is asked
constexpr double round_off = 256 * std::numeric_limits<double>::epsilon();  // of a time

// In the order of ranks.
std::vector<PetscInt> of_all_ranks(const std::vector<PetscInt>& own, MPI_Comm comm) {
  const int count = int(own.size());
  std::vector<int> counts(std::size_t(ranks_in(comm))), begins(counts.size());
  SS_TRY(MPI_Allgather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, comm));
  std::partial_sum(counts.begin(), counts.end() - 1, begins.begin() + 1);
  std::vector<PetscInt> all(std::size_t(begins.back() + counts.back()));
  SS_TRY(
      MPI_Allgatherv(own.data(), count, MPIU_INT, all.data(), counts.data(), begins.data(), MPIU_INT, comm));
  return all;
}

}  // namespace

bool Idling::at(double t, const std::vector<PetscInt>& changed, double same) {
  const bool later = !(std::abs(t - t_) <= std::max(same, round_off * std::abs(t)));
  if (later || steps_ == 0) {
    t_ = t;
    steps_ = idle_ = 0;
    changes_.clear();
  }
  ++steps_;
  if (steps_ <= few) return false;
  int most = 0;
  for (const PetscInt node : changed) most = std::max(most, ++changes_[node]);
  std::array<int, 3> flags{most, changed.empty() ? 0 : 1, SignalWatch::caught()};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, flags.data(), 3, MPI_INT, MPI_MAX, comm_));
  idle_ = flags[1] ? 0 : idle_ + 1;
  if (flags[0] > most_changes || idle_ > most_steps) end(t, flags[0]);
  if (flags[2]) beat("steps", 0);  // a search ends here
  return flags[2] != 0;
}

void Idling::end(double t, int changes) const {
  if (changes <= most_changes)
    throw Failure("time stands still: " + std::to_string(idle_) +
                  " steps have come no further than t = " + number_text(t) +
                  ", and no node starts or stops in them");
  std::vector<PetscInt> own;
  for (const auto& [node, times] : changes_)
    if (times > most_changes / 2) own.push_back(node);
  const std::vector<PetscInt> nodes = of_all_ranks(own, comm_);
  constexpr std::size_t shown = 5;
  std::string text;
  for (std::size_t k = 0; k < std::min(shown, nodes.size()); ++k)
    text += (k ? ", " : "") + std::to_string(nodes[k]);
  if (nodes.size() > shown) text += ", ... (" + std::to_string(nodes.size()) + " in all)";
  throw Failure("nodes begin to slip and rest again without end at t = " + number_text(t) + ": " +
                (nodes.size() == 1 ? "node " : "nodes ") + text + ", " + std::to_string(changes) +
                " times without time");
}

}  // namespace stickslip
