#include "output/catalogue.hpp"

#include <mpi.h>

#include <algorithm>
#include <cmath>

#include "base/local_values.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

constexpr int bins_a_unit = 4;
constexpr double fewest = 20;  // events for a slope

// Mean of a density ~ exp(-b m) on [0, width].
double mean_of(double b, double width) {
  const double x = b * width;
  return width * (std::abs(x) < 1e-4 ? .5 - x / 12 : 1 / x - 1 / std::expm1(x));
}

}  // namespace

void Magnitudes::add(double magnitude) {
  if (!std::isfinite(magnitude)) return;
  Bin& bin = bins_[int(std::floor(bins_a_unit * magnitude))];
  bin.count += 1;
  bin.sum += magnitude;
}

std::optional<Magnitudes::Slope> Magnitudes::slope() const {
  if (bins_.empty()) return std::nullopt;
  const auto fewer = [](const auto& one, const auto& other) { return one.second.count < other.second.count; };
  const int first = std::max_element(bins_.begin(), bins_.end(), fewer)->first + 1 + 2 * bins_a_unit;
  const double width = 3, low = double(first) / bins_a_unit;
  double count = 0, sum = 0;
  for (auto bin = bins_.lower_bound(first); bin != bins_.lower_bound(first + 3 * bins_a_unit); ++bin) {
    count += bin->second.count;
    sum += bin->second.sum - low * bin->second.count;
  }
  if (count < fewest) return std::nullopt;
  const double mean = sum / count, most = 60 / width, step = 1e-3 / width;
  const auto beyond = [&](double b) { return mean_of(b, width) - mean; };
  const double b = find_root(beyond, {-most, beyond(-most), most, beyond(most)}, 1e-10);
  const double variance = (mean_of(b - step, width) - mean_of(b + step, width)) / (2 * step);
  return Slope{b, 1 / std::sqrt(count * variance)};
}

void Magnitudes::archive(Archive& a) {
  if (!a.has("events.magnitudes")) return;
  struct Row {
    int quarter;
    Bin bin;
  };
  std::vector<Row> rows;
  for (const auto& [quarter, bin] : bins_) rows.push_back({quarter, bin});
  a.list("events.magnitudes", [&](NumberList& x) {
    x.rest(rows, [&x](Row& row) { x(row.quarter, row.bin.count, row.bin.sum); });
  });
  for (const Row& row : rows) bins_[row.quarter] = row.bin;
}

void Catalogue::plan(ObservationPlan& plan) {
  begin_ = MPI_Wtime();
  plan.layout.events = Events::columns();
}

void Catalogue::start(RunFile* file) { file_ = file; }

void Catalogue::step(const ObservedStep& step) {
  if (is_told_) return;
  events_.step(step.t, Reading(step.u), model_.dof());
  for (const SlipEvent& event : events_.ended()) enter(event);
}

void Catalogue::record(const SlipEvent& event) {
  ++told_;
  enter(event);
}

void Catalogue::enter(const SlipEvent& event) {
  magnitudes_.add(std::log(event.moment));
  largest_moment_ = std::max(largest_moment_, event.moment);
  largest_extent_ = std::max(largest_extent_, double(event.count));
  if (file_) file_->row("events", event.end, events_.row(event));
}

void Catalogue::archive(Archive& a) {
  if (a.has("events.last")) events_.archive(a);
  magnitudes_.archive(a);
  if (a.has("events.largest")) a("events.largest", largest_moment_, largest_extent_);
}

void Catalogue::summarise(Summary& summary, Vec) {
  const long count = events_.count() + told_;
  summary.set("events", count);
  if (count > 0) {
    summary.set("largest_moment", largest_moment_);
    summary.set("largest_extent", largest_extent_);
  }
  if (const auto slope = magnitudes_.slope()) {
    summary.set("b", slope->b);
    summary.set("b_error", slope->error);
  }
  summary.set("events_per_s", double(count) / (MPI_Wtime() - begin_));
}

}  // namespace stickslip
