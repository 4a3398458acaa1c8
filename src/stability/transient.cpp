// How far perturbations can grow before the spectrum has its say: the operator is not normal.
#include <petscsys.h>
// after petscsys.h
#include <petscblaslapack.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/spectrum.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

constexpr double most_dense = 400;  // unknowns

using Matrix = std::vector<double>;  // square, by columns

Matrix times(const Matrix& a, const Matrix& b, PetscBLASInt m) {
  Matrix c(a.size());
  const double one = 1, zero = 0;
  BLASgemm_("N", "N", &m, &m, &m, &one, a.data(), &m, b.data(), &m, &zero, c.data(), &m);
  return c;
}

// Largest eigenvalue of a symmetric matrix.
double largest_eigenvalue(Matrix a, PetscBLASInt m) {
  std::vector<double> values(std::size_t(m), 0.), work(std::size_t(8 * m));
  PetscBLASInt size = 8 * m, info = 0;
  LAPACKsyev_("N", "U", &m, a.data(), &m, values.data(), work.data(), &size, &info);
  if (info != 0) throw Failure("LAPACK found no eigenvalues of the symmetric part");
  return values.back();
}

double two_norm(const Matrix& x, PetscBLASInt m) {
  Matrix square(x.size());
  const double one = 1, zero = 0;
  BLASgemm_("T", "N", &m, &m, &m, &one, x.data(), &m, x.data(), &m, &zero, square.data(), &m);
  return std::sqrt(std::max(0., largest_eigenvalue(std::move(square), m)));
}

// exp(M t): Taylor's series of M t/2^k, squared k times.
Matrix exponential(const Matrix& M, PetscBLASInt m, double t) {
  double norm = 0;
  for (PetscBLASInt j = 0; j < m; ++j) {
    double column = 0;
    for (PetscBLASInt i = 0; i < m; ++i) column += std::abs(M[std::size_t(j * m + i)]) * t;
    norm = std::max(norm, column);
  }
  const int halvings = norm > 0.5 ? int(std::ceil(std::log2(norm / 0.5))) : 0;
  Matrix a = M, sum(M.size(), 0.), term(M.size(), 0.);
  for (double& x : a) x *= std::ldexp(t, -halvings);
  for (PetscBLASInt i = 0; i < m; ++i) sum[std::size_t(i * m + i)] = term[std::size_t(i * m + i)] = 1;
  for (int k = 1; k <= 16; ++k) {
    term = times(term, a, m);
    for (std::size_t i = 0; i < term.size(); ++i) sum[i] += term[i] /= k;
  }
  for (int k = 0; k < halvings; ++k) sum = times(sum, sum, m);
  return sum;
}

// The numerical abscissa: the largest eigenvalue of the symmetric part. |exp(M (t + u))| <= exp(abscissa u) |exp(M t)|.
double abscissa_of(const Matrix& M, PetscBLASInt m) {
  Matrix symmetric(M.size());
  for (PetscBLASInt i = 0; i < m; ++i)
    for (PetscBLASInt j = 0; j < m; ++j)
      symmetric[std::size_t(j * m + i)] = (M[std::size_t(j * m + i)] + M[std::size_t(i * m + j)]) / 2;
  return largest_eigenvalue(std::move(symmetric), m);
}

struct Sample {
  double t, g;
};

// The top of the parabola of ln g through three places.
Sample parabola_top(const Sample& a, const Sample& b, const Sample& c) {
  const double left = (std::log(b.g) - std::log(a.g)) / (b.t - a.t);
  const double right = (std::log(c.g) - std::log(b.g)) / (c.t - b.t), bend = (right - left) / (c.t - a.t);
  if (!(bend < 0)) return b;
  const double t = std::clamp((a.t + b.t) / 2 - left / (2 * bend), a.t, c.t);
  return {t, b.g * std::exp((t - b.t) * (left + bend * (t - a.t)))};
}

