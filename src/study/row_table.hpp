// A table of results of which each column is described once, and goes from there into the summary and into the file.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "stickslip/base/json_values.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/result_file.hpp"

namespace stickslip {

// monostate and an empty text: nothing there, null in the summary, NaN or "" in the file.
using Cell = std::variant<std::monostate, bool, std::int64_t, double, std::string>;

inline Cell cell_of(const std::optional<double>& value) { return value ? Cell(*value) : Cell(); }

template <class Row>
struct Column {
  std::string key;    // in the summary
  Field field;        // in the file; without a name it is not there
  std::function<Cell(const Row&)> cell;
  bool is_text = false;
};

template <class Row>
Json json_of(const std::vector<Column<Row>>& columns, const Row& row) {
  Json object = Json::object();
  for (const Column<Row>& column : columns)
    object[column.key] = std::visit([](const auto& value) -> Json {
      using Value = std::decay_t<decltype(value)>;
      if constexpr (std::is_same_v<Value, std::monostate>) return Json();
      else if constexpr (std::is_same_v<Value, std::string>) return value.empty() ? Json() : Json(value);
      else return Json(value);
    }, column.cell(row));
  return object;
}

template <class Row>
void add_columns(ResultFile& file, const std::vector<Column<Row>>& columns, const std::vector<Row>& rows) {
  for (const Column<Row>& column : columns) {
    if (column.field.name.empty()) continue;
    std::vector<std::string> texts;
    std::vector<double> numbers;
    for (const Row& row : rows)
      std::visit([&](const auto& value) {
        using Value = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, std::string>) texts.push_back(value);
        else if constexpr (std::is_same_v<Value, std::monostate>) numbers.push_back(NAN);
        else numbers.push_back(double(value));
      }, column.cell(row));
    if (column.is_text) file.add_text(column.field, {"row"}, texts);
    else file.add(column.field, {"row"}, numbers);
  }
}

}  // namespace stickslip
