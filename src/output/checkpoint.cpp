#include "stickslip/output/checkpoint.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
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

namespace fs = std::filesystem;
using h5::Id;

const hsize_t block_size = 512;  // the smallest user block
const char* const magic = "stickslip checkpoint";

// "DIR/NAME" of out_file without its ending: what the names of its checkpoints begin with.
std::string stem(const std::string& out_file) { return fs::path(out_file).replace_extension().string(); }

// FNV-1a, 64 bits, of the file from the user block on; and how many bytes those are.
std::pair<std::uint64_t, std::uint64_t> checksum(const std::string& path) {
  const paths::Descriptor file(path, O_RDONLY);
  std::uint64_t sum = 1469598103934665603u, count = 0;
  std::vector<unsigned char> buffer(1 << 18);
  while (const std::size_t got =
             paths::read_some(file, buffer.data(), buffer.size(), static_cast<std::int64_t>(block_size + count))) {
    for (std::size_t k = 0; k < got; ++k) sum = (sum ^ buffer[k]) * 1099511628211u;
    count += got;
  }
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
  paths::read_some(paths::Descriptor(path, O_RDONLY), buffer.data(), buffer.size() - 1, 0);
  return buffer.data();
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
  paths::write_all(paths::Descriptor(temporary, O_WRONLY), block.data(), block.size(), 0);
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
  const std::string prefix = paths::file(stem(out_file)) + ".chk-";
  std::vector<std::pair<fs::file_time_type, fs::path>> found;
  try {
    for (const fs::directory_entry& entry : fs::directory_iterator(paths::folder(out_file))) {
      const std::string name = entry.path().stem();
      const bool numbered = name.size() > prefix.size() && name.compare(0, prefix.size(), prefix) == 0 &&
                            name.find_first_not_of("0123456789", prefix.size()) == std::string::npos;
      if (numbered && entry.path().extension() == ".h5" && entry.path().filename() != paths::file(just_written) &&
          entry.is_regular_file())
        found.emplace_back(entry.last_write_time(), entry.path());
    }
    std::sort(found.rbegin(), found.rend());
    for (std::size_t k = 0; k < found.size(); ++k)
      if (static_cast<std::int64_t>(k) + 1 >= keep) fs::remove(found[k].second);
  } catch (const fs::filesystem_error&) {
    // as said above
  }
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
    h5::naming(path, [&] {
      try {
        write_file(temporary, provenance, checkpoint, values);
        paths::publish(temporary, path);
      } catch (...) {
        unlink(temporary.c_str());
        throw;
      }
    });
    prune(out_file, path, keep);
  });
  return path;
}

Checkpoint read_checkpoint(const std::string& path) {
  Checkpoint checkpoint;
  const auto check = [&] {
    const std::string block = read_block(path);
    if (block.compare(0, std::strlen(magic), magic) != 0)
      throw Failure("is not a checkpoint of this program (they are called NAME.chk-NUMBER.h5)");
    if (block != block_text(checksum(path))) throw Failure("is damaged (its checksum does not fit)");
  };
  h5::read_from_outside("restart", path, check, [&] { read_file(path, checkpoint); });
  h5::broadcast(checkpoint.header);
  broadcast(checkpoint.ranks);
  broadcast(checkpoint.t);
  broadcast(checkpoint.dt);
  broadcast(checkpoint.step);
  broadcast(checkpoint.texts);
  broadcast(checkpoint.numbers);
  broadcast(checkpoint.arrays);
  return checkpoint;
}

}  // namespace stickslip
