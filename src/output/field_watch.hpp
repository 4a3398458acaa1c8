// What observers look at psi with: the nodes beside those of a rank, the course of a node within a step,
// loops over all nodes, what all nodes do, and whether what they do repeats itself.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "model/moved_nodes.hpp"
#include "numerics/straight_line.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/output/checkpoint.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

// Values of nodes beside those of this rank that stencils of its own nodes reach.
class NodeHalo {
 public:
  // Collective.
  NodeHalo(const Scene& scene, const NodeRange& nodes);

  // One value of each of them, in the order of `at`, of one value of each own node. Collective.
  std::vector<double> fetch(const std::vector<double>& own) const;
  // The value of a node: of `own`, or of what was fetched.
  double at(PetscInt node, const std::vector<double>& own, const std::vector<double>& fetched) const {
    const PetscInt i = node - first_;
    return i >= 0 && i < count_ ? own[i] : fetched[place_of(node)];
  }

 private:
  std::size_t place_of(PetscInt node) const;

  PetscInt first_, count_;
  std::vector<PetscInt> nodes_;     // those beside, in order
  std::optional<NodeFetch> fetch_;  // none where the rank has all nodes
};

// Times at which a motion passes a level in one direction, counted: their mean distance, and how well it is
// known.
class Repeats {
 public:
  // The time of the newest of `more` passages since the last one that was told.
  void add(double t, double more = 1) {
    if (count_ < 0) first_ = t;
    count_ += count_ < 0 ? 1 : more;
    last_ = t;
    if (count_ > 0 && spacing_ == 0) {
      spacing_ = (t - first_) / count_;
      off_line_.add(0, 0);
    }
    // beside equal distances, so that what is small stands alone
    if (spacing_ > 0) off_line_.add(count_, t - first_ - count_ * spacing_);
  }
  double passages() const { return count_ + 1; }
  double last() const { return last_; }
  double mean() const { return (last_ - first_) / count_; }  // of two passages or more
  // Of the mean, from how far passages lie beside equal distances; 0 for less than three.
  double error() const {
    return off_line_.count() > 2 ? std::sqrt(2 * off_line_.variance()) / count_ : 0;
  }

  template <class List>
  void archive(List& list) {
    list(count_, first_, last_, spacing_);
    off_line_.archive(list);
  }

 private:
  double count_ = -1, first_ = 0, last_ = 0, spacing_ = 0;  // of distances
  StraightLine off_line_;
};

// What steps add to the error of a period: a bound, often a hundred times what the period is off. An error of
// the force is not forgotten while a node rests or slides steadily, and delays its next slip. It is known as
// a whole where the run's error is (`passage`, the delay of a passage by it, 0: not known), else each step of
// the period may err by the part `step` (0: not known) of what it computes.
struct PeriodErrors {
  double step = 0, passage = 0;
  double of(double period, double steps, double periods) const {
    return passage > 0 ? 2 * passage / periods : step * steps * std::abs(period);
  }
};

// Puts a period into the summary with the digits that its error leaves, to the error's fourth, and the error,
// as `period_error`, with two.
void set_period(Summary& summary, double period, double error);

// The course of psi of a node within an accepted step, for what is measured in passing at any number of
// nodes: the cubic through its values at both ends and their slopes, which the node's own equations give
// (error dt^4). It is the same for a motion and its mirror image. What is asked for at a few places or by
// name (measures.hpp) is read from the method's dense output instead, which costs a pass over all
// nodes.

// A node where a step begins or ends. normal: N(t), by which friction is multiplied there. beside: what its
// neighbours add, as NodeRates has it.
struct NodeMoment {
  double psi = 0, eta = 0, state = 0, normal = 1, beside = 0;
};

// psi_t of the nodes of a rank.
class NodeRates {
 public:
  // Collective.
  explicit NodeRates(const Model& model);

  // What neighbours add to the rate of a node is asked for where they do: N D2 psi where they have viscosity,
  // K1 D2 psi, as it stands in eta_t, where psi keeps to a balance. Collective; psi of this rank's nodes, dof
  // apart.
  bool ask_beside() const { return halo_.has_value(); }
  void look_beside(const double* u);
  double beside(PetscInt local_node) const;

  // psi_t where the node leaves rest, or comes to it, in the direction `aside` (psi = 0 says none); 0 of a
  // held node. Where a step of dt passes over what is stiff (time/integrator_impl.hpp), and without mass, psi
  // keeps to the balance of its forces: then it is (eta_t - F_s g)/(B + F_psi). Not a number where that is
  // not known: under a load, and beside neighbours of whom nothing is known.
  double of(PetscInt local_node, const NodeMoment& at, double aside, double dt) const;

 private:
  const Model& model_;
  std::optional<NodeHalo> halo_;
  std::vector<double> psi_, fetched_;
};

// Of a step of length dt, from its values and rates there; a straight line where a rate is not known.
class StepCourse : public HermiteCubic {
 public:
  StepCourse(double psi0, double psi1, double rate0, double rate1, double dt);

  // Where it comes from below the level to it, as a part of the step; of several places the last. The step
  // begins below the level and does not end there.
  double rise_to(double level) const;
  // The part of the step from `begin` on over which it lies in [-level, level].
  double part_within(double level, double begin) const;

 private:
  double part_below(double level, double begin) const;
};

}  // namespace stickslip

// Loops over values side by side that keep eight sums, least or largest values apart, whatever the
// processor's vectors hold: vector code, and the same bits everywhere.

