#include "stickslip/output/checkpoint.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/json.hpp"
#include "base/process.hpp"
#include "output/hdf5_tools.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"

namespace stickslip {

namespace {

namespace fs = std::filesystem;
using h5::Id;

const hsize_t block_size = 512;                             // the smallest user block
constexpr std::int64_t most_steps = 9'000'000'000'000'000;  // as of ts_max_steps
const char* const magic = "stickslip checkpoint";

// "DIR/NAME" of out_file without its ending: what the names of its checkpoints begin with.
std::string stem(const std::string& out_file) { return fs::path(out_file).replace_extension().string(); }

struct Checksum {
  std::uint64_t sum = 0, bytes = 0;
};

// Of the file from the user block on: FNV-1a of 64 bits, on eight lanes of words side by side, since each
// product waits for the one before it; bytes behind the last whole block of lanes go into the first lane one
// by one.
Checksum checksum(const std::string& path) {
  constexpr std::uint64_t basis = 1469598103934665603u, prime = 1099511628211u;
  constexpr std::size_t lanes = 8, block = lanes * sizeof(std::uint64_t);
  const paths::Descriptor file(path, O_RDONLY);
  std::array<std::uint64_t, lanes> lane;
  lane.fill(basis);
  std::uint64_t count = 0;
  std::vector<unsigned char> buffer(1 << 18);
  for (;;) {
    std::size_t got = 0;  // the whole buffer but at the end
    while (const std::size_t part = paths::read_some(file, buffer.data() + got, buffer.size() - got,
                                                     static_cast<std::int64_t>(block_size + count + got)))
      got += part;
    const std::size_t whole = got / block * block;
    for (std::size_t at = 0; at < whole; at += block) {
      std::uint64_t words[lanes];
      std::memcpy(words, buffer.data() + at, block);
      for (std::size_t k = 0; k < lanes; ++k) lane[k] = (lane[k] ^ words[k]) * prime;
    }
    for (std::size_t at = whole; at < got; ++at) lane[0] = (lane[0] ^ buffer[at]) * prime;
    count += got;
    if (got < buffer.size()) break;
  }
  std::uint64_t sum = basis;
  for (const std::uint64_t part : lane) sum = (sum ^ part) * prime;
  return {sum, count};
}

std::string block_text(const Checksum& sum) {
  return fmt::format("{}\nfnv1a64x8 {:016x}\nbytes {}\n", magic, sum.sum, sum.bytes);
}

std::string read_block(const std::string& path) {
  std::array<char, block_size> buffer{};
  paths::read_some(paths::Descriptor(path, O_RDONLY), buffer.data(), buffer.size() - 1, 0);
  return buffer.data();
}

// Everything but the values of the fields, for which there is room; where each of them begins.
std::vector<std::int64_t> write_frame_of(const std::string& temporary, const Provenance& provenance,
                                         const Checkpoint& checkpoint, const std::vector<hsize_t>& sizes) {
  double bytes = 0;
  for (const auto& [name, values] : checkpoint.arrays) bytes += 8.0 * double(values.size());
  for (const hsize_t size : sizes) bytes += 8.0 * double(size);
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
  std::vector<std::int64_t> places;
  auto size = sizes.begin();
  for (const auto& field : checkpoint.fields) {
    const Id space(H5Screate_simple(1, &*size++, nullptr)), creation = h5::dataset_creation();
    H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY);
    H5Pset_fill_time(creation, H5D_FILL_TIME_NEVER);
    const Id dataset =
        h5::create_dataset(file, "fields/" + field.first, H5T_NATIVE_DOUBLE, space, creation, H5P_DEFAULT);
    const haddr_t at = H5Dget_offset(dataset);
    if (at == HADDR_UNDEF) h5::fail("find the place of " + field.first + " in", file);
    places.push_back(static_cast<std::int64_t>(at));
  }
  if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0 || H5Fclose(file.release()) < 0) h5::fail("write", temporary);
  return places;
}

