// The few modes that lead a spectrum or nearly do, followed as the operator changes.
//
// w S(lambda) p = 0, with the left and right eigenvectors w and p of a place nearby, gives each eigenvalue
// with an error of second order in what has changed; those that might lead are taken along by Rayleigh's
// quotient iteration on both eigenvectors, one banded factorisation a step, which cubes errors (Parlett,
// Mathematics of Computation 28 (1974) 679).
#pragma once

#include <complex>
#include <optional>
#include <vector>

#include "stickslip/stability/growth_rate.hpp"

namespace stickslip {

// All calls are collective over comm; every rank holds the same.
class FollowedModes {
 public:
  // `refine`: modes beyond the frequency that the grid resolves do not count.
  FollowedModes(MPI_Comm comm, bool refine) : comm_(comm), refine_(refine) {}

  const std::vector<FollowedMode>& all() const { return modes_; }
  bool empty() const { return modes_.empty(); }
  void clear() { modes_.clear(); }

  // The leading one of the modes followed to this operator; nothing where the last one was lost, or too few
  // are left.
  std::optional<LeadingMode> follow(const LinearisedOperator& s);
  // The leading one as known, with no step taken; there must be one.
  LeadingMode leading(const LinearisedOperator& s) const;

  // Polishes them from where they were, whatever they become; searches where none is left.
  void recover(const LinearisedOperator& s);
  // What the shifts of `spectrum` find, or (thorough) all its means, beside the modes followed so far.
  void search(const LinearisedOperator& s, bool thorough);
  // Follows the modes of another place to this one, beside those here; the rightmost stay.
  void take_up(const LinearisedOperator& s, const std::vector<FollowedMode>& more);
  // Counts the modes right of the rightmost one here and adds those that are missing. False where that fails.
  bool complete(const LinearisedOperator& s);

  // The number of modes right of `a` that count; empty where an eigenvalue stands too near that line.
  std::optional<long> count(const LinearisedOperator& s, double a,
                            std::vector<Complex>* where = nullptr) const;

  void only_sign(bool yes) { only_sign_ = yes; }
  void allow_slack(double slack) { slack_ = slack; }
  bool doubtful() { return std::exchange(doubtful_, false); }

 private:
  double reach(const LinearisedOperator& s) const;         // frequency up to which modes count
  double count_height(const LinearisedOperator& s) const;  // of the box in which they are counted
  double line_behind(const LinearisedOperator& s, const Mode& m) const;
  bool add(const LinearisedOperator& s, Mode&& mode, std::vector<FollowedMode>& all) const;
  bool add_near(const LinearisedOperator& s, std::vector<Complex> where, double line,
                std::vector<FollowedMode>& all) const;
  bool add_missing(const LinearisedOperator& s, long count, std::vector<Complex> where, double line,
                   std::vector<FollowedMode>& all) const;
  std::optional<long> count_firmly(const LinearisedOperator& s, double a, std::vector<Complex>& where) const;
  double frequency_by_halving(const LinearisedOperator& s, double line) const;
  void keep_rightmost(const LinearisedOperator& s, std::vector<FollowedMode> all);

  MPI_Comm comm_;
  bool refine_;
  std::vector<FollowedMode> modes_;
  std::size_t leader_ = 0;
  // how far behind another mode, in parts of the frequency, one may be taken for the leading one
  double slack_ = 1e-7;
  bool only_sign_ = false, doubtful_ = false;
};

// As far right of a mode as it and the count may be wrong.
double count_margin(const LinearisedOperator& s, double frequency, double part = 1e-7);
// Growth rates closer than this are equal to round-off.
double same_growth(const LinearisedOperator& s);

}  // namespace stickslip
