// Work on one rank, or on each by itself, with an outcome that all ranks share.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "stickslip/base/error.hpp"

namespace stickslip {

// What a rank met: exit code 0 where nothing.
struct Trouble {
  int exit_code = 0;
  std::string text;

  template <class Body>
  static Trouble of(Body&& body) {
    try {
      body();
    } catch (const Error& e) {
      return {e.exit_code(), e.what()};
    } catch (const std::exception& e) {
      return {1, e.what()};
    }
    return {};
  }
  // Throws on every rank what rank `from` met: UsageError or Failure. Collective; costs one broadcast of two
  // integers where that is nothing.
  void share(MPI_Comm comm, int from) const;
};

// Runs body() on rank 0; where it throws, every rank throws the same: UsageError or Failure with its text,
// any other exception as Failure. Collective.
template <class Body>
void on_root(MPI_Comm comm, Body&& body) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  (rank == 0 ? Trouble::of(body) : Trouble()).share(comm, 0);
}

// Runs body(), which is not collective or ends on every rank, on every rank; where it throws on some, every
// rank throws what the first of them did. Collective.
template <class Body>
void together(MPI_Comm comm, Body&& body) {
  const Trouble trouble = Trouble::of(body);
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  int first = trouble.exit_code == 0 ? ranks : rank;
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, comm));
  if (first < ranks) trouble.share(comm, first);
}

// What ranks tell each other: values of rank 0, sums, the largest. Collective, on PETSC_COMM_WORLD unless
// another communicator is given.
inline int rank_in(MPI_Comm comm) {  // not collective
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  return rank;
}
inline int ranks_in(MPI_Comm comm) {  // not collective
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  return ranks;
}

template <class T>
std::enable_if_t<std::is_trivially_copyable_v<T>> broadcast(T& value, MPI_Comm comm = PETSC_COMM_WORLD) {
  MPI_Bcast(&value, static_cast<int>(sizeof value), MPI_BYTE, 0, comm);
}

template <class T>
std::enable_if_t<std::is_trivially_copyable_v<T>> broadcast(std::vector<T>& values,
                                                            MPI_Comm comm = PETSC_COMM_WORLD) {
  std::int64_t size = static_cast<std::int64_t>(values.size());
  broadcast(size, comm);
  values.resize(size);
  const std::int64_t most = 1 << 26;  // an int counts the bytes of one call
  for (std::int64_t at = 0; at < size; at += most)
    MPI_Bcast(values.data() + at, static_cast<int>(std::min(most, size - at) * std::int64_t(sizeof(T))),
              MPI_BYTE, 0, comm);
}

inline void broadcast(std::string& text, MPI_Comm comm = PETSC_COMM_WORLD) {
  std::vector<char> bytes(text.begin(), text.end());
  broadcast(bytes, comm);
  text.assign(bytes.begin(), bytes.end());
}

template <class T>
void broadcast(std::map<std::string, T>& values) {
  std::int64_t size = static_cast<std::int64_t>(values.size());
  broadcast(size);
  auto source = values.begin();  // rank 0 has one for each, the others none
  for (std::int64_t k = 0; k < size; ++k) {
    std::pair<std::string, T> item;
    if (source != values.end()) item = *source++;
    broadcast(item.first);
    broadcast(item.second);
    values.insert(std::move(item));
  }
}

template <class... T>
void broadcast_all(T&... values) {
  (broadcast(values), ...);
}

// Element by element, in place, on every rank.
inline void sum_over(MPI_Comm comm, double* values, int count) {
  MPI_Allreduce(MPI_IN_PLACE, values, count, MPI_DOUBLE, MPI_SUM, comm);
}
inline double sum_over(MPI_Comm comm, double value) {
  sum_over(comm, &value, 1);
  return value;
}
inline void largest_over(MPI_Comm comm, double* values, int count) {
  MPI_Allreduce(MPI_IN_PLACE, values, count, MPI_DOUBLE, MPI_MAX, comm);
}
inline double largest_over(MPI_Comm comm, double value) {
  largest_over(comm, &value, 1);
  return value;
}

// Whether a condition holds on some rank.
inline bool on_any_rank(MPI_Comm comm, bool here) { return largest_over(comm, here ? 1 : 0) > 0; }

}  // namespace stickslip
