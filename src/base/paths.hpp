// File names and what may be written under them. Rank 0 only.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace stickslip::paths {

std::string folder(const std::string& path);  // "." where there is none
std::string file(const std::string& path);    // the last part
std::string hidden_sibling(const std::string& path, const std::string& suffix = ".tmp");  // DIR/.NAME.tmp

// The file behind symbolic links, so that a rename replaces the file and not the link; `path` itself where
// nothing is there yet.
std::string resolved(const std::string& path);

enum class Present { nothing, regular, special };  // special: a pipe or a device

// What stands at `path`, for `option` to write there: throws UsageError where that is a folder, the folder is
// missing or not writable, or the name is empty, too long or otherwise unusable (found by making and removing
// a file).
Present check_writable(const std::string& option, const std::string& path);

// An open file, closed with the scope.
class Descriptor {
 public:
  // flags: those of open(2). Throws Failure, "cannot DOING 'PATH': ...".
  Descriptor(const std::string& path, int flags, const std::string& doing = "open");
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  operator int() const { return number_; }  // NOLINT: it stands for its number

 private:
  int number_;
};

// All the bytes, from position `at` on; at -1: where the file stands, which may be a pipe. Throws Failure:
// the system's word for what is wrong.
void write_all(int descriptor, const void* bytes, std::size_t size, std::int64_t at = -1);
// Up to so many bytes from position `at` on, fewer at the end of the file. Throws Failure likewise.
std::size_t read_some(int descriptor, void* bytes, std::size_t size, std::int64_t at);

// Takes disk space for the first `bytes` of a file, made where it is not there. Throws Failure.
void reserve(const std::string& path, double bytes);

// Throws Failure where a file may not become so long (a limit of the user or of the file system). Empties it.
void check_length(const std::string& path, double bytes);

// Makes a file anew: write(name) writes it under a hidden name in the same folder, then it is brought to disk
// and takes the place of what stands at `path`, in one step, so that whoever reads finds the earlier file or
// the whole new one. Where anything throws, the earlier one stands and nothing is left. `suffix`: of the
// hidden name; not `to_disk`: it is to outlive the program, but not the machine.
void replace_file(const std::string& path, const std::function<void(const std::string& name)>& write,
                  const std::string& suffix = ".tmp", bool to_disk = true);
void replace_file(const std::string& path, const std::string& content, const std::string& suffix = ".tmp",
                  bool to_disk = true);

void sync(const std::string& path);                                   // fsync of a file; throws Failure
void publish(const std::string& temporary, const std::string& path);  // atomic rename; throws Failure

}  // namespace stickslip::paths

namespace stickslip {

// A word as a POSIX shell would need it typed.
std::string shell_word(const std::string& word);

}  // namespace stickslip
