// A measured curve: phi from points of velocity and force (model/friction_curve.hpp).
#pragma once

#include <memory>

#include "model/friction_curve.hpp"
#include "model/law.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

struct MeasuredCurve {
  static constexpr const char* name = "table";
  static constexpr bool jumps_at_rest = true;
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

  double threshold() const { return curve->threshold(); }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    using elementary::value_of, elementary::where_less;
    const WithSlopeOf<Real> s = sign.sign_slope(psi), a = sign.magnitude(psi);
    const FrictionCurve::Bucket& c = curve->bucket(value_of(a.value), value_of(s.value));
    Real y = a.value - c.at;
    if constexpr (std::is_same_v<Sign, SignFrozen>) {  // against the motion, the cubic for a while
      const double end = -curve->least_speed() - c.at;
      y = where_less(y, end, Real(end), y);
    }
    const Real z = where_less(y, 0, Real(0.), y);
    const double more_slope = where_less(value_of(y), 0, 0, c.more_slope);
    const Real value = c.value + y * (c.slope + y * (c.bend + y * c.twist)) +
                       z * (c.more_slope + z * (c.more_bend + z * c.more_twist));
    const Real slope = c.slope + y * (2 * c.bend + 3 * c.twist * y) + more_slope +
                       z * (2 * c.more_bend + 3 * c.more_twist * z);
    return {s.value * value, s.slope * value + s.value * a.slope * slope};
  }
  SlopeBounds slope_bounds() const { return curve->slope_bounds(); }
};

}  // namespace stickslip
