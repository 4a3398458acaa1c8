// The command `chart`: error against seconds, or where each method fails.
#include "stickslip/study/chart.hpp"
#include "stickslip/commands/commands.hpp"
#include "stickslip/study/limits.hpp"

namespace stickslip {

int chart_command(const Options& options) {
  return options.text("chart_kind") == "limits" ? chart_limits(options) : chart_errors(options);
}

}  // namespace stickslip
