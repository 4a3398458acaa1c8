// The command `chart`: error against seconds, or where each method fails.
#include "stickslip/chart.hpp"
#include "stickslip/commands.hpp"
#include "stickslip/limits.hpp"

namespace stickslip {

int chart_command(const Options& options) {
  return options.text("chart_kind") == "limits" ? chart_limits(options) : chart_errors(options);
}

}  // namespace stickslip
