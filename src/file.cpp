#include "stickslip/file.hpp"

#include <hdf5_hl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cerrno>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "hdf5_tools.hpp"
#include "paths.hpp"
#include "share.hpp"
#include "stickslip/error.hpp"
#include "stickslip/json.hpp"
#include "stickslip/root.hpp"
#include "stickslip/summary.hpp"

namespace stickslip {

namespace {

using h5::Id;

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// A dataset, of doubles unless said otherwise; an old one of the name is a mistake in the program.
Id create_dataset(hid_t file, const std::string& name, hid_t type, hid_t space, hid_t creation, hid_t access) {
  const Id links(H5Pcreate(H5P_LINK_CREATE));
  H5Pset_create_intermediate_group(links, 1);
  Id dataset(H5Dcreate2(file, name.c_str(), type, space, links, creation, access));
  if (!dataset) h5::fail("make dataset " + name + " in", "the file");
  return dataset;
}

// No times in the headers: with them every write would change more than the extents.
Id dataset_creation() {
  Id properties(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(properties, false);
  return properties;
}

void describe(hid_t dataset, const Field& field) {
  if (!field.units.empty()) h5::write_attribute(dataset, "units", field.units);
  if (!field.long_name.empty()) h5::write_attribute(dataset, "long_name", field.long_name);
}

Id write_fixed(hid_t file, const Field& field, const std::vector<hsize_t>& dims, const std::vector<double>& values) {
  const Id space(dims.empty() ? H5Screate(H5S_SCALAR)
                              : H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr));
  Id dataset = create_dataset(file, field.name, H5T_NATIVE_DOUBLE, space, dataset_creation(), H5P_DEFAULT);
  if (!values.empty() &&
      H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    h5::fail("write", field.name);
  describe(dataset, field);
  return dataset;
}

void make_scale(hid_t dataset, const std::string& name) {
  if (H5DSset_scale(dataset, name.c_str()) < 0) h5::fail("make a dimension scale of", name);
}

void attach_scale(hid_t dataset, hid_t scale, unsigned dimension) {
  if (H5DSattach_scale(dataset, scale, dimension) < 0) h5::fail("attach a dimension scale to", "a dataset");
}

// Rows against time in one group: column 0 is t, the others hold one value or `x.size()` values a row.
struct Column {
  Field field;
  bool wide;
  Id dataset;
  std::vector<double> pending;     // rows not yet written
  hsize_t chunk_width = 1;         // values a row in one chunk
  std::vector<haddr_t> chunks;     // where in the file the chunks begin that lie side by side
};

struct Table {
  std::string group;  // "" is the root
  Field x_field;
  std::vector<double> x;
  std::vector<Column> columns;
  hsize_t capacity = 0;  // rows for which the file has room
  hsize_t written = 0;   // rows in the file
  hsize_t extent = 0;    // rows that the extents in memory name: 1 in a table just made, else `written`
  hsize_t pending = 0;   // rows in memory

  std::string path(const std::string& name) const { return group.empty() ? name : group + "/" + name; }
  hsize_t width(const Column& column) const { return column.wide ? x.size() : 1; }
};

const hsize_t first_capacity = 4096;                 // rows of a table whose length nobody knows
const hsize_t largest_chunk = hsize_t(1) << 30;      // bytes; the format ends at 4 GiB
const double cheap_copy = 64e6;                      // bytes that closing may copy to give back unused room

// Makes the datasets of a table with room for its `capacity` rows.
void create_table(hid_t file, Table& table) {
  const Id group(table.group.empty() ? -1
                                     : H5Gcreate2(file, table.group.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
  Id x;
  if (!table.x.empty()) {
    Field field = table.x_field;
    field.name = table.path(field.name);
    x = write_fixed(file, field, {table.x.size()}, table.x);
    make_scale(x, table.x_field.name);
  }
  // One row is there from the start, since only chunks within the extents are allocated.
  table.extent = table.capacity > 0 ? 1 : 0;
  const hsize_t rows = std::max<hsize_t>(table.capacity, 1);
  for (Column& column : table.columns) {
    const hsize_t width = table.width(column);
    const int rank = column.wide ? 2 : 1;
    const hsize_t dims[2] = {table.extent, width}, most[2] = {H5S_UNLIMITED, width};
    const hsize_t chunk[2] = {rows, std::clamp<hsize_t>(largest_chunk / (8 * rows), 1, width)};
    const Id space(H5Screate_simple(rank, dims, most)), creation = dataset_creation(),
        access(H5Pcreate(H5P_DATASET_ACCESS));
    const double nan = std::numeric_limits<double>::quiet_NaN();
    H5Pset_chunk(creation, rank, chunk);
    H5Pset_fill_value(creation, H5T_NATIVE_DOUBLE, &nan);  // never written; a reader pads shorter datasets with it
    H5Pset_alloc_time(creation, H5D_ALLOC_TIME_EARLY);
    H5Pset_fill_time(creation, H5D_FILL_TIME_NEVER);  // keeps the file sparse
    H5Pset_chunk_cache(access, 0, 0, 0);              // what is read is what the file holds
    column.dataset = create_dataset(file, table.path(column.field.name), H5T_NATIVE_DOUBLE, space, creation, access);
    describe(column.dataset, column.field);
    column.chunk_width = chunk[1];
    column.chunks.clear();
    for (hsize_t at = 0; table.capacity > 0 && at < width; at += column.chunk_width) {
      const hsize_t offset[2] = {0, at};
      hsize_t size = 0;
      haddr_t address = HADDR_UNDEF;
      unsigned filters = 0;
      if (H5Dget_chunk_info_by_coord(column.dataset, offset, &filters, &address, &size) < 0 || address == HADDR_UNDEF)
        h5::fail("find the place of " + column.field.name + " in", file);
      column.chunks.push_back(address);
    }
    if (&column == &table.columns[0]) {
      make_scale(column.dataset, column.field.name);
    } else {
      attach_scale(column.dataset, table.columns[0].dataset, 0);
      if (column.wide) attach_scale(column.dataset, x, 1);
    }
  }
}

// Puts rows where they belong in the file, extents or not: a write through the library would need the extents first,
// and could not take them back on a full disk. The format of the values is that of this machine.
void put_rows(int descriptor, const Table& table, const Column& column, hsize_t first, hsize_t count,
              const double* data) {
  const auto put = [&](haddr_t at, const double* values, hsize_t number) {
    const char* bytes = reinterpret_cast<const char*>(values);
    for (std::size_t left = number * sizeof(double); left > 0;) {
      const ssize_t done = pwrite(descriptor, bytes, left, static_cast<off_t>(at));
      if (done < 0 && errno == EINTR) continue;
      if (done < 0) throw Failure(std::strerror(errno));
      bytes += done;
      at += static_cast<haddr_t>(done);
      left -= static_cast<std::size_t>(done);
    }
  };
  const hsize_t width = table.width(column);
  const haddr_t row_bytes = column.chunk_width * sizeof(double);
  if (column.chunks.size() == 1) return put(column.chunks[0] + first * row_bytes, data, count * width);
  for (hsize_t row = 0; row < count; ++row)
    for (std::size_t c = 0; c < column.chunks.size(); ++c) {
      const hsize_t begin = c * column.chunk_width, number = std::min(column.chunk_width, width - begin);
      put(column.chunks[c] + (first + row) * row_bytes, data + row * width + begin, number);
    }
}

// Lengthens (or, before anybody reads, shortens) the extents in memory; readers see them after show(). Time last:
// whatever it counts is complete in the other columns, wherever a reader or a kill comes between.
void set_extent(Table& table, hsize_t rows) {
  for (std::size_t k = table.columns.size(); k-- > 0;) {
    Column& column = table.columns[k];
    const hsize_t dims[2] = {rows, table.width(column)};
    if (H5Dset_extent(column.dataset, dims) < 0) h5::fail("extend", column.dataset);
  }
  table.extent = rows;
}

// Writes the pending rows, then the extents in memory.
void write_pending(int descriptor, Table& table) {
  if (table.pending == 0) return;
  for (const Column& column : table.columns)
    put_rows(descriptor, table, column, table.written, table.pending, column.pending.data());
  table.written += table.pending;
  table.pending = 0;
  for (Column& column : table.columns) column.pending.clear();
  if (table.written > table.extent) set_extent(table, table.written);
}

// Lets readers see the extents: one small write in place for each dataset.
void show(Table& table) {
  for (std::size_t k = table.columns.size(); k-- > 0;)
    if (H5Dflush(table.columns[k].dataset) < 0) h5::fail("write", table.columns[k].dataset);
}

// How many rows to copy in one go: about 8 MB a column.
hsize_t rows_at_once(const Table& table) {
  return std::max<hsize_t>(1, (hsize_t(1) << 20) / std::max<hsize_t>(1, table.x.size()));
}

void append(Table& table, double t, const std::vector<const double*>& row) {
  if (row.size() + 1 != table.columns.size()) throw std::logic_error("a row of another length than its table");
  table.columns[0].pending.push_back(t);
  for (std::size_t k = 0; k < row.size(); ++k) {
    Column& column = table.columns[k + 1];
    column.pending.insert(column.pending.end(), row[k], row[k] + table.width(column));
  }
  ++table.pending;
}

}  // namespace

// ---- the file of a run ----

struct RunFile::Writer {
  std::string path;       // final name
  std::string temporary;  // until the first frame
  Provenance provenance;
  std::map<std::string, std::string> texts;
  std::map<std::string, double> numbers;
  std::vector<double> friction_psi, friction_F;
  std::vector<Table> tables;  // 0: frames; then probes and series where wanted
  std::size_t probes = 0, series = 0, events = 0;  // which, 0 for none
  Id file;
  bool published = false;
  bool broken = false;  // a write has failed: no more are tried
  double next_flush = 0;

  Writer(const std::string& name, Provenance from, RunLayout&& layout);
  ~Writer();
  void create(const std::string& name, double bytes);
  void copy_rows(const Resume& from);
  void flush();
  void write_and_show();
  void publish();
  void check_present() const;
  void rewrite(bool exact);
  void close();
  void drop_handles();
  int descriptor() const;  // of the open file
};

RunFile::Writer::Writer(const std::string& name, Provenance from, RunLayout&& layout)
    : path(paths::resolved(name)),
      temporary(paths::hidden_sibling(path)),
      provenance(std::move(from)),
      texts(std::move(layout.texts)),
      numbers(std::move(layout.numbers)),
      friction_psi(std::move(layout.friction_psi)),
      friction_F(std::move(layout.friction_F)) {
  const Field time{"t", "time", "time"};
  Table frames;
  frames.x_field = {"x", "length", "position"};
  frames.x = std::move(layout.x);
  frames.capacity = static_cast<hsize_t>(std::max<std::int64_t>(layout.frames, 1));
  frames.columns.push_back({time, false, {}, {}, 1, {}});
  for (const Field& field : layout.fields) frames.columns.push_back({field, true, {}, {}, 1, {}});
  tables.push_back(std::move(frames));
  if (!layout.probe_x.empty()) {
    probes = tables.size();
    Table table;
    table.group = "probes";
    table.x_field = {"x", "length", "position of the probe"};
    table.x = std::move(layout.probe_x);
    table.capacity = first_capacity;
    table.columns.push_back({time, false, {}, {}, 1, {}});
    for (const char* field : {"psi", "eta"}) table.columns.push_back({standard_field(field), true, {}, {}, 1, {}});
    tables.push_back(std::move(table));
  }
  const auto add_rows = [&](const char* group, const Field& at, const std::vector<Field>& fields) {
    if (fields.empty()) return std::size_t(0);
    Table table;
    table.group = group;
    table.capacity = first_capacity;
    table.columns.push_back({at, false, {}, {}, 1, {}});
    for (const Field& field : fields) table.columns.push_back({field, false, {}, {}, 1, {}});
    tables.push_back(std::move(table));
    return tables.size() - 1;
  };
  series = add_rows("series", time, layout.series);
  events = add_rows("events", {"t", "time", "time at which the event ends"}, layout.events);
}

// `bytes`: of rows that will follow at once.
void RunFile::Writer::create(const std::string& name, double bytes) {
  for (const Table& table : tables) bytes += 8.0 * double(table.x.size());
  bytes += 16.0 * double(friction_psi.size());
  unlink(name.c_str());  // never write into a file that somebody else may still have open
  double room = 0;
  for (const Table& table : tables)
    for (const Column& column : table.columns) room += 8.0 * double(table.capacity) * double(table.width(column));
  file = h5::create_file(name, bytes, 0, room);
  h5::write_header(file, provenance, "run");
  for (const auto& [key, text] : texts) h5::write_attribute(file, key, text);
  for (const auto& [key, number] : numbers) h5::write_attribute(file, key, number);
  if (!friction_psi.empty()) {
    const Field at{"friction/psi", "length/time", "sliding velocity"};
    const Id scale = write_fixed(file, at, {friction_psi.size()}, friction_psi);
    make_scale(scale, "psi");
    const Field friction{"friction/F", "1", "steady friction over its amplitude"};
    attach_scale(write_fixed(file, friction, {friction_F.size()}, friction_F), scale, 0);
  }
  for (Table& table : tables) create_table(file, table);
  if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", name);
}

// Creates the file with the rows up to the given time of an earlier one, column by column: by name, probes by their
// position.
void RunFile::Writer::copy_rows(const Resume& from) {
  struct Source {
    hsize_t kept = 0;
    std::vector<double> x;
    std::vector<std::size_t> index;  // for each x of the new table the index in the old one; beyond its end: none
    std::vector<Id> datasets;        // for each column, empty where there is none
  };
  const Id old = h5::open_file(from.path);
  (void)h5::read_header(old);
  std::vector<Source> sources(tables.size());
  for (std::size_t which = 0; which < tables.size(); ++which) {
    Table& table = tables[which];
    Source& source = sources[which];
    source.datasets.resize(table.columns.size());
    if (!h5::exists(old, table.path("t"))) continue;
    const std::vector<double> times = h5::read_reals(old, table.path("t"));
    // an event is known to have ended one step later
    const bool strictly = which == events && which > 0;
    const auto later = std::find_if(times.begin(), times.end(),
                                    [&](double t) { return strictly ? !(t < from.until) : !(t <= from.until); });
    source.kept = static_cast<hsize_t>(later - times.begin());
    if (!table.x.empty()) source.x = h5::read_reals(old, table.path("x"));
    if (which == 0 && source.x != table.x) throw Failure("'" + from.path + "' has another grid");
    for (const double x : table.x)
      source.index.push_back(
          static_cast<std::size_t>(std::find(source.x.begin(), source.x.end(), x) - source.x.begin()));
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      const std::string name = table.path(table.columns[c].field.name);
      if (!h5::exists(old, name)) continue;
      source.datasets[c] = Id(H5Dopen2(old, name.c_str(), H5P_DEFAULT));
      const auto sizes = h5::extents(source.datasets[c]);
      const bool fits = table.columns[c].wide ? sizes.size() == 2 && sizes[1] == source.x.size() : sizes.size() == 1;
      if (!fits || sizes[0] < source.kept) throw Failure("'" + from.path + "': " + name + " does not fit its t and x");
    }
    if (source.kept > 0) table.capacity += source.kept;
  }

  create(temporary, 0);
  for (std::size_t which = 0; which < tables.size(); ++which) {
    Table& table = tables[which];
    const Source& source = sources[which];
    const hsize_t block = rows_at_once(table);
    for (hsize_t first = 0; first < source.kept; first += block) {
      table.pending = std::min(block, source.kept - first);
      for (std::size_t c = 0; c < table.columns.size(); ++c) {
        Column& column = table.columns[c];
        column.pending.clear();
        if (!source.datasets[c]) {
          column.pending.assign(table.pending * table.width(column), std::numeric_limits<double>::quiet_NaN());
        } else if (!column.wide) {
          column.pending = h5::read_rows(source.datasets[c], first, table.pending, 1);
        } else {
          const hsize_t width = source.x.size();
          const std::vector<double> rows = h5::read_rows(source.datasets[c], first, table.pending, width);
          for (hsize_t r = 0; r < table.pending; ++r)
            for (const std::size_t k : source.index)
              column.pending.push_back(k < width ? rows[r * width + k] : std::numeric_limits<double>::quiet_NaN());
        }
      }
      write_pending(descriptor(), table);
    }
  }
}

// A new file with the same rows and the pending ones, with room for more (`exact`: for no more), which takes the
// place of this one.
void RunFile::Writer::rewrite(bool exact) {
  const std::string name = paths::hidden_sibling(path, ".new");
  double bytes = 0;
  for (const Table& table : tables)
    for (const Column& column : table.columns)
      bytes += 8.0 * double(table.written + table.pending) * double(table.width(column));
  unlink(name.c_str());
  try {
    paths::reserve(name, bytes);  // fails while nothing is touched yet
  } catch (...) {
    unlink(name.c_str());
    throw;
  }

  const Id old = std::move(file);
  std::vector<std::vector<Id>> sources;
  std::vector<hsize_t> rows;
  for (Table& table : tables) {
    sources.emplace_back();
    for (Column& column : table.columns) sources.back().push_back(std::move(column.dataset));
    rows.push_back(table.written);
    const hsize_t needed = table.written + table.pending;
    if (exact) table.capacity = needed;
    else if (needed > table.capacity) table.capacity = std::max(first_capacity, 2 * needed);
  }
  try {
    create(name, bytes);
    for (std::size_t which = 0; which < tables.size(); ++which) {
      Table& table = tables[which];
      table.written = 0;
      const hsize_t block = rows_at_once(table);
      for (hsize_t first = 0; first < rows[which]; first += block) {
        const hsize_t count = std::min(block, rows[which] - first);
        for (std::size_t c = 0; c < table.columns.size(); ++c) {
          const hsize_t width = table.width(table.columns[c]);
          const std::vector<double> values = h5::read_rows(sources[which][c], first, count, width);
          put_rows(descriptor(), table, table.columns[c], first, count, values.data());
        }
      }
      table.written = rows[which];
      if (table.written > table.extent) set_extent(table, table.written);
      write_pending(descriptor(), table);
    }
    if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", name);
    paths::publish(name, published ? path : temporary);
  } catch (...) {
    drop_handles();  // the old file stands as it was
    unlink(name.c_str());
    throw;
  }
}

void RunFile::Writer::publish() {
  for (Table& table : tables)
    if (table.written == 0 && table.extent > 0) {
      set_extent(table, 0);  // readers must not see the row that a table is made with; this gives up its chunks
      table.capacity = 0;
    }
  if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", temporary);
  paths::publish(temporary, path);
  published = true;
}

int RunFile::Writer::descriptor() const {
  int* number = nullptr;
  if (H5Fget_vfd_handle(file, H5P_DEFAULT, reinterpret_cast<void**>(&number)) < 0) h5::fail("write", file);
  return *number;
}

// Writing goes on without an error into a file that was removed: whoever waits for the result should hear of it.
void RunFile::Writer::check_present() const {
  struct stat named {}, open_one {};
  if (fstat(descriptor(), &open_one) != 0 || stat(path.c_str(), &named) != 0)
    throw Failure("cannot write '" + path + "': it was removed while the run went on");
  if (named.st_ino != open_one.st_ino || named.st_dev != open_one.st_dev)
    throw Failure("cannot write '" + path + "': another file has taken its place while the run went on");
}

void RunFile::Writer::flush() {
  if (broken) return;
  const double begin = now();
  try {
    write_and_show();
  } catch (...) {
    broken = true;
    throw;
  }
  next_flush = now() + 20 * (now() - begin);  // at most a twentieth of the time is spent here
}

void RunFile::Writer::write_and_show() {
  if (published) check_present();
  bool room = true;
  for (const Table& table : tables) room = room && table.written + table.pending <= table.capacity;
  if (!room) rewrite(false);
  for (Table& table : tables) write_pending(descriptor(), table);
  if (published) {
    for (Table& table : tables) show(table);
  } else if (tables[0].written > 0) {
    publish();
  }
}

void RunFile::Writer::close() {
  if (!file) return;
  flush();
  if (published && !broken) {
    double used = 0, unused = 0;
    for (const Table& table : tables)
      for (const Column& column : table.columns) {
        used += 8.0 * double(table.written) * double(table.width(column));
        unused += 8.0 * double(table.capacity - table.written) * double(table.width(column));
      }
    if (unused > 0 && used <= cheap_copy) try {
        rewrite(true);
      } catch (const Failure&) {
        // no room for a copy: the file keeps its unused, sparse end
      }
  }
  for (Table& table : tables)
    for (Column& column : table.columns) column.dataset.reset();
  if (file && H5Fclose(file.release()) < 0 && !broken) h5::fail("write", path);
}

void RunFile::Writer::drop_handles() {
  for (Table& table : tables)
    for (Column& column : table.columns) column.dataset.reset();
  file.reset();
}

RunFile::Writer::~Writer() {
  try {
    close();
  } catch (...) {
    // either an error is under way already, or the caller did not ask for one by close()
  }
  drop_handles();
  if (!published) unlink(temporary.c_str());
}

namespace {

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

}  // namespace

RunFile::RunFile(MPI_Comm comm, std::string path, Provenance provenance, RunLayout layout,
                 std::optional<Resume> resume)
    : comm_(comm), last_time_(-std::numeric_limits<double>::infinity()) {
  on_root(comm_, [&] {
    try {
      writer_ = std::make_unique<Writer>(path, std::move(provenance), std::move(layout));
      naming(writer_->path, [&] {
        if (resume) writer_->copy_rows(*resume);
        else writer_->create(writer_->temporary, 0);
      });
      frames_ = static_cast<std::int64_t>(writer_->tables[0].written);
      if (frames_ > 0)
        last_time_ = h5::read_rows(writer_->tables[0].columns[0].dataset, writer_->tables[0].written - 1, 1, 1)[0];
    } catch (const Failure& e) {
      throw UsageError("out_file '" + path + "': " + e.what());  // nothing has been computed yet
    }
  });
  MPI_Bcast(&frames_, 1, MPI_INT64_T, 0, comm_);
  MPI_Bcast(&last_time_, 1, MPI_DOUBLE, 0, comm_);
}

RunFile::~RunFile() = default;

void RunFile::probes(double t, const std::vector<double>& psi, const std::vector<double>& eta) {
  if (!writer_ || writer_->probes == 0) return;
  Table& table = writer_->tables[writer_->probes];
  if (psi.size() != table.x.size() || eta.size() != table.x.size()) throw std::logic_error("probes of another number");
  append(table, t, {psi.data(), eta.data()});
}

namespace {
void append_row(Table& table, double t, const std::vector<double>& row) {
  std::vector<const double*> values;
  values.reserve(row.size());
  for (const double& value : row) values.push_back(&value);
  append(table, t, values);
}
}  // namespace

void RunFile::series(double t, const std::vector<double>& row) {
  if (writer_ && writer_->series != 0) append_row(writer_->tables[writer_->series], t, row);
}
void RunFile::event(double end, const std::vector<double>& row) {
  if (writer_ && writer_->events != 0) append_row(writer_->tables[writer_->events], end, row);
}

void RunFile::frame(double t, const std::vector<const double*>& fields) {
  if (!(t > last_time_)) throw std::logic_error("frames must follow each other in time");
  on_root(comm_, [&] {
    naming(writer_->path, [&] {
      Table& table = writer_->tables[0];
      append(table, t, fields);
      const double bytes = 8.0 * double(table.pending) * double(table.x.size()) * double(table.columns.size());
      if (now() >= writer_->next_flush || bytes > 4e6) writer_->flush();
    });
  });
  ++frames_;
  last_time_ = t;
}

void RunFile::flush() {
  on_root(comm_, [&] { naming(writer_->path, [&] { writer_->flush(); }); });
}

void RunFile::close() {
  on_root(comm_, [&] { naming(writer_->path, [&] { writer_->close(); }); });
}

Field standard_field(const std::string& name) {
  if (name == "psi") return {"psi", "length/time", "sliding velocity"};
  if (name == "eta") return {"eta", "1", "force over the friction amplitude"};
  if (name == "tau") return {"tau", "1", "contact state: strength over that of fresh contacts"};
  if (name == "theta") return {"theta", "time", "contact state: age"};
  if (name == "chi") return {"chi", "length", "displacement"};
  throw std::logic_error("no standard field '" + name + "'");
}

// ---- files written in one piece ----

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

ResultFile::ResultFile(MPI_Comm comm, std::string path, Provenance provenance)
    : comm_(comm),
      path_(std::move(path)),
      provenance_(std::move(provenance)),
      contents_(std::make_unique<Contents>()) {}

ResultFile::~ResultFile() = default;

void ResultFile::attribute(const std::string& name, const std::string& text) {
  contents_->texts.emplace_back(name, text);
}

void ResultFile::attribute(const std::string& name, double value) { contents_->numbers.emplace_back(name, value); }

void ResultFile::scale(const Field& field, std::vector<double> values) {
  contents_->entries.push_back({field, {}, std::move(values), {}, false, true});
}

void ResultFile::add(const Field& field, const std::vector<std::string>& dimensions, std::vector<double> values) {
  contents_->entries.push_back({field, dimensions, std::move(values), {}, false, false});
}

void ResultFile::add_text(const Field& field, const std::vector<std::string>& dimensions,
                          std::vector<std::string> values) {
  contents_->entries.push_back({field, dimensions, {}, std::move(values), true, false});
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
  const auto make = [&](const Field& field, const std::vector<double>& values) {
    Id dataset = write_fixed(file, field, {values.size()}, values);
    make_scale(dataset, leaf(field.name));
    scales.emplace(field.name, std::move(dataset));
  };
  for (const Entry& entry : entries)
    if (entry.is_scale) make(entry.field, entry.values);

  for (const Entry& entry : entries) {
    if (entry.is_scale) continue;
    const std::string& name = entry.field.name;
    const std::size_t count = entry.is_text ? entry.texts.size() : entry.values.size();
    const std::size_t slash = name.rfind('/');
    const std::string group = slash == std::string::npos ? "" : name.substr(0, slash + 1);
    std::vector<std::string> used;
    std::vector<hsize_t> dims;
    hsize_t known = 1;
    for (const std::string& dimension : entry.dimensions) {
      const std::string here = group + dimension;
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
        used[d] = group + entry.dimensions[d];
        make({used[d], "1", "index"}, counting);
      }
    if (known != count) throw std::logic_error("dataset '" + name + "' does not fit its dimensions");

    Id dataset;
    if (entry.is_text) {
      const Id type(H5Tcopy(H5T_C_S1));
      H5Tset_size(type, H5T_VARIABLE);
      H5Tset_cset(type, H5T_CSET_UTF8);
      const Id space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr));
      dataset = create_dataset(file, name, type, space, dataset_creation(), H5P_DEFAULT);
      std::vector<const char*> pointers;
      for (const std::string& text : entry.texts) pointers.push_back(text.c_str());
      if (!pointers.empty() && H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers.data()) < 0)
        h5::fail("write", name);
      describe(dataset, entry.field);
    } else {
      dataset = write_fixed(file, entry.field, dims, entry.values);
    }
    for (std::size_t d = 0; d < used.size(); ++d) attach_scale(dataset, scales.at(used[d]), static_cast<unsigned>(d));
  }
}