namespace stickslip {

constexpr int lanes = 8;

// A value for each lane and, in the end, one for all.
struct Lanes {
  double of[lanes];

  explicit Lanes(double all) { std::fill(of, of + lanes, all); }
  double least_of_all() const { return *std::min_element(of, of + lanes); }
  double largest_of_all() const { return *std::max_element(of, of + lanes); }
  double sum() const {
    double all = 0;
    for (const double one : of) all += one;
    return all;
  }
};

// Calls body(number, lane) for 0 .. count - 1 in turn, eight at a time.
template <class Body>
void in_lanes(PetscInt count, const Body& body) {
  PetscInt i = 0;
  for (; i + lanes <= count; i += lanes)
#pragma GCC ivdep
    for (int k = 0; k < lanes; ++k) body(i + k, k);
  for (int k = 0; i + k < count; ++k) body(i + k, k);
}

// Passes over the psi of a range of nodes as it lies in a vector, node by node, in vector code: what is
// measured of a field costs no more than reading it. Least, largest and sums are kept in eight lanes whatever
// the processor's vectors hold, so that the same nodes give the same bits everywhere.

// Unknowns of `count` nodes, `dof` (2 or 3) a node: psi, eta and the state.
struct FieldRange {
  const double* u;
  PetscInt count;
  int dof;
};

struct FieldSums {
  double low, high;  // least and largest psi; HUGE_VAL and -HUGE_VAL of no node
  double psi, eta;   // sums
};
FieldSums sums_of(const FieldRange& field);

// Least and largest psi of the nodes, and of each node so far: low[i] and high[i] take in what is new.
struct Extremes {
  double low, high;
};
Extremes widen(const FieldRange& field, double* low, double* high);

// The same with nothing kept; range: the largest that a node has come through, this field included. low,
// high: nullptr where no field went before.
struct LastExtremes {
  double low, high, range;
};
LastExtremes widest(const FieldRange& field, const double* low, const double* high);

// Upward passages of psi through a level along a piece of the line, and its state where it begins and ends:
// below the level less the depth (-1), above the level plus the depth (1), or nowhere beyond either (0).
struct Passages {
  int first = 0, last = 0, up = 0;

  void add(int state) {
    if (state == 0) return;
    if (first == 0) first = state;
    if (last == -1 && state == 1) ++up;
    last = state;
  }
  void append(const Passages& next) {
    if (next.first == 0) return;
    if (first == 0) first = next.first;
    if (last == -1 && next.first == 1) ++up;
    up += next.up;
    last = next.last;
  }
};
// With the largest difference of psi between neighbours of the range.
struct Fronts {
  Passages passages;
  double steepest = 0;
};
Fronts fronts_of(const FieldRange& field, double level, double depth);

}  // namespace stickslip

namespace stickslip::event_loops {

// The loops of the catalogue over nodes side by side, in the version that suits this processor.

// A step of nodes side by side: psi and friction at its beginning, in its middle and at its end.
struct StepOfNodes {
  const double *p0, *p, *p1, *F0, *F, *F1;
  double dt;
  double *slip, *slipped;  // to which the slip is added
  std::size_t count;
};
struct StepSums {
  double work, squares, ends;  // of psi F and of psi^2 by Simpson's rule over dt/6; of psi^2 at the end
};
StepSums add_step(const StepOfNodes& nodes);

// psi in the middle of a step, on the cubic through values and slopes at its ends.
struct MiddleOfNodes {
  const double *p0, *p1, *eta0, *eta1, *F0, *F1;
  double A, B, dt;
  double* p;
  std::size_t count;
};
void find_middle(const MiddleOfNodes& nodes);

// psi for a law: where it is 0 as small as can be in the direction of the motion that begins or ends there,
// that of p0 + p1.
struct AimedNodes {
  const double *psi, *p0, *p1;
  double* aimed;
  std::size_t count;
};
void aim(const AimedNodes& nodes);

// Unknowns as they lie in a vector, dof (2 or 3) a node, each kind in an array of its own.
struct InterleavedNodes {
  const double* u;
  double *psi, *eta, *state;
  int dof;
  std::size_t count;
};
void separate(const InterleavedNodes& nodes);

// Nodes whose friction at the beginning of a step is not that of the end of the last one.
struct EarlierNodes {
  const double* p0;
  const unsigned char* moved;
  std::size_t count;
};
std::size_t count_unknown(const EarlierNodes& nodes);

// 1 for nodes that move at either end of a step, else 0.
struct MovingNodes {
  const double *p0, *p1;
  double velocity;
  unsigned char* moves;
  std::size_t count;
};
void mark_moving(const MovingNodes& nodes);

}  // namespace stickslip::event_loops

namespace stickslip {

// The whole field in the last quarter of a run: ranges of psi at every node, how steep its fronts are, pulses
// and their speed. Every rank looks at its own nodes.
//
// Ranges are taken at every step. What needs a sum over the ranks is taken at moments whose distance is at
// least a part of the time since the first step in the quarter, so that their number grows with the logarithm
// of that of the steps: a fifth, and 3 % (and the first eight steps) for the phase of a wave, which is
// followed from each moment to the next by the speed that those before it show.
//
// Upward is in the plate's direction (observer.hpp): where v < 0 passages are those downward.
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
class FieldWatch {
 public:
  FieldWatch(const Model& model, double t_end);

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
