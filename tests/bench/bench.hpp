// What the benchmarks share: interleaved timing on a machine that others use too.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <ctime>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

namespace bench {

struct Seconds {
  double median, least;
};

// -bench_clock wall (the default), or cpu: the processor time of this process, which other users of the
// machine leave alone but for cache and memory; while one rank waits for another it goes on too.
inline bool cpu_clock() {
  char text[8];
  PetscBool set;
  PetscOptionsGetString(nullptr, nullptr, "-bench_clock", text, sizeof text, &set);
  if (set && std::string(text) != "cpu" && std::string(text) != "wall")
    throw std::runtime_error("-bench_clock: wall or cpu");
  return set && std::string(text) == "cpu";
}

inline double now(bool cpu) {
  if (!cpu) return MPI_Wtime();
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

// Runs the candidates in turn, `trials` rounds of `repeat` calls each, after one round that is not counted. A
// round of one candidate counts with its slowest rank. Returns the seconds of one call, over the rounds.
inline std::vector<Seconds> interleaved(MPI_Comm comm, int trials, PetscInt repeat,
                                        const std::vector<std::function<void()>>& candidates) {
  const bool cpu = cpu_clock();
  std::vector<std::vector<double>> seconds(candidates.size());
  for (int trial = -1; trial < trials; ++trial) {
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      MPI_Barrier(comm);
      const double begin = now(cpu);
      for (PetscInt r = 0; r < repeat; ++r) candidates[k]();
      double took = (now(cpu) - begin) / double(repeat);
      MPI_Allreduce(MPI_IN_PLACE, &took, 1, MPI_DOUBLE, MPI_MAX, comm);
      if (trial >= 0) seconds[k].push_back(took);
    }
  }
  std::vector<Seconds> result;
  for (std::vector<double>& s : seconds) {
    std::sort(s.begin(), s.end());
    result.push_back({s[s.size() / 2], s.front()});
  }
  return result;
}

}  // namespace bench
