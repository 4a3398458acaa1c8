#include "waves/train_sheet.hpp"

#include <algorithm>
#include <cmath>

#include "numerics/mesh_solve.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

TrainEquations TrainSheet::equations(const SheetPlace& p) const {
  const auto family = [at = family_.at, value2 = p.value2](double value) {
    return setting_of(at(value, value2));
  };
  return {family, value_scale_, p.mesh, p.q(), p.value()};
}

SheetPlace TrainSheet::place(const Train& train, double value, double value2) const {
  const double q = setting_of(family_.at(value, value2)).number_of(train);
  SheetPlace p{train.mesh, {0, 0, q, value}, value2};
  p.x = equations(p).fill(train, q);
  p.x.back() = value;
  return p;
}

SheetChart TrainSheet::chart(const SheetPlace& p, double z_part, double q) const {
  const double length = std::hypot(z_part, q);
  SheetChart chart{z_part / length / z_scale_, q / length, 0};
  chart.origin = chart.alpha(p);
  return chart;
}

std::vector<double> TrainSheet::tangent(const SheetPlace& p, const SheetChart& chart) const {
  return equations(p).tangent(p.x, chart.row());
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
    MeshSolution<TrainEquations> s{equations(start), start.x};
    s.equations.condition(chart.row(), alpha + chart.origin);
    solve_on_suiting_mesh([](auto& at) { return newton(at.equations, at.x, nullptr, 12); }, {1e-10, 60}, s);
    return SheetPlace{s.mesh(), s.x, value2};
  } catch (const Error&) {
    return std::nullopt;
  }
}

Train TrainSheet::train(const SheetPlace& p) const { return pack(equations(p), p.x); }

}  // namespace stickslip
