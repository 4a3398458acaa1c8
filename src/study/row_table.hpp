// A table of results of which each column is described once, and goes from there into the summary and into
// the file.
#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "stickslip/base/json_values.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/result_file.hpp"

namespace stickslip {

template <class Row>
struct Column {
  std::string key;                       // in the summary
  Field field;                           // in the file; without a name it is not there
  std::function<Json(const Row&)> cell;  // null or an empty text: null in the summary, NaN or "" in the file
  bool is_text = false;
};

template <class Row>
Json json_of(const std::vector<Column<Row>>& columns, const Row& row) {
  Json object = Json::object();
  for (const Column<Row>& column : columns) {
    const Json value = column.cell(row);
    object[column.key] = value == Json("") ? Json() : value;
  }
  return object;
}

template <class Row>
void add_columns(ResultFile& file, const std::vector<Column<Row>>& columns, const std::vector<Row>& rows) {
  for (const Column<Row>& column : columns) {
    if (column.field.name.empty()) continue;
    std::vector<std::string> texts;
    std::vector<double> numbers;
    for (const Row& row : rows) {
      const Json value = column.cell(row);
      if (column.is_text)
        texts.push_back(value.get<std::string>());
      else
        numbers.push_back(value.is_null()      ? NAN
                          : value.is_boolean() ? double(value.get<bool>())
                                               : value.get<double>());
    }
    if (column.is_text)
      file.add_text(column.field, {"row"}, texts);
    else
      file.add(column.field, {"row"}, numbers);
  }
}

}  // namespace stickslip
