#include "stickslip/output/run_file.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/broadcast.hpp"
#include "base/paths.hpp"
#include "output/datasets.hpp"
#include "output/earlier_rows.hpp"
#include "output/growing_table.hpp"
#include "output/node_rows.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

namespace {

using h5::Column;
using h5::Id;
using Table = h5::GrowingTable;

const hsize_t first_capacity = 4096;  // rows of a table whose length nobody knows
const double cheap_copy = 64e6;       // bytes that closing may copy to give back unused room
const double most_pending = 4e6;      // bytes of frames, of all ranks, or of other rows that wait for a flush

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

struct RunFile::Writer {
  std::string path;       // final name
  std::string temporary;  // until the first frame
  std::string replacing;  // the name of a file under way that will take the place of this one
  Provenance provenance;
  RunLayout layout;
  std::vector<Table> tables;  // 0: frames; then the groups that are wanted
  Id file;
  std::int64_t made = 0;  // files so far: the fields lie elsewhere in each
  bool published = false;
  double next_flush = 0;

  Writer(const std::string& name, Provenance from, RunLayout&& what);
  ~Writer();
  Table table_of(const std::string& group, const Field& t, const std::vector<Field>& fields, bool wide) const;
  void create(const std::string& name, double bytes);
  void copy_rows(const std::vector<h5::EarlierRows>& sources);
  void resume(const Resume& from);
  std::string name_now() const { return !replacing.empty() ? replacing : published ? path : temporary; }
  std::vector<h5::ColumnPlace> places() const;
  void make_room();
  void show_rows();
  void publish();
  void check_present() const;
  void replace(bool exact);
  void replace_into(const std::string& name, double bytes);
  void abandon();
  void close(bool broken);
  void drop_handles();
  int descriptor() const;  // of the open file
};

RunFile::Writer::Writer(const std::string& name, Provenance from, RunLayout&& what)
    : path(paths::resolved(name)), temporary(paths::hidden_sibling(path)), provenance(std::move(from)),
      layout(std::move(what)) {
  const Field time{"t", "time", "time"};
  tables.push_back(table_of("", time, layout.fields, true));
  tables[0].x = {{"x", "length", "position"}, static_cast<hsize_t>(layout.slab.nodes()), layout.x};
  tables[0].by_ranks = true;
  tables[0].capacity = static_cast<hsize_t>(std::max<std::int64_t>(layout.frames, 1));
  const auto add = [&](const char* group, const Field& t, const std::vector<Field>& fields) {
    if (!fields.empty()) tables.push_back(table_of(group, t, fields, false));
  };
  if (!layout.probe_x.empty()) {
    tables.push_back(table_of("probes", time, {standard_field("psi"), standard_field("eta")}, true));
    tables.back().x = {{"x", "length", "position of the probe"},
                       layout.probe_x.size(),
                       [places = layout.probe_x](std::int64_t k) { return places[k]; }};
  }
  add("series", time, layout.series);
  const Field end{"t", "time", "time at which the event ends"};
  add("events/rupture", end, layout.rupture);  // readers see the nodes of an event before it
  add("events", end, layout.events);
  add("lyapunov", {"t", "time", "end of the interval of time"}, layout.lyapunov);
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
    bytes += 8.0 * double(table.x.size);
    room += 8.0 * double(table.capacity) * double(table.row_width());
  }
  bytes += 16.0 * double(layout.friction_psi.size()) + 24.0 * double(layout.load_t.size());
  bytes += 8.0 * double(layout.profiles.size()) * double(layout.slab.nodes());
  unlink(name.c_str());  // never write into a file that somebody else may still have open
  file = h5::create_file(name, bytes, 0, room);
  h5::write_header(file, provenance, "run");
  for (const auto& [key, text] : layout.texts) h5::write_attribute(file, key, text);
  for (const auto& [key, number] : layout.numbers) h5::write_attribute(file, key, number);
  const auto add = [&](const Field& at, const std::vector<double>& x,
                       const std::vector<std::pair<Field, const std::vector<double>*>>& columns) {
    if (x.empty()) return;
    const Id scale = h5::write_fixed(file, at, {x.size()}, x);
    h5::make_scale(scale, paths::file(at.name));
    for (const auto& [field, values] : columns)
      h5::attach_scale(h5::write_fixed(file, field, {x.size()}, *values), scale, 0);
  };
  add({"friction/psi", "length/time", "sliding velocity"}, layout.friction_psi,
      {{{"friction/F", "1", "steady friction over its amplitude"}, &layout.friction_F}});
  add({"load/t", "time", "corner of the load"}, layout.load_t,
      {{{"load/before", "length/time", "velocity of the driving plate right before it"}, &layout.load_before},
       {{"load/behind", "length/time", "velocity of the driving plate right behind it"},
        &layout.load_behind}});
  for (Table& table : tables) table.create(file);
  if (!layout.profiles.empty()) {
    const Id scale(H5Dopen2(file, "x", H5P_DEFAULT));
    for (const auto& [field, at] : layout.profiles)
      h5::attach_scale(h5::write_line(file, field, static_cast<hsize_t>(layout.slab.nodes()), at), scale, 0);
  }
  ++made;
  if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", name);
}

