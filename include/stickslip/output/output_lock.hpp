// One writer at a time of an out_file.
//
// The lock is flock(2) on a hidden file beside it (`ring.h5`: `.ring.h5.lock`), since out_file itself may not
// be there yet and is replaced by renaming. The system gives the lock back however the process ends; the file
// is removed at an orderly end, and one that a killed process left holds nobody off. Processes on other
// machines see the lock where the file system passes it on (NFS, Lustre with `flock`); where it knows no
// locks, there is none.
#pragma once

#include <string>
#include <utility>

namespace stickslip {

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

}  // namespace stickslip
