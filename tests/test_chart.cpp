// The pure parts of chart: what the rows are, which are best, how good the reference is.

#include <algorithm>
#include <cmath>

#include "catch.hpp"
#include "stickslip/study/chart.hpp"
#include "study/ladder.hpp"
#include "stickslip/base/error.hpp"

using namespace stickslip;

namespace {

ChartRow row(double error, double seconds, const std::string& failed = "") {
  ChartRow r;
  if (failed.empty()) r.error = error;
  r.failed = failed;
  r.seconds = seconds;
  r.repeats = 1;
  return r;
}

}  // namespace

TEST_CASE("the front holds the rows that no other beats", "[chart][serial]") {
  const std::vector<ChartRow> rows = {row(1e-3, 1),   row(1e-2, 0.5),          row(1e-3, 2),   row(1e-5, 3),
                                      row(1e-2, 0.5), row(1e-9, 0, "blew up"), row(2e-2, 0.5), row(5e-6, 3)};
  CHECK(chart_front(rows) == std::vector<std::size_t>{1, 0, 7});
  CHECK(chart_front({}).empty());
  // against the definition, on many rows
  std::vector<ChartRow> many;
  for (int i = 0; i < 300; ++i) many.push_back(row(1 + (i * 37) % 101, 1 + (i * 53) % 89));
  const auto front = chart_front(many);
  const auto beats = [](const ChartRow& a, const ChartRow& b) {
    return *a.error <= *b.error && a.seconds <= b.seconds && (*a.error < *b.error || a.seconds < b.seconds);
  };
  for (std::size_t i = 0; i < many.size(); ++i) {
    const bool beaten =
        std::any_of(many.begin(), many.end(), [&](const ChartRow& r) { return beats(r, many[i]); });
    const bool twin = std::any_of(front.begin(), front.end(), [&](std::size_t j) {
      return many[j].seconds == many[i].seconds && *many[j].error == *many[i].error;
    });
    CHECK(twin == !beaten);
  }
}

// Of three grids, each twice as fine as the one before.
double error_of_finest(double before, double last, double p) {
  FallingErrors errors;
  errors.fineness = {1, 2, 4};
  errors.distances = {before, last};
  errors.best = p;
  return errors.predicted(4);
}

TEST_CASE("the error of the finest grid is what the rate promises, the order at most", "[chart][serial]") {
  // C(h) = exact + h^p on three grids: the finest one's error is known
  for (const int p : {2, 4, 8}) {
    const double h = 0.1, before = std::pow(4 * h, p) - std::pow(2 * h, p),
                 last = std::pow(2 * h, p) - std::pow(h, p);
    CHECK(error_of_finest(before, last, p) == Approx(std::pow(h, p)));
  }
  CHECK(error_of_finest(1, 1e-6, 4) == Approx(1e-6 / 15));  // a rate that is too good is not believed
  CHECK(error_of_finest(1, 0.8, 8) > 1.6);                  // no convergence: more than the difference itself
}

TEST_CASE("methods by name", "[chart][serial]") {
  const MethodSpec a = MethodSpec::parse("chart_methods", "arkimex:4:friction");
  CHECK(a.name() == "arkimex:4");
  CHECK(a.implicit == "friction");
  CHECK(a.can().splits);
  CHECK_FALSE(MethodSpec::parse("m", "rosw:ra34pw2").can().splits);
  CHECK(MethodSpec::parse("m", "rk").name() == "rk:5dp");
  CHECK(MethodSpec::parse("m", "cn").name() == "cn");
  CHECK_FALSE(MethodSpec::parse("m", "cn").can().has_estimate);
  CHECK_FALSE(MethodSpec::parse("m", "rk:4").can().has_estimate);
  CHECK(MethodSpec::parse("m", "fusedarkimex:3:friction").name() == "arkimex:3");  // how steps are taken
  CHECK(&offered_type("fusedrk") == &offered_type("rk"));
  for (const char* bad : {"", "rk:", "rk:5dp:wave", "cn:2", "rosw:rodas3:friction", "rosw:ra34pw2:wave",
                          "rosw:ra34pw2:friction",
                          "arkimex:4:all", "arkimex:bpr3", "irk", "nonsense", "rk:5dp:none:more", "bdf:9"}) {
    INFO(bad);
    CHECK_THROWS_AS(MethodSpec::parse("chart_methods", bad), UsageError);
  }
}

TEST_CASE("the settings of a chart come in the order of its lists", "[chart][serial]") {
  const Options options = Options()
                              .with("grid_n", "64")
                              .with("chart_methods", "rk:3bs,rk:4")
                              .with("chart_tolerances", "1e-2,1e-4")
                              .with("chart_orders", "2,8")
                              .with("chart_grids", "32,64");
  const auto settings = chart_settings(options);
  CHECK(settings.size() == 16);
  CHECK(settings[0].method.name() == "rk:3bs");
  CHECK(settings[0].order == 2);
  CHECK(settings[0].n == 32);
  CHECK(settings[1].tolerance == 1e-4);
  CHECK(settings[2].n == 64);
  CHECK(settings[4].order == 8);
  // without an estimate: steps that shrink with the tolerance like the method's order asks
  CHECK(settings[8].method.name() == "rk:4");
  CHECK(settings[8].step / settings[9].step == Approx(std::pow(100, 0.25)));
  CHECK(chart_settings(options.with("chart_steps", "0.1,0.2,0.3")).size() == 8 + 12);

  // defaults: the scene's own order where it is set, its grid and half of it where that nests
  CHECK(chart_settings(Options().with("grid_n", "64").with("grid_order", "4")).size() == 8u * 4 * 2);
  CHECK(chart_settings(Options().with("grid_n", "65")).size() == 8u * 4 * 3);
  const auto ends = chart_settings(Options().with("grid_n", "65").with("bc_left", "velocity"));
  CHECK(ends.front().n == 33);
  CHECK(std::none_of(ends.begin(), ends.end(), [](const Setting& s) { return s.order == 8; }));
  const auto chain = chart_settings(Options().with("model_form", "chain").with("grid_n", "64"));
  CHECK(chain.size() == 8u * 4);

  for (const auto& [name, text] : std::vector<std::pair<std::string, std::string>>{
           {"chart_orders", "3"}, {"chart_methods", "rk:9"}, {"chart_grids", "4"}})
    CHECK_THROWS_AS(chart_settings(options.with(name, text)), UsageError);
  const Options noise = options.with("init_noise", "0.1");
  CHECK(chart_settings(noise).size() == settings.size());  // drawn by length: the same on every grid
  CHECK_THROWS_AS(chart_settings(noise.with("init_noise_length", "0")), UsageError);
}