// The values of all ranks' nodes, by rank 0; where each has all of them, its own.
void write_fields(const std::string& temporary, const std::vector<std::int64_t>& places,
                  const Checkpoint& checkpoint, const NodeRange& nodes) {
  const bool is_root = rank_in(PETSC_COMM_WORLD) == 0;
  std::optional<paths::Descriptor> file;
  on_root(PETSC_COMM_WORLD, [&] { file.emplace(temporary, O_WRONLY, "write"); });
  collect(
      PETSC_COMM_WORLD,
      [&](const Give& give) {
        Piece piece;
        for (const auto& [name, values] : checkpoint.fields) {
          const auto each = std::int64_t(values.size()) / nodes.count;
          piece.first = nodes.first * each;
          piece.count = std::int64_t(values.size());
          if (nodes.comm != PETSC_COMM_SELF || is_root) give(piece, values.data());
          ++piece.list;
        }
      },
      [&](const Piece& piece, const double* values) {
        const std::int64_t at = places[std::size_t(piece.list)] + piece.first * std::int64_t(sizeof(double));
        paths::write_all(*file, values, std::size_t(piece.count) * sizeof(double), at);
      });
}

// Brings a file that is complete to disk and under its name.
void finish_file(const std::string& temporary, const std::string& path) {
  const std::string block = block_text(checksum(temporary));
  paths::write_all(paths::Descriptor(temporary, O_WRONLY), block.data(), block.size(), 0);
  paths::sync(temporary);
  paths::publish(temporary, path);
}

// On one rank; throws Failure.
void read_file(const std::string& path, Checkpoint& checkpoint) {
  const Id file = h5::open_file(path);
  checkpoint.header = h5::read_header(file);
  if (checkpoint.header.kind != "checkpoint") throw Failure("is no checkpoint");
  if (checkpoint.header.version != version())
    throw Failure("was written by version " + checkpoint.header.version +
                  " of this program, and this is version " + version() +
                  "; go on with the version that wrote it");
  checkpoint.ranks = static_cast<int>(h5::read_integer_attribute(file, "ranks"));
  checkpoint.t = h5::read_real_attribute(file, "t");
  checkpoint.dt = h5::read_real_attribute(file, "dt");
  checkpoint.step = h5::read_integer_attribute(file, "step");
  checkpoint.texts = parse_text_map(h5::read_text_attribute(file, "texts"));
  const Id numbers = h5::open_group(file, "numbers");
  for (const std::string& name : h5::attribute_names(numbers))
    checkpoint.numbers[name] = h5::read_real_attribute(numbers, name);
  for (const std::string& name : h5::members(file, "arrays"))
    checkpoint.arrays[name] = h5::read_reals(file, "arrays/" + name);
  // Of the fields, which are read later, here only so much as shows whether the library can.
  for (const std::string& name : h5::members(file, "fields")) {
    const Id dataset = h5::open_dataset(file, "fields/" + name);
    const std::vector<hsize_t> size = dataset ? h5::extents(dataset) : std::vector<hsize_t>{};
    if (size.size() != 1) throw Failure("is damaged (its field '" + name + "')");
    if (size[0] > 0) (void)h5::read_rows(dataset, size[0] - 1, 1, 1);
  }
  const auto finite = [](double x) { return std::isfinite(x); };
  const bool sane = finite(checkpoint.t) && checkpoint.t >= 0 && finite(checkpoint.dt) && checkpoint.dt > 0 &&
                    checkpoint.step >= 0 && checkpoint.step <= most_steps;
  if (!sane) throw Failure("holds a state that no run can have");
}

