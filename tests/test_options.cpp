// The option table, the checks of values, and the scene built from them.

#include <slepceps.h>
#include <petscts.h>

#include <set>

#include "asked_options.hpp"
#include "base/failure.hpp"
#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/options/options.hpp"

using namespace stickslip;

namespace {

Options given(const std::vector<Given>& list, const std::string& command = "run") {
  return Options::from(command, list);
}

// Pairs name, text, as from the command line.
Options set(std::initializer_list<std::pair<const char*, const char*>> pairs) {
  std::vector<Given> list;
  for (const auto& [name, text] : pairs) list.push_back({name, std::string(text), ""});
  return given(list);
}

Scene scene(std::initializer_list<std::pair<const char*, const char*>> pairs) {
  return Scene::from(set(pairs));
}

#define REFUSED(expression, part) CHECK_THROWS_WITH(expression, Contains(part))

}  // namespace

TEST_CASE("every default in the option table passes its own check") {
  std::set<std::string> seen;
  for (const OptionSpec& spec : option_table()) {
    INFO(spec.name);
    CHECK(seen.insert(lower_case(spec.name)).second);
    CHECK_FALSE(spec.help.empty());
    CHECK_FALSE(spec.group.empty());
    CHECK(spec.default_text.empty() != spec.default_help.empty());
    if (!spec.default_text.empty()) CHECK_NOTHROW(check_value(spec, spec.default_text, ""));
    const std::string text = Options().text(spec.name);
    if (!text.empty()) CHECK_NOTHROW(check_value(spec, text, ""));
    // what both read is of the steps
    if (is_library_option(lower_case(spec.name))) CHECK(lower_case(spec.name).rfind("ts_", 0) == 0);
  }
}

TEST_CASE("integers are exact or refused") {
  CHECK(set({{"grid_n", "1000"}}).integer("grid_n") == 1000);
  CHECK(set({{"grid_n", "1e6"}}).integer("grid_n") == 1000000);
  CHECK(set({{"grid_n", "+12"}}).integer("grid_n") == 12);
  // beyond PETSc's integers of 64 bits, too
  REFUSED(set({{"grid_n", "10000000000000000"}}), "-grid_n 10000000000000000: must be an integer from 1 to");
  REFUSED(set({{"grid_n", "18446744073709551617"}}), "18446744073709551617");
  REFUSED(set({{"grid_n", "99999999999999999999999999999999999"}}), "must be an integer");
  REFUSED(set({{"grid_n", "1e16"}}), "-grid_n 1e16");
  for (const char* bad :
       {"0", "-3", "12.5", "1e-3", "abc", "", "12abc", "0x10", " 12", "1 2", "nan", "inf", "1,2"})
    REFUSED(set({{"grid_n", bad}}), "-grid_n");
  CHECK_FALSE(set({{"grid_n", "1000"}, {"grid_n", "auto"}}).is_set("grid_n"));  // as -accuracy wants it
  CHECK(set({{"grid_n", "auto"}, {"grid_n", "1000"}}).integer("grid_n") == 1000);
  REFUSED(set({{"init_seed", "auto"}}), "-init_seed auto: must be an integer");
}

TEST_CASE("reals are finite, decimal and in range") {
  CHECK(set({{"model_gamma", "3.5e-1"}}).real("model_gamma") == 0.35);
  CHECK(set({{"bc_left", "velocity"}, {"bc_left_value", "-1.5"}}).real("bc_left_value") == -1.5);
  for (const char* bad : {"nan", "NaN", "inf", "-inf", "infinity", "1e999", "-1e999", "3,5", "3..5", "three",
                          "", "0x1p3", "1d-3", "--3", "+-3", "3 "})
    REFUSED(set({{"model_v", bad}}), "-model_v");
  for (const char* bad : {"0", "-1", "nan"})
    REFUSED(set({{"model_gamma", bad}}), "must be a finite number > 0");
  REFUSED(set({{"model_c", "-1e-30"}}), ">= 0");
  CHECK(set({{"model_v", "1e-400"}}).real("model_v") == 0);
}