// The largest |exp(M t)| of a small matrix, beside `result`. From a time with norm g nothing above `best` can come
// sooner than ln(best/g)/abscissa later: steps are as long as that and a slack, a coarse one first to know what is high,
// then one of 1e-4, so that no peak is jumped over. Tops seen on the way are refined. As |exp(M (t + u))| <= |exp(M t)|
// |exp(M u)|, nothing follows a norm of 1.
void grow_small(const Matrix& M, PetscBLASInt m, Transient& result) {
  const double abscissa = abscissa_of(M, m);
  result.abscissa = std::max(result.abscissa, abscissa);
  if (!(abscissa > 1e-12)) return;
  const auto at = [&](double t) { return Sample{t, two_norm(exponential(M, m, t), m)}; };
  for (const double slack : {0.03, 1e-4}) {
    Sample before{0, 1}, here{0, 1};
    for (int k = 0; here.g > 1 || k == 0; ++k) {
      const double ahead = std::log(std::max(result.growth, here.g) / here.g);
      const Sample next = at(here.t + (ahead + slack) / abscissa);
      if (here.g >= before.g && here.g > next.g && here.g > 0.9 * result.growth) {
        const Least top = find_least([&](double t) { return -at(t).g; }, before.t, next.t, 1e-7 * next.t,
                                     [](double) { return false; });
        if (-top.value > result.growth) {
          result.growth = -top.value;
          result.time = top.x;
        }
      }
      before = std::exchange(here, next);
      if (k == 20000) {
        result.exact = false;
        break;
      }
    }
  }
}

// The same for a large matrix: at even times until the norm is 1, then beside the three highest tops at intervals
// halved ten times. (No parabola through them: where two directions exchange the lead, the top is a corner.)
void grow_large(const Matrix& M, PetscBLASInt m, double horizon, Transient& result) {
  result.abscissa = abscissa_of(M, m);
  if (horizon <= 0 || !(result.abscissa > 1e-12)) return;
  const double h = std::min(horizon / 100, std::max(0.1 / result.abscissa, horizon / 400));
  const Matrix step = exponential(M, m, h);
  std::vector<Sample> samples{{0, 1}};
  for (Matrix x = step; samples.back().t < horizon; x = times(x, step, m)) {
    samples.push_back({double(samples.size()) * h, two_norm(x, m)});
    if (samples.back().g <= 1) break;
  }
  std::vector<std::size_t> tops;
  for (std::size_t k = 1; k + 1 < samples.size(); ++k)
    if (samples[k].g >= samples[k - 1].g && samples[k].g > samples[k + 1].g) tops.push_back(k);
  std::sort(tops.begin(), tops.end(), [&](std::size_t a, std::size_t b) { return samples[a].g > samples[b].g; });
  if (tops.size() > 3) tops.resize(3);
  for (const std::size_t k : tops) {
    Sample left = samples[k - 1], middle = samples[k], right = samples[k + 1];
    Matrix x_left = exponential(M, m, left.t), x_middle = times(x_left, step, m);
    double width = h;
    for (int level = 0; level < 10; ++level) {
      const Matrix half = exponential(M, m, width /= 2);
      Matrix x_first = times(x_left, half, m), x_second = times(x_middle, half, m);
      const Sample first{left.t + width, two_norm(x_first, m)}, second{middle.t + width, two_norm(x_second, m)};
      if (first.g > std::max(middle.g, second.g)) {
        right = std::exchange(middle, first);
        x_middle = std::move(x_first);
      } else if (second.g > middle.g) {
        left = std::exchange(middle, second);
        x_left = std::exchange(x_middle, std::move(x_second));
      } else {
        left = first;
        right = second;
        x_left = std::move(x_first);
      }
    }
    if (middle.g > result.growth) {
      result.growth = middle.g;
      result.time = middle.t;
    }
  }
}

// ---- many nodes ---------------------------------------------------------------------------------------------------

