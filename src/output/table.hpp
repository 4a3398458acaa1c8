// Results, each described once: a column has a name, a unit, a meaning and a value of its row. From it come
// the summary (JSON), the file (HDF5) and the tables of docs/summary.md and docs/files.md
// (scripts/tables.py).
//
// Columns of one row, all that a command has found, are the keys of its summary.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/json.hpp"
#include "base/json_values.hpp"
#include "base/process.hpp"
#include "stickslip/base/provenance.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

enum class In { both, summary, file };

// `value`: a member, or a function of a row, which gives a number, truth, a text, a list, an optional one of
// these, or Json. What is not there, and an empty text, is null in the summary, NaN or "" in the file. A
// column without one is set by somebody else.
template <class Row>
struct Column {
  std::string name;     // of the key, and of the dataset
  std::string unit;     // in words (Field); "1" of texts in a file
  std::string meaning;  // Markdown, or plain where it is the long_name of a dataset
  std::function<Json(const Row&)> value;
  In in = In::both;
  std::string dataset = {};  // its name, where that is another than the key's
};
template <class Row>
using Columns = std::vector<Column<Row>>;

template <class Row>
Columns<Row> operator+(Columns<Row> first, const Columns<Row>& more) {
  first.insert(first.end(), more.begin(), more.end());
  return first;
}

// The columns of a part of a row: a member or a function, which may give an optional one or a pointer.
template <class Row, class Member, class Inner>
Columns<Row> of(Member member, const Columns<Inner>& inner) {
  Columns<Row> columns;
  for (const Column<Inner>& c : inner) {
    const auto value = [member, get = c.value](const Row& row) -> Json {
      const auto& part = std::invoke(member, row);
      if constexpr (std::is_convertible_v<decltype(part), const Inner&>)
        return get(part);
      else
        return part ? get(*part) : Json();
    };
    columns.push_back({c.name, c.unit, c.meaning, value, c.in, c.dataset});
  }
  return columns;
}

// A list of rows.
template <class Row>
struct Table {
  std::string list;       // where it stands in the summary: key or key.key; "": nowhere
  std::string prefix;     // of its datasets, mostly a group: "branch/"
  std::string dimension;  // of its datasets; "": they are in no file
  Columns<Row> columns;
  std::string counts = "index";  // what the scale of the dimension says
};

// What the pages say of a table.
struct TableText {
  std::string list, prefix, dimension, counts = "time";
  Columns<Json> columns;

  template <class Row>
  TableText(const Table<Row>& table)  // NOLINT: a list of tables of any rows
      : list(table.list), prefix(table.prefix), dimension(table.dimension), counts(table.counts) {
    for (const auto& c : table.columns) columns.push_back({c.name, c.unit, c.meaning, {}, c.in, c.dataset});
  }
  template <class Row>
  TableText(const Columns<Row>& keys)  // NOLINT: the keys of a summary
      : TableText(Table<Row>{"", "", "", keys}) {}
  // Datasets over t.
  TableText(std::string group, const std::vector<Field>& fields)
      : prefix(std::move(group)), dimension(prefix + "t") {
    for (const Field& f : fields) columns.push_back({f.name, f.units, f.long_name, {}, In::file});
  }
  TableText(const std::vector<SummaryKey>& keys) {  // NOLINT: likewise
    for (const SummaryKey& q : keys) columns.push_back({q.name, q.unit, q.meaning, {}});
  }
};
std::string json_text(const std::vector<TableText>& tables);

// The keys of a summary.
template <class Row>
std::vector<SummaryKey> keys_of(const Columns<Row>& columns) {
  std::vector<SummaryKey> keys;
  for (const Column<Row>& c : columns) keys.push_back({c.name, c.unit, c.meaning});
  return keys;
}

// NOLINTNEXTLINE(readability-container-size-empty): the text "", not an empty list
inline Json or_null(const Json& value) { return value == "" ? Json() : value; }

template <class Row>
void set_keys(Summary& summary, const Columns<Row>& columns, const Row& row) {
  for (const Column<Row>& column : columns)
    if (column.value) summary.set(column.name, or_null(column.value(row)));
}

template <class Row>
Json json_of(const Columns<Row>& columns, const Row& row) {
  Json object = Json::object();
  for (const Column<Row>& column : columns)
    if (column.in != In::file) object[column.name] = or_null(column.value(row));
  return object;
}

template <class Row, class Rows>
Json list_of(const Table<Row>& table, const Rows& rows) {
  Json list = Json::array();
  for (const Row& row : rows) list.push_back(json_of(table.columns, row));
  return list;
}

// One dataset of cells. Texts where one of them is.
void add_cells(ResultFile& file, const Field& field, const std::vector<std::string>& dimensions,
               const std::vector<Json>& cells);

