// The motion of chains of rate-and-state blocks (laboratory.py, which compiles this), by a method that the
// program does not have: linearly implicit Euler steps, extrapolated. x of a block: ln psi, ln theta, with
// mass eta. On scenes of 1 to 20 blocks it agrees with SciPy's Radau and LSODA to their tolerances of 1e-8
// and 1e-9.
#include <algorithm>
#include <cmath>
#include <vector>

namespace {

constexpr int reach = 5;  // how far apart unknowns are that one equation holds

struct Dual {  // a number and its derivative
  double v = 0, d = 0;
  Dual(double value = 0, double slope = 0) : v(value), d(slope) {}
};
Dual operator+(Dual a, Dual b) { return {a.v + b.v, a.d + b.d}; }
Dual operator-(Dual a, Dual b) { return {a.v - b.v, a.d - b.d}; }
Dual operator*(Dual a, Dual b) { return {a.v * b.v, a.d * b.v + a.v * b.d}; }
Dual operator/(Dual a, Dual b) { return {a.v / b.v, (a.d - a.v / b.v * b.d) / b.v}; }
Dual exp(Dual a) { return {std::exp(a.v), std::exp(a.v) * a.d}; }
Dual asinh_of_exp(Dual z) {  // and exp(z)/sqrt(1 + exp(2 z)), its slope
  const double e = std::exp(std::min(z.v, 30.));
  return {z.v < 30 ? std::asinh(e) : z.v + std::log(2.), e / std::sqrt(1 + e * e) * z.d};
}
Dual slope_of_asinh(Dual z) {
  const double e = std::exp(std::min(z.v, 30.)), root = std::sqrt(1 + e * e);
  return {e / root, e / (root * root * root) * z.d};
}

}  // namespace

struct Chain {
  int n, regularised, slip_law;
  double m, k0, k1, f0, zeta, v, a, b, D, mu0, psi0;

  int each() const { return m > 0 ? 3 : 2; }

  void rates(const Dual* x, Dual* x_t) const {
    const int w = each();
    for (int i = 0; i < n; ++i) {
      const Dual y = x[i * w], s = x[i * w + 1], psi = exp(y);
      const Dual state_t = slip_law ? Dual(-1) * psi / Dual(D) * (y - Dual(std::log(D)) + s)
                                    : exp(Dual(-1) * s) - psi / Dual(D);
      Dual pull = Dual(k0) * (Dual(v) - psi);
      if (i > 0) pull = pull + Dual(k1) * (exp(x[(i - 1) * w]) - psi);
      if (i + 1 < n) pull = pull + Dual(k1) * (exp(x[(i + 1) * w]) - psi);
      const Dual age = Dual(b) * (s + Dual(std::log(psi0 / D)));
      const Dual z = y - Dual(std::log(2 * psi0)) + (Dual(mu0) + age) / Dual(a);
      x_t[i * w + 1] = state_t;
      if (m > 0) {
        const Dual F = regularised ? Dual(a) * asinh_of_exp(z)
                                   : Dual(mu0) + Dual(a) * (y - Dual(std::log(psi0))) + age;
        x_t[i * w] = (Dual(f0) * (x[i * w + 2] - F) - Dual(zeta) * psi) / (Dual(m) * psi);
        x_t[i * w + 2] = pull / Dual(f0);
      } else {
        const Dual share = regularised ? slope_of_asinh(z) : Dual(1);
        x_t[i * w] = (pull - Dual(f0 * b) * share * state_t) / (Dual(f0 * a) * share + Dual(zeta) * psi);
      }
    }
  }
};

namespace {

class Extrapolation {
 public:
  Extrapolation(const Chain& chain, double tolerance)
      : chain_(chain), N_(chain.n * chain.each()), tolerance_(tolerance), J_(N_ * N_), LU_(N_ * N_),
        pivot_(N_), f_(N_), dual_(N_), dual_t_(N_) {}

  // One step from x, and its error over what is allowed; infinite where it has none. `rows`: how many it
  // took.
  double step(const std::vector<double>& x, double h, std::vector<double>& end, int& rows) {
    slopes(x);
    std::vector<std::vector<double>> T;
    double error = INFINITY;
    for (rows = 1; rows <= most; ++rows) {
      T.push_back(x);
      if (!euler(T.back(), h, rows)) return INFINITY;
      for (int k = rows - 2; k >= 0; --k)  // T[k] becomes the entry of this row that is best to that order
        for (int i = 0; i < N_; ++i)
          T[k][i] = T[k + 1][i] + (T[k + 1][i] - T[k][i]) / (double(rows) / (k + 1) - 1);
      if (rows < 3) continue;
      error = 0;
      for (int i = 0; i < N_; ++i)
        error = std::max(error, std::abs(T[0][i] - T[1][i]) / (tolerance_ * (1 + std::abs(T[0][i]))));
      if (!(error > 1)) break;
    }
    rows = std::min(rows, most);
    end = T[0];
    return std::isfinite(error) ? error : INFINITY;
  }

  static constexpr int most = 9;

