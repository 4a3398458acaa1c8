#include "waves/train_sheet.hpp"

#include <algorithm>
#include <cmath>

#include "numerics/mesh_solve.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

TrainEquations TrainSheet::equations(const SheetPlace& p, const SheetChart& chart, double alpha) const {
  const auto family = [at = family_.at, value2 = p.value2](double value) {
    return setting_of(at(value, value2));
  };
  TrainEquations problem(family(p.value()), p.mesh, p.q());
  problem.extend(family, value_scale_, {chart.z, chart.q, 0}, alpha + chart.origin);
  return problem;
}

SheetPlace TrainSheet::place(const Train& train, double value, double value2) const {
  const double q = setting_of(family_.at(value, value2)).number_of(train);
  SheetPlace p{train.mesh, {0, 0, q, value}, value2};
  p.x = equations(p, {}, 0).fill(train, q);
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
  TrainEquations problem = equations(p, chart, 0);
  problem.linearise(p.x.data());
  std::vector<double> rhs(p.x.size()), t(p.x.size());
  rhs.back() = 1;
  problem.solve(rhs.data(), t.data());
  return t;
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
  using Solution = MeshSolution<TrainEquations>;
  const auto on = [&](std::vector<double> mesh, const std::vector<double>& x) {
    return equations({std::move(mesh), x, value2}, chart, alpha);
  };
  const MeshSolver<TrainEquations> solver{
      [&](std::vector<double> mesh, const Solution& near) { return on(std::move(mesh), near.x); },
      [](Solution& s) { return newton(s.equations, s.x, nullptr, 12); }};
  try {
    Solution s{on(from.mesh, from.x), from.x};
    solve_on_suiting_mesh(solver, {1e-10, 60}, s);
    return SheetPlace{s.mesh(), s.x, value2};
  } catch (const Error&) {
    return std::nullopt;
  }
}

Train TrainSheet::train(const SheetPlace& p) const { return pack(equations(p, {}, 0), p.x); }

}  // namespace stickslip
