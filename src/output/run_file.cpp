#include "stickslip/output/run_file.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <stdexcept>

#include "base/process.hpp"
#include "output/hdf5_tools.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"

namespace stickslip {

namespace {

using h5::EarlierRows;
using h5::Id;
using h5::Put;
using h5::Table;

const hsize_t first_capacity = 4096;  // rows of a table whose length nobody knows
const double cheap_copy = 64e6;       // bytes that closing may copy to give back unused room
const double most_pending = 4e6;      // bytes of frames, of all ranks, or of other rows that wait for a flush

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Frames; then the groups of rows.
std::vector<Table> tables_of(const RunLayout& layout) {
  std::vector<Table> tables;
  tables.emplace_back("", standard_field("t"), layout.fields,
                      hsize_t(std::max<std::int64_t>(layout.frames, 1)),
                      h5::Axis{{"x", "length", "position"}, hsize_t(layout.slab.nodes()), layout.x});
  tables[0].keep_by_ranks(layout.slab.kept());
  for (const RowGroup& group : layout.groups)
    tables.emplace_back(group.name, group.t, group.fields, first_capacity,
                        h5::Axis{{"x", "length", "position of the probe"},
                                 group.places.size(),
                                 [at = group.places](std::int64_t k) { return at[std::size_t(k)]; }});
  return tables;
}

}  // namespace

// Rank 0 has the file, and makes, writes, counts and shows its rows; the others have their part of frames.
struct RunFile::Impl {
  MPI_Comm comm;
  Provenance provenance;
  RunLayout layout;
  std::vector<Table> tables;
  std::string path, temporary;  // the final name; the one until the first frame
  std::string replacing;        // of a file under way that will take the place of this one
  Id file;
  bool published = false, closed = false;
  bool broken = false;  // a write has failed: no more are tried
  double next_flush = 0;
  double waiting = 0;  // bytes of rows in memory, but for those of frames; the same on every rank
  double last_time = -std::numeric_limits<double>::infinity();

  Impl(MPI_Comm ranks, const std::string& name, Provenance from, RunLayout what)
      : comm(ranks), provenance(std::move(from)), layout(std::move(what)), tables(tables_of(layout)),
        path(paths::resolved(name)), temporary(paths::hidden_sibling(path)) {}
  ~Impl() {
    abandon();
    drop_handles();
    if (is_root() && !published) unlink(temporary.c_str());
  }

  bool is_root() const { return rank_in(comm) == 0; }
  Table* table(const std::string& group) {
    const auto found = std::find_if(tables.begin() + 1, tables.end(),
                                    [&](const Table& table) { return table.group == group; });
    return is_root() && found != tables.end() ? &*found : nullptr;
  }
  template <class Body>
  void by_root(const Body& body) const {
    on_root(comm, [&] { h5::naming(path, body); });
  }

  // `bytes`: of rows that will follow at once.
  void create(const std::string& name, double bytes) {
    double room = 0;
    for (const Table& table : tables) {
      bytes += 8. * double(table.x.size);
      room += double(table.capacity) * table.row_bytes();
    }
    for (const FixedTable& table : layout.tables)
      bytes += 8. * double(table.at.size()) * double(1 + table.columns.size());
    bytes += 8. * double(layout.profiles.size()) * double(layout.slab.nodes());
    unlink(name.c_str());  // never write into a file that somebody else may still have open
    file = h5::create_file(name, bytes, 0, room);
    h5::write_header(file, provenance, "run");
    for (const auto& [key, text] : layout.texts) h5::write_attribute(file, key, text);
    for (const auto& [key, number] : layout.numbers) h5::write_attribute(file, key, number);
    for (const FixedTable& table : layout.tables) {
      const Id scale = h5::write_fixed(file, table.axis, {table.at.size()}, table.at);
      h5::make_scale(scale, paths::file(table.axis.name));
      for (const auto& [field, values] : table.columns)
        h5::attach_scale(h5::write_fixed(file, field, {values.size()}, values), scale, 0);
    }
    for (Table& table : tables) table.create(file);
    if (!layout.profiles.empty()) {
      const Id scale(H5Dopen2(file, "x", H5P_DEFAULT));
      for (const auto& [field, at] : layout.profiles)
        h5::attach_scale(h5::write_line(file, field, hsize_t(layout.slab.nodes()), at), scale, 0);
    }
    if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", name);
  }

