// The tracer of zero lines on functions whose lines are known.

#include <cmath>
#include <limits>

#include "catch.hpp"
#include "stickslip/numerics/level_curve.hpp"

using namespace stickslip;

namespace {

LevelCurve traced(const PlaneFunction& f, int cells = 12) { return level_curve(f, sampled(f, cells), {}); }

bool on_border(PlanePoint p) { return p.x == 0 || p.x == 1 || p.y == 0 || p.y == 1; }

// Largest |f| over even places put on the line, over the length of the step that found it.
double largest(const PlaneFunction& f, const CurvePiece& piece, int count = 40) {
  double most = 0;
  const auto places = even_places({piece}, count)[0];
  for (const CurvePlace& place : places) {
    double slope = std::numeric_limits<double>::quiet_NaN();
    const Placed on = put_on_curve(f, place.at, place.across, slope);
    REQUIRE(on.found);
    most = std::max(most, std::abs(f(on.at.x, on.at.y)));
  }
  return most;
}

}  // namespace

TEST_CASE("closed lines: a circle, and one smaller than a cell", "[level_curve]") {
  for (const double radius : {0.35, 0.01}) {
    const PlaneFunction f = [&](double x, double y) { return std::hypot(x - 0.52, y - 0.47) - radius; };
    const LevelCurve curve = traced(f);
    REQUIRE(curve.pieces.size() == 1);
    const CurvePiece& circle = curve.pieces[0];
    CHECK(curve.lost.empty());
    CHECK(circle.closed);
    CHECK(circle.stuck.empty());
    CHECK(distance(circle.points.front(), circle.points.back()) == 0);
    CHECK(length(circle) == Approx(2 * M_PI * radius).epsilon(0.02));
    CHECK(largest(f, circle) < 1e-9);
  }
}

TEST_CASE("several branches, two of them close together", "[level_curve]") {
  // y = 0.51 and 0.53
  const PlaneFunction near = [](double, double y) { return (y - 0.52) * (y - 0.52) - 1e-4; };
  const LevelCurve two = traced(near, 25);
  REQUIRE(two.pieces.size() == 2);
  for (const CurvePiece& piece : two.pieces) {
    CHECK_FALSE(piece.closed);
    CHECK(on_border(piece.points.front()));
    CHECK(on_border(piece.points.back()));
    CHECK(length(piece) == Approx(1));
    CHECK(largest(near, piece) < 1e-9);
  }
  // hyperbola: two branches that do not meet
  const PlaneFunction hyperbola = [](double x, double y) { return (x - 0.5) * (y - 0.5) - 0.003; };
  const LevelCurve arms = traced(hyperbola);
  REQUIRE(arms.pieces.size() == 2);
  for (const CurvePiece& piece : arms.pieces) CHECK(largest(hyperbola, piece) < 1e-9);
}

TEST_CASE("corners are turned, not cut: a diamond", "[level_curve]") {
  const PlaneFunction f = [](double x, double y) {
    return 0.3 - std::max(std::abs(x - 0.5), 2 * std::abs(y - 0.5));
  };
  const LevelCurve curve = traced(f);
  REQUIRE(curve.pieces.size() == 1);
  CHECK(curve.pieces[0].closed);
  CHECK(length(curve.pieces[0]) == Approx(1.8).epsilon(0.005));
  double right = 0, top = 0;
  for (const PlanePoint& p : curve.pieces[0].points) {
    right = std::max(right, p.x);
    top = std::max(top, p.y);
  }
  CHECK(right == Approx(0.8).margin(1e-5));
  CHECK(top == Approx(0.65).margin(1e-5));
}

TEST_CASE("logarithmic axes are the caller's: a power law is a straight line", "[level_curve]") {
  // v = k^(-1/4) with k and v from 0.01 to 100
  const auto value = [](double c) { return std::pow(10., 4 * c - 2); };
  const PlaneFunction f = [&](double x, double y) { return value(y) * std::pow(value(x), 0.25) - 1; };
  const LevelCurve curve = traced(f);
  REQUIRE(curve.pieces.size() == 1);
  const CurvePiece& line = curve.pieces[0];
  CHECK(on_border(line.points.front()));
  CHECK(on_border(line.points.back()));
  CHECK(length(line) == Approx(std::hypot(1, 0.25)).epsilon(1e-6));
  const auto places = even_places({line}, 9)[0];
  for (std::size_t k = 0; k < places.size(); ++k) {
    double slope = std::numeric_limits<double>::quiet_NaN();
    const Placed on = put_on_curve(f, places[k].at, places[k].across, slope);
    CHECK(on.found);
    CHECK(std::abs(on.at.y - (0.5 - (on.at.x - 0.5) / 4)) < 1e-9);
    CHECK(std::abs(on.at.x - (places[0].at.x < 0.5 ? double(k) / 8 : 1 - double(k) / 8)) < 1e-3);
    CHECK(places[k].border == (k == 0 || k == 8));
  }
}

