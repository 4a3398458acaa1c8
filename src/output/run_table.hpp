// Rows against time in one group of an HDF5 file that grows and can be read meanwhile (run_file.hpp says
// how). Rank 0 has the datasets and writes; every rank keeps rows of its own nodes in memory until then. What
// fails throws Failure.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "output/hdf5_tools.hpp"
#include "stickslip/output/field.hpp"

namespace stickslip::h5 {

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
