// Work that rank 0 alone does (files), with an outcome that all ranks share.
#pragma once

#include <petscsys.h>

#include <exception>
#include <string>

#include "stickslip/base/error.hpp"

namespace stickslip {

// Runs body() on rank 0; where it throws, every rank throws the same: UsageError or Failure with its text,
// any other exception as Failure. Collective; costs one broadcast of an int.
template <class Body>
void on_root(MPI_Comm comm, Body&& body) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  int told[2] = {0, 0};  // exit code, length of the text
  std::string text;
  if (rank == 0) {
    try {
      body();
    } catch (const Error& e) {
      told[0] = e.exit_code();
      text = e.what();
    } catch (const std::exception& e) {
      told[0] = 1;
      text = e.what();
    }
    told[1] = static_cast<int>(text.size());
  }
  MPI_Bcast(told, 2, MPI_INT, 0, comm);
  if (told[0] == 0) return;
  text.resize(told[1]);
  MPI_Bcast(&text[0], told[1], MPI_CHAR, 0, comm);
  if (told[0] == 2) throw UsageError(text);
  throw Failure(text);
}

}  // namespace stickslip
