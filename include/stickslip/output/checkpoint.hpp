// Checkpoints: all that a run needs to go on, in HDF5 files beside out_file (ring.h5: ring.chk-000150.h5).
//
// A checkpoint is written under a hidden name, brought to disk (fsync) and renamed, so that one with its
// final name is whole. Its first 512 bytes, which HDF5 leaves to the user, carry a checksum of the rest: a
// damaged one is refused before HDF5 sees it. Every rank writes and reads the values of its own nodes
// (run_file.hpp says how); only rank 0 opens the file by the library.
#pragma once

#include <petscsys.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/base/provenance.hpp"

namespace stickslip {

// The nodes of this rank among all. Where every rank has all of them, rank 0 writes.
struct NodeRange {
  MPI_Comm comm = MPI_COMM_NULL;
  std::int64_t first = 0, count = 0, all = 0;
  static NodeRange of(const Model& model) {
    return {model.comm(), model.first(), model.local(), model.scene().n};
  }
};

struct Checkpoint {
  double t = 0, dt = 0;   // time reached, and the step that the method wants to take next
  std::int64_t step = 0;  // steps taken so far
  // Whatever else must survive, exact to the last bit: counters, settings of the method, tables under way.
  std::map<std::string, double> numbers;
  std::map<std::string, std::string> texts;
  std::map<std::string, std::vector<double>> arrays;
  // One value or several, the same number, for each node: to be written, those of this rank's nodes.
  std::map<std::string, std::vector<double>> fields;

  // Set by read_checkpoint only:
  FileHeader header;  // version, git and options of the run that wrote it
  int ranks = 1;      // on so many
  std::string path;

  // Of a checkpoint that was read, `each` values for every node of the range. Throws std::exception, on every
  // rank, where it has no field of that name and size. Collective. Of any other the field as it is.
  std::vector<double> field(const std::string& name, const NodeRange& nodes, int each) const;
};

// DIR/NAME.chk-STEP.h5 for out_file DIR/NAME.h5, the step in at least six digits.
std::string checkpoint_name(const std::string& out_file, std::int64_t step);

// Writes a checkpoint beside out_file (significant on rank 0: t, dt, step, numbers, texts, arrays), then
// removes the oldest files of that kind until `keep` are left; the one just written stays. Returns its name.
// Flush the RunFile first: a checkpoint must not be ahead of the frames. Collective; throws Failure, and then
// the checkpoints of before are all there.
std::string write_checkpoint(const std::string& out_file, std::int64_t keep, const Provenance& provenance,
                             const Checkpoint& checkpoint, const NodeRange& nodes);

// Every rank gets the same; fields are read by Checkpoint::field. Throws UsageError `restart 'PATH': ...` for
// what is damaged, senseless or of another version. Collective.
Checkpoint read_checkpoint(const std::string& path);

}  // namespace stickslip
