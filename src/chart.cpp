#include "stickslip/chart.hpp"

#include "stickslip/error.hpp"

namespace stickslip {

int chart_errors(const Options&) {
  throw UsageError("chart_kind error: not part of this version");
}

}  // namespace stickslip
