// The boundary of steady sliding: its growth rate as a function of a scene's parameters, where that is
// zero, and what is born there.
#pragma once

#include <petscsys.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/stability/linearised_operator.hpp"
#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

// Whether stick-slip grows out of a Hopf point of steady sliding (supercritical) or sliding loses to it by a
// jump (subcritical): the first Lyapunov coefficient.
//
// With x the deviation of all unknowns from sliding, J x its linear rate and B, C the second and third
// derivatives of the rates, which are those of friction and of the state's rate, node by node; J q = i omega
// q and p its left vector, p^T q = 1,
//     c = p^T [ C(q, q, q*) - 2 B(q, J^-1 B(q, q*)) + B(q*, (2 i omega - J)^-1 B(q, q)) ].
// The amplitude a of psi (half of its range at the node that moves most) then obeys, near the point,
//     da/dt = growth a + l a^3,     l = Re c/(8 max |q_psi|^2),
// so that the oscillation born there has a^2 = -growth/l. The unit of l is that of 1/(time velocity^2).
// Uniform motion without a state: l = -A F'''(v)/16.
//
// On a ring of equal nodes a wave of wavenumber k other than 0 crosses with its mirror image. Travelling
// waves and standing ones then both branch off, each with its coefficient (`travelling`, `standing`). With z,
// w the complex amplitudes of the two directions, z' = (i omega + alpha |z|^2 + beta |w|^2) z and the same
// for w; alpha and (alpha + beta)/2 say how sum |z|^2 + |w|^2 grows on either, and the larger of the two is
// the largest of all directions: where it is negative sliding attracts and the wave that has it is the stable
// one, where it is positive that wave leaves by a jump. `coefficient` is that wave's.
//
// Source: Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., Springer 2004, section 5.4
// (5.62); for waves: M. Golubitsky, I. Stewart and D. G. Schaeffer, Singularities and Groups in Bifurcation
// Theory II, Springer 1988, chapter XVII. Not collective; every rank that calls holds the whole line.
struct Criticality {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  // l of the oscillation that `of` names; NaN where why_not says why
  double coefficient = none;
  double travelling = none, standing = none;  // of both, on a ring with k other than 0
  // uniform, travelling, standing, or mode (of a medium that differs)
  std::string of;
  std::string why_not;

  bool known() const { return coefficient == coefficient; }
  // supercritical, subcritical, or empty.
  std::string word() const { return !known() ? "" : coefficient < 0 ? "supercritical" : "subcritical"; }
};

// Of the mode `m` of J = LinearisedOperator(steady), Im > 0, whose real part is near 0 and is left out.
// `continuum`: the grid plays no part, and the mode is the wave of its wavenumber; its psi may then be empty,
// as it may where J has exact waves. The cost is that of two banded factorisations.
Criticality criticality(const SteadySliding& steady, const LinearisedOperator& J, const Mode& m,
                        bool continuum);

// The leading mode of steady sliding, as a function of the scene and of what is known of a place nearby.
//
// Where all modes are known in closed form, and in small matrices, nothing else is asked. Elsewhere the few
// modes that lead at another place, or nearly do, are followed to this one: w S(lambda) p = 0, with their
// left and right eigenvectors w and p, gives each eigenvalue with an error of second order in what has
// changed, and those that might lead are taken along by Rayleigh's quotient iteration on both eigenvectors,
// one banded factorisation a step, which cubes errors (Parlett, Mathematics of Computation 28 (1974) 679). A
// count of the modes further right says whether one is missing; it is sought where the count sees it, then by
// all means of compute_spectrum.

// The rightmost mode; psi empty where it comes from a dispersion relation.
struct LeadingMode {
  Mode mode;
  bool degenerate = false;  // others have the same growth rate
};

// Its real part; NaN where there is none.
inline double growth_of(const std::optional<LeadingMode>& leading) {
  return leading ? leading->mode.value.real() + 0. : std::numeric_limits<double>::quiet_NaN();  // + 0.: no -0
}

// A mode with its left eigenvector, as they were where the mode was polished last.
struct FollowedMode {
  Mode mode;
  std::vector<Complex> left;
};

// What is known of the modes about a place: those that lead there or nearly do, the leading one first. Empty
// where nothing is known, or where nobody needs to know it.
struct KnownModes {
  std::vector<FollowedMode> modes;
  bool sure = true;  // false: one was lost on the way here, or the count gave no answer
};

struct LeadSettings {
  bool refine = true;  // modes beyond the frequency that the grid resolves do not count
  // how far behind another mode, in parts of the frequency, one may be taken for the leading one
  double slack = 1e-7;
  // The sign need be right only: where a mode known grows, those that lead it are not sought, and elsewhere
  // only those that grow.
  bool only_sign = false;
};

// The leading mode; nothing where none is found. `counted`: none leads it, else it is the best of those
// known. `known`: guesses, which save work and, where it is counted, change no answer; they become what is
// known here. Collective over comm; every rank gets the same.
std::optional<LeadingMode> lead(MPI_Comm comm, const LinearisedOperator& J, KnownModes& known, bool counted,
                                const LeadSettings& settings);

