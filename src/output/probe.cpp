#include "stickslip/output/probe.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/json_values.hpp"
#include "output/measures.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

NodesAround::NodesAround(const Scene& scene) : scene_(scene), corners_(corners_of(scene)) {}

std::pair<double, double> NodesAround::range(double x) const {
  const SmoothStretch smooth = stretch_around(corners_, scene_, x);
  const double from = smooth.from / scene_.h(), to = smooth.to / scene_.h(), near = 1e-9;
  double first = std::ceil(from - near),
         last = smooth.jumps ? std::ceil(to - near) - 1 : std::floor(to + near);
  if (!scene_.ring()) first = std::max(first, 0.), last = std::min(last, double(scene_.n - 1));
  if (last - first < 2) return {-HUGE_VAL, HUGE_VAL};
  return {first, last};
}

Combination NodesAround::at(double x) const {
  const double round_off = 1e-12 * scene_.length;
  if (!(x >= -round_off && x <= scene_.length + round_off))
    throw UsageError("out_probes: x = " + number_text(x) +
                     " lies outside the scene, which reaches from 0 to " + number_text(scene_.length));
  const double at = std::clamp(x / scene_.h(), 0., double(scene_.ring() ? scene_.n : scene_.n - 1));
  const GridEnd end = scene_.ring() ? GridEnd::periodic : GridEnd::one_sided;
  Combination row = grid_interpolation(scene_.n, end, end, scene_.order + 1, at);
  if (corners_.empty() || row.size() == 1) return row;
  const auto [first, last] = range(x);
  if (!std::isfinite(first)) return row;
  const auto nodes = PetscInt(std::min(last - first + 1, double(scene_.n)));
  row = grid_interpolation(nodes, GridEnd::one_sided, GridEnd::one_sided, scene_.order + 1, at - first);
  for (auto& part : row) part.first = ((part.first + PetscInt(first)) % scene_.n + scene_.n) % scene_.n;
  return row;
}

Combination interpolation_at(const Scene& scene, double x) { return NodesAround(scene).at(x); }

FrictionAt::FrictionAt(const Scene& scene, const std::vector<double>& x) {
  FrictionPlaces places;
  for (const double at : x) {
    amplitude_.push_back(friction_amplitude_at(scene, at));
    places.push_back({at, amplitude_.back()});
  }
  if (scene.laws_differ())
    laws_ = Friction::along(scene.friction, places);
  else
    laws_ = {Friction::of(scene.friction)};
}

double FrictionAt::force(std::size_t place, double psi, double state) const {
  return amplitude_[place] * laws_[laws_.size() == 1 ? 0 : place]->force(psi, state);
}

Probes::Probes(const Model& model, const Scene& whole, const std::vector<double>& x)
    : model_(model), dof_(model.dof()) {
  const bool varies = whole.laws_differ();
  if (!varies) friction_ = Friction::of(whole.friction);
  std::vector<double> places;  // of the nodes
  const NodesAround around(whole);
  for (const double at : x) {
    const Combination combination = around.at(at);
    // a chain has nothing between its blocks
    const bool between = whole.form == Form::continuum && combination.size() > 1;
    const bool spread = between && !whole.unit_amplitude() && !varies;
    std::vector<Part> row;
    for (const auto& [node, weight] : combination) {
      const double excess =
          spread ? friction_amplitude_at(whole, at) - friction_amplitude_at(whole, whole.x(node)) : 0;
      row.push_back({nodes_.size(), weight, excess});
      nodes_.push_back(node % model.scene().n);
      places.push_back(whole.x(node));
    }
    rows_.push_back(std::move(row));
  }
  if (x.empty()) return;
  if (varies && whole.form == Form::continuum) {
    here_.emplace(whole, x);
    own_.emplace(whole, places);
  }
  fetch_.emplace(NodeFetch::Layout{model.comm(), model.local(), model.scene().n, dof_}, dof_, nodes_);
  values_.psi.resize(x.size());
  values_.eta.resize(x.size());
}

const Probes::Values& Probes::read(Vec u) {
  if (rows_.empty()) return values_;
  fetch_->take(u);
  return values_of(fetch_->values());
}

const Probes::Values& Probes::read(const std::function<void(PetscInt, double*)>& node) {
  std::vector<double> values(nodes_.size() * std::size_t(dof_));
  for (std::size_t k = 0; k < nodes_.size(); ++k) node(nodes_[k], &values[k * std::size_t(dof_)]);
  return values_of(values.data());
}

const Probes::Values& Probes::values_of(const double* a) {
  const double N = model_.normal_load(model_.time()).N, push = model_.scene().push(model_.time());
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    double psi = 0, eta = 0;
    for (const Part& part : rows_[row]) {
      const double* node = a + part.index * std::size_t(dof_);
      const double state = dof_ > 2 ? node[2] : 0;
      psi += part.weight * node[0];
      eta += part.weight * node[1];
      if (part.excess != 0) eta += part.weight * N * part.excess * friction_->force(node[0], state);
      if (here_ && rows_[row].size() > 1)
        eta +=
            part.weight * N * (here_->force(row, node[0], state) - own_->force(part.index, node[0], state));
    }
    values_.psi[row] = psi;
    values_.eta[row] = eta - push;
  }
  return values_;
}

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
