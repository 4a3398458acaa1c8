// What a dataset says of itself.
#pragma once

#include <string>
#include <vector>

namespace stickslip {

// One dataset: its name, its units in words ("time", "length/time", "1"; not "seconds", which readers take
// for dates) and what it is.
struct Field {
  std::string name, units, long_name;
};

// The standard fields, to be put into RunLayout::fields: psi, eta, tau, theta, chi; and t.
Field standard_field(const std::string& name);

// Tables of numbers that grow with a run, a row a step or an event: each column with its field and its number
// of a row in one place. (Tables of results, which are made once: table.hpp.)
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