// Adds modes known at another place to those known here, followed to this one.
void take_up(const LinearisedOperator& J, KnownModes& known, const std::vector<FollowedMode>& more,
             const LeadSettings& settings);

// The number of modes right of `a` that count; empty where an eigenvalue stands too near that line. `where`:
// as of count_right(). Collective.
std::optional<long> count_leading(MPI_Comm comm, const LinearisedOperator& J, double a, bool refine,
                                  std::vector<Complex>* where = nullptr);

// The answer without a grid, where there is one: of a continuum whose nodes are all alike, with `refine`.
std::optional<ContinuumLead> lead_without_grid(const LinearisedOperator& J, bool refine);
// Whether the leading mode is the largest of all in closed form; and whether it is followed at all.
bool all_known(const LinearisedOperator& J, bool refine);
bool is_followed(const LinearisedOperator& J, bool refine);

// As far right of a mode as it and the count may be wrong.
double count_margin(const LinearisedOperator& J, double frequency, double part = 1e-7);
// Growth rates closer than this are equal to round-off.
double same_growth(const LinearisedOperator& J);

// The growth rate of steady sliding as a function of one or two parameters of its scene: the largest real
// part among the modes that count. With `refine` those are the modes of the continuum, as far as the grid
// resolves them, and in the chain all; without it every mode of the matrix.
//
// A continuum whose nodes are all alike is asked as such (fastest_wave.hpp): no grid plays a part. A chain of
// equal blocks, and without `refine` a uniform continuum, has the largest over the exact discrete dispersion
// relation, all modes looked at. Elsewhere modes are followed and counted. What lattices and lines
// ask at many places is followed from the middles of small cells of the box, where it is counted, once.

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

// Where steady sliding loses stability: the zeros of its growth rate in one parameter, and the curve of zeros
// in two.

// The growth rate sampled evenly: `side` values on each axis, the first axis fastest; NaN without steady
// sliding.
struct Samples {
  int side = 0;
  std::vector<double> growth;
};

// A place on the curve where something changes. bautin: the first Lyapunov coefficient passes through zero,
// so that a supercritical Hopf point becomes a subcritical one; a fold of oscillations begins there.
struct SpecialPlace {
  std::string kind;
  Crossing at;
};

// What is found beside the points themselves.
struct BoundaryFindings {
  Samples samples;
  std::vector<std::string> notes;  // what is not as it should be
  // Of one parameter: coordinates where, without a point, a growth rate that is 0 begins or ceases to be, or
  // sliding under a load is lost or found again.
  std::vector<double> turns;
  // The places (codimension two) where one mode takes over from another of different kind or frequency;
  // curves only.
  std::vector<Crossing> meetings;
  std::vector<SpecialPlace> special;  // curves only
};

// What a growth rate says of sliding: "stable", "unstable", neither where it is 0, or that there is none
// (NaN).
std::string stability_word(double rate);
// The values of the axes at a place of the unit square, in words.
std::string place_text(const std::vector<Axis>& axes, double x, double y);
// A note for each end of a line where no way on was found.
void note_stuck(const std::string& line, const std::string& why, const std::vector<Axis>& axes,
                const std::vector<CurvePiece>& pieces, std::vector<std::string>& notes);

// The zeros of f that samples of it on an axis show: changes of sign, and zeros that f only touches, of which
// the bracket has no width. Findings tell of intervals along which f is 0; samples right beyond them are
// added.
std::vector<Bracket> zeros_shown(const std::function<double(double)>& f, const Axis& axis,
                                 std::vector<Sample>& samples, BoundaryFindings& findings);

// A line of zeros in the box, and what is said of it where it stops inside.
struct LineInBox {
  std::string line, where;
  int cells;             // of the lattice on which f is sampled
  double step;           // the longest
  double start = 1e-9;   // to which the places to start from are found
};
// About `count` points of the line on which f is 0, even along it: those that `at` makes of places of it.
std::vector<Crossing> zeros_in_box(const PlaneFunction& f, const std::vector<Axis>& axes,
                                   const LineInBox& asked, PetscInt count,
                                   const std::function<Crossing(double x, double y)>& at, Samples& samples,
                                   std::vector<std::string>& notes);

// Every zero on the first axis, ascending in the coordinate, bracketed on 33 samples and by the least
// |growth| between samples of one sign. `error` of a point: growth rate on a grid of half the spacing over
// the slope. Collective.
std::vector<Crossing> boundary_points(GrowthRate& growth, BoundaryFindings& findings);

// The curve in the box of both axes (level_curve.hpp): about `points` points, even along it in the
// coordinates, ends on the borders of the box included; several pieces, closed ones too. `error` and `error2`
// of a point: how far the modes followed move it along the curve's normal when the spacing is halved.
// Collective.
std::vector<Crossing> boundary_curve(GrowthRate& growth, PetscInt points, BoundaryFindings& findings);

// The plate velocity at which uniform sliding loses stability, in closed form, for the laws of velocity alone
// without spread: sqrt(1 - s delta/gamma), sqrt(1 - zeta/f0), sqrt(f0/zeta) - 1. Nothing for other scenes, or
// where there is none.
std::optional<double> closed_form_velocity(const Scene& scene);

}  // namespace stickslip
