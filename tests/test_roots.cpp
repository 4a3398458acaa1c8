// The root finder: on every function the place is within the tolerance, and calls stay within the bound of
// its contract.

#include <cmath>
#include <functional>
#include <vector>

#include "catch.hpp"
#include "stickslip/numerics/roots.hpp"

using namespace stickslip;

namespace {

struct Case {
  std::function<double(double)> f;
  double a, b, root;
  int few;  // calls that suffice for 1e-12; 0: only the bound counts
};

const std::vector<Case>& cases() {
  static const std::vector<Case> list{
      {[](double x) { return x * x - 2; }, 0, 2, std::sqrt(2), 9},
      {[](double x) { return std::cos(x) - x; }, 0, 3, 0.7390851332151607, 9},
      {[](double x) { return std::exp(x) - 1e-3; }, -50, 50, std::log(1e-3), 25},
      {[](double x) { return std::pow(x - 1. / 3, 9); }, -4, 1, 1. / 3, 0},      // a zero of order 9
      {[](double x) { return x < 0.3 ? -1. : 1e-9; }, 0, 1, 0.3, 0},             // a jump
      {[](double x) { return std::atan(1e8 * (x - 0.7)); }, -1e4, 1e4, 0.7, 0},  // nearly one
      {[](double x) { return std::cbrt(x - 0.1); }, 0, 1, 0.1, 0},               // vertical slope
      {[](double x) { return 1e-300 * (x - 0.4); }, 0, 1, 0.4, 5},               // fa fb underflows
      {[](double x) { return 1e300 * (x - 0.4); }, 0, 1, 0.4, 5},
  };
  return list;
}

}  // namespace

TEST_CASE("a zero in a bracket, in either direction, within the calls that the contract allows", "[roots]") {
  for (std::size_t k = 0; k < cases().size(); ++k)
    for (const bool turned : {false, true})
      for (const double tolerance : {1e-3, 1e-12}) {
        const Case& c = cases()[k];
        const double a = turned ? c.b : c.a, b = turned ? c.a : c.b;
        int calls = 0;
        const double x =
            find_root([&](double at) { return ++calls, c.f(at); }, {a, c.f(a), b, c.f(b)}, tolerance);
        INFO("case " << k << ", tolerance " << tolerance << ", calls " << calls << ", x " << x);
        // what f itself cannot tell apart: the zero of order 9 underflows nowhere, 1e-16 is lost in its
        // argument
        CHECK(std::abs(x - c.root) <= tolerance + 4e-16);
        CHECK(calls <= 4 * std::log2(std::abs(b - a) / tolerance) + 4);
        if (c.few > 0) CHECK(calls <= c.few + 1);
      }
}

TEST_CASE("what is no bracket, and values that are not finite, give no number", "[roots]") {
  const auto line = [](double x) { return x - 0.5; };
  CHECK(std::isnan(find_root(line, {1, 0.5, 2, 1.5}, 1e-9)));
  CHECK(std::isnan(find_root(line, {0, std::nan(""), 2, 1.5}, 1e-9)));
  CHECK(std::isnan(find_root([](double) { return std::nan(""); }, {0, -1, 1, 1}, 1e-9)));
  CHECK(find_root(line, {0.5, 0, 2, 1.5}, 1e-9) == 0.5);
  CHECK(find_root(line, {0, -0.5, 0.5, 0}, 1e-9) == 0.5);
}

TEST_CASE("a zero near a place: by the secant, or by a bracket grown where that leads away", "[roots]") {
  const auto square = [](double x) { return x * x - 2; };
  int calls = 0;
  double slope = 0;
  const auto counted = [&](double x) { return ++calls, square(x); };
  CHECK(std::abs(root_near(counted, 1.41, square(1.41), 1e-3, 1e-7, 0.1, &slope) - std::sqrt(2)) < 1e-12);
  CHECK(calls <= 4);
  CHECK(slope == Approx(2 * std::sqrt(2)).epsilon(1e-3));
  // a corner beside the place sends secants far away
  const auto corner = [](double x) { return x < 1e-3 ? 1 + 1e-6 * x : 1 - 400 * (x - 1e-3); };
  CHECK(std::abs(root_near(corner, 0, corner(0), 1e-5, 1e-9, 0.1) - 3.5e-3) < 1e-9);
  CHECK(std::isnan(root_near([](double) { return 1.; }, 0, 1, 1e-5, 1e-9, 0.1)));
  CHECK(std::isnan(root_near([](double x) { return x * x + 1; }, 0, 1, 1e-5, 1e-9, 0.1)));
}

TEST_CASE("the last place where a condition holds", "[roots]") {
  CHECK(last_place([](double x) { return x < 0.3; }, 0, 1) == std::nextafter(0.3, 0));
  CHECK(last_place([](double x) { return x > 0.3; }, 1, 0, 1e-3) == Approx(0.3).margin(1e-3));
}

TEST_CASE("the least value", "[roots]") {
  const auto f = [](double x) { return (x - 0.2) * (x - 0.2) + 1; };
  const Least least = find_least(f, -1, 1, 1e-6, [](double) { return false; });
  CHECK(least.x == Approx(0.2).margin(1e-6));
  CHECK(least.value == Approx(1).epsilon(1e-11));
  CHECK(find_least(f, -1, 1, 1e-6, [](double y) { return y < 1.1; }).value < 1.1);
  // an interval of a few neighbouring numbers ends, too
  const double left = 0.7, right = std::nextafter(std::nextafter(std::nextafter(left, 1), 1), 1);
  const double x = find_least(f, left, right, 0, [](double) { return false; }).x;
  CHECK((left <= x && x <= right));
}
