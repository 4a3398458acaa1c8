#include "stickslip/base/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

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

}  // namespace stickslip
