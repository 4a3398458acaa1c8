// What makes values of type Json (json.hpp): the library in full, which takes a second to compile, optional
// values, null where there is none, and complex ones, {re, im}.
#pragma once

#include <complex>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/json.hpp"

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

template <>
struct adl_serializer<std::complex<double>> {
  template <class Value>
  static void to_json(Value& json, const std::complex<double>& z) {
    json = Value::object({{"re", z.real()}, {"im", z.imag()}});
  }
};

}  // namespace nlohmann