// The scale of a dimension, 0, 1, ...; where it has nothing to say the file makes one.
void add_count(ResultFile& file, const std::string& dimension, const std::string& counts, std::size_t rows);

// Nothing where there are no rows.
template <class Row, class Rows>
void add_rows(ResultFile& file, const Table<Row>& table, const Rows& rows) {
  add_count(file, table.dimension, table.counts, rows.size());
  for (const Column<Row>& column : table.columns) {
    std::vector<Json> cells;
    for (const Row& row : rows)
      if (column.in != In::summary) cells.push_back(column.value(row));
    const std::string name = table.prefix + (column.dataset.empty() ? column.name : column.dataset);
    add_cells(file, {name, column.unit, column.meaning}, {table.dimension}, cells);
  }
}

// The results of a sweep: a row for every point, its journal on disk while the sweep goes on, and the table
// in HDF5 and CSV. Rank 0 of whoever calls; what is collective says so.
//
// A row is what a summary holds, made flat: {a: {b: 1}} is a_b = 1; of a list of objects each member becomes
// a list (points: [{value: 1}, {value: 2}] is points_value = [1, 2]). What is alike at all points (options,
// version, ...) is left out, and warnings are one text.
class ResultFile;

Json flat_row(const Json& summary);

// How the points lie. With a grid `values` of an axis are those along its dimension, else one for each row.
struct SweepLayout {
  struct Axis {
    std::string name;
    bool is_numeric;
    std::vector<std::string> values;
  };
  bool is_grid, follows;  // follows: a last dimension `direction`, 1 and -1
  std::vector<Axis> axes;
  std::function<std::vector<std::string>(long point)> values;  // of the axes
};

class SweepTable {
 public:
  void take(long point, const Json& row);  // the first row of a point counts
  bool has(long point) const { return slots_.count(point) > 0; }
  long size() const { return long(points_.size()); }
  const std::vector<long>& points() const { return points_; }
  // Of a row there is; "" where it is null or missing. Truth is true or false.
  std::string text(long point, const std::string& key) const;

  // Replaces both files, each whole or not at all. `texts` and `numbers` become attributes. Throws Failure.
  void write(const std::string& path, const Provenance& provenance, const SweepLayout& layout,
             const std::map<std::string, std::string>& texts,
             const std::map<std::string, double>& numbers) const;

 private:
  struct Column {
    std::string key;
    long point = 0;  // the first of all that have it, and where it stands there
    std::size_t place = 0;
    bool is_list = false;
    std::size_t width = 0;    // of the longest list
    std::vector<Json> cells;  // numbers, texts and lists by row, null or not there where a row has none

    const Json& cell(std::size_t slot) const;
    const Json& item(std::size_t slot, std::size_t k) const;  // of a list
  };
  std::vector<const Column*> ordered() const;
  std::vector<std::size_t> by_point() const;  // rows in the order of points
  std::string csv(const SweepLayout& layout) const;
  void write_csv(const std::string& path, const SweepLayout& layout) const;
  void add_column(ResultFile& file, const Column& column, std::vector<std::string> dimensions,
                  const std::vector<std::size_t>& row) const;

  std::vector<long> points_;
  std::unordered_map<long, std::size_t> slots_;
  std::vector<Column> columns_;
  std::unordered_map<std::string, std::size_t> index_;
};

// Where one group of ranks notes its rows: a line of JSON each, in one write, so that a killed program loses
// none.
class SweepJournal {
 public:
  SweepJournal(const std::string& out_file, int group);  // goes on with an old one; throws Failure
  void note(long point, const Json& row);

 private:
  paths::Descriptor file_;
};
// All rows in the journals beside this file, into the table. A torn line is one that was not written.
void read_journals(const std::string& out_file, SweepTable& table);
void remove_journals(const std::string& out_file);

std::string csv_beside(const std::string& out_file);
// Throws UsageError where the CSV file cannot be written, or is not one of a sweep. Collective.
void check_csv(const std::string& out_file);

// What a sweep's file says of the sweep that wrote it. Throws UsageError. Collective.
struct SweepHeader {
  std::map<std::string, std::string> given;  // options (Options::given)
  std::string git;
  long points = 0, done = 0, failed = 0;  // rows
  bool complete = false;                  // then nothing is left to do
};
SweepHeader read_sweep_header(const std::string& path);

// The summary of a command that is one of many.

// While it lives, the summary of a command that ends goes to `into`, on every rank, and nothing is written or
// told. `into` is left alone where a command is refused (UsageError). Not collective.
class SummaryKept {
 public:
  explicit SummaryKept(Json& into);
  ~SummaryKept();
  SummaryKept(const SummaryKept&) = delete;
  SummaryKept& operator=(const SummaryKept&) = delete;

 private:
  Json* before_;
};

}  // namespace stickslip
