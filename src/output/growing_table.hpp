// Rows against time in one group of an HDF5 file that grows and can be read meanwhile (run_file.hpp says how). Rank 0
// only; what fails throws Failure.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "output/hdf5_tools.hpp"
#include "stickslip/output/field.hpp"

namespace stickslip::h5 {

// Column 0 is t; the others hold one value or, if wide, `x.size()` values a row.
struct Column {
  Field field;
  bool wide = false;
  Id dataset = {};
  std::vector<double> pending = {};    // rows not yet written
  hsize_t chunk_width = 1;             // values a row in one chunk
  std::vector<haddr_t> chunks = {};    // where in the file the chunks begin that lie side by side
};

struct GrowingTable {
  // A table of one column, t, in the group of this name; `rows`: for which the file will have room.
  GrowingTable(std::string name, hsize_t rows, Field t) : group(std::move(name)), capacity(rows) {
    columns.push_back({std::move(t)});
  }

  std::string path(const std::string& name) const { return group.empty() ? name : group + "/" + name; }
  hsize_t width(const Column& column) const { return column.wide ? x.size() : 1; }
  hsize_t row_width() const;     // values in a row, t included
  hsize_t rows_at_once() const;  // how many rows to copy in one go: about 8 MB a column

  // Adds a row to those in memory: t, then a pointer to the values of each of the other columns.
  void append(double t, const std::vector<const double*>& row);

  // Makes the datasets, with room for `capacity` rows and one row there already.
  void create(hid_t file);
  // Puts rows of one column where they belong in the file, beyond the extents or not.
  void put_rows(int descriptor, const Column& column, hsize_t first, hsize_t count, const double* data) const;
  // Writes the rows in memory, then the extents in memory.
  void write_pending(int descriptor);
  // Lengthens (or, before anybody reads, shortens) the extents in memory; readers see them after show().
  void set_extent(hsize_t rows);
  // Lets readers see the extents: one small write in place for each dataset.
  void show();
  void close();  // the datasets

  std::string group;  // "" is the root
  Field x_field = {};
  std::vector<double> x = {};
  std::vector<Column> columns = {};
  hsize_t capacity;
  hsize_t written = 0;  // rows in the file
  hsize_t extent = 0;   // rows that the extents in memory name: 1 in a table just made, else `written`
  hsize_t pending = 0;  // rows in memory

 private:
  void create_column(hid_t file, Column& column, hid_t x_scale);
};

}  // namespace stickslip::h5
