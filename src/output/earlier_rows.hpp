// Rows of a run's file that go over into a new one: of a run that goes on, or of a table that has outgrown
// its room. Rank 0 only; never more than about a megabyte of them is in memory. What fails throws Failure.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "output/growing_table.hpp"

namespace stickslip::h5 {

// Rows of one table in another file, column by column.
struct EarlierRows {
  hsize_t rows = 0;
  std::vector<double> x;     // of a table that rank 0 writes
  std::vector<Id> datasets;  // for each column, empty where there is none
};

// The rows of an earlier file, called `name`, up to time `until`; `strictly`: before it.
EarlierRows earlier_rows(hid_t old, const std::string& name, const GrowingTable& table, double until,
                         bool strictly);

// `count` rows of a column in the order of the new table, NaN where the other file has nothing.
std::vector<double> rows_of(const EarlierRows& source, const GrowingTable& table, std::size_t c,
                            hsize_t first, hsize_t count);

// Takes over a column that holds a field.
using PutValues = std::function<void(std::int64_t at, const double* values, hsize_t count)>;
void copy_field(const EarlierRows& source, const GrowingTable& table, std::size_t c, const PutValues& put);

}  // namespace stickslip::h5
