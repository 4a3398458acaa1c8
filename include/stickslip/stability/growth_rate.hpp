// The growth rate of steady sliding as a function of one or two parameters of its scene: the largest real
// part among the modes that count. With `refine` those are the modes of the continuum, as far as the grid
// resolves them, and in the chain all; without it every mode of the matrix.
//
// A continuum whose nodes are all alike is asked as such (continuum.hpp): no grid plays a part. A chain of
// equal blocks, and without `refine` a uniform continuum, has the largest over the exact discrete dispersion
// relation, all modes looked at. Elsewhere modes are followed and counted (lead.hpp). What lattices and lines
// ask at many places is followed from the middles of small cells of the box, where it is counted, once.
#pragma once

#include <petscsys.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/stability/criticality.hpp"
#include "stickslip/stability/lead.hpp"

namespace stickslip {

// A parameter and the range in which it varies. Coordinate 0 is `from`, 1 is `to`, evenly in the value or its
// logarithm.
struct Axis {
  std::string name;  // for messages
  double from = 0, to = 1;
  bool logarithmic = false;
  std::vector<std::string> same = {};  // parameters that take the same value (k0 = k1)
  double value(double coordinate) const;
  double slope(double coordinate) const {
    return logarithmic ? value(coordinate) * std::log(to / from) : to - from;
  }
};

// The scene with the values of the axes; the second value is 0 where there is one axis.
using SceneAt = std::function<Scene(double value, double value2)>;

// A point of the boundary.
struct Crossing {
  double x = 0, y = 0;                   // coordinates on the axes
  double value = 0, value2 = 0;          // of the parameters
  double growth = 0;                     // what is left of it
  double frequency = 0, wavenumber = 0;  // infinite where the zero is that of the limit of short waves
  bool degenerate = false;  // many modes cross at once; the one named has the smallest wavenumber
  double residual = 0;      // |J x - lambda x|/|x| of the mode; NaN for the limit of short waves
  // by how much a grid of half the spacing moves the point; 0 where no grid plays a part
  double error = 0, error2 = 0;
  std::string kind;              // hopf or zero; of stick-slip graze, fold, flip, torus or branch
  std::string of = "sliding";    // or stick-slip, waves, trains: whose end the point is
  double nx = 0, ny = 0;         // of stick-slip: unit vector on the axes, across the line to where it lives
  int piece = 0;                 // of the curve
  bool switched = false;         // another mode leads than at the point before
  std::optional<bool> complete;  // no mode grows there, by the count; empty where it was not counted
  Criticality criticality;       // of a hopf point, once asked for
};

// What is asked at places of the box of one or two axes.
class OnAxes {
 public:
  OnAxes(SceneAt scene_at, std::vector<Axis> axes)
      : scene_at_(std::move(scene_at)), axes_(std::move(axes)) {}
  const std::vector<Axis>& axes() const { return axes_; }
  Scene scene(double x, double y = 0) const { return scene_at_(value(0, x), value(1, y)); }
  // The place with its values, of which nothing else is known.
  Crossing crossing_at(double x, double y) const;
  long evaluations() const { return evaluations_; }
  void watch(std::function<void()> each) { each_ = std::move(each); }  // is called before every evaluation

 protected:
  void count_evaluation() {
    ++evaluations_;
    if (each_) each_();
  }
  // Of a parameter; 0 where there is no such axis.
  double value(std::size_t axis, double coordinate) const {
    return axis < axes_.size() ? axes_[axis].value(coordinate) : 0;
  }

  SceneAt scene_at_;
  std::vector<Axis> axes_;

 private:
  long evaluations_ = 0;
  std::function<void()> each_;
};

// Every member that evaluates is collective over comm; every rank gets the same.
class GrowthRate : public OnAxes {
 public:
  // Throws what scene_at throws (UsageError) at a corner of the box.
  GrowthRate(MPI_Comm comm, SceneAt scene_at, std::vector<Axis> axes, bool refine = true);

