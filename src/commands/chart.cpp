// The command `chart`: error against seconds, or where each method fails.
#include "commands/table.hpp"
#include "stickslip/study/chart.hpp"
#include "stickslip/study/limits.hpp"

namespace stickslip {

namespace {

int chart(const Options& options) {
  return options.text("chart_kind") == "limits" ? chart_limits(options) : chart_errors(options);
}

}  // namespace

Command chart_command() {
  return {"chart", "the same scene by many methods: error against seconds, or where each method fails", chart,
          true, chart_tables};
}

}  // namespace stickslip
