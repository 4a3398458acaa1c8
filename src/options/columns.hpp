// Text files of numbers in columns, as measuring programs and spreadsheets write them. Not collective.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stickslip {

struct Rows {
  std::vector<std::vector<double>> values;
  std::vector<std::size_t> lines;  // of the file, from 1
};

// Whether there is such a file, `given` as below.
bool names_table(const std::string& given, const std::string& where);

// `given` with one column more than those that it names; than the first two where it names none.
std::string with_column(const std::string& given, const std::string& where, const std::string& column);

// Reads `given`: the name of a file, or FILE:COLUMN,COLUMN,... with columns by number from 1 or by their
// names in a header. Between columns stand semicolons, tabs, commas or blanks, whichever the first row of
// numbers has; where that is no comma, a comma is a decimal point. Words may stand in quotes. Lines that
// begin with # or % are comments, # after a blank begins one; rows of words before the numbers are a header.
// A file that is not there is looked for beside `where`, the scene's file and line that name it.
// A line among the words that close the command says what was read: how many rows, which columns, whether
// there is a header.
// Rows are of `least` to `most` numbers, each of as many as the first. Throws UsageError with the option, the
// file, the line and the column: cannot be read, no such column, not finite, no row at all.
Rows read_columns(const std::string& option, const std::string& given, const std::string& where,
                  std::size_t least, std::size_t most);

}  // namespace stickslip
