#include "stickslip/phase_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "kernel.hpp"
#include "stickslip/error.hpp"
#include "stickslip/stencil.hpp"

namespace stickslip {

namespace {

constexpr int P = 16;          // values of every function on a piece, at Chebyshev points
constexpr double settled = 1e-11;  // largest last coefficient of a function that counts as known on its piece

// Values of a function at the Chebyshev points of a piece; real and imaginary parts apart, so that loops vectorise.
struct Values {
  double re[P], im[P];
};
inline void set(Values& x, Complex c) {
  for (int j = 0; j < P; ++j) x.re[j] = c.real(), x.im[j] = c.imag();
}
inline void add_product(Values& out, const Values& a, const Values& b) {
  for (int j = 0; j < P; ++j) {
    out.re[j] += a.re[j] * b.re[j] - a.im[j] * b.im[j];
    out.im[j] += a.re[j] * b.im[j] + a.im[j] * b.re[j];
  }
}
inline void add(Values& out, const Values& a, double factor) {
  for (int j = 0; j < P; ++j) out.re[j] += factor * a.re[j], out.im[j] += factor * a.im[j];
}
inline void multiply(Values& x, const Values& a) {
  for (int j = 0; j < P; ++j) {
    const double re = x.re[j] * a.re[j] - x.im[j] * a.im[j];
    x.im[j] = x.re[j] * a.im[j] + x.im[j] * a.re[j];
    x.re[j] = re;
  }
}
inline void invert(Values& x) {
  for (int j = 0; j < P; ++j) {
    const double d = 1 / (x.re[j] * x.re[j] + x.im[j] * x.im[j]);
    x.re[j] *= d;
    x.im[j] *= -d;
  }
}

// Chebyshev points (first kind) on [-1, 1], interpolation to those of either half, the last two coefficients, weights of
// the barycentric formula.
struct Chebyshev {
  double x[P], half[2][P][P], tail[2][P], weight[P];  // half[side][i]: what the value at i gives to every point
  Chebyshev() {
    const auto coefficient = [&](int k, int i) {
      return (k == 0 ? 1. : 2.) / P * std::cos(k * (2 * i + 1) * M_PI / (2 * P));
    };
    for (int i = 0; i < P; ++i) {
      x[i] = std::cos((2 * i + 1) * M_PI / (2 * P));
      weight[i] = (i % 2 ? -1 : 1) * std::sin((2 * i + 1) * M_PI / (2 * P));
      for (int k = 0; k < 2; ++k) tail[k][i] = coefficient(P - 1 - k, i);
    }
    for (int side = 0; side < 2; ++side)
      for (int j = 0; j < P; ++j)
        for (int i = 0; i < P; ++i) {
          const double at = (x[j] + (side ? 1 : -1)) / 2;
          half[side][i][j] = 0;
          for (int k = 0; k < P; ++k) half[side][i][j] += coefficient(k, i) * std::cos(k * std::acos(at));
        }
  }
};
const Chebyshev& chebyshev() {
  static const Chebyshev table;
  return table;
}

double last_coefficients(const Values& v) {
  const Chebyshev& c = chebyshev();
  double worst = 0;
  for (const auto& tail : c.tail) {
    double re = 0, im = 0;
    for (int i = 0; i < P; ++i) re += tail[i] * v.re[i], im += tail[i] * v.im[i];
    worst = std::max(worst, std::abs(re) + std::abs(im));
  }
  return worst;
}
double largest(const Values& v) {
  double most = 0;
  for (int j = 0; j < P; ++j) most = std::max(most, std::abs(v.re[j]) + std::abs(v.im[j]));
  return most;
}
Values to_half(const Values& v, int side) {
  const auto& w = chebyshev().half[side];
  Values out;
  set(out, 0);
  for (int i = 0; i < P; ++i)
    for (int j = 0; j < P; ++j) {
      out.re[j] += w[i][j] * v.re[i];
      out.im[j] += w[i][j] * v.im[i];
    }
  return out;
}

// ln (1 + w). The library's is slow near 1, where nearly all arguments are: it saves digits of the modulus that the sum
// of logarithms does not keep.
inline Complex log_one_plus(Complex w) {
  if (std::abs(w.real()) + std::abs(w.imag()) > 1e-3)
    return {std::log(std::norm(1. + w)) / 2, std::atan2(w.imag(), 1 + w.real())};
  Complex sum = 0;
  for (int k = 6; k >= 1; --k) {
    sum = (k % 2 ? 1. : -1.) / k + Complex(w.real() * sum.real() - w.imag() * sum.imag(),
                                           w.real() * sum.imag() + w.imag() * sum.real());
  }
  return {w.real() * sum.real() - w.imag() * sum.imag(), w.real() * sum.imag() + w.imag() * sum.real()};
}

struct Unsettled {};  // thrown where the phase cannot be followed

// Small dense complex matrices, row-major.
using Dense = std::vector<Complex>;

// Determinant, of a matrix that is destroyed.
Complex determinant(Dense& a, int n) {
  Complex det = 1;
  for (int k = 0; k < n; ++k) {
    int p = k;
    for (int i = k + 1; i < n; ++i)
      if (std::norm(a[std::size_t(i * n + k)]) > std::norm(a[std::size_t(p * n + k)])) p = i;
    if (a[std::size_t(p * n + k)] == Complex(0)) return 0;
    if (p != k) {
      det = -det;
      for (int j = k; j < n; ++j) std::swap(a[std::size_t(k * n + j)], a[std::size_t(p * n + j)]);
    }
    det *= a[std::size_t(k * n + k)];
    for (int i = k + 1; i < n; ++i) {
      const Complex l = a[std::size_t(i * n + k)] / a[std::size_t(k * n + k)];
      if (l != Complex(0))
        for (int j = k + 1; j < n; ++j) a[std::size_t(i * n + j)] -= l * a[std::size_t(k * n + j)];
    }
  }
  return det;
}

Dense inverse_of(Dense a, int n) {
  Dense b(a.size(), 0.);
  for (int i = 0; i < n; ++i) b[std::size_t(i * n + i)] = 1;
  for (int k = 0; k < n; ++k) {
    int p = k;
    for (int i = k + 1; i < n; ++i)
      if (std::norm(a[std::size_t(i * n + k)]) > std::norm(a[std::size_t(p * n + k)])) p = i;
    for (int j = 0; j < n; ++j) {
      std::swap(a[std::size_t(k * n + j)], a[std::size_t(p * n + j)]);
      std::swap(b[std::size_t(k * n + j)], b[std::size_t(p * n + j)]);
    }
    const Complex d = 1. / a[std::size_t(k * n + k)];
    for (int j = 0; j < n; ++j) a[std::size_t(k * n + j)] *= d, b[std::size_t(k * n + j)] *= d;
    for (int i = 0; i < n; ++i) {
      const Complex l = a[std::size_t(i * n + k)];
      if (i == k || l == Complex(0)) continue;
      for (int j = 0; j < n; ++j) {
        a[std::size_t(i * n + j)] -= l * a[std::size_t(k * n + j)];
        b[std::size_t(i * n + j)] -= l * b[std::size_t(k * n + j)];
      }
    }
  }
  return b;
}

// Roots S of 4 (S + S^2/3 + ...) = -d, smallest first: the wave pair's, then those of the stencil's own.
std::vector<Complex> stencil_roots(int order, Complex d) {
  static constexpr double coefficient[] = {1, 1. / 3, 8. / 45, 4. / 35};
  const int b = order / 2;
  std::vector<Complex> s(static_cast<std::size_t>(b));
  for (int k = 0; k < b; ++k) s[std::size_t(k)] = 2. * std::polar(1., 0.4 + 2 * M_PI * k / b);
  for (int step = 0; step < 200; ++step)  // Durand and Kerner
    for (int k = 0; k < b; ++k) {
      Complex f = d / 4., power = 1, others = coefficient[b - 1];
      for (int j = 0; j < b; ++j) f += coefficient[j] * (power *= s[std::size_t(k)]);
      for (int j = 0; j < b; ++j)
        if (j != k) others *= s[std::size_t(k)] - s[std::size_t(j)];
      if (others != Complex(0)) s[std::size_t(k)] -= f / others;
    }
  std::sort(s.begin(), s.end(), [](Complex x, Complex y) { return std::norm(x) < std::norm(y); });
  return s;
}

// A piece of the segment.
struct Piece {
  Complex from, to;
  Complex at(double x) const { return (from + to) / 2. + (to - from) / 2. * x; }
  Piece half(int side) const {
    const Complex middle = (from + to) / 2.;
    return side == 0 ? Piece{from, middle} : Piece{middle, to};
  }
};

// The tree for stencils of half-width b. A state at an interface is p at the b nodes on either side; in the basis Q its
// first ng = b + 1 components are the wave pair and what decays to the right, the nu = b - 1 others grow to the right.
template <int b>
class Tree {
 public:
  Tree(const Sliding& s, PhaseTurn& result) : s_(s), result_(result) {
    const std::size_t m = s.size();
    const PetscInt order = s.scene.order, n = s.scene.n;
    if (s.scene.ring()) {
      first_ = 0;
      last_ = m;
    } else {
      // rows near the ends are taken as they are; they must not reach beyond the first interface
      for (first_ = b; s.node[first_] < order; ++first_) {
      }
      for (last_ = m - b; s.node[last_ - 1] >= n - order; --last_) {
      }
      for (const bool left : {true, false}) {
        const std::size_t rows = left ? first_ : m - last_;
        for (std::size_t i = 0; i < rows; ++i)
          for (const auto& [column, value] : s.coupling_row(left ? i : m - 1 - i))
            if ((left ? column : m - 1 - column) >= rows + b) throw Unsettled();
      }
    }
    const double h = s.scene.form == Form::chain ? 1 : s.scene.h();
    scale_ = h * h / s.K1;
    weights_ = second_difference(s.scene.order);
  }

