// The whole field in the last quarter of a run: ranges of psi at every node, how steep its fronts are, pulses
// and their speed. Every rank looks at its own nodes.
//
// Ranges are taken at every step. What needs a sum over the ranks is taken at moments whose distance is at
// least a part of the time since the first step in the quarter, so that their number grows with the logarithm
// of that of the steps: a fifth, and 3 % (and the first eight steps) for the phase of a wave, which is
// followed from each moment to the next by the speed that those before it show.
//
// Upward is in the plate's direction (forward.hpp): where v < 0 passages are those downward.
//
//   pulses      upward passages of psi through v along x, on a ring or between the ends; a dip counts where
//               it goes a twentieth of the range of psi below
//   wave speed  on a ring with m pulses the slope of the phase of the m-th Fourier coefficient (from 8192
//               nodes, or 512 a turn), -2 pi m V/L, by least squares; elsewhere the least-squares slope of
//               the times at which nodes of the middle half (up to 1024 of them) last passed v upwards, along
//               each pulse. Positive to the right; none where the phase is not linear in time to 0.3 rad,
//               where pulses of one direction hold fewer than 80 % of the nodes, or where the times of
//               passage are off the straight line by more than a tenth of what they climb.
//
// Where only what slides is advanced, ranges and passages are those of the steps of clusters, and the whole
// is shown at the times that next_look() says.
#pragma once

#include <optional>
#include <vector>

#include "model/moved_nodes.hpp"
#include "output/field_loops.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class FieldWatch {
 public:
  FieldWatch(const Model& model, double t_end);
  static double bytes_a_node() { return 16; }  // memory: low_ and high_

  void step(const ObservedStep& step);  // collective
  void moved(const MovedNodes& nodes);
  double next_look(double t) const;  // later than t
  double end() const { return t_end_; }

  struct Result {
    // half the largest range of a node; empty where the run did not come so far
    std::optional<double> amplitude;
    std::optional<double> wave_speed;
    std::optional<int> pulses;  // on the model's own grid
    double steepest = 0;        // largest step of psi between neighbours over its range
  };
  Result result() const;  // collective

  void archive(Archive& a, bool by_clusters);  // collective

 private:
  struct Moment {
    double t, phase;
  };
  struct Tracked {  // a node whose passages are timed
    PetscInt node;  // of this rank
    double psi, passed;
  };
  struct PhasePlace {  // a node of this rank
    PetscInt node;
    double cosine, sine;
  };
  FieldRange range(const double* u) const;
  Extremes widen_to(const double* u, bool at_end);
  void look(double t, const double* u, const Extremes& own);
  void pass(Tracked& node, double from, double to, double psi) const;
  double step_to_next_rank(const double* u) const;
  int count_pulses(const Passages& own) const;
  bool phase_is_due(double t) const;
  void take_phase(double t, const double* u);
  void choose_phase_places();
  double phase_of(const double* u);
  std::optional<double> ring_speed() const;
  std::size_t place_of(const Tracked& node) const;
  std::optional<double> passage_speed() const;

  const Model& model_;
  double t_begin_, t_end_, next_look_;
  long steps_ = 0;  // seen in the quarter
  // of this rank's nodes, up to the step before the last; empty before the first
  std::vector<double> low_, high_;
  std::vector<Tracked> tracked_;  // of this rank, off a ring
  double tracked_first_ = 0, tracked_stride_ = 1;
  std::size_t tracked_count_ = 0;  // on all ranks
  double last_t_ = 0, first_step_t_ = 0;
  std::vector<Moment> moments_;
  std::vector<PhasePlace> phase_places_;
  int mode_ = -1, pulses_ = 0;  // pulses at the beginning (-1: not yet seen) and at the last moment
  double steepest_ = 0;
  double largest_range_ = 0;                 // of this rank's nodes, once the last step is known
  double moved_steps_ = 0, moved_time_ = 0;  // of clusters
};

}  // namespace stickslip
