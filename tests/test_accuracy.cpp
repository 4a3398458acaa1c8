// -accuracy: steps that waves bound, and orders are foreseen as they come.

#include <cmath>

#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "study/ladder.hpp"

using namespace stickslip;

TEST_CASE("waves bound the steps of rk:7vr alone", "[accuracy][serial]") {
  const auto longest = [](const std::vector<Given>& given, const char* pair) {
    const Options options = Options::from("run", given);
    const Scene scene = Scene::from(options);
    const Setting setting{MethodSpec::parse("test", pair), 1e-5, 0, scene.order, scene.n};
    return SceneAtStart(options, scene).longest_step(setting);
  };
  const std::vector<Given> ring = {
      {"init_type", "sine", ""}, {"grid_length", "20", ""}, {"grid_n", "60", ""}};
  // the shortest wave at order 4: frequency^2 = 1 + 16/3/dx^2 = 49
  CHECK(longest(ring, "rk:7vr") == Approx(4.4 / 7));
  CHECK(longest(ring, "rk:5dp") == 0);
  CHECK(longest({{"grid_n", "60", ""}}, "rk:7vr") == 0);  // all nodes alike: there is no wave
}

TEST_CASE("orders beyond the last grid", "[accuracy][serial]") {
  CHECK(expected_order(NAN, 3, 8) == 3);              // nothing known of a rise
  CHECK(expected_order(1, 3, 8) == Approx(5.4));      // rising: by 0.8 of itself, as fronts are resolved,
  CHECK(expected_order(4, 6, 8) == 7);                // or halfway to the scheme's,
  CHECK(expected_order(3.2, 3.8, 8) == Approx(4.7));  // and by no more than it has
  CHECK(expected_order(7.9, 8, 8) == 8);
  CHECK(expected_order(1, 20, 8) == 8);               // no scheme converges faster in the end
  CHECK(expected_order(0.9, 0.9, 8) == Approx(0.9));  // a jump
}