  // A file with these rows of another one.
  void make(const std::string& name, double bytes, const std::vector<EarlierRows>& earlier) {
    create(name, bytes);
    for (std::size_t k = 0; k < earlier.size(); ++k) tables[k].take_over(earlier[k], direct());
  }

  // Of the file of a run that goes on, for which the tables get room.
  std::vector<EarlierRows> rows_until(const Resume& from) {
    const Id old = h5::open_file(from.path);
    (void)h5::read_header(old);
    std::vector<EarlierRows> earlier;
    for (Table& table : tables) {
      const bool is_events = table.group.rfind("events", 0) == 0;  // known to have ended one step later
      const bool is_later = is_events || (layout.tells_rows_later && !table.group.empty());
      earlier.push_back(table.earlier(old, from.path, from.until, is_later));
      table.capacity += earlier.back().rows;
      if (!table.by_ranks) table.capacity = std::min(table.capacity, Table::most_rows);
    }
    return earlier;
  }

  // A new file with the same rows, with room for those in memory and more (`exact`: for no more), which is to
  // take the place of this one.
  void replace(bool exact) {
    const std::string name = paths::hidden_sibling(path, ".new");
    double bytes = 0;
    for (const Table& table : tables) {
      table.check_rows(table.rows());
      bytes += double(table.rows()) * table.row_bytes();
    }
    unlink(name.c_str());
    try {
      paths::reserve(name, bytes);  // fails while nothing is touched yet
    } catch (...) {
      unlink(name.c_str());
      throw;
    }
    const Id old = std::move(file);
    std::vector<EarlierRows> own;
    for (Table& table : tables) {
      own.push_back(table.give_up());
      if (exact)
        table.capacity = table.rows();
      else if (table.rows() > table.capacity)
        table.capacity = std::min(std::max(first_capacity, 2 * table.rows()), Table::most_rows);
    }
    replacing = name;
    make(name, bytes, own);
  }

  // The old file stands as it was.
  void abandon() {
    if (replacing.empty()) return;
    drop_handles();
    unlink(replacing.c_str());
    replacing.clear();
  }

  void drop_handles() {
    for (Table& table : tables) table.close();
    file.reset();
  }

  // Into the open file.
  Put direct() const {
    return [into = descriptor()](std::int64_t at, const double* values, std::size_t count) {
      paths::write_all(into, values, count * sizeof(double), at);
    };
  }

  int descriptor() const {
    int* number = nullptr;
    if (H5Fget_vfd_handle(file, H5P_DEFAULT, reinterpret_cast<void**>(&number)) < 0) h5::fail("write", file);
    return *number;
  }

  // Writing goes on without an error into a file that was removed: whoever waits for the result should hear
  // of it.
  void check_present() const {
    struct stat named {
    }, open_one{};
    if (fstat(descriptor(), &open_one) != 0 || stat(path.c_str(), &named) != 0)
      throw Failure("cannot write '" + path + "': it was removed while the run went on");
    if (named.st_ino != open_one.st_ino || named.st_dev != open_one.st_dev)
      throw Failure("cannot write '" + path + "': another file has taken its place while the run went on");
  }

  void make_room() {
    if (published) check_present();
    if (std::any_of(tables.begin(), tables.end(), [](const Table& t) { return t.rows() > t.capacity; }))
      replace(false);
  }

  // Of frames what this rank has, those in memory and then `last`, a row that is not.
  void give_frames(const Give& give, const std::vector<const double*>* last) const {
    const Slab& slab = layout.slab;
    const Table& frames = tables[0];
    const auto give_rows = [&](Piece piece, const double* values) {
      piece.first = slab.first();
      piece.count = std::int64_t(slab.kept());
      if (slab.is_one_run()) return give(piece, values);
      for (std::int64_t end = piece.row + std::exchange(piece.rows, 1); piece.row < end; ++piece.row) {
        slab.place(values, [&](std::int64_t node, std::int64_t nodes, const double* part) {
          give({piece.list, piece.row, 1, node, nodes}, part);
        });
        values += slab.kept();
      }
    };
    const auto row = std::int64_t(frames.written), rows = std::int64_t(frames.pending) - (last ? 1 : 0);
    for (std::size_t c = 1; c < frames.columns.size() && slab.kept() > 0; ++c) {
      give_rows({std::int64_t(c), row, rows, 0, 0}, frames.columns[c].pending.data());
      if (last) give_rows({std::int64_t(c), row + rows, 1, 0, 0}, (*last)[c - 1]);
    }
  }

