// What watches a run: writes its frames, rows and catalogue, or measures something for its summary.
//
// A run drives any number of observers through
//     plan, archive (of a run that goes on from a checkpoint), start, step ..., archive (now and then), ...,
//     summarise
// and knows nothing else of them. A new quantity in the summary is one observer and its name in
// commands/quantities.cpp.
//
// Contract. step() is called at the start of a run (index 0, t_before = t; not where it goes on from a
// checkpoint) and after every accepted step, in order, with fields that are finite. Each call is collective:
// every rank makes it with the same numbers, so that an observer may communicate over the model's ranks, and
// none sees a step that another does not. u is the model's distributed vector (psi, eta and the stored state,
// node by node); it is not to be changed. What an observer wants to see inside a step it announces as times
// before the first; interpolate() gives u there, of the order of the method's dense output (docs/methods.md),
// as long as step() lasts.
//
// Where only what slides is advanced (plan.by_clusters; one rank then), step() is called at the start, at the
// end and at the announced times alone, and interpolate() gives u at the time of the call alone. In between,
// in the order of time, moved() is called for steps of some nodes, and changed() where nodes begin or cease
// to slide. A checkpoint is written after told_until() with its time; calls for that very time may come again
// in the run that goes on from it.
#pragma once

#include <petscvec.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/output/checkpoint.hpp"
#include "stickslip/output/run_file.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

class Model;
struct MovedNodes;  // src/model/moved_nodes.hpp
class MediumNow;

// One accepted step.
struct ObservedStep {
  std::int64_t index;  // number of this step, 0 for the start
  double t_before, t;
  Vec u;                    // at t
  std::int64_t rejections;  // since the beginning of the run, those before a restart included
  const std::function<void(double at, Vec into)>& interpolate;  // u at an announced time in [t_before, t]
};

// What observers ask for before the first step.
struct ObservationPlan {
  // only later times are to come: -1 at the start, the time of the checkpoint afterwards
  double after;
  RunLayout layout;  // what the file will hold; without an out_file nobody reads it
  bool by_clusters = false;
  // The times inside steps at which an observer interpolates: the first later than `t`, infinity where there
  // is none.
  std::vector<std::function<double(double t)>> next_times;

  double next_time(double t) const {  // the first of all of them
    double first = std::numeric_limits<double>::infinity();
    for (const auto& next : next_times) first = std::min(first, next(t));
    return first;
  }
};

class Observer {
 public:
  virtual ~Observer() = default;
  // Adds what this observer needs. Throws UsageError for what cannot be had.
  virtual void plan(ObservationPlan&) {}
  // Names what must survive a restart, each by a name that no other observer has: it is restored between
  // plan() and start(), and saved after any step. Throws std::exception, on every rank, where what is
  // restored does not fit.
  virtual void archive(Archive&) {}
  // The file is open: nullptr where none is written. It outlives the last step.
  virtual void start(RunFile*) {}
  virtual void step(const ObservedStep&) = 0;
  // Where only what slides is advanced.
  virtual void moved(const MovedNodes&, const MediumNow&) {}
  virtual void changed(double, const MediumNow&) {}
  virtual void told_until(double) {}  // no call for an earlier time will follow
  // Sets keys of the summary, the same on every rank. u: where the run ended, held nodes set; nullptr where
  // it failed, so that only what counts steps has something to say.
  virtual void summarise(Summary&, Vec) {}
};

// An observer of a program of one's own: the keys that it sets in the summary of `run`, and how it is made.
// Series of its own it announces in plan() as a RowGroup of the layout, and writes with RunFile::row.
struct OwnObserver {
  std::vector<SummaryKey> keys;
  std::function<std::unique_ptr<Observer>(const Model&)> make;
};
// To be called before stickslip::main. Throws std::logic_error for a key that is there already.
void register_observer(OwnObserver observer);
// T(const Model&), static T::keys().
template <class T>
void register_observer() {
  register_observer({T::keys(), [](const Model& model) { return std::make_unique<T>(model); }});
}

// An observer whose result is numbers: what -accuracy_of asks for.
class Measure : public Observer {
 public:
  // What was measured so far, the same on every rank; empty where the motion has none. Collective.
  virtual std::vector<double> values() const = 0;
};

// Makes one for a model, which may be one of several equal cells of the scene `whole`; it lives no longer
// than the model.
using MeasureMaker = std::function<std::unique_ptr<Measure>(const Model& model, const Scene& whole)>;

// What is looked at from one side only, the maxima of psi and its upward passages, is looked at from the side
// to which the plate goes, so that the mirror image of a motion is measured as the motion itself is.

// 1, or -1 where the plate goes backward: forward * psi is positive along its way.
inline double forward(const Scene& scene) { return scene.v < 0 ? -1 : 1; }

// The name in a checkpoint of what was seen in this direction.
inline std::string seen_from(const Scene& scene, const std::string& name) {
  return scene.v < 0 ? name + ".backward" : name;
}

}  // namespace stickslip
