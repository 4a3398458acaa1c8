// The cubic on [0, 1] with given values and slopes at both ends.
#pragma once

#include <cmath>

namespace stickslip {

// Slopes of a step from t to t + dt: dt times those in t.
struct HermiteCubic {
  double y0, m0, c2, c3;

  HermiteCubic(double y_0, double y_1, double m_0, double m_1)
      : y0(y_0), m0(m_0), c2(3 * (y_1 - y_0) - 2 * m_0 - m_1), c3(2 * (y_0 - y_1) + m_0 + m_1) {}
  double operator()(double s) const { return y0 + s * (m0 + s * (c2 + s * c3)); }
  double slope(double s) const { return m0 + s * (2 * c2 + s * 3 * c3); }

  // Calls take(s) where the slope is 0 inside.
  template <class Take>
  void extrema(const Take& take) const {
    const double a = 3 * c3, b = 2 * c2, root = b * b - 4 * a * m0;
    if (!(root >= 0)) return;
    const double q = -(b + std::copysign(std::sqrt(root), b)) / 2;
    for (const double s : {a != 0 ? q / a : -1., q != 0 ? m0 / q : -1.})
      if (s > 0 && s < 1) take(s);
  }
};

}  // namespace stickslip
