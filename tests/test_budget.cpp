// What a search may do at most: base/pulse.hpp, and the search for ends of stick-slip.
#include "base/pulse.hpp"
#include "catch.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/study/stick_slip_end.hpp"

using namespace stickslip;

TEST_CASE("work is counted by every budget about it", "[budget][serial]") {
  work(1e300);  // by none
  const Budget outer(100);
  work(60);
  {
    const Budget inner(50);
    work(30);
    CHECK_THROWS_AS(work(15), Spent);  // 105 of the outer one
    CHECK_THROWS_AS(work(10), Spent);
  }
  CHECK_THROWS_AS(work(1), Spent);  // and stays spent
  const Budget next(1e9);
  CHECK_THROWS_AS(work(1), Spent);
}

TEST_CASE("a search for ends of stick-slip ends where its work is done", "[budget][serial]") {
  struct Friction {
    const char *law, *state;
    double viscosity;
  };
  for (const Friction& f : {Friction{"carlson-langer", "none", 0.1}, Friction{"lugre", "bristles", 0},
                            Friction{"rate-and-state", "ageing", 0}}) {
    CAPTURE(f.law);
    Scene pair;
    pair.form = Form::chain;
    pair.order = 2;
    pair.n = 2;
    pair.length = 2;
    pair.left = pair.right = End::free;
    pair.friction.law = Law(f.law);
    pair.friction.state = StateLaw(f.state);
    pair.spread = 0.1;
    pair.nu = f.viscosity;
    const SceneAt at = [pair](double v, double) {
      Scene there = pair;
      there.v = v;
      return there;
    };
    std::vector<double> start{0.3, 0, 0.2, 0.1};
    if (pair.friction.has_state()) start = {0.3, 0, 0.1, 0.2, 0.1, 0.1};
    const CellMotion cell{at, [start](double, double) { return start; }};
    const auto search = StickSlipEnd::of(at, {Axis{"v", 0.2, 1.2}}, cell);
    search->allow(1e4);
    std::vector<std::string> notes;
    CHECK(search->points(notes).empty());
    REQUIRE(!notes.empty());
    CHECK(notes.back().find("budget of 1e+04 evaluations") != std::string::npos);
    CHECK(search->unfinished() == notes.back());
  }
}