  void follow(const Piece& piece, int depth = 0) {
    if (depth > 40) throw Unsettled();
    Level level;
    if (build(piece, level)) return descend(piece, level, depth);
    for (int side : {0, 1}) follow(piece.half(side), depth + 1);
  }

 private:
  static constexpr int ng = b + 1, nu = b - 1, d = 2 * b;
  struct Map {
    Values e[d][d];  // [g_right; u_left] = e [g_left; u_right], the block [g, g] times 2^scale
    Values log;      // of the determinant of what was eliminated, the part that is not in e
    double scale = 0;
    double size = 0, tail = 0;
  };
  struct Level {
    std::vector<Map> map;
    Dense R;  // inverse of the basis
  };

  // Inverse of I - A or A (nu x nu), without exchanges: it stands near the identity or is diagonal. The logarithm of
  // the determinant, relative to `reference`, is added to log.
  static void invert_small(Values (&a)[nu ? nu : 1][nu ? nu : 1], Values& log, Complex reference) {
    Values det;
    set(det, 1. / reference);
    for (int k = 0; k < nu; ++k) {
      multiply(det, a[k][k]);
      Values pivot = a[k][k];
      invert(pivot);
      set(a[k][k], 1);
      for (int j = 0; j < nu; ++j) multiply(a[k][j], pivot);
      for (int i = 0; i < nu; ++i) {
        if (i == k) continue;
        Values l = a[i][k];
        set(a[i][k], 0);
        for (int t = 0; t < P; ++t) l.re[t] = -l.re[t], l.im[t] = -l.im[t];
        for (int j = 0; j < nu; ++j) add_product(a[i][j], l, a[k][j]);
      }
    }
    for (int t = 0; t < P; ++t) {
      const Complex x(det.re[t], det.im[t]);
      if (!(std::norm(x - 1.) < 0.8)) throw Unsettled();  // the parts do not stay apart
      const Complex y = log_one_plus(x - 1.);
      log.re[t] += y.real();
      log.im[t] += y.imag();
    }
  }

