#include "output/maxima.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/json_values.hpp"
#include "output/forward.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

constexpr std::size_t points = 5;

const Lagrange& quartic() {
  static const Lagrange through({0, 0.25, 0.5, 0.75, 1});
  return through;
}

}  // namespace

Maxima::Maxima(const Model& model, const Scene& whole, double x, double t_end)
    : probe_(model, whole, {x}), work_(model.create_vector()), forward_(forward(whole)),
      name_(seen_from(whole, "maxima")), begin_(t_end / 2) {}

void Maxima::plan(ObservationPlan& plan) {
  // any time at all: a method that has to keep its step for interpolation keeps every one
  plan.next_times.push_back([this](double t) {
    const double next = std::nextafter(t, std::numeric_limits<double>::infinity());
    return std::max(next, begin_);
  });
}

void Maxima::step(const ObservedStep& step) {
  const double dt = step.t - step.t_before, before = last_;
  last_ = psi(step.u);
  if (step.t_before < begin_ || dt == 0) return;
  std::array<double, points> values;
  values.front() = before;
  values.back() = last_;
  for (std::size_t i = 1; i + 1 < points; ++i) {
    step.interpolate(step.t_before + dt * double(i) / double(points - 1), work_);
    values[i] = psi(work_);
  }
  const auto slope = [&](double at) { return quartic().slope(values.data(), at); };
  double low = 0, rising = slope(0) / dt;
  visit(before, slope_ > 0 && rising <= 0);  // just where two steps meet
  for (std::size_t i = 1; i < points; ++i) {
    const double high = double(i) / double(points - 1), then = slope(high) / dt;
    if (rising > 0 && then <= 0) {
      const double top = last_place([&](double at) { return slope(at) > 0; }, low, high, std::ldexp(1., -52));
      visit(quartic().value(values.data(), top), true);
    }
    visit(values[i], false);
    low = high;
    rising = then;
  }
  slope_ = rising;
}

// By the range so far, which is no larger than that of the end: what does not count now never will.
double Maxima::least_prominence() const {
  if (highest_ < lowest_) return 0;
  const double allowed = absolute_ + relative_ * std::max(std::abs(highest_), std::abs(lowest_));
  return std::max(prominence * (highest_ - lowest_), tolerances * allowed);
}

void Maxima::visit(double value, bool is_maximum) {
  highest_ = std::max(highest_, value);
  lowest_ = std::min(lowest_, value);
  const double least = least_prominence();
  if (std::isnan(candidate_)) {
    if (is_maximum && value - low_ > least)
      candidate_ = value;
    else
      low_ = std::min(low_, value);
  } else if (candidate_ - value > least) {
    maxima_.push_back(candidate_);
    lows_.push_back(low_);
    candidate_ = NAN;
    low_ = value;
  } else {
    candidate_ = std::max(candidate_, value);
  }
  if (maxima_.size() <= most) return;
  maxima_.erase(maxima_.begin());
  lows_.erase(lows_.begin());
}

std::vector<double> prominent(const std::vector<double>& maxima, const std::vector<double>& lows,
                              double last_low, double least) {
  std::vector<double> found;
  double low = lows.empty() ? last_low : lows.front();
  double top = NAN;  // a maximum that is high enough on its left side
  for (std::size_t i = 0; i < maxima.size(); ++i) {
    low = std::min(low, lows[i]);
    if (std::isnan(top) ? maxima[i] - low > least : maxima[i] >= top) top = maxima[i];
    const double after = i + 1 < maxima.size() ? lows[i + 1] : last_low;
    if (!std::isnan(top) && top - after > least) {
      found.push_back(top);
      top = NAN;
      low = after;
    }
  }
  return found;
}

void Maxima::archive(Archive& a) {
  if (!a.has(name_)) throw std::runtime_error("its maxima were not seen in the plate's direction");
  a("maxima_psi", last_);
  a("maxima_slope", slope_);
  a(name_, maxima_);
  a("maxima_lows", lows_);
  a("maxima_watch", highest_, lowest_, low_, candidate_);
}

void Maxima::summarise(Summary& summary, Vec) {
  const double least = least_prominence();
  std::vector<double> found = prominent(maxima_, lows_, low_, least);
  if (const int period = period_of(found); period >= 0) summary.set("maxima_period", period);
  for (double& one : found) one *= forward_;
  summary.set("maxima", found);
  summary.set("maxima_prominence", least);
}

int period_of(const std::vector<double>& maxima) {
  const std::size_t count = maxima.size();
  if (count < 8) return -1;
  double largest = 0;
  for (const double one : maxima) largest = std::max(largest, std::abs(one));
  for (std::size_t period = 1; period <= count / 4; ++period) {
    bool repeats = true;
    for (std::size_t i = period; i < count && repeats; ++i)
      repeats = std::abs(maxima[i] - maxima[i - period]) <= 1e-3 * largest;
    if (repeats) return int(period);
  }
  return 0;
}

}  // namespace stickslip
