#include "base/json.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/json_values.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

namespace {

std::string text_of(double value) {
  if (!std::isfinite(value)) return "null";
  const std::string digits = number_text(value);
  return digits.find_first_of(".e") == std::string::npos ? digits + ".0" : digits;
}

void append(std::string& out, const Json& value, int indent, int level) {
  const auto line = [&](int depth) {
    if (indent > 0) out += '\n' + std::string(indent * depth, ' ');
  };
  if (value.is_number_float()) {
    out += text_of(value.get<double>());
  } else if (!value.is_structured() || value.empty()) {
    out += value.dump(-1, ' ', false, Json::error_handler_t::replace);
  } else {
    const bool is_object = value.is_object();
    const bool one_line = !is_object && std::none_of(value.begin(), value.end(),
                                                     [](const Json& item) { return item.is_structured(); });
    const char* separator = one_line && indent > 0 ? ", " : ",";
    out += is_object ? '{' : '[';
    for (auto item = value.begin(); item != value.end(); ++item) {
      if (item != value.begin()) out += separator;
      if (!one_line) line(level + 1);
      if (is_object) {
        append(out, item.key(), indent, level);
        out += indent > 0 ? ": " : ":";
      }
      append(out, *item, indent, level + 1);
    }
    if (!one_line) line(level);
    out += is_object ? '}' : ']';
  }
}

}  // namespace

std::string json_text(const Json& value, int indent) {
  std::string out;
  append(out, value, indent, 0);
  return out;
}

std::string text_of_map(const std::map<std::string, std::string>& values) { return json_text(values, 0); }

std::map<std::string, std::string> parse_text_map(const std::string& json) {
  try {
    return Json::parse(json).get<std::map<std::string, std::string>>();
  } catch (const Json::exception&) {
    throw std::runtime_error("not a JSON object of texts");
  }
}

}  // namespace stickslip
