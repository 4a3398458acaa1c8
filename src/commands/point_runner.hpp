// A command as one of many in the same process.
#pragma once

#include <exception>

#include "base/json_values.hpp"
#include "commands/table.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

class PointRunner {
 public:
  // `base`: whose library options are in PETSc's database. Both must outlive it.
  PointRunner(const Command& command, const Options& base) : command_(command), base_(base) {}

  struct Outcome {
    Json row;      // flat_row of its summary; of a point that fails at least status and reason
    int code = 0;  // exit code: 0, or that of a signal it stopped for
    // What one rank of several met alone, while others may wait for it: for the caller to throw.
    std::exception_ptr alone;
  };
  // On the ranks of PETSC_COMM_WORLD, with nothing written but what `options` ask for. Collective.
  Outcome run(const Options& options) const;

 private:
  const Command& command_;
  const Options& base_;
};

}  // namespace stickslip