// Cholesky's factorisation of a symmetric banded matrix; false where it is not positive definite. Row i holds the
// entries (i, i - band ... i).
bool positive_definite(std::vector<double>& a, std::size_t n, std::size_t band) {
  const std::size_t width = band + 1;
  const auto at = [&](std::size_t i, std::size_t j) -> double& { return a[i * width + (j + band - i)]; };
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t first = i > band ? i - band : 0;
    for (std::size_t j = first; j <= i; ++j) {
      double sum = at(i, j);
      for (std::size_t k = std::max(first, j > band ? j - band : 0); k < j; ++k) sum -= at(i, k) * at(j, k);
      if (j < i) {
        at(i, j) = sum / at(j, j);
      } else {
        if (!(sum > 0)) return false;
        at(i, i) = std::sqrt(sum);
      }
    }
  }
  return true;
}

// The energy's matrix M = diag(W K/A, W, W), unknowns of a node together; it is applied and inverted by its blocks.
struct Energy {
  explicit Energy(const Sliding& sliding) : s(sliding) { s.factor(0, stiffness); }
  const Sliding& s;
  BandLU stiffness;  // of K = S(0)

  std::vector<Complex> apply(const std::vector<Complex>& x) const {
    const std::size_t n = s.size(), d = s.dof();
    std::vector<Complex> p(n), y(x.size());
    for (std::size_t i = 0; i < n; ++i) p[i] = x[i * d];
    p = s.apply(0, p);
    for (std::size_t i = 0; i < n; ++i) {
      y[i * d] = s.weight[i] * p[i] / s.A;
      for (std::size_t c = 1; c < d; ++c) y[i * d + c] = s.weight[i] * x[i * d + c];
    }
    return y;
  }
  std::vector<Complex> solve(const std::vector<Complex>& x) const {
    const std::size_t n = s.size(), d = s.dof();
    std::vector<Complex> p(n), y(x.size());
    for (std::size_t i = 0; i < n; ++i) p[i] = s.A * x[i * d] / s.weight[i];
    s.solve(stiffness, p);
    for (std::size_t i = 0; i < n; ++i) {
      y[i * d] = p[i];
      for (std::size_t c = 1; c < d; ++c) y[i * d + c] = x[i * d + c] / s.weight[i];
    }
    return y;
  }
};

// (J - z)^-1 b with S(z) factored, and (J^T - z)^-1 b (no conjugation): both lead to one solve with S or S^T.
std::vector<Complex> resolvent(const Sliding& s, Complex z, const BandLU& lu, const std::vector<Complex>& b) {
  const std::size_t n = s.size(), d = s.dof();
  std::vector<Complex> p(n), y(b.size());
  for (std::size_t i = 0; i < n; ++i) {
    p[i] = -(b[i * d + 1] + (s.s_delta + z) * b[i * d] / s.A);
    if (d == 3) p[i] += z * s.F_state[i] * b[i * d + 2] / (z + s.r[i]);
  }
  s.solve(lu, p);
  for (std::size_t i = 0; i < n; ++i) {
    y[i * d] = p[i];
    y[i * d + 1] = b[i * d] / s.A + (z / s.A + s.B + s.F_psi[i]) * p[i];
    if (d == 3) {
      y[i * d + 2] = (s.g_psi[i] * p[i] - b[i * d + 2]) / (z + s.r[i]);
      y[i * d + 1] += s.F_state[i] * y[i * d + 2];
    }
  }
  return y;
}

