// The velocity of the driving plate as a function of time,
//     v(t) = w(t) + sum of a sin(2 pi t/T + phase),
// w piecewise straight through given points (t, v), constant before the first and behind the last; two points
// at one time make a jump. It takes the place of v in  eta_t = K0 (v - psi) + ...  and nowhere else.
//
// A harmonic force p sin(2 pi t/T) on every node is such a sine too (Scene::push).
//
// The normal load N(t), by which friction is multiplied, is such a function too (Scene::normal).
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

struct Sine {
  double amplitude, period, phase = 0;
  double at(double t) const;
};

class Load {
 public:
  Load() = default;
  // `points`: times ascend, each at most twice; empty: w = v.
  Load(double v, const std::vector<std::pair<double, double>>& points, const std::vector<Sine>& sines = {});

  bool varies() const { return !pieces_.empty(); }
  // The piece that begins at t, or that t lies in.
  int piece_from(double t) const;
  double in_piece(int piece, double t) const;
  double operator()(double t) const { return in_piece(piece_from(t), t); }  // behind a corner, at one
  double before(double t) const;                                            // a corner, at one
  double slope_in_piece(int piece, double t) const;                         // dv/dt
  double slope(double t) const { return varies() ? slope_in_piece(piece_from(t), t) : 0; }
  double integral(double t) const;     // of v from 0 to t: how far the plate has come
  double next_corner(double t) const;  // later than t; infinity where there is none
  double largest() const;              // |v(t)| never exceeds it
  double smallest() const;             // v(t) never falls below it
  Load scaled(double factor) const;    // with the amplitudes of its sines multiplied; it varies as before
  // Of the sines together, those of amplitude 0 too, as common_period() has it.
  double period() const { return period_; }
  // A length of time over which v(t) between two corners has no more than one extremum: of one sine half a
  // period; infinity without one.
  double smooth_time() const { return smooth_time_; }

 private:
  // From `begin` on: w = v + slope (t - begin); `travel`: the integral of w until then.
  struct Interval {
    double begin, v, slope, travel;
  };
  std::vector<Interval> pieces_;
  std::vector<Sine> sines_;  // none of amplitude 0
  double period_ = 0, smooth_time_ = std::numeric_limits<double>::infinity();
};

// The shortest time that is a multiple of both periods, of the first at most a hundred times; infinity where
// there is none. A period of 0 is none at all.
double common_period(double a, double b);

}  // namespace stickslip
