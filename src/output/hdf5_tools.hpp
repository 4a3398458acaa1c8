// The HDF5 C API with owners and exceptions, and datasets with units and dimension scales, as every file of
// this program has them. Rank 0 only, no parallel HDF5.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/process.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/provenance.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"

namespace stickslip::h5 {

// The HDF5 C API with owners and exceptions. Rank 0 only, no parallel HDF5.

// Owner of any HDF5 identifier.
class Id {
 public:
  Id() = default;
  explicit Id(hid_t id) : id_(id) {}
  Id(Id&& other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Id& operator=(Id&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  Id(const Id&) = delete;
  Id& operator=(const Id&) = delete;
  ~Id() { reset(); }
  operator hid_t() const { return id_; }  // NOLINT: an owner stands for its identifier
  explicit operator bool() const { return id_ >= 0; }
  void reset();  // closes, ignoring errors
  hid_t release() { return std::exchange(id_, -1); }

 private:
  hid_t id_ = -1;
};

// Throws Failure "cannot DO 'PATH': WHY", WHY from the error stack of the library (which prints nothing
// itself); the second form names the file that the object is in.
[[noreturn]] void fail(const std::string& doing, const std::string& path);
[[noreturn]] void fail(const std::string& doing, hid_t object);

constexpr hsize_t largest_piece = stickslip::largest_piece;

// Turns off the library's own printing of errors; to be called before anything else of HDF5.
void quiet();

// A new file of the oldest format, which has no flags that a killed writer leaves set, and that readers may
// open while it is written (no lock, no metadata evicted between flushes). An old file of that name is
// removed, never written into. Disk space for the metadata and for `bytes` of data that are to be written at
// once is taken first, so that a full disk shows here and as Failure: the library crashes at exit when it
// could not write its metadata. `sparse`: the bytes for which the file will have room beyond those.
Id create_file(const std::string& path, double bytes, hsize_t user_block = 0, double sparse = 0);
Id open_file(const std::string& path);  // for reading; throws Failure

Id text_type();  // of texts of any length, UTF-8
void write_attribute(hid_t object, const std::string& name, const std::string& text);
void write_attribute(hid_t object, const std::string& name, double value);
void write_attribute(hid_t object, const std::string& name, std::int64_t value);
bool has_attribute(hid_t object, const std::string& name);
// A link, each group on the way included. Only what lies in the file itself exists: soft and external links
// throw Failure, so that no file but the one named is opened.
bool exists(hid_t file, const std::string& path);
Id open_group(hid_t file, const std::string& group);  // throws Failure where there is none
// Of numbers that lie in the file itself; nothing where there is no such dataset. Throws Failure where its
// values are elsewhere (external storage, virtual datasets), are no numbers, or lie in chunks of more than
// 64 MB.
Id open_dataset(hid_t file, const std::string& path);
// How many values may be read of a file: one a byte, or 2^24 where it is shorter (compressed).
hsize_t most_values(hid_t file);
// These throw Failure where the attribute is missing or of another type.
std::string read_text_attribute(hid_t object, const std::string& name);
double read_real_attribute(hid_t object, const std::string& name);
std::int64_t read_integer_attribute(hid_t object, const std::string& name);

std::vector<hsize_t> extents(hid_t dataset);
// The whole dataset.
std::vector<double> read_reals(hid_t file, const std::string& name);
// Rows of a dataset of (t) or (t, x).
std::vector<double> read_rows(hid_t dataset, hsize_t first, hsize_t count, hsize_t width);
// Of (t, x), so many columns of so many rows; of (x), the rows.
std::vector<double> read_block(hid_t dataset, hsize_t row, hsize_t rows, hsize_t column, hsize_t columns);

std::vector<std::string> attribute_names(hid_t object);

// Names of what lies in a group of the file itself, sorted.
std::vector<std::string> members(hid_t file, const std::string& group);

// Opens a file from outside on rank 0: check(), which throws Failure where it is not what it should be, then
// read(), first in a child process. Whatever is wrong becomes UsageError `WHAT 'PATH': ...` on every rank.
// Collective.
void read_from_outside(const std::string& what, const std::string& path, const std::function<void()>& check,
                       const std::function<void()>& read);

// Whether act() comes to an end in a child process, by an exception or not: damaged files can crash the
// library or make it run for ever. For files from outside, before they are read in earnest.
bool survives(const std::function<void()>& act);

// The root attributes that every file of this program carries.
void write_header(hid_t file, const Provenance& provenance, const std::string& kind);
FileHeader read_header(hid_t file);  // throws Failure where the file is not ours
void broadcast(FileHeader& header);  // collective on PETSC_COMM_WORLD

// Datasets with units and dimension scales, as every file of this program has them. Rank 0 only.

// A new dataset, its groups made where they are missing; an old one of the name is a mistake in the program.
// All of these throw Failure.
Id create_dataset(hid_t file, const std::string& name, hid_t type, hid_t space, hid_t creation, hid_t access);
// No times in the headers: with them every write would change more than the extents.
Id dataset_creation();
// Attributes units and long_name, where there are any.
void describe(hid_t dataset, const Field& field);
// Doubles, row-major, written at once; no dims: a scalar.
Id write_fixed(hid_t file, const Field& field, const std::vector<hsize_t>& dims,
               const std::vector<double>& values);
// Doubles along x, made piece by piece: a long list is never held.
Id write_line(hid_t file, const Field& field, hsize_t size, const std::function<double(std::int64_t)>& at);
void make_scale(hid_t dataset, const std::string& name);
void attach_scale(hid_t dataset, hid_t scale, unsigned dimension);

// Errors name the file that the user knows: no temporary one, and not none.
template <class Body>
void naming(const std::string& path, Body&& body) {
  try {
    body();
  } catch (const Failure& e) {
    std::string text = e.what();
    for (const char* suffix : {".tmp", ".new"}) {
      const std::string hidden = paths::hidden_sibling(path, suffix);
      const std::size_t at = text.find(hidden);
      if (at != std::string::npos) text.replace(at, hidden.size(), path);
    }
    if (text.find("'" + path + "'") == std::string::npos) text = "cannot write '" + path + "': " + text;
    throw Failure(text);
  }
}

// Rows against time in one group of an HDF5 file that grows and can be read meanwhile (run_file.hpp says
// how). Rank 0 has the datasets and writes; every rank keeps rows of its own nodes in memory until then. What
// fails throws Failure.

// Writes `count` values from byte `at` of the file on.
using Put = std::function<void(std::int64_t at, const double* values, std::size_t count)>;

// Its values lie in chunks side by side, each with room for all rows.
struct Column {
  Field field;
  hsize_t wide = 1;      // values in a row
  std::size_t kept = 1;  // of them, those that this rank gives and keeps in memory
  hsize_t chunk_width = 1;
  std::vector<haddr_t> chunks = {};  // where they begin in the file
  Id dataset = {};
  std::vector<double> pending = {};  // rows that are not yet written

  void append(const double* values) { pending.insert(pending.end(), values, values + kept); }
  // Hands the values first ... first + count - 1 of so many rows to put().
  void put(hsize_t row, hsize_t rows, hsize_t first, hsize_t count, const double* values,
           const Put& put) const;
};

// Places along x, in order; a long list is never held.
struct Axis {
  Field field = {};
  hsize_t size = 0;
  std::function<double(std::int64_t)> at = {};
};

// Rows of a table in another file.
struct EarlierRows {
  hsize_t rows = 0, wide = 1;
  std::vector<Id> datasets = {};  // for each column, empty where there is none
  // For each place along x of the new table that in the old one; empty: the same places.
  std::vector<hsize_t> places = {};

  // Of a column, in the order of the new table's places; NaN where the old one has nothing.
  std::vector<double> block(std::size_t c, hsize_t row, hsize_t count, hsize_t first, hsize_t across) const;
};

struct Table {
  // a chunk has room for all rows and less than 4 GiB
  static constexpr hsize_t most_rows = (hsize_t(1) << 29) - 1;

  // A column of t, and the fields, over x or not. Where every rank has values of these, each keeps so many of
  // a row.
  Table(std::string group, Field t, const std::vector<Field>& fields, hsize_t rows, Axis x = {});
  void keep_by_ranks(std::size_t kept);

  std::string path(const std::string& name) const { return group.empty() ? name : group + "/" + name; }
  double row_bytes() const;
  hsize_t rows() const { return written + pending; }
  void check_rows(hsize_t rows) const;  // throws where they are too many for a table
  // Adds a row to those in memory: the values of all columns but t, one behind the other.
  void append(double t, const std::vector<double>& row);
  void forget_pending();

  // Makes the datasets, with room for `capacity` rows and one row there already.
  void create(hid_t file);
  // The rows of an earlier file, called `name`, up to time `until`; `strictly`: before it.
  EarlierRows earlier(hid_t old, const std::string& name, double until, bool strictly) const;
  // The rows that it has, its datasets being to be made anew.
  EarlierRows give_up();
  // Writes them where there is nothing yet, in pieces of a megabyte.
  void take_over(const EarlierRows& from, const Put& put);
  // Writes the rows in memory of what rank 0 alone has: of the frames of all ranks t, else all columns.
  void write_pending(const Put& put) const;
  // Counts the rows in memory as written.
  void advance();
  // Lengthens (or, before anybody reads, shortens) the extents in memory; readers see them after show().
  void set_extent(hsize_t rows);
  void show();   // by one small write in place for each dataset
  void close();  // the datasets

  std::string group;  // "" is the root
  Axis x;
  bool by_ranks = false;
  std::vector<Column> columns;  // first t
  hsize_t capacity;             // rows for which the file has or will have room
  hsize_t written = 0;          // rows in the file
  hsize_t extent = 0;   // rows that the extents in memory name: 1 in a table just made, else `written`
  hsize_t pending = 0;  // rows in memory

 private:
  void create_column(hid_t file, Column& column, hid_t x_scale);
  bool has_same_axis(hid_t old) const;
};

}  // namespace stickslip::h5
