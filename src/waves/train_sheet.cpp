#include "waves/train_sheet.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"

namespace stickslip {

PeriodicEquations TrainSheet::equations(const SheetPlace& p) const {
  const auto cases = [at = family_.at, value2 = p.value2](double value) { return at(value, value2); };
  return {p.mesh, fields_of(cases), p.value(), value_scale_};
}

SheetPlace TrainSheet::place(const Train& train, double value, double value2) const {
  const double q = field(value, value2).number_of(train);
  SheetPlace p{train.mesh, {0, 0, q, value}, value2};
  p.x = equations(p).fill(profile_of(train), q);
  return p;
}

SheetChart TrainSheet::chart(const SheetPlace& p, double z_part, double q) const {
  const double length = std::hypot(z_part, q);
  SheetChart chart{z_part / length / z_scale_, q / length, 0};
  chart.origin = chart.alpha(p);
  return chart;
}

std::vector<double> TrainSheet::tangent(const SheetPlace& p, const SheetChart& chart) const {
  PeriodicEquations there = equations(p);
  return there.tangent(p.x, train_conditions(there.dim(), chart.row(), 0));
}

SheetChart TrainSheet::along(const SheetPlace& p, const SheetChart& side) const {
  const std::vector<double> t = tangent(p, side);
  return chart(p, t[1] / z_scale_, t[t.size() - 2]);
}

double TrainSheet::slope(const SheetPlace& p, const SheetChart& chart) const {
  return tangent(p, chart).back() / value_scale_;
}

std::optional<SheetPlace> TrainSheet::at(const SheetChart& chart, const SheetPlace& from, double alpha,
                                         double value2) const {
  try {
    const SheetPlace start{from.mesh, from.x, value2};
    TrainSolution s{equations(start), start.x};
    const auto conditions = train_conditions(s.equations.dim(), chart.row(), alpha + chart.origin);
    solve_on_suiting_mesh([&](auto& at) { return newton(at, conditions, 12); }, {1e-10, 60}, s);
    return SheetPlace{s.mesh(), s.x, value2};
  } catch (const Error&) {
    return std::nullopt;
  }
}

Train TrainSheet::train(const SheetPlace& p) const {
  return pack(field(p.value(), p.value2), {equations(p), p.x});
}

}  // namespace stickslip