std::vector<h5::ColumnPlace> RunFile::Writer::places() const {
  std::vector<h5::ColumnPlace> places;
  for (std::size_t c = 1; c < tables[0].columns.size(); ++c) places.push_back(tables[0].columns[c].place);
  return places;
}

// The rows of other files, which are none of the table's own yet.
void RunFile::Writer::copy_rows(const std::vector<h5::EarlierRows>& sources) {
  const int into = descriptor();
  const auto put = [into](std::int64_t at, const double* values, hsize_t count) {
    paths::write_all(into, values, count * sizeof(double), at);
  };
  for (std::size_t which = 0; which < tables.size(); ++which) {
    Table& table = tables[which];
    const h5::EarlierRows& source = sources[which];
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      const Column& column = table.columns[c];
      if (table.by_ranks && column.wide) {
        h5::copy_field(source, table, c, put);
        continue;
      }
      const hsize_t block =
          std::max<hsize_t>(1, h5::largest_piece / std::max<hsize_t>(1, table.width(column)));
      for (hsize_t first = 0; first < source.rows; first += block) {
        const hsize_t count = std::min(block, source.rows - first);
        column.place.put_rows(first, count, h5::rows_of(source, table, c, first, count).data(), put);
      }
    }
    table.written = source.rows;
    if (source.rows > table.extent) table.set_extent(source.rows);
  }
}

// Creates the file with the rows up to the given time of an earlier one.
void RunFile::Writer::resume(const Resume& from) {
  const Id old = h5::open_file(from.path);
  (void)h5::read_header(old);
  std::vector<h5::EarlierRows> sources;
  for (Table& table : tables) {
    const bool is_events = table.group.rfind("events", 0) == 0;  // known to have ended one step later
    const bool is_later = is_events || (layout.tells_rows_later && !table.group.empty());
    sources.push_back(h5::earlier_rows(old, from.path, table, from.until, is_later));
    table.capacity += sources.back().rows;
    if (!table.by_ranks) table.capacity = std::min(table.capacity, Table::most_rows);
  }
  create(temporary, 0);
  copy_rows(sources);
}

// A new file with the same rows, with room for those in memory and more (`exact`: for no more), which is to
// take the place of this one.
void RunFile::Writer::replace(bool exact) {
  const std::string name = paths::hidden_sibling(path, ".new");
  double bytes = 0;
  for (const Table& table : tables) {
    table.check_rows(table.written + table.pending);
    bytes += 8.0 * double(table.written + table.pending) * double(table.row_width());
  }
  unlink(name.c_str());
  try {
    paths::reserve(name, bytes);  // fails while nothing is touched yet
  } catch (...) {
    unlink(name.c_str());
    throw;
  }
  for (Table& table : tables) {
    const hsize_t needed = table.written + table.pending;
    if (exact)
      table.capacity = needed;
    else if (needed > table.capacity)
      table.capacity = std::min(std::max(first_capacity, 2 * needed), Table::most_rows);
  }
  replacing = name;
  replace_into(name, bytes);
}