  // The map of `left` followed by `right`.
  static void join(const Map& left, const Map& right, Map& out) {
    const double left_scale = std::exp2(std::min(left.scale, 900.));
    const double right_scale = std::exp2(std::min(right.scale, 900.));
    out.log = left.log;
    add(out.log, right.log, 1);
    out.scale = left.scale + right.scale;
    Values W[nu ? nu : 1][ng], Z[nu ? nu : 1][nu ? nu : 1], N[ng][ng];
    for (int i = 0; i < ng; ++i)
      for (int j = 0; j < ng; ++j) N[i][j] = left.e[i][j];
    if constexpr (nu > 0) {
      Values X[nu][nu];
      for (int i = 0; i < nu; ++i)
        for (int j = 0; j < nu; ++j) {
          set(X[i][j], 0);
          for (int k = 0; k < ng; ++k) add_product(X[i][j], right.e[ng + i][k], left.e[k][ng + j]);
          for (int t = 0; t < P; ++t) X[i][j].re[t] = (i == j) - X[i][j].re[t], X[i][j].im[t] = -X[i][j].im[t];
        }
      invert_small(X, out.log, 1);
      for (int i = 0; i < nu; ++i) {
        Values Y[ng];  // X E_right
        for (int j = 0; j < ng; ++j) {
          set(Y[j], 0);
          for (int k = 0; k < nu; ++k) add_product(Y[j], X[i][k], right.e[ng + k][j]);
        }
        for (int j = 0; j < ng; ++j) {
          set(W[i][j], 0);
          for (int k = 0; k < ng; ++k) add_product(W[i][j], Y[k], left.e[k][j]);
        }
        for (int j = 0; j < nu; ++j) {
          set(Z[i][j], 0);
          for (int k = 0; k < nu; ++k) add_product(Z[i][j], X[i][k], right.e[ng + k][ng + j]);
        }
      }
      for (int i = 0; i < ng; ++i)
        for (int j = 0; j < ng; ++j)
          for (int k = 0; k < nu; ++k) add_product(N[i][j], left.e[i][ng + k], W[k][j]);
    }
    for (int i = 0; i < ng; ++i)
      for (int j = 0; j < ng; ++j) {
        set(out.e[i][j], 0);
        for (int k = 0; k < ng; ++k) add_product(out.e[i][j], right.e[i][k], N[k][j]);
      }
    if constexpr (nu > 0) {
      for (int j = 0; j < nu; ++j) {
        Values HZ[ng];
        for (int i = 0; i < ng; ++i) {
          set(HZ[i], 0);
          for (int k = 0; k < nu; ++k) add_product(HZ[i], left.e[i][ng + k], Z[k][j]);
        }
        for (int i = 0; i < ng; ++i) {
          Values sum;
          set(sum, 0);
          for (int k = 0; k < ng; ++k) add_product(sum, right.e[i][k], HZ[k]);
          out.e[i][ng + j] = right.e[i][ng + j];
          add(out.e[i][ng + j], sum, right_scale);
        }
      }
      for (int i = 0; i < nu; ++i) {
        for (int j = 0; j < ng; ++j) {
          Values sum;
          set(sum, 0);
          for (int k = 0; k < nu; ++k) add_product(sum, left.e[ng + i][ng + k], W[k][j]);
          out.e[ng + i][j] = left.e[ng + i][j];
          add(out.e[ng + i][j], sum, left_scale);
        }
        for (int j = 0; j < nu; ++j) {
          set(out.e[ng + i][ng + j], 0);
          for (int k = 0; k < nu; ++k) add_product(out.e[ng + i][ng + j], left.e[ng + i][ng + k], Z[k][j]);
        }
      }
    }
    normalise(out);
  }

