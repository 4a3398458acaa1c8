// The motion at a few places of the grid from the beginning of a run to its end, in windows of time.
//
// At up to 128 nodes, spread evenly over the whole scene (of which the model may be one of several equal
// cells: then at the same nodes of that cell), every accepted step is looked at: the least and the largest
// psi in each window of time, how often psi passes its value in steady sliding upwards, and when it last did.
// Within a step an extremum, a passage, and psi where a window begins are those of its course
// (field_watch.hpp), so that they do not depend on where steps fall (error dt^4). The windows are equally
// long; when there are 128 of them they are joined in pairs, so that the whole of a run stands in 64 to 128
// windows, however many steps it takes; that of a run stopped long before its end in half as many as it has
// taken steps, if these are fewer. Costs the same at any number of nodes; nothing is communicated before
// record(). Where only what slides is advanced each place goes on by the steps of its cluster, and rests from
// one to the next.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "model/moved_nodes.hpp"
#include "output/field_watch.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/regime.hpp"

namespace stickslip {

// What was seen, window by window and place by place (value [window * places + place]); of forward * psi
// (observer.hpp).
struct MotionRecord {
  double begin = 0, window = 0, t = 0;  // of the first window; length of each; time reached
  std::size_t windows = 0, places = 0;
  double steps = 0;  // that a place has taken, in the mean
  const double *low = nullptr, *high = nullptr, *passages = nullptr;
  const double* passed = nullptr;    // time of the last passage in the window, where there is one
  std::vector<double> steady;        // psi in steady sliding at each place
  std::vector<std::size_t> free;     // places that are not held: those that can pass and rest
  std::vector<double> of_all_ranks;  // where there are several: what the pointers stand for
};

class Traces {
 public:
  static constexpr std::size_t most_places = 128, most_windows = 128;

  // `steady`: psi of steady sliding at a node. The run ends at t_end.
  Traces(const Model& model, const std::function<double(PetscInt)>& steady, double t_end);

  void step(const ObservedStep& step);
  void moved(const MovedNodes& nodes);
  MotionRecord record() const;  // the same on every rank; valid until the next step; collective

  // False where there is nothing to save or restore: then the record begins where the run goes on.
  // Collective.
  bool archive(Archive& a, bool by_clusters);

 private:
  struct Sample : NodeMoment {
    double rate = std::numeric_limits<double>::quiet_NaN();  // psi_t, where it was told
  };
  struct Place {
    PetscInt node;      // of this rank
    std::size_t index;  // among all places
    double steady;
  };
  void start(double t);
  void begin_windows_for(double t, double dt);
  void follow(std::size_t place, const MovedNodes& nodes, PetscInt at);
  void advance(std::size_t place, double t, const Sample& next);
  void open_windows(std::size_t place, double t, const Sample& next);
  void take_in(std::size_t place, double t, const Sample& next);
  void begin_windows(std::size_t until);
  void widen_windows(double t, double dt);
  double index_of(double t) const;
  void join_pairs();
  double steps() const;  // collective
  StepCourse course(const Place& place, const Sample& from, const Sample& to, double dt) const;
  void refine(std::size_t place, double dt, const Sample& next);

  const Model& model_;
  NodeRates rates_;
  double advanced_ = 0;  // steps, of all places
  double forward_, t_end_, begin_ = 0, window_ = 0, t_ = 0;
  bool started_ = false;
  std::size_t count_ = 0;                               // places on all ranks
  std::size_t windows_ = 1;                             // begun
  std::vector<std::size_t> free_;                       // of all places
  std::vector<Place> places_;                           // of this rank
  std::vector<Sample> before_, now_;                    // of each: at the last step but one, at the last
  std::vector<double> time_, last_dt_;                  // of that: when, and how long
  std::vector<double> low_, high_, passages_, passed_;  // windows x places of this rank
};

// The word for a motion (regime.hpp has the rules), from the record of its traces. Plain numbers, no
// communication.

// What is known of the scene beside the record.
struct SceneContext {
  double v = 0;
  double scale = 1;  // of psi (scales.hpp, velocity)
  std::optional<double> growth;  // of perturbations of sliding, as the steps have it: its sign is certain
  bool stable = false, unstable = false;  // sliding of the scene itself, whatever the steps make of it
  double linear = 0;                      // its growth rate, where one of them is true
  bool unloaded = false;                  // nothing will ever move a medium at rest
  // time until the force on the first node that rests or lags reaches its friction
  double loading = 0;
  double cycle = 0;         // about the longest time between two slips, or the period of an oscillation
  double distance_now = 0;  // largest |psi - steady| of all nodes at the end
  double speed_now = 0;     // largest |psi|
  double forcing = 0;       // period of the load; 0: none
  bool sticks = false;      // friction may hold a node at psi = 0
};

struct Judgement {
  Motion motion = Motion::undecided;
  std::optional<double> rate, time_to_decide;
  std::optional<double> period;  // where the motion repeats
  double period_error = 0;       // as its passages tell
  // of forward psi, over the last period; the last quarter where it has none
  double low = HUGE_VAL, high = -HUGE_VAL;
};

Judgement judge(const MotionRecord& record, const SceneContext& around);

}  // namespace stickslip
