// Work on one rank, or on each by itself, with an outcome that all ranks share.
#pragma once

#include <petscsys.h>

#include <string>

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

}  // namespace stickslip
