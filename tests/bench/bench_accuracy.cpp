// What `-accuracy` costs, measured as `chart` measures its rows: processor time in a process in which everything has
// been done before, the median of several.
//
//     build/tests/bench_accuracy run SCENE.yaml -accuracy 1e-4 [options of run]
//
// Prints as JSON the seconds of choosing and estimating (with runs that were not good enough), those of the run chosen,
// from setting its method up to its end, and its attempts. tests/accuracy.py calls it.
#include <slepcsys.h>

#include <algorithm>
#include <cstdio>
#include <vector>

#include "stickslip/study/accuracy.hpp"
#include "stickslip/options/command_line.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"

using namespace stickslip;

namespace {

struct Price {
  double choosing, run;
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
      if (!options.is_set(name)) SS_TRY(PetscOptionsClearValue(nullptr, ("-" + name).c_str()));
    if (!run.failed.empty()) throw Failure(run.failed);
    if (plan.estimate({run.end, run.measured}) <= wanted) return {plan.seconds() + before, run.seconds, attempt};
    if (attempt == 5) throw Failure("not reached");
    plan.refine();
    before += run.seconds;
  }
}

void measure(int argc, char** argv) {
  const CommandLine line = read_command_line(argc, argv, {"run"}, MPI_COMM_WORLD);
  const Options options = Options::from("run", line.given);
  insert_library_options(options);
  std::vector<Price> prices;
  double spent = 0;
  while (prices.size() < 5 || (prices.size() < 25 && spent < 0.05)) {
    prices.push_back(price(options, options.real("accuracy")));
    spent += prices.back().choosing + prices.back().run;
    if (spent > 20) break;
  }
  const auto median = [&](double Price::*of) {
    std::sort(prices.begin(), prices.end(), [&](const Price& a, const Price& b) { return a.*of < b.*of; });
    return prices[prices.size() / 2].*of;
  };
  std::printf("{\"choosing\": %.4g, \"run\": %.4g, \"attempts\": %d}\n", median(&Price::choosing), median(&Price::run),
              prices[0].attempts);
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