std::vector<Complex> transposed_resolvent(const Sliding& s, Complex z, const BandLU& lu,
                                          const std::vector<Complex>& b) {
  const std::size_t n = s.size(), d = s.dof();
  std::vector<Complex> e(n), y(b.size());
  for (std::size_t i = 0; i < n; ++i) {
    e[i] = -b[i * d] - (s.B + s.F_psi[i] + z / s.A) * b[i * d + 1];
    if (d == 3) e[i] -= s.g_psi[i] * (s.F_state[i] * b[i * d + 1] + b[i * d + 2]) / (z + s.r[i]);
  }
  s.solve_transposed(lu, e);
  for (std::size_t i = 0; i < n; ++i) {
    y[i * d] = (b[i * d + 1] + (s.s_delta + z) * e[i]) / s.A;
    y[i * d + 1] = e[i];
    if (d == 3) y[i * d + 2] = -(s.F_state[i] * (b[i * d + 1] + z * e[i]) + b[i * d + 2]) / (z + s.r[i]);
  }
  return y;
}

// The largest eigenvalue of H x = mu M x, H = (M J + J^T M)/2, by halving: mu M - H is positive definite for every mu
// beyond it. In H the waves cancel.
double band_abscissa(const Sliding& s) {
  const std::size_t n = s.size(), d = s.dof();
  std::vector<std::size_t> position(n);  // a ring is folded, so that its ends lie beside each other
  for (std::size_t i = 0; i < n; ++i)
    position[i] = !s.scene.ring() ? i : i < (n + 1) / 2 ? 2 * i : 2 * (n - 1 - i) + 1;
  struct Term {
    std::size_t row, column;
    double H, M;
  };
  std::vector<Term> terms;
  std::size_t band = 0;
  const auto add = [&](std::size_t i, std::size_t c, std::size_t j, std::size_t e, double H, double M) {
    const std::size_t row = position[i] * d + c, column = position[j] * d + e;
    if (column > row) return;
    band = std::max(band, row - column);
    terms.push_back({row, column, H, M});
  };
  for (std::size_t i = 0; i < n; ++i) {
    const double w = s.weight[i], D = s.B + s.F_psi[i];
    auto row = s.coupling_row(i);
    for (auto& [j, value] : row) value *= s.K1;
    row.emplace_back(i, s.K0);
    for (const auto& [j, value] : row) {
      add(i, 0, j, 0, -0.5 * w * value * (D + s.B + s.F_psi[j]), w * value / s.A);
      if (d == 3) {
        add(i, 0, j, 2, -0.5 * w * value * s.F_state[j], 0);
        add(j, 2, i, 0, -0.5 * w * value * s.F_state[j], 0);
      }
    }
    for (const auto& [c, e] : {std::pair<std::size_t, std::size_t>{0, 1}, {1, 0}})
      add(i, c, i, e, 0.5 * s.s_delta * w * s.F_psi[i], 0);
    add(i, 1, i, 1, -s.s_delta * w, w);
    if (d == 3) {
      add(i, 2, i, 0, 0.5 * w * s.g_psi[i], 0);
      add(i, 2, i, 1, 0.5 * s.s_delta * w * s.F_state[i], 0);
      add(i, 2, i, 2, -s.r[i] * w, w);
    }
  }
  std::vector<double> a;
  const auto beyond = [&](double mu) {
    a.assign(n * d * (band + 1), 0.);
    for (const Term& t : terms) a[t.row * (band + 1) + (t.column + band - t.row)] += mu * t.M - t.H;
    return positive_definite(a, n * d, band);
  };
  const double unit = std::sqrt(s.A * s.K0) + 1e-3 * std::sqrt(s.A * s.largest_stiffness());
  double low = -unit, high = unit;
  while (!beyond(high)) low = high, high *= 4;
  for (double step = unit; low == -step && beyond(low); low = -(step *= 4)) high = low;
  for (int k = 0; k < 60 && high - low > 1e-10 * (unit + std::abs(low)); ++k) {
    const double middle = (low + high) / 2;
    (beyond(middle) ? high : low) = middle;
  }
  return (low + high) / 2;
}