 private:
  void slopes(const std::vector<double>& x) {
    for (int first = 0; first <= 2 * reach; ++first) {  // unknowns that far apart share no equation
      for (int j = 0; j < N_; ++j) dual_[j] = {x[j], double(j % (2 * reach + 1) == first)};
      chain_.rates(dual_.data(), dual_t_.data());
      for (int j = first; j < N_; j += 2 * reach + 1)
        for (int i = std::max(0, j - reach); i < std::min(N_, j + reach + 1); ++i)
          J_[i * N_ + j] = dual_t_[i].d;
    }
  }

  // (1 - h J) (x' - x) = h f(x), `count` times.
  bool euler(std::vector<double>& x, double whole, int count) {
    const double h = whole / count;
    for (int i = 0; i < N_; ++i)
      for (int j = std::max(0, i - reach); j < std::min(N_, i + 2 * reach + 1); ++j)
        LU_[i * N_ + j] = (i == j) - h * J_[i * N_ + j];
    for (int k = 0; k < N_; ++k) {
      const int below = std::min(N_, k + reach + 1), beside = std::min(N_, k + 2 * reach + 1);
      pivot_[k] = k;
      for (int i = k + 1; i < below; ++i)
        if (std::abs(LU_[i * N_ + k]) > std::abs(LU_[pivot_[k] * N_ + k])) pivot_[k] = i;
      if (!(std::abs(LU_[pivot_[k] * N_ + k]) > 0)) return false;
      for (int j = k; j < beside; ++j) std::swap(LU_[k * N_ + j], LU_[pivot_[k] * N_ + j]);
      for (int i = k + 1; i < below; ++i) {
        const double part = LU_[i * N_ + k] /= LU_[k * N_ + k];
        for (int j = k + 1; j < beside; ++j) LU_[i * N_ + j] -= part * LU_[k * N_ + j];
      }
    }
    for (int s = 0; s < count; ++s) {
      std::copy(x.begin(), x.end(), dual_.begin());
      chain_.rates(dual_.data(), dual_t_.data());
      for (int i = 0; i < N_; ++i) f_[i] = h * dual_t_[i].v;
      for (int k = 0; k < N_; ++k) {
        std::swap(f_[k], f_[pivot_[k]]);
        for (int i = k + 1; i < std::min(N_, k + reach + 1); ++i) f_[i] -= LU_[i * N_ + k] * f_[k];
      }
      for (int k = N_ - 1; k >= 0; --k) {
        for (int j = k + 1; j < std::min(N_, k + 2 * reach + 1); ++j) f_[k] -= LU_[k * N_ + j] * f_[j];
        f_[k] /= LU_[k * N_ + k];
      }
      for (int i = 0; i < N_; ++i) {
        x[i] += f_[i];
        if (!(std::abs(f_[i]) < 50)) return false;
      }
    }
    return true;
  }

  const Chain& chain_;
  int N_;
  double tolerance_;
  std::vector<double> J_, LU_;
  std::vector<int> pivot_;
  std::vector<double> f_;
  std::vector<Dual> dual_, dual_t_;
};

}  // namespace

// From x through the `count` ascending `times`, whose last is the end: x there into `out`. Times at which
// ln psi of the first block rises through ln v, and its rate there, into `passages` (at most `most` pairs):
// how many there are; -1 where the step shrinks to nothing.
extern "C" int follow(const Chain* chain, double tolerance, const double* start, int count,
                      const double* times, double* out, int most, double* passages) {
  const int N = chain->n * chain->each();
  Extrapolation method(*chain, tolerance);
  std::vector<double> x(start, start + N), end, part;
  const double level = std::log(chain->v);
  double t = 0, h = 1e-6 * chain->D / chain->v, before;
  int found = 0, rows, others;
  for (int k = 0; k < count; ++k) {
    while (t < times[k]) {
      const bool last = t + h >= times[k];
      const double taken = last ? times[k] - t : h;
      const double error = method.step(x, taken, end, rows);
      if (!(error <= 1)) {
        h = taken * (std::isfinite(error) ? std::max(0.1, 0.8 * std::pow(error, -1. / rows)) : 0.2);
        if (t + h == t) return -1;
        continue;
      }
      if (x[0] < level && end[0] >= level && found < most) {
        double low = 0, high = taken, below = x[0] - level, above = end[0] - level, at = 0;
        for (int round = 0; round < 60 && high - low > 1e-14 * taken; ++round) {  // secants, and halves
          at = round % 3 < 2 ? low - below * (high - low) / (above - below) : (low + high) / 2;
          if (!(method.step(x, at, part, others) <= 1)) break;
          (part[0] < level ? low : high) = at;
          (part[0] < level ? below : above) = part[0] - level;
          if (std::abs(part[0] - level) < 1e-13 * std::abs(level)) break;
        }
        passages[2 * found] = t + at;
        before = part[0];
        method.step(x, 0.99 * at, part, others);  // the rate of a psi that is the force's slave is no use
        passages[2 * found++ + 1] = (before - part[0]) / (0.01 * at);
      }
      t = last ? times[k] : t + taken;
      x = end;
      const double longer = 0.8 * std::pow(std::max(error, 1e-8), -1. / rows) * (rows < 6 ? 1.5 : 1);
      if (!last || taken * longer < h) h = taken * std::clamp(longer, 0.3, 4.);
    }
    std::copy(x.begin(), x.end(), out + k * N);
  }
  return found;
}