  void show_rows() {
    for (Table& table : tables) table.advance();
    if (!replacing.empty()) {
      if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) h5::fail("write", replacing);
      paths::publish(replacing, published ? path : temporary);
      replacing.clear();
    }
    if (published)
      for (Table& table : tables) table.show();
    else if (tables[0].written > 0)
      publish();
  }

  void publish() {
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

  // `last`: a row of fields that is not in memory yet.
  void flush(const std::vector<const double*>* last) {
    if (broken) return;
    waiting = 0;
    const double begin = now();
    try {
      by_root([&] { make_room(); });
      const Put put = is_root() ? direct() : Put();
      const auto give = [&](const Give& to) { give_frames(to, last); };
      const auto write = [&](const Piece& p, const double* values) {
        tables[0].columns[std::size_t(p.list)].put(hsize_t(p.row), hsize_t(p.rows), hsize_t(p.first),
                                                   hsize_t(p.count), values, put);
      };
      h5::naming(path, [&] { collect(comm, give, write); });
      by_root([&] {
        for (const Table& table : tables) table.write_pending(put);
        show_rows();
      });
      if (!is_root()) tables[0].advance();
    } catch (...) {
      broken = true;
      abandon();
      throw;
    }
    next_flush = now() + 20 * (now() - begin);  // at most a twentieth of the time is spent here
  }

  void end() {
    if (!file) return;
    double used = 0, unused = 0;
    for (const Table& table : tables) {
      used += double(table.written) * table.row_bytes();
      unused += double(table.capacity - table.written) * table.row_bytes();
    }
    if (published && !broken && unused > 0 && used <= cheap_copy) try {
        replace(true);
        show_rows();
      } catch (const Failure&) {
        abandon();  // no room for a copy: the file keeps its unused, sparse end
      }
    for (Table& table : tables) table.close();
    if (file && H5Fclose(file.release()) < 0 && !broken) h5::fail("write", path);
  }

  // Of frames in memory the other ranks' part is lost; everything else is kept.
  void end_alone() {
    tables[0].forget_pending();
    if (!broken && published) {
      make_room();
      for (const Table& table : tables) table.write_pending(direct());
      show_rows();
    }
    broken = true;
    end();
  }
};

RunFile::RunFile(MPI_Comm comm, std::string path, Provenance provenance, RunLayout layout,
                 std::optional<Resume> resume)
    : m_(std::make_unique<Impl>(comm, path, std::move(provenance), std::move(layout))) {
  Impl& m = *m_;
  Table& frames = m.tables[0];
  on_root(comm, [&] {
    try {
      h5::naming(m.path, [&] {
        m.make(m.temporary, 0, resume ? m.rows_until(*resume) : std::vector<EarlierRows>());
        if (frames.written > 0)
          m.last_time = h5::read_rows(frames.columns[0].dataset, frames.written - 1, 1, 1)[0];
      });
    } catch (const Failure& e) {
      throw UsageError("out_file '" + path + "': " + e.what());  // nothing has been computed yet
    }
  });
  broadcast(m.path, comm);
  broadcast(frames.written, comm);
  broadcast(m.last_time, comm);
}

RunFile::~RunFile() {
  Impl& m = *m_;
  if (!m.is_root() || m.closed) return;
  try {
    if (ranks_in(m.comm) == 1)
      close();
    else
      m.end_alone();
  } catch (...) {
    // either an error is under way already, or the caller did not ask for one by close()
  }
}

void RunFile::row(const char* group, double t, const std::vector<double>& values) {
  if (Table* const table = m_->table(group)) table->append(t, values);
  m_->waiting += 8. * double(1 + values.size());
  if (m_->waiting > most_pending) flush();  // however long it is until the next frame
}

std::int64_t RunFile::rows(const std::string& group) const {
  const Table* const table = m_->table(group);
  return table ? std::int64_t(table->rows()) : 0;
}

void RunFile::frame(double t, const std::vector<const double*>& fields) {
  Impl& m = *m_;
  if (!(t > m.last_time)) throw std::logic_error("frames must follow each other in time");
  Table& frames = m.tables[0];
  frames.columns[0].append(&t);
  ++frames.pending;
  bool due = now() >= m.next_flush || double(frames.pending) * frames.row_bytes() > most_pending;
  broadcast(due, m.comm);
  if (due)
    m.flush(&fields);
  else
    for (std::size_t k = 0; k < fields.size(); ++k) frames.columns[k + 1].append(fields[k]);
  m.last_time = t;
}

void RunFile::flush() { m_->flush(nullptr); }

void RunFile::close() {
  if (std::exchange(m_->closed, true)) return;
  flush();
  m_->by_root([&] { m_->end(); });
}

std::int64_t RunFile::frames() const { return std::int64_t(m_->tables[0].rows()); }
double RunFile::last_time() const { return m_->last_time; }

namespace {

constexpr std::int64_t small_cell = largest_piece;  // nodes

}  // namespace

Slab Slab::even(MPI_Comm comm, std::int64_t nodes) {
  const std::int64_t rank = rank_in(comm), ranks = ranks_in(comm);
  Slab slab;
  slab.nodes_ = slab.cell_ = nodes;
  slab.first_ = nodes * rank / ranks;
  slab.owned_ = slab.kept_ = std::size_t(nodes * (rank + 1) / ranks - slab.first_);
  return slab;
}

Slab::Slab(const Model& model, std::int64_t nodes)
    : comm_(model.comm()), nodes_(nodes), cell_(model.scene().n), cells_(nodes / cell_),
      first_(model.first()), owned_(model.local()), kept_(owned_),
      gathered_(cells_ > 1 && cell_ <= small_cell) {
  const int ranks = ranks_in(comm_);
  if (ranks == 1 && rank_in(PETSC_COMM_WORLD) != 0) {  // each rank has the whole: rank 0 gives it
    owned_ = kept_ = 0;
    gathered_ = false;
  }
  if (!gathered_) return;
  counts_.resize(ranks);
  offsets_.assign(ranks, 0);
  const int own = int(owned_);
  SS_TRY(MPI_Allgather(&own, 1, MPI_INT, counts_.data(), 1, MPI_INT, comm_));
  for (std::size_t k = 1; k < counts_.size(); ++k) offsets_[k] = offsets_[k - 1] + counts_[k - 1];
  kept_ = rank_in(comm_) == 0 ? std::size_t(cell_) : 0;
}

void Slab::take(const double* own, int stride, std::vector<double>& to) const {
  std::vector<double> part(gathered_ ? owned_ : 0);
  const std::size_t before = to.size();
  to.resize(before + kept_);
  double* const into = gathered_ ? part.data() : to.data() + before;
  for (std::size_t i = 0; i < owned_; ++i) into[i] = own[i * std::size_t(stride)];
  if (gathered_)
    SS_TRY(MPI_Gatherv(part.data(), int(owned_), MPI_DOUBLE, to.data() + before, counts_.data(),
                       offsets_.data(), MPI_DOUBLE, 0, comm_));
}

void Slab::place(const double* values, const Put& put) const {
  if (kept_ == 0) return;
  if (!gathered_) {
    for (std::int64_t k = 0; k < cells_; ++k) put(k * cell_ + first_, std::int64_t(kept_), values);
    return;
  }
  std::vector<double> repeated(std::min(nodes_, small_cell));
  for (std::int64_t at = 0; at < nodes_; at += small_cell) {
    const std::int64_t count = std::min(small_cell, nodes_ - at);
    for (std::int64_t k = 0; k < count; ++k) repeated[k] = values[(at + k) % cell_];
    put(at, count, repeated.data());
  }
}

Gather::Gather(Vec like, PetscInt dof)
    : comm_(PetscObjectComm(reinterpret_cast<PetscObject>(like))), components_(dof) {
  const PetscInt* first;  // of each rank, and the length
  SS_TRY(VecGetOwnershipRanges(like, &first));
  const int ranks = ranks_in(comm_);
  first_.assign(first, first + ranks);
  for (int k = 0; k < ranks; ++k) count_.push_back(static_cast<int>(first[k + 1] - first[k]));
  size_ = static_cast<std::size_t>(first[ranks]);
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
  const int rank = rank_in(comm_);
  std::vector<double> out(rank == 0 ? size_ : 0);
  SS_TRY(MPI_Gatherv(Reading(v), count_[rank], MPI_DOUBLE, out.data(), count_.data(), first_.data(),
                     MPI_DOUBLE, 0, comm_));
  return out;
}

void Gather::spread(const std::vector<double>& values, Vec v) {
  on_root(comm_, [&] {
    if (values.size() != size_) throw std::logic_error("a vector of another length");
  });
  SS_TRY(MPI_Scatterv(values.data(), count_.data(), first_.data(), MPI_DOUBLE, Writing(v),
                      count_[rank_in(comm_)], MPI_DOUBLE, 0, comm_));
}

}  // namespace stickslip
