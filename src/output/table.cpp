#include "output/table.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

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

}  // namespace stickslip