// The largest singular value, in the energy norm, of an operator given with its transpose, by Lanczos' iteration on
// their product; `start` is the first vector and becomes the right singular vector.
template <class Forward, class Transposed>
double energy_norm(const Energy& M, const Forward& forward, const Transposed& transposed, std::vector<Complex>& start,
                   double tolerance, int most) {
  const auto inner = [](const std::vector<Complex>& x, const std::vector<Complex>& y) {
    Complex sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += std::conj(x[i]) * y[i];
    return sum;
  };
  std::vector<std::vector<Complex>> basis, images;  // M-orthonormal, and M times them
  std::vector<double> diagonal, beside;
  std::vector<Complex> x = start, Mx = M.apply(x);
  double size = std::sqrt(inner(x, Mx).real()), value = 0;
  for (int k = 0; k < most; ++k) {
    for (auto* v : {&x, &Mx})
      for (Complex& z : *v) z /= size;
    basis.push_back(x);
    images.push_back(Mx);
    x = M.solve(transposed(M.apply(forward(x))));
    diagonal.push_back(inner(images.back(), x).real());
    for (int twice = 0; twice < 2; ++twice)
      for (std::size_t j = 0; j < basis.size(); ++j) {
        const Complex part = inner(images[j], x);
        for (std::size_t i = 0; i < x.size(); ++i) x[i] -= part * basis[j][i];
      }
    Mx = M.apply(x);
    size = std::sqrt(std::max(0., inner(x, Mx).real()));
    // Ritz value of the tridiagonal matrix and its vector, by inverse iteration on few unknowns
    const auto m = PetscBLASInt(basis.size());
    std::vector<double> T(std::size_t(m * m), 0.), values(std::size_t(m), 0.), work(std::size_t(8 * m));
    for (PetscBLASInt i = 0; i < m; ++i) {
      T[std::size_t(i * m + i)] = diagonal[std::size_t(i)];
      if (i > 0) T[std::size_t(i * m + i - 1)] = T[std::size_t((i - 1) * m + i)] = beside[std::size_t(i - 1)];
    }
    PetscBLASInt room = 8 * m, info = 0;
    LAPACKsyev_("V", "U", &m, T.data(), &m, values.data(), work.data(), &room, &info);
    if (info != 0) throw Failure("LAPACK found no eigenvalues in Lanczos' iteration");
    value = values.back();
    const double* ritz = &T[std::size_t((m - 1) * m)];
    const double error = size * std::abs(ritz[m - 1]);
    if (k + 1 == most || error <= tolerance * value || size <= 1e-14 * value) {
      std::fill(start.begin(), start.end(), Complex(0));
      for (std::size_t j = 0; j < basis.size(); ++j)
        for (std::size_t i = 0; i < start.size(); ++i) start[i] += ritz[j] * basis[j][i];
      break;
    }
    beside.push_back(size);
  }
  return std::sqrt(std::max(0., value));
}

// A vector that favours no wave and no place, the same in every run.
std::vector<Complex> any_vector(std::size_t n, bool real) {
  std::vector<Complex> x(n);
  std::uint64_t seed = 0x9e3779b97f4a7c15u;
  const auto draw = [&] {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return double(seed >> 11) * 0x1p-53 - 0.5;
  };
  for (Complex& z : x) {
    const double re = draw();
    z = {re, real ? 0 : draw()};
  }
  return x;
}

// exp(J t) by steps of a Pade approximant r, one complex solve a step: r(z) = r(infinity) + 2 Re [a/(z - z0)] for real
// vectors. (2, 2), of order 4, conserves the energy of waves without friction at any step; (1, 2), of order 3, damps
// those that the step does not resolve.
class Propagator {
 public:
  Propagator(const Sliding& s, double dt, bool damps) : s_(s), dt_(dt), beyond_(damps ? 0 : 1) {
    const Complex z0 = damps ? Complex(2, std::sqrt(2.)) : Complex(3, std::sqrt(3.));
    // (6 + 2 z)/(z^2 - 4 z + 6), or 1 + 12 z/(z^2 - 6 z + 12)
    residue_ = (damps ? 6. + 2. * z0 : 12. * z0) / (z0 - std::conj(z0));
    sigma_ = z0 / dt;
    s.factor(sigma_, lu_);
  }
  std::vector<Complex> operator()(std::vector<Complex> x, long steps, bool transpose) const {
    for (long k = 0; k < steps; ++k) {
      const std::vector<Complex> y =
          transpose ? transposed_resolvent(s_, sigma_, lu_, x) : resolvent(s_, sigma_, lu_, x);
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = beyond_ * x[i].real() + 2 * (residue_ * y[i]).real() / dt_;
    }
    return x;
  }