TEST_CASE("words, booleans, lists, times") {
  REFUSED(set({{"friction_law", "cubix"}}), "did you mean cubic?");
  REFUSED(set({{"model_form", "Chain"}}), "did you mean chain?");
  REFUSED(set({{"model_zeta", "papr"}}), "did you mean paper?");
  for (const char* yes : {"true", "YES", "on", "1"})
    CHECK(set({{"out_displacement", yes}}).boolean("out_displacement"));
  for (const char* no : {"False", "no", "off", "0"})
    CHECK_FALSE(set({{"out_displacement", no}}).boolean("out_displacement"));
  CHECK(given({{"out_displacement", std::nullopt, ""}}).boolean("out_displacement"));
  REFUSED(set({{"out_displacement", "2"}}), "true or false");
  REFUSED(given({{"grid_n", std::nullopt, "s.yaml:4"}}), "-grid_n (s.yaml:4): needs a value");
  CHECK(set({{"out_times", "1, 2.5,3"}}).reals("out_times") == std::vector<double>{1, 2.5, 3});
  CHECK(Options().reals("out_times").empty());
  for (const char* bad : {"1,,2", ",", "1,nan", "1;2", "1,-2"})
    REFUSED(set({{"out_times", bad}}), "-out_times");
  CHECK(set({{"out_checkpoint_every", "500"}}).steps_or_seconds("out_checkpoint_every").steps == 500);
  CHECK(set({{"out_checkpoint_every", "10m"}}).steps_or_seconds("out_checkpoint_every").seconds == 600);
  for (const char* bad : {"0", "-5", "1.5", "10x", "s", "0s", "nans"})
    REFUSED(set({{"out_checkpoint_every", bad}}), "-out_checkpoint_every");
}

TEST_CASE("unknown names get the nearest one") {
  REFUSED(set({{"model_gama", "3"}}), "unknown option -model_gama; did you mean -model_gamma?");
  REFUSED(set({{"gamma", "3"}}), "did you mean -model_gamma?");
  REFUSED(set({{"ts_max_tim", "3"}}), "did you mean -ts_max_time?");
  REFUSED(given({{"grid_n=5", std::nullopt, ""}}), "write the value as a word of its own: -grid_n 5");
  REFUSED(set({{"xyzzy", "3"}}), "unknown option -xyzzy");
  REFUSED(set({{"tss_rtol", "3"}}), "did you mean -ts_rtol?");
  REFUSED(set({{"ts_monitor_something_new", "3"}}), "unknown option -ts_monitor_something_new");
  REFUSED(set({{"sub_pc_tpye", "lu"}}), "did you mean -sub_pc_type?");
  CHECK_NOTHROW(set({{"st_ksp_rtol", "1e-8"}, {"mat_mumps_icntl_14", "50"}, {"mg_levels_1_ksp_type", "cg"}}));
  CHECK(set({{"MODEL_GAMMA", "4"}}).real("model_gamma") == 4);  // names are case-blind
  CHECK(set({{"friction_law", "rate-and-state"}, {"friction_d", "2"}}).real("friction_D") == 2);
}

TEST_CASE("well-known library options are checked by name") {
  REFUSED(set({{"ts_max_time", "soon"}}), "-ts_max_time soon: must be a finite number >= 0");
  REFUSED(set({{"ts_rtol", "tight"}}), "-ts_rtol tight");
  REFUSED(set({{"ts_dt", "nan"}}), "-ts_dt nan");
  REFUSED(set({{"ts_dt", "-0.1"}}), "-ts_dt -0.1");
  REFUSED(set({{"snes_max_it", "10000000000000000"}}), "-snes_max_it 10000000000000000");
  REFUSED(set({{"st_ksp_rtol", "x"}}), "-st_ksp_rtol x");
  REFUSED(set({{"eps_ncv", "0"}}), "-eps_ncv 0");
  REFUSED(set({{"ts_adapt_type", "basik"}}), "did you mean basic?");
  REFUSED(set({{"ts_rk_multirate", "true"}}), "-ts_rk_multirate: not here");
  CHECK(set({{"snes_max_it", "1e2"}}).text("snes_max_it") == "100");
  CHECK(set({{"ts_max_snes_failures", "-1"}}).library().at("ts_max_snes_failures") == "-1");
  REFUSED(check_library_types(set({{"st_ksp_type", "gmress"}})), "did you mean gmres?");
  CHECK_NOTHROW(check_library_types(set({{"eps_type", "krylovschur"}, {"pc_type", "lu"}})));
}

