// What the searches for modes share: comparing, sorting and merging them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

Complex inner(const std::vector<Complex>& a, const std::vector<Complex>& b);  // conj(a) b
void normalise(std::vector<Complex>& p);                                      // largest entry 1
// Round-off in an eigenvalue: that of the stiffest entry, felt through dS/dlambda.
double rounding(const LinearisedOperator& s, Complex lambda);

// lambda with w S(lambda) p = 0, from a mode's value, its psi p and a vector w near its left eigenvector:
// errors of p and w enter as their product, and D2 is taken by differences, so that round-off of size 1/h^2
// stays out. Nothing where w S' p is less than `least` of what it is summed from (nearly double eigenvalues),
// or where no value is near.
std::optional<Complex> stationary_value(const LinearisedOperator& s, const Mode& mode,
                                        const std::vector<Complex>& w, double least = 1e-3);

// What a polished eigenvalue may be wrong by.
class Tolerance {
 public:
  explicit Tolerance(const LinearisedOperator& s)
      : s_(s), floor_(1e-11 * (own_rate(s) + 1.01 * s.imaginary_bound())) {}
  double operator()(const Mode& m) const { return std::max(10 * rounding(s_, m.value), floor_); }

 private:
  const LinearisedOperator& s_;
  double floor_;
};

// A fixed vector that favours no wave, so that every rank and every run finds the same.
class Noise {
 public:
  double next() {
    seed_ = seed_ * 6364136223846793005u + 1442695040888963407u;
    return double(seed_ >> 11) * 0x1p-53 - 0.5;
  }

 private:
  std::uint64_t seed_ = 0x9e3779b97f4a7c15u;
};

// The eigenvector nearest to z, by inverse iteration; not polished.
Mode mode_near(const LinearisedOperator& s, Complex z);

// Of a list that has one of each pair of conjugates, the one with Im > 0: how many a value stands for.
inline PetscInt eigenvalues_of(Complex value) { return value.imag() > 0 ? 2 : 1; }
// Rightmost first; real parts equal to the tolerance are put in the order of frequency.
void sort_modes(std::vector<Mode>& modes, double tolerance);
// How many of the sorted modes with |Im| up to `height` are listed: as many as make `count` eigenvalues, and
// at least one that is no symmetry.
std::size_t shown_modes(const LinearisedOperator& s, const std::vector<Mode>& modes, double height,
                        PetscInt count);
// Values closer to this one than that may belong to one eigenvalue.
double nearness(const LinearisedOperator& s, Complex value);
// p without what it has of q.
void remove_part(std::vector<Complex>& p, const std::vector<Complex>& q);
// Whether a polished mode is one more beside those known: where some have nearly its value, what it has
// beside their span must be an eigenvector of that value too. (Modes of one value may be any of their span:
// neither values nor pairs of shapes tell copies.)
bool is_new(const LinearisedOperator& s, const std::vector<Mode>& known, const Mode& m);
// Adds polished modes that are new.
void add_new(const LinearisedOperator& s, std::vector<Mode>& modes, std::vector<Mode> more);
// Adds guesses, but for those that lie nearly in the span of others with nearly the same value.
void add_guesses(const LinearisedOperator& s, std::vector<Mode>& guesses, std::vector<Mode> more);
// One more eigenvector of a mode's value beside those known, where there is one: by inverse iteration.
std::optional<Mode> twin(const LinearisedOperator& s, const std::vector<Mode>& known, const Mode& m);
// A uniform ring has every travelling mode twice; a Krylov space built from one vector sees one of the two.
// The other is its mirror image.
void add_mirror_images(const LinearisedOperator& s, std::vector<Mode>& modes);

// What is known of the modes in closed form, where all nodes are alike.

// The eigenvalues by the exact discrete dispersion relation (LinearisedOperator::exact_waves).
class ExactModes {
 public:
  explicit ExactModes(const LinearisedOperator& s);
  bool apply() const { return !roots_.empty(); }
  // Eigenvalues with real part above a and |Im| up to `height`, the symmetry of a line that slides as a whole
  // included.
  long count(double a, double height) const;
  // Largest distance of a mode from the nearest eigenvalue of the relation, relative to the size of the
  // eigenvalue.
  double distance(const std::vector<Mode>& modes) const;
  // Guesses: sine waves, the rightmost first, equal ones by frequency; not polished.
  std::vector<Mode> rightmost(double height, std::size_t count) const;

 private:
  struct Root {
    Complex value;  // Im >= 0
    double k;
    int members;  // its conjugate and its multiplicity counted
  };
  const LinearisedOperator& s_;
  std::vector<Root> roots_;  // by frequency
};

