// What the searches for modes share: comparing, sorting and merging them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "stickslip/stability/continuum.hpp"
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

}  // namespace stickslip
