#include "stickslip/output/run_file.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/paths.hpp"
#include "output/datasets.hpp"
#include "output/growing_table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

namespace {

using h5::Column;
using h5::Id;
using Table = h5::GrowingTable;

const hsize_t first_capacity = 4096;  // rows of a table whose length nobody knows
const double cheap_copy = 64e6;       // bytes that closing may copy to give back unused room

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Rows of one table in another file, column by column: by name, wide ones by the position of their values.
struct Source {
  hsize_t rows = 0;
  std::vector<double> x;
  std::vector<Id> datasets;  // for each column, empty where there is none
};

// The rows of an earlier file up to time `until`; `strictly`: before it.
Source source_of(hid_t old, const std::string& name, const Table& table, double until, bool strictly) {
  Source source;
  source.datasets.resize(table.columns.size());
  if (!h5::exists(old, table.path("t"))) return source;
  const std::vector<double> times = h5::read_reals(old, table.path("t"));
  const auto later =
      std::find_if(times.begin(), times.end(), [&](double t) { return strictly ? !(t < until) : !(t <= until); });
  source.rows = static_cast<hsize_t>(later - times.begin());
  if (!table.x.empty()) source.x = h5::read_reals(old, table.path("x"));
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const std::string path = table.path(table.columns[c].field.name);
    if (!h5::exists(old, path)) continue;
    source.datasets[c] = Id(H5Dopen2(old, path.c_str(), H5P_DEFAULT));
    const auto sizes = h5::extents(source.datasets[c]);
    const bool fits = table.columns[c].wide ? sizes.size() == 2 && sizes[1] == source.x.size() : sizes.size() == 1;
    if (!fits || sizes[0] < source.rows) throw Failure("'" + name + "': " + path + " does not fit its t and x");
  }
  return source;
}

// `count` rows of a column in the order of the new table, NaN where the other file has nothing.
std::vector<double> rows_of(const Source& source, const Table& table, std::size_t c, hsize_t first, hsize_t count) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Column& column = table.columns[c];
  if (!source.datasets[c]) return std::vector<double>(count * table.width(column), nan);
  const hsize_t width = column.wide ? source.x.size() : 1;
  const std::vector<double> rows = h5::read_rows(source.datasets[c], first, count, width);
  if (!column.wide || source.x == table.x) return rows;
  std::vector<double> values(count * table.x.size(), nan);
  for (std::size_t k = 0; k < table.x.size(); ++k) {
    const auto at = std::find(source.x.begin(), source.x.end(), table.x[k]) - source.x.begin();
    for (hsize_t r = 0; r < count && at < std::ptrdiff_t(width); ++r)
      values[r * table.x.size() + k] = rows[r * width + hsize_t(at)];
  }
  return values;
}

void append_row(Table& table, double t, const std::vector<double>& row) {
  std::vector<const double*> values;
  values.reserve(row.size());
  for (const double& value : row) values.push_back(&value);
  table.append(t, values);
}

}  // namespace

struct RunFile::Writer {
  std::string path;       // final name
  std::string temporary;  // until the first frame
  Provenance provenance;
  RunLayout layout;
  std::vector<Table> tables;  // 0: frames; then the groups that are wanted
  std::size_t probes = 0, series = 0, events = 0, lyapunov = 0;  // which, 0 for none
  Id file;
  bool published = false;
  bool broken = false;  // a write has failed: no more are tried
  double next_flush = 0;

  Writer(const std::string& name, Provenance from, RunLayout&& what);
  ~Writer();
  Table table_of(const std::string& group, const Field& t, const std::vector<Field>& fields, bool wide) const;
  void create(const std::string& name, double bytes);
  void copy_rows(const std::vector<Source>& sources);
  void resume(const Resume& from);
  void flush();
  void write_and_show();
  void publish();
  void check_present() const;
  void rewrite(bool exact);
  void rewrite_into(const std::string& name, double bytes);
  void close();
  void drop_handles();
  int descriptor() const;  // of the open file
};

