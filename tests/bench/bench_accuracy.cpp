// What `-accuracy` costs, measured as `chart` measures its rows: processor time in a process in which
// everything has been done before, the median of several.
//
//     build/tests/bench_accuracy run SCENE.yaml -accuracy 1e-4 [options of run] [--row METHOD TOLERANCE ORDER
//     NODES]
//
// Prints as JSON the seconds of choosing and estimating (with runs that were not good enough), those of the
// run chosen, from setting its method up to its end, and its attempts. With a row of a chart, which is run in
// turn with all this: its seconds, and the ratios to it of the run and of everything, medians over the turns,
// which load touches little. tests/accuracy.py calls it.
#include <slepcsys.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/study/accuracy.hpp"
#include "stickslip/options/command_line.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"

using namespace stickslip;

namespace {

struct Price {
  double choosing, run, row;
  int attempts;
};

Price price(const Options& options, double wanted) {
  AccuracyPlan plan(options, wanted);
  double before = 0;
  for (int attempt = 1;; ++attempt) {
    const Options chosen = plan.options();
    insert_library_options(chosen);
    const Trial run = run_trial(chosen, plan.setting(), "", 1e9, plan.measure());
    for (const auto& [name, text] : chosen.library())
      if (!options.is_set(name)) clear_library_option(name);
    if (!run.failed.empty()) throw Failure(run.failed);
    if (plan.estimate({run.end, run.measured}) <= wanted)
      return {plan.seconds() + before, run.seconds, NAN, attempt};
    if (attempt == 5) throw Failure("not reached");
    plan.refine();
    before += run.seconds;
  }
}

double median(const std::vector<Price>& prices, const std::function<double(const Price&)>& of) {
  std::vector<double> values;
  for (const Price& p : prices) values.push_back(of(p));
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Takes `--row` and its four words off the end of the command line.
std::optional<Setting> row_of(int& argc, char** argv) {
  if (argc < 6 || std::string(argv[argc - 5]) != "--row") return std::nullopt;
  argc -= 5;
  return Setting{MethodSpec::parse("--row", argv[argc + 1]), std::atof(argv[argc + 2]), 0,
                 std::atoi(argv[argc + 3]), PetscInt(std::atoll(argv[argc + 4]))};
}

void measure(int argc, char** argv) {
  const std::optional<Setting> row = row_of(argc, argv);
  const CommandLine line = read_command_line(argc, argv, {"run"}, MPI_COMM_WORLD);
  const Options options = Options::from("run", line.given);
  insert_library_options(options);
  std::vector<Price> prices;
  double spent = 0;
  while (prices.size() < 5 || (prices.size() < 25 && spent < 0.05)) {
    prices.push_back(price(options, options.real("accuracy")));
    spent += prices.back().choosing + prices.back().run;
    if (row) prices.back().row = run_trial(options, *row, "", 1e9).seconds;
    if (spent > 20) break;
  }
  const auto print = [&](const char* name, const std::function<double(const Price&)>& of) {
    std::printf("\"%s\": %.4g, ", name, median(prices, of));
  };
  std::printf("{");
  print("choosing", [](const Price& p) { return p.choosing; });
  print("run", [](const Price& p) { return p.run; });
  if (row) {
    print("row", [](const Price& p) { return p.row; });
    print("run_over_row", [](const Price& p) { return p.run / p.row; });
    print("all_over_row", [](const Price& p) { return (p.choosing + p.run) / p.row; });
  }
  std::printf("\"attempts\": %d}\n", prices[0].attempts);
}

}  // namespace

int main(int argc, char** argv) {
  if (SlepcInitialize(nullptr, nullptr, nullptr, nullptr)) return 1;
  int code = 0;
  try {
    measure(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_accuracy: %s\n", e.what());
    code = 1;
  }
  return SlepcFinalize() ? 1 : code;
}
