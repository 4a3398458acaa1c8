
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/failure.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/provenance.hpp"

namespace stickslip {

namespace {

constexpr std::size_t longest_line = 65536;
constexpr std::size_t longest = 1000000;                 // rows: more is no table that anybody means
constexpr const char* byte_order_mark = "\xef\xbb\xbf";  // before the text, by spreadsheets
constexpr const char* blanks = " \t";

// The parts of a line between separators, those in quotes whole; a blank stands for any number of blanks and
// tabs, and what follows the last separator counts only where it is something.
std::vector<std::string> fields_of(const std::string& line, char separator) {
  std::vector<std::string> fields;
  const bool any_blanks = separator == ' ';
  for (std::size_t at = 0; (at = line.find_first_not_of(any_blanks ? blanks : " ", at)) < line.size();) {
    std::string field;
    if (line[at] == '"' && line.find('"', at + 1) != std::string::npos) {
      const std::size_t end = line.find('"', at + 1);
      field = line.substr(at + 1, end - at - 1);
      at = end + 1;
    }
    const std::size_t end =
        std::min(line.size(), any_blanks ? line.find_first_of(blanks, at) : line.find(separator, at));
    field += trimmed(line.substr(at, end - at));
    if (any_blanks && field.size() > 1 && field.back() == ',') field.pop_back();  // "1 2" beside "1, 2"
    fields.push_back(field);
    at = end + 1;
  }
  return fields;
}

std::string without_comment(const std::string& line) {
  for (std::size_t at = line.find('#'); at != std::string::npos; at = line.find('#', at + 1))
    if (at > 0 && std::strchr(blanks, line[at - 1])) return line.substr(0, at);
  return line;
}

// A line of Latin-1, as older spreadsheets save it, in UTF-8; one of UTF-8 as it is.
std::string in_utf8(const std::string& line) {
  std::size_t at = 0;
  while (at < line.size() && utf8_length(line, at) > 0) at += std::size_t(utf8_length(line, at));
  if (at == line.size()) return line;
  std::string text;
  for (const char c : line) {
    const unsigned byte = (unsigned char)c;
    if (byte < 0x80)
      text += c;
    else
      (text += char(0xC0 | byte >> 6)) += char(0x80 | (byte & 0x3F));
  }
  return text;
}

bool is_comment(const std::string& line) {
  const std::size_t first = line.find_first_not_of(blanks);
  return first == std::string::npos || line[first] == '#' || line[first] == '%';
}

std::optional<double> number_in(std::string field, char separator) {
  if (separator != ',') std::replace(field.begin(), field.end(), ',', '.');
  return parse_number(field);
}

// FILE, or the shortest FILE before a colon that is one, and the columns behind it; FILE is empty where there
// is none.
struct TableName {
  std::string file;
  std::vector<std::string> columns;
};
TableName table_name(const std::string& given, const std::string& where) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(where).parent_path();
  std::error_code ignored;
  for (std::size_t end = given.size(); end != std::string::npos;
       end = given.find(':', end == given.size() ? 0 : end + 1)) {
    const std::string name = given.substr(0, end);
    for (const fs::path& path : {fs::path(name), folder / name})
      if (!name.empty() && fs::exists(path, ignored))
        return {path.string(),
                end < given.size() ? fields_of(given.substr(end + 1), ',') : std::vector<std::string>()};
  }
  return {};
}

// One file as it is read: where it is, what was asked of it, and how its rows are written.
class Table {
 public:
  Table(const std::string& option, const std::string& given, const std::string& where) {
    const TableName found = table_name(given, where);
    path_ = found.file.empty() ? given : found.file;
    chosen_ = found.columns;
    name_ = "-" + option + " " + stickslip::quoted(path_);
    read_lines();
  }

  Rows rows(std::size_t least, std::size_t most) {
    const std::size_t first = first_row(least);
    Rows read;
    for (std::size_t i = first; i < lines_.size(); ++i) {
      if (is_comment(lines_[i])) continue;
      read.values.push_back(row_at(i, least, most, read.values.empty() ? 0 : read.values.front().size()));
      read.lines.push_back(i + 1);
    }
    return read;
  }

