// Text files of numbers in columns: separated by blanks, tabs or commas; # begins a comment. Not collective.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace stickslip {

struct Rows {
  std::vector<std::vector<double>> values;
  std::vector<std::size_t> lines;  // of the file, from 1
};

// The rows, each of as many numbers as the first, from `least` to `most`. Throws UsageError with the option,
// the file and the line: cannot be read, no such number of columns, not finite, no row at all.
Rows read_columns(const std::string& option, const std::string& path, std::size_t least, std::size_t most);

}  // namespace stickslip
