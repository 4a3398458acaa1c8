#include "output/run_table.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "output/hdf5_tools.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip::h5 {

namespace {

const hsize_t largest_chunk = hsize_t(1) << 30;  // bytes; the format ends at 4 GiB
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

void Column::put(hsize_t row, hsize_t rows, hsize_t first, hsize_t count, const double* values,
                 const Put& put) const {
  if (chunks.size() == 1 && count == wide)
    return put(std::int64_t(chunks[0] + row * wide * sizeof(double)), values, rows * count);
  for (hsize_t r = row; r < row + rows; ++r)
    for (hsize_t at = first, part; at < first + count; at += part, values += part) {
      const hsize_t in_chunk = at % chunk_width;
      part = std::min(chunk_width - in_chunk, first + count - at);
      put(std::int64_t(chunks[at / chunk_width] + (r * chunk_width + in_chunk) * sizeof(double)), values,
          part);
    }
}

Table::Table(std::string name, Field t, const std::vector<Field>& fields, hsize_t rows, Axis along)
    : group(std::move(name)), x(std::move(along)), capacity(rows) {
  columns.push_back({std::move(t)});
  const hsize_t wide = std::max<hsize_t>(x.size, 1);
  for (const Field& field : fields) columns.push_back({field, wide, wide});
}

void Table::keep_by_ranks(std::size_t kept) {
  by_ranks = true;
  for (std::size_t c = 1; c < columns.size(); ++c) columns[c].kept = kept;
}

double Table::row_bytes() const {
  double sum = 0;
  for (const Column& column : columns) sum += 8. * double(column.wide);
  return sum;
}

void Table::check_rows(hsize_t rows) const {
  if (rows > most_rows)
    throw Failure("a table of a file has at most " + std::to_string(most_rows) + " rows, and " +
                  (group.empty() ? "that of the frames" : "`" + group + "`") + " would have " +
                  std::to_string(rows) + "; " +
                  (group == "series" ? "leave it out (-out_series false)" : "ask for fewer"));
}

void Table::append(double t, const std::vector<double>& row) {
  if (8. * double(1 + row.size()) != row_bytes())
    throw std::logic_error("a row of another length than its table");
  columns[0].append(&t);
  const double* value = row.data();
  for (std::size_t c = 1; c < columns.size(); value += columns[c++].kept) columns[c].append(value);
  ++pending;
}

void Table::forget_pending() {
  pending = 0;
  for (Column& column : columns) column.pending.clear();
}

void Table::create(hid_t file) {
  check_rows(capacity);
  Id x_scale;
  if (x.size > 0) {
    x_scale = write_line(file, {path(x.field.name), x.field.units, x.field.long_name}, x.size, x.at);
    make_scale(x_scale, x.field.name);
  }
  // One row is there from the start, since only chunks within the extents are allocated.
  extent = capacity > 0 ? 1 : 0;
  for (Column& column : columns) create_column(file, column, x_scale);
}

void Table::create_column(hid_t file, Column& column, hid_t x_scale) {
  const bool is_field = x.size > 0 && &column != &columns[0];
  const hsize_t rows = std::max<hsize_t>(capacity, 1), wide = column.wide;
  const int rank = is_field ? 2 : 1;
  const hsize_t dims[2] = {extent, wide}, most[2] = {H5S_UNLIMITED, wide};
  const hsize_t chunk[2] = {rows, std::clamp<hsize_t>(largest_chunk / (8 * rows), 1, wide)};
  const Id space(H5Screate_simple(rank, dims, most)), creation = dataset_creation(),
                                                      access(H5Pcreate(H5P_DATASET_ACCESS));
  H5Pset_chunk(creation, rank, chunk);
  // never written; a reader pads shorter datasets with it
  H5Pset_fill_value(creation, H5T_NATIVE_DOUBLE, &nan);
  H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY);
  H5Pset_fill_time(creation, H5D_FILL_TIME_NEVER);  // keeps the file sparse
  H5Pset_chunk_cache(access, 0, 0, 0);              // what is read is what the file holds
  column.dataset = create_dataset(file, path(column.field.name), H5T_NATIVE_DOUBLE, space, creation, access);
  describe(column.dataset, column.field);
  column.chunk_width = chunk[1];
  column.chunks.clear();
  for (hsize_t at = 0; capacity > 0 && at < wide; at += chunk[1]) {
    const hsize_t offset[2] = {0, at};
    hsize_t size = 0;
    haddr_t address = HADDR_UNDEF;
    unsigned filters = 0;
    if (H5Dget_chunk_info_by_coord(column.dataset, offset, &filters, &address, &size) < 0 ||
        address == HADDR_UNDEF)
      fail("find the place of " + column.field.name + " in", file);
    column.chunks.push_back(address);
  }
  if (&column == &columns[0])
    make_scale(column.dataset, column.field.name);
  else
    attach_scale(column.dataset, columns[0].dataset, 0);
  if (is_field) attach_scale(column.dataset, x_scale, 1);
}

