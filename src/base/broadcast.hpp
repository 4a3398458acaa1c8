// What ranks tell each other: values of rank 0, sums, the largest. Collective, on PETSC_COMM_WORLD unless
// another communicator is given.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace stickslip {

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
