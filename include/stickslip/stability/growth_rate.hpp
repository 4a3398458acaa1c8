// The growth rate of steady sliding as a function of one or two options: the largest real part among the modes that the
// grid resolves.
//
// Where all nodes are alike it is the largest over the exact discrete dispersion relation, all modes looked at.
// Elsewhere the rightmost modes are followed by two-sided Rayleigh steps from one set of parameters to the next, and a
// count of the modes further right says now and then whether one was missed, which is then sought.
#pragma once

#include <petscsys.h>

#include <functional>
#include <optional>
#include <string>
#include <utility>
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
  // Counts the growing modes at a point (Crossing::complete).
  void count_growing(Crossing& c);
  // What such a count costs at (x, y), roughly in seconds; 0 where none is needed.
  double count_cost(double x, double y) const;
  // Seeks the modes that lead those followed, at a place where a count has found some.
  void seek(double x, double y);

  // Where the parameters have moved by more than `reach` (of the box) from the place of the last count, or the
  // coefficients by half the oscillation's frequency, the modes found at another place as near are taken up, or it is
  // counted anew. Never with a reach of 0: for those who count themselves.
  void count_every(double reach) { reach_ = reach; }
  // It is counted at the next place, wherever that is.
  void count_next() { due_ = true; }
  // Away from its zeros the growth rate need have the right sign only: where a mode followed grows, those that lead it
  // are not sought, and elsewhere only those that grow.
  void only_sign(bool yes) { only_sign_ = yes; }
  // A mode was lost on the way since the last call of this: it is time to count.
  bool doubtful() { return std::exchange(doubtful_, false); }

  // A scene with fewer nodes whose zeros lie near this one's, to scan and trace on; nothing where it has more than half
  // as many. The continuum: a grid of order 2 with about eight nodes in a boundary layer and in a draw of spread
  // friction, if it has what the mean medium favours anywhere in the box. The chain: its first 1024 blocks, or more
  // where its layers are wide. What leads here alone (modes of short waves, those trapped further down the chain) is
  // found when points are placed here.
  std::optional<GrowthRate> reduced() const;
  // Takes up the modes that the reduced one has at (x, y), as guesses.
  void take_hints(GrowthRate& reduced, double x, double y);

  bool enters() const;  // whether the linear operator changes along the first axis at all
  long evaluations() const { return evaluations_; }
  void watch(std::function<void()> each) { each_ = std::move(each); }  // is called before every evaluation

 private:
  struct Followed {
    Mode mode;                  // as it was where it was polished last
    std::vector<Complex> left;  // its left eigenvector
  };
  Mode with_vector(const Sliding& sliding, const Mode& mode) const;
  static std::optional<Complex> estimate(const Sliding& sliding, const Followed& followed);
  static bool follow(const Sliding& sliding, Followed& followed);
  void take_up(const Sliding& sliding, const std::vector<Followed>& more, double height);
  void keep_rightmost(const Sliding& sliding, std::vector<Followed> all);
  std::optional<Leading> leading_followed(const Sliding& sliding, double height, double level);
  static bool add_followed(const Sliding& sliding, double height, Mode&& mode, std::vector<Followed>& all);
  void search(const Sliding& sliding, double height, bool thorough = false);
  bool complete(const Sliding& sliding, double height);
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
  std::vector<Place> places_;  // of counts, while they take little memory
  std::optional<Place> pool_at_;
  double reach_ = 0.04;
  double slack_ = 1e-7;  // how far behind another mode, in parts of the frequency, one may be taken for the leading one
  bool due_ = false, hinted_ = false, only_sign_ = false, doubtful_ = false;
  long evaluations_ = 0;
  std::function<void()> each_;
};

}  // namespace stickslip