void ResultFile::write() {
  if (path_.empty()) return;
  on_root(comm_, [&] {
    const std::string path = paths::resolved(path_), temporary = paths::hidden_sibling(path);
    unlink(temporary.c_str());
    naming(path, [&] {
      try {
        Id file = h5::create_file(temporary, contents_->bytes());
        h5::write_header(file, provenance_, provenance_.command);
        contents_->write(file);
        if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0 || H5Fclose(file.release()) < 0) h5::fail("write", path);
        paths::sync(temporary);
        paths::publish(temporary, path);
      } catch (...) {
        unlink(temporary.c_str());
        throw;
      }
    });
  });
}

// ---- reading and checking ----

void check_output_path(const std::string& path) {
  on_root(PETSC_COMM_WORLD, [&] {
    const paths::Present present = paths::check_writable("out_file", path);
    if (present == paths::Present::nothing) return;
    if (present == paths::Present::special) throw UsageError("out_file '" + path + "': is not a regular file");
    const auto look = [&] {
      const Id file = h5::open_file(path);
      (void)h5::read_header(file);
    };
    const auto refuse = [&] {
      throw UsageError("out_file '" + path +
                       "': exists and was not written by this program; give another name or remove it");
    };
    if (!h5::survives(look)) refuse();
    try {
      look();
    } catch (const Failure&) {
      refuse();
    }
  });
}