  // The leading mode, counted, whatever was asked before; nothing where there is no steady sliding.
  std::optional<LeadingMode> leading(double x, double y = 0);
  double operator()(double x, double y = 0);  // its real part, NaN where there is none
  // For many places: from the modes that were counted in the middle of the cell of the place, with what is
  // known here. A mode that takes over within the cell may be missed.
  std::optional<LeadingMode> followed(double x, double y, KnownModes& known);
  double followed(double x, double y = 0);
  // From modes known at a place nearby, as lead() takes and leaves them.
  std::optional<LeadingMode> leading_from(KnownModes& known, double x, double y, bool counted,
                                          bool only_sign = false);
  // Counts at a place whose cell may lack modes, and has it know what leads there.
  void learn(double x, double y = 0);

  // The point with its mode polished on the matrix itself. Throws Failure where there is no steady sliding.
  Crossing crossing(double x, double y = 0);
  Crossing crossing(double x, double y, const std::optional<LeadingMode>& leading) const;
  // Whether stick-slip grows out of that point or sliding loses to it by a jump.
  Criticality criticality(const Crossing& c);
  Criticality criticality(const Crossing& c, const std::optional<LeadingMode>& leading) const;
  // The growth rate is zero there: no jump through zero, where a mode enters or leaves what the grid
  // resolves.
  bool vanishes(const Crossing& c) const;
  // The mode that crosses has a frequency within a tenth of the highest that the grid resolves, or above it:
  // it is a matter of the grid.
  bool near_shortest(const Crossing& c) const;
  // Counts the growing modes at a point (Crossing::complete).
  void count_growing(Crossing& c) const;
  // What such a count costs in the middle of the box, roughly in seconds; 0 where none is needed, as all
  // modes are known.
  double count_cost() const;

  // The same on a grid of half the spacing; nothing in the chain, where the grid is the matter.
  std::optional<GrowthRate> finer() const;
  // A scene with fewer nodes whose zeros lie near this one's, to scan and trace on; nothing where it has more
  // than half as many. The continuum: a grid of order 2 with about eight nodes in a boundary layer and in a
  // draw of spread friction, if it has what the mean medium favours anywhere in the box. The chain: its first
  // 1024 blocks, or more where its layers are wide. What leads here alone (modes of short waves, those
  // trapped further down the chain) is found when points are placed here.
  std::optional<GrowthRate> reduced() const;
  // Modes that another grid's has at (x, y), beside those known here, as guesses.
  void take_hints(KnownModes& known, const GrowthRate& other, const KnownModes& there, double x,
                  double y) const;

  bool enters() const;  // whether the linear operator changes along the first axis at all
 private:
  // What the modes of a place are followed from, and the coefficients there.
  struct Cell {
    double K0 = 0, stiffest = 0;  // A K0 and A (K0 + K1 times the largest kappa^2)
    // A beta + A q, with what viscosity does to the shortest wave first; and r. Empty: no steady sliding.
    std::vector<double> drag, r;
    KnownModes known = {};
    double x = 0, y = 0;  // its middle
  };
  using CellKey = std::array<std::int64_t, 3>;  // halvings of its side, and its place on the axes
  std::optional<LinearisedOperator> linearised(double x, double y) const;
  static bool differ(const std::optional<LinearisedOperator>& a, const std::optional<LinearisedOperator>& b);
  std::optional<CellKey> cell_about(const LinearisedOperator& J, double x, double y);
  Cell& cell(const CellKey& key, std::size_t nodes);
  KnownModes nearest(double x, double y) const;  // that a cell knows: guesses
  double side();
  static Cell coefficients_of(const LinearisedOperator& J);
  static bool near(const Cell& a, const Cell& b);
  bool grid_suffices(const GrowthRate& coarse) const;

  MPI_Comm comm_;
  LeadSettings settings_;
  std::map<CellKey, Cell> cells_;  // counted, while they take little memory
  KnownModes recent_;  // where it was counted last: guesses
  double side_ = 0;
};

}  // namespace stickslip
