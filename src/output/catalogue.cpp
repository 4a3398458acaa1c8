#include "output/catalogue.hpp"

#include <petscsys.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/json_values.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/output/result_file.hpp"

namespace stickslip {

namespace {

constexpr int bins_a_unit = 4;
constexpr double fewest = 20;  // events for a slope

// Mean of a density ~ exp(-b m) on [0, width].
double mean_of(double b, double width) {
  const double x = b * width;
  return width * (std::abs(x) < 1e-4 ? .5 - x / 12 : 1 / x - 1 / std::expm1(x));
}

struct EventRow {
  const SlipEvent& event;
  const Scene& scene;
  double weight;
  double rupture_offset;
  double duration, clock;  // by the run's clock; begin and end are by the plate's, where that halts
};

const std::vector<RowColumn<EventRow>>& event_columns() {
  using Row = const EventRow&;
  static const std::vector<RowColumn<EventRow>> columns = {
      {{"begin", "time", "time at which the first node moves"}, [](Row r) { return r.event.begin; }},
      {{"first", "length", "position of the first node that moves"},
       [](Row r) { return r.scene.x(r.event.first); }},
      {{"left", "length", "left end of the region that slips"},
       [](Row r) { return r.scene.x(r.event.left); }},
      {{"extent", "length", "blocks that slip (chain) or their length (continuum)"},
       [](Row r) { return r.weight * double(r.event.count); }},
      {{"direction", "1",
        "1: forward; -1: backward; slip, moment and stress_drop are positive in both cases"},
       [](Row r) { return double(r.event.direction); }},
      {{"slip", "length", "largest slip"}, [](Row r) { return r.event.slip; }},
      {{"moment", "length^2", "sum of the slip over blocks or over length"},
       [](Row r) { return r.event.moment; }},
      {{"magnitude", "1", "natural logarithm of the moment"},
       [](Row r) { return r.event.moment > 0 ? std::log(r.event.moment) : NAN; }},
      {{"magnitude10", "1", "the same to the base 10"},
       [](Row r) { return r.event.moment > 0 ? std::log10(r.event.moment) : NAN; }},
      {{"stress_drop", "1", "mean of eta before less eta behind"}, [](Row r) { return r.event.stress_drop; }},
      {{"strain_energy", "amplitude*length", "energy given away by the springs"},
       [](Row r) { return r.event.strain_energy; }},
      {{"friction_work", "amplitude*length", "energy lost in friction"},
       [](Row r) { return r.event.friction_work; }},
      {{"radiated", "amplitude*length", "energy lost in damping"}, [](Row r) { return r.event.radiated; }},
      {{"kinetic", "amplitude*length", "largest kinetic energy"}, [](Row r) { return r.event.kinetic; }}};
  return columns;
}

// Where the plate has a clock of its own.
const std::vector<RowColumn<EventRow>>& halt_columns() {
  using Row = const EventRow&;
  static const std::vector<RowColumn<EventRow>> columns = {
      {{"duration", "time", "with `load_halt`: how long it takes by the run's clock"},
       [](Row r) { return r.duration; }},
      {{"clock", "time", "with `load_halt`: when it ends by the run's clock, that of frames and series"},
       [](Row r) { return r.clock; }}};
  return columns;
}

// What is written of ruptures.
const std::vector<RowColumn<EventRow>>& front_columns() {
  using Row = const EventRow&;
  static const std::vector<RowColumn<EventRow>> columns = {
      {{"front_speed_right", "length/time",
        "with `out_rupture`: speed of the front to the right of the first node, null (NaN) without one"},
       [](Row r) { return front_of(r.event, r.scene, 1).speed; }},
      {{"front_speed_right_error", "length/time", "its standard error"},
       [](Row r) { return front_of(r.event, r.scene, 1).error; }},
      {{"front_speed_left", "length/time",
        "with `out_rupture`: speed of the front to the left of it, negative while it runs to the left"},
       [](Row r) { return front_of(r.event, r.scene, -1).speed; }},
      {{"front_speed_left_error", "length/time", "its standard error"},
       [](Row r) { return front_of(r.event, r.scene, -1).error; }},
      {{"rupture_offset", "1", "with `out_rupture`: the event's first row of `events/rupture`"},
       [](Row r) { return r.rupture_offset; }}};
  return columns;
}

std::vector<RowColumn<EventRow>> columns_with(bool halt, bool ruptures) {
  std::vector<RowColumn<EventRow>> all = event_columns();
  const auto add = [&](const std::vector<RowColumn<EventRow>>& more) {
    all.insert(all.end(), more.begin(), more.end());
  };
  if (halt) add(halt_columns());
  if (ruptures) add(front_columns());
  return all;
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

void Recurrence::add(const SlipEvent& event) {
  if (std::isfinite(last_)) system_.add({1, event.end - last_});
  last_ = event.end;
  const PetscInt first = PetscInt(nodes_.first), behind = first + PetscInt(nodes_.count);
  for (const PetscInt left : {event.left - all_, event.left})  // round a ring
    for (PetscInt i = std::max(left, first); i < std::min(left + event.count, behind); ++i) {
      double& last = last_of_[std::size_t(i - first)];
      if (std::isfinite(last)) node_.add({1, event.end - last});
      last = event.end;
    }
}

Json Recurrence::of(const Sums& sums) {
  const double deviation = std::sqrt(sums.squares / (sums.count - 1));
  return Json::object({{"count", sums.count},
                       {"mean", sums.count > 0 ? Json(sums.mean) : Json()},
                       {"variation", sums.count > 1 ? Json(deviation / sums.mean) : Json()}});
}

Recurrence::Sums Recurrence::of_all_ranks() const {
  const auto rank = std::size_t(rank_in(nodes_.comm)), ranks = std::size_t(ranks_in(nodes_.comm));
  std::vector<double> all(3 * ranks);
  all[3 * rank] = node_.count;
  all[3 * rank + 1] = node_.mean;
  all[3 * rank + 2] = node_.squares;
  sum_over(nodes_.comm, all.data(), int(all.size()));
  Sums sums;
  for (std::size_t r = 0; r < ranks; ++r) sums.add({all[3 * r], all[3 * r + 1], all[3 * r + 2]});
  return sums;
}

Json Recurrence::found() const {
  return Json::object({{"system", of(system_)}, {"node", of(of_all_ranks())}});
}

void Recurrence::archive(Archive& a) {
  if (!a.has("events.recurrence_times")) return;
  a("events.recurrence_times", last_, system_.count, system_.mean, system_.squares);
  // Those of each rank, and beside them what other ranks than these may add up.
  const double off = node_.mean - (a.restores() ? 0 : of_all_ranks().mean);
  std::vector<double> own = {node_.count, node_.mean, node_.squares, node_.count * node_.mean,
                             node_.squares + node_.count * off * off};
  a.by_rank("events.recurrence_of_nodes", own);
  if (own.size() != 5) throw std::runtime_error("its 'events.recurrence_of_nodes' does not fit");
  node_ = {own[0], own[1], own[2]};
  if (own[3] != own[0] * own[1]) node_ = {own[0], own[3] / own[0], own[4]};
  a.nodes("events.last_of_nodes", {&last_of_});
}

std::vector<Field> Catalogue::columns(bool halt, bool ruptures) {
  return fields_of(columns_with(halt, ruptures));
}

std::vector<Field> Catalogue::rupture_columns() {
  return {{"x", "length", "position of a node of the event, from the left end of its region on"},
          {"time", "time", "time at which it first slips in this event (by the run's clock)"}};
}

void EventsOfSteps::plan(ObservationPlan& plan) {
  stiff_ = model_.scene().friction.regularised || model_.friction_law(0).steep;
  if (stiff_) plan.next_times.emplace_back([](double t) { return std::nextafter(t, HUGE_VAL); });
}

std::vector<SlipEvent> EventsOfSteps::step(const ObservedStep& step) {
  // Where friction is stiff the slopes of psi say nothing of what it goes through: the method does.
  const std::function<Vec()> middle = [&] {
    if (!middle_) middle_ = model_.create_vector();
    step.interpolate((step.t_before + step.t) / 2, middle_);
    return Vec(middle_);
  };
  events_.step(step.t, step.u, model_.dof(), stiff_ ? middle : nullptr);
  return events_.ended();
}

std::vector<double> EventTimes::values() const {
  std::vector<std::pair<double, double>> sorted = times_;
  std::sort(sorted.begin(), sorted.end());
  std::vector<double> times;
  for (const auto& [begin, end] : sorted) times.insert(times.end(), {begin, end});
  return times;
}

void Catalogue::plan(ObservationPlan& plan) {
  begin_ = MPI_Wtime();
  const Field end{"t", "time", "time at which the event ends"};
  if (ruptures_) plan.layout.groups.push_back({"events/rupture", end, rupture_columns()});  // shown before it
  plan.layout.groups.push_back({"events", end, columns(halts(model_.scene()), ruptures_)});
  if (events_) events_->plan(plan);
}

void Catalogue::start(RunFile* file) { file_ = file; }

void Catalogue::step(const ObservedStep& step) {
  if (!events_) return;
  for (const SlipEvent& event : events_->step(step)) enter(event, plate_.at(event.end));
}

void Catalogue::record(const SlipEvent& event, double plate_time) {
  ++told_;
  enter(event, plate_time);
}

void Catalogue::enter(const SlipEvent& ended, double plate_time) {
  const Scene& scene = model_.scene();
  SlipEvent event = ended;
  if (halts(scene)) event.begin = event.end = plate_time;  // meanwhile the plate stood
  magnitudes_.add(std::log(event.moment));
  largest_moment_ = std::max(largest_moment_, event.moment);
  largest_extent_ = std::max(largest_extent_, double(event.count));
  recurrence_.add(event);
  if (!file_) return;
  const EventRow about{event,
                       scene,
                       scene.form == Form::chain ? 1 : scene.h(),
                       double(file_->rows("events/rupture")),
                       ended.end - ended.begin,
                       ended.end};
  const std::vector<double> row = numbers_of(columns_with(halts(scene), ruptures_), about);
  for (std::size_t k = 0; k < event.rupture.size(); ++k)
    file_->row("events/rupture", ended.end,
               {scene.x((event.left + PetscInt(k)) % scene.n), event.rupture[k]});
  file_->row("events", event.end, row);  // once its nodes are there
}

void Catalogue::archive(Archive& a) {
  if (a.restores() ? a.has("clusters.reached") : !events_) {
    a("events.told", told_);
  } else if (a.has("events.last")) {
    events_->archive(a);
  }
  magnitudes_.archive(a);
  recurrence_.archive(a);
  if (a.has("events.largest")) a("events.largest", largest_moment_, largest_extent_);
}

void Catalogue::summarise(Summary& summary, Vec u) {
  const long count = (events_ ? events_->count() : 0) + told_;
  summary.set("events", count);
  if (count > 0) {
    summary.set("largest_moment", largest_moment_);
    summary.set("largest_extent", largest_extent_);
  }
  if (const auto slope = magnitudes_.slope()) {
    summary.set("b", slope->b);
    summary.set("b_error", slope->error);
  }
  if (u) summary.set("recurrence", recurrence_.found());
  summary.set("events_per_s", double(count) / (MPI_Wtime() - begin_));
}

}  // namespace stickslip
