#include "output/shared_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

#include "base/broadcast.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

constexpr std::size_t largest_piece = 1 << 17;  // doubles: a megabyte
constexpr int piece_tag = 71, values_tag = 72;

// What tells a file from others of its name on other machines.
struct FileIdentity {
  std::uint64_t device = 0, number = 0, size = 0;
  std::int64_t seconds = 0, nanoseconds = 0;
};

FileIdentity identity_of(int descriptor) {
  struct stat at {};
  if (fstat(descriptor, &at) != 0) return {};
  return {at.st_dev, at.st_ino, std::uint64_t(at.st_size), at.st_mtim.tv_sec, at.st_mtim.tv_nsec};
}

// Whether writes from several machines are in step there (statfs(2) lists the numbers).
bool keeps_machines_in_step(int descriptor) {
  constexpr std::uint32_t nfs = 0x6969, smb = 0x517b, smb2 = 0xfe534d42, cifs = 0xff534d42, fuse = 0x65735546,
                          v9fs = 0x01021997;
  struct statfs system {};
  if (fstatfs(descriptor, &system) != 0) return false;
  for (const std::uint32_t late : {nfs, smb, smb2, cifs, fuse, v9fs})
    if (static_cast<std::uint32_t>(system.f_type) == late) return false;
  return true;
}

struct Block {
  std::int64_t at = 0, count = -1;  // -1: no more
};

}  // namespace

SharedFile::SharedFile(MPI_Comm comm, bool by_root) : comm_(comm), by_root_(by_root) {
  rank_ = rank_in(comm);
  ranks_ = ranks_in(comm);
  if (ranks_ == 1) return;
  MPI_Comm machine;  // the first rank of each is its lowest
  SS_TRY(MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, rank_, MPI_INFO_NULL, &machine));
  int first = rank_;
  SS_TRY(MPI_Bcast(&first, 1, MPI_INT, 0, machine));
  SS_TRY(MPI_Comm_free(&machine));
  beside_root_ = first == 0;
}

void SharedFile::open(std::string path) {
  broadcast(path, comm_);
  descriptor_.reset();
  try {
    descriptor_ = std::make_unique<paths::Descriptor>(path, O_WRONLY, "write");
  } catch (const Failure&) {
    // rank 0 says so when it writes; another one feeds it
  }
  if (ranks_ == 1) return;
  const FileIdentity own = descriptor_ ? identity_of(*descriptor_) : FileIdentity{};
  FileIdentity its = own;
  broadcast(its, comm_);
  const bool unchanged =
      own.size == its.size && own.seconds == its.seconds && own.nanoseconds == its.nanoseconds;
  const bool direct =
      rank_ == 0 ||
      (!by_root_ && descriptor_ && own.number == its.number &&
       (beside_root_ ? own.device == its.device : unchanged && keeps_machines_in_step(*descriptor_)));
  if (!direct) descriptor_.reset();
  const int feeds = direct ? 0 : 1;
  std::vector<int> all(ranks_);
  // nobody writes before all have looked
  SS_TRY(MPI_Allgather(&feeds, 1, MPI_INT, all.data(), 1, MPI_INT, comm_));
  fed_.clear();
  for (std::size_t k = 0; k < all.size(); ++k)
    if (rank_ == 0 && all[k]) fed_.push_back(int(k));
}

void SharedFile::put(std::int64_t at, const double* values, std::size_t count) const {
  if (!descriptor_) throw Failure("the file cannot be opened");
  paths::write_all(*descriptor_, values, count * sizeof(double), at);
}

void SharedFile::write(const std::function<void(const Put&)>& body) {
  std::string trouble;
  try {
    if (rank_ == 0 || descriptor_)
      body([this](std::int64_t at, const double* values, std::size_t count) { put(at, values, count); });
    else
      feed(body);
  } catch (const std::exception& e) {
    trouble = e.what();
  }
  std::vector<double> piece;
  for (const int rank : fed_) drain(rank, piece, trouble);
  agree_on(std::move(trouble));
}

void SharedFile::sync() {
  if (ranks_ == 1) return;
  std::string trouble;
  if (descriptor_ && !beside_root_ && fsync(*descriptor_) != 0) trouble = std::strerror(errno);
  agree_on(std::move(trouble));
}

// What one rank met, all throw.
void SharedFile::agree_on(std::string trouble) const {
  if (ranks_ == 1) {
    if (!trouble.empty()) throw Failure(trouble);
    return;
  }
  int first = trouble.empty() ? ranks_ : rank_;  // that met trouble
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, comm_));
  if (first == ranks_) return;
  int size = int(trouble.size());
  SS_TRY(MPI_Bcast(&size, 1, MPI_INT, first, comm_));
  trouble.resize(size);
  SS_TRY(MPI_Bcast(&trouble[0], size, MPI_CHAR, first, comm_));
  throw Failure(trouble);
}

void SharedFile::feed(const std::function<void(const Put&)>& body) const {
  const auto send = [this](const Block& piece) {
    SS_TRY(MPI_Send(&piece, int(sizeof piece), MPI_BYTE, 0, piece_tag, comm_));
  };
  try {
    body([&](std::int64_t at, const double* values, std::size_t count) {
      for (std::size_t done = 0; done < count; done += largest_piece) {
        const std::size_t part = std::min(largest_piece, count - done);
        send({at + std::int64_t(done * sizeof(double)), std::int64_t(part)});
        SS_TRY(MPI_Send(values + done, int(part), MPI_DOUBLE, 0, values_tag, comm_));
      }
    });
  } catch (...) {
    send({});
    throw;
  }
  send({});
}

// What a rank feeds; after a trouble it is taken all the same, since the rank goes on sending.
void SharedFile::drain(int rank, std::vector<double>& piece, std::string& trouble) const {
  for (;;) {
    Block next;
    SS_TRY(MPI_Recv(&next, int(sizeof next), MPI_BYTE, rank, piece_tag, comm_, MPI_STATUS_IGNORE));
    if (next.count < 0) return;
    piece.resize(std::max(piece.size(), std::size_t(next.count)));
    SS_TRY(MPI_Recv(piece.data(), int(next.count), MPI_DOUBLE, rank, values_tag, comm_, MPI_STATUS_IGNORE));
    if (!trouble.empty()) continue;
    try {
      put(next.at, piece.data(), std::size_t(next.count));
    } catch (const std::exception& e) {
      trouble = e.what();
    }
  }
}

}  // namespace stickslip
