#include "stickslip/output/checkpoint.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <tuple>
#include <utility>

#include "output/datasets.hpp"
#include "output/hdf5_tools.hpp"
#include "base/paths.hpp"
#include "base/broadcast.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/json.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

namespace {

using h5::Id;

const hsize_t block_size = 512;  // the smallest user block
const char* const magic = "stickslip checkpoint";

// "DIR/NAME" of out_file without its ending: what the names of its checkpoints begin with.
std::string stem(const std::string& out_file) {
  const std::size_t dot = out_file.rfind('.'), slash = out_file.rfind('/');
  const std::size_t begin = slash == std::string::npos ? 0 : slash + 1;
  return dot == std::string::npos || dot <= begin ? out_file : out_file.substr(0, dot);
}

// FNV-1a, 64 bits, of the file from the user block on; and how many bytes those are.
std::pair<std::uint64_t, std::uint64_t> checksum(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) throw Failure("cannot open '" + path + "': " + std::strerror(errno));
  std::uint64_t sum = 1469598103934665603u, count = 0;
  std::vector<unsigned char> buffer(1 << 18);
  off_t at = static_cast<off_t>(block_size);
  for (;;) {
    const ssize_t got = pread(fd, buffer.data(), buffer.size(), at);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) {
      const int why = errno;
      close(fd);
      throw Failure("cannot read '" + path + "': " + std::strerror(why));
    }
    if (got == 0) break;
    for (ssize_t k = 0; k < got; ++k) sum = (sum ^ buffer[static_cast<std::size_t>(k)]) * 1099511628211u;
    at += got;
    count += static_cast<std::uint64_t>(got);
  }
  close(fd);
  return {sum, count};
}

std::string block_text(const std::pair<std::uint64_t, std::uint64_t>& sum) {
  char line[128];
  std::snprintf(line, sizeof line, "%s\nfnv1a64 %016llx\nbytes %llu\n", magic,
                static_cast<unsigned long long>(sum.first), static_cast<unsigned long long>(sum.second));
  return line;
}

std::string read_block(const std::string& path) {
  std::array<char, block_size> buffer{};
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) throw Failure(std::strerror(errno));
  const ssize_t got = pread(fd, buffer.data(), buffer.size() - 1, 0);
  close(fd);
  return got > 0 ? std::string(buffer.data()) : "";
}

void write_file(const std::string& temporary, const Provenance& provenance, const Checkpoint& checkpoint,
                const std::vector<double>& state) {
  double bytes = 8.0 * double(state.size());
  for (const auto& [name, values] : checkpoint.arrays) bytes += 8.0 * double(values.size());
  Id file = h5::create_file(temporary, bytes, block_size);
  h5::write_header(file, provenance, "checkpoint");
  h5::write_attribute(file, "t", checkpoint.t);
  h5::write_attribute(file, "dt", checkpoint.dt);
  h5::write_attribute(file, "step", checkpoint.step);
  h5::write_attribute(file, "texts", text_of_map(checkpoint.texts));
  {
    const Id group(H5Gcreate2(file, "numbers", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    for (const auto& [name, value] : checkpoint.numbers) h5::write_attribute(group, name, value);
    const Id arrays(H5Gcreate2(file, "arrays", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  }
  for (const auto& [name, values] : checkpoint.arrays)
    h5::write_fixed(file, {"arrays/" + name, "", ""}, {values.size()}, values);
  h5::write_fixed(file, {"state", "", ""}, {state.size()}, state);
  if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0 || H5Fclose(file.release()) < 0) h5::fail("write", temporary);

  const std::string block = block_text(checksum(temporary));
  const int fd = open(temporary.c_str(), O_WRONLY | O_CLOEXEC);
  const bool written = fd >= 0 && pwrite(fd, block.data(), block.size(), 0) == static_cast<ssize_t>(block.size());
  const int why = errno;
  if (fd >= 0) close(fd);
  if (!written) throw Failure("cannot write '" + temporary + "': " + std::strerror(why));
  paths::sync(temporary);
}

// On one rank; throws Failure.
void read_file(const std::string& path, Checkpoint& checkpoint) {
  const Id file = h5::open_file(path);
  checkpoint.header = h5::read_header(file);
  if (checkpoint.header.kind != "checkpoint") throw Failure("is no checkpoint");
  if (checkpoint.header.version != version())
    throw Failure("was written by version " + checkpoint.header.version + " of this program, and this is version " +
                  version() + "; go on with the version that wrote it");
  checkpoint.ranks = static_cast<int>(h5::read_integer_attribute(file, "ranks"));
  checkpoint.t = h5::read_real_attribute(file, "t");
  checkpoint.dt = h5::read_real_attribute(file, "dt");
  checkpoint.step = h5::read_integer_attribute(file, "step");
  checkpoint.texts = parse_text_map(h5::read_text_attribute(file, "texts"));
  const Id numbers(H5Gopen2(file, "numbers", H5P_DEFAULT));
  if (!numbers) h5::fail("read the numbers of", path);
  for (const std::string& name : h5::attribute_names(numbers))
    checkpoint.numbers[name] = h5::read_real_attribute(numbers, name);
  for (const std::string& name : h5::members(file, "arrays"))
    checkpoint.arrays[name] = h5::read_reals(file, "arrays/" + name);
  checkpoint.state = h5::read_reals(file, "state");
  const auto finite = [](double x) { return std::isfinite(x); };
  const bool sane = finite(checkpoint.t) && checkpoint.t >= 0 && finite(checkpoint.dt) && checkpoint.dt > 0 &&
                    checkpoint.step >= 0 && checkpoint.step < std::numeric_limits<int>::max() &&
                    std::all_of(checkpoint.state.begin(), checkpoint.state.end(), finite);
  if (!sane) throw Failure("holds a state that no run can have");
}

// Removes the oldest checkpoints of this out_file, `just_written` excepted, until `keep` are left. What cannot be
// removed is left behind without complaint: it harms nobody.
void prune(const std::string& out_file, const std::string& just_written, std::int64_t keep) {
  const std::string folder = paths::folder(out_file), prefix = paths::file(stem(out_file)) + ".chk-", suffix = ".h5";
  std::vector<std::tuple<std::int64_t, std::int64_t, std::string>> found;  // seconds, nanoseconds, name
  DIR* directory = opendir(folder.c_str());
  if (!directory) return;
  while (const dirent* entry = readdir(directory)) {
    const std::string name = entry->d_name;
    if (name.size() <= prefix.size() + suffix.size() || name.compare(0, prefix.size(), prefix) != 0 ||
        name.compare(name.size() - suffix.size(), suffix.size(), suffix) != 0)
      continue;
    const std::string digits = name.substr(prefix.size(), name.size() - prefix.size() - suffix.size());
    if (digits.find_first_not_of("0123456789") != std::string::npos) continue;
    std::string path = folder;
    path += "/" + name;
    struct stat at {};
    if (name == paths::file(just_written) || stat(path.c_str(), &at) != 0 || !S_ISREG(at.st_mode)) continue;
    found.emplace_back(at.st_mtim.tv_sec, at.st_mtim.tv_nsec, std::move(path));
  }
  closedir(directory);
  std::sort(found.rbegin(), found.rend());
  for (std::size_t k = 0; k < found.size(); ++k)
    if (static_cast<std::int64_t>(k) + 1 >= keep) unlink(std::get<2>(found[k]).c_str());
}

}  // namespace

std::string checkpoint_name(const std::string& out_file, std::int64_t step) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "%06lld", static_cast<long long>(step));
  return stem(out_file) + ".chk-" + digits + ".h5";
}

