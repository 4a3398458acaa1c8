// Frames of a run: psi, eta, the state and where asked for the displacement, at times that the options set.
#pragma once

#include <string>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

// The times of frames, none of them kept but those that out_times lists.
class FrameTimes {
 public:
  explicit FrameTimes(const Options& options);  // throws UsageError for out_times outside the run
  double after(double t) const;                 // the first one later than t, infinity where there is none
  double count_after(double t) const;           // how many are later
  const std::string& option() const { return option_; }  // that sets them, with its value, for messages

 private:
  double at(double i) const;
  double index_after(double t) const;

  std::string option_;
  std::vector<double> list_;  // out_times, sorted
  double every_ = 0;          // out_every; without either: equal parts of the run
  double count_ = 0, last_ = 0;
};

class Frames : public Observer {
 public:
  // Of the scene `whole`, of which the model may be one of several equal cells. Throws UsageError for times
  // outside the run. `displacement`: nullptr, or what chi is solved with; it and the plate, at whose last
  // time there is a frame, are the caller's.
  Frames(const Model& model, const Scene& whole, const Options& options, const Displacement* displacement,
         const Plate& plate);
  // Memory of a node whose unknowns take `unknowns` bytes: u inside a step, and the rows of the file.
  static double bytes_a_node(double unknowns) { return 2 * unknowns; }

  void plan(ObservationPlan& plan) override;
  void start(RunFile* file) override { file_ = file; }
  void step(const ObservedStep& step) override;

 private:
  void write(double t);

  const Model& model_;
  StateLaw state_;
  double most_bytes_;  // out_limit
  std::size_t nodes_;  // of the whole scene
  const Displacement* displacement_;
  const Plate& plate_;
  VecHandle work_, chi_;
  Slab slab_;
  std::vector<std::vector<double>> rows_;  // of the fields
  FrameTimes times_;
  double next_ = 0;  // the frame to come
  RunFile* file_ = nullptr;
};

}  // namespace stickslip
