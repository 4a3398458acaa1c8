#include "numerics/stage_program.hpp"

#include <Eigen/Dense>

namespace stickslip {

double StageProgram::diagonal() const {
  for (int i = 0; i < stages && additive(); ++i)
    if (At[i * (stages + 1)] != 0) return At[i * (stages + 1)];
  return 0;
}

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
