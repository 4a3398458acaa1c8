// Meshes of one period of a periodic function, and its values on them: interval by interval the left node and
// the Gauss points, d values each. Phases run from 0 = mesh[0] to mesh[N] = 1. Local to the process.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

constexpr int mesh_stages = 5;  // Gauss points an interval

// y (d values) at any phase, taken modulo 1, from values x on a mesh: at the points of `method`.
void evaluate(const Collocation& method, const std::vector<double>& mesh, const double* x, int d,
              double phase, double* y);

// The size of the derivative of order mesh_stages + 1 on each interval, each component by its own range: from
// the jumps of the derivative of order `mesh_stages` between neighbours.
std::vector<double> roughness(const std::vector<double>& mesh, const double* x, int d);

// Mesh of `intervals` intervals that carry equal shares of roughness^(1/(mesh_stages + 1)).
std::vector<double> equidistribute(const std::vector<double>& mesh, const std::vector<double>& rough,
                                   size_t intervals);

// How many intervals make the interpolation error `error` of the range, once they are spread so.
double intervals_for(const std::vector<double>& mesh, const std::vector<double>& rough, double error);

// A mesh that carries nearly equal shares already, and about as many intervals as make that error: no better
// one is needed.
bool suits(const std::vector<double>& mesh, const std::vector<double>& rough, double error);

std::vector<double> halved(const std::vector<double>& mesh);

// How many points a mesh has on which values stand.
inline std::size_t points_on(const std::vector<double>& mesh) {
  return (mesh.size() - 1) * (mesh_stages + 1);
}

// Largest less least of each of the d components of `points` values.
std::vector<double> ranges(const double* x, std::size_t points, int d);

// Of one component at all points: its value `part` of the way through an interval, and its largest (sign 1)
// or least (-1) over the period, between the points too.
double value_within(const std::vector<double>& values, std::size_t interval, double part);
double extremum(const std::vector<double>& values, int sign);

// Periodic solutions of smooth systems y' = f(y; lambda) as a boundary-value problem: collocation at five
// Gauss points an interval, Newton's method, Floquet multipliers. A system may depend on the phase too
// (forcing), with a period that is known.
//
// In phase p = t/T the unknowns are y at the left node and the Gauss points of each interval, one number q
// (ln T, unless the system says otherwise) and, on a branch, the parameter lambda:
//     Y_j - y_i - h T sum_k a_jk f(Y_k) = 0,      y_{i+1} = the polynomial through y_i and Y at the right
//                                                 end,
// y_N = y_0, and one linear condition on (y_0, q, lambda) for each of q and lambda. A step of Newton's method
// eliminates the Gauss points of each interval, then the nodes from the left by orthogonal transformations
// (CyclicChain), which is stable however strongly deviations grow or decay on the way.
//
// Source: U. M. Ascher, R. M. M. Mattheij, R. D. Russell, Numerical Solution of Boundary Value Problems, SIAM
// 1995, chapters 5 and 7. Local to the process.
class VectorField {
 public:
  virtual ~VectorField() = default;
  virtual int dim() const = 0;
  virtual int band() const { return dim() - 1; }  // df_i/dy_j = 0 for |i - j| > band
  virtual void rates(const double* y, double* f) const = 0;
  // The same at a phase, where they depend on it.
  virtual void rates_at(double phase, const double* y, double* f) const {
    static_cast<void>(phase);
    rates(y, f);
  }
  virtual void jacobian(const double* y, double* J) const = 0;  // all dim x dim entries, row-major
  virtual void jacobian_at(double phase, const double* y, double* J) const {
    static_cast<void>(phase);
    jacobian(y, J);
  }
  // Changes Newton's step dy at y where the rates are too steep for it; y is to obey y - h f(y) = given,
  // about.
  virtual void safeguard_step(double phase, const double* y, double h, double* dy) const {
    static_cast<void>(phase), static_cast<void>(y), static_cast<void>(h), static_cast<void>(dy);
  }

  // What else a system may say. Where its rates depend on q: itself at that q, to which all below belongs.
  virtual std::shared_ptr<const VectorField> at(double q) const { return static_cast<void>(q), nullptr; }
  struct Period {
    double T, slope;  // dT/dq
  };
  virtual Period period(double q) const { return {std::exp(q), std::exp(q)}; }
  // slope += d(rates)/dq at y, where the rates are f.
  virtual void add_slope(const double* y, const double* f, double* slope) const {
    static_cast<void>(y), static_cast<void>(f), static_cast<void>(slope);
  }
  // Added to the right-hand side of the first condition, that of the phase.
  virtual double anchor() const { return 0; }
  // What a component of y is measured by, a power of two: a change is small beside it.
  virtual double unit(int) const { return 1; }
  // The component of a rate so fast that the residual of its stages says little of y: weighted with
  // 1/(1 + h rate).
  struct Stiff {
    int component;
    double rate;
  };
  virtual Stiff stiff() const { return {0, 0}; }
};
using SharedField = std::shared_ptr<const VectorField>;
using FieldFamily = std::function<SharedField(double lambda)>;

