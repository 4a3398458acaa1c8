#include "base/scatter.hpp"

#include <algorithm>
#include <exception>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

namespace {
constexpr std::int64_t largest_piece = 1 << 17;  // doubles: a megabyte
constexpr int tag = 73;
}  // namespace

void scatter(MPI_Comm comm, std::int64_t first, std::int64_t count, double* into,
             const std::function<void(std::int64_t first, std::int64_t count, double* values)>& read) {
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  std::vector<std::int64_t> parts(rank == 0 ? 2 * ranks : 0);
  const std::int64_t own[2] = {first, count};
  SS_TRY(MPI_Gather(own, 2, MPI_INT64_T, parts.data(), 2, MPI_INT64_T, 0, comm));
  std::exception_ptr trouble;
  const auto take = [&](std::int64_t at, std::int64_t number, double* values) {
    if (trouble) return;  // the others wait for their values all the same
    try {
      read(at, number, values);
    } catch (...) {
      trouble = std::current_exception();
    }
  };
  std::vector<double> piece;
  for (int k = 0; k < (rank == 0 ? ranks : 0); ++k) {
    const std::int64_t begin = parts[2 * k], end = begin + parts[2 * k + 1];
    for (std::int64_t at = begin; at < end; at += largest_piece) {
      const std::int64_t number = std::min(largest_piece, end - at);
      if (k == 0) {
        take(at, number, into + (at - begin));
        continue;
      }
      piece.resize(number);
      take(at, number, piece.data());
      SS_TRY(MPI_Send(piece.data(), int(number), MPI_DOUBLE, k, tag, comm));
    }
  }
  if (rank != 0)
    for (std::int64_t done = 0; done < count; done += largest_piece)
      SS_TRY(MPI_Recv(into + done, int(std::min(largest_piece, count - done)), MPI_DOUBLE, 0, tag, comm,
                      MPI_STATUS_IGNORE));
  on_root(comm, [&] {
    if (trouble) std::rethrow_exception(trouble);
  });
}

}  // namespace stickslip
