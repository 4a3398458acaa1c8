#include "stickslip/numerics/collocation.hpp"

#include <petscdt.h>

#include "numerics/matrix.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

// The n zeros of the Jacobi polynomial P^(alpha, 0) and the weights of their quadrature, taken over to [0,
// 1].
void jacobi(int n, double alpha, std::vector<double>& points, std::vector<double>& weights) {
  points.resize(n);
  weights.resize(n);
  SS_TRY(PetscDTGaussJacobiQuadrature(n, -1, 1, alpha, 0, points.data(), weights.data()));
  for (double& x : points) x = (1 + x) / 2;
  for (double& w : weights) w /= 2;
}

// The integrals of l_j by Gauss's rule of s points, which is exact for them.
Tableau tableau(const std::vector<double>& c) {
  const std::size_t s = c.size();
  Tableau t{int(s), c, std::vector<double>(s * s), std::vector<double>(s)};
  const Lagrange basis(c);
  std::vector<double> points, weights, l(s);
  jacobi(int(s), 0, points, weights);
  const auto integrate = [&](double to, double* row) {
    for (std::size_t m = 0; m < s; ++m) {
      basis.weights(to * points[m], l.data());
      for (std::size_t j = 0; j < s; ++j) row[j] += to * weights[m] * l[j];
    }
  };
  for (std::size_t i = 0; i < s; ++i) integrate(c[i], &t.a[i * s]);
  integrate(1, t.b.data());
  return t;
}

}  // namespace

Tableau Tableau::gauss(int s) {
  std::vector<double> c, weights;
  jacobi(s, 0, c, weights);
  return tableau(c);
}

Tableau Tableau::radau(int s) {
  std::vector<double> c, weights;
  jacobi(s - 1, 1, c, weights);
  c.push_back(1);
  return tableau(c);
}

Collocation::Collocation(const Tableau& tableau)
    : Tableau(tableau), basis([&] {
        std::vector<double> points{0};
        points.insert(points.end(), tableau.c.begin(), tableau.c.end());
        return points;
      }()),
      end(tableau.c.size() + 1), a2(a.size()) {
  basis.weights(1, end.data());
  const auto integrals = as_matrix(a.data(), s, s);
  as_matrix(a2.data(), s, s) = integrals.lazyProduct(integrals);
}

const Collocation& Collocation::gauss5() {
  static const Collocation method(Tableau::gauss(5));
  return method;
}

const Collocation& Collocation::radau5() {
  static const Collocation method(Tableau::radau(5));
  return method;
}

}  // namespace stickslip
