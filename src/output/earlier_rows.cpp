#include "output/earlier_rows.hpp"

#include <algorithm>
#include <limits>

#include "stickslip/base/error.hpp"

namespace stickslip::h5 {

namespace {

bool has_same_axis(hid_t old, const GrowingTable& table) {
  const Id dataset = open_dataset(old, table.path("x"));
  if (!dataset) fail("read x of", old);
  if (const auto sizes = extents(dataset); sizes.size() != 1 || sizes[0] != table.x.size) return false;
  for (hsize_t first = 0; first < table.x.size; first += largest_piece) {
    const std::vector<double> piece =
        read_rows(dataset, first, std::min(largest_piece, table.x.size - first), 1);
    for (std::size_t k = 0; k < piece.size(); ++k)
      if (piece[k] != table.x.at(static_cast<std::int64_t>(first + k))) return false;
  }
  return true;
}

}  // namespace

EarlierRows earlier_rows(hid_t old, const std::string& name, const GrowingTable& table, double until,
                         bool strictly) {
  EarlierRows source;
  source.datasets.resize(table.columns.size());
  if (!exists(old, table.path("t"))) return source;
  // of events whose times are by the plate's clock (load_halt): that of the run
  const bool has_clock = exists(old, table.path("clock"));
  const std::vector<double> times = read_reals(old, table.path(has_clock ? "clock" : "t"));
  const auto later = std::find_if(times.begin(), times.end(),
                                  [&](double t) { return strictly ? !(t < until) : !(t <= until); });
  source.rows = static_cast<hsize_t>(later - times.begin());
  if (table.by_ranks && !has_same_axis(old, table)) throw Failure("'" + name + "' has another grid");
  if (table.x.size > 0 && !table.by_ranks) source.x = read_reals(old, table.path("x"));
  const hsize_t wide = table.by_ranks ? table.x.size : source.x.size();
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const std::string path = table.path(table.columns[c].field.name);
    source.datasets[c] = open_dataset(old, path);
    if (!source.datasets[c]) continue;
    const auto sizes = extents(source.datasets[c]);
    const bool fits = table.columns[c].wide ? sizes.size() == 2 && sizes[1] == wide : sizes.size() == 1;
    if (!fits || sizes[0] < source.rows)
      throw Failure("'" + name + "': " + path + " does not fit its t and x");
  }
  return source;
}

std::vector<double> rows_of(const EarlierRows& source, const GrowingTable& table, std::size_t c,
                            hsize_t first, hsize_t count) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Column& column = table.columns[c];
  if (!source.datasets[c]) return std::vector<double>(count * table.width(column), nan);
  const hsize_t width = column.wide ? source.x.size() : 1;
  std::vector<double> rows = read_rows(source.datasets[c], first, count, width);
  if (!column.wide) return rows;
  std::vector<double> values(count * table.x.size, nan);
  for (hsize_t k = 0; k < table.x.size; ++k) {
    const double x = table.x.at(static_cast<std::int64_t>(k));
    const auto at = std::find(source.x.begin(), source.x.end(), x) - source.x.begin();
    for (hsize_t r = 0; r < count && at < std::ptrdiff_t(width); ++r)
      values[r * table.x.size + k] = rows[r * width + hsize_t(at)];
  }
  return values;
}

void copy_field(const EarlierRows& source, const GrowingTable& table, std::size_t c, const PutValues& put) {
  const ColumnPlace& place = table.columns[c].place;
  const hsize_t at_once = std::max<hsize_t>(1, largest_piece / place.wide);
  for (hsize_t row = 0; row < source.rows; row += at_once) {
    const hsize_t rows = std::min(at_once, source.rows - row);
    for (hsize_t first = 0; first < place.wide; first += largest_piece) {
      const hsize_t count = std::min(largest_piece, place.wide - first);  // all of a row if there are several
      const std::vector<double> values =
          source.datasets[c] ? read_block(source.datasets[c], row, rows, first, count)
                             : std::vector<double>(rows * count, std::numeric_limits<double>::quiet_NaN());
      if (count == place.wide)
        place.put_rows(row, rows, values.data(), put);
      else
        place.put_row(row, first, count, values.data(), put);
    }
  }
}

}  // namespace stickslip::h5
