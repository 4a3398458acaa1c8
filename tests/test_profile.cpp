// Profiles along x and loads: what holds between the places given, at them, round a ring; integrals and
// corners.

#include <cmath>
#include <random>

#include "catch.hpp"
#include "stickslip/model/load.hpp"
#include "stickslip/model/medium.hpp"

using namespace stickslip;

TEST_CASE("a profile between its places", "[profile]") {
  const std::vector<std::pair<double, double>> points = {{1, 2}, {3, 6}, {3, 1}, {5, 0}};
  const ProfileAlongX linear(points, Between::linear), smooth(points, Between::smooth),
      step(points, Between::step);
  CHECK(linear.at(0) == 2);
  CHECK(linear.at(2) == Approx(4));
  CHECK(linear.at(3) == 1);                       // the second value at a place holds from there on
  CHECK(linear.at(std::nextafter(3., 0.)) == 1);  // a node that rounding puts before a jump
  CHECK(linear.at(3 - 1e-9) == Approx(6));
  CHECK(linear.at(9) == 0);
  CHECK(step.at(2.9) == 2);
  CHECK(step.at(4.9) == 1);
  CHECK(smooth.at(2) == Approx(4));
  CHECK(smooth.at(1.5) == Approx(2 + 4 * std::pow(0.25, 3) * (10 - 15 * 0.25 + 6 * 0.25 * 0.25)));
  CHECK(linear.shortest() == 2);
  CHECK(ProfileAlongX({{1, 2}}, Between::linear).shortest() == std::numeric_limits<double>::infinity());
}

TEST_CASE("a profile on a ring goes on at its beginning", "[profile]") {
  const ProfileAlongX p({{2, 1}, {6, 5}}, Between::linear, 10);
  CHECK(p.at(6) == Approx(5));
  CHECK(p.at(9) == Approx(3));
  CHECK(p.at(0) == Approx(5 - 4 * 4. / 6));
  CHECK(p.at(2) == Approx(1));
  const ProfileAlongX steps({{2, 1}, {6, 5}}, Between::step, 10);
  CHECK(steps.at(1) == 5);
  CHECK(steps.at(5) == 1);
}

TEST_CASE("where a profile jumps, and between which values it stays", "[profile]") {
  const std::vector<std::pair<double, double>> points = {{1, 2}, {3, 6}, {3, 1}, {5, 1}, {7, 4}};
  CHECK(ProfileAlongX(points, Between::linear).jumps() == std::vector<double>{3});
  CHECK(ProfileAlongX(points, Between::step).jumps() == std::vector<double>{3, 3, 7});
  CHECK(ProfileAlongX(points, Between::step, 10).jumps() == std::vector<double>{1, 3, 3, 7});
  CHECK(ProfileAlongX(points, Between::smooth).range() == std::pair(1., 6.));
  CHECK(ProfileAlongX({{1, 2}}, Between::step, 10).jumps().empty());
}

TEST_CASE("a load, its corners and how far the plate comes", "[load]") {
  CHECK_FALSE(Load(0.3, {}, {{0, 1}}).varies());
  std::mt19937 random(7);
  std::uniform_real_distribution<double> draw(-1, 1);
  for (int scene = 0; scene < 20; ++scene) {
    std::vector<std::pair<double, double>> points;
    double t = 0.5 + 0.4 * draw(random);
    for (int i = 0; i < 5; ++i) {
      points.emplace_back(t, draw(random));
      if (draw(random) > 0.3) points.emplace_back(t, draw(random));  // a jump
      t += 0.2 + std::abs(draw(random));
    }
    const double amplitude = scene % 2 == 0 ? 0 : draw(random), period = 0.7 + 0.3 * draw(random);
    const double second = scene % 3 == 0 ? 0 : draw(random), phase = 2 * draw(random);
    const Load load(9, points, {{amplitude, period}, {second, 1.5 * period, phase}});
    REQUIRE(load.varies());
    const auto exact = [&](double at) {  // behind a jump
      double w = points.front().second;
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (points[i].first > at) break;
        w = points[i].second;
        if (i + 1 < points.size() && points[i + 1].first > at)
          w += (points[i + 1].second - w) * (at - points[i].first) / (points[i + 1].first - points[i].first);
      }
      return w + amplitude * std::sin(2 * M_PI * at / period) +
             second * std::sin(2 * M_PI * at / (1.5 * period) + phase);
    };
    double integral = 0, largest = 0, least = 1e300;
    const double end = points.back().first + 1;
    for (double from = 0; from < end;) {  // Simpson's rule on short pieces that end at corners
      const double to = std::min({from + 0.002, load.next_corner(from), end}), middle = (from + to) / 2;
      const int piece = load.piece_from(from);
      CHECK(load(middle) == Approx(exact(middle)).margin(1e-13));
      CHECK(load.slope_in_piece(piece, middle) ==
            Approx((load.in_piece(piece, middle + 1e-5) - load.in_piece(piece, middle - 1e-5)) / 2e-5)
                .margin(1e-7));
      least = std::min(least, load(middle));
      integral +=
          (to - from) / 6 * (load.in_piece(piece, from) + 4 * load(middle) + load.in_piece(piece, to));
      largest = std::max(largest, std::abs(load(middle)));
      from = to;
      CHECK(load.integral(to) == Approx(integral).margin(1e-10));
    }
    CHECK(load.largest() >= largest);
    CHECK(load.smallest() <= least);
    CHECK(load.period() == Approx(3 * period));
    for (const auto& point : points) CHECK(load.next_corner(point.first) > point.first);
  }
}
