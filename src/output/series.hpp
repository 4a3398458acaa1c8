// Rows of the groups `series` and `probes` of a run's file, one for every step, and the values at its end.
#pragma once

#include <vector>

#include "output/row_columns.hpp"
#include "stickslip/model/plate.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/probe.hpp"

namespace stickslip {

// Minimum, maximum and means over all nodes.
struct FieldStatistics {
  double psi_min, psi_max, psi_mean, eta_mean;
};
FieldStatistics statistics(const Model& model, Vec u);  // collective

// series/...: statistics, the step and, where the displacement is known, the energy balance.
class Series : public Observer {
 public:
  // `displacement`: nullptr, or the caller's; `plate` is.
  Series(const Model& model, const Scene& whole, const Displacement* displacement, const Plate& plate);

  static std::vector<Field> fields();  // all that there may be

  void plan(ObservationPlan& plan) override;
  void start(RunFile* file) override { file_ = file; }
  void step(const ObservedStep& step) override;

 private:
  struct Row;
  // `load`: it varies; `halt`: the plate has a clock of its own; `energy`: its balance is known.
  static std::vector<RowColumn<Row>> columns(bool load, bool halt, bool energy);

  const Model& model_;
  const Plate& plate_;
  std::vector<RowColumn<Row>> columns_;
  const Displacement* displacement_;  // nullptr without a balance of energy
  double cells_;                      // equal ones in the whole scene
  RunFile* file_ = nullptr;
};

// probes/psi and probes/eta, and `probes` in the summary.
class ProbeRows : public Observer {
 public:
  ProbeRows(const Model& model, const Scene& whole, std::vector<double> x);

  void plan(ObservationPlan& plan) override;
  void start(RunFile* file) override { file_ = file; }
  void step(const ObservedStep& step) override;
  void summarise(Summary& summary, Vec u) override;

 private:
  std::vector<double> x_;
  Probes probes_;
  RunFile* file_ = nullptr;
};

// psi_min, psi_max, psi_mean and eta_mean in the summary.
class EndStatistics : public Observer {
 public:
  static std::vector<SummaryKey> keys();
  explicit EndStatistics(const Model& model) : model_(model) {}

  void step(const ObservedStep&) override {}
  void summarise(Summary& summary, Vec u) override;

 private:
  const Model& model_;
};

}  // namespace stickslip
