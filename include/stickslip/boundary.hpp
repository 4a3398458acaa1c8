// Where steady sliding loses stability: the zeros of its growth rate in one option, and the curve of zeros in two.
//
// The growth rate G is the largest real part among the modes that the grid resolves. Where all nodes are alike it is
// the largest over the exact discrete dispersion relation, all modes looked at. Elsewhere the rightmost modes are
// followed by two-sided Rayleigh steps from one set of parameters to the next, and sought anew by Krylov-Schur when the
// parameters have moved far, so that a change of the leading mode is seen.
#pragma once

#include <petscsys.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/options.hpp"
#include "stickslip/spectrum.hpp"

namespace stickslip {

// One option and the range in which it varies. Coordinate 0 is `from`, 1 is `to`, evenly in the value or its logarithm.
struct Axis {
  std::string name;
  double from = 0, to = 1;
  bool logarithmic = false;
  std::vector<std::string> same = {};  // options that take the same value (k0 = k1)
  double value(double coordinate) const;
};

// A point of the boundary.
struct Crossing {
  double x = 0, y = 0;           // coordinates on the axes
  double value = 0, value2 = 0;  // of the options
  double growth = 0;             // what is left of it
  double frequency = 0, wavenumber = 0;
  bool degenerate = false;       // many modes cross at once; the one named has the smallest wavenumber
  double residual = 0;           // |J x - lambda x|/|x| of the mode
  std::string kind;              // hopf or zero
  int piece = 0;                 // of the curve
  bool switched = false;         // another mode leads than at the point before
  std::optional<bool> complete;  // no mode grows there, by the count; empty where it was not counted
};

// The growth rate as a function of one or two options.
class GrowthRate {
 public:
  // Throws UsageError where an axis names no real option of this scene or leaves its range.
  GrowthRate(MPI_Comm comm, const Options& options, std::vector<Axis> axes);

  const std::vector<Axis>& axes() const { return axes_; }
  Options options_at(double x, double y = 0) const;

  struct Leading {
    Mode mode;       // the rightmost; psi empty where it comes from the exact relation
    bool degenerate;
  };
  // The leading mode; nothing where there is no steady sliding. Collective.
  std::optional<Leading> leading(double x, double y = 0);
  double operator()(double x, double y = 0);  // its real part, NaN where there is none

  // dG/dx along the first axis from the eigenvectors: -w (dS/dx) p / (w S' p).
  double slope(double x, const Leading& at);

  // The point with its mode polished on the matrix itself.
  Crossing crossing(double x, double y = 0);
  // The growth rate is zero there: no jump through zero, where a mode enters or leaves what the grid resolves.
  bool vanishes(const Crossing& c) const;
  // Counts the growing modes at a point (Crossing::complete), where one of `points` such counts is affordable at
  // place `number` among them.
  void count_growing(Crossing& c, std::size_t number, std::size_t points);
  // The next search for the leading modes is made with all means, as the first one is.
  void forget() {
    pool_.clear();
    searched_ = false;
  }
  // Where the parameters have moved by more than this (of the box) from the place of the last search, or the
  // coefficients by half the oscillation's frequency, the modes found
  // at another place as near are taken up, or they are sought anew.
  void search_every(double reach) { reach_ = reach; }
  // They are at the next place, wherever it is.
  void search_next() { due_ = true; }

  bool enters() const;  // whether the linear operator changes along the first axis at all
  long evaluations() const { return evaluations_; }

 private:
  struct Followed {
    Mode mode;                  // as it was where it was polished last
    std::vector<Complex> left;  // its left eigenvector
  };
  Mode with_vector(const Sliding& sliding, const Mode& mode) const;
  static std::optional<Complex> estimate(const Sliding& sliding, const Followed& followed);
  static bool follow(const Sliding& sliding, Followed& followed);
  void take_up(const Sliding& sliding, const std::vector<Followed>& more, double height);
  std::optional<Leading> leading_followed(const Sliding& sliding, double height, double level);
  MPI_Comm comm_;
  Options options_;
  std::vector<Axis> axes_;
  std::vector<Followed> pool_;
  std::size_t leader_ = 0;  // of the pool
  struct Place {
    double x, y;
    double K0, stiffest;           // A K0 and A (K0 + K1 times the largest kappa^2)
    std::vector<double> drag, r;  // A beta + A q, and r
    std::vector<Followed> found;
  };
  static Place place_of(const Sliding& sliding, double x, double y);
  bool near(const Place& a, const Place& b) const;
  std::vector<Place> places_;  // of searches, while they take little memory
  std::optional<Place> pool_at_;
  double reach_ = 0.04;
  bool searched_ = false, due_ = false;
  long evaluations_ = 0;
};

// The growth rate sampled evenly: `side` values on each axis, the first axis fastest; NaN without steady sliding.
struct Samples {
  int side = 0;
  std::vector<double> growth;
};

// Every zero on the first axis, ascending in the coordinate. `notes`: what is not as it should be. Collective.
std::vector<Crossing> boundary_points(GrowthRate& growth, Samples& samples, std::vector<std::string>& notes);

// The curve in the box of both axes: about `points` points, even along it in the coordinates, ends on the borders of
// the box included; several pieces, closed ones too. `notes`: why a piece ended inside the box. Collective.
std::vector<Crossing> boundary_curve(GrowthRate& growth, PetscInt points, Samples& samples,
                                     std::vector<std::string>& notes);

// What time integration of the full system finds beside the curve.
struct Verified {
  double value = 0, value2 = 0;  // of the options
  double growth = 0;             // growth rate there
  std::string expected;          // what the linear answer says: sliding or stick-slip
  std::string from_sliding;      // regime reached from slightly perturbed sliding: sliding, stick-slip, undecided
  std::string from_stick_slip;   // the same from large oscillations
  std::string regime;            // both the same, or `both live` (hysteresis), or undecided
};

// `count` points of the curve, each checked on its unstable and its stable side. Collective over PETSC_COMM_WORLD.
std::vector<Verified> verify_boundary(GrowthRate& growth, const std::vector<Crossing>& points, PetscInt count);

// The regime that a scene reaches in the time given, from psi = steady + amplitude (1 + cos(k x))/2. Collective.
std::string regime_from(const Options& options, const Sliding& sliding, double amplitude, double k, double duration);

// The plate velocity at which uniform sliding loses stability, in closed form, for the laws of velocity alone without
// spread: sqrt(1 - s delta/gamma), sqrt(1 - zeta/f0), sqrt(f0/zeta) - 1. Nothing for other scenes, or where there is
// none.
std::optional<double> closed_form_velocity(const Scene& scene);

}  // namespace stickslip
