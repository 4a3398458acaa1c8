#include "stickslip/numerics/roots.hpp"

namespace stickslip {

using Complex = std::complex<double>;

// By hand: as eigenvalues of the companion matrix (Eigen) small roots beside large ones lose a digit where it
// is balanced, and three where not.
std::vector<Complex> polynomial_roots(const std::vector<double>& c) {
  if (c.size() == 3) {  // without cancellation
    const double b = c[1] / c[0], d = c[2] / c[0], disc = b * b / 4 - d;
    if (disc < 0) return {Complex(-b / 2, std::sqrt(-disc)), Complex(-b / 2, -std::sqrt(-disc))};
    const double large = -b / 2 - std::copysign(std::sqrt(disc), b);
    return {large, large == 0 ? 0 : d / large};
  }
  // A cubic: Newton's iteration from beyond its outermost turning point, on the side where the real root is;
  // then the quadratic that is left, deflated from the side that loses no digits.
  double root = -c[1] / (3 * c[0]);
  const auto value = [&](double x) { return ((c[0] * x + c[1]) * x + c[2]) * x + c[3]; };
  const auto slope = [&](double x) { return (3 * c[0] * x + 2 * c[1]) * x + c[2]; };
  const double at = value(root) / c[0], side = at >= 0 ? 1 : -1;
  double distance = std::cbrt(std::abs(at));
  if (-slope(root) / c[0] > 0) distance = 1.324718 * std::max(distance, std::sqrt(-slope(root) / c[0]));
  if (c[3] == 0) {
    root = 0;
  } else if (distance > 0) {
    double x = root - side * distance, last;
    do {
      last = x;
      if (slope(last) == 0) break;
      x = last - value(last) / slope(last) / (1 + 1e-15);
    } while (side * x > side * last);
    root = last;
  }
  double linear = c[1] + c[0] * root, constant = c[2] + linear * root;
  if (root != 0 && std::abs(c[0]) * root * root > std::abs(c[3] / root)) {
    constant = -c[3] / root;
    linear = (constant - c[2]) / root;
  }
  std::vector<Complex> roots = polynomial_roots({c[0], linear, constant});
  roots.push_back(root);
  return roots;
}

}  // namespace stickslip