void check_outputs(const std::string& out_file, const std::string& summary) {
  if (!out_file.empty()) check_output_path(out_file);
  if (!summary.empty()) check_summary_path(summary);
  if (out_file.empty() || summary.empty()) return;
  on_root(PETSC_COMM_WORLD, [&] {
    const auto place = [](const std::string& path) {
      return paths::resolved(paths::folder(path)) + "/" + paths::file(path);
    };
    if (place(paths::resolved(out_file)) == place(paths::resolved(summary)))
      throw UsageError("summary '" + summary + "': is the same file as out_file");
  });
}

namespace {

// Opens a file on rank 0 and hands it to body(); whatever is wrong with it becomes `WHAT 'PATH': ...` on every rank.
template <class Body>
void reading(const std::string& what, const std::string& path, Body&& body) {
  on_root(PETSC_COMM_WORLD, [&] {
    const std::string label = what + " '" + path + "': ";
    struct stat at {};
    if (stat(path.c_str(), &at) != 0) throw UsageError(label + std::strerror(errno));
    if (!S_ISREG(at.st_mode)) throw UsageError(label + "is not a file");
    h5::quiet();
    if (H5Fis_hdf5(path.c_str()) <= 0) throw UsageError(label + "is not an HDF5 file");
    const auto read = [&] {
      const Id file = h5::open_file(path);
      body(static_cast<hid_t>(file), h5::read_header(file));
    };
    if (!h5::survives(read)) throw UsageError(label + "is damaged");
    try {
      read();
    } catch (const Failure& e) {
      throw UsageError(label + e.what());
    }
  });
}

}  // namespace

