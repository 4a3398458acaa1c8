// The end of a run that the next one starts from, handed on in memory: for commands that run one after
// another in one process, where a file between them would take ten times as long as a short run.
#pragma once

#include <optional>
#include <string>

#include "stickslip/model/model.hpp"
#include "stickslip/output/reader.hpp"

namespace stickslip {

// While it lives, a run leaves its end here, and one with init_type `file` whose init_file is `name` starts
// from it. The same on every rank.
class CarriedFrame {
 public:
  static constexpr const char* name = "(the point before)";  // no file: it is never opened

  explicit CarriedFrame(std::optional<Frame> start);
  ~CarriedFrame();
  CarriedFrame(const CarriedFrame&) = delete;
  CarriedFrame& operator=(const CarriedFrame&) = delete;
  static CarriedFrame* innermost();  // nullptr: there is none

  // All nodes of the whole scene, of which the model may be a cell, as a file would hold them; the whole
  // field on every rank. Collective over PETSC_COMM_WORLD.
  void keep(const Model& model, const Scene& whole, Vec u, double t);

  const std::optional<Frame> start;
  std::optional<Frame> end;  // of the last run that came to its end

 private:
  CarriedFrame* before_;
};

// The same on disk, exact to the last bit, for a sweep that was killed. Rank 0 of PETSC_COMM_WORLD writes,
// under another name first; every rank gets what is read. Throws Failure. Collective.
void save_frame(const std::string& path, const Frame& frame);
Frame load_frame(const std::string& path);

}  // namespace stickslip
