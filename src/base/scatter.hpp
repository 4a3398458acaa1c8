// Long lists from rank 0 to those that want a part of them.
#pragma once

#include <petscsys.h>

#include <cstdint>
#include <functional>

namespace stickslip {

// Every rank gets the values first ... first + count - 1 of a list that rank 0 reads by read(first, count,
// values), in pieces of at most a megabyte: it has no more of it at a time. Parts may overlap. What read()
// throws every rank throws (root.hpp). Collective.
void scatter(MPI_Comm comm, std::int64_t first, std::int64_t count, double* into,
             const std::function<void(std::int64_t first, std::int64_t count, double* values)>& read);

}  // namespace stickslip
