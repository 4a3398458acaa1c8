#include "stickslip/output/result_file.hpp"

#include <unistd.h>

#include <algorithm>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>

#include "base/process.hpp"
#include "output/hdf5_tools.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/model/friction.hpp"

namespace stickslip {

using h5::Id;

struct ResultFile::Contents {
  struct Entry {
    Field field;  // its name with the group
    std::vector<std::string> dimensions;
    std::vector<double> values;
    std::vector<std::string> texts;
    bool is_text = false, is_scale = false;
  };
  std::vector<Entry> entries;
  std::vector<std::pair<std::string, std::string>> texts;
  std::vector<std::pair<std::string, double>> numbers;

  double bytes() const;  // of the data, an upper bound
  void write(hid_t file) const;
};

namespace {

Id write_texts(hid_t file, const Field& field, const std::vector<hsize_t>& dims,
               const std::vector<std::string>& texts) {
  const Id type = h5::text_type();
  const Id space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr));
  Id dataset = h5::create_dataset(file, field.name, type, space, h5::dataset_creation(), H5P_DEFAULT);
  std::vector<const char*> pointers;
  for (const std::string& text : texts) pointers.push_back(text.c_str());
  if (!pointers.empty() && H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers.data()) < 0)
    h5::fail("write", field.name);
  h5::describe(dataset, field);
  return dataset;
}

}  // namespace

ResultFile::ResultFile(MPI_Comm comm, std::string path, Provenance provenance)
    : comm_(comm), path_(std::move(path)), provenance_(std::move(provenance)),
      contents_(std::make_unique<Contents>()) {}

ResultFile::~ResultFile() = default;

void ResultFile::attribute(const std::string& name, const std::string& text) {
  contents_->texts.emplace_back(name, text);
}

void ResultFile::attribute(const std::string& name, double value) {
  contents_->numbers.emplace_back(name, value);
}

void ResultFile::scale(const Field& field, std::vector<double> values) {
  contents_->entries.push_back({field, {}, std::move(values), {}, false, true});
}

void ResultFile::scale_text(const Field& field, std::vector<std::string> values) {
  contents_->entries.push_back({field, {}, {}, std::move(values), true, true});
}

void ResultFile::add(const Field& field, const std::vector<std::string>& dimensions,
                     std::vector<double> values) {
  contents_->entries.push_back({field, dimensions, std::move(values), {}, false, false});
}

void ResultFile::add_text(const Field& field, const std::vector<std::string>& dimensions,
                          std::vector<std::string> values) {
  contents_->entries.push_back({field, dimensions, {}, std::move(values), true, false});
}

void ResultFile::add_complex(const Field& field, const std::vector<std::string>& dimensions,
                             const std::vector<std::complex<double>>& values) {
  std::vector<double> re, im;
  for (const auto& z : values) {
    re.push_back(z.real());
    im.push_back(z.imag());
  }
  add({field.name + "_re", field.units, field.long_name + ", real part"}, dimensions, re);
  add({field.name + "_im", field.units, field.long_name + ", imaginary part"}, dimensions, im);
}

double ResultFile::Contents::bytes() const {
  double sum = 0;
  for (const Entry& entry : entries) {
    sum += 2 * 8.0 * double(entry.values.size());  // twice: for a scale that is made where there is none
    for (const std::string& text : entry.texts) sum += 64 + double(text.size());
  }
  return sum;
}

void ResultFile::Contents::write(hid_t file) const {
  for (const auto& [name, text] : texts) h5::write_attribute(file, name, text);
  for (const auto& [name, value] : numbers) h5::write_attribute(file, name, value);
  std::map<std::string, Id> scales;
  const auto leaf = [](const std::string& name) { return name.substr(name.rfind('/') + 1); };
  const auto keep = [&](const Field& field, Id dataset) {
    h5::make_scale(dataset, leaf(field.name));
    scales.emplace(field.name, std::move(dataset));
  };
  const auto make = [&](const Field& field, const std::vector<double>& values) {
    keep(field, h5::write_fixed(file, field, {values.size()}, values));
  };
  for (const Entry& entry : entries) {
    if (!entry.is_scale) continue;
    if (entry.is_text)
      keep(entry.field, write_texts(file, entry.field, {entry.texts.size()}, entry.texts));
    else
      make(entry.field, entry.values);
  }

  for (const Entry& entry : entries) {
    if (entry.is_scale) continue;
    const std::string& name = entry.field.name;
    const std::size_t count = entry.is_text ? entry.texts.size() : entry.values.size();
    const std::size_t slash = name.rfind('/');
    const std::string group = slash == std::string::npos ? "" : name.substr(0, slash + 1);
    // in the group of the dataset, which the name may have or not
    const auto beside = [&](const std::string& dimension) {
      return dimension.rfind(group, 0) == 0 ? dimension : group + dimension;
    };
    std::vector<std::string> used;
    std::vector<hsize_t> dims;
    hsize_t known = 1;
    for (const std::string& dimension : entry.dimensions) {
      const std::string here = beside(dimension);
      used.push_back(scales.count(here) ? here : scales.count(dimension) ? dimension : "");
      dims.push_back(used.back().empty() ? 0 : h5::extents(scales.at(used.back()))[0]);
      if (!used.back().empty()) known *= dims.back();
    }
    // the size of one dimension without a scale follows from the number of values
    for (std::size_t d = 0; d < dims.size(); ++d)
      if (used[d].empty()) {
        dims[d] = known > 0 ? count / known : 0;
        known *= dims[d];
        std::vector<double> counting(dims[d]);
        for (std::size_t k = 0; k < counting.size(); ++k) counting[k] = double(k);
        used[d] = beside(entry.dimensions[d]);
        make({used[d], "1", "index"}, counting);
      }
    if (known != count) throw std::logic_error("dataset '" + name + "' does not fit its dimensions");

    const Id dataset = entry.is_text ? write_texts(file, entry.field, dims, entry.texts)
                                     : h5::write_fixed(file, entry.field, dims, entry.values);
    for (std::size_t d = 0; d < used.size(); ++d)
      h5::attach_scale(dataset, scales.at(used[d]), static_cast<unsigned>(d));
  }
}

void ResultFile::write() {
  if (path_.empty()) return;
  on_root(comm_, [&] {
    const std::string path = paths::resolved(path_);
    const auto write = [&](const std::string& name) {
      Id file = h5::create_file(name, contents_->bytes());
      h5::write_header(file, provenance_, provenance_.command);
      contents_->write(file);
      if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0 || H5Fclose(file.release()) < 0) h5::fail("write", path);
    };
    h5::naming(path, [&] { paths::replace_file(path, write); });
  });
}

Field standard_field(const std::string& name) {
  if (name == "t") return {"t", "time", "time"};
  if (name == "psi") return {"psi", "length/time", "sliding velocity"};
  if (name == "eta") return {"eta", "1", "force over the friction amplitude"};
  for (const StateLaw law : all_state_laws())
    if (!law.none() && name == law->symbol) return {law->symbol, law->unit, law->meaning};
  if (name == "chi") return {"chi", "length", "displacement"};
  throw std::logic_error("no standard field '" + name + "'");
}

}  // namespace stickslip

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