FileHeader read_header(const std::string& what, const std::string& path) {
  FileHeader header;
  reading(what, path, [&](hid_t, const FileHeader& found) { header = found; });
  share(header);
  return header;
}

DataArray read_array(const std::string& what, const std::string& path, const std::string& name) {
  DataArray array;
  reading(what, path, [&](hid_t file, const FileHeader&) {
    array.values = h5::read_reals(file, name);
    const Id dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT));
    for (const hsize_t size : h5::extents(dataset)) array.shape.push_back(size);
  });
  std::vector<std::int64_t> shape(array.shape.begin(), array.shape.end());
  share(shape);
  array.shape.assign(shape.begin(), shape.end());
  share(array.values);
  return array;
}

Frame read_frame(const std::string& what, const std::string& path, std::int64_t index) {
  Frame frame;
  reading(what, path, [&](hid_t file, const FileHeader& header) {
    if (header.kind != "run") throw Failure("holds the result of `" + header.kind + "`, not of `run`");
    const std::vector<double> t = h5::read_reals(file, "t");
    frame.x = h5::read_reals(file, "x");
    frame.count = static_cast<std::int64_t>(t.size());
    frame.index = index == -1 ? frame.count - 1 : index;
    if (frame.index < 0 || frame.index >= frame.count)
      throw Failure("has " + std::to_string(frame.count) + " frames (0 to " + std::to_string(frame.count - 1) +
                    "), not frame " + std::to_string(index));
    frame.t = t[static_cast<std::size_t>(frame.index)];
    frame.options = header.options;
    for (const std::string& name : h5::members(file, "/")) {
      const Id object(H5Oopen(file, name.c_str(), H5P_DEFAULT));
      if (H5Iget_type(object) != H5I_DATASET) continue;
      const auto sizes = h5::extents(object);
      if (sizes.size() != 2 || sizes[1] != frame.x.size() || sizes[0] <= static_cast<hsize_t>(frame.index)) continue;
      frame.fields[name] = h5::read_rows(object, static_cast<hsize_t>(frame.index), 1, sizes[1]);
    }
    for (const char* name : {"psi", "eta"})
      if (!frame.fields.count(name)) throw Failure(std::string("has no dataset '") + name + "' of (t, x)");
  });
  share(frame.t);
  share(frame.index);
  share(frame.count);
  share(frame.x);
  share(frame.fields);
  share(frame.options);
  return frame;
}

