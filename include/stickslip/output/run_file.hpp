// Results in HDF5, one file a command, written by rank 0 alone (gathered arrays).
//
// Every file carries the root attributes `program`, `version`, `git`, `command_line`, `options` (one JSON object of
// texts), `date`, `ranks` and `kind` (the command, or `checkpoint`), dimension scales and `units`, so that
// xarray.open_dataset(file, engine="h5netcdf") opens it. It is made under a hidden temporary name in the same folder
// and renamed when it holds something; a file of the same name stands until then.
//
// The file of a run can be read at every moment from then on, also after kill -9. Nothing but two things is ever
// written to it in place: raw rows beyond the extents that a reader sees, and then those extents, each eight bytes
// in the header of its dataset, time last. All else (headers, attributes, scales, chunk index) is complete before
// the rename: the chunks, each as long as the table may grow, are allocated at once, sparse on disk. A table that
// outgrows its chunks is copied into a new file, which then takes the old one's place.
#pragma once

#include <petscvec.h>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/handle.hpp"
#include "stickslip/provenance.hpp"
#include "stickslip/scene.hpp"

namespace stickslip {

// Throws UsageError where option out_file with this text cannot be written at the end of the work: an empty name, a
// folder, a missing or unwritable folder, an existing file that this program did not write. Collective.
void check_output_path(const std::string& path);

// Both outputs of a command at once, and that they are not one and the same file. "" stands for none. Collective.
void check_outputs(const std::string& out_file, const std::string& summary);

// Brings an interleaved vector (dof values a node, nodes in order) to rank 0, and back. Keeps its scatter.
class Gather {
 public:
  Gather(Vec like, PetscInt dof);                          // collective
  // The components, each one value a node, on rank 0; empty vectors elsewhere. Valid until the next call. Collective.
  const std::vector<std::vector<double>>& components(Vec v);
  // The whole vector as it stands, on rank 0. Collective.
  std::vector<double> interleaved(Vec v);
  // The inverse of interleaved(): `values` of rank 0 into v. Collective.
  void spread(const std::vector<double>& values, Vec v);

 private:
  ScatterHandle scatter_;
  VecHandle on_root_;
  std::vector<std::vector<double>> components_;
};

// One dataset: its name, its units in words ("time", "length/time", "1"; not "seconds", which readers take for
// dates) and what it is.
struct Field {
  std::string name, units, long_name;
};

// What the file of a run holds. Significant on rank 0; probe_x empty: no group probes, series empty: no group series.
struct RunLayout {
  std::vector<double> x;        // of the nodes
  std::vector<Field> fields;    // of (t, x): psi, eta, the state where there is one, chi where asked for
  std::vector<double> probe_x;  // probes/x; the datasets are probes/psi and probes/eta of (t, x)
  std::vector<Field> series;    // series/NAME of t
  std::vector<Field> events;    // events/NAME of t, the end of an event
  std::int64_t frames = 0;      // how many are expected to come (any number may)
  std::map<std::string, std::string> texts;  // further root attributes
  std::map<std::string, double> numbers;
  std::vector<double> friction_psi, friction_F;  // steady friction, a table friction/F of friction/psi, if not empty

  // All that follows from a scene: x, the fields psi, eta and tau or theta; as numbers the coefficients A, B, K0, K1,
  // s_delta and v of the one system and, where uniform sliding exists, its steady_eta and steady_stable (1 or 0, to
  // perturbations of every wavelength of the grid); the table of friction (amplitude 1). To be completed by probes,
  // series, frames.
  static RunLayout of(const Scene& scene);
};

// The standard fields, to be put into RunLayout::fields: psi, eta, tau, theta, chi.
Field standard_field(const std::string& name);

class RunFile {
 public:
  // An earlier file of the same run whose rows up to and including time `until` are to be kept.
  struct Resume {
    std::string path;
    double until;
  };

  // Collective, like everything here unless said otherwise. Throws UsageError where the file cannot be made; the
  // others throw Failure. With `resume` the file begins with the
  // kept rows of that one (which may stand under the same name): same x or UsageError; a field, series or probe that
  // the old file lacks is NaN in the old rows.
  RunFile(MPI_Comm comm, std::string path, Provenance provenance, RunLayout layout,
          std::optional<Resume> resume = std::nullopt);
  ~RunFile();  // what was written so far is kept; rank 0 alone acts
  RunFile(const RunFile&) = delete;
  RunFile& operator=(const RunFile&) = delete;

  // Rows of the groups probes and series, each with a time of its own, increasing, at every step if you like. Kept in
  // memory until the next frame() or flush(). Not collective: ranks other than 0 ignore the call.
  void probes(double t, const std::vector<double>& psi, const std::vector<double>& eta);
  void series(double t, const std::vector<double>& row);
  void event(double end, const std::vector<double>& row);  // ends do not decrease

  // One frame: each field of the layout in order, n values each, on rank 0. Everything is on its way to disk when it
  // returns, except that frames which follow each other at once share a flush. Give the probes and series of a
  // moment before its frame.
  void frame(double t, const std::vector<const double*>& fields);

  // Everything written so far becomes visible to readers (and so survives kill -9).
  void flush();
  // After an error that has been thrown, flush() and close() write no more and throw nothing.
  void close();

  std::int64_t frames() const { return frames_; }   // in the file, those of `resume` included
  double last_time() const { return last_time_; }   // of the last frame; -infinity where there is none

 private:
  struct Writer;
  MPI_Comm comm_;
  std::unique_ptr<Writer> writer_;  // rank 0
  std::int64_t frames_ = 0;
  double last_time_;
};

// A file written in one piece: spectrum, boundary, wave, chart, laws. Collect on every rank or on rank 0, write() is
// collective. Names may have one group before them ("branch/speed"); a dimension is named by its scale, which is
// sought in the dataset's group first, then at the root. A dimension without a scale gets one that counts 0, 1, ...
class ResultFile {
 public:
  ResultFile(MPI_Comm comm, std::string path, Provenance provenance);  // path "": write() does nothing
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;

  void attribute(const std::string& name, const std::string& text);
  void attribute(const std::string& name, double value);
  void scale(const Field& field, std::vector<double> values);
  // Row-major values of the named dimensions, none of them for a scalar.
  void add(const Field& field, const std::vector<std::string>& dimensions, std::vector<double> values);
  void add_text(const Field& field, const std::vector<std::string>& dimensions, std::vector<std::string> values);
  void write();  // throws Failure

 private:
  struct Contents;
  MPI_Comm comm_;
  std::string path_;
  Provenance provenance_;
  std::unique_ptr<Contents> contents_;
};

// What a file of this program holds. All three below are collective, give every rank the same, and throw UsageError,
// which begins with `WHAT 'PATH': ` (WHAT is the option's name), where the file is missing, not ours or lacks it.
struct FileHeader {
  std::string kind, version, git;
  std::map<std::string, std::string> options;
};
FileHeader read_header(const std::string& what, const std::string& path);

struct DataArray {
  std::vector<std::size_t> shape;
  std::vector<double> values;  // row-major
};
DataArray read_array(const std::string& what, const std::string& path, const std::string& name);

// One frame of a run's file; index -1 is the last one.
struct Frame {
  double t = 0;
  std::int64_t index = 0, count = 0;                  // which frame, of how many
  std::vector<double> x;
  std::map<std::string, std::vector<double>> fields;  // psi, eta, ...
  std::map<std::string, std::string> options;
};
Frame read_frame(const std::string& what, const std::string& path, std::int64_t index = -1);

}  // namespace stickslip
