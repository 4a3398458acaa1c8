// Rows of the groups `series` and `probes` of a run's file, one for every step, and the values at its end.
#pragma once

#include <vector>

#include "output/cluster_rows.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/probe.hpp"

namespace stickslip {

// Minimum, maximum and means over all nodes.
struct FieldStatistics {
  double psi_min, psi_max, psi_mean, eta_mean;
};
FieldStatistics statistics(const Model& model, Vec u);  // collective

// series/...: statistics, the step and, where the displacement is known, the energy balance. A row for each
// step, or for every so many. Where only what slides is advanced: for every so many times at which nodes
// begin to slide or stop, and else when the nodes that are advanced have taken a step on the average; the
// energies are known at the times of frames, and NaN elsewhere.
class Series : public Observer {
 public:
  // `displacement`: nullptr, or the caller's; `plate` is.
  Series(const Model& model, const Scene& whole, const Displacement* displacement, const Plate& plate,
         std::int64_t every);

  static std::vector<Field> fields();  // all that there may be

  void plan(ObservationPlan& plan) override;
  void archive(Archive& a) override;
  void start(RunFile* file) override { file_ = file; }
  void step(const ObservedStep& step) override;
  void moved(const MovedNodes& nodes, const MediumNow& now) override;
  void changed(double t, const MediumNow& now) override;
  void told_until(double t) override;

 private:
  struct Row;
  RowOfTime::Write writer() const;
  void put(double t, const Row& row);
  void put(double t, const MediumNow& now);
  // `load`: it varies; `halt`: the plate has a clock of its own; `energy`: its balance is known.
  static std::vector<RowColumn<Row>> columns(bool load, bool halt, bool normal, bool energy);

  const Model& model_;
  const Plate& plate_;
  std::vector<RowColumn<Row>> columns_;
  const Displacement* displacement_;  // nullptr without a balance of energy
  double cells_;                      // equal ones in the whole scene
  std::int64_t every_;
  RunFile* file_ = nullptr;
  // by clusters
  RowOfTime row_;
  bool by_clusters_ = false;
  double last_ = 0, changes_ = 0, node_steps_ = 0;  // the last row; since it
  double shown_ = -1;                               // the last one of the whole medium
};

// probes/psi and probes/eta, and `probes` in the summary. Where only what slides is advanced: rows at the
// ends of steps of the clusters that probes look at, and where these begin and end.
class ProbeRows : public Observer {
 public:
  ProbeRows(const Model& model, const Scene& whole, std::vector<double> x);

  void plan(ObservationPlan& plan) override;
  void archive(Archive& a) override;
  void start(RunFile* file) override { file_ = file; }
  void step(const ObservedStep& step) override;
  void moved(const MovedNodes& nodes, const MediumNow& now) override;
  void changed(double t, const MediumNow& now) override;
  void told_until(double t) override;
  void summarise(Summary& summary, Vec u) override;

 private:
  static std::vector<double> row(const Probes::Values& values);
  RowOfTime::Write writer() const;
  void put(double t, const Probes::Values& values);

  const Model& model_;
  std::vector<double> x_;
  Probes probes_;
  Attention attention_;
  RowOfTime row_;
  bool by_clusters_ = false;
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