  std::string said(const Rows& read) const {
    const std::size_t rows = read.values.size(), width = read.values.front().size();
    std::string text = std::to_string(rows) + (rows == 1 ? " row, " : " rows, ");
    if (header_.empty() && columns_.empty()) {
      text += std::to_string(width) + " columns";
    } else {
      text += width == 1 ? "column " : "columns ";
      for (std::size_t j = 0; j < width; ++j)
        text += (j == 0 ? "" : j + 1 < width ? ", " : " and ") + named(columns_.empty() ? j : columns_[j]);
    }
    return text + (skipped_ == 0 ? "" : ", header skipped");
  }

 private:
  void read_lines() {
    std::ifstream file(path_, std::ios::binary);
    if (!file) throw UsageError(name_ + ": cannot be read: " + std::strerror(errno));
    std::vector<char> buffer(longest_line);
    while (file.getline(buffer.data(), longest_line)) {
      std::string line(buffer.data(), file.gcount() - (file.eof() ? 0 : 1));
      if (lines_.empty() && line.compare(0, 3, byte_order_mark) == 0) line.erase(0, 3);
      if (line.find('\0') != std::string::npos)
        throw usage_error("{}:{}: no text of UTF-8 (a spreadsheet saves it as CSV UTF-8)", name_,
                          lines_.size() + 1);
      if (!line.empty() && line.back() == '\r') line.pop_back();
      lines_.push_back(without_comment(in_utf8(line)));
      if (lines_.size() > longest)
        throw UsageError(name_ + ": more than " + std::to_string(longest) + " rows");
    }
    if (file.bad())  // a folder, for one
      throw UsageError(name_ + ": cannot be read: " + std::strerror(errno));
    if (!file.eof()) throw usage_error("{}: a line of more than {} bytes", name_, longest_line - 1);
  }

  // Where numbers begin; finds how columns are separated and which are meant.
  std::size_t first_row(std::size_t least) {
    const bool by_name = !std::all_of(chosen_.begin(), chosen_.end(), parse_number);
    for (const std::string& word : chosen_) {
      if (by_name) break;
      const double place = parse_integer(word).value_or(0);
      if (!(place >= 1 && place <= 1e6))
        throw usage_error("{}: no column {}; they count from 1", name_, word);
      columns_.push_back(std::size_t(place) - 1);
    }
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      if (by_name && columns_.empty()) {
        find_header(lines_[i]);
        continue;
      }
      if (is_comment(lines_[i])) continue;
      for (const char separator : {';', '\t', ',', ' '}) {
        if (by_name && separator != separator_) continue;
        if (!is_row(fields_of(lines_[i], separator), separator, least)) continue;
        separator_ = separator;
        check_header(i);
        return i;
      }
    }
    if (by_name && columns_.empty()) throw usage_error("{}: {}", name_, no_such_columns());
    throw UsageError(name_ + ": no row has numbers in " +
                     (chosen_.empty() ? std::to_string(least) + " columns" : "the columns that are named") +
                     first_words());
  }

  void find_header(std::string line) {
    line.erase(0, std::min(line.find_first_not_of(" \t#%"), line.size()));
    bool split = false;
    for (const char separator : {';', '\t', ',', ' '}) {
      const std::vector<std::string> names = fields_of(line, separator);
      std::vector<std::size_t> found;
      for (const std::string& name : chosen_)
        for (std::size_t j = 0; j < names.size(); ++j)
          if (lower_case(names[j]) == lower_case(name) && found.size() < chosen_.size()) {
            found.push_back(j);
            break;
          }
      // what may be chosen, should this fail: the most names that the first separator of a line gives, not by
      // blanks where others do; no row of numbers
      const std::pair<bool, std::size_t> breadth{separator != ' ', names.size()};
      if (!split && names.size() > 1 && breadth > breadth_ && !is_row(names, separator, names.size()))
        header_ = names, breadth_ = breadth;
      split = split || names.size() > 1;
      if (found.size() < chosen_.size()) continue;
      columns_ = found, header_ = names, separator_ = separator;
      return;
    }
  }

  // Whether a line has numbers where they are wanted: in all columns, or in those that are chosen.
  bool is_row(const std::vector<std::string>& fields, char separator, std::size_t least) const {
    const auto number = [&](std::size_t j) { return j < fields.size() && number_in(fields[j], separator); };
    if (!columns_.empty()) return std::all_of(columns_.begin(), columns_.end(), number);
    if (fields.size() < std::min<std::size_t>(least, 2)) return false;
    for (std::size_t j = 0; j < fields.size(); ++j)
      if (!number(j)) return false;
    return true;
  }

