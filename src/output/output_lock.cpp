#include "stickslip/output/output_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "base/paths.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

// Whether the open file still has that name: its last holder may have removed it in the meantime.
bool is_named(int descriptor, const std::string& name) {
  struct stat open_one {
  }, named{};
  return fstat(descriptor, &open_one) == 0 && stat(name.c_str(), &named) == 0 &&
         open_one.st_ino == named.st_ino && open_one.st_dev == named.st_dev;
}

// For the one who is held off.
void sign(int descriptor) {
  char host[256] = "?", text[300];
  (void)gethostname(host, sizeof host - 1);
  const int size = std::snprintf(text, sizeof text, "process %ld on %s", long(getpid()), host);
  if (ftruncate(descriptor, 0) == 0) (void)!pwrite(descriptor, text, std::size_t(size), 0);
}

std::string signature(int descriptor) {
  char text[300] = "";
  const ssize_t size = pread(descriptor, text, sizeof text - 1, 0);
  return size > 0 ? " (" + std::string(text, std::size_t(size)) + ")" : "";
}

}  // namespace

OutputLock::OutputLock(const std::string& path)
    : name_(paths::hidden_sibling(paths::resolved(path), ".lock")) {
  for (;;) {
    const int file = open(name_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (file < 0)
      throw UsageError("out_file '" + path + "': cannot make '" + name_ + "' (" + std::strerror(errno) + ")");
    if (flock(file, LOCK_EX | LOCK_NB) != 0) {
      const bool taken = errno == EWOULDBLOCK;
      const std::string by = taken ? signature(file) : "";
      close(file);
      if (!taken) return;  // no locks on this file system; what was made goes with this object
      throw UsageError("out_file '" + path + "': another command writes it now" + by +
                       "; wait for its end or give another name");
    }
    if (is_named(file, name_)) {
      descriptor_ = file;
      sign(file);
      return;
    }
    close(file);
  }
}

OutputLock::~OutputLock() {
  if (!name_.empty()) unlink(name_.c_str());  // before the lock is given back
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace stickslip
