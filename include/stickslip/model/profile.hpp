// A quantity that is given at some places along x, and what holds between them.
//
//     linear   straight from one place to the next
//     smooth   from value to value like 10 s^3 - 15 s^4 + 6 s^5: two continuous derivatives, flat at every
//              place given
//     step     a value holds from its place to the next one
// Between two places no value lies beyond theirs. Two values at one place make a jump: the second holds from
// there on. Before the first place and behind the last their values hold; on a ring the last place goes on to
// the first.
//
// Nothing here communicates. x is a length; a value has the unit of the quantity.
#pragma once

#include <utility>
#include <vector>

namespace stickslip {

enum class Between { linear, smooth, step };

class ProfileAlongX {
 public:
  ProfileAlongX() = default;
  // Places ascend, each at most twice. `period`: of a ring, 0 where there is none.
  ProfileAlongX(std::vector<std::pair<double, double>> points, Between between, double period = 0);

  double at(double x) const;
  const std::vector<std::pair<double, double>>& points() const { return points_; }
  bool is_constant() const;
  // Where the value jumps, in the order of x; on a ring a jump from the last place to the first is one, too.
  std::vector<double> jumps() const;
  // The smallest and the largest value.
  std::pair<double, double> range() const;
  // The shortest distance over which the value changes from one place to another, a jump aside; infinite
  // where none does. What a grid has to resolve.
  double shortest() const;

 private:
  std::vector<std::pair<double, double>> points_;
  Between between_ = Between::linear;
  double period_ = 0, snap_ = 0;  // snap_: a place that x misses by so little is met
};

}  // namespace stickslip