  // The block [g, g] scaled to size 1; how well the map is settled.
  static void normalise(Map& m) {
    double most = 0;
    for (int i = 0; i < ng; ++i)
      for (int j = 0; j < ng; ++j) most = std::max(most, largest(m.e[i][j]));
    if (!(most > 0) || !std::isfinite(most)) throw Unsettled();
    const int exponent = std::ilogb(most);
    const double factor = std::exp2(-exponent);
    m.scale += exponent;
    m.tail = 0;
    for (int i = 0; i < ng; ++i)
      for (int j = 0; j < ng; ++j) {
        for (int t = 0; t < P; ++t) m.e[i][j].re[t] *= factor, m.e[i][j].im[t] *= factor;
        m.tail = std::max(m.tail, last_coefficients(m.e[i][j]));
      }
    if (nu > 0) m.tail = std::max(m.tail, last_coefficients(m.log));
  }

  static void halve(const Map& m, int side, Map& out) {
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < d; ++j) out.e[i][j] = to_half(m.e[i][j], side);
    out.log = to_half(m.log, side);
    out.scale = m.scale;
    out.tail = m.tail;
  }

  // Maps of stretches of a few nodes on a piece; false where they do not settle on it.
  bool build(const Piece& piece, Level& level) {
    const Complex middle = piece.at(0);
    Complex mean = 0;
    const std::size_t probes = 16, m = s_.size();
    for (std::size_t k = 0; k < probes; ++k) mean += symbol_at(k * (m - 1) / (probes - 1), middle) / double(probes);
    const std::vector<Complex> roots = stencil_roots(2 * b, mean);
    Dense Q(d * d, 0.);
    const auto q = [&](int i, int j) -> Complex& { return Q[std::size_t(i * d + j)]; };
    {
      const Complex t = 2. - 4. * roots[0];  // the wave pair: cosine and sine about the interface
      Complex c0 = 1, c1 = t / 2., s0 = 0, s1 = 1;
      for (int j = 0; j < b; ++j) {
        q(b + j, 0) = c0;
        q(b + j, 1) = s0;
        if (j > 0) q(b - j, 0) = c0, q(b - j, 1) = -s0;
        const Complex c2 = t * c1 - c0, s2 = t * s1 - s0;
        c0 = c1, c1 = c2, s0 = s1, s1 = s2;
      }
      q(0, 0) = c0;
      q(0, 1) = -s0;
    }
    for (int k = 1; k < b; ++k) {
      const Complex t = 2. - 4. * roots[std::size_t(k)], w = std::sqrt(t * t / 4. - 1.);
      Complex mu = t / 2. + w;
      if (std::abs(mu) > 1) mu = t / 2. - w;
      Complex power = 1;
      for (int j = 0; j < d; ++j, power *= mu) q(j, 1 + k) = q(d - 1 - j, b + k) = power;
    }
    level.R = inverse_of(Q, d);
    // T = R (shift) Q + (d_i - mean) v w, the recurrence in this basis
    Dense T(d * d, 0.), v(d), w(d);
    Dense companion(d * d, 0.);
    for (int i = 0; i + 1 < d; ++i) companion[std::size_t(i * d + i + 1)] = 1;
    for (int j = 0; j < d; ++j)
      companion[std::size_t((d - 1) * d + j)] =
          ((j == b ? mean : 0.) - weights_[std::size_t(std::abs(j - b))]) / weights_[b];
    for (int i = 0; i < d; ++i) {
      v[std::size_t(i)] = level.R[std::size_t(i * d + d - 1)] / weights_[b];
      w[std::size_t(i)] = q(b, i);
      for (int j = 0; j < d; ++j)
        for (int k = 0; k < d; ++k)
          for (int l = 0; l < d; ++l)
            T[std::size_t(i * d + j)] += level.R[std::size_t(i * d + k)] * companion[std::size_t(k * d + l)] * q(l, j);
    }
    Complex reference = 1;  // determinant of the growing block
    if (nu > 0) {
      Dense block;
      for (int i = 0; i < nu; ++i)
        for (int j = 0; j < nu; ++j) block.push_back(T[std::size_t((ng + i) * d + ng + j)]);
      reference = determinant(block, nu);
    }
    const std::size_t stretch = 8;
    level.map.resize((last_ - first_ + stretch - 1) / stretch);
    Map node, joined;
    for (std::size_t c = 0; c < level.map.size(); ++c) {
      Map& cell = level.map[c];
      for (std::size_t i = first_ + c * stretch; i < std::min(last_, first_ + (c + 1) * stretch); ++i) {
        node_map(piece, i, mean, T, v, w, reference, node);
        if (i == first_ + c * stretch) {
          cell = node;
        } else {
          join_two_(&cell, &node, -1, &joined);
          std::swap(cell, joined);
        }
      }
      if (cell.tail > settled) return false;
    }
    return true;
  }

