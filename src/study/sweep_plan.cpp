#include "study/sweep_plan.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>

#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/sampling.hpp"
#include "stickslip/options/library_options.hpp"

namespace stickslip {

namespace {

constexpr int most_axes = 4;
constexpr double most_points = 1e8;  // numbers of points are int or double in every reader

// The options that a sweep sets itself, and those that say what it is.
bool is_own(const std::string& name) {
  static const std::set<std::string> names = {"out_file", "summary", "progress", "restart", "check"};
  return names.count(name) || name.rfind("sweep_", 0) == 0;
}

}  // namespace

// ---- one axis

SweepAxis::SweepAxis(const Options& sweep, int number) {
  const std::string n = std::to_string(number), own = "sweep_parameter" + n;
  names_ = sweep.words(own);
  listed_ = sweep.words("sweep_values" + n);
  for (std::string& name : names_) {
    const OptionSpec* spec = find_option(name);
    if (spec) name = spec->name;
    if ((!spec && !is_library_option(name)) || is_own(name))
      throw UsageError("-" + own + " " + stickslip::quoted(name) + ": no option that a sweep may vary" +
                       did_you_mean(nearest_option(name)));
    if (spec && spec->type == OptionType::integer) integer_ = true;
  }
  const std::string from = "sweep_from" + n, to = "sweep_to" + n;
  const bool ranged = sweep.is_set(from) && sweep.is_set(to);
  if (ranged == !listed_.empty() || sweep.is_set(from) != sweep.is_set(to))
    throw UsageError(own + " " + name() + ": needs either " + from + " and " + to + ", or sweep_values" + n);
  count_ = ranged ? sweep.integer("sweep_points" + n) : long(listed_.size());
  if (!ranged) return;
  from_ = sweep.real(from);
  to_ = sweep.real(to);
  log_ = sweep.boolean("sweep_log" + n);
  if (log_ && !(from_ > 0 && to_ > 0))
    throw UsageError("sweep_log" + n + ": needs " + from + " and " + to + " above 0");
  if (integer_ && (from_ != std::floor(from_) || to_ != std::floor(to_)))
    throw UsageError(own + " " + name() + ": takes integers, so " + from + " and " + to +
                     " must be integers");
}

std::string SweepAxis::at_part(double part) const {
  const double value = log_ ? from_ * std::pow(to_ / from_, part) : from_ + (to_ - from_) * part;
  return number_text(integer_ ? std::round(value) : value);
}

std::string SweepAxis::between(long k, long intervals) const {
  if (k == 0) return number_text(from_);
  if (k == intervals) return number_text(to_);
  return at_part(double(k) / double(intervals));
}

std::string SweepAxis::drawn(double part) const {
  if (!listed_.empty())
    return listed_[std::min(std::size_t(part * double(listed_.size())), listed_.size() - 1)];
  if (log_ || !integer_) return at_part(part);
  const double low = std::min(from_, to_), high = std::max(from_, to_);
  return number_text(std::min(high, low + std::floor(part * (high - low + 1))));
}

bool SweepAxis::is_numeric() const {
  return std::all_of(listed_.begin(), listed_.end(),
                     [](const std::string& text) { return bool(parse_number(text)); });
}

Options SweepAxis::set(Options options, const std::string& value) const {
  for (const std::string& name : names_) options = options.with(name, value);
  return options;
}

// ---- all of them

SweepPlan::SweepPlan(const Options& sweep, const Options& base)
    : base_(base), follow_(sweep.boolean("sweep_follow")), seed_(sweep.integer("sweep_seed")) {
  const std::string sample = sweep.text("sweep_sample");
  kind_ = sample == "grid"    ? Kind::grid
          : sample == "list"  ? Kind::list
          : sample == "sobol" ? Kind::sobol
                              : Kind::random;
  read_axes(sweep);
  const bool sampled = kind_ == Kind::random || kind_ == Kind::sobol;
  if (sampled != sweep.is_set("sweep_count"))
    throw UsageError(
        sampled
            ? "sweep_sample " + sample + ": needs sweep_count, the number of points"
            : "sweep_count: only with sweep_sample random or sobol; sweep_points1, ... count on a " + sample);
  if (sampled) count_ = sweep.integer("sweep_count");
  if (follow_ && kind_ != Kind::grid)
    throw UsageError("sweep_follow: needs a grid, not sweep_sample " + sample);
  if (sweep.is_set("sweep_refine")) read_refinement(sweep);
  double all = 1;
  if (refined_)
    // may be more than a long holds
    for (const long cells : cells_) all *= std::ldexp(double(cells), halvings_) + 1;
  else
    for (const std::size_t length : shape()) all *= double(length);
  if (all > most_points)
    throw UsageError("sweep: " + number_text(all) + " points are more than " + number_text(most_points));
  check_values();
}

void SweepPlan::read_axes(const Options& sweep) {
  std::set<std::string> taken;
  for (int number = 1; number <= most_axes; ++number) {
    const std::string n = std::to_string(number);
    if (sweep.is_set("sweep_parameter" + n)) {
      if (int(axes_.size()) != number - 1)
        throw UsageError("sweep_parameter" + n + ": without sweep_parameter" + std::to_string(number - 1));
      axes_.emplace_back(sweep, number);
      for (const std::string& name : sweep.words("sweep_parameter" + n))
        if (!taken.insert(lower_case(name)).second)
          throw UsageError("sweep_parameter" + n + " " + name + ": varied twice");
      continue;
    }
    for (const char* part : {"sweep_from", "sweep_to", "sweep_points", "sweep_log", "sweep_values"})
      if (sweep.is_set(part + n)) throw UsageError(part + n + ": without sweep_parameter" + n);
  }
  if (axes_.empty()) throw UsageError("sweep: needs sweep_parameter1, an option to vary, e.g. model_v");
  for (const SweepAxis& axis : axes_) {
    if (kind_ != Kind::list) continue;
    if (axis.values() != axes_[0].values())
      throw UsageError("sweep_sample list: every option needs as many values as the first, " +
                       std::to_string(axes_[0].values()) + "; " + axis.name() + " has " +
                       std::to_string(axis.values()));
    count_ = axis.values();
  }
}

void SweepPlan::read_refinement(const Options& sweep) {
  refined_ = true;
  if (kind_ != Kind::grid || follow_) throw UsageError("sweep_refine: needs a grid, without sweep_follow");
  if (axes_.size() > 2)
    throw UsageError("sweep_refine: in one or two options, and there are " + std::to_string(axes_.size()));
  long fewest = 0;
  for (std::size_t k = 0; k < axes_.size(); ++k) {
    if (axes_[k].is_listed())
      throw UsageError("sweep_refine: " + axes_[k].name() + " needs a range, not sweep_values");
    if (axes_[k].values() < 2)
      throw UsageError("sweep_refine: " + axes_[k].name() + " needs at least 2 sweep_points");
    cells_[k] = axes_[k].values() - 1;
    fewest = fewest == 0 ? cells_[k] : std::min(fewest, cells_[k]);
  }
  const double width = sweep.real("sweep_refine");
  const int most = 60;  // far too many points already
  while (halvings_ < most && 1 / (double(fewest) * std::ldexp(1., halvings_)) > width * (1 + 1e-12))
    ++halvings_;
}

// What would be refused at some point is refused before all work.
void SweepPlan::check_values() const {
  for (const SweepAxis& axis : axes_) {
    const bool sampled = kind_ == Kind::random || kind_ == Kind::sobol;
    const long values = sampled && !axis.is_listed() ? 2 : axis.values();
    std::set<std::string> seen;
    for (long k = 0; k < values; ++k) {
      const std::string value = sampled && !axis.is_listed() ? axis.between(k, 1) : axis.value(k);
      (void)axis.set(base_, value);
      if (!seen.insert(value).second && kind_ == Kind::grid)
        throw UsageError("sweep: " + axis.name() + " takes the value " + value + " twice");
    }
    if (!refined_) continue;
    const auto k = &axis - axes_.data();
    const long last = search().size()[k] - 1;
    if (last >= 2 && axis.between(last / 2, last) == axis.between(last / 2 - 1, last))
      throw UsageError("sweep_refine: " + axis.name() + " has no values so close to each other");
  }
}

std::vector<std::size_t> SweepPlan::shape() const {
  if (kind_ != Kind::grid) return {std::size_t(count_)};
  std::vector<std::size_t> lengths;
  for (const SweepAxis& axis : axes_) lengths.push_back(std::size_t(axis.values()));
  if (follow_) lengths.push_back(2);
  return lengths;
}

long SweepPlan::points() const {
  if (refined_) return search().points();
  long product = 1;
  for (const std::size_t length : shape()) product *= long(length);
  return product;
}

std::vector<std::string> SweepPlan::values(long point) const {
  std::vector<std::string> texts(axes_.size());
  if (refined_) {
    const ChangeSearch lattice = search();
    for (std::size_t k = 0; k < axes_.size(); ++k)
      texts[k] = axes_[k].between(lattice.place(point)[k], lattice.size()[k] - 1);
  } else if (kind_ == Kind::grid) {
    long rest = follow_ ? point / 2 : point;
    for (std::size_t k = axes_.size(); k-- > 0;) {
      texts[k] = axes_[k].value(rest % axes_[k].values());
      rest /= axes_[k].values();
    }
  } else if (kind_ == Kind::list) {
    for (std::size_t k = 0; k < axes_.size(); ++k) texts[k] = axes_[k].value(point);
  } else {
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      // each axis has draws of its own, those of sobol moved by one draw (not by seed 0)
      const auto index = PetscInt(kind_ == Kind::random ? point * most_axes + long(k) : long(k));
      double part = counter_uniform(seed_, index);
      if (kind_ == Kind::sobol) {
        const std::uint32_t shift = seed_ == 0 ? 0 : std::uint32_t(std::ldexp(part, 32));
        part = std::ldexp(double(sobol(int(k), std::uint32_t(point)) ^ shift), -32);
      }
      texts[k] = axes_[k].drawn(part);
    }
  }
  return texts;
}

Options SweepPlan::at(long point) const {
  const std::vector<std::string> texts = values(point);
  Options options = base_;
  for (std::size_t k = 0; k < axes_.size(); ++k) options = axes_[k].set(std::move(options), texts[k]);
  return options;
}

long SweepPlan::units() const { return follow_ ? points() / (2 * axes_[0].values()) : points(); }

std::vector<long> SweepPlan::unit(long number) const {
  if (!follow_) return {number};
  const long steps = axes_[0].values(), lines = units();
  std::vector<long> line;
  for (long k = 0; k < steps; ++k) line.push_back((k * lines + number) * 2);
  for (long k = steps; k-- > 0;) line.push_back((k * lines + number) * 2 + 1);
  return line;
}

}  // namespace stickslip