// What ever shorter waves of a line of the continuum come to grow at: they see the mean damping alone (Cox
// and Zuazua 1994 for the wave equation), by the trapezoidal rule on the nodes. With viscosity between
// neighbours S/kappa^2 tends to (K1 + lambda N)(lambda + r): they decay, at -K1/N or with their state.
double short_wave_growth(const LinearisedOperator& s);

// Where modes may stand, and what they may look like: the beginning of every search.
constexpr std::size_t many_nodes = 5000;  // beyond, the search is frugal: what it misses the count points at

// Frequencies of the medium with mean coefficients, one a mode: knots with about one eigenvalue between two
// of them.
std::vector<double> mean_frequencies(const LinearisedOperator& s);
// Shifts where the medium with mean coefficients grows fastest, at the ends of its band, and between. One
// shift is enough where all nodes are alike.
std::vector<Complex> first_shifts(const LinearisedOperator& s, double height, PetscInt count);
// What a node would do alone: the rightmost root for three stiffnesses; or of its oscillations only.
double local_growth(const LinearisedOperator& s, std::size_t i, bool oscillations);
// Segments of the line where the mean over 1, 4, 16, ... nodes of the local growth is largest: what they
// would do alone is nearly what modes trapped there do. `quick`: one segment a length.
struct Segment {
  std::size_t first, width;
};
std::vector<Segment> promising_segments(const LinearisedOperator& s, bool quick);
// The modes of a segment alone (psi on its nodes). `inside`: only those that are small at the ends of the
// segment: others look more growing than they are, and would stand before them.
std::vector<Mode> segment_modes(const LinearisedOperator& s, const Segment& segment, double height,
                                bool inside);

// The search for the rightmost modes of a line too long for a dense matrix.
//
// Guesses come from Krylov spaces at shifts, from segments of the line, from coarser grids, from sine waves;
// all are polished. Then the eigenvalues right of the last one listed are counted. While the count names more
// than are known, the search goes on where they must be: it is narrowed down to a gap between known real
// parts, then in frequency. Every step is a list of tasks shared among the ranks and put together in the
// order of the tasks, so that the number of ranks does not matter.
class ModeSearch {
 public:
  ModeSearch(MPI_Comm comm, const LinearisedOperator& s, const SpectrumSettings& settings, double height);
  // The modes found, rightmost first, and in `result` what is known of them: complete, list_complete,
  // missing, completeness_check. Collective; the same on every rank. Throws Failure where nothing is found.
  std::vector<Mode> run(Spectrum& result);
  // Between the rightmost mode and the line right of which all are counted.
  double margin() const { return margin_; }

 private:
  using Task = std::function<std::vector<Mode>(std::size_t)>;
  struct Count {
    long all, known;  // eigenvalues right of a line, and those of them that are modes known
  };
  struct Line {
    double at, slack;  // it may be moved by that much without passing a known mode
  };

  bool in_reach(const Mode& m) const { return m.value.imag() <= height_; }
  bool leads(const Mode& m) const { return in_reach(m) && !is_neutral(s_, m); }
  const Mode* rightmost() const;

  std::vector<std::vector<Mode>> distribute(std::size_t tasks, const Task& task) const;
  void select(std::vector<Mode>& guesses) const;
  void take(std::vector<Mode> guesses);
  void try_shifts(const std::vector<Complex>& shifts, PetscInt count);
  void try_places(const std::vector<Complex>& places);
  bool try_twins(std::size_t members);
  void try_segments(bool quick, bool inside);
  void try_coarse_grid();
  bool try_resolved();
  void first_guesses();
  void scan(std::vector<Complex> places, double line, int round);

  Line list_line(std::size_t listed) const;
  std::optional<Count> count(double line, std::vector<Complex>* where = nullptr) const;
  std::optional<Count> count(const Line& line, std::vector<Complex>* where = nullptr) const;
  std::size_t listed() const;
  bool look_between(std::size_t members);
  bool close_list(Spectrum& result);
  void close_rightmost(Spectrum& result);
  std::vector<Complex> unknown(std::vector<Complex> zeros) const;
  std::string counted_text(const Count& c, double line) const;

  MPI_Comm comm_;
  const LinearisedOperator& s_;
  const SpectrumSettings settings_;
  const double height_;
  const ExactModes exact_;
  const bool many_;  // too many nodes for many shifts
  const Tolerance tolerance_;
  const double own_;          // rate of the scene
  const std::size_t wanted_;  // pairs
  bool resolved_sought_;
  double margin_ = 0;
  std::vector<Mode> modes_;
};

}  // namespace stickslip