// Removes the oldest checkpoints of this out_file, `just_written` excepted, until `keep` are left. What
// cannot be removed is left behind without complaint: it harms nobody.
void prune(const std::string& out_file, const std::string& just_written, std::int64_t keep) {
  const std::string prefix = paths::file(stem(out_file)) + ".chk-";
  std::vector<std::pair<fs::file_time_type, fs::path>> found;
  try {
    for (const fs::directory_entry& entry : fs::directory_iterator(paths::folder(out_file))) {
      const std::string name = entry.path().stem();
      const bool numbered = name.size() > prefix.size() && name.compare(0, prefix.size(), prefix) == 0 &&
                            name.find_first_not_of("0123456789", prefix.size()) == std::string::npos;
      if (numbered && entry.path().extension() == ".h5" &&
          entry.path().filename() != paths::file(just_written) && entry.is_regular_file())
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
  return fmt::format("{}.chk-{:06}.h5", stem(out_file), step);
}

std::vector<double> Checkpoint::field(const std::string& name, const NodeRange& nodes, int each) const {
  if (path.empty()) return fields.at(name);
  Id file, dataset;
  on_root(PETSC_COMM_WORLD, [&] {
    file = h5::open_file(path);
    dataset = h5::open_dataset(file, "fields/" + name);
    if (!dataset || h5::extents(dataset) != std::vector<hsize_t>{hsize_t(nodes.all) * hsize_t(each)})
      throw std::runtime_error("its field '" + name + "' does not fit the scene");
  });
  std::vector<double> values(std::size_t(nodes.count) * std::size_t(each));
  scatter(PETSC_COMM_WORLD, nodes.first * each, nodes.count * each, values.data(),
          [&](std::int64_t first, std::int64_t count, double* into) {
            const std::vector<double> piece = h5::read_rows(dataset, hsize_t(first), hsize_t(count), 1);
            std::copy(piece.begin(), piece.end(), into);
          });
  return values;
}

std::string write_checkpoint(const std::string& out_file, std::int64_t keep, const Provenance& provenance,
                             const Checkpoint& checkpoint, const NodeRange& nodes) {
  std::string path = checkpoint_name(out_file, checkpoint.step);
  const std::string temporary = paths::hidden_sibling(path);
  std::vector<hsize_t> sizes;
  for (const auto& [name, values] : checkpoint.fields) {
    if (nodes.count == 0 || values.size() % std::size_t(nodes.count) != 0)
      throw RankFailure("the field '" + name +
                        "' of a checkpoint has another number of nodes than the scene");
    sizes.push_back(hsize_t(nodes.all) * (values.size() / hsize_t(nodes.count)));
  }
  std::vector<std::int64_t> places;
  try {
    on_root(PETSC_COMM_WORLD, [&] {
      unlink(temporary.c_str());
      h5::naming(path, [&] { places = write_frame_of(temporary, provenance, checkpoint, sizes); });
    });
    h5::naming(path, [&] { write_fields(temporary, places, checkpoint, nodes); });
    on_root(PETSC_COMM_WORLD, [&] { h5::naming(path, [&] { finish_file(temporary, path); }); });
  } catch (...) {
    if (rank_in(PETSC_COMM_WORLD) == 0) unlink(temporary.c_str());
    throw;
  }
  on_root(PETSC_COMM_WORLD, [&] { prune(out_file, path, keep); });
  return path;
}

Checkpoint read_checkpoint(const std::string& path) {
  Checkpoint checkpoint;
  const auto check = [&] {
    const std::string block = read_block(path);
    if (block.compare(0, std::strlen(magic), magic) != 0)
      throw Failure("is not a checkpoint of this program (they are called NAME.chk-NUMBER.h5)");
    if (block.find("\nfnv1a64 ") != std::string::npos)
      throw Failure("was written by an earlier revision of this program; go on with the one that wrote it");
    if (block != block_text(checksum(path))) throw Failure("is damaged (its checksum does not fit)");
  };
  h5::read_from_outside("restart", path, check, [&] { read_file(path, checkpoint); });
  h5::broadcast(checkpoint.header);
  broadcast_all(checkpoint.ranks, checkpoint.t, checkpoint.dt, checkpoint.step, checkpoint.texts,
                checkpoint.numbers, checkpoint.arrays);
  checkpoint.path = path;
  return checkpoint;
}

namespace {

[[noreturn]] void does_not_fit(const std::string& name) {
  throw std::runtime_error("its '" + name + "' does not fit");
}

}  // namespace

double NumberList::next() {
  if (at_ == numbers_.size()) does_not_fit(name_);
  return numbers_[at_++];
}

double NumberList::next_integer(double least, double most) {
  const double value = next();
  if (!(value >= least && value <= most && value < 9e18 && value == std::floor(value))) does_not_fit(name_);
  return value;
}

NumberList Archive::begin(const std::string& name, bool is_list) const {
  if (to_) return {name, {}, false};
  if (const auto found = from_->arrays.find(name); is_list && found != from_->arrays.end())
    return {name, found->second, true};
  if (const auto found = from_->numbers.find(name); !is_list && found != from_->numbers.end())
    return {name, {found->second}, true};
  throw std::runtime_error("it has no '" + name + "'");
}

void Archive::end(NumberList& x, bool is_list) {
  if (from_ && x.at_ < x.numbers_.size()) does_not_fit(x.name_);
  if (to_ && is_list) to_->arrays[x.name_] = std::move(x.numbers_);
  if (to_ && !is_list) to_->numbers[x.name_] = x.numbers_[0];
}

void Archive::operator()(const std::string& name, Vec values) {
  if (to_) {
    to_->fields[name] = local_values(values);
    return;
  }
  PetscInt size;
  SS_TRY(VecGetLocalSize(values, &size));
  const std::vector<double> own = from_->field(name, nodes_, int(size / nodes_.count));
  std::copy(own.begin(), own.end(), static_cast<double*>(Writing(values)));
}

void Archive::nodes(const std::string& name, const std::vector<std::vector<double>*>& lists) {
  const std::size_t each = lists.size(), count = std::size_t(nodes_.count);
  std::vector<double> all(each * count);
  if (from_) all = from_->field(name, nodes_, int(each));
  for (std::size_t k = 0; k < each; ++k) {
    lists[k]->resize(count);
    for (std::size_t i = 0; i < count; ++i)
      (from_ ? (*lists[k])[i] : all[i * each + k]) = from_ ? all[i * each + k] : (*lists[k])[i];
  }
  if (to_) to_->fields[name] = std::move(all);
}

void Archive::spread(const std::string& name, std::size_t all, const std::vector<Own>& own) {
  std::vector<double> numbers(all);
  if (to_) {
    for (const Own& one : own) numbers[one.place] = *one.value;
    // every number has one owner, and elsewhere all its bits are 0
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, numbers.data(), int(all), MPI_UINT64_T, MPI_BOR, nodes_.comm));
  }
  list(name, [&](NumberList& x) { x(numbers); });
  for (const Own& one : own) *one.value = numbers[one.place];
}

void Archive::by_rank(const std::string& name, std::vector<double>& own) {
  const std::size_t size = own.size(), ranks = std::size_t(ranks_in(nodes_.comm));
  std::vector<double> all(to_ ? size * ranks : 0);
  if (to_)
    SS_TRY(MPI_Allgather(own.data(), int(size), MPI_DOUBLE, all.data(), int(size), MPI_DOUBLE, nodes_.comm));
  (*this)(name, all);
  if (to_) return;
  if (size == 0 ? !all.empty() : all.size() % size != 0) does_not_fit(name);
  if (size == 0) return;
  const std::size_t rank = std::size_t(rank_in(nodes_.comm));
  own.assign(size, 0.);
  for (std::size_t k = 0; k < all.size(); ++k)
    if (rank == (all.size() == size * ranks ? k / size : 0)) own[k % size] += all[k];
}

}  // namespace stickslip
