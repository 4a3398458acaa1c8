// What stands in files already: the checks before one is written, who writes it now, and reading those of
// this program.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/model/model.hpp"

namespace stickslip {

// One writer at a time of an out_file.
//
// The lock is flock(2) on a hidden file beside it (`ring.h5`: `.ring.h5.lock`), since out_file itself may not
// be there yet and is replaced by renaming. The system gives the lock back however the process ends; the file
// is removed at an orderly end, and one that a killed process left holds nobody off. Processes on other
// machines see the lock where the file system passes it on (NFS, Lustre with `flock`); where it knows no
// locks, there is none.
class OutputLock {
 public:
  OutputLock() = default;  // of nothing
  // rank 0 alone; throws UsageError where another one holds it
  explicit OutputLock(const std::string& path);
  OutputLock(OutputLock&& other) noexcept { *this = std::move(other); }
  OutputLock& operator=(OutputLock&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    name_.swap(other.name_);
    return *this;
  }
  OutputLock(const OutputLock&) = delete;
  OutputLock& operator=(const OutputLock&) = delete;
  ~OutputLock();

 private:
  int descriptor_ = -1;
  std::string name_;  // of the hidden file
};

// What stands in files already: the checks before one is written, and reading those of this program.

// Throws UsageError where option out_file with this text cannot be written at the end of the work: an empty
// name, a folder, a missing or unwritable folder, an existing file that this program did not write.
// Collective.
void check_output_path(const std::string& path);

// Both outputs of a command at once, that they are not one and the same file, and that no other command
// writes out_file now: what comes back holds others off as long as it lives. "" stands for none. Throws
// UsageError. Collective.
[[nodiscard]] OutputLock check_outputs(const std::string& out_file, const std::string& summary);

// What a file of this program holds. All three below are collective, give every rank the same, and throw
// UsageError, which begins with `WHAT 'PATH': ` (WHAT is the option's name), where the file is missing, not
// ours or lacks it.
struct FileHeader {
  std::string kind, version, git;
  std::map<std::string, std::string> options;
};
FileHeader read_header(const std::string& what, const std::string& path);
std::string kind_of(const std::string& what, const std::string& path);  // "" for an HDF5 file of others

struct DataArray {
  std::vector<std::size_t> shape;
  std::vector<double> values;  // row-major
};
DataArray read_array(const std::string& what, const std::string& path, const std::string& name);

// One frame of a run's file, or of any HDF5 file (as NetCDF-4 files are) with a variable x and variables psi
// and eta of it, or of (time, x); index -1 is the last one.
struct Frame {
  double t = 0;
  std::int64_t index = 0, count = 0;  // which frame, of how many
  std::vector<double> x;
  std::map<std::string, std::vector<double>> fields;  // psi, eta, ...
  std::map<std::string, std::string> options;
};
Frame read_frame(const std::string& what, const std::string& path, std::int64_t index = -1);

// The end of a run that the next one starts from, handed on in memory: for commands that run one after
// another in one process, where a file between them would take ten times as long as a short run.

// While it lives, a run leaves its end here, and one with init_type `file` whose init_file is `name` starts
// from it. The same on every rank.
class CarriedFrame {
 public:
  static constexpr const char* name = "(the point before)";  // no file: it is never opened

  explicit CarriedFrame(std::optional<Frame> start);
  ~CarriedFrame();
  CarriedFrame(const CarriedFrame&) = delete;
  CarriedFrame& operator=(const CarriedFrame&) = delete;
  static CarriedFrame* innermost();  // nullptr: there is none

  // All nodes of the whole scene, of which the model may be a cell, as a file would hold them; the whole
  // field on every rank. Collective over PETSC_COMM_WORLD.
  void keep(const Model& model, const Scene& whole, Vec u, double t);

  const std::optional<Frame> start;
  std::optional<Frame> end;  // of the last run that came to its end

 private:
  CarriedFrame* before_;
};

// The same on disk, exact to the last bit, for a sweep that was killed. Rank 0 of PETSC_COMM_WORLD writes,
// under another name first; every rank gets what is read. Throws Failure. Collective.
void save_frame(const std::string& path, const Frame& frame);
Frame load_frame(const std::string& path);

}  // namespace stickslip