  Complex symbol_at(std::size_t i, Complex z) const { return (s_.K0 + s_.pointwise(i, z)) * scale_; }

  void node_map(const Piece& piece, std::size_t i, Complex mean, const Dense& T, const Dense& v, const Dense& w,
                Complex reference, Map& out) const {
    Values delta;
    for (int t = 0; t < P; ++t) {
      const Complex x = symbol_at(i, piece.at(chebyshev().x[t])) - mean;
      delta.re[t] = x.real();
      delta.im[t] = x.imag();
    }
    Values full[d][d];
    for (int r = 0; r < d; ++r)
      for (int c = 0; c < d; ++c) {
        Values factor;
        set(factor, v[std::size_t(r)] * w[std::size_t(c)]);
        set(full[r][c], T[std::size_t(r * d + c)]);
        add_product(full[r][c], factor, delta);
      }
    out.scale = 0;
    set(out.log, 0);
    if constexpr (nu > 0) {
      Values F[nu][nu];
      for (int r = 0; r < nu; ++r)
        for (int c = 0; c < nu; ++c) F[r][c] = full[ng + r][ng + c];
      invert_small(F, out.log, reference);
      for (int r = 0; r < nu; ++r) {
        for (int c = 0; c < nu; ++c) out.e[ng + r][ng + c] = F[r][c];
        for (int c = 0; c < ng; ++c) {
          Values sum;
          set(sum, 0);
          for (int k = 0; k < nu; ++k) add_product(sum, F[r][k], full[ng + k][c]);
          set(out.e[ng + r][c], 0);
          add(out.e[ng + r][c], sum, -1);
        }
      }
      for (int r = 0; r < ng; ++r) {
        for (int c = 0; c < nu; ++c) {
          set(out.e[r][ng + c], 0);
          for (int k = 0; k < nu; ++k) add_product(out.e[r][ng + c], full[r][ng + k], F[k][c]);
        }
        for (int c = 0; c < ng; ++c) {
          out.e[r][c] = full[r][c];
          for (int k = 0; k < nu; ++k) add_product(out.e[r][c], full[r][ng + k], out.e[ng + k][c]);
        }
      }
    } else {
      for (int r = 0; r < d; ++r)
        for (int c = 0; c < d; ++c) out.e[r][c] = full[r][c];
    }
    normalise(out);
  }

