// A file that rank 0 has made and into which all ranks write, each at places of its own.
//
// A rank writes itself where it sees the very file of rank 0 and what it writes is there for others at once:
// on rank 0's machine, or on another one by a file system that keeps machines in step (not NFS, SMB or FUSE,
// which may hold writes back). All others feed rank 0 in pieces of at most a megabyte, one rank after the
// other, so that rank 0 never has more of their values than that.
#pragma once

#include <petscsys.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/paths.hpp"

namespace stickslip {

class SharedFile {
 public:
  // `by_root`: all ranks feed rank 0. Collective, like all here but put().
  SharedFile(MPI_Comm comm, bool by_root);

  // The file that is there under this name (significant on rank 0) and will not be renamed or changed by
  // anybody until this returns. Throws nothing: a rank that cannot open it feeds rank 0. The last one is
  // closed.
  void open(std::string path);
  void close() { descriptor_.reset(); }

  // Writes `count` values from byte `at` of the file on.
  using Put = std::function<void(std::int64_t at, const double* values, std::size_t count)>;
  // Lets body(put) run on every rank, with what it writes in the file when this returns. Throws Failure, the
  // same on every rank, where one of them could not write.
  void write(const std::function<void(const Put&)>& body);
  // Brings to disk what ranks on other machines than rank 0's have written themselves; what rank 0's machine
  // holds is for it to sync. Throws as write() does.
  void sync();

 private:
  void agree_on(std::string trouble) const;
  void feed(const std::function<void(const Put&)>& body) const;
  void drain(int rank, std::vector<double>& piece, std::string& trouble) const;
  void put(std::int64_t at, const double* values, std::size_t count) const;

  MPI_Comm comm_;
  int rank_ = 0, ranks_ = 1;
  bool by_root_, beside_root_ = true;              // on its machine
  std::unique_ptr<paths::Descriptor> descriptor_;  // of those that write themselves
  std::vector<int> fed_;                           // rank 0: the others
};

}  // namespace stickslip
