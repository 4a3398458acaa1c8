// The velocity of the driving plate as a function of time,
//     v(t) = w(t) + a sin(2 pi t/T),
// w piecewise straight through given points (t, v), constant before the first and behind the last; two points
// at one
// time make a jump. It takes the place of v in  eta_t = K0 (v - psi) + ...  and nowhere else.
//
// Between its corners, the times at which w bends or jumps, v(t) is smooth, so that a method keeps its order
// where a step ends at each of them. At a corner itself there are two values, one of the piece that ends and
// one of the piece that begins: who evaluates says which piece he is in.
//
// Nothing here communicates. Velocities, times.
#pragma once

#include <limits>
#include <utility>
#include <vector>

namespace stickslip {

class Load {
 public:
  Load() = default;
  // `points`: times ascend, each at most twice; empty: w = v.
  Load(double v, const std::vector<std::pair<double, double>>& points, double amplitude, double period);

  bool varies() const { return !pieces_.empty(); }
  // The piece that begins at t, or that t lies in.
  int piece_from(double t) const;
  double in_piece(int piece, double t) const;
  double operator()(double t) const { return in_piece(piece_from(t), t); }  // behind a corner, at one
  double integral(double t) const;     // of v from 0 to t: how far the plate has come
  double next_corner(double t) const;  // later than t; infinity where there is none
  double largest() const;              // |v(t)| never exceeds it
  double period() const { return amplitude_ != 0 ? period_ : 0; }  // of the sine; 0 without one
  // A length of time over which v(t) between two corners has no more than one extremum: half a period;
  // infinity without a sine.
  double smooth_time() const {
    return amplitude_ != 0 ? period_ / 2 : std::numeric_limits<double>::infinity();
  }

 private:
  // From `begin` on: w = v + slope (t - begin); `travel`: the integral of w until then.
  struct Interval {
    double begin, v, slope, travel;
  };
  std::vector<Interval> pieces_;
  double amplitude_ = 0, period_ = 1;
};

}  // namespace stickslip
