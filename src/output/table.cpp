#include "output/table.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>
#include <set>

#include "output/hdf5_tools.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/output/reader.hpp"

namespace stickslip {

void add_cells(ResultFile& file, const Field& field, const std::vector<std::string>& dimensions,
               const std::vector<Json>& cells) {
  if (cells.empty()) return;
  const bool is_text = std::any_of(cells.begin(), cells.end(), [](const Json& c) { return c.is_string(); });
  std::vector<std::string> texts;
  std::vector<double> numbers;
  for (const Json& c : cells) {
    if (is_text)
      texts.push_back(c.is_null() ? "" : c.is_string() ? c.get<std::string>() : c.dump());
    else
      numbers.push_back(c.is_null() ? NAN : c.is_boolean() ? double(c.get<bool>()) : c.get<double>());
  }
  if (is_text)
    file.add_text(field, dimensions, std::move(texts));
  else
    file.add(field, dimensions, std::move(numbers));
}

void add_count(ResultFile& file, const std::string& dimension, const std::string& counts, std::size_t rows) {
  if (rows == 0 || counts == "index") return;
  std::vector<double> numbers(rows);
  std::iota(numbers.begin(), numbers.end(), 0.);
  file.scale({dimension, "1", counts}, numbers);
}

std::string json_text(const std::vector<TableText>& tables) {
  Json list = Json::array();
  for (const TableText& table : tables) {
    Json columns = Json::array();
    for (const auto& c : table.columns)
      columns.push_back(
          {{"key", c.in == In::file ? Json() : Json(c.name)},
           {"dataset", c.in == In::summary ? Json() : Json(c.dataset.empty() ? c.name : c.dataset)},
           {"unit", c.unit},
           {"meaning", c.meaning}});
    list.push_back({{"list", table.list},
                    {"prefix", table.prefix},
                    {"dimension", table.dimension},
                    {"counts", table.counts},
                    {"columns", columns}});
  }
  return json_text(list);
}

// ---- rows

namespace {

void add_flat(Json& row, const std::string& key, const Json& value);

// A list of objects as lists of their members; of plain values as it is. Lists of lists are left out.
void add_list(Json& row, const std::string& key, const Json& list) {
  const auto all = [&list](auto is) { return std::all_of(list.begin(), list.end(), is); };
  if (all([](const Json& item) { return !item.is_structured(); })) {
    row[key] = list;
    return;
  }
  if (!all([](const Json& item) { return item.is_object(); })) return;
  std::vector<std::string> members;
  for (const Json& item : list)
    for (const auto& [name, value] : item.items())
      if (!value.is_structured() && std::find(members.begin(), members.end(), name) == members.end())
        members.push_back(name);
  for (const std::string& name : members) {
    Json column = Json::array();
    for (const Json& item : list)
      column.push_back(item.contains(name) && !item[name].is_structured() ? item[name] : Json());
    row[key + "_" + name] = column;
  }
}

void add_flat(Json& row, const std::string& key, const Json& value) {
  if (value.is_object()) {
    for (const auto& [name, member] : value.items()) add_flat(row, key + "_" + name, member);
  } else if (value.is_array()) {
    if (!value.empty()) add_list(row, key, value);
  } else {
    row[key] = value;
  }
}

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

double number_of(const Json& value) {
  if (value.is_boolean()) return value.get<bool>() ? 1 : 0;
  return value.is_number() ? value.get<double>() : nan;
}

std::string text_of(const Json& value) {
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  return value.is_number_float() ? number_text(value.get<double>()) : value.dump();
}

}  // namespace

Json flat_row(const Json& summary) {
  static const std::set<std::string> alike = {"command", "version", "git",      "options",
                                              "files",   "ranks",   "warnings", "wall_s"};
  Json row = Json::object();
  for (const auto& [key, value] : summary.items())
    if (!alike.count(key)) add_flat(row, key, value);
  std::vector<std::string> warnings;
  if (summary.contains("warnings") && summary["warnings"].is_array())
    for (const Json& one : summary["warnings"]) warnings.push_back(one.get<std::string>());
  row["warnings"] = joined(warnings, "; ");
  if (summary.contains("wall_s")) row["wall_s"] = summary["wall_s"];
  return row;
}

void SweepTable::take(long point, const Json& row) {
  if (!slots_.emplace(point, points_.size()).second) return;
  points_.push_back(point);
  const std::size_t slot = points_.size() - 1;
  std::size_t place = 0;
  for (const auto& [key, value] : row.items()) {
    const auto [known, is_new] = index_.emplace(key, columns_.size());
    if (is_new) columns_.push_back({key, point, place, false, 0, {}});
    Column& column = columns_[known->second];
    if (point < column.point) {
      column.point = point;
      column.place = place;
    }
    ++place;
    if (value.is_array()) {
      column.is_list = true;
      column.width = std::max(column.width, value.size());
    }
    column.cells.resize(slot);
    column.cells.push_back(value.is_string() || value.is_array() ? value
                           : std::isnan(number_of(value))        ? Json()
                                                                 : Json(number_of(value)));
  }
}

const Json& SweepTable::Column::cell(std::size_t slot) const {
  static const Json none;
  return slot < cells.size() ? cells[slot] : none;
}

const Json& SweepTable::Column::item(std::size_t slot, std::size_t k) const {
  static const Json none;
  const Json& list = cell(slot);
  return list.is_array() && k < list.size() ? list[k] : none;
}

std::string SweepTable::text(long point, const std::string& key) const {
  const auto column = index_.find(key);
  if (column == index_.end()) return "";
  const Json& value = columns_[column->second].cell(slots_.at(point));
  return value.is_array() ? "" : text_of(value);
}

std::vector<const SweepTable::Column*> SweepTable::ordered() const {
  std::vector<const Column*> order;
  for (const Column& column : columns_) order.push_back(&column);
  std::sort(order.begin(), order.end(), [](const Column* a, const Column* b) {
    return std::pair(a->point, a->place) < std::pair(b->point, b->place);
  });
  // How long a point took depends on the machine, so it comes last; all else is known of every point.
  std::stable_partition(order.begin(), order.end(), [](const Column* c) { return c->key != "wall_s"; });
  return order;
}

std::vector<std::size_t> SweepTable::by_point() const {
  std::vector<std::size_t> order(points_.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::sort(order.begin(), order.end(),
            [this](std::size_t a, std::size_t b) { return points_[a] < points_[b]; });
  return order;
}

// ---- the table

namespace {

// A cell of CSV (RFC 4180).
std::string cell(const std::string& text) {
  const std::string plain = one_line(text);
  if (plain.find_first_of(",\"") == std::string::npos) return plain;
  std::string out = "\"";
  for (const char c : plain) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

}  // namespace

std::string SweepTable::csv(const SweepLayout& layout) const {
  const std::vector<const Column*> columns = ordered();
  std::string text = "number";
  for (const SweepLayout::Axis& axis : layout.axes) text += "," + cell(axis.name);
  if (layout.follows) text += ",direction";
  for (const Column* c : columns) {
    if (!c->is_list) text += "," + cell(c->key);
    for (std::size_t k = 0; k < c->width; ++k) text += "," + cell(c->key + "_" + std::to_string(k));
  }
  for (const std::size_t slot : by_point()) {
    const long point = points_[slot];
    text += "\n" + std::to_string(point);
    for (const std::string& value : layout.values(point)) text += "," + cell(value);
    if (layout.follows) text += point % 2 ? ",-1" : ",1";
    for (const Column* c : columns) {
      if (!c->is_list) text += "," + cell(this->text(point, c->key));
      for (std::size_t k = 0; k < c->width; ++k) text += "," + cell(text_of(c->item(slot, k)));
    }
  }
  return text + "\n";
}

namespace {

// The dimensions of the table and their scales; without a grid the options beside the points.
std::vector<std::string> add_dimensions(ResultFile& file, const SweepLayout& layout, std::size_t rows) {
  std::vector<std::string> dimensions, coordinates;
  const auto numbers_of = [](const std::vector<std::string>& list) {
    std::vector<double> values;
    for (const std::string& one : list) values.push_back(std::stod(one));
    return values;
  };
  if (!layout.is_grid) {
    std::vector<double> counting(rows);
    std::iota(counting.begin(), counting.end(), 0.);
    dimensions = {"point"};
    file.scale({"point", "1", "number of the row"}, counting);
  }
  for (const SweepLayout::Axis& axis : layout.axes) {
    const Field field{axis.name, "", "option " + axis.name};
    if (layout.is_grid) {
      dimensions.push_back(axis.name);
      if (axis.is_numeric)
        file.scale(field, numbers_of(axis.values));
      else
        file.scale_text(field, axis.values);
    } else {
      coordinates.push_back(axis.name);
      if (axis.is_numeric)
        file.add(field, dimensions, numbers_of(axis.values));
      else
        file.add_text(field, dimensions, axis.values);
    }
  }
  if (layout.follows) {
    dimensions.push_back("direction");
    file.scale({"direction", "1", "1: the first option rising in the order of its values, -1: falling"},
               {1, -1});
  }
  if (!coordinates.empty()) file.attribute("coordinates", joined(coordinates, " "));
  return dimensions;
}

std::size_t cells_in(const SweepLayout& layout, std::size_t rows) {
  if (!layout.is_grid) return rows;
  std::size_t cells = layout.follows ? 2 : 1;
  for (const SweepLayout::Axis& axis : layout.axes) cells *= axis.values.size();
  return cells;
}

}  // namespace

// `row`: the row behind each cell, past the end where there is none.
void SweepTable::add_column(ResultFile& file, const Column& c, std::vector<std::string> dimensions,
                            const std::vector<std::size_t>& row) const {
  std::vector<Json> cells;
  for (const std::size_t slot : row)
    for (std::size_t k = 0; k < (c.is_list ? c.width : 1); ++k)
      cells.push_back(c.is_list ? c.item(slot, k) : c.cell(slot));
  if (c.is_list) dimensions.push_back(c.key + "_number");
  add_cells(file, {c.key, "", ""}, dimensions, cells);
}

void SweepTable::write_csv(const std::string& path, const SweepLayout& layout) const {
  paths::replace_file(paths::resolved(csv_beside(path)), csv(layout), ".tmp", false);
}

void SweepTable::write(const std::string& path, const Provenance& provenance, const SweepLayout& layout,
                       const std::map<std::string, std::string>& texts,
                       const std::map<std::string, double>& numbers) const {
  ResultFile file(PETSC_COMM_SELF, path, provenance);
  for (const auto& [name, value] : texts) file.attribute(name, value);
  for (const auto& [name, value] : numbers) file.attribute(name, value);
  const std::size_t rows = points_.size(), cells = cells_in(layout, rows);
  const std::vector<std::string> dimensions = add_dimensions(file, layout, rows);
  const std::vector<std::size_t> order = by_point();
  std::vector<std::size_t> row(cells, rows);
  std::vector<double> number(cells);
  std::iota(number.begin(), number.end(), 0.);
  for (std::size_t k = 0; k < rows; ++k) {
    const long point = points_[order[k]];
    row[layout.is_grid ? std::size_t(point) : k] = order[k];
    if (!layout.is_grid) number[k] = double(point);
  }
  file.add({"number", "1", "number of the point, also in the names of its files"}, dimensions, number);
  std::set<std::string> taken(dimensions.begin(), dimensions.end());
  for (const SweepLayout::Axis& axis : layout.axes) taken.insert(axis.name);
  for (const Column* column : ordered())  // what is taken is the option itself, which is there already
    if (taken.count(column->key) == 0) add_column(file, *column, dimensions, row);
  write_csv(path, layout);  // first: where the results say that the sweep is whole, so is it
  file.write();
}

// ---- journals

namespace {

std::string journal_of(const std::string& out_file, const std::string& group) {
  return out_file + ".points-" + group;
}

std::vector<std::string> journals(const std::string& out_file) {
  const std::string begin = journal_of(paths::file(out_file), "");
  std::vector<std::string> found;
  for (const auto& entry : std::filesystem::directory_iterator(paths::folder(out_file))) {
    const std::string name = entry.path().filename();
    const std::string rest = name.rfind(begin, 0) == 0 ? name.substr(begin.size()) : "";
    if (!rest.empty() && rest.find_first_not_of("0123456789") == std::string::npos)
      found.push_back(entry.path());
  }
  return found;
}

}  // namespace

SweepJournal::SweepJournal(const std::string& out_file, int group)
    : file_(journal_of(out_file, std::to_string(group)), O_RDWR | O_CREAT | O_APPEND, "write") {
  const off_t size = lseek(file_, 0, SEEK_END);
  char last = '\n';
  if (size > 0 && paths::read_some(file_, &last, 1, size - 1) == 1 && last != '\n')
    paths::write_all(file_, "\n", 1);
}

void SweepJournal::note(long point, const Json& row) {
  Json line = Json::object();
  line["point"] = point;
  line["row"] = row;
  const std::string text = json_text(line, 0) + "\n";
  paths::write_all(file_, text.data(), text.size());
}

void read_journals(const std::string& out_file, SweepTable& table) {
  for (const std::string& path : journals(out_file)) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
      const Json entry = Json::parse(line, nullptr, false);
      if (entry.is_object() && entry.contains("point") && entry.contains("row"))
        table.take(entry["point"], entry["row"]);
    }
  }
}

void remove_journals(const std::string& out_file) {
  for (const std::string& path : journals(out_file)) unlink(path.c_str());
}

std::string csv_beside(const std::string& out_file) {
  return std::filesystem::path(out_file).replace_extension(".csv");
}

void check_csv(const std::string& out_file) {
  on_root(PETSC_COMM_WORLD, [&] {
    const std::string path = csv_beside(out_file);
    if (path == out_file)
      throw UsageError("out_file '" + out_file + "': the HDF5 file of a sweep; its CSV has that name");
    const paths::Present present = paths::check_writable("out_file", path);
    if (present == paths::Present::nothing) return;
    if (present == paths::Present::special)
      throw UsageError("out_file '" + out_file + "': '" + path + "' beside it is not a regular file");
    std::ifstream old(path);
    std::string first;
    if (std::getline(old, first) && first.rfind("number,", 0) != 0)
      throw UsageError("out_file '" + out_file + "': '" + path +
                       "' beside it exists and is not a sweep's; it will not be overwritten");
  });
}

SweepHeader read_sweep_header(const std::string& path) {
  SweepHeader header;
  h5::read_from_outside(
      "restart", path,
      [&] {
        if (H5Fis_hdf5(path.c_str()) <= 0) throw Failure("is not an HDF5 file");
      },
      [&] {
        const h5::Id file = h5::open_file(path);
        const FileHeader found = h5::read_header(file);
        if (found.kind != "sweep") throw Failure("holds the result of " + found.kind + ", not of a sweep");
        header.given = parse_text_map(h5::read_text_attribute(file, "given"));
        header.points = long(h5::read_real_attribute(file, "points"));
        header.done = long(h5::read_real_attribute(file, "done"));
        header.failed = long(h5::read_real_attribute(file, "failed"));
        header.complete = h5::read_real_attribute(file, "complete") != 0;
        header.git = found.git;
      });
  broadcast_all(header.given, header.git, header.points, header.done, header.failed, header.complete);
  return header;
}

}  // namespace stickslip