TEST_CASE("every option that an object of PETSc or SLEPc asks for is known") {
  const std::set<std::string> names = AskedOptions::names();
  CHECK(names.size() > 1500);
  for (const std::string& name : names) {
    INFO(name);
    if (name.find('_') != name.npos) CHECK(is_library_option(name));
  }
}

TEST_CASE("defaults that depend on other options") {
  const Options none;
  CHECK(none.text("bc_left_value") == "0.2");
  CHECK(none.with("model_v", 0.7).real("bc_right_value") == 0.7);
  CHECK(none.text("model_delta") == "0.2");
  CHECK(none.text("bc_right") == "periodic");
  CHECK(none.with("bc_left", "velocity").text("bc_right") == "free");
  CHECK(none.with("bc_right", "free").text("bc_left") == "free");
  CHECK(none.with("init_type", "layer").text("init_eta") == "steady");
  CHECK(none.text("init_eta") == "0.1");
  const Options chain = none.with("model_form", "chain").with("grid_n", "20");
  CHECK(chain.text("model_delta") == "0");
  CHECK(chain.text("grid_order") == "2");
  CHECK(chain.text("grid_length") == "20");
  CHECK(chain.with("bc_left", "free").text("grid_length") == "19");
  const Options rs = none.with("friction_law", "rate-and-state");
  CHECK(rs.text("state_law") == "ageing");
  CHECK(rs.with("friction_D", "3").real("state_D") == 3);
  CHECK(rs.with("state_D", "3").real("friction_D") == 3);
  CHECK(none.all().at("grid_n") == "512");
  CHECK(none.given().empty());
  CHECK_FALSE(none.with("grid_n", "9").with("grid_n", "").is_set("grid_n"));
}

TEST_CASE("numbers survive as text") {
  for (double value : {0.1, 1. / 3, 1e-300, 123456789.123456789, -2.5e17})
    CHECK(Options().with("model_v", value).real("model_v") == value);
  REFUSED(Options().with("model_v", std::nan("")), "-model_v nan");
}

TEST_CASE("a restart takes its settings from the checkpoint") {
  const std::map<std::string, std::string> stored = {{"model_gamma", "4"},
                                                     {"ts_rtol", "1e-8"},
                                                     {"ts_max_time", "10"},
                                                     {"out_frames", "20"},
                                                     {"out_file", "a.h5"}};
  const Options merged =
      set({{"restart", "a.chk"}, {"ts_max_time", "30"}, {"out_every", "2"}}).resumed_from(stored);
  CHECK(merged.real("model_gamma") == 4);
  CHECK(merged.text("ts_rtol") == "1e-8");
  CHECK(merged.real("ts_max_time") == 30);
  CHECK(merged.text("out_every") == "2");
  CHECK_FALSE(merged.is_set("out_frames"));
  CHECK(merged.text("out_file") == "a.h5");
  CHECK(merged.text("restart") == "a.chk");
  CHECK_NOTHROW(set({{"model_gamma", "4"}}).resumed_from(stored));
  REFUSED(set({{"model_gamma", "5"}}).resumed_from(stored), "-model_gamma 5: a restart takes");
  REFUSED(set({{"ts_dt", "0.5"}}).resumed_from(stored), "-ts_dt 0.5");
}

TEST_CASE("scenes: coefficients and what belongs together") {
  const Scene c = scene({{"model_gamma", "2"}, {"model_c", "3"}});
  CHECK(c.A() == 2);
  CHECK(c.K0() == 0.5);
  CHECK(c.K1() == 4.5);
  CHECK(c.s_delta() == 0.2);
  CHECK(c.h() == Approx(60. / 512));
  CHECK(scene({{"model_delta_sign", "printed"}}).s_delta() == -0.2);

  const Scene b =
      scene({{"model_form", "chain"}, {"model_zeta", "paper"}, {"model_m", "2"}, {"model_k1", "5"}});
  CHECK(b.zeta == Approx(1.));
  CHECK(b.delta == 0);
  CHECK(b.order == 2);
  CHECK(b.h() == 1);
  CHECK(scene({{"model_form", "chain"}, {"grid_n", "1"}}).n == 1);
  CHECK(scene({{"model_form", "chain"}, {"grid_n", "1"}, {"bc_left", "free"}}).n == 1);

  REFUSED(scene({{"model_form", "chain"}, {"model_delta", "0.2"}}),
          "-model_delta 0.2: a parameter of the continuum");
  REFUSED(scene({{"model_form", "chain"}, {"model_gamma", "3"}}), "-model_gamma 3");
  REFUSED(scene({{"model_zeta", "paper"}}), "-model_zeta paper: a parameter of the chain");
  REFUSED(scene({{"model_form", "chain"}, {"grid_length", "60"}}), "-grid_length 60");
  CHECK_NOTHROW(scene({{"model_form", "chain"}, {"grid_length", "512"}, {"grid_order", "2"}}));
  REFUSED(scene({{"model_form", "chain"}, {"grid_order", "4"}}), "-grid_order 4");
  REFUSED(scene({{"model_c", "1e200"}}), "K1");
}

