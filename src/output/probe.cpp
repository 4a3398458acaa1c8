#include "stickslip/output/probe.hpp"

#include <algorithm>
#include <cmath>

#include "base/local_values.hpp"
#include "stickslip/numerics/collocation.hpp"

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

}  // namespace stickslip
