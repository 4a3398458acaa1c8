// Checkpoints: all that a run needs to go on, in HDF5 files beside out_file (ring.h5: ring.chk-000150.h5).
//
// A checkpoint is written under a hidden name, brought to disk (fsync) and renamed, so that one with its final name
// is whole. Its first 512 bytes, which HDF5 leaves to the user, carry a checksum of the rest: a damaged one is
// refused before HDF5 sees it.
#pragma once

#include <petscvec.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "stickslip/output/gather.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/base/provenance.hpp"

namespace stickslip {

struct Checkpoint {
  double t = 0, dt = 0;   // time reached, and the step that the method wants to take next
  std::int64_t step = 0;  // steps taken so far
  // Whatever else must survive, exact to the last bit: counters, settings of the method, tables under way.
  std::map<std::string, double> numbers;
  std::map<std::string, std::string> texts;
  std::map<std::string, std::vector<double>> arrays;

  // Set by read_checkpoint only:
  FileHeader header;          // version, git and options of the run that wrote it
  int ranks = 1;              // on so many
  std::vector<double> state;  // the whole state vector on rank 0, empty elsewhere (Gather::spread puts it in place)
};

// DIR/NAME.chk-STEP.h5 for out_file DIR/NAME.h5, the step in at least six digits.
std::string checkpoint_name(const std::string& out_file, std::int64_t step);

// Writes a checkpoint of `state` beside out_file (significant on rank 0: t, dt, step, numbers, texts, arrays), then
// removes the oldest files of that kind until `keep` are left; the one just written stays. Returns its name. Flush
// the RunFile first: a checkpoint must not be ahead of the frames. Collective; throws Failure, and then the
// checkpoints of before are all there.
std::string write_checkpoint(const std::string& out_file, std::int64_t keep, const Provenance& provenance,
                             const Checkpoint& checkpoint, Gather& gather, Vec state);

// Every rank gets the same but for `state`. Throws UsageError `restart 'PATH': ...` for what is damaged, senseless or
// of another version. Collective.
Checkpoint read_checkpoint(const std::string& path);

}  // namespace stickslip