  // What counts as settled where the line is in so many maps: a product over m nodes carries round-off of some m epsilon,
  // below which no shorter piece brings it.
  double settled_over(std::size_t maps) const {
    return settled + 8 * std::numeric_limits<double>::epsilon() * double(last_ - first_) / double(maps);
  }

  // Joins neighbours on ever shorter pieces until one map is left. Where the joined maps would still be settled on the
  // whole piece, it is not halved.
  void descend(const Piece& piece, const Level& level, int depth) {
    if (depth > 60) throw Unsettled();
    if (level.map.size() == 1) return finish(piece, level, depth);
    double tail = 0;
    for (const Map& m : level.map) tail = std::max(tail, m.tail);
    Level joined;
    joined.R = level.R;
    if (tail < 1e-5 * settled && join_all(level, -1, joined)) return descend(piece, joined, depth);
    for (int side : {0, 1}) {
      if (join_all(level, side, joined)) {
        descend(piece.half(side), joined, depth + 1);
      } else {
        Level same;
        same.R = level.R;
        same.map.resize(level.map.size());
        for (std::size_t k = 0; k < level.map.size(); ++k) {
          Map half;
          halve(level.map[k], side, half);
          normalise(half);
          same.map[k] = half;
        }
        descend(piece.half(side), same, depth + 1);
      }
    }
  }

  // Two neighbours on one half of their piece, or on all of it (side < 0); the last one may stand alone.
  struct JoinTwo {
    void operator()(const Map* l, const Map* r, int side, Map* out) const {
      Map left, right;
      if (side >= 0) {
        halve(*l, side, left);
        l = &left;
        if (r) {
          halve(*r, side, right);
          r = &right;
        }
      }
      if (r) return join(*l, *r, *out);
      *out = *l;
      normalise(*out);
    }
  };
  using Joining = std::function<void(const Map*, const Map*, int, Map*)>;
  const Joining join_two_ = kernel::compiled<Joining>(JoinTwo());

  bool join_all(const Level& level, int side, Level& out) {
    out.map.resize((level.map.size() + 1) / 2);
    const double allowed = settled_over(out.map.size());
    for (std::size_t k = 0; k < out.map.size(); ++k) {
      const bool pair = 2 * k + 1 < level.map.size();
      join_two_(&level.map[2 * k], pair ? &level.map[2 * k + 1] : nullptr, side, &out.map[k]);
      if (out.map[k].tail > allowed) return false;
    }
    return true;
  }

  // The last map closed by the ends: a polynomial with the zeros of det S.
  void finish(const Piece& piece, const Level& level, int depth) {
    const Map& m = level.map[0];
    Values f;
    const Complex shift(m.log.re[P / 2], m.log.im[P / 2]);
    for (int t = 0; t < P; ++t) {
      const Complex x = close(m, level.R, piece.at(chebyshev().x[t]), t) *
                        std::exp(Complex(m.log.re[t], m.log.im[t]) - shift);
      f.re[t] = x.real();
      f.im[t] = x.imag();
    }
    const double size = largest(f);
    if (!(size > 0) || !std::isfinite(size)) throw Unsettled();
    if (last_coefficients(f) > 100 * settled_over(1) * size) {
      if (std::abs(piece.to - piece.from) < 1e-13 * (1 + std::abs(piece.from))) throw Unsettled();
      for (int side : {0, 1}) {
        Level half;
        half.R = level.R;
        half.map.resize(1);
        halve(m, side, half.map[0]);
        normalise(half.map[0]);
        finish(piece.half(side), half, depth + 1);
      }
      return;
    }
    ++result_.pieces;
    Polynomial{piece, f}.turn(result_);
  }

