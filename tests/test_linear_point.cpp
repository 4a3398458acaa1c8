// The linearisation of a node against what it is derived from.
#include <complex>
#include <random>

#include "catch.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/model.hpp"

using namespace stickslip;

namespace {

LinearPoint random_point(std::mt19937& draw, bool chain, bool with_state) {
  std::uniform_real_distribution<double> real(-1, 1);
  Scene s;
  s.form = chain ? Form::chain : Form::continuum;
  s.zeta = chain ? 1 + real(draw) : 0;
  s.delta = real(draw);
  s.gamma = 2 + real(draw);
  s.nu = std::max(0., real(draw));
  // one by one: the order of arguments is the compiler's
  const RatePartials g{0, real(draw), -1 - real(draw)};
  const Partials F{0, real(draw), real(draw)};
  LinearPoint p(s, F, g);
  p.has_state = with_state;
  if (!with_state) p.F_state = p.g_psi = p.g_state = 0;
  return p;
}

// det(lambda - block) by its definition, and lambda times it where a row of zeros stands for the state.
std::complex<double> determinant(const NodeBlock& b, int dof, std::complex<double> lambda) {
  double rows[9] = {};
  b.write(dof, rows);
  std::complex<double> m[3][3] = {};
  for (int i = 0; i < dof; ++i)
    for (int j = 0; j < dof; ++j) m[i][j] = (i == j ? lambda : 0.) - rows[i * dof + j];
  if (dof == 2) return m[0][0] * m[1][1] - m[0][1] * m[1][0];
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
         m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

}  // namespace

TEST_CASE(
    "A node's characteristic polynomial is the determinant of its block, and its stability that of the roots",
    "[linear_point]") {
  std::mt19937 draw(7);
  int stable = 0, unstable = 0;
  for (int k = 0; k < 400; ++k) {
    const bool with_state = k % 2;
    const LinearPoint p = random_point(draw, k % 4 < 2, with_state);
    const double kappa2 = (k % 5) * 0.7;
    const NodeBlock full = p.block(Part::full, kappa2);
    const auto [c2, c1, c0] = p.characteristic(kappa2);
    for (const std::complex<double> z : {std::complex<double>(0.3, 1.1), {-2., 0.4}, {0., 3.}}) {
      const std::complex<double> from_block = determinant(full, with_state ? 3 : 2, z);
      const std::complex<double> polynomial = with_state ? ((z + c2) * z + c1) * z + c0 : (z + c2) * z + c1;
      // some 20 roundings of 1e-16
      CHECK(std::abs(from_block - polynomial) < 1e-12 * (1 + std::abs(from_block)));
      const double a = p.A;
      std::complex<double> eliminated = z * (z / a + p.beta() + p.N * kappa2);
      if (with_state) eliminated += z * p.F_state * p.g_psi / (z + p.r());
      eliminated += p.stiffness(kappa2) + p.s_delta * p.B;
      CHECK(std::abs(eliminated * a * (with_state ? z + p.r() : 1.) - from_block) <
            1e-12 * (1 + std::abs(from_block)));
    }
    // The number of roots on the right is the turn of the polynomial along the imaginary axis, from -i R to i
    // R: a left root adds half a turn, a right one takes it.
    const int degree = with_state ? 3 : 2;
    double turn = 0;
    std::complex<double> last;
    for (int j = -4000; j <= 4000; ++j) {
      const std::complex<double> z(0, std::tan(M_PI / 2 * j / 4001.));
      const std::complex<double> now = with_state ? ((z + c2) * z + c1) * z + c0 : (z + c2) * z + c1;
      if (j > -4000) turn += std::arg(now / last);
      last = now;
    }
    const long right = std::lround((degree - turn / M_PI) / 2);
    CHECK(p.stable(kappa2) == (right == 0));
    (right == 0 ? stable : unstable)++;
  }
  CHECK(stable > 40);
  CHECK(unstable > 40);
}

TEST_CASE("With eta and the state eliminated the block's equations are solved, and those of its transpose",
          "[linear_point]") {
  std::mt19937 draw(9);
  std::uniform_real_distribution<double> real(-1, 1);
  using Complex = std::complex<double>;
  for (int k = 0; k < 200; ++k) {
    const bool with_state = k % 2;
    const LinearPoint p = random_point(draw, k % 4 < 2, with_state);
    const double kappa2 = (k % 5) * 0.7;
    const Complex lambda(real(draw), real(draw));
    NodeVector b{Complex(real(draw), real(draw)), Complex(real(draw), real(draw))};
    if (with_state) b.state = Complex(real(draw), real(draw));
    const NodeBlock J = p.block(Part::full, kappa2);
    // B and delta are never both non-zero; random_point takes both, and the equation in psi alone leaves s
    // delta B out
    const Complex S = p.diagonal(lambda) + p.stiffness(kappa2) + lambda * p.N * kappa2 + p.s_delta * p.B;
    NodeVector y = p.expand(lambda, -p.condense(lambda, b) / S, b);
    y.eta += p.N * kappa2 * y.psi;  // -N D2 psi
    CHECK(std::abs((J.psi_psi - lambda) * y.psi + J.psi_eta * y.eta + J.psi_state * y.state - b.psi) < 1e-11);
    CHECK(std::abs(J.eta_psi * y.psi + (J.eta_eta - lambda) * y.eta + J.eta_state * y.state - b.eta) < 1e-11);
    CHECK(std::abs(J.state_psi * y.psi + (J.state_state - lambda) * y.state - b.state) < 1e-11);
    const NodeVector z =
        p.expand_transposed(lambda, -(p.condense_transposed(lambda, b) + p.N * kappa2 * b.eta) / S, b);
    CHECK(std::abs((J.psi_psi - lambda) * z.psi + J.eta_psi * z.eta + J.state_psi * z.state - b.psi) < 1e-11);
    CHECK(std::abs(J.psi_eta * z.psi + (J.eta_eta - lambda) * z.eta - b.eta) < 1e-11);
    CHECK(std::abs(J.psi_state * z.psi + J.eta_state * z.eta + (J.state_state - lambda) * z.state - b.state) <
          1e-11);
    const double step = 1e-6;
    const Complex slope = (p.diagonal(lambda + step) - p.diagonal(lambda - step)) / (2 * step);
    // its third derivative times step^2, and round-off
    CHECK(std::abs(p.diagonal_slope(lambda) - slope) < 1e-7);
  }
}

TEST_CASE("Parts of a node's block add up; a wave's stiffness is the symbol times K1", "[linear_point]") {
  std::mt19937 draw(8);
  for (int k = 0; k < 40; ++k) {
    const LinearPoint p = random_point(draw, k % 4 < 2, k % 2);
    const double kappa2 = 0.3 * k;
    const auto sum = [&](Part a, Part b, double NodeBlock::*entry) {
      return p.block(a, kappa2).*entry + p.block(b, kappa2).*entry;
    };
    for (const auto entry :
         {&NodeBlock::psi_psi, &NodeBlock::psi_eta, &NodeBlock::psi_state, &NodeBlock::eta_psi,
          &NodeBlock::eta_eta, &NodeBlock::eta_state, &NodeBlock::state_psi, &NodeBlock::state_state}) {
      const double full = p.block(Part::full, kappa2).*entry;
      CHECK(sum(Part::wave, Part::reaction, entry) == Approx(full).margin(1e-14));
      const double alone = p.block(Part::pointwise).*entry;
      CHECK(p.block(Part::stencil, kappa2).*entry + alone == Approx(full).margin(1e-14));
    }
  }
}
