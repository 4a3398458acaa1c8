// The results of a sweep: a row for every point, its journal on disk while the sweep goes on, and the table
// in HDF5 and CSV. Rank 0 of whoever calls; what is collective says so.
//
// A row is what a summary holds, made flat: {a: {b: 1}} is a_b = 1; of a list of objects each member becomes
// a list (points: [{value: 1}, {value: 2}] is points_value = [1, 2]). What is alike at all points (options,
// version, ...) is left out, and warnings are one text.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/json_values.hpp"
#include "base/paths.hpp"
#include "stickslip/base/provenance.hpp"

namespace stickslip {

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

}  // namespace stickslip