  Complex close(const Map& m, const Dense& R, Complex z, int t) const {
    const auto e = [&](int i, int j) { return Complex(m.e[i][j].re[t], m.e[i][j].im[t]); };
    if (s_.scene.ring()) {
      // D2 is symmetric on a ring, so the wave pair multiplies by mu and 1/mu round it. The growing parts close by
      // themselves (F = 0): det (T - 1) = +-det N (2 - trace N^-1 G), N = 1 - H E.
      Dense N(ng * ng, 0.);
      for (int i = 0; i < ng; ++i)
        for (int j = 0; j < ng; ++j) {
          N[std::size_t(i * ng + j)] = i == j;
          for (int k = ng; k < d; ++k) N[std::size_t(i * ng + j)] -= e(i, k) * e(k, j);
        }
      for (int i = ng; i < d; ++i)
        for (int j = ng; j < d; ++j)
          if (std::abs(e(i, j)) > 1e-13) throw Unsettled();
      const Dense inverse = inverse_of(N, ng);
      Complex trace = 0;
      for (int i = 0; i < ng; ++i)
        for (int j = 0; j < ng; ++j) trace += inverse[std::size_t(i * ng + j)] * e(j, i);
      return determinant(N, ng) * (2 * std::exp2(-m.scale) - trace);
    }
    // unknowns: p up to the first interface and beyond, p from before the last interface, in units of 2^scale
    const int left = int(first_), right = int(s_.size() - last_), columns = left + right + 2 * b;
    Dense a(std::size_t(columns * columns), 0.);
    const auto entry = [&](int i, int j) -> Complex& { return a[std::size_t(i * columns + j)]; };
    const auto fill = [&](int row, std::size_t i) {
      const auto place = [&](std::size_t c) {
        return c < first_ + b && i < first_ ? int(c) : columns - int(s_.size() - c);
      };
      for (const auto& [column, value] : s_.coupling_row(i)) entry(row, place(column)) += s_.K1 * value * scale_;
      entry(row, place(i)) += symbol_at(i, z);
    };
    for (int i = 0; i < left; ++i) fill(i, std::size_t(i));
    for (int i = 0; i < right; ++i) fill(left + i, last_ + std::size_t(i));
    const int in = left - b, out = columns - right - b;  // first columns of the states at either interface
    const double up = std::exp2(std::min(m.scale, 900.));
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < d; ++j) {
        // R y = (g; u): rows g: g_right - G g_left - H u_right; rows u: u_left - E g_left - 2^scale F u_right
        const int row = left + right + i;
        (i < ng ? entry(row, out + j) : entry(row, in + j)) += R[std::size_t(i * d + j)];
        for (int k = 0; k < ng; ++k) entry(row, in + j) -= e(i, k) * R[std::size_t(k * d + j)];
        for (int k = ng; k < d; ++k) entry(row, out + j) -= (i < ng ? 1 : up) * e(i, k) * R[std::size_t(k * d + j)];
      }
    return determinant(a, columns);
  }

