#include "options/columns.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>

#include "base/failure.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

constexpr std::size_t longest_line = 4096;
constexpr std::size_t longest = 1000000;  // rows: more is no table that anybody means

constexpr const char* byte_order_mark = "\xef\xbb\xbf";  // before the text, by spreadsheets

std::vector<double> row_of(std::string line, const std::string& place) {
  std::replace(line.begin(), line.end(), ',', ' ');
  std::vector<double> row;
  for (const std::string& word : split_words(line, place, '#')) {
    const std::optional<double> value = parse_number(word);
    if (!value || !std::isfinite(*value))
      throw usage_error("{}: {} is not a finite number{}", place, quoted(word),
                        value ? "" : " (a line of words begins with #)");
    row.push_back(*value);
  }
  return row;
}

}  // namespace

Rows read_columns(const std::string& option, const std::string& path, std::size_t least, std::size_t most) {
  const std::string name = "-" + option + " " + quoted(path);
  std::ifstream file(path);
  if (!file) throw UsageError(name + ": cannot be read: " + std::strerror(errno));
  Rows read;
  std::vector<std::vector<double>>& rows = read.values;
  char buffer[longest_line];
  for (std::size_t number = 1; file.getline(buffer, sizeof buffer); ++number) {
    std::string line(buffer, file.gcount() - (file.eof() ? 0 : 1));
    const std::string place = name + ":" + std::to_string(number);
    if (number == 1 && line.compare(0, 3, byte_order_mark) == 0) line.erase(0, 3);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    std::vector<double> row = row_of(line, place);
    if (row.empty()) continue;
    const std::string wanted = std::to_string(least) + (most > least ? " to " + std::to_string(most) : "");
    if (row.size() < least || row.size() > most)
      throw usage_error("{}: {} columns; {} are wanted", place, row.size(), wanted);
    if (!rows.empty() && row.size() != rows.front().size())
      throw usage_error("{}: {} columns where the rows before have {}", place, row.size(),
                        rows.front().size());
    rows.push_back(std::move(row));
    read.lines.push_back(number);
    if (rows.size() > longest) throw UsageError(name + ": more than " + std::to_string(longest) + " rows");
  }
  if (file.bad()) throw UsageError(name + ": cannot be read: " + std::strerror(errno));  // a folder, for one
  if (!file.eof()) throw usage_error("{}: a line of more than {} bytes", name, longest_line - 1);
  if (rows.empty()) throw UsageError(name + ": holds no numbers");
  return read;
}

}  // namespace stickslip
