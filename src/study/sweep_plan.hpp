// The points of a sweep: which options take which values there. Not collective: the same on every rank.
//
// With a grid the results have one dimension for each option, the last running fastest, and with sweep_follow
// one more, `direction`: the first option is followed from its first value to its last (direction 1, in
// rising order of points) and back (-1). A list, a sample and a refined grid have the one dimension `point`.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "stickslip/numerics/sampling.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// One option, or several that take the same value, and the values.
class SweepAxis {
 public:
  // Of sweep_parameter1 (number 1) and those that go with it. Throws UsageError.
  SweepAxis(const Options& sweep, int number);

  const std::string& name() const { return names_.front(); }  // that of the dimension
  long values() const { return count_; }                      // sweep_points or those of sweep_values
  // Where there are so many equal intervals between both ends: the value at the end of number k.
  std::string between(long k, long intervals) const;
  // Value number k of all.
  std::string value(long k) const { return listed_.empty() ? between(k, count_ - 1) : listed_[k]; }
  // The value that a number from [0, 1) draws: evenly from the range (of an integer: each alike), or from the
  // list.
  std::string drawn(double part) const;
  bool is_listed() const { return !listed_.empty(); }
  bool is_numeric() const;  // are all of its values numbers?
  Options set(Options options, const std::string& value) const;

 private:
  std::string at_part(double part) const;  // of the range

  std::vector<std::string> names_, listed_;
  double from_ = 0, to_ = 0;
  bool log_ = false, integer_ = false;
  long count_ = 1;
};

class SweepPlan {
 public:
  // Throws UsageError where the sweep_* options do not say what to do, or a value is out of an option's
  // range. `base`: the options at every point but for those varied.
  SweepPlan(const Options& sweep, const Options& base);

  const std::vector<SweepAxis>& axes() const { return axes_; }
  bool is_grid() const { return kind_ == Kind::grid && !refined_; }
  bool follows() const { return follow_; }
  bool is_refined() const { return refined_; }
  // Lengths of the dimensions of a grid.
  std::vector<std::size_t> shape() const;
  long points() const;  // of a refined grid: those of the finest one
  // The values of the axes at a point, in their order.
  std::vector<std::string> values(long point) const;
  Options at(long point) const;

  // What one group of ranks computes, in this order: a point, or with sweep_follow all of a line.
  long units() const;
  std::vector<long> unit(long number) const;
  // The points of a refined grid, which come in several rounds.
  ChangeSearch search() const { return {cells_, halvings_}; }

 private:
  enum class Kind { grid, list, random, sobol };
  void read_axes(const Options& sweep);
  void read_refinement(const Options& sweep);
  void check_values() const;

  Options base_;
  std::vector<SweepAxis> axes_;
  Kind kind_ = Kind::grid;
  bool follow_ = false, refined_ = false;
  long count_ = 0;  // of a list or a sample
  PetscInt seed_ = 0;
  std::array<long, 2> cells_{};
  int halvings_ = 0;
};

}  // namespace stickslip
