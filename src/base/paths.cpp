#include "base/paths.hpp"

#include <fmt/format.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>

#include "base/failure.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip::paths {

std::string folder(const std::string& path) {
  const std::string parent = std::filesystem::path(path).parent_path();
  return parent.empty() ? "." : parent;
}

std::string file(const std::string& path) { return std::filesystem::path(path).filename(); }

std::string hidden_sibling(const std::string& path, const std::string& suffix) {
  return std::filesystem::path(path).replace_filename("." + file(path) + suffix);
}

std::string resolved(const std::string& path) {
  std::error_code missing;
  const std::filesystem::path real = std::filesystem::canonical(path, missing);
  return missing ? path : real.string();
}

Present check_writable(const std::string& option, const std::string& path) {
  const auto refuse = [&](const std::string& why) { throw usage_error("{} '{}': {}", option, path, why); };
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

  // Whether a file can be made there is best learnt by making one; permissions alone do not tell (read-only
  // mounts).
  const std::string probe = hidden_sibling(resolved(path), ".probe");  // not what another program writes now
  unlink(probe.c_str());
  const int fd = open(probe.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (fd < 0) refuse(fmt::format("cannot be written in '{}' ({})", folder(path), std::strerror(errno)));
  close(fd);
  unlink(probe.c_str());
  return present ? Present::regular : Present::nothing;
}

Descriptor::Descriptor(const std::string& path, int flags, const std::string& doing)
    : number_(open(path.c_str(), flags | O_CLOEXEC, 0666)) {
  if (number_ < 0) throw failure("cannot {} '{}': {}", doing, path, std::strerror(errno));
}

Descriptor::~Descriptor() { close(number_); }

void write_all(int descriptor, const void* bytes, std::size_t size, std::int64_t at) {
  for (std::size_t done = 0; done < size;) {
    const char* from = static_cast<const char*>(bytes) + done;
    const ssize_t count = at < 0
                              ? write(descriptor, from, size - done)
                              : pwrite(descriptor, from, size - done, static_cast<off_t>(at) + off_t(done));
    if (count < 0 && errno != EINTR) throw Failure(std::strerror(errno));
    if (count > 0) done += count;
  }
}

std::size_t read_some(int descriptor, void* bytes, std::size_t size, std::int64_t at) {
  for (;;) {
    const ssize_t count = pread(descriptor, bytes, size, static_cast<off_t>(at));
    if (count >= 0) return count;
    if (errno != EINTR) throw Failure(std::strerror(errno));
  }
}

void reserve(const std::string& path, double bytes) {
  const Descriptor file(path, O_RDWR | O_CREAT, "create");
  if (const int why = posix_fallocate(file, 0, static_cast<off_t>(bytes)); why != 0)
    throw Failure("cannot write '" + path + "': " + std::strerror(why));
}

void check_length(const std::string& path, double bytes) {
  const bool fits = truncate(path.c_str(), static_cast<off_t>(bytes)) == 0;
  const int why = errno;
  if (!fits || truncate(path.c_str(), 0) != 0)
    throw Failure("cannot write '" + path + "': " + std::strerror(fits ? errno : why));
}

void sync(const std::string& path) {
  const Descriptor file(path, O_RDONLY);
  if (fsync(file) != 0) throw Failure("cannot write '" + path + "': " + std::strerror(errno));
}

void publish(const std::string& temporary, const std::string& path) {
  if (std::rename(temporary.c_str(), path.c_str()) != 0)
    throw Failure("cannot write '" + path + "': " + std::strerror(errno));
}

void replace_file(const std::string& path, const std::function<void(const std::string& name)>& write,
                  const std::string& suffix, bool to_disk) {
  const std::string name = hidden_sibling(path, suffix);
  unlink(name.c_str());
  try {
    write(name);
    if (to_disk) sync(name);
    publish(name, path);
  } catch (...) {
    unlink(name.c_str());
    throw;
  }
}

void replace_file(const std::string& path, const std::string& content, const std::string& suffix,
                  bool to_disk) {
  const auto write = [&](const std::string& name) {
    write_all(Descriptor(name, O_WRONLY | O_CREAT | O_TRUNC, "write"), content.data(), content.size());
  };
  replace_file(path, write, suffix, to_disk);
}

}  // namespace stickslip::paths

namespace stickslip {

std::string shell_word(const std::string& word) {
  const char* safe = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/@%";
  if (!word.empty() && word.find_first_not_of(safe) == std::string::npos) return word;
  std::string out = "'";
  for (const char c : word) {
    if (c == '\'')
      out += "'\\''";
    else
      out += c;
  }
  return out + "'";
}

}  // namespace stickslip
