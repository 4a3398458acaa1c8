// A measured curve of friction, velocity against force, as a function: cubics between the points, with one
// continuous derivative, that rise and fall only where the points do (monotone piecewise cubic Hermite
// interpolation; F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, with the one-sided
// three-point slopes at the ends of C. Moler, Numerical Computing with MATLAB, SIAM 2004, section 3.6). So
// friction never becomes negative between points, nor falls where none of them does. Errors against a smooth
// function go like the cube of the distances of points, beside an extremum like their square.
//
// Below the first velocity of a direction its force holds; beyond the last one the force holds, or goes on
// straight with the last slope. The force at velocity 0 is the threshold; where it is 0, so is the jump.
// Without negative velocities the curve is odd.
//
// A piece is found without search: the upper bits of velocity + offset number buckets, of which none holds
// more than one point. A bucket has the cubics before and behind its point, about that point, so that all it
// takes is one line of memory and no branch. (Boost.Math's pchip searches by halving and throws beyond its
// ends.)
//
// Velocities and forces are those of the law: the force is over the friction amplitude. Local.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "model/law.hpp"
#include "numerics/elementary.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/friction.hpp"

namespace stickslip {

class FrictionCurve {
 public:
  // value + y (slope + y (bend + y twist)), y = speed - at; the first of each two for y < 0.
  struct Bucket {
    double at, value, slope[2], bend[2], twist[2];

    template <class Real>
    Real force(const Real& y, int side) const {
      return value + y * (slope[side] + y * (bend[side] + y * twist[side]));
    }
    template <class Real>
    Real force_slope(const Real& y, int side) const {
      return slope[side] + y * (2 * bend[side] + 3 * twist[side] * y);
    }
  };

  // What is wrong with `points` as a curve, and at which of them; "" where nothing is.
  static std::string fault(const Points& points, std::size_t& at);

  // Of points without a fault; friction that falls beyond the last one does so down to 0.
  FrictionCurve(const Points& points, bool straight_beyond);

  // The number of the bucket of motion at the speed `a` >= 0; direction < 0: backward.
  std::int64_t place(double a, double direction) const {
    const double last = last_, below = a < last ? a : last, x = below > 0 ? below : 0;
    const auto other = std::int64_t(elementary::if_negative(direction)) & backward_;
    return std::int64_t(elementary::bits_of(x + offset_) >> shift_) - base_ + other;
  }
  const Bucket& bucket(std::int64_t place) const { return buckets_[place]; }
  double least_speed() const { return least_; }  // given, beside 0: below 0 the cubic is good for so much
  SlopeBounds slope_bounds() const { return bounds_; }
  LawScales scales() const { return {last_, largest_ > 0 ? largest_ : 1, 1}; }

 private:
  // value + y (slope + y (bend + y twist)) from `from` to the next.
  struct CubicPiece {
    double from, value, slope, bend, twist;
  };
  std::vector<CubicPiece> pieces_of(const Points& points, bool straight_beyond);

  std::vector<Bucket> buckets_;  // of one direction, then of the other
  double offset_ = 0, last_ = 0, least_ = 0, largest_ = 0;
  int shift_ = 0;
  std::int64_t base_ = 0, backward_ = 0;  // backward_: 0 where both directions are alike
  SlopeBounds bounds_;
};

// A measured curve: phi from points of velocity and force, FrictionCurve above.
struct MeasuredCurve : LawDefaults {
  static constexpr const char* name = "table";
  static constexpr bool jumps_at_rest = true, may_not_jump = true, takes_points = true, looks_up = true;
  static constexpr int continuous_derivatives = 1;
  double beyond = 0;
  std::shared_ptr<const FrictionCurve> curve;
  static std::vector<Declared<MeasuredCurve>> parameters() {
    using R = Parameter::Range;
    return {{nullptr,
             {"table", "", R::curve, "velocity",
              "table: measured friction, velocity1:force1,velocity2:force2,... or a file of two columns; odd "
              "unless velocities < 0 are given; the force at rest is the threshold",
              "", "", false, "", FrictionCurve::fault}},
            {&MeasuredCurve::beyond,
             {"table_beyond", "constant", R::word, "",
              "table: beyond the last velocity the force stays, or goes on with the last slope", "", "",
              false, "constant slope"}}};
  }
  void take(const Points& points) {
    if (points.empty())
      throw UsageError(
          "friction_law table: -friction_table is missing, velocity1:force1,velocity2:force2,... or a file "
          "of "
          "two columns");
    curve = std::make_shared<const FrictionCurve>(points, beyond == 1);
  }
  static bool continuous_at_rest(const Points& points) {
    for (const auto& [velocity, force] : points)
      if (velocity >= 0) return velocity == 0 && force == 0;
    return false;
  }

  LawScales scales() const { return curve->scales(); }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    using elementary::value_of;
    const WithSlopeOf<Real> s = sign.sign_slope(psi), a = sign.magnitude(psi);
    const Real speed = forward<Sign>(a.value);
    const FrictionCurve::Bucket& c = curve->bucket(curve->place(value_of(speed), value_of(s.value)));
    const Real y = speed - c.at;
    const int side = value_of(y) >= 0;
    const Real value = c.force(y, side);
    return {s.value * value, s.slope * value + s.value * a.slope * c.force_slope(y, side)};
  }
  // phi in the steps of a loop over many nodes: looking up between vector code before and behind it.
  struct Place {
    double sign, speed;
    std::int64_t bucket;
  };
  template <class Sign>
  Place place(double psi, Sign sign) const {
    const double s = sign.sign_slope(psi).value, speed = forward<Sign>(sign.magnitude(psi).value);
    return {s, speed, curve->place(speed, s)};
  }
  double looked_up(double speed, std::int64_t bucket) const {
    const FrictionCurve::Bucket& c = curve->bucket(bucket);
    const double y = speed - c.at;
    return c.force(y, y >= 0);
  }
  SlopeBounds slope_bounds() const { return curve->slope_bounds(); }

 private:
  // Against the motion, the cubic for a while.
  template <class Sign, class Real>
  Real forward(const Real& speed) const {
    if constexpr (!std::is_same_v<Sign, SignFrozen>) return speed;
    const double least = -curve->least_speed();
    return elementary::where_less(speed, least, Real(least), speed);
  }
};

}  // namespace stickslip
