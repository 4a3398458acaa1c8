#include "stickslip/json.hpp"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <stdexcept>

namespace stickslip {

namespace {

void append_real(std::string& out, double value) {
  if (!std::isfinite(value)) {
    out += "null";
    return;
  }
  char buffer[40];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  const std::string digits(buffer, end);
  out += digits;
  if (digits.find_first_of(".e") == std::string::npos) out += ".0";
}

// Length of the UTF-8 sequence that starts at `at`, 0 where there is none (overlong forms and surrogates included).
std::size_t sequence_length(const std::string& s, std::size_t at) {
  const auto byte = [&](std::size_t k) { return at + k < s.size() ? static_cast<unsigned char>(s[at + k]) : 0u; };
  const auto tail = [&](std::size_t k) { return (byte(k) & 0xC0u) == 0x80u; };
  const unsigned lead = byte(0);
  if (lead < 0x80) return 1;
  if (lead >= 0xC2 && lead <= 0xDF) return tail(1) ? 2 : 0;
  if (lead >= 0xE0 && lead <= 0xEF) {
    if (!tail(1) || !tail(2)) return 0;
    if (lead == 0xE0 && byte(1) < 0xA0) return 0;
    if (lead == 0xED && byte(1) > 0x9F) return 0;
    return 3;
  }
  if (lead >= 0xF0 && lead <= 0xF4) {
    if (!tail(1) || !tail(2) || !tail(3)) return 0;
    if (lead == 0xF0 && byte(1) < 0x90) return 0;
    if (lead == 0xF4 && byte(1) > 0x8F) return 0;
    return 4;
  }
  return 0;
}

void append_quoted(std::string& out, const std::string& s) {
  out += '"';
  for (std::size_t at = 0; at < s.size();) {
    const char c = s[at];
    const std::size_t length = sequence_length(s, at);
    if (length == 0) {
      out += "\xEF\xBF\xBD";
      ++at;
      continue;
    }
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (c == '\n') {
      out += "\\n";
    } else if (c == '\t') {
      out += "\\t";
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      char code[8];
      std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      out += code;
    } else {
      out.append(s, at, length);
    }
    at += length;
  }
  out += '"';
}

}  // namespace

Json& Json::push(Json item) {
  if (is_null()) value_ = Items{};
  std::get<Items>(value_).push_back(std::move(item));
  return *this;
}

Json& Json::set(const std::string& key, Json value) {
  if (is_null()) value_ = Members{};
  auto& members = std::get<Members>(value_);
  for (auto& [name, old] : members)
    if (name == key) {
      old = std::move(value);
      return *this;
    }
  members.emplace_back(key, std::move(value));
  return *this;
}

const Json* Json::find(const std::string& key) const {
  if (const auto* members = std::get_if<Members>(&value_))
    for (const auto& [name, value] : *members)
      if (name == key) return &value;
  return nullptr;
}

bool Json::plain() const { return !std::holds_alternative<Items>(value_) && !std::holds_alternative<Members>(value_); }

void Json::append_to(std::string& out, int indent, int level) const {
  const auto line = [&](int depth) {
    if (indent == 0) return;
    out += '\n';
    out.append(static_cast<std::size_t>(indent) * static_cast<std::size_t>(depth), ' ');
  };
  if (const auto* truth = std::get_if<bool>(&value_)) {
    out += *truth ? "true" : "false";
  } else if (const auto* integer = std::get_if<std::int64_t>(&value_)) {
    out += std::to_string(*integer);
  } else if (const auto* real = std::get_if<double>(&value_)) {
    append_real(out, *real);
  } else if (const auto* string = std::get_if<std::string>(&value_)) {
    append_quoted(out, *string);
  } else if (const auto* items = std::get_if<Items>(&value_)) {
    bool one_line = true;
    for (const Json& item : *items) one_line = one_line && item.plain();
    out += '[';
    for (std::size_t k = 0; k < items->size(); ++k) {
      if (k > 0) out += (one_line && indent > 0) ? ", " : ",";
      if (!one_line) line(level + 1);
      (*items)[k].append_to(out, indent, level + 1);
    }
    if (!one_line) line(level);
    out += ']';
  } else if (const auto* members = std::get_if<Members>(&value_)) {
    out += '{';
    for (std::size_t k = 0; k < members->size(); ++k) {
      if (k > 0) out += ',';
      line(level + 1);
      append_quoted(out, (*members)[k].first);
      out += indent > 0 ? ": " : ":";
      (*members)[k].second.append_to(out, indent, level + 1);
    }
    if (!members->empty()) line(level);
    out += '}';
  } else {
    out += "null";
  }
}

std::string Json::text(int indent) const {
  std::string out;
  append_to(out, indent, 0);
  return out;
}

std::map<std::string, std::string> parse_text_map(const std::string& json) {
  std::size_t at = 0;
  const auto skip = [&] {
    while (at < json.size() && (json[at] == ' ' || json[at] == '\n' || json[at] == '\t' || json[at] == '\r')) ++at;
  };
  const auto expect = [&](char c) {
    skip();
    if (at >= json.size() || json[at] != c) throw std::runtime_error("not a JSON object of texts");
    ++at;
  };
  const auto next_is = [&](char c) {
    skip();
    return at < json.size() && json[at] == c;
  };
  const auto string = [&] {
    expect('"');
    std::string out;
    while (at < json.size() && json[at] != '"') {
      char c = json[at++];
      if (c == '\\') {
        if (at >= json.size()) break;
        c = json[at++];
        if (c == 'n') c = '\n';
        else if (c == 't') c = '\t';
        else if (c == 'u') {
          // the writer escapes control characters only, which are below 0x80
          unsigned code = 0;
          const char* first = json.data() + at;
          if (at + 4 > json.size() || std::from_chars(first, first + 4, code, 16).ptr != first + 4 || code > 0x7f)
            throw std::runtime_error("unexpected escape in a JSON text");
          at += 4;
          c = static_cast<char>(code);
        } else if (c != '"' && c != '\\' && c != '/') {
          throw std::runtime_error("unexpected escape in a JSON text");
        }
      }
      out += c;
    }
    expect('"');
    return out;
  };

  std::map<std::string, std::string> values;
  expect('{');
  if (!next_is('}')) {
    for (;;) {
      std::string key = string();
      expect(':');
      values[std::move(key)] = string();
      if (!next_is(',')) break;
      ++at;
    }
  }
  expect('}');
  skip();
  if (at != json.size()) throw std::runtime_error("text after a JSON object");
  return values;
}

}  // namespace stickslip
