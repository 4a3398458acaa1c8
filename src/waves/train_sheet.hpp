// Trains over two parameters: the surface of all trains of a family, on which one moves by a coordinate of
// its own, so that places where a parameter turns back are like any other.
//
// At each value2 the trains of a family form a curve in (z(0), q, value), q = ln T or ln sqrt(V^2 - c^2)
// (train_field.hpp). A chart measures alpha along a direction in (z(0)/scale, q), so that (alpha, value2)
// are coordinates of the surface; there `value` is a smooth function. Computed alike on every rank.
#pragma once

#include <optional>
#include <vector>

#include "stickslip/waves/train_limits.hpp"
#include "waves/train_field.hpp"

namespace stickslip {

// A train of the family: the unknowns of its equations on their mesh, `value` the last of them.
struct SheetPlace {
  std::vector<double> mesh, x;
  double value2 = 0;
  double value() const { return x.back(); }
  double q() const { return x[x.size() - 2]; }
  double z() const { return x[1]; }
};

// alpha = row . (z(0), q) - origin
struct SheetChart {
  double z = 0, q = 0, origin = 0;
  double alpha(const SheetPlace& p) const { return z * p.z() + q * p.q() - origin; }
  std::vector<double> row() const { return {z, q, 0}; }
};

class TrainSheet {
 public:
  // `value_scale`: a length in `value`, `z_scale`: that of z(0).
  TrainSheet(TrainFamily2 family, double value_scale, double z_scale)
      : family_(std::move(family)), value_scale_(value_scale), z_scale_(z_scale) {}

  SheetPlace place(const Train& train, double value, double value2) const;
  // The chart with this direction in (z(0)/scale, q), alpha = 0 at p and of unit length.
  SheetChart chart(const SheetPlace& p, double z_part, double q) const;
  // That along the trains of p's value2, on the side of the chart given.
  SheetChart along(const SheetPlace& p, const SheetChart& side) const;
  // The train at (alpha, value2), by Newton's method from `from`, on a mesh that suits it; nothing where
  // there is none.
  std::optional<SheetPlace> at(const SheetChart& chart, const SheetPlace& from, double alpha,
                               double value2) const;
  double slope(const SheetPlace& p, const SheetChart& chart) const;  // dvalue/dalpha over value_scale
  Train train(const SheetPlace& p) const;
  double z_scale() const { return z_scale_; }

 private:
  PeriodicEquations equations(const SheetPlace& p) const;
  TrainField field(double value, double value2) const { return TrainField(family_.at(value, value2)); }
  std::vector<double> tangent(const SheetPlace& p, const SheetChart& chart) const;
  TrainFamily2 family_;
  double value_scale_, z_scale_;
};

}  // namespace stickslip