RunFile::Writer::Writer(const std::string& name, Provenance from, RunLayout&& what)
    : path(paths::resolved(name)),
      temporary(paths::hidden_sibling(path)),
      provenance(std::move(from)),
      layout(std::move(what)) {
  const Field time{"t", "time", "time"};
  tables.push_back(table_of("", time, layout.fields, true));
  tables[0].x_field = {"x", "length", "position"};
  tables[0].x = layout.x;
  tables[0].capacity = static_cast<hsize_t>(std::max<std::int64_t>(layout.frames, 1));
  const auto add = [&](const char* group, const Field& t, const std::vector<Field>& fields, bool wide) {
    tables.push_back(table_of(group, t, fields, wide));
    return tables.size() - 1;
  };
  if (!layout.probe_x.empty()) {
    probes = add("probes", time, {standard_field("psi"), standard_field("eta")}, true);
    tables[probes].x_field = {"x", "length", "position of the probe"};
    tables[probes].x = layout.probe_x;
  }
  if (!layout.series.empty()) series = add("series", time, layout.series, false);
  if (!layout.events.empty())
    events = add("events", {"t", "time", "time at which the event ends"}, layout.events, false);
  if (!layout.lyapunov.empty())
    lyapunov = add("lyapunov", {"t", "time", "end of the interval of time"}, layout.lyapunov, false);
}

Table RunFile::Writer::table_of(const std::string& group, const Field& t, const std::vector<Field>& fields,
                                bool wide) const {
  Table table(group, first_capacity, t);
  for (const Field& field : fields) table.columns.push_back({field, wide});
  return table;
}

// `bytes`: of rows that will follow at once.
void RunFile::Writer::create(const std::string& name, double bytes) {
  double room = 0;
  for (const Table& table : tables) {
    bytes += 8.0 * double(table.x.size());
    room += 8.0 * double(table.capacity) * double(table.row_width());
  }
  bytes += 16.0 * double(layout.friction_psi.size());
  for (const auto& profile : layout.profiles) bytes += 8.0 * double(profile.second.size());
  unlink(name.c_str());  // never write into a file that somebody else may still have open
  file = h5::create_file(name, bytes, 0, room);
  h5::write_header(file, provenance, "run");
  for (const auto& [key, text] : layout.texts) h5::write_attribute(file, key, text);
  for (const auto& [key, number] : layout.numbers) h5::write_attribute(file, key, number);
  if (!layout.friction_psi.empty()) {
    const Field at{"friction/psi", "length/time", "sliding velocity"};
    const Id scale = h5::write_fixed(file, at, {layout.friction_psi.size()}, layout.friction_psi);
    h5::make_scale(scale, "psi");
    const Field friction{"friction/F", "1", "steady friction over its amplitude"};
    h5::attach_scale(h5::write_fixed(file, friction, {layout.friction_F.size()}, layout.friction_F), scale, 0);
  }
  for (Table& table : tables) table.create(file);
  if (!layout.profiles.empty()) {
    const Id scale(H5Dopen2(file, "x", H5P_DEFAULT));
    for (const auto& [field, values] : layout.profiles)
      h5::attach_scale(h5::write_fixed(file, field, {values.size()}, values), scale, 0);
  }
  if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", name);
}

// The rows of other files, which are none of the table's own yet.
void RunFile::Writer::copy_rows(const std::vector<Source>& sources) {
  for (std::size_t which = 0; which < tables.size(); ++which) {
    Table& table = tables[which];
    const hsize_t rows = sources[which].rows, block = table.rows_at_once();
    for (hsize_t first = 0; first < rows; first += block) {
      const hsize_t count = std::min(block, rows - first);
      for (std::size_t c = 0; c < table.columns.size(); ++c)
        table.put_rows(descriptor(), table.columns[c], first, count,
                       rows_of(sources[which], table, c, first, count).data());
    }
    table.written = rows;
    if (rows > table.extent) table.set_extent(rows);
  }
}

// Creates the file with the rows up to the given time of an earlier one.
void RunFile::Writer::resume(const Resume& from) {
  const Id old = h5::open_file(from.path);
  (void)h5::read_header(old);
  std::vector<Source> sources;
  for (Table& table : tables) {
    const bool is_events = events != 0 && &table == &tables[events];  // known to have ended one step later
    sources.push_back(source_of(old, from.path, table, from.until, is_events));
    if (&table == &tables[0] && h5::exists(old, "t") && sources[0].x != table.x)
      throw Failure("'" + from.path + "' has another grid");
    table.capacity += sources.back().rows;
  }
  create(temporary, 0);
  copy_rows(sources);
}