void RunFile::Writer::replace_into(const std::string& name, double bytes) {
  const Id old = std::move(file);
  std::vector<h5::EarlierRows> sources;
  for (Table& table : tables) {
    sources.push_back({table.written, {}, {}});
    if (!table.by_ranks)
      for (hsize_t k = 0; k < table.x.size; ++k)
        sources.back().x.push_back(table.x.at(static_cast<std::int64_t>(k)));
    for (Column& column : table.columns) sources.back().datasets.push_back(std::move(column.dataset));
  }
  create(name, bytes);
  copy_rows(sources);
}

// The old file stands as it was.
void RunFile::Writer::abandon() {
  if (replacing.empty()) return;
  drop_handles();
  unlink(replacing.c_str());
  replacing.clear();
}

void RunFile::Writer::publish() {
  for (Table& table : tables)
    if (table.written == 0 && table.extent > 0) {
      // readers must not see the row that a table is made with; this gives up its chunks
      table.set_extent(0);
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

// Writing goes on without an error into a file that was removed: whoever waits for the result should hear of
// it.
void RunFile::Writer::check_present() const {
  struct stat named {
  }, open_one{};
  if (fstat(descriptor(), &open_one) != 0 || stat(path.c_str(), &named) != 0)
    throw Failure("cannot write '" + path + "': it was removed while the run went on");
  if (named.st_ino != open_one.st_ino || named.st_dev != open_one.st_dev)
    throw Failure("cannot write '" + path + "': another file has taken its place while the run went on");
}

// Before rows are written.
void RunFile::Writer::make_room() {
  if (published) check_present();
  bool room = true;
  for (const Table& table : tables) room = room && table.written + table.pending <= table.capacity;
  if (!room) replace(false);
}

// Once the ranks have written theirs.
void RunFile::Writer::show_rows() {
  for (Table& table : tables) table.write_pending(descriptor());
  if (!replacing.empty()) {
    if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", replacing);
    paths::publish(replacing, published ? path : temporary);
    replacing.clear();
  }
  if (published) {
    for (Table& table : tables) table.show();
  } else if (tables[0].written > 0) {
    publish();
  }
}

void RunFile::Writer::close(bool broken) {
  if (!file) return;
  if (published && !broken) {
    double used = 0, unused = 0;
    for (const Table& table : tables) {
      used += 8.0 * double(table.written) * double(table.row_width());
      unused += 8.0 * double(table.capacity - table.written) * double(table.row_width());
    }
    if (unused > 0 && used <= cheap_copy) try {
        replace(true);
        show_rows();
      } catch (const Failure&) {
        abandon();  // no room for a copy: the file keeps its unused, sparse end
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
  abandon();
  drop_handles();
  if (!published) unlink(temporary.c_str());
}

RunFile::RunFile(MPI_Comm comm, std::string path, Provenance provenance, RunLayout layout,
                 std::optional<Resume> resume)
    : comm_(comm), rows_(std::make_unique<NodeRows>(comm, layout.slab, layout.fields.size(), layout.by_root)),
      last_time_(-std::numeric_limits<double>::infinity()) {
  on_root(comm_, [&] {
    try {
      writer_ = std::make_unique<Writer>(path, std::move(provenance), std::move(layout));
      h5::naming(writer_->path, [&] {
        if (resume)
          writer_->resume(*resume);
        else
          writer_->create(writer_->temporary, 0);
      });
      path_ = writer_->path;
      frames_ = static_cast<std::int64_t>(writer_->tables[0].written);
      if (frames_ > 0)
        last_time_ =
            h5::read_rows(writer_->tables[0].columns[0].dataset, writer_->tables[0].written - 1, 1, 1)[0];
    } catch (const Failure& e) {
      throw UsageError("out_file '" + path + "': " + e.what());  // nothing has been computed yet
    }
  });
  broadcast(path_, comm_);
  broadcast(frames_, comm_);
  broadcast(last_time_, comm_);
}

// Of frames in memory the other ranks' part is lost; everything else is kept.
RunFile::~RunFile() {
  if (!writer_ || closed_) return;
  try {
    if (ranks_in(comm_) == 1) {
      close();
    } else {
      writer_->tables[0].forget_pending();
      if (!broken_ && writer_->published) {
        writer_->make_room();
        writer_->show_rows();
      }
      writer_->close(true);
    }
  } catch (...) {
    // either an error is under way already, or the caller did not ask for one by close()
  }
}

void RunFile::row(const char* group, double t, const std::vector<double>& values) {
  for (std::size_t k = 1; writer_ && k < writer_->tables.size(); ++k) {
    Table& table = writer_->tables[k];
    if (table.group != group) continue;
    if (1 + values.size() != table.row_width())
      throw std::logic_error("a row of another length than its table");
    std::vector<const double*> columns;
    for (std::size_t at = 0; at < values.size(); at += table.width(table.columns.back()))
      columns.push_back(&values[at]);
    table.append(t, columns);
  }
  waiting_ += 8. * double(1 + values.size());
  if (waiting_ > most_pending) flush();  // however long it is until the next frame
}

std::int64_t RunFile::rows(const std::string& group) const {
  std::int64_t rows = 0;
  if (writer_)
    for (const Table& table : writer_->tables)
      if (table.group == group) rows = std::int64_t(table.written + table.pending);
  return rows;
}

void RunFile::frame(double t, const std::vector<const double*>& fields) {
  if (!(t > last_time_)) throw std::logic_error("frames must follow each other in time");
  int due = 0;
  if (writer_) {
    Table& table = writer_->tables[0];
    table.append(t, {});
    const double bytes = 8.0 * double(table.pending) * double(table.row_width());
    due = now() >= writer_->next_flush || bytes > most_pending ? 1 : 0;
  }
  broadcast(due, comm_);
  if (due)
    flush_with(&fields);
  else
    rows_->append(fields);
  ++frames_;
  last_time_ = t;
}

// `last`: a row of fields that is not in memory yet.
void RunFile::flush_with(const std::vector<const double*>* last) {
  if (broken_) return;
  waiting_ = 0;
  const double begin = now();
  try {
    std::int64_t told[2] = {0, made_};  // the first row to write, and the number of the file
    std::vector<h5::ColumnPlace> places;
    std::string name;
    on_root(comm_, [&] {
      h5::naming(path_, [&] {
        writer_->make_room();
        told[0] = static_cast<std::int64_t>(writer_->tables[0].written);
        told[1] = writer_->made;
        if (told[1] == made_) return;
        places = writer_->places();
        name = writer_->name_now();
      });
    });
    broadcast(told, comm_);
    if (told[1] != made_) rows_->open(name, places);
    made_ = told[1];
    h5::naming(path_, [&] { rows_->write(told[0], last); });
    on_root(comm_, [&] { h5::naming(path_, [&] { writer_->show_rows(); }); });
  } catch (...) {
    broken_ = true;
    if (writer_) writer_->abandon();
    throw;
  }
  // at most a twentieth of the time is spent here
  if (writer_) writer_->next_flush = now() + 20 * (now() - begin);
}

void RunFile::flush() { flush_with(nullptr); }

void RunFile::close() {
  if (closed_) return;
  closed_ = true;
  flush();
  rows_->close();
  on_root(comm_, [&] { h5::naming(path_, [&] { writer_->close(broken_); }); });
}

}  // namespace stickslip