std::string write_checkpoint(const std::string& out_file, std::int64_t keep, const Provenance& provenance,
                             const Checkpoint& checkpoint, Gather& gather, Vec state) {
  std::string path = checkpoint_name(out_file, checkpoint.step);
  const std::vector<double> values = gather.interleaved(state);
  on_root(PETSC_COMM_WORLD, [&] {
    const std::string temporary = paths::hidden_sibling(path);
    unlink(temporary.c_str());
    try {
      write_file(temporary, provenance, checkpoint, values);
      paths::publish(temporary, path);
    } catch (const Failure& e) {
      unlink(temporary.c_str());
      std::string text = e.what();
      const std::size_t at = text.find(temporary);
      if (at != std::string::npos) text.replace(at, temporary.size(), path);
      throw Failure(text);
    }
    prune(out_file, path, keep);
  });
  return path;
}

Checkpoint read_checkpoint(const std::string& path) {
  Checkpoint checkpoint;
  on_root(PETSC_COMM_WORLD, [&] {
    const std::string label = "restart '" + path + "': ";
    struct stat at {};
    if (stat(path.c_str(), &at) != 0) throw UsageError(label + std::strerror(errno));
    if (!S_ISREG(at.st_mode)) throw UsageError(label + "is not a file");
    try {
      const std::string block = read_block(path);
      if (block.compare(0, std::strlen(magic), magic) != 0)
        throw Failure("is not a checkpoint of this program (they are called NAME.chk-NUMBER.h5)");
      if (block != block_text(checksum(path))) throw Failure("is damaged (its checksum does not fit)");
      const auto read = [&] { read_file(path, checkpoint); };
      if (!h5::survives(read)) throw Failure("is damaged");
      read();
    } catch (const std::exception& e) {
      throw UsageError(label + e.what());
    }
  });
  h5::broadcast(checkpoint.header);
  MPI_Bcast(&checkpoint.ranks, 1, MPI_INT, 0, PETSC_COMM_WORLD);
  MPI_Bcast(&checkpoint.t, 1, MPI_DOUBLE, 0, PETSC_COMM_WORLD);
  MPI_Bcast(&checkpoint.dt, 1, MPI_DOUBLE, 0, PETSC_COMM_WORLD);
  MPI_Bcast(&checkpoint.step, 1, MPI_INT64_T, 0, PETSC_COMM_WORLD);
  broadcast(checkpoint.texts);
  broadcast(checkpoint.numbers);
  broadcast(checkpoint.arrays);
  return checkpoint;
}

}  // namespace stickslip
