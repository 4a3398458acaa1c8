#include "base/paths.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "stickslip/base/error.hpp"

namespace stickslip::paths {

std::string folder(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

std::string file(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? path : path.substr(slash + 1);
}

std::string hidden_sibling(const std::string& path, const std::string& suffix) {
  const std::string hidden = "." + file(path) + suffix;
  return path.find('/') == std::string::npos ? hidden : folder(path) + "/" + hidden;
}

std::string resolved(const std::string& path) {
  char buffer[PATH_MAX];
  return realpath(path.c_str(), buffer) ? std::string(buffer) : path;
}

Present check_writable(const std::string& option, const std::string& path) {
  const auto refuse = [&](const std::string& why) { throw UsageError(option + " '" + path + "': " + why); };
  if (path.empty()) refuse("the name of a file is needed");
  struct stat at {};
  const bool present = stat(path.c_str(), &at) == 0;
  if (!present && errno != ENOENT) refuse(std::strerror(errno));
  if (present && S_ISDIR(at.st_mode)) refuse("is a folder, give the name of a file");
  if (!present && path.back() == '/') refuse("is not the name of a file");
  if (present && !S_ISREG(at.st_mode)) {
    if (access(path.c_str(), W_OK) != 0) refuse(std::strerror(errno));
    return Present::special;
  }
  struct stat link {};
  if (!present && lstat(path.c_str(), &link) == 0) refuse("is a symbolic link to nothing");
  struct stat in {};
  if (stat(folder(path).c_str(), &in) != 0)
    refuse("the folder '" + folder(path) + "' does not exist (make it first)");

  // Whether a file can be made there is best learnt by making one; permissions alone do not tell (read-only mounts).
  const std::string probe = hidden_sibling(resolved(path));
  unlink(probe.c_str());
  const int fd = open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (fd < 0) refuse("cannot be written in '" + folder(path) + "' (" + std::strerror(errno) + ")");
  close(fd);
  unlink(probe.c_str());
  return present ? Present::regular : Present::nothing;
}

void reserve(const std::string& path, double bytes) {
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (fd < 0) throw Failure("cannot create '" + path + "': " + std::strerror(errno));
  const int why = posix_fallocate(fd, 0, static_cast<off_t>(bytes));
  close(fd);
  if (why != 0) throw Failure("cannot write '" + path + "': " + std::strerror(why));
}

void check_length(const std::string& path, double bytes) {
  const bool fits = truncate(path.c_str(), static_cast<off_t>(bytes)) == 0;
  const int why = errno;
  if (!fits || truncate(path.c_str(), 0) != 0)
    throw Failure("cannot write '" + path + "': " + std::strerror(fits ? errno : why));
}

void sync(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) throw Failure("cannot open '" + path + "': " + std::strerror(errno));
  const int code = fsync(fd);
  const int why = errno;
  close(fd);
  if (code != 0) throw Failure("cannot write '" + path + "': " + std::strerror(why));
}

void publish(const std::string& temporary, const std::string& path) {
  if (std::rename(temporary.c_str(), path.c_str()) != 0)
    throw Failure("cannot write '" + path + "': " + std::strerror(errno));
}

}  // namespace stickslip::paths
