#include "cycles/profile.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

using std::size_t;

// Place of the field's k-th node among all that are solved for, from left to right.
size_t place(const CellField& field, size_t k) {
  return size_t(field.node(k) - (field.scene().left == End::velocity ? 1 : 0));
}

// Friction smoothed over eps is that of a node at rest, to 1e-3 of the threshold, where |psi| is below this
// many eps.
constexpr double rest_in_eps = 4;

// A linear functional of y along a profile: its polynomials between the points of a mesh.
class Trace {
 public:
  Trace(const std::vector<double>& mesh, const std::vector<double>& values, size_t d,
        std::vector<double> weights)
      : mesh_(mesh), points_(mesh_stages + 1) {
    for (size_t i = 0; i < values.size() / d; ++i) {
      double sum = 0;
      for (size_t a = 0; a < d; ++a) sum += weights[a] * values[i * d + a];
      at_.push_back(sum);
    }
  }
  size_t intervals() const { return mesh_.size() - 1; }
  double extremum(int sign) const { return stickslip::extremum(at_, sign); }
  // Part of the period in which |value| < bound; two crossings between neighbouring points are not seen.
  double share_below(double bound) const {
    double share = 0;
    const std::vector<double>& points = Collocation::gauss5().basis.points();
    for (size_t i = 0; i < intervals(); ++i)
      for (size_t j = 0; j < points_; ++j) {
        const double begin = points[j], end = j + 1 < points_ ? points[j + 1] : 1;
        share += (mesh_[i + 1] - mesh_[i]) * length_below(bound, i, begin, end);
      }
    return share;
  }

 private:
  double length_below(double bound, size_t i, double begin, double end) const {
    const auto excess = [&](double part) { return std::abs(value_within(at_, i, part)) - bound; };
    const double a = excess(begin), b = excess(end);
    if (a < 0 && b < 0) return end - begin;
    if (a >= 0 && b >= 0) return 0;
    const double crossing = find_root(excess, {begin, a, end, b}, 1e-9);
    return a < 0 ? crossing - begin : end - crossing;
  }

  const std::vector<double>& mesh_;
  size_t points_;
  std::vector<double> at_;
};

}  // namespace

std::vector<double> in_band_order(const CellField& field, const double* natural) {
  const size_t dof = size_t(field.dof()), width = size_t(field.width());
  std::vector<double> y(size_t(field.dim()));
  for (size_t k = 0; k < field.nodes(); ++k)
    std::copy_n(natural + place(field, k) * dof + (dof - width), width, &y[k * width]);
  return y;
}

void unfold(const CellField& field, const double* y, double* natural) {
  const size_t dof = size_t(field.dof());
  for (size_t k = 0; k < field.nodes(); ++k) field.numbers(y, k, natural + place(field, k) * dof);
}

Cycle cycle_of(const CellField& field, const std::vector<double>& mesh, const std::vector<double>& values,
               double period) {
  const size_t dof = size_t(field.dof()), nodes = field.nodes(), d = nodes * dof,
               width = size_t(field.dim());
  Cycle cycle;
  cycle.nodes = PetscInt(nodes);
  cycle.dof = field.dof();
  cycle.period = period;
  cycle.forcing_periods = field.periods();
  const std::vector<double>& points = Collocation::gauss5().basis.points();
  for (size_t i = 0; i + 1 < mesh.size(); ++i)
    for (const double part : points)
      cycle.times.push_back(period * (mesh[i] + (mesh[i + 1] - mesh[i]) * part));
  std::vector<double> all(cycle.times.size() * d);  // what there is of each node, in the order of the field
  for (size_t k = 0; k < cycle.times.size(); ++k)
    for (size_t node = 0; node < nodes; ++node)
      field.numbers(&values[k * width], node, &all[k * d + node * dof]);
  std::vector<double> shown(all);  // without the harmonic force
  for (size_t k = 0; k < cycle.times.size(); ++k)
    for (size_t node = 0; node < nodes; ++node)
      shown[k * d + node * dof + 1] -= field.scene().push(cycle.times[k]);
  cycle.states.resize((cycle.times.size() + 1) * d);
  for (size_t k = 0; k < cycle.times.size(); ++k)
    for (size_t node = 0; node < nodes; ++node)
      std::copy_n(&shown[k * d + node * dof], dof, &cycle.states[k * d + place(field, node) * dof]);
  std::copy_n(cycle.states.begin(), d, cycle.states.end() - long(d));
  cycle.times.push_back(period);
  measure(cycle);
  const bool rests = field.scene().friction.regularised && field.scene().friction.jumps_at_rest();
  double range = 0, rest = 0;
  for (size_t k = 0; k < nodes; ++k) {
    std::vector<double> psi(d);
    psi[k * dof] = 1;
    const Trace trace(mesh, all, d, psi);
    const double low = trace.extremum(-1), high = trace.extremum(1);
    cycle.psi_min = std::min(cycle.psi_min, low);
    cycle.psi_max = std::max(cycle.psi_max, high);
    range = std::max(range, high - low);
    if (rests) rest += trace.share_below(rest_in_eps * field.scene().friction.eps) / double(nodes);
  }
  cycle.amplitude = range / 2;
  cycle.rest_fraction = rest;
  std::vector<double> mean_eta(d);
  for (size_t k = 0; k < nodes; ++k) mean_eta[k * dof + 1] = 1 / double(nodes);
  const Trace force(mesh, shown, d, mean_eta);
  cycle.force_drop = force.extremum(1) - force.extremum(-1);
  return cycle;
}

}  // namespace stickslip
