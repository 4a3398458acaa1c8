#include "output/repeats.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "stickslip/base/text.hpp"

namespace stickslip {

void set_period(Summary& summary, double period, double error) {
  constexpr double round_off = 1e-15;
  const double all = std::max(error, round_off * std::abs(period));
  const double digits = std::floor(std::log10(std::abs(period))) - std::floor(std::log10(all)) + 4;
  const auto rounded = [](double value, double to) {
    return std::stod(rounded_text(value, int(std::clamp(to, 1., 17.))));
  };
  summary.set("period", rounded(period, digits));
  summary.set("period_error", rounded(all, 2));
}

}  // namespace stickslip