// A new file with the same rows and the pending ones, with room for more (`exact`: for no more), which takes the
// place of this one.
void RunFile::Writer::rewrite(bool exact) {
  const std::string name = paths::hidden_sibling(path, ".new");
  double bytes = 0;
  for (const Table& table : tables) bytes += 8.0 * double(table.written + table.pending) * double(table.row_width());
  unlink(name.c_str());
  try {
    paths::reserve(name, bytes);  // fails while nothing is touched yet
  } catch (...) {
    unlink(name.c_str());
    throw;
  }
  for (Table& table : tables) {
    const hsize_t needed = table.written + table.pending;
    if (exact) table.capacity = needed;
    else if (needed > table.capacity) table.capacity = std::max(first_capacity, 2 * needed);
  }
  try {
    rewrite_into(name, bytes);
    paths::publish(name, published ? path : temporary);
  } catch (...) {
    drop_handles();  // the old file stands as it was
    unlink(name.c_str());
    throw;
  }
}

void RunFile::Writer::rewrite_into(const std::string& name, double bytes) {
  const Id old = std::move(file);
  std::vector<Source> sources;
  for (Table& table : tables) {
    sources.push_back({table.written, table.x, {}});
    for (Column& column : table.columns) sources.back().datasets.push_back(std::move(column.dataset));
  }
  create(name, bytes);
  copy_rows(sources);
  for (Table& table : tables) table.write_pending(descriptor());
  if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", name);
}

void RunFile::Writer::publish() {
  for (Table& table : tables)
    if (table.written == 0 && table.extent > 0) {
      table.set_extent(0);  // readers must not see the row that a table is made with; this gives up its chunks
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
  for (Table& table : tables) table.write_pending(descriptor());
  if (published) {
    for (Table& table : tables) table.show();
  } else if (tables[0].written > 0) {
    publish();
  }
}

void RunFile::Writer::close() {
  if (!file) return;
  flush();
  if (published && !broken) {
    double used = 0, unused = 0;
    for (const Table& table : tables) {
      used += 8.0 * double(table.written) * double(table.row_width());
      unused += 8.0 * double(table.capacity - table.written) * double(table.row_width());
    }
    if (unused > 0 && used <= cheap_copy) try {
        rewrite(true);
      } catch (const Failure&) {
        // no room for a copy: the file keeps its unused, sparse end
      }
  }
  for (Table& table : tables) table.close();
  if (file && H5Fclose(file.release()) < 0 && !broken) h5::fail("write", path);
}

void RunFile::Writer::drop_handles() {
  for (Table& table : tables) table.close();
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

RunFile::RunFile(MPI_Comm comm, std::string path, Provenance provenance, RunLayout layout,
                 std::optional<Resume> resume)
    : comm_(comm), last_time_(-std::numeric_limits<double>::infinity()) {
  on_root(comm_, [&] {
    try {
      writer_ = std::make_unique<Writer>(path, std::move(provenance), std::move(layout));
      h5::naming(writer_->path, [&] {
        if (resume) writer_->resume(*resume);
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
  table.append(t, {psi.data(), eta.data()});
}

void RunFile::series(double t, const std::vector<double>& row) {
  if (writer_ && writer_->series != 0) append_row(writer_->tables[writer_->series], t, row);
}
void RunFile::event(double end, const std::vector<double>& row) {
  if (writer_ && writer_->events != 0) append_row(writer_->tables[writer_->events], end, row);
}
void RunFile::lyapunov(double end, const std::vector<double>& row) {
  if (writer_ && writer_->lyapunov != 0) append_row(writer_->tables[writer_->lyapunov], end, row);
}

void RunFile::frame(double t, const std::vector<const double*>& fields) {
  if (!(t > last_time_)) throw std::logic_error("frames must follow each other in time");
  on_root(comm_, [&] {
    h5::naming(writer_->path, [&] {
      Table& table = writer_->tables[0];
      table.append(t, fields);
      const double bytes = 8.0 * double(table.pending) * double(table.x.size()) * double(table.columns.size());
      if (now() >= writer_->next_flush || bytes > 4e6) writer_->flush();
    });
  });
  ++frames_;
  last_time_ = t;
}

void RunFile::flush() {
  on_root(comm_, [&] { h5::naming(writer_->path, [&] { writer_->flush(); }); });
}

void RunFile::close() {
  on_root(comm_, [&] { h5::naming(writer_->path, [&] { writer_->close(); }); });
}

}  // namespace stickslip
