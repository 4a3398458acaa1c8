
#include "study/lyapunov.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/json_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/base/vectors.hpp"

namespace stickslip {

namespace {

constexpr double largest_change_of_slope = 1e-3;  // by an error that the steps allow

double from_of(const Options& options) {
  const double end = options.real("ts_max_time");
  const double from = options.is_set("lyapunov_from") ? options.real("lyapunov_from") : 0.25 * end;
  if (from >= end)
    throw UsageError("-lyapunov_from " + options.text("lyapunov_from") +
                     ": must lie before the end, ts_max_time " + options.text("ts_max_time"));
  return from;
}

int count_of(const Options& options, const Model& model) {
  const auto count = options.integer("lyapunov_count");
  if (model.scene().massless())
    throw UsageError("-lyapunov_count " + options.text("lyapunov_count") +
                     ": tangents are those of a chain with mass; take a "
                     "small model_m in place of 0");
  if (count > model.unknowns())
    throw UsageError("-lyapunov_count " + options.text("lyapunov_count") + ": this scene has only " +
                     std::to_string(model.unknowns()) + " unknowns, and no more exponents");
  return static_cast<int>(count);
}

// All exponents together are the rate at which volumes grow, whatever the vectors.
void check_sum(const std::vector<Estimate>& exponents, double divergence) {
  double sum = 0, scale = 0;
  for (const Estimate& e : exponents) {
    sum += e.value;
    scale += std::abs(e.value);
  }
  if (std::abs(sum - divergence) > 1e-3 * scale)
    warn("the Lyapunov exponents add up to " + rounded_text(sum, 4) + ", the mean divergence is " +
         rounded_text(divergence, 4) + ": steps are too long for them (lower ts_rtol and ts_atol, or ts_dt)");
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

}  // namespace

LyapunovExponents::LyapunovExponents(const Model& model, const Options& options)
    : model_(model), count_(options.integer("lyapunov_count")), from_(from_of(options)),
      tangents_(model, count_of(options, model)), average_(count_ + 1, from_, options.real("ts_max_time")) {}

void LyapunovExponents::plan(ObservationPlan& plan) {
  plan.next_times.emplace_back([](double t) { return std::nextafter(t, HUGE_VAL); });  // within every step
  RowGroup rows{"lyapunov", {"t", "time", "end of the interval of time"}, {}};
  for (std::size_t k = 1; k <= count_; ++k)
    rows.fields.push_back(
        {"rate_" + std::to_string(k), "1/time",
         "mean growth rate of tangent vector " + std::to_string(k) + " since the row before"});
  plan.layout.groups.push_back(rows);
}

void LyapunovExponents::step(const ObservedStep& step) {
  if (step.index == 0 || step.t == step.t_before) return;
  if (!measuring_ && step.t > from_) {
    measuring_ = true;
    tangents_.renew();
  }
  const double dt = step.t - step.t_before;
  tangents_.advance(dt, [&](double part, Vec into) {
    const double at = part == 1 ? step.t : std::min(step.t_before + part * dt, step.t);
    step.interpolate(at, into);
    model_.set_time(at);  // afterwards: to interpolate may take slopes at other times
  });
  std::vector<double> growth = tangents_.growth();
  if (!measuring_) return;
  judge(step.u);
  growth.push_back(tangents_.divergence());
  const std::size_t complete = average_.add(step.t_before, step.t, growth);
  for (; written_ < complete; ++written_) {
    std::vector<double> row(count_);
    for (std::size_t k = 0; k < count_; ++k) row[k] = average_.rate(written_, k);
    if (file_) file_->row("lyapunov", average_.end_of(written_), row);
  }
}

// Rate-and-state friction goes by ln psi, so that its slope needs the digits of psi however small that is.
void LyapunovExponents::judge(Vec u) {
  if (allowed_ == 0) return;
  double least = std::numeric_limits<double>::infinity();
  {
    const Reading a(u);
    for (PetscInt i = 0; i < model_.local(); ++i) {
      if (!model_.friction_law(i).steep || model_.held(model_.first() + i)) continue;
      const double *at = a + i * model_.dof(), state = model_.dof() == 3 ? at[2] : 0;
      const double slope = model_.friction(i, at[0], state).F_psi,
                   beside = model_.friction(i, at[0] + allowed_, state).F_psi;
      if (!(std::abs(beside - slope) <= largest_change_of_slope * std::abs(slope)))
        least = std::min(least, std::abs(at[0]));
    }
  }
  least = -largest_over(model_.comm(), -least);
  if (least < std::numeric_limits<double>::infinity())
    least_psi_ = least_psi_ == 0 ? least : std::min(least, least_psi_);
}

void LyapunovExponents::archive(Archive& a) {
  tangents_.archive(a);
  average_.archive("lyapunov.growth", a);
  a("lyapunov.from", from_);
  a("lyapunov.measuring", measuring_);
  a("lyapunov.written", written_);
  if (a.has("lyapunov.least")) a.list("lyapunov.least", [&](NumberList& x) { x(least_psi_); });
}

// ---- what it amounts to

void LyapunovExponents::summarise(Summary& summary, Vec u) {
  if (!u) return;
  if (!(average_.measured() > 0)) {
    warn("lyapunov_count: the run ended before lyapunov_from " + number_text(from_) +
         ", and nothing was measured");
    return;
  }
  if (least_psi_ > 0)
    warn("lyapunov_count: psi comes to " + rounded_text(least_psi_, 2) + ", where an error of ts_atol, " +
         rounded_text(allowed_, 2) +
         ", changes the slope of friction by a thousandth or more: the exponents are " +
         "not to be believed (ts_atol " + rounded_text(std::min(allowed_, least_psi_) * 1e-4, 1) +
         " or less lets ts_rtol control the error)");
  std::vector<Estimate> exponents = average_.exponents();
  const double divergence = exponents.back().value;
  exponents.pop_back();
  std::sort(exponents.begin(), exponents.end(),
            [](const Estimate& a, const Estimate& b) { return a.value > b.value; });
  Json list = Json::array();
  for (const Estimate& e : exponents)
    list.push_back(Json::object({{"value", number(e.value)}, {"error", number(e.error)}}));
  summary.set("lyapunov", list);
  summary.set("lyapunov_largest", number(exponents[0].value));
  summary.set("lyapunov_largest_error", number(exponents[0].error));
  if (const auto dimension = kaplan_yorke(exponents, std::size_t(model_.unknowns()))) {
    summary.set("lyapunov_dimension", dimension->value);
    summary.set("lyapunov_dimension_error", number(dimension->error));
  }
  if (tangents_.has_rested()) return;
  summary.set("lyapunov_divergence", divergence);
  if (PetscInt(count_) == model_.unknowns()) check_sum(exponents, divergence);
}

std::string lyapunov_words(const Summary& summary) {
  const Json& list = summary.get<Json>("lyapunov");
  if (list.is_null()) return "";
  std::string text;
  const std::size_t most = 4;  // of a longer list
  for (std::size_t k = 0; k < std::min(list.size(), most); ++k) {
    const Json &value = list[k]["value"], &error = list[k]["error"];
    text += (k ? ", " : "Lyapunov exponents ") +
            (value.is_null() ? "-infinity" : rounded_text(value.get<double>(), 3)) +
            (error.is_null() ? "" : " +- " + rounded_text(error.get<double>(), 1));
  }
  if (list.size() > most) text += ", ... (" + std::to_string(list.size()) + " in all)";
  const Json &first = list[0]["value"], &its_error = list[0]["error"];
  if (!first.is_null() && !its_error.is_null() && first.get<double>() > 3 * its_error.get<double>())
    text += ": errors double every " + rounded_text(std::log(2) / first.get<double>(), 2) + " time units";
  const Json& dimension = summary.get<Json>("lyapunov_dimension");
  if (!dimension.is_null()) text += "; dimension " + rounded_text(dimension.get<double>(), 3);
  return text;
}

namespace {
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t blocks = 16;
}  // namespace

std::size_t GrowthAverage::add(double begin, double end, const std::vector<double>& growth) {
  const auto complete = [&](double t) {
    return t > from_ && interval_ > 0 ? std::size_t((t - from_) / interval_ * (1 + 1e-12)) : 0;
  };
  for (double at = std::max(begin, from_); at < end && interval_ > 0;) {
    const std::size_t interval = complete(at);
    const double until = std::min(end, std::max(end_of(interval), std::nextafter(at, end)));
    if (sums_.size() < (interval + 1) * count_) sums_.resize((interval + 1) * count_, 0.);
    for (std::size_t k = 0; k < count_; ++k)
      sums_[interval * count_ + k] += growth[k] * ((until - at) / (end - begin));
    measured_ += until - at;
    at = until;
  }
  return complete(end);
}

std::size_t GrowthAverage::whole() const {
  const auto count = std::size_t(measured_ / interval_ * (1 + 1e-12));
  return std::min(count, sums_.size() / count_);
}

// Over `count` intervals.
double GrowthAverage::slope(std::size_t k, std::size_t first, std::size_t count) const {
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double s = (double(i) + 0.5) / double(count), weight = s * (1 - s);
    sum += weight * rate(first + i, k);
    weights += weight;
  }
  return sum / weights;
}

std::vector<Estimate> GrowthAverage::exponents() const {
  std::vector<Estimate> all(count_, Estimate{nan, nan});
  if (!(measured_ > 0)) return all;
  for (std::size_t k = 0; k < count_; ++k) {
    double sum = 0;
    for (std::size_t i = k; i < sums_.size(); i += count_) sum += sums_[i];
    const bool enough = whole() >= blocks && std::isfinite(sum);
    all[k] = {enough ? slope(k, 0, whole()) : sum / measured_, enough ? error(k) : nan};
  }
  return all;
}

double GrowthAverage::error(std::size_t k) const {
  const std::size_t length = whole() / blocks, first = whole() - blocks * length;
  std::array<double, blocks> slopes{};
  double mean = 0, squares = 0;
  for (std::size_t b = 0; b < blocks; ++b)
    mean += (slopes[b] = slope(k, first + b * length, length)) / double(blocks);
  for (const double one : slopes) squares += (one - mean) * (one - mean);
  return std::sqrt(squares / double(blocks - 1) / double(blocks));
}

std::optional<Estimate> kaplan_yorke(const std::vector<Estimate>& exponents, std::size_t unknowns) {
  double sum = 0, variance = 0;
  for (std::size_t j = 0; j < exponents.size(); ++j) {
    const Estimate& e = exponents[j];
    if (std::isnan(e.value)) return std::nullopt;
    const bool is_zero = std::abs(e.value) <= e.error;
    const double value = is_zero ? 0 : e.value;
    if (sum + value < 0) {
      if (std::isinf(value)) return Estimate{double(j), 0};
      // D = j + sum/|value|
      const double part = sum / -value, own = std::isnan(e.error) ? 0 : part * e.error / value;
      return Estimate{double(j) + part, std::sqrt(variance / (value * value) + own * own)};
    }
    sum += value;
    if (!is_zero && !std::isnan(e.error)) variance += e.error * e.error;
  }
  if (exponents.size() == unknowns) return Estimate{double(unknowns), 0};
  return std::nullopt;
}

}  // namespace stickslip
