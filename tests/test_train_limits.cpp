// Where trains merge and where their stability changes, against trains and spectra computed anew.

#include <cmath>

#include "catch.hpp"
#include "stickslip/waves/train_limits.hpp"

using namespace stickslip;

namespace {

Scene cubic_scene(double v, double gamma) {
  Scene s;
  s.v = v;
  s.gamma = gamma;
  return s;
}

// One pulse on a ring of 25, in (model_v, model_gamma).
TrainFamily2 family() {
  return {"model_v", "model_gamma", [](double v, double gamma) {
            TrainCase asked{cubic_scene(v, gamma), {}};
            asked.request.length = 25;
            return asked;
          }};
}

Branch branch(double from, double to, int steps, double gamma) {
  return continue_train({"model_v", [=](double v) { return family().at(v, gamma); }}, from, to, steps);
}

double length_at(double v, double gamma, double speed) {
  TrainRequest request;
  request.speed = speed;
  return solve_train(cubic_scene(v, gamma), request).length;
}

double growth_at(const TrainLimit& limit, double ahead) {
  const TrainCase asked = family().at(limit.value + ahead, limit.value2);
  return train_spectrum(solve_train(asked.scene, asked.request), 4).growth_rate;
}

}  // namespace

TEST_CASE("a fold of trains: the length has a minimum over the speed there", "[wave][limits][serial]") {
  std::vector<std::string> notes;
  const Branch walk = branch(0.95, 0.956, 30, 3);
  INFO(walk.points.size() << " points: " << walk.end);
  const std::vector<TrainLimit> limits = train_limits(family(), walk, 3, false, notes);
  const auto fold =
      std::find_if(limits.begin(), limits.end(), [](const TrainLimit& l) { return l.kind == "fold"; });
  REQUIRE(fold != limits.end());
  for (const BranchPoint& p : walk.points) CHECK(p.value <= fold->value + 1e-12);
  const double h = 2e-6, V = fold->speed;
  const double below = length_at(fold->value, 3, V - h), here = length_at(fold->value, 3, V),
               above = length_at(fold->value, 3, V + h);
  CHECK(here == Approx(25).epsilon(1e-9));
  // dL/dV = 0 there; the difference is odd in h, smaller by h over the range of V of the canard, 1e-4 or so
  CHECK(std::abs(above - below) < 3e-2 * std::abs(above + below - 2 * here));
}

TEST_CASE("a change of stability of trains, on a branch and followed in a second parameter",
          "[wave][limits][serial]") {
  std::vector<std::string> notes;
  const std::vector<TrainLimitCurve> curves =
      train_limit_curves(family(), branch(0.85, 0.86, 6, 3), 0.85, 0.9, 3, 3.1, 2, notes);
  CHECK(notes.empty());
  REQUIRE(curves.size() == 1);
  CHECK(curves[0].points.size() == 3);
  for (const TrainLimit* limit : {&curves[0].points.front(), &curves[0].points.back()}) {
    INFO("v " << limit->value << " gamma " << limit->value2);
    CHECK(limit->kind == "hopf");
    CHECK(limit->leads.value_or(false));
    CHECK(limit->length == 25);
    CHECK(std::abs(growth_at(*limit, 0)) < 1e-8);
  }
  CHECK(growth_at(curves[0].points.front(), -1e-3) > 1e-5);
  CHECK(growth_at(curves[0].points.front(), 1e-3) < -1e-5);
}