 private:
  const Sliding& s_;
  double dt_, beyond_;
  Complex sigma_, residue_;
  BandLU lu_;
};

// The largest |exp(J t)|: from one time to the next, each by Lanczos' iteration from the vector of the last. As
// |exp(J (t + u))| <= |exp(J t)| |exp(J u)|, nothing larger can come after a time when it is below 1.
void iterate_growth(const Sliding& s, double growth_rate, Transient& result) {
  const double n = double(s.size() * s.dof()), budget = 1e9;  // unknowns times steps
  const double quick = std::max(result.abscissa, std::sqrt(s.A * s.K0)), all = s.imaginary_bound();
  const double horizon = 40 / std::min(-growth_rate, quick);
  // In the continuum waves much shorter than what varies are left out: beyond some frequency they are the grid's.
  double fastest = all;
  if (s.scene.form == Form::continuum && n > most_dense) {
    const double length = s.scene.spread == 0 ? s.scene.c : std::min(s.scene.c, s.scene.spread_length);
    fastest = std::min({all, 10 * (std::sqrt(s.A * s.K0) + s.scene.c / length), resolved_frequency(s)});
  }
  const bool whole = fastest == all;
  const double dt = 0.5 / fastest;
  result.frequency = fastest;
  const Energy M(s);
  const Propagator propagator(s, dt, !whole);
  double spent = 0, last = 1, before = 1;
  std::vector<Complex> mixed = any_vector(s.size() * s.dof(), true), x = mixed;
  {
    double size = 0;
    const std::vector<Complex> image = M.apply(mixed);
    for (std::size_t i = 0; i < mixed.size(); ++i) size += (std::conj(mixed[i]) * image[i]).real();
    for (Complex& z : mixed) z /= std::sqrt(size);
  }
  result.exact = false;
  long steps = std::max(1L, std::lround(0.2 / (quick * dt)));
  std::vector<Sample> samples{{0, 1}};
  const auto norm_at = [&](long count, double tolerance) {
    const auto forward = [&](const std::vector<Complex>& v) {
      spent += n * double(count);
      return propagator(v, count, false);
    };
    const auto transposed = [&](const std::vector<Complex>& v) {
      spent += n * double(count);
      return propagator(v, count, true);
    };
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += 0.1 * mixed[i];  // another direction may take the lead
    const double g = energy_norm(M, forward, transposed, x, tolerance, 30);
    samples.push_back({double(count) * dt, g});
    return g;
  };
  while (spent < budget && double(steps) * dt < horizon) {
    before = last;
    last = norm_at(steps, 1e-3);
    if (last < 1 && before < 1) {
      result.exact = whole;
      break;
    }
    steps = std::max(steps + 1, std::lround(1.15 * double(steps)));
  }
  const auto by_time = [](const Sample& a, const Sample& b) { return a.t < b.t; };
  const auto by_growth = [](const Sample& a, const Sample& b) { return a.g < b.g; };
  for (int refine = 0; refine < 12 && spent < 2 * budget; ++refine) {  // the widest gap beside what is nearly the top
    std::sort(samples.begin(), samples.end(), by_time);
    const double near = 0.97 * std::max_element(samples.begin(), samples.end(), by_growth)->g;
    std::size_t widest = 0;
    double width = 1.1 * dt;
    for (std::size_t k = 0; k + 1 < samples.size(); ++k)
      if (std::max(samples[k].g, samples[k + 1].g) >= near && samples[k + 1].t - samples[k].t > width) {
        width = samples[k + 1].t - samples[k].t;
        widest = k;
      }
    if (width <= 1.1 * dt) break;
    norm_at(std::lround((samples[widest].t + width / 2) / dt), 1e-4);
  }
  // beside the top, in intervals halved until the parabola through three of them is the norm to 1e-6
  for (int halve = 0; halve < 16; ++halve) {
    std::sort(samples.begin(), samples.end(), by_time);
    const auto top = std::max_element(samples.begin(), samples.end(), by_growth);
    result.growth = top->g;
    result.time = top->t;
    if (top == samples.begin() || top + 1 == samples.end()) return;
    const Sample left = *(top - 1), middle = *top, right = *(top + 1), best = parabola_top(left, middle, right);
    result.growth = best.g;
    result.time = best.t;
    const bool first = middle.t - left.t > right.t - middle.t;
    const long from = std::lround((first ? left.t : middle.t) / dt);
    const long to = std::lround((first ? middle.t : right.t) / dt);
    if (to - from < 2 || best.g / std::min(left.g, right.g) < 1 + 1e-4 || spent > 4 * budget) return;
    norm_at((from + to) / 2, 1e-7);
  }
}

