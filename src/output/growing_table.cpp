#include "output/growing_table.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "base/paths.hpp"
#include "output/datasets.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip::h5 {

namespace {

const hsize_t largest_chunk = hsize_t(1) << 30;  // bytes; the format ends at 4 GiB

}  // namespace

hsize_t GrowingTable::row_width() const {
  hsize_t sum = 0;
  for (const Column& column : columns) sum += width(column);
  return sum;
}

void GrowingTable::append(double t, const std::vector<const double*>& row) {
  if (row.size() != (by_ranks ? 0 : columns.size() - 1))
    throw std::logic_error("a row of another length than its table");
  columns[0].pending.push_back(t);
  for (std::size_t k = 0; k < row.size(); ++k) {
    Column& column = columns[k + 1];
    column.pending.insert(column.pending.end(), row[k], row[k] + width(column));
  }
  ++pending;
}

void GrowingTable::check_rows(hsize_t rows) const {
  if (rows > most_rows)
    throw Failure("a table of a file has at most " + std::to_string(most_rows) + " rows, and " +
                  (group.empty() ? "that of the frames" : "`" + group + "`") + " would have " +
                  std::to_string(rows) + "; " +
                  (group == "series" ? "leave it out (-out_series false)" : "ask for fewer"));
}

void GrowingTable::forget_pending() {
  pending = 0;
  for (Column& column : columns) column.pending.clear();
}

void GrowingTable::create(hid_t file) {
  check_rows(capacity);
  const Id parents(H5Pcreate(H5P_LINK_CREATE));
  H5Pset_create_intermediate_group(parents, 1);
  Id made;  // the group of a table may lie in that of another
  if (!group.empty() && !exists(file, group))
    made = Id(H5Gcreate2(file, group.c_str(), parents, H5P_DEFAULT, H5P_DEFAULT));
  Id x_scale;
  if (x.size > 0) {
    x_scale = create_axis(file);
    make_scale(x_scale, x.field.name);
  }
  // One row is there from the start, since only chunks within the extents are allocated.
  extent = capacity > 0 ? 1 : 0;
  for (Column& column : columns) create_column(file, column, x_scale);
}

Id GrowingTable::create_axis(hid_t file) const {
  Field field = x.field;
  field.name = path(field.name);
  return write_line(file, field, x.size, x.at);
}

void GrowingTable::create_column(hid_t file, Column& column, hid_t x_scale) {
  const hsize_t rows = std::max<hsize_t>(capacity, 1), wide = width(column);
  const int rank = column.wide ? 2 : 1;
  const hsize_t dims[2] = {extent, wide}, most[2] = {H5S_UNLIMITED, wide};
  const hsize_t chunk[2] = {rows, std::clamp<hsize_t>(largest_chunk / (8 * rows), 1, wide)};
  const Id space(H5Screate_simple(rank, dims, most)), creation = dataset_creation(),
                                                      access(H5Pcreate(H5P_DATASET_ACCESS));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  H5Pset_chunk(creation, rank, chunk);
  // never written; a reader pads shorter datasets with it
  H5Pset_fill_value(creation, H5T_NATIVE_DOUBLE, &nan);
  H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY);
  H5Pset_fill_time(creation, H5D_FILL_TIME_NEVER);  // keeps the file sparse
  H5Pset_chunk_cache(access, 0, 0, 0);              // what is read is what the file holds
  column.dataset = create_dataset(file, path(column.field.name), H5T_NATIVE_DOUBLE, space, creation, access);
  describe(column.dataset, column.field);
  column.place = {wide, chunk[1], {}};
  for (hsize_t at = 0; capacity > 0 && at < wide; at += chunk[1]) {
    const hsize_t offset[2] = {0, at};
    hsize_t size = 0;
    haddr_t address = HADDR_UNDEF;
    unsigned filters = 0;
    if (H5Dget_chunk_info_by_coord(column.dataset, offset, &filters, &address, &size) < 0 ||
        address == HADDR_UNDEF)
      fail("find the place of " + column.field.name + " in", file);
    column.place.chunks.push_back(address);
  }
  if (&column == &columns[0]) {
    make_scale(column.dataset, column.field.name);
  } else {
    attach_scale(column.dataset, columns[0].dataset, 0);
    if (column.wide) attach_scale(column.dataset, x_scale, 1);
  }
}

// A write through the library would need the extents first, and could not take them back on a full disk. The
// format of the values is that of this machine.
void GrowingTable::write_pending(int descriptor) {
  if (pending == 0) return;
  const auto put = [&](std::int64_t at, const double* values, hsize_t count) {
    paths::write_all(descriptor, values, count * sizeof(double), at);
  };
  for (const Column& column : columns)
    if (!(by_ranks && column.wide)) column.place.put_rows(written, pending, column.pending.data(), put);
  written += pending;
  forget_pending();
  if (written > extent) set_extent(written);
}

// Time last: whatever it counts is complete in the other columns, wherever a reader or a kill comes between.
void GrowingTable::set_extent(hsize_t rows) {
  for (std::size_t k = columns.size(); k-- > 0;) {
    const hsize_t dims[2] = {rows, width(columns[k])};
    if (H5Dset_extent(columns[k].dataset, dims) < 0) fail("extend", columns[k].dataset);
  }
  extent = rows;
}

void GrowingTable::show() {
  for (std::size_t k = columns.size(); k-- > 0;)
    if (H5Dflush(columns[k].dataset) < 0) fail("write", columns[k].dataset);
}

void GrowingTable::close() {
  for (Column& column : columns) column.dataset.reset();
}

}  // namespace stickslip::h5
