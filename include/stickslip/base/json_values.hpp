// What makes values of type Json (json.hpp): the library in full, which takes a second to compile, and
// optional values, null where there is none.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>

#include "stickslip/base/json.hpp"

namespace nlohmann {

template <class T>
struct adl_serializer<std::optional<T>> {
  template <class Value>
  static void to_json(Value& json, const std::optional<T>& value) {
    if (value)
      json = *value;
    else
      json = nullptr;
  }
};

}  // namespace nlohmann