TEST_CASE("scenes: ends and grids") {
  REFUSED(scene({{"bc_left", "periodic"}, {"bc_right", "free"}}),
          "periodic holds at both ends or at neither");
  const Scene held = scene({{"bc_left", "velocity"}, {"bc_left_value", "-1.5"}});
  CHECK(held.left == End::velocity);
  CHECK(held.right == End::free);
  CHECK(held.left_value == -1.5);
  CHECK(held.h() == Approx(60. / 511));
  REFUSED(scene({{"bc_left_value", "-1.5"}}), "needs -bc_left velocity");
  REFUSED(scene({{"grid_n", "5"}, {"grid_order", "8"}}), "order 8 needs at least 9 nodes");
  REFUSED(scene({{"grid_n", "1"}}), "order 4 needs at least 5");
  REFUSED(scene({{"grid_n", "2"}}), "order 4 needs at least 5");
  REFUSED(set({{"grid_length", "-60"}}), "must be a finite number > 0");
  REFUSED(set({{"grid_order", "3"}}), "must be one of 4, 2, 6, 8");
  REFUSED(scene({{"grid_order", "8"}, {"bc_right", "velocity"}}), "growing modes");
  CHECK_NOTHROW(scene({{"grid_order", "8"}, {"bc_right", "free"}}));
  REFUSED(scene({{"model_form", "chain"}, {"grid_n", "1"}, {"bc_left", "velocity"}}), "at least 2 blocks");
  REFUSED(
      scene({{"model_form", "chain"}, {"grid_n", "2"}, {"bc_left", "velocity"}, {"bc_right", "velocity"}}),
      "3");
  REFUSED(scene({{"grid_length", "1e-300"}}), "too short");
}

TEST_CASE("scenes: laws") {
  REFUSED(scene({{"friction_a", "0.02"}}), "a parameter of another law");
  REFUSED(scene({{"friction_eps", "0.02"}}), "no threshold");
  REFUSED(scene({{"friction_law", "coulomb"}, {"friction_eps", "0.02"}}), "-friction_stick regularised");
  REFUSED(scene({{"friction_law", "coulomb"}, {"friction_fd", "2"}}), "must not exceed");
  REFUSED(
      scene({{"friction_law", "coulomb"}, {"friction_stick", "regularised"}, {"friction_back_slip", "no"}}),
      "exact");
  CHECK(scene({{"friction_law", "coulomb"}, {"friction_stick", "regularised"}}).friction.regularised);
  CHECK_FALSE(scene({{"friction_law", "coulomb"}}).friction.regularised);
  CHECK_FALSE(scene({{"friction_stick", "regularised"}}).friction.regularised);
  REFUSED(scene({{"state_law", "healing"}}), "phi(0) = 0");
  CHECK_NOTHROW(scene({{"state_law", "contact-age"}}));
  REFUSED(scene({{"state_law", "ageing"}}), "belongs to rate-and-state");
  REFUSED(scene({{"friction_law", "rate-and-state"}, {"state_law", "none"}}), "needs ageing or slip");
  CHECK(scene({{"friction_law", "rate-and-state"}}).friction.state == StateLaw("ageing"));
  REFUSED(scene({{"friction_law", "rate-and-state"}, {"state_D", "2"}, {"friction_D", "1"}}),
          "one slip distance");
  REFUSED(scene({{"state_t_h", "2"}}), "another state law");
  REFUSED(scene({{"friction_spread", "1.5"}}), "at most 1");
  CHECK(scene({{"friction_spread", "1.5"}, {"friction_spread_kind", "lognormal"}}).spread == 1.5);
  REFUSED(scene({{"model_form", "chain"}, {"friction_spread_length", "2"}}), "one draw a block");
}