// y0 . y_0 + q q + lambda lambda = right.
struct Condition {
  std::vector<double> y0;
  double q = 0, lambda = 0, right = 0;
};

// The matrices by which a linear system y' = J(t) y carries deviations over the intervals of a mesh, grouped
// so that none grows by much within a group: what is left of a period for eigenvalues.
template <class T>
struct Pencil {
  std::vector<T> first, last;  // first y_0 + last y_N = 0
};

class PeriodicEquations {
 public:
  PeriodicEquations(std::vector<double> mesh, SharedField field);
  // With lambda as an unknown; its derivatives by differences over 1e-6 `scale` to either side.
  PeriodicEquations(std::vector<double> mesh, FieldFamily family, double lambda, double scale);

  // The same on another mesh, near x.
  PeriodicEquations on(std::vector<double> mesh, const std::vector<double>& x) const {
    return family_ ? PeriodicEquations(std::move(mesh), family_, lambda(x), scale_)
                   : PeriodicEquations(std::move(mesh), field_);
  }

  int parameters() const { return family_ ? 2 : 1; }
  std::size_t block() const { return d_ * (mesh_stages + 1); }
  std::size_t size() const { return n_ * block() + parameters(); }
  const std::vector<double>& mesh() const { return mesh_; }
  int dim() const { return d_; }
  const VectorField& field() const { return *field_; }

  // The unknowns of a profile, which writes y at a phase; lambda, if it is one, is that of the constructor.
  // Or those of a solution on another mesh.
  std::vector<double> fill(const std::function<void(double phase, double* y)>& profile, double q) const;
  std::vector<double> fill(const PeriodicEquations& from, const std::vector<double>& x) const;
  double q(const std::vector<double>& x) const { return x[n_ * block()]; }
  double lambda(const std::vector<double>& x) const { return family_ ? x[n_ * block() + 1] : lambda_; }
  void at(const std::vector<double>& x, double phase, double* y) const;
  // A step dx in units of the components, of a family's parameter in those of its scale.
  std::vector<double> in_units(std::vector<double> dx) const;
  void jacobian(const std::vector<double>& x, const double* y, double* J) const {
    at_number(field_, q(x))->jacobian(y, J);
  }

  struct Step {
    double residual = 0;  // the largest, before it
    std::vector<double> dx;
  };
  // Newton's step at x. Throws Failure where the equations are singular, Error of the family.
  Step step(const std::vector<double>& x, const std::vector<Condition>& conditions);
  // The direction in which a solution may move at x: `rows` as conditions with right-hand sides 0 but for the
  // last's, 1.
  std::vector<double> tangent(const std::vector<double>& x, const std::vector<Condition>& rows);
  // Solves from x. The last step's size tells how far round-off lets the answer be known; that of q in
  // `q_step`.
  struct Newton {
    bool converged = false;
    double last_step = -1, q_step = 0, residual = 0;

    // After the step dx, in units of the components, whose last entries are the `numbers` sought: is the
    // solution there? Converged by the step: the residual cannot fall below the round-off of stiff
    // intervals. In a front of width w (in phase) y cannot be known better than 1e-16/w, so that there the
    // numbers decide.
    bool took(const std::vector<double>& dx, std::size_t numbers);
  };
  Newton newton(std::vector<double>& x, const std::vector<Condition>& conditions, int most = 20);

 private:
  struct Linear;
  Linear linear(const std::vector<double>& x, bool zero_right);
  std::vector<double> closed(const Linear& system, const std::vector<Condition>& conditions,
                             const std::vector<double>& rights) const;
  void set_lambda(double lambda);
  static SharedField at_number(const SharedField& field, double q) {
    SharedField there = field->at(q);
    return there ? there : field;
  }

  std::vector<double> mesh_;
  SharedField field_, lower_, upper_;  // at lambda, and a little beside it
  FieldFamily family_;
  double lambda_ = 0, scale_ = 0, width_ = 0;
  int d_;
  std::size_t n_;
};

// The stage equations (1 - h a (x) J) Y = R of one step of y' = J y over h by collocation, in place: R has
// `columns` right-hand sides, row by row, stage by stage. J and what is thrown as below.
void solve_stages(const Collocation& method, int d, int band, double h, const double* J, int columns,
                  std::vector<double>& R);

// One step of y' = J y over h by collocation: the d x d matrix that carries y over it. J: at the five points
// of `method`, d x d each, of half band `band`. Throws Failure where it is singular.
std::vector<double> carried(const Collocation& method, int d, int band, double h, const double* J);

// From the matrices of all intervals in turn.
template <class T>
Pencil<T> pencil_of(int d, const std::vector<T>& matrices);

// Floquet multipliers, largest first.
template <class T>
std::vector<std::complex<double>> multipliers_of(int d, const Pencil<T>& pencil);

}  // namespace stickslip