  // Rows before the numbers are of words, unless columns were chosen; the first that is as wide has the
  // names.
  void check_header(std::size_t first) {
    const std::size_t width = fields_of(lines_[first], separator_).size();
    for (std::size_t i = 0; i < first; ++i) {
      if (is_comment(lines_[i])) continue;
      const std::vector<std::string> fields = fields_of(lines_[i], separator_);
      if (chosen_.empty())
        for (const std::string& field : fields)
          if (number_in(field, separator_)) refuse_word(i, fields);
      if (header_.empty() || header_.size() < width) header_ = fields;
      ++skipped_;
    }
  }

  [[noreturn]] void refuse_word(std::size_t i, const std::vector<std::string>& fields) const {
    for (std::size_t j = 0; j < fields.size(); ++j)
      if (!number_in(fields[j], separator_))
        throw usage_error("{}:{}, column {}: {} is not a finite number (a row of words alone is a header)",
                          name_, i + 1, j + 1, stickslip::quoted(fields[j]));
    throw usage_error("{}:{}: {} columns where the rows below have more", name_, i + 1, fields.size());
  }

  std::vector<double> row_at(std::size_t i, std::size_t least, std::size_t most, std::size_t before) const {
    const std::vector<std::string> fields = fields_of(lines_[i], separator_);
    std::vector<std::size_t> columns = columns_;
    if (columns.empty()) {
      if (before > 0 && fields.size() != before)
        throw usage_error("{}:{}: {} columns where the rows before have {}", name_, i + 1, fields.size(),
                          before);
      for (std::size_t j = 0; j < fields.size(); ++j) columns.push_back(j);
    }
    if (columns.size() < least || columns.size() > most)
      throw usage_error("{}:{}: {} columns; {} are wanted{}", name_, i + 1, columns.size(),
                        std::to_string(least) + (most > least ? " to " + std::to_string(most) : ""),
                        columns.size() > most && chosen_.empty() ? ": " + how_to_choose() : "");
    std::vector<double> row;
    for (const std::size_t j : columns) {
      const std::string field = j < fields.size() ? fields[j] : "";
      const std::optional<double> value = number_in(field, separator_);
      if (!value || !std::isfinite(*value))
        throw usage_error("{}:{}, column {}: {} is not a finite number", name_, i + 1, j + 1,
                          stickslip::quoted(field));
      row.push_back(*value);
    }
    return row;
  }

  std::string named(std::size_t column) const {
    return column < header_.size() ? "'" + header_[column] + "'" : std::to_string(column + 1);
  }
  std::string how_to_choose() const {
    std::string names;
    for (const std::string& name : header_) names += (names.empty() ? "" : ", ") + ("'" + name + "'");
    return "choose them by number, as in " + path_ + ":1,2" +
           (names.empty() ? "" : ", or by name, of " + names);
  }
  std::string no_such_columns() const {
    for (const std::string& name : chosen_)
      if (std::none_of(header_.begin(), header_.end(),
                       [&](const std::string& one) { return lower_case(one) == lower_case(name); }))
        return "no column " + stickslip::quoted(name) + suggestion(name, header_) + "; " + how_to_choose();
    return "no row has all of these names";
  }
  std::string first_words() const {
    const auto line = std::find_if_not(lines_.begin(), lines_.end(), is_comment);
    return line == lines_.end() ? "" : " (it begins with " + stickslip::quoted(line->substr(0, 60)) + ")";
  }
  std::string path_, name_;           // name_: as messages call it
  std::vector<std::string> chosen_;   // columns as they were given
  std::vector<std::size_t> columns_;  // that are read; all where empty
  std::vector<std::string> lines_, header_;
  std::pair<bool, std::size_t> breadth_{};  // of the header: not by blanks, names
  std::size_t skipped_ = 0;                 // rows of words
  char separator_ = ' ';
};

}  // namespace

bool names_table(const std::string& given, const std::string& where) {
  return !table_name(given, where).file.empty();
}

std::string with_column(const std::string& given, const std::string& where, const std::string& column) {
  return given + (table_name(given, where).columns.empty() ? ":1,2," : ",") + "\"" + column + "\"";
}

Rows read_columns(const std::string& option, const std::string& given, const std::string& where,
                  std::size_t least, std::size_t most) {
  Table table(option, given, where);
  Rows read = table.rows(least, most);
  note_reading(option + " " + given + ": " + table.said(read));
  return read;
}

}  // namespace stickslip
