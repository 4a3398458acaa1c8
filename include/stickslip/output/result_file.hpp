// A file of results that is written in one piece, and what its datasets say of themselves.
#pragma once

#include <petscsys.h>

#include <complex>
#include <memory>
#include <string>
#include <vector>

#include "stickslip/base/provenance.hpp"

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

// A file written in one piece: spectrum, boundary, wave, chart, laws, sweep. Collect on every rank or on rank
// 0, write() is collective. Names may have one group before them ("branch/speed"); a dimension is named by
// its scale, which is sought in the dataset's group first, then at the root. A dimension without a scale gets
// one that counts 0, 1, ...
class ResultFile {
 public:
  ResultFile(MPI_Comm comm, std::string path, Provenance provenance);  // path "": write() does nothing
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;

  void attribute(const std::string& name, const std::string& text);
  void attribute(const std::string& name, double value);
  void scale(const Field& field, std::vector<double> values);
  void scale_text(const Field& field, std::vector<std::string> values);
  // Row-major values of the named dimensions, none of them for a scalar.
  void add(const Field& field, const std::vector<std::string>& dimensions, std::vector<double> values);
  void add_text(const Field& field, const std::vector<std::string>& dimensions,
                std::vector<std::string> values);
  // Two, NAME_re and NAME_im.
  void add_complex(const Field& field, const std::vector<std::string>& dimensions,
                   const std::vector<std::complex<double>>& values);
  void write();  // throws Failure

 private:
  struct Contents;
  MPI_Comm comm_;
  std::string path_;
  Provenance provenance_;
  std::unique_ptr<Contents> contents_;
};

}  // namespace stickslip
