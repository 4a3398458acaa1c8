// -accuracy: its short runs are those of PETSc's rk, and orders are foreseen as they come.

#include <cmath>

#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "study/ladder.hpp"

using namespace stickslip;

TEST_CASE("a pilot takes the steps of PETSc's rk", "[accuracy][serial]") {
  using Words = std::vector<std::pair<const char*, const char*>>;
  const std::vector<Words> scenes = {
      {{"init_type", "sine"},
       {"grid_length", "20"},
       {"grid_n", "60"},
       {"grid_order", "8"},
       {"ts_max_time", "2"}},
      {{"init_type", "pulses"}, {"init_pulses", "2"}, {"grid_n", "80"}, {"ts_max_time", "1"}},
      {{"bc_left", "free"}, {"friction_spread", "0.2"}, {"grid_n", "700"}, {"ts_max_time", "1"}},
      {{"bc_left", "velocity"},
       {"bc_left_value", "-1"},
       {"init_type", "layer"},
       {"grid_order", "6"},
       {"grid_n", "90"},
       {"ts_max_time", "1"}},
      {{"ts_max_time", "5"}},
      {{"model_form", "chain"},
       {"grid_n", "7"},
       {"friction_law", "rate-and-state"},
       {"ts_max_time", "0.5"},
       {"friction_spread", "0.1"}},
      {{"init_type", "sine"},
       {"grid_n", "40"},
       {"load_v", "0:0.3,0.4:0.3,0.4:-0.2,1.1:0.5"},
       {"load_sine_amplitude", "0.2"},
       {"load_sine_period", "0.7"},
       {"ts_max_time", "2"}},
      {{"model_form", "chain"},
       {"grid_n", "4"},
       {"bc_left", "free"},
       {"init_noise", "0.2"},
       {"load_v", "0.3:1,0.3:-1,7:0.4"},
       {"ts_max_time", "9"}},
  };
  for (const Words& words : scenes) {
    // every second one with steps held by the largest error
    const bool largest = (&words - scenes.data()) % 2 == 1;
    if (largest) SS_TRY(PetscOptionsSetValue(nullptr, "-ts_adapt_wnormtype", "infinity"));
    std::vector<Given> given;
    for (const auto& [name, text] : words) given.push_back({name, text, ""});
    for (const char* pair : {"rk:5dp", "rk:3bs", "rk:7vr"}) {
      const Options options = Options::from("run", given);
      const Scene scene = Scene::from(options);
      const Setting setting{MethodSpec::parse("test", pair), 1e-5, 0, scene.order, scene.n};
      const Pilot pilot(options, scene);
      const Trial ours = pilot.run(setting, 100);
      const double longest = pilot.longest_step(setting);
      CHECK((longest > 0) == (std::string(pair) == "rk:7vr" && words.size() > 1));
      if (longest > 0)
        SS_TRY(PetscOptionsSetValue(nullptr, "-ts_adapt_dt_max", number_text(longest).c_str()));
      const Trial petscs = run_trial(options, setting, "", 100);
      SS_TRY(PetscOptionsClearValue(nullptr, "-ts_adapt_dt_max"));
      INFO(words[0].first << " " << words[0].second << " " << pair);
      CHECK(ours.failed.empty());
      CHECK(petscs.failed.empty());
      CHECK(ours.steps == petscs.steps);
      CHECK(ours.rejections == petscs.rejections);
      CHECK(ours.rhs_evaluations == petscs.rhs_evaluations);
      CHECK(distance(ours.end, petscs.end) < 1e-13);
    }
    if (largest) SS_TRY(PetscOptionsClearValue(nullptr, "-ts_adapt_wnormtype"));
  }
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
