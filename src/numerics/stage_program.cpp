#include "numerics/stage_program.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <numeric>

namespace stickslip {

double StageProgram::diagonal() const {
  for (int i = 0; i < stages && additive(); ++i)
    if (At[i * (stages + 1)] != 0) return At[i * (stages + 1)];
  return 0;
}

double StageProgram::time(int stage) const {
  const double* const row = &(additive() ? At : A)[stage * stages];
  return std::accumulate(row, row + stage + 1, 0.);
}

bool StageProgram::ends_at_last_stage() const {
  const std::vector<double>& new_u = additive() ? bt : b;
  const double* const last = &(additive() ? At : A)[(stages - 1) * stages];
  return std::equal(new_u.begin(), new_u.end(), last, [](double x, double y) { return is_no_weight(x - y); });
}

std::vector<double> StageProgram::lacking() const {
  std::vector<double> of_f = b;
  for (int j = 0; j < stages && ends_at_last_stage(); ++j) of_f[j] -= A[(stages - 1) * stages + j];
  return of_f;
}

namespace {
std::vector<double> difference(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> all;
  for (std::size_t j = 0; j < b.size(); ++j) all.push_back(a[j] - b[j]);
  return all;
}
}  // namespace

std::vector<double> StageProgram::error_of_f() const { return difference(b, embedded); }
std::vector<double> StageProgram::error_of_g() const { return difference(bt, embedded_t); }

std::vector<double> propagator(const StageProgram& method, int dim, const std::vector<double>& of_f,
                               const std::vector<double>& of_g, double dt) {
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Matrix> F(of_f.data(), dim, dim), G(of_g.data(), dim, dim);
  const Matrix one = Matrix::Identity(dim, dim);
  std::vector<Matrix> f, g;
  const auto sum = [&](const double* a, const double* at) {  // of the slopes so far
    Matrix y = one;
    for (std::size_t j = 0; j < f.size(); ++j) y += dt * (a[j] * f[j] + (at ? at[j] : 0) * g[j]);
    return y;
  };
  for (int i = 0; i < method.stages; ++i) {
    const double* const at = method.additive() ? &method.At[i * method.stages] : nullptr;
    Matrix y = sum(&method.A[i * method.stages], at);
    if (at) y = (one - dt * at[i] * G).partialPivLu().solve(y).eval();
    f.push_back(F * y);
    g.push_back(G * y);
  }
  const Matrix P = sum(method.b.data(), method.additive() ? method.bt.data() : nullptr);
  return {P.data(), P.data() + P.size()};
}

}  // namespace stickslip
