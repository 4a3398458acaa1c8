#include "commands/seeds.hpp"

#include <petscsys.h>

#include <set>

#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

MPI_Comm own_team = MPI_COMM_WORLD;

// NAME.h5 for one seed: NAME-seed7.h5.
std::string name_of_seed(const std::string& path, const std::string& seed) {
  const std::size_t dot = path.rfind('.'), slash = path.rfind('/');
  const bool has_end = dot != std::string::npos && (slash == std::string::npos || dot > slash + 1) && dot > 0;
  return path.substr(0, has_end ? dot : path.size()) + "-seed" + seed + (has_end ? path.substr(dot) : "");
}

}  // namespace

MPI_Comm team() { return own_team; }

Options of_own_seed(const Options& options) {
  const std::vector<PetscInt> seeds = options.integers("run_seeds");
  const std::string shown = "run_seeds " + options.text("run_seeds") + ": ";
  int ranks, rank;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (std::set<PetscInt>(seeds.begin(), seeds.end()).size() != seeds.size())
    throw UsageError(shown + "each seed once, or runs would write the same file");
  if (int(seeds.size()) > ranks)
    throw UsageError(shown + std::to_string(seeds.size()) + " runs side by side need as many ranks, and there " +
                     (ranks == 1 ? "is 1" : "are " + std::to_string(ranks)) + " (mpirun -n)");
  if (options.is_set("restart"))
    throw UsageError(shown + "not with restart; continue each seed's run by itself");
  if (options.text("summary") == "-") throw UsageError(shown + "the summaries need a file, not standard output");
  const int own = int(long(rank) * long(seeds.size()) / ranks);
  if (MPI_Comm_split(MPI_COMM_WORLD, own, rank, &own_team) != MPI_SUCCESS)
    throw Failure("the ranks cannot be split over run_seeds");
  PETSC_COMM_WORLD = own_team;
  const std::string seed = std::to_string(seeds[std::size_t(own)]);
  Options mine = options.with("run_seeds", "").with("friction_seed", seed).with("init_seed", seed);
  for (const char* file : {"out_file", "summary"})
    if (options.is_set(file)) mine = mine.with(file, name_of_seed(options.text(file), seed));
  return mine;
}

int join_teams(int code) {
  if (own_team == MPI_COMM_WORLD) return code;
  // the launcher ends all ranks when one ends with an error: none before all are done
  MPI_Allreduce(MPI_IN_PLACE, &code, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  MPI_Comm_free(&own_team);
  return code;
}

}  // namespace stickslip
