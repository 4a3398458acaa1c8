// Frames of a run: psi, eta, the state and where asked for the displacement, at times that the options set.
#pragma once

#include <memory>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class Frames : public Observer {
 public:
  // Of the scene `whole`, of which the model may be one of several equal cells. Throws UsageError for out_times outside
  // the run. `displacement`: nullptr, or what chi is solved with; it is the caller's.
  Frames(const Model& model, const Scene& whole, const Options& options, Gather& gather,
         const Displacement* displacement);

  void plan(ObservationPlan& plan) override;
  void start(RunFile* file) override { file_ = file; }
  void step(const ObservedStep& step) override;

 private:
  void write(double t);

  const Model& model_;
  StateLaw state_;
  std::size_t nodes_;  // of the whole scene
  Gather& gather_;
  const Displacement* displacement_;
  VecHandle work_, chi_;
  std::unique_ptr<Gather> gather_chi_;
  std::vector<double> times_;
  std::size_t next_ = 0;
  RunFile* file_ = nullptr;
};

}  // namespace stickslip
