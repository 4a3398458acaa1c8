// The file of a run, which grows while others read it, and which values a rank has of it.
//
// Which values of a scene's nodes a rank has, and where they stand in a row of a file.
//
// Every rank has the nodes that it owns. Where the model is one of several equal cells of a scene, small
// cells (below a megabyte a field) are brought to rank 0, which repeats them; of large ones each rank gives
// its part once for each cell. So no rank has more than its part, or a megabyte a field.
#pragma once

#include <petscsys.h>
#include <petscvec.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/base/provenance.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/result_file.hpp"

namespace stickslip {

class Slab {
 public:
  // Nodes of a scene without a model, dealt out evenly. Not collective.
  static Slab even(MPI_Comm comm, std::int64_t nodes);
  Slab() = default;
  // Of the scene with so many nodes, of which the model may be one of several equal cells. Collective.
  Slab(const Model& model, std::int64_t nodes);

  std::int64_t nodes() const { return nodes_; }  // of the whole scene
  std::size_t kept() const { return kept_; }     // values a field that this rank has

  // Appends what this rank has of a field whose values on its own nodes stand at own[0], own[stride], ...
  // Collective.
  void take(const double* own, int stride, std::vector<double>& to) const;

  // Calls put(first, count, values) for every run of nodes that this rank has, `values` being those.
  using Put = std::function<void(std::int64_t first, std::int64_t count, const double* values)>;
  void place(const double* values, const Put& put) const;

  // The values that this rank has are one run of nodes from here on, and stand in the file once.
  bool is_one_run() const { return cells_ == 1; }
  std::int64_t first() const { return first_; }

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
  std::int64_t nodes_ = 0, cell_ = 0, cells_ = 1;
  std::int64_t first_ = 0;  // of the cell's nodes the first that this rank owns
  std::size_t owned_ = 0, kept_ = 0;
  bool gathered_ = false;              // rank 0 has the cell
  std::vector<int> counts_, offsets_;  // of the ranks, for that
};

// Brings an interleaved vector (dof values a node, nodes in order) to rank 0, and back: for files, which rank
// 0 writes.
class Gather {
 public:
  Gather(Vec like, PetscInt dof);
  // The components, each one value a node, on rank 0; empty vectors elsewhere. Valid until the next call.
  // Collective.
  const std::vector<std::vector<double>>& components(Vec v);
  // The whole vector as it stands, on rank 0. Collective.
  std::vector<double> interleaved(Vec v);
  // The inverse of interleaved(): `values` of rank 0 into v. Collective.
  void spread(const std::vector<double>& values, Vec v);

 private:
  MPI_Comm comm_;
  std::vector<int> first_, count_;  // of each rank
  std::size_t size_;                // of all
  std::vector<std::vector<double>> components_;
};

// Results in HDF5, one file a command; here that of a run. Rank 0 alone writes it: the other ranks hand it
// the values of their nodes in pieces of a megabyte, and when all are written it shows the frame
// to readers. No rank ever has more of a field than its part.
//
// Every file carries the root attributes `program`, `version`, `git`, `command_line`, `options` (one JSON
// object of texts), `date`, `ranks` and `kind` (the command, or `checkpoint`), dimension scales and `units`,
// so that xarray.open_dataset(file, engine="h5netcdf") opens it. It is made under a hidden temporary name in
// the same folder and renamed when it holds something; a file of the same name stands until then.
//
// The file of a run can be read at every moment from then on, also after kill -9. Nothing but two things is
// ever written to it in place: raw rows beyond the extents that a reader sees, and then those extents, each
// eight bytes in the header of its dataset, time last. All else (headers, attributes, scales, chunk index) is
// complete before the rename: the chunks, each as long as the table may grow, are allocated at once, sparse
// on disk. A table that outgrows its chunks is copied into a new file, which then takes the old one's place.

// Rows against times of their own in a group of the file (RunFile::row): GROUP/NAME of t, or of (t, x) where
// there are places.
struct RowGroup {
  std::string name;
  Field t;
  std::vector<Field> fields;
  std::vector<double> places = {};
};

// What is known from the start: columns of one axis, not empty.
struct FixedTable {
  Field axis;
  std::vector<double> at;
  std::vector<std::pair<Field, std::vector<double>>> columns;
};

// What the file of a run holds. Significant on rank 0, but for fields and slab.
struct RunLayout {
  Slab slab;  // whose nodes are whose
  std::function<double(std::int64_t)> x;  // of a node
  std::vector<Field> fields;     // of (t, x): psi, eta, the state where there is one, chi where asked for
  std::vector<RowGroup> groups;  // in the order in which readers see their rows
  std::int64_t frames = 0;       // how many are expected to come (any number may)
  // Rows other than frames come only after their time: a run that goes on from a checkpoint writes those at
  // the checkpoint's time itself, as it always does those of events.
  bool tells_rows_later = false;
  std::map<std::string, std::string> texts;  // further root attributes
  std::map<std::string, double> numbers;
  // of nodes: what differs along x
  std::vector<std::pair<Field, std::function<double(std::int64_t)>>> profiles;
  std::vector<FixedTable> tables;
};

class RunFile {
 public:
  // An earlier file of the same run whose rows up to and including time `until` are to be kept.
  struct Resume {
    std::string path;
    double until;
  };

  // Collective, like everything here unless said otherwise. Throws UsageError where the file cannot be made;
  // the others throw Failure. With `resume` the file begins with the kept rows of that one (which may stand
  // under the same name): same x or UsageError; a field, series or probe that the old file lacks is NaN in
  // the old rows.
  RunFile(MPI_Comm comm, std::string path, Provenance provenance, RunLayout layout,
          std::optional<Resume> resume = std::nullopt);
  ~RunFile();  // what was flushed so far is kept, on one rank everything; rank 0 alone acts
  RunFile(const RunFile&) = delete;
  RunFile& operator=(const RunFile&) = delete;

  // A row of a group, if the layout has it: each field in turn, at all places where there are any. Times do
  // not decrease; at every step if you like. Kept in memory until the next frame() or flush(), or until they
  // take some megabytes. Ranks other than 0 give rows of the same length, whose values are ignored.
  void row(const char* group, double t, const std::vector<double>& values);

  // Rows of such a group so far, those of `resume` and those in memory included: on rank 0, 0 elsewhere. Not
  // collective.
  std::int64_t rows(const std::string& group) const;

  // One frame: of each field of the layout, in order, the values that this rank has (Slab::take). Everything
  // is on its way to disk when it returns, except that frames which follow each other at once share a flush.
  // Give the probes and series of a moment before its frame.
  void frame(double t, const std::vector<const double*>& fields);

  // Everything written so far becomes visible to readers (and so survives kill -9).
  void flush();
  // After an error that has been thrown, flush() and close() write no more and throw nothing.
  void close();

  std::int64_t frames() const;  // in the file, those of `resume` included
  double last_time() const;     // of the last frame; -infinity where there is none

 private:
  struct Impl;
  std::unique_ptr<Impl> m_;
};

}  // namespace stickslip
