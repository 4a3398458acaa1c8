// Rows against time in one group of an HDF5 file that grows and can be read meanwhile (run_file.hpp says
// how). Rank 0 only, but for ColumnPlace; what fails throws Failure.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "output/hdf5_tools.hpp"
#include "stickslip/output/field.hpp"

namespace stickslip::h5 {

// Where the values of a column lie in the file: in chunks, side by side, each with room for all rows.
struct ColumnPlace {
  hsize_t wide = 1, chunk_width = 1;  // values a row, and in a row of a chunk
  std::vector<haddr_t> chunks = {};   // where the chunks begin

  // Hands the values first ... first + count - 1 of one row to put(at, values, count), at being bytes in the
  // file.
  template <class Put>
  void put_row(hsize_t row, hsize_t first, hsize_t count, const double* values, const Put& put) const {
    for (hsize_t done = 0; done < count;) {
      const hsize_t c = (first + done) / chunk_width, in_chunk = (first + done) % chunk_width;
      const hsize_t part = std::min(chunk_width - in_chunk, count - done);
      put(static_cast<std::int64_t>(chunks[c] + (row * chunk_width + in_chunk) * sizeof(double)),
          values + done, part);
      done += part;
    }
  }
  // Whole rows.
  template <class Put>
  void put_rows(hsize_t row, hsize_t count, const double* values, const Put& put) const {
    if (chunks.size() == 1) {
      put(static_cast<std::int64_t>(chunks[0] + row * wide * sizeof(double)), values, count * wide);
    } else {
      for (hsize_t k = 0; k < count; ++k) put_row(row + k, 0, wide, values + k * wide, put);
    }
  }
};

// Column 0 is t; the others hold one value or, if wide, one for each place along x in a row.
struct Column {
  Field field;
  bool wide = false;
  Id dataset = {};
  std::vector<double> pending = {};  // rows not yet written
  ColumnPlace place = {};
};

// Places along x, in order; a long list is never held.
struct Axis {
  Field field = {};
  hsize_t size = 0;
  std::function<double(std::int64_t)> at = {};
};

struct GrowingTable {
  // a chunk has room for all rows and less than 4 GiB
  static constexpr hsize_t most_rows = (hsize_t(1) << 29) - 1;

  // A table of one column, t, in the group of this name; `rows`: for which the file will have room.
  GrowingTable(std::string name, hsize_t rows, Field t) : group(std::move(name)), capacity(rows) {
    columns.push_back({std::move(t)});
  }

  std::string path(const std::string& name) const { return group.empty() ? name : group + "/" + name; }
  hsize_t width(const Column& column) const { return column.wide ? x.size : 1; }
  hsize_t row_width() const;  // values in a row, t included

  // Adds a row to those in memory: t, then a pointer to the values of each of the other columns; t alone
  // where ranks write the others.
  void append(double t, const std::vector<const double*>& row);

  void forget_pending();  // rows in memory

  void check_rows(hsize_t rows) const;  // throws Failure where they are too many for a table

  // Makes the datasets, with room for `capacity` rows and one row there already.
  void create(hid_t file);
  // Writes the rows in memory, then the extents in memory.
  void write_pending(int descriptor);
  // Lengthens (or, before anybody reads, shortens) the extents in memory; readers see them after show().
  void set_extent(hsize_t rows);
  // Lets readers see the extents: one small write in place for each dataset.
  void show();
  void close();  // the datasets

  std::string group;  // "" is the root
  Axis x = {};
  bool by_ranks = false;  // they write the wide columns, which are none of append()'s and write_pending()'s
  std::vector<Column> columns = {};
  hsize_t capacity;
  hsize_t written = 0;  // rows in the file
  hsize_t extent = 0;   // rows that the extents in memory name: 1 in a table just made, else `written`
  hsize_t pending = 0;  // rows in memory

 private:
  void create_column(hid_t file, Column& column, hid_t x_scale);
  Id create_axis(hid_t file) const;
};

}  // namespace stickslip::h5
