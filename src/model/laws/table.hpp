// A measured curve: phi from points of velocity and force (model/friction_curve.hpp).
#pragma once

#include <memory>

#include "model/friction_curve.hpp"
#include "model/law.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

struct MeasuredCurve : LawDefaults {
  static constexpr const char* name = "table";
  static constexpr bool jumps_at_rest = true, takes_points = true, looks_up = true;
  static constexpr int continuous_derivatives = 1;
  double beyond = 0;
  std::shared_ptr<const FrictionCurve> curve;
  static std::vector<Declared<MeasuredCurve>> parameters() {
    using R = Parameter::Range;
    return {{nullptr,
             {"table", "", R::curve, "velocity",
              "table: measured friction, velocity1:force1,velocity2:force2,... or a file of two columns; odd "
              "unless velocities < 0 are given; the force at rest is the threshold"}},
            {&MeasuredCurve::beyond,
             {"table_beyond", "constant", R::word, "",
              "table: beyond the last velocity the force stays, or goes on with the last slope", "", "",
              false, "constant slope"}}};
  }
  void take(const FrictionCurve::Points& points) {
    if (points.empty())
      throw UsageError(
          "friction_law table: -friction_table is missing, velocity1:force1,velocity2:force2,... or a file "
          "of "
          "two columns");
    curve = std::make_shared<const FrictionCurve>(points, beyond == 1);
  }
  static bool continuous_at_rest(const FrictionCurve::Points& points) {
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
