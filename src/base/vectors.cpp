#include "stickslip/base/vectors.hpp"

#include <algorithm>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

NodeFetch::NodeFetch(const Layout& l, int kept, const std::vector<PetscInt>& nodes)
    : dof_(l.dof), kept_(kept), values_(nodes.size() * std::size_t(kept)) {
  const auto size = PetscInt(values_.size());
  SS_TRY(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, size, values_.data(), fetched_.out()));
  if (ranks_in(l.comm) == 1) {  // a scatter would take longer over its types than over the values
    nodes_ = nodes;
    return;
  }
  IsHandle from;
  if (kept == dof_) {
    SS_TRY(ISCreateBlock(PETSC_COMM_SELF, dof_, PetscInt(nodes.size()), nodes.data(), PETSC_COPY_VALUES,
                         from.out()));
  } else {
    std::vector<PetscInt> entries;
    for (const PetscInt node : nodes)
      for (int d = 0; d < kept; ++d) entries.push_back(node * dof_ + d);
    SS_TRY(ISCreateGeneral(PETSC_COMM_SELF, size, entries.data(), PETSC_COPY_VALUES, from.out()));
  }
  SS_TRY(VecCreateMPIWithArray(l.comm, dof_, l.local * dof_, l.all * dof_, nullptr, own_.out()));
  SS_TRY(VecScatterCreate(own_, from, fetched_, nullptr, scatter_.out()));
}

void NodeFetch::begin(const double* own) const {
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    std::copy_n(own + nodes_[i] * dof_, kept_, &values_[i * std::size_t(kept_)]);
  if (!scatter_) return;
  SS_TRY(VecPlaceArray(own_, own));
  SS_TRY(VecScatterBegin(scatter_, own_, fetched_, INSERT_VALUES, SCATTER_FORWARD));
}

void NodeFetch::end() const {
  if (!scatter_) return;
  SS_TRY(VecScatterEnd(scatter_, own_, fetched_, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecResetArray(own_));
}

void NodeFetch::take(Vec u) const { take(Reading(u)); }

namespace {

constexpr int tag = 73, piece_tag = 71, values_tag = 72;

void send(MPI_Comm comm, const Piece& piece) {
  SS_TRY(MPI_Send(&piece, int(sizeof piece), MPI_BYTE, 0, piece_tag, comm));
}

// Cuts whole rows, or parts of one row, so that no piece is longer than rank 0 takes.
void send_in_pieces(MPI_Comm comm, const Piece& all, const double* values) {
  constexpr std::int64_t one = 1;
  const std::int64_t rows_at_once = std::max(one, largest_piece / std::max(one, all.count));
  for (Piece part = all; part.row < all.row + all.rows; part.row += part.rows) {
    part.rows = std::min(rows_at_once, all.row + all.rows - part.row);
    for (part.first = all.first; part.first < all.first + all.count; part.first += part.count) {
      part.count = std::min(largest_piece, all.first + all.count - part.first);
      send(comm, part);
      SS_TRY(MPI_Send(values, int(part.rows * part.count), MPI_DOUBLE, 0, values_tag, comm));
      values += part.rows * part.count;
    }
    part.count = all.count;
  }
}

// Hands on what a rank gives; after a failure that is only taken, since the rank goes on giving.
void receive(MPI_Comm comm, int rank, std::vector<double>& values, Trouble& trouble, const Give& write) {
  for (;;) {
    Piece piece;
    SS_TRY(MPI_Recv(&piece, int(sizeof piece), MPI_BYTE, rank, piece_tag, comm, MPI_STATUS_IGNORE));
    if (piece.rows == 0) return;
    values.resize(std::max(values.size(), std::size_t(piece.rows * piece.count)));
    SS_TRY(MPI_Recv(values.data(), int(piece.rows * piece.count), MPI_DOUBLE, rank, values_tag, comm,
                    MPI_STATUS_IGNORE));
    if (trouble.exit_code == 0) trouble = Trouble::of([&] { write(piece, values.data()); });
  }
}

}  // namespace

void scatter(MPI_Comm comm, std::int64_t first, std::int64_t count, double* into,
             const std::function<void(std::int64_t first, std::int64_t count, double* values)>& read) {
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  std::vector<std::int64_t> parts(rank == 0 ? 2 * ranks : 0);
  const std::int64_t own[2] = {first, count};
  SS_TRY(MPI_Gather(own, 2, MPI_INT64_T, parts.data(), 2, MPI_INT64_T, 0, comm));
  Trouble trouble;
  const auto take = [&](std::int64_t at, std::int64_t number, double* values) {
    // after a failure the others wait for their values all the same
    if (trouble.exit_code == 0) trouble = Trouble::of([&] { read(at, number, values); });
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
  trouble.share(comm, 0);
}

void collect(MPI_Comm comm, const std::function<void(const Give&)>& body, const Give& write) {
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  together(comm, [&] {
    Trouble trouble;
    if (rank == 0) {
      trouble = Trouble::of([&] { body(write); });
      std::vector<double> values;
      for (int k = 1; k < ranks; ++k) receive(comm, k, values, trouble, write);
    } else {
      trouble = Trouble::of([&] {
        body([&](const Piece& piece, const double* values) { send_in_pieces(comm, piece, values); });
      });
      send(comm, {0, 0, 0, 0, 0});
    }
    if (trouble.exit_code != 0) throw Failure(trouble.text);
  });
}

}  // namespace stickslip
