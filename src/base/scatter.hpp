// Long lists between rank 0, which reads and writes files, and those that have parts of them: in pieces of at
// most a megabyte, so that rank 0 has no more of the others' parts at a time.
#pragma once

#include <petscsys.h>

#include <cstdint>
#include <functional>

namespace stickslip {

constexpr std::int64_t largest_piece = 1 << 17;  // doubles: a megabyte

// Every rank gets the values first ... first + count - 1 of a list that rank 0 reads by read(first, count,
// values). Parts may overlap. What read() throws every rank throws (root.hpp). Collective.
void scatter(MPI_Comm comm, std::int64_t first, std::int64_t count, double* into,
             const std::function<void(std::int64_t first, std::int64_t count, double* values)>& read);

// The values first ... first + count - 1 of `rows` rows, one row behind the other, of list number `list`.
struct Piece {
  std::int64_t list = 0, row = 0, rows = 1, first = 0, count = 0;
};
using Give = std::function<void(const Piece& piece, const double* values)>;

// The other way: what body(give) gives on every rank is handed to write() on rank 0, first what that one
// gives itself. What any of them throws every rank throws. Collective.
void collect(MPI_Comm comm, const std::function<void(const Give&)>& body, const Give& write);

}  // namespace stickslip
