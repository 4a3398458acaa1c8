// How far each block or node has gone since the start of a run, and chi and eta then: what the displacement
// needs where forces tell it worse, or not at all (displacement.hpp). From the dense output of psi in every
// step, by Gauss's rule of five points.
//
// Comes before the observers that ask for the displacement, which may be of any time of the step at hand.
// Nodes are counted each for itself, so that the ranks do not matter.
#pragma once

#include <vector>

#include "base/local_values.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/checkpoint.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class Travel : public Observer {
 public:
  // Both must outlive it.
  Travel(const Model& model, Displacement& displacement);
  // Whether the run of a checkpoint counted so.
  static bool is_in(const Checkpoint& checkpoint) { return checkpoint.arrays.count("travel.until") > 0; }

  void plan(ObservationPlan& plan) override;
  void archive(Archive& a) override;
  void step(const ObservedStep& step) override;

 private:
  const std::vector<double>& at(double t);
  void add(double from, double to, std::vector<double>& slip);
  void tell();

  const Model& model_;
  Displacement& displacement_;
  VecHandle work_;
  const ObservedStep* step_ = nullptr;       // at hand
  double until_ = 0;                         // counted
  std::vector<double> chi_, eta_;            // at the start, of this rank's nodes
  std::vector<double> slip_, before_, now_;  // at the end and the beginning of that step, and within it
};

// How far the nodes slip in a part of a step, from its dense output.
class SlipOfStep {
 public:
  explicit SlipOfStep(const Model& model) : model_(model), work_(model.create_vector()) {}

  // Of an unknown (0: psi, 1: eta) over this rank's nodes, at a time of the step. Collective.
  double sum_at(const ObservedStep& step, double t, int unknown);
  // The integral of psi over this rank's nodes and from one time of the step to another. Collective.
  double between(const ObservedStep& step, double from, double to);

 private:
  const Model& model_;
  VecHandle work_;
};

}  // namespace stickslip
