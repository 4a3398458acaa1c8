#include "stickslip/limits.hpp"

#include "stickslip/error.hpp"

namespace stickslip {

int chart_limits(const Options&) {
  throw UsageError("chart_kind limits: not part of this version; use error");
}

}  // namespace stickslip
