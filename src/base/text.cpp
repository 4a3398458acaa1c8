#include "stickslip/base/text.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

namespace stickslip {

namespace {

int edit_distance(const std::string& a, const std::string& b) {
  // with exchange of neighbours as one step
  std::vector<std::vector<int>> d(a.size() + 1, std::vector<int>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = int(i + j);
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

}  // namespace

std::string number_text(double value) {
  char buffer[40];
  return std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
}

std::string rounded_text(double value, int digits) { return fmt::format("{:.{}g}", value, digits); }

std::string one_line(std::string text) {
  for (char& c : text)
    if ((unsigned char)c < 0x20 || c == 0x7f) c = ' ';
  return text;
}

std::string quoted(const std::string& text) {
  if (text.empty()) return "''";
  std::string result = text.substr(0, 80);
  while (result.size() < text.size() && !result.empty() && (result.back() & 0xC0) == 0x80) result.pop_back();
  for (char& c : result)
    if ((unsigned char)c < 0x20 || c == 0x7f) c = '?';
  return text.size() > 80 ? result + "..." : result;
}

std::string lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  return text;
}

std::string nearest_name(const std::string& name, const std::vector<std::string>& names) {
  const std::string wanted = lower_case(name.substr(0, 200));
  std::string best;
  int least = std::min(int(wanted.size()), std::max(1, std::min(4, int(wanted.size()) / 3)) + 1);
  for (const std::string& candidate : names) {
    const int d = edit_distance(wanted, lower_case(candidate));
    if (d < least) {
      least = d;
      best = candidate;
    }
  }
  if (!best.empty() || wanted.empty()) return best;
  for (const std::string& candidate : names) {  // the prefix left out: gamma for model_gamma
    const std::string low = lower_case(candidate), tail = "_" + wanted;
    if (low.size() > tail.size() && low.compare(low.size() - tail.size(), tail.size(), tail) == 0)
      return candidate;
  }
  for (const std::string& candidate : names)  // cut short: print for printed
    if (wanted.size() > 2 && lower_case(candidate).rfind(wanted, 0) == 0) return candidate;
  return "";
}

std::string suggestion(const std::string& name, const std::vector<std::string>& names, const char* before) {
  return did_you_mean(nearest_name(name, names), before);
}

std::string did_you_mean(const std::string& name, const char* before) {
  return name.empty() ? "" : "; did you mean " + (before + name) + "?";
}

std::string joined(const std::vector<std::string>& parts, const std::string& separator) {
  std::string text;
  for (const std::string& part : parts) text += (&part == &parts[0] ? "" : separator) + part;
  return text;
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(" \t") + 1 - begin);
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text)
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

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

std::string called(const std::string& option) {
  const auto found = noted.labels.find(option);
  return found == noted.labels.end() ? option : found->second;
}

}  // namespace stickslip
