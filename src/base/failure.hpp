// Failure and UsageError with a text by fmt's format: throw failure("no root at t = {}", t).
#pragma once

#include <fmt/format.h>

#include "stickslip/base/error.hpp"

namespace stickslip {

template <class... Args>
Failure failure(fmt::format_string<Args...> text, Args&&... args) {
  return Failure(fmt::format(text, std::forward<Args>(args)...));
}
template <class... Args>
UsageError usage_error(fmt::format_string<Args...> text, Args&&... args) {
  return UsageError(fmt::format(text, std::forward<Args>(args)...));
}

}  // namespace stickslip
