// Tables of numbers that grow with a run, a row a step or an event: each column with its field and its number
// of a row in one place. (Tables of results, which are made once: table.hpp.)
#pragma once

#include <vector>

#include "stickslip/output/field.hpp"

namespace stickslip {

template <class Row>
struct RowColumn {
  Field field;
  double (*value)(const Row& row);
};

template <class Row>
std::vector<Field> fields_of(const std::vector<RowColumn<Row>>& columns) {
  std::vector<Field> fields;
  for (const RowColumn<Row>& column : columns) fields.push_back(column.field);
  return fields;
}

template <class Row>
std::vector<double> numbers_of(const std::vector<RowColumn<Row>>& columns, const Row& row) {
  std::vector<double> numbers;
  for (const RowColumn<Row>& column : columns) numbers.push_back(column.value(row));
  return numbers;
}

}  // namespace stickslip