bool Table::has_same_axis(hid_t old) const {
  const Id dataset = open_dataset(old, path("x"));
  if (!dataset) fail("read x of", old);
  if (extents(dataset) != std::vector<hsize_t>{x.size}) return false;
  for (hsize_t first = 0; first < x.size; first += largest_piece) {
    const std::vector<double> piece = read_rows(dataset, first, std::min(largest_piece, x.size - first), 1);
    for (std::size_t k = 0; k < piece.size(); ++k)
      if (piece[k] != x.at(std::int64_t(first + k))) return false;
  }
  return true;
}

EarlierRows Table::earlier(hid_t old, const std::string& name, double until, bool strictly) const {
  EarlierRows from;
  from.datasets.resize(columns.size());
  if (!exists(old, path("t"))) return from;
  // of events whose times are by the plate's clock (load_halt): that of the run
  const std::vector<double> times = read_reals(old, path(exists(old, path("clock")) ? "clock" : "t"));
  const auto later = std::find_if(times.begin(), times.end(),
                                  [&](double t) { return strictly ? !(t < until) : !(t <= until); });
  from.rows = hsize_t(later - times.begin());
  if (by_ranks && !has_same_axis(old)) throw Failure("'" + name + "' has another grid");
  from.wide = columns.back().wide;
  if (x.size > 0 && !by_ranks) {
    const std::vector<double> places = read_reals(old, path("x"));
    from.wide = places.size();
    for (hsize_t k = 0; k < x.size; ++k)
      from.places.push_back(
          hsize_t(std::find(places.begin(), places.end(), x.at(std::int64_t(k))) - places.begin()));
  }
  for (std::size_t c = 0; c < columns.size(); ++c) {
    from.datasets[c] = open_dataset(old, path(columns[c].field.name));
    if (!from.datasets[c]) continue;
    const auto sizes = extents(from.datasets[c]);
    const bool fits = x.size > 0 && c > 0 ? sizes.size() == 2 && sizes[1] == from.wide : sizes.size() == 1;
    if (!fits || sizes[0] < from.rows)
      throw Failure("'" + name + "': " + path(columns[c].field.name) + " does not fit its t and x");
  }
  return from;
}

EarlierRows Table::give_up() {
  EarlierRows own{written};
  for (Column& column : columns) own.datasets.push_back(std::move(column.dataset));
  return own;
}

// Of a column, in the order of the new table's places.
std::vector<double> EarlierRows::block(std::size_t c, hsize_t row, hsize_t count, hsize_t first,
                                       hsize_t across) const {
  std::vector<double> values(count * across, nan);
  if (!datasets[c]) return values;
  if (c == 0 || places.empty()) return read_block(datasets[c], row, count, first, across);
  const std::vector<double> old = read_block(datasets[c], row, count, 0, wide);
  for (std::size_t k = 0; k < values.size(); ++k)
    if (const hsize_t place = places[first + k % across]; place < wide)
      values[k] = old[k / across * wide + place];
  return values;
}

void Table::take_over(const EarlierRows& from, const Put& put) {
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const Column& column = columns[c];
    const hsize_t at_once = std::max<hsize_t>(1, largest_piece / column.wide);
    for (hsize_t row = 0; row < from.rows; row += at_once)
      for (hsize_t first = 0; first < column.wide; first += largest_piece) {
        const hsize_t count = std::min(at_once, from.rows - row),
                      across = std::min(largest_piece, column.wide - first);
        column.put(row, count, first, across, from.block(c, row, count, first, across).data(), put);
      }
  }
  written = from.rows;
  if (written > extent) set_extent(written);
}

// A write through the library would need the extents first, and could not take them back on a full disk. The
// format of the values is that of this machine.
void Table::write_pending(const Put& put) const {
  for (std::size_t c = 0; c < (by_ranks ? 1 : columns.size()); ++c)
    columns[c].put(written, pending, 0, columns[c].wide, columns[c].pending.data(), put);
}

void Table::advance() {
  written += pending;
  forget_pending();
  if (columns[0].dataset && written > extent) set_extent(written);
}

// Time last: whatever it counts is complete in the other columns, wherever a reader or a kill comes between.
void Table::set_extent(hsize_t rows) {
  for (std::size_t k = columns.size(); k-- > 0;) {
    const hsize_t dims[2] = {rows, columns[k].wide};
    if (H5Dset_extent(columns[k].dataset, dims) < 0) fail("extend", columns[k].dataset);
  }
  extent = rows;
}

void Table::show() {
  for (std::size_t k = columns.size(); k-- > 0;)
    if (H5Dflush(columns[k].dataset) < 0) fail("write", columns[k].dataset);
}

void Table::close() {
  for (Column& column : columns) column.dataset.reset();
}

}  // namespace stickslip::h5