// ---- gathering ----

Gather::Gather(Vec like, PetscInt dof) : components_(static_cast<std::size_t>(dof)) {
  SS_TRY(VecScatterCreateToZero(like, scatter_.out(), on_root_.out()));
}

const std::vector<std::vector<double>>& Gather::components(Vec v) {
  const std::vector<double> values = interleaved(v);
  const std::size_t dof = components_.size();
  for (std::size_t d = 0; d < dof; ++d) {
    components_[d].resize(values.size() / dof);
    for (std::size_t i = 0; i < components_[d].size(); ++i) components_[d][i] = values[i * dof + d];
  }
  return components_;
}

std::vector<double> Gather::interleaved(Vec v) {
  SS_TRY(VecScatterBegin(scatter_, v, on_root_, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecScatterEnd(scatter_, v, on_root_, INSERT_VALUES, SCATTER_FORWARD));
  PetscInt size = 0;
  const PetscScalar* values = nullptr;
  SS_TRY(VecGetLocalSize(on_root_, &size));
  SS_TRY(VecGetArrayRead(on_root_, &values));
  std::vector<double> out(static_cast<std::size_t>(size));
  for (PetscInt i = 0; i < size; ++i) out[static_cast<std::size_t>(i)] = PetscRealPart(values[i]);
  SS_TRY(VecRestoreArrayRead(on_root_, &values));
  return out;
}

void Gather::spread(const std::vector<double>& values, Vec v) {
  PetscInt size = 0;
  PetscScalar* array = nullptr;
  SS_TRY(VecGetLocalSize(on_root_, &size));
  on_root(PetscObjectComm(reinterpret_cast<PetscObject>(v)), [&] {
    if (values.size() != static_cast<std::size_t>(size)) throw std::logic_error("a vector of another length");
  });
  SS_TRY(VecGetArray(on_root_, &array));
  for (PetscInt i = 0; i < size; ++i) array[i] = values[static_cast<std::size_t>(i)];
  SS_TRY(VecRestoreArray(on_root_, &array));
  SS_TRY(VecScatterBegin(scatter_, on_root_, v, INSERT_VALUES, SCATTER_REVERSE));
  SS_TRY(VecScatterEnd(scatter_, on_root_, v, INSERT_VALUES, SCATTER_REVERSE));
}

}  // namespace stickslip
