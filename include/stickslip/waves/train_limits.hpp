// Where trains end and where their stability on their ring changes: on a branch in one parameter, and
// followed from there in two.
//
// A fold: two trains of the family merge, dvalue = 0 along the trains. A change of stability: the growth rate
// of one eigenvalue passes through zero (wave_stability.hpp); it may oscillate in the frame of the train
// (`hopf`) or not (`zero`). On the surface of all trains (alpha, value2), train_field.hpp, each is the zero
// line of a smooth function, which is followed there (numerics/level_curve.hpp) and whose points are spread
// evenly in the two parameters. Computed alike on every rank.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/waves/train.hpp"
#include "stickslip/waves/wave_stability.hpp"

namespace stickslip {

// What a train is asked of, as a function of two parameters; may throw as that of TrainFamily.
struct TrainFamily2 {
  std::string name, name2;
  std::function<TrainCase(double, double)> at;
};

struct TrainLimit {
  std::string kind;  // fold, hopf, zero
  double value = 0, value2 = 0;
  double frequency = 0;   // of the mode that crosses, in the frame of the train, 1/time
  double wavenumber = 0;  // of its Bloch factor, 1/length
  PetscInt bloch = 0;
  double speed = 0, length = 0, period = 0;
  // no other mode grows there: trains on one side are stable; empty where not asked for
  std::optional<bool> leads;
};

struct TrainLimitCurve {
  std::vector<TrainLimit> points;
  std::string end;  // why it ends, in words
};

// Every fold of a branch and, with `stability`, every change of its trains' stability between two
// neighbouring points, in order. Folds to 1e-8 of the step of the branch, changes of stability to the
// accuracy of eigenvalues. `value2` stays. `notes` becomes what was seen and not located.
std::vector<TrainLimit> train_limits(const TrainFamily2& family, const Branch& branch, double value2,
                                     bool stability, std::vector<std::string>& notes);

// Folds and changes of stability, each followed from value2 = from2 to to2 while `value` stays between from
// and to: at most `steps` steps.
std::vector<TrainLimitCurve> train_limit_curves(const TrainFamily2& family, const Branch& branch, double from,
                                                double to, double from2, double to2, int steps,
                                                std::vector<std::string>& notes);

// A train that was looked at.
struct TrainSample {
  double value = 0, value2 = 0;
  bool stable = false;  // on its ring
};

// A line of limits through the box value, value2 in [0, 1].
struct TrainLimitLine {
  CurvePiece piece;
  std::vector<TrainLimit> limits;  // at its points; it is not asked whether they lead
  // The limit at a place of the piece, and whether it leads; empty where it is not found.
  std::function<std::optional<TrainLimit>(const CurvePlace&)> at;
};

// Where the trains of a branch at value2 = at2 are stable, and each line where that begins or ends, followed
// both ways through the box in at most `steps` steps each: limits at which no other mode grows. Those that
// are `known` are left out. `lost`: how many more were seen and not located.
struct StableTrains {
  std::vector<TrainSample> samples;
  std::vector<TrainLimitLine> lines;
  int lost = 0;
};
StableTrains stable_trains(const TrainFamily2& family, const Branch& branch, double at2, int steps,
                           const std::function<bool(const TrainLimit&)>& known);

}  // namespace stickslip
