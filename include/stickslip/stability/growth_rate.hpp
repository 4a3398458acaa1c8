// The growth rate of steady sliding as a function of one or two parameters of its scene: the largest real
// part among the modes that count. With `refine` those are the modes of the continuum, as far as the grid
// resolves them, and in the chain all; without it every mode of the matrix.
//
// A continuum whose nodes are all alike is asked as such (continuum.hpp): the grid plays no part. A chain of
// equal blocks, and without `refine` a uniform continuum, has the largest over the exact discrete dispersion
// relation, all modes looked at. Elsewhere the rightmost modes are followed by two-sided Rayleigh steps from
// one set of parameters to the next, and a count of the modes further right says now and then whether one was
// missed, which is then sought.
#pragma once

#include <petscsys.h>

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/stability/continuum.hpp"
#include "stickslip/stability/criticality.hpp"
#include "stickslip/stability/spectrum.hpp"

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

// A mode with its left eigenvector, as they were where the mode was polished last.
struct FollowedMode {
  Mode mode;
  std::vector<Complex> left;
};

// The rightmost mode; psi empty where it comes from a dispersion relation.
struct LeadingMode {
  Mode mode;
  bool degenerate = false;  // others have the same growth rate
};

class FollowedModes;

// Every member that evaluates is collective over comm; every rank gets the same.
class GrowthRate {
 public:
  // Throws what scene_at throws (UsageError) at a corner of the box.
  GrowthRate(MPI_Comm comm, SceneAt scene_at, std::vector<Axis> axes, bool refine = true);
  GrowthRate(GrowthRate&&) noexcept;
  ~GrowthRate();

  const std::vector<Axis>& axes() const { return axes_; }
  Scene scene(double x, double y = 0) const;

  // The leading mode; nothing where there is no steady sliding.
  std::optional<LeadingMode> leading(double x, double y = 0);
  double operator()(double x, double y = 0);  // its real part, NaN where there is none

  // The point with its mode polished on the matrix itself. Throws Failure where there is no steady sliding.
  Crossing crossing(double x, double y = 0);
  // Whether stick-slip grows out of that point or sliding loses to it by a jump.
  Criticality criticality(const Crossing& c);
  // The growth rate is zero there: no jump through zero, where a mode enters or leaves what the grid
  // resolves.
  bool vanishes(const Crossing& c) const;
  // The mode that crosses has a frequency within a tenth of the highest that the grid resolves, or above it:
  // it is a matter of the grid.
  bool near_shortest(const Crossing& c) const;
  // Counts the growing modes at a point (Crossing::complete).
  void count_growing(Crossing& c);
  // What such a count costs in the middle of the box, roughly in seconds; 0 where none is needed, as all
  // modes are known.
  double count_cost() const;
  // Seeks the modes that lead those followed, at a place where a count has found some.
  void seek(double x, double y);

  // Where the parameters have moved by more than `reach` (of the box) from the place of the last count, or
  // the coefficients by half the oscillation's frequency, the modes found at another place as near are taken
  // up, or it is counted anew. Never with a reach of 0: for those who count themselves.
  void count_every(double reach) { reach_ = reach; }
  // It is counted at the next place, wherever that is.
  void count_next() { due_ = true; }
  // Away from its zeros the growth rate need have the right sign only: where a mode followed grows, those
  // that lead it are not sought, and elsewhere only those that grow.
  void only_sign(bool yes);
  // A mode was lost on the way since the last call of this: it is time to count.
  bool doubtful();

  // The same on a grid of half the spacing; nothing in the chain, where the grid is the matter.
  std::optional<GrowthRate> finer() const;
  // A scene with fewer nodes whose zeros lie near this one's, to scan and trace on; nothing where it has more
  // than half as many. The continuum: a grid of order 2 with about eight nodes in a boundary layer and in a
  // draw of spread friction, if it has what the mean medium favours anywhere in the box. The chain: its first
  // 1024 blocks, or more where its layers are wide. What leads here alone (modes of short waves, those
  // trapped further down the chain) is found when points are placed here.
  std::optional<GrowthRate> reduced() const;
  // Takes up the modes that another grid's has at (x, y), as guesses.
  void take_hints(GrowthRate& other, double x, double y);

  bool enters() const;  // whether the linear operator changes along the first axis at all
  long evaluations() const { return evaluations_; }
  void watch(std::function<void()> each) { each_ = std::move(each); }  // is called before every evaluation

 private:
  struct Place {
    double x, y;
    double K0, stiffest;          // A K0 and A (K0 + K1 times the largest kappa^2)
    std::vector<double> drag, r;  // A beta + A q, with what viscosity does to the shortest wave first; and r
    std::vector<FollowedMode> found;
  };
  std::optional<LinearisedOperator> linearised(double x, double y) const;
  static bool differ(const std::optional<LinearisedOperator>& a, const std::optional<LinearisedOperator>& b);
  // the answer without a grid, where there is one
  std::optional<ContinuumLead> closed(const LinearisedOperator& J) const;
  bool all_known(const LinearisedOperator& J) const;
  std::optional<LeadingMode> leading_wave(const LinearisedOperator& J) const;
  std::optional<LeadingMode> leading_followed(const LinearisedOperator& J, double x, double y);
  bool take_up_place(const LinearisedOperator& J, const Place& here, bool due);
  static Place place_of(const LinearisedOperator& J, double x, double y);
  bool near(const Place& a, const Place& b) const;
  bool grid_suffices(const GrowthRate& coarse) const;

  MPI_Comm comm_;
  SceneAt scene_at_;
  std::vector<Axis> axes_;
  bool refine_;
  std::unique_ptr<FollowedModes> modes_;
  std::vector<Place> places_;  // of counts, while they take little memory
  std::optional<Place> modes_at_;
  double reach_ = 0.04;
  bool due_ = false, hinted_ = false;
  long evaluations_ = 0;
  std::function<void()> each_;
};

}  // namespace stickslip
