#include "base/names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

#include "stickslip/base/text.hpp"

namespace stickslip {

namespace {

Names noted;

// Exponents of length, time and force.
using Dimension = std::array<int, 3>;

// Of quantities along the line: how many of their lengths are counted in blocks in a chain.
const std::map<std::string, int> lengths_along = {{"x", 1},      {"first", 1},          {"left", 1},
                                                  {"extent", 1}, {"wavenumber", -1},    {"wave_speed", 1},
                                                  {"speed", 1},  {"wavelength", 1},     {"front_speed", 1},
                                                  {"moment", 1}, {"largest_moment", 1}, {"grid_length", 1},
                                                  {"place", 1}};

std::optional<Dimension> parsed(const std::string& text) {
  static const std::map<std::string, Dimension> known = {{"1", {0, 0, 0}},
                                                         {"length", {1, 0, 0}},
                                                         {"time", {0, 1, 0}},
                                                         {"force", {0, 0, 1}},
                                                         {"velocity", {1, -1, 0}}};
  Dimension sum{};
  int sign = 1;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.size(), text.find_first_of("*/", at));
    const std::vector<std::string> factor = split(text.substr(at, end - at), '^');
    const auto base = known.find(factor[0]);
    if (base == known.end() || factor.size() > 2) return std::nullopt;
    const int power = sign * (factor.size() == 2 ? std::atoi(factor[1].c_str()) : 1);
    for (int k = 0; k < 3; ++k) sum[k] += power * base->second[k];
    if (end < text.size()) sign = text[end] == '/' ? -1 : 1;
    at = end + 1;
  }
  return sum;
}

std::string power_text(const std::string& unit, int power) {
  return power == 1 ? unit : unit + "^" + std::to_string(power);
}

}  // namespace

void note_names(Names names) { noted = std::move(names); }
const Names& names() { return noted; }

std::string unit_of(const std::string& dimension, const std::string& name) {
  const std::size_t other = dimension.find("; chain: ");
  std::optional<Dimension> found =
      parsed(other == std::string::npos ? dimension
             : noted.counts_blocks      ? dimension.substr(other + std::string("; chain: ").size())
                                        : dimension.substr(0, other));
  if (!found || dimension.empty()) return "";
  if (noted.counts_blocks) {
    const auto along = lengths_along.find(name.substr(name.rfind('/') + 1));
    if (along != lengths_along.end()) (*found)[0] -= along->second;
  }
  const std::array<std::string, 3> units{noted.length, noted.time, noted.force};
  std::string above, below;
  int factors_below = 0;
  for (const int k : {2, 0, 1}) {
    const int power = (*found)[k];
    if (power == 0) continue;
    if (units[k].empty()) return "";
    std::string& side = power > 0 ? above : below;
    side += (side.empty() ? "" : " ") + power_text(units[k], std::abs(power));
    factors_below += power < 0;
  }
  if (*found == Dimension{-1, 2, 1} && units == std::array<std::string, 3>{"m", "s", "N"}) return "kg";
  if (below.empty()) return above;
  return (above.empty() ? "1" : above) + "/" + (factors_below > 1 ? "(" + below + ")" : below);
}

std::string in_unit(const std::string& number, const std::string& dimension, const std::string& name) {
  const std::string unit = unit_of(dimension, name);
  return unit.empty() ? number : number + " " + unit;
}

std::string in_unit(double value, int digits, const std::string& dimension, const std::string& name) {
  return in_unit(rounded_text(value, digits), dimension, name);
}

std::string with_error(double value, double error) {
  if (!std::isfinite(value) || !std::isfinite(error) || !(error > 0)) return rounded_text(value, 6);
  const auto place = [](double x) { return int(std::floor(std::log10(x))); };
  const int last = place(error) - 1, first = std::max(place(std::max(std::abs(value), error)), last + 1);
  std::string digits = fmt::format("{:#.{}g}", value, std::min(first - last + 1, 15));
  if (digits.back() == '.') digits.pop_back();
  return digits + " +- " + fmt::format("{:.2g}", error);
}

// "text (99.2 Hz)" where there is a unit of time.
static std::string with_turns(const std::string& text, double turns, int digits) {
  if (noted.time.empty() || !std::isfinite(turns)) return text;
  return fmt::format("{} ({} {})", text, rounded_text(turns, std::min(digits, 4)),
                     noted.time == "s"    ? "Hz"
                     : noted.time == "ms" ? "kHz"
                                          : "1/" + noted.time);
}

std::string frequency_text(double value, int digits) {
  return with_turns(in_unit(value, digits, "1/time"), value / (2 * M_PI), digits);
}

std::string period_text(double value, int digits) {
  return with_turns(in_unit(value, digits, "time"), 1 / value, digits);
}

std::string amplitude_text(double value, double omega, int digits) {
  const std::string text = in_unit(value, digits, "velocity");
  if (noted.length.empty() || noted.time.empty() || !(omega > 0)) return text;
  return text + fmt::format(" (displacement {}, acceleration {})", in_unit(value / omega, digits, "length"),
                            in_unit(value * omega, digits, "velocity/time"));
}

std::string called(const std::string& option) {
  const auto found = noted.labels.find(option);
  return found == noted.labels.end() ? option : found->second;
}

}  // namespace stickslip
