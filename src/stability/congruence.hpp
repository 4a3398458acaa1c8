// The wide part of a stencil taken off, row by row (argument_principle.hpp). Local to the process.
#pragma once

#include <array>

#include "numerics/chebyshev.hpp"

namespace stickslip::stretches {

using namespace chebyshev;

// The stencil of half-width b on the nodes of a line, in units of K1/h^2: S = -D2 + eps_i. Its wide part is
// taken off by the congruence S = U M U^T, M tridiagonal and U unit upper triangular with b - 1 diagonals
// above, row by row from the right: what came before fades by a constant factor at every row, as the
// stencil's own solutions do. With t = U^T 1 and z = U^-1 eps the rows of diag(t) M diag(t) sum to t_k z_k,
// small and free of cancellation.
constexpr int widest = 4;  // half-width, of the stencil of order 8
struct Row {
  Values u[widest];   // u[m] = U_{i,i+m}, u[0] unused
  Values e, inverse;  // M_{i,i+1} and 1/e
  Values d, z;        // M_{i,i}
  Values t;           // known b - 1 rows later
  Values g[widest];   // (M U^T)_{i+m,i}
};

class Sweep {
 public:
  Sweep(int half_width, const std::array<double, 5>& w) : b_(half_width), w_(w) {}
  Row& operator[](long i) { return row_[i & 7]; }

  // Rows right of `next` as if nothing coupled them: forgotten after some rows.
  void start(long next, const Values& eps) {
    for (long i = next + b_; i > next; --i) {
      Row& r = (*this)[i];
      for (int m = 0; m < b_; ++m) set(r.u[m], 0);
      set(r.e, -w_[1]);
      set(r.inverse, -1 / w_[1]);
      set(r.t, 1);
      r.z = r.d = eps;
      for (int j = 0; j < P; ++j) r.d.re[j] -= w_[0];
      finish(i);
    }
  }
  void step(long i, const Values& eps) {
    Row& r = (*this)[i];
    for (int m = b_ - 1; m >= 1; --m) {
      set(r.u[m], -w_[m + 1]);
      for (int k = m + 1; k < b_; ++k) add_product(r.u[m], r.u[k], (*this)[i + m + 1].g[k - m - 1], -1);
      multiply(r.u[m], (*this)[i + m].inverse);
    }
    set(r.e, -w_[1]);
    r.z = r.d = eps;
    for (int j = 0; j < P; ++j) r.d.re[j] -= w_[0];
    for (int m = 1; m < b_; ++m) {
      add_product(r.e, r.u[m], (*this)[i + 1].g[m - 1], -1);
      add_product(r.z, r.u[m], (*this)[i + m].z, -1);
    }
    for (int m = 1; m < b_; ++m) {
      Values part;  // what u_m is multiplied with in S_ii
      set(part, 0);
      add_product(part, r.u[m], (*this)[i + m].d, -1);
      if (m > 1) add_product(part, r.u[m - 1], (*this)[i + m - 1].e, -2);
      for (int j = 0; m == 1 && j < P; ++j) part.re[j] -= 2 * r.e.re[j], part.im[j] -= 2 * r.e.im[j];
      add_product(r.d, part, r.u[m]);
    }
    if (b_ == 1) set(r.t, 1);
    if (b_ > 1) {
      r.inverse = r.e;
      invert(r.inverse);
      Values& t = (*this)[i + b_ - 1].t;
      set(t, 1);
      for (int m = 1; m < b_; ++m)
        for (int j = 0; j < P; ++j) {
          t.re[j] += (*this)[i + b_ - 1 - m].u[m].re[j];
          t.im[j] += (*this)[i + b_ - 1 - m].u[m].im[j];
        }
    }
    finish(i);
  }

 private:
  void finish(long i) {
    Row& r = (*this)[i];
    for (int m = 0; m + 1 < b_; ++m) {
      set(r.g[m], 0);
      if (m == 0) r.g[m] = r.d;
      if (m == 1) r.g[m] = r.e;
      if (m > 1) add_product(r.g[m], r.u[m - 1], (*this)[i + m - 1].e);
      if (m > 0) add_product(r.g[m], r.u[m], (*this)[i + m].d);
      add_product(r.g[m], r.u[m + 1], (*this)[i + m].e);
    }
  }

  const int b_;
  std::array<double, 5> w_;
  std::array<Row, 8> row_;
};

// Rows after which a start of the sweep is forgotten to all digits, by half-width (the stencils' own
// solutions fade by 0.07 a node at order 4, 0.1 at 6, 0.13 at 8, where the waves do not fade).
constexpr int rows_to_forget[widest] = {0, 16, 18, 22};

}  // namespace stickslip::stretches
