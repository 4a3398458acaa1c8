// A train in the frame that moves with it, as a periodic solution of a system: what of it is fixed, and the
// one number that is sought with it.
//
// The system is that of model/oscillator.hpp, y = (f, z[, s]). Alike on every rank.
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "numerics/mesh_solve.hpp"
#include "stickslip/numerics/periodic_equations.hpp"
#include "stickslip/waves/train.hpp"
#include "stickslip/waves/train_limits.hpp"

namespace stickslip {

// The number sought is q = ln T where the speed is given, q = ln sqrt(V^2 - c^2) where the length is; then T
// = L/(n V), and the rates depend on q. The phase: f = v at 0.
class TrainField : public VectorField {
 public:
  TrainField(const Scene& scene, const TrainRequest& request)
      : TrainField(std::make_shared<const Oscillator>(scene), request) {}
  // The train of a case which has trains at all; Failure for others.
  explicit TrainField(const TrainCase& asked);
  TrainField(std::shared_ptr<const Oscillator> oscillator, const TrainRequest& request);

  // That of a number q; speed() and r2() and all rates are known of it, or where the speed is given.
  TrainField placed(double q) const;
  double number_of(const Train& train) const;

  const std::shared_ptr<const Oscillator>& oscillator() const { return oscillator_; }
  const TrainRequest& request() const { return request_; }
  double speed() const { return speed_; }  // |V|
  double r2() const { return r2_; }

  int dim() const override { return oscillator_->dim(); }
  void rates(const double* y, double* f) const override { oscillator_->rhs(r2_, y, f, nullptr); }
  void jacobian(const double* y, double* J) const override {
    double f[train_max_dim];
    oscillator_->rhs(r2_, y, f, J);
  }
  SharedField at(double q) const override {
    return request_.speed ? nullptr : std::make_shared<const TrainField>(placed(q));
  }
  Period period(double q) const override;
  void add_slope(const double* y, const double* f, double* slope) const override;
  double anchor() const override { return oscillator_->v(); }
  double unit(int component) const override { return oscillator_->scale(component); }
  Stiff stiff() const override;

 private:
  std::shared_ptr<const Oscillator> oscillator_;
  TrainRequest request_;
  double speed_ = 0, r2_ = 0, speed_q_ = 0, r2_q_ = 0;
};

using TrainSolution = MeshSolution<PeriodicEquations>;
using SharedTrain = std::shared_ptr<const TrainField>;

// f(0) = v; on a branch beside it row . (z(0), q, lambda) = right.
std::vector<Condition> train_conditions(int dim);
std::vector<Condition> train_conditions(int dim, const std::vector<double>& row, double right);
// Throws UsageError where neighbours resist each other: the equation of a train is of third order then.
void refuse_viscosity(const Scene& scene);
// The trains of a family.
FieldFamily fields_of(std::function<TrainCase(double)> cases);

// All unknowns of a train by phase; as long as it lives.
std::function<void(double, double*)> profile_of(const Train& train);
// The train of a solution; its residual and errors stay 0.
Train pack(const TrainField& field, const TrainSolution& solution);

// Newton's method in at most so many steps; false where it does not converge.
bool newton(TrainSolution& s, const std::vector<Condition>& conditions, int most = 20);
// The same for the phase alone; false, too, where the equations are singular or not finite.
bool solve_train_on_mesh(TrainSolution& s);
// As good as asked for, from a solution; nothing where Newton's method does not converge on finer meshes.
std::optional<Train> train_to_accuracy(TrainSolution start, double tolerance, const std::string& what);

// Trains over two parameters: the surface of all trains of a family, on which one moves by a coordinate of
// its own, so that places where a parameter turns back are like any other.
//
// At each value2 the trains of a family form a curve in (z(0), q, value), q = ln T or ln sqrt(V^2 - c^2)
// (train_field.hpp). A chart measures alpha along a direction in (z(0)/scale, q), so that (alpha, value2)
// are coordinates of the surface; there `value` is a smooth function. Computed alike on every rank.

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
