// F = (1 + b ln(1 + theta/theta0)) phi, theta_t = 1 - |psi| theta/D. s = ln(theta).
#pragma once

#include "model/states/ageing.hpp"

namespace stickslip {

struct ContactAge : Ageing {
  static constexpr const char* name = "contact-age";
  static constexpr bool is_factor = true;
  double b = 0.1, theta0 = 1;
  static std::vector<Declared<ContactAge>> parameters() {
    using R = Parameter::Range;
    return {{&ContactAge::D, slip_distance},
            {&ContactAge::b,
             {"b", "0.1", R::not_negative, "", "contact-age: growth of friction with ln(1 + theta/theta0)"}},
            {&ContactAge::theta0,
             {"theta0", "1", R::positive, "time", "contact-age: age at which growth begins"}}};
  }

  template <class Real>
  WithSlopeOf<Real> factor(Real s) const {
    using elementary::exp, elementary::log1p;
    const Real r = exp(s) / theta0;
    return {1 + b * log1p(r), b * r / (1 + r)};
  }
  double factor_at_long_rest() const { return std::numeric_limits<double>::infinity(); }
  double at_rest(double s, double t) const { return std::log(std::exp(s) + t); }
  double time_at_rest(double s) const { return theta0 + std::exp(s); }
};

}  // namespace stickslip