  // A polynomial by its values, and the turn of its phase from end to end.
  struct Polynomial {
    Piece piece;
    Values f;
    struct Point {
      double x;
      Complex f, slope;  // f'/f with respect to x
    };
    Complex value(Complex x, Complex* derivative = nullptr) const {
      const Chebyshev& c = chebyshev();
      Complex above = 0, below = 0, above2 = 0, below2 = 0;
      for (int i = 0; i < P; ++i) {
        Complex apart = x - c.x[i];
        if (std::norm(apart) < 1e-28) apart = 1e-14;
        const Complex w = c.weight[i] / apart, g(f.re[i], f.im[i]);
        above += w * g;
        below += w;
        above2 -= w / apart * g;
        below2 -= w / apart;
      }
      const Complex result = above / below;
      if (derivative) *derivative = (above2 - result * below2) / below;
      return result;
    }
    Point at(double x) const {
      Point p{x, 0, 0};
      Complex derivative;
      p.f = value(x, &derivative);
      p.slope = derivative / p.f;
      return p;
    }
    // As for the count on short lines: followed where both slopes predict the change and it is small.
    double turn(const Point& a, const Point& b_, PhaseTurn& result, int depth) const {
      if (depth > 60) throw Unsettled();
      const double step = b_.x - a.x;
      const Complex predicted = (a.slope + b_.slope) / 2. * step, measured = std::log(b_.f / a.f);
      if (std::abs(a.slope * step) < 0.7 && std::abs(b_.slope * step) < 0.7 && std::abs(measured - predicted) < 0.2) {
        if (measured.imag() > 0 && a.slope.imag() > 0 && result.zeros.size() < 4096) zero_near(a.x, result);
        return measured.imag();
      }
      const Point m = at((a.x + b_.x) / 2);
      return turn(a, m, result, depth + 1) + turn(m, b_, result, depth + 1);
    }
    void turn(PhaseTurn& result) const {
      Point last = at(-1);
      for (int k = 1; k <= 4; ++k) {
        const Point next = at(-1 + k / 2.);
        result.turn += turn(last, next, result, 0);
        last = next;
      }
    }
    // Newton's iteration to a zero beside the piece; where there is none the place itself is told.
    void zero_near(double x, PhaseTurn& result) const {
      Complex y = x;
      for (int k = 0; k < 12; ++k) {
        Complex derivative;
        const Complex v = value(y, &derivative), change = v / derivative;
        y -= change;
        if (!(std::abs(y) < 3)) return;
        if (std::abs(change) < 1e-10) break;
      }
      const Complex z = (piece.from + piece.to) / 2. + (piece.to - piece.from) / 2. * y;
      const double near = 1e-6 * std::abs(piece.to - piece.from);
      if (std::abs(y) < 1.8 && (result.zeros.empty() || std::abs(result.zeros.back() - z) > near))
        result.zeros.push_back(z);
    }
  };

  const Sliding& s_;
  PhaseTurn& result_;
  std::size_t first_ = 0, last_ = 0;  // rows first_ .. last_ - 1 are those of the interior
  double scale_ = 1;
  std::array<double, 5> weights_{};
};

template <int b>
void follow_part(const Sliding& s, const Piece& piece, PhaseTurn& result) {
  Tree<b> tree(s, result);
  tree.follow(piece);
}

}  // namespace

std::optional<PhaseTurn> follow_phase(MPI_Comm comm, const Sliding& s, Complex from, Complex to) {
  if (s.size() < shortest_line || !(s.K1 > 0)) return std::nullopt;
  int ranks = 1, rank = 0;
  MPI_Comm_size(comm, &ranks);
  MPI_Comm_rank(comm, &rank);
  PhaseTurn result;
  int failed = 0;
  const int parts = ranks == 1 ? 1 : 8 * ranks;
  try {
    for (int k = rank; k < parts; k += ranks) {
      const Piece piece{from + (to - from) * (double(k) / parts), from + (to - from) * (double(k + 1) / parts)};
      switch (s.scene.order) {
        case 2: follow_part<1>(s, piece, result); break;
        case 4: follow_part<2>(s, piece, result); break;
        case 6: follow_part<3>(s, piece, result); break;
        default: follow_part<4>(s, piece, result); break;
      }
    }
  } catch (const Unsettled&) {
    failed = 1;
  }
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MAX, comm));
  if (failed) return std::nullopt;
  // the rightmost zeros of all ranks
  std::sort(result.zeros.begin(), result.zeros.end(), [](Complex a, Complex b) { return a.real() > b.real(); });
  if (ranks > 1) {
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &result.turn, 1, MPI_DOUBLE, MPI_SUM, comm));
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &result.pieces, 1, MPI_LONG, MPI_SUM, comm));
    int mine = int(2 * std::min<std::size_t>(result.zeros.size(), 32));
    std::vector<int> counts(static_cast<std::size_t>(ranks)), starts(static_cast<std::size_t>(ranks), 0);
    SS_TRY(MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, comm));
    for (std::size_t k = 1; k < starts.size(); ++k) starts[k] = starts[k - 1] + counts[k - 1];
    std::vector<Complex> all(std::size_t(starts.back() + counts.back()) / 2);
    SS_TRY(MPI_Allgatherv(result.zeros.data(), mine, MPI_DOUBLE, all.data(), counts.data(), starts.data(), MPI_DOUBLE,
                          comm));
    std::sort(all.begin(), all.end(), [](Complex a, Complex b) { return a.real() > b.real(); });
    result.zeros = std::move(all);
  }
  return result;
}

}  // namespace stickslip