TEST_CASE("a fold in one coordinate, and a line that ends where f has no value", "[level_curve]") {
  const PlaneFunction fold = [](double x, double y) { return y - 0.8 + 3 * (x - 0.5) * (x - 0.5); };
  const LevelCurve parabola = traced(fold);
  REQUIRE(parabola.pieces.size() == 1);
  CHECK(largest(fold, parabola.pieces[0]) < 1e-9);
  double top = 0;
  for (const PlanePoint& p : parabola.pieces[0].points) top = std::max(top, p.y);
  CHECK(top == Approx(0.8).margin(3e-4));  // of steps of 1/60 one lies within 1/120 of the fold

  const PlaneFunction half = [](double x, double y) {
    return x > 0.63 ? std::numeric_limits<double>::quiet_NaN() : y - 0.3;
  };
  const LevelCurve curve = traced(half);
  REQUIRE(curve.pieces.size() == 1);
  REQUIRE(curve.pieces[0].stuck.size() == 1);
  CHECK(curve.pieces[0].stuck[0].x == Approx(0.63).margin(1e-4));
}

TEST_CASE("a function that learns: sure values are asked at places to start from", "[level_curve]") {
  // f is wrong by 0.05 until it has been asked surely once, as a growth rate is before a mode is found
  double wrong = 0.05;
  const PlaneFunction f = [&](double x, double y) { return y - 0.4 - 0.1 * x - wrong; };
  LevelCurveSettings settings;
  settings.sure = [&](double x, double y) {
    wrong = 0;
    return f(x, y);
  };
  const LevelCurve curve = level_curve(f, sampled(f, 12), settings);
  REQUIRE(curve.pieces.size() == 1);
  for (const PlanePoint& p : curve.pieces[0].points) CHECK(std::abs(p.y - 0.4 - 0.1 * p.x) < 1e-5);
}

namespace {

// A straight line upwards from the middle of the lower border, with points up to the height `top`.
class Straight : public PlaneLine {
 public:
  Straight(double top, bool vanishing) : top_(top), vanishing_(vanishing) {}
  Way begin(bool forwards) override {
    at_ = {0.5, 0};
    return {forwards ? Way::inwards : Way::outwards, forwards ? M_PI / 2 : -M_PI / 2};
  }
  std::optional<NextPoint> ahead(double radius, double heading) override {
    next_ = {0.5, std::min(1., at_.y + radius)};
    if (next_.y > top_) return std::nullopt;
    return NextPoint{next_, heading, next_.y == 1};
  }
  void accept() override { at_ = next_; }
  bool vanishes() const override { return vanishing_ && at_.y > top_ - 1e-2; }

 private:
  PlanePoint at_{}, next_{};
  double top_;
  bool vanishing_;
};

}  // namespace

TEST_CASE("a line whose points are solved for: it arrives, is stuck, or vanishes", "[level_curve]") {
  for (const double top : {2., 0.7}) {
    Straight line(top, false);
    const CurvePiece piece = follow_both_ways(line, {0.5, 0}, {0.1, 0.01});
    CHECK(piece.points.front().y == 0);
    CHECK(piece.points.back().y == Approx(std::min(1., top)).margin(4e-5));  // steps shorten to 1e-5
    CHECK(piece.stuck.size() == (top < 1 ? 1 : 0));
    CHECK(!piece.closed);
  }
  Straight line(0.7, true);
  std::vector<PlanePoint> points;
  CHECK(follow(line, {0.5, 0}, line.begin(true), {0.1, 0.01}, points) == LineEnd::vanishes);
  CHECK(follow(line, {0.5, 0}, line.begin(true), {0.1, 0.01, 3}, points) == LineEnd::steps);
  CHECK(points.size() == 4);
}

TEST_CASE("even places: the points of several pieces by their lengths", "[level_curve]") {
  std::vector<CurvePiece> lines(3);
  lines[0].points = {{0, 0.2}, {0.3, 0.2}, {0.9, 0.2}};
  lines[1].points = {{0.5, 0.5}, {0.5, 0.8}};
  lines[2].points = {{0.1, 0.1}};
  const auto places = even_places(lines, 12);
  REQUIRE(places.size() == 3);
  CHECK(places[0].size() == 9);
  CHECK(places[1].size() == 3);
  CHECK(places[2].empty());
  for (std::size_t k = 0; k < 9; ++k) {
    const CurvePlace& place = places[0][k];
    CHECK(place.at.x == Approx(0.1125 * double(k)));
    CHECK(place.along == Approx(place.at.x));
    CHECK(place.segment == (place.at.x <= 0.3 ? 0 : 1));
  }
}
