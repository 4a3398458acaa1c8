// Results in HDF5, one file a command; here that of a run. Rank 0 alone writes it: the other ranks hand it
// the values of their nodes (slab.hpp) in pieces of a megabyte, and when all are written it shows the frame
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
#pragma once

#include <petscsys.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/base/provenance.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/slab.hpp"

namespace stickslip {

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
  // All rows but frames are told when a later time is: a run that goes on writes those at the time of its
  // checkpoint itself, as it always does those of events.
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