// |(z - J)^-1| in the energy norm.
double resolvent_norm_with(const Sliding& s, const Energy& M, Complex z) {
  BandLU lu, conjugate;
  s.factor(z, lu);
  s.factor(std::conj(z), conjugate);
  const auto forward = [&](const std::vector<Complex>& v) { return resolvent(s, z, lu, v); };
  const auto transposed = [&](const std::vector<Complex>& v) {
    return transposed_resolvent(s, std::conj(z), conjugate, v);
  };
  std::vector<Complex> x = any_vector(s.size() * s.dof(), false);
  return energy_norm(M, forward, transposed, x, 1e-4, 40);
}

}  // namespace

std::optional<Transient> transient_growth(const Sliding& s, double growth_rate, bool iterate) {
  Transient result;
  result.abscissa = -std::numeric_limits<double>::infinity();
  // growth is bounded only where sliding is stable; the largest comes within a few damping or oscillation times
  const double slow = std::min(std::abs(growth_rate), std::sqrt(s.A * s.K0) + 1e-300);
  const double horizon = growth_rate < 0 ? 6 / slow : 0;
  const std::size_t d = s.dof();
  const std::vector<Sliding::Wave> waves = s.exact_waves();
  if (!waves.empty() && !iterate) {
    result.method = "wavenumbers";
    // a block for every wavenumber, in P = sqrt(K/A) p, e, t
    const double h = s.scene.form == Form::chain ? 1 : s.scene.h();
    for (const Sliding::Wave& w : waves) {
      const double K = s.K0 + s.K1 * symbol(s.scene.order, h, w.k);
      if (!(K > 0)) continue;
      const double root = std::sqrt(K / s.A);
      Matrix M(d * d, 0.);
      const auto entry = [&](std::size_t i, std::size_t j) -> double& { return M[j * d + i]; };
      entry(0, 0) = -s.A * (s.B + s.F_psi[0]);
      entry(0, 1) = s.A * root;
      entry(1, 0) = (-K + s.s_delta * s.F_psi[0]) / root;
      entry(1, 1) = -s.s_delta;
      if (d == 3) {
        entry(0, 2) = -s.A * root * s.F_state[0];
        entry(1, 2) = s.s_delta * s.F_state[0];
        entry(2, 0) = s.g_psi[0] / root;
        entry(2, 2) = -s.r[0];
      }
      if (growth_rate < 0) grow_small(M, PetscBLASInt(d), result);
      else result.abscissa = std::max(result.abscissa, abscissa_of(M, PetscBLASInt(d)));
    }
    return result;
  }
  if (!s.symmetric || s.neutral()) return std::nullopt;
  if (iterate || double(s.size() * d) > most_dense) {
    result.method = "iteration";
    result.abscissa = band_abscissa(s);
    const double rounding = 1e-8 * std::sqrt(s.A * s.largest_stiffness());
    if (growth_rate < 0 && result.abscissa > rounding) iterate_growth(s, growth_rate, result);
    return result;
  }
  result.method = "dense";
  // dense: W (K0 - K1 D2) = L L^T, P = L^T p/sqrt(A), e and t times the root of the weight
  const std::size_t n = s.size(), m = n * d;
  PetscBLASInt size = PetscBLASInt(n), info = 0;
  Matrix L(n * n, 0.);
  for (const Sliding::Entry& e : s.entries())
    if (e.row % d == 1 && e.column % d == 0) L[(e.column / d) * n + e.row / d] -= s.weight[e.row / d] * e.value;
  for (std::size_t i = 0; i < n; ++i) L[i * n + i] += s.weight[i] * s.s_delta * s.F_psi[i];
  LAPACKpotrf_("L", &size, L.data(), &size, &info);
  if (info != 0) return std::nullopt;
  const auto lower = [&](std::size_t i, std::size_t j) { return i >= j ? L[j * n + i] : 0.; };
  // columns of the inverse of L^T, by back substitution
  Matrix inverse(n * n, 0.);  // (L^T)^-1
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = n; i-- > 0;) {
      double sum = i == j ? 1 : 0;
      for (std::size_t k = i + 1; k < n; ++k) sum -= lower(k, i) * inverse[j * n + k];
      inverse[j * n + i] = sum / lower(i, i);
    }
  // M = T J T^-1 column by column, the order of unknowns: all P, all e, all t
  Matrix M(m * m, 0.);
  std::vector<Complex> x(m), y(m);
  for (std::size_t column = 0; column < m; ++column) {
    std::fill(x.begin(), x.end(), Complex(0));
    const std::size_t c = column / n, j = column % n;
    if (c == 0) {
      for (std::size_t i = 0; i < n; ++i) x[i * d] = std::sqrt(s.A) * inverse[j * n + i];
    } else {
      x[j * d + c] = 1 / std::sqrt(s.weight[j]);
    }
    s.multiply(x.data(), y.data());
    for (std::size_t i = 0; i < n; ++i) {
      double P = 0;
      for (std::size_t k = i; k < n; ++k) P += lower(k, i) * y[k * d].real();
      M[column * m + i] = P / std::sqrt(s.A);
      for (std::size_t k = 1; k < d; ++k) M[column * m + k * n + i] = std::sqrt(s.weight[i]) * y[i * d + k].real();
    }
  }
  grow_large(M, PetscBLASInt(m), horizon, result);
  return result;
}

double resolvent_norm(const Sliding& s, Complex z) {
  if (!s.symmetric || s.neutral()) return std::nan("");
  const Energy M(s);
  return resolvent_norm_with(s, M, z);
}

std::vector<double> pseudospectrum(MPI_Comm comm, const Sliding& s, const std::vector<double>& re,
                                   const std::vector<double>& im) {
  if (!s.symmetric || s.neutral()) return {};
  int ranks = 1, rank = 0;
  MPI_Comm_size(comm, &ranks);
  MPI_Comm_rank(comm, &rank);
  const Energy M(s);
  std::vector<double> norms(re.size() * im.size(), 0.);
  for (std::size_t k = 0; k < norms.size(); ++k)
    if (int(k) % ranks == rank) norms[k] = resolvent_norm_with(s, M, {re[k % re.size()], im[k / re.size()]});
  MPI_Allreduce(MPI_IN_PLACE, norms.data(), int(norms.size()), MPI_DOUBLE, MPI_SUM, comm);
  return norms;
}

}  // namespace stickslip
