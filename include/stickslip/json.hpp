// A small JSON value and its text. Objects keep the order of their keys; reals are written with the fewest digits
// that give the same double back (and always look like reals: 60.0); what is not finite becomes null; text that is
// not UTF-8 has its bad bytes replaced by U+FFFD.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace stickslip {

class Json {
 public:
  Json() = default;  // null
  Json(std::nullptr_t) {}
  Json(bool value) : value_(value) {}
  Json(double value) : value_(value) {}
  Json(const char* text) : value_(std::string(text)) {}
  Json(std::string text) : value_(std::move(text)) {}
  template <class Integer, std::enable_if_t<std::is_integral_v<Integer> && !std::is_same_v<Integer, bool>, int> = 0>
  Json(Integer value) : value_(static_cast<std::int64_t>(value)) {}
  template <class T>
  Json(const std::optional<T>& value) {
    if (value) *this = Json(*value);
  }
  template <class T>
  Json(const std::vector<T>& values) : value_(Items{}) {
    for (const T& value : values) push(Json(value));
  }
  template <class T>
  Json(const std::map<std::string, T>& values) : value_(Members{}) {
    for (const auto& [key, value] : values) set(key, Json(value));
  }

  static Json array() { return Json(Items{}, 0); }
  static Json object() { return Json(Members{}, 0); }
  // An object from its members in order: Json::object({{"x", 1.0}, {"psi", 0.2}}).
  static Json object(std::vector<std::pair<std::string, Json>> members) { return Json(std::move(members), 0); }

  bool is_null() const { return std::holds_alternative<std::monostate>(value_); }

  Json& push(Json item);                          // to an array (null becomes one)
  Json& set(const std::string& key, Json value);  // of an object (null becomes one); an old value is replaced
  const Json* find(const std::string& key) const; // nullptr where the object has no such key

  // indent 0: all in one line. Otherwise one member a line, arrays of plain values in one line.
  std::string text(int indent = 2) const;

 private:
  using Items = std::vector<Json>;
  using Members = std::vector<std::pair<std::string, Json>>;
  template <class Value>
  Json(Value value, int) : value_(std::move(value)) {}
  bool plain() const;
  void append_to(std::string& out, int indent, int level) const;

  std::variant<std::monostate, bool, std::int64_t, double, std::string, Items, Members> value_;
};

// The object of texts that Json(std::map<std::string, std::string>) wrote, read back. Throws std::runtime_error
// where the text is something else.
std::map<std::string, std::string> parse_text_map(const std::string& json);

}  // namespace stickslip
