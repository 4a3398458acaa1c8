// What a run records of its fields: frames, means and where the load point has gone, series in time.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/moved_nodes.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/checkpoint.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/probe.hpp"
#include "stickslip/output/result_file.hpp"

namespace stickslip {

// Rows against time where only what slides is advanced (time/clusters.hpp).

// One row for each time: the last one that is put there. It is written when a row of a later time comes, so
// that a run that goes on from a checkpoint, which takes over the rows before the checkpoint's time, writes
// the same rows.
class RowOfTime {
 public:
  using Write = std::function<void(double t, const std::vector<double>& row)>;

  // Times do not go back.
  void put(double t, std::vector<double> row, const Write& write) {
    write_until(t, write);
    t_ = t;
    row_ = std::move(row);
  }
  void write_until(double t, const Write& write) {
    if (row_.empty() || !(t_ < t)) return;
    write(t_, row_);
    row_.clear();
  }
  void archive(Archive& a, const std::string& name) {
    a.list(name, [&](NumberList& x) {
      x(t_);
      x.rest(row_);
    });
  }

 private:
  double t_ = 0;
  std::vector<double> row_;  // empty: none
};

// Says when some nodes do anything but rest in closed form.
class Attention {
 public:
  Attention(const std::vector<PetscInt>& nodes, PetscInt all)
      : nodes_(nodes), all_(all), advanced_(nodes.size(), 0.) {}

  bool moved(const MovedNodes& m) const {
    for (const PetscInt i : nodes_)
      if (m.place(i, all_) >= 0) return true;
    return false;
  }
  // Whether one has joined a cluster, or left all.
  bool changed(const MediumNow& now) {
    bool any = false;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const double is = now.is_advanced(nodes_[k]) ? 1 : 0;
      any = any || is != advanced_[k];
      advanced_[k] = is;
    }
    return any;
  }
  void archive(NumberList& x) { x(advanced_); }

 private:
  const std::vector<PetscInt>& nodes_;
  PetscInt all_;
  std::vector<double> advanced_;
};

// Frames of a run: psi, eta, the state and where asked for the displacement, at times that the options set.

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

// The mean velocity under a load that repeats (load_sine_...), over all nodes and the last whole period of
// the load. It follows from the forces at the period's two ends: summed over the nodes, between free ends or
// on a ring, eta_t = K0 (v - psi) - s delta (psi_t/A + B psi), with delta or B being 0, so that
//     int psi dt = int v dt - [eta + s delta psi/A]/K0   (means; free ends of a continuum count half)
// exactly. None with a held end, or K0 = 0, or before a period has passed.
class LoadedMean : public Observer {
 public:
  static std::vector<SummaryKey> keys();
  explicit LoadedMean(const Model& model);

  void plan(ObservationPlan& plan) override;
  void step(const ObservedStep& step) override;
  void archive(Archive& a) override { a("loaded_mean.marks", marks_[0], marks_[1], count_); }
  void summarise(Summary& summary, Vec u) override;

 private:
  double next(double t) const;
  double force(Vec u) const;

  const Model& model_;
  double period_;  // 0: nothing to measure
  VecHandle work_;
  std::array<double, 2> marks_{};  // the mean of eta + s delta psi/A at the last two ends of a period
  long count_ = 0;                 // of them so far
};

// How far each block or node has gone since the start of a run, and chi and eta then: what the displacement
// needs where forces tell it worse, or not at all (displacement.hpp). From the dense output of psi in every
// step, by Gauss's rule of five points.
//
// Comes before the observers that ask for the displacement, which may be of any time of the step at hand.
// Nodes are counted each for itself, so that the ranks do not matter.
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

// Rows of the groups `series` and `probes` of a run's file, one for every step, and the values at its end.

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
