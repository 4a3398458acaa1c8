#include "stickslip/stability/transient.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <unsupported/Eigen/MatrixFunctions>

#include "stability/numerical_abscissa.hpp"
#include "stickslip/numerics/interpolation.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

namespace {

constexpr double most_dense = 400;  // unknowns

struct Sample {
  double t, g;  // g = |exp(M t)|
};

// ---- small and dense matrices
// -------------------------------------------------------------------------------------

using Matrix = Eigen::MatrixXd;

double largest_eigenvalue_of(const Matrix& symmetric) {
  const Eigen::Tridiagonalization<Matrix> T(symmetric);
  return largest_eigenvalue(T.diagonal(), T.subDiagonal());
}

double two_norm(const Matrix& x) { return std::sqrt(std::max(0., largest_eigenvalue_of(x.transpose() * x))); }

Matrix exponential(const Matrix& M, double t) { return (M * t).exp(); }

// The numerical abscissa: the largest eigenvalue of the symmetric part. |exp(M (t + u))| <= exp(abscissa u)
// |exp(M t)|.
double abscissa_of(const Matrix& M) { return largest_eigenvalue_of((M + M.transpose()) / 2); }

// The largest |exp(M t)| of a small matrix, beside `result`. From a time with norm g nothing above `best` can
// come sooner than ln(best/g)/abscissa later: steps are as long as that and a slack, a coarse one first to
// know what is high, then one of 1e-4, so that no peak is jumped over. Tops seen on the way are refined. As
// |exp(M (t + u))| <= |exp(M t)| |exp(M u)|, nothing follows a norm of 1.
void grow_small(const Matrix& M, Transient& result) {
  const double abscissa = abscissa_of(M);
  result.abscissa = std::max(result.abscissa, abscissa);
  if (!(abscissa > 1e-12 * M.norm())) return;
  const auto at = [&](double t) { return Sample{t, two_norm(exponential(M, t))}; };
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

// The top beside a sample, at intervals halved ten times. (No parabola: where two directions exchange the
// lead, the top is a corner.) `step` = exp(M h), h between the samples.
Sample refine_top(const Matrix& M, const Matrix& step, Sample left, Sample middle, Sample right) {
  Matrix x_left = exponential(M, left.t), x_middle = x_left * step;
  double width = middle.t - left.t;
  for (int level = 0; level < 10; ++level) {
    const Matrix half = exponential(M, width /= 2);
    Matrix x_first = x_left * half, x_second = x_middle * half;
    const Sample first{left.t + width, two_norm(x_first)}, second{middle.t + width, two_norm(x_second)};
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
  return middle;
}

// The same for a large matrix: at up to 400 even times h apart, until the norm is 1, then beside those of the
// eight highest tops that come within a tenth of the highest: between samples a lower one may rise further.
void sample_large(const Matrix& M, double h, double horizon, Transient& result) {
  const Matrix step = exponential(M, h);
  std::vector<Sample> samples{{0, 1}};
  for (Matrix x = step; samples.back().t < horizon && samples.size() <= 400; x = x * step) {
    samples.push_back({double(samples.size()) * h, two_norm(x)});
    if (samples.back().g <= 1) break;
  }
  std::vector<std::size_t> tops;
  for (std::size_t k = 1; k + 1 < samples.size(); ++k)
    if (samples[k].g >= samples[k - 1].g && samples[k].g > samples[k + 1].g) tops.push_back(k);
  std::sort(tops.begin(), tops.end(),
            [&](std::size_t a, std::size_t b) { return samples[a].g > samples[b].g; });
  if (tops.size() > 8) tops.resize(8);
  for (const std::size_t k : tops) {
    if (samples[k].g < 0.9 * samples[tops.front()].g) break;
    const Sample top = refine_top(M, step, samples[k - 1], samples[k], samples[k + 1]);
    if (top.g <= result.growth) continue;
    result.growth = top.g;
    result.time = top.t;
  }
}

// Between samples 0.1/abscissa apart nothing rises by more than a tenth. Where decay is so slow that they do
// not reach to its end, the rest is looked at in longer steps.
void grow_large(const Matrix& M, double horizon, Transient& result) {
  result.abscissa = abscissa_of(M);
  if (horizon <= 0 || !(result.abscissa > 1e-12 * M.norm())) return;
  const double fine = std::min(horizon / 100, 0.1 / result.abscissa);
  sample_large(M, fine, horizon, result);
  if (400 * fine < horizon) sample_large(M, horizon / 400, horizon, result);
}

// The operator on one wave, in the energy's own unknowns P = sqrt(K/A) p, e, t; K > 0 is the wave's
// stiffness.
Matrix wave_matrix(const LinearPoint& medium, int dof, double kappa2) {
  const double root[] = {std::sqrt(medium.stiffness(kappa2) / medium.A), 1, 1};
  Matrix M(dof, dof);
  medium.block(Part::full, kappa2).write(dof, M.data());  // by rows
  M.transposeInPlace();
  for (int i = 0; i < dof; ++i)
    for (int j = 0; j < dof; ++j) M(i, j) *= root[i] / root[j];
  return M;
}

// The whole operator T J T^-1 in the energy's own unknowns, all P, all e, all t: with W (K0 - K1 D2) = L L^T,
// P = L^T p/sqrt(A), e and t times the root of the weight. Nothing where that is not positive definite.
std::optional<Matrix> whole_matrix(const LinearisedOperator& s) {
  const std::size_t n = s.size(), d = s.dof(), m = n * d;
  Matrix stiffness = Matrix::Zero(n, n);  // its lower triangle
  for (std::size_t i = 0; i < n; ++i) {
    stiffness(i, i) = s.coupling.weight[i] * s.point(i).K0;
    for (const Coupling::Term& t : s.coupling.row(i))
      if (t.column <= i) stiffness(i, t.column) += s.coupling.weight[i] * s.K1 * t.value;
  }
  const Eigen::LLT<Matrix> factors(stiffness);
  if (factors.info() != Eigen::Success) return std::nullopt;
  const Matrix U = factors.matrixU();  // L^T
  Matrix M = Matrix::Zero(m, m);
  const auto scale = [&](std::size_t i, std::size_t c) {
    return c == 0 ? 1 / std::sqrt(s.A) : std::sqrt(s.coupling.weight[i]);
  };
  for (const LinearisedOperator::Entry& e : s.entries())
    M(e.row % d * n + e.row / d, e.column % d * n + e.column / d) +=
        e.value * scale(e.row / d, e.row % d) / scale(e.column / d, e.column % d);
  M.leftCols(n) *= U.inverse();
  M.topRows(n) = (U * M.topRows(n)).eval();
  return M;
}

// ---- many nodes
// ---------------------------------------------------------------------------------------------------

// exp(J t) by steps of a Pade approximant r, one complex solve a step: r(z) = r(infinity) + 2 Re [a/(z - z0)]
// for real vectors. (2, 2), of order 4, conserves the energy of waves without friction at any step; (1, 2),
// of order 3, damps those that the step does not resolve.
class Propagator {
 public:
  Propagator(const LinearisedOperator& s, double dt, bool damps) : s_(s), dt_(dt), beyond_(damps ? 0 : 1) {
    const Complex z0 = damps ? Complex(2, std::sqrt(2.)) : Complex(3, std::sqrt(3.));
    // (6 + 2 z)/(z^2 - 4 z + 6), or 1 + 12 z/(z^2 - 6 z + 12)
    residue_ = (damps ? 6. + 2. * z0 : 12. * z0) / (z0 - std::conj(z0));
    sigma_ = z0 / dt;
    s.factor(sigma_, lu_);
  }
  std::vector<Complex> operator()(std::vector<Complex> x, long steps, bool transpose) const {
    for (long k = 0; k < steps; ++k) {
      const std::vector<Complex> y =
          transpose ? s_.resolvent_transposed(sigma_, lu_, x) : s_.resolvent(sigma_, lu_, x);
      for (std::size_t i = 0; i < x.size(); ++i)
        x[i] = beyond_ * x[i].real() + 2 * (residue_ * y[i]).real() / dt_;
    }
    return x;
  }

 private:
  const LinearisedOperator& s_;
  double dt_, beyond_;
  Complex sigma_, residue_;
  BandLU lu_;
};

// The top of the parabola of ln g through three samples.
Sample parabola_top(const Sample& a, const Sample& b, const Sample& c) {
  const Lagrange parabola({a.t, b.t, c.t});
  const double logarithm[] = {std::log(a.g), std::log(b.g), std::log(c.g)};
  const double bend = 2 * std::inner_product(logarithm, logarithm + 3, parabola.leading().data(), 0.),
               t = std::clamp(b.t - parabola.slope(logarithm, b.t) / bend, a.t, c.t);
  if (!(bend < 0)) return b;
  return {t, std::exp(parabola.value(logarithm, t))};
}

// The largest |exp(J t)| by Lanczos' iteration at several times, each from the vector of the last.
class GrowthInTime {
 public:
  GrowthInTime(const LinearisedOperator& s, double growth_rate, Transient& result)
      : s_(s), result_(result), unknowns_(s.unknowns()),
        quick_(std::max(result.abscissa, std::sqrt(s.A * s.K0))),
        horizon_(40 / std::min(-growth_rate, quick_)), energy_(s), dt_(0.5 / (result.frequency = fastest())),
        propagator_(s, dt_, result.frequency < s.imaginary_bound()), mixed_(any_vector(s.unknowns(), true)),
        x_(mixed_) {
    const double size = energy_.norm(mixed_);
    for (Complex& z : mixed_) z /= size;
  }

  void find() {
    climb();
    close_gaps();
    halve_beside_top();
  }

 private:
  // In the continuum waves much shorter than what varies are left out: beyond some frequency they are the
  // grid's.
  double fastest() const {
    const Scene& scene = s_.scene;
    const double all = s_.imaginary_bound();
    if (scene.form == Form::chain || unknowns_ <= most_dense) return all;
    const double length = std::min(scene.c, scene.friction_length());
    return std::min({all, 10 * (std::sqrt(s_.A * s_.K0) + scene.c / length), resolved_frequency(s_)});
  }

  double norm_at(long steps, double tolerance) {
    const auto map = [&](bool transposed) {
      return [this, steps, transposed](const std::vector<Complex>& v) {
        spent_ += unknowns_ * double(steps);
        return propagator_(v, steps, transposed);
      };
    };
    // another direction may take the lead
    for (std::size_t i = 0; i < x_.size(); ++i) x_[i] += 0.1 * mixed_[i];
    const double g = energy_.norm(map(false), map(true), x_, tolerance, 30);
    samples_.push_back({double(steps) * dt_, g});
    return g;
  }

  // From one time to the next. As |exp(J (t + u))| <= |exp(J t)| |exp(J u)|, nothing larger can come after a
  // time when it is below 1.
  void climb() {
    result_.exact = false;
    double last = 1, before = 1;
    for (long steps = std::max(1L, std::lround(0.2 / (quick_ * dt_)));
         spent_ < budget_ && double(steps) * dt_ < horizon_;
         steps = std::max(steps + 1, std::lround(1.15 * double(steps)))) {
      before = std::exchange(last, norm_at(steps, 1e-3));
      if (last < 1 && before < 1) {
        result_.exact = result_.frequency == s_.imaginary_bound();
        return;
      }
    }
  }

  // The widest gap beside what is nearly the top, twelve times.
  void close_gaps() {
    for (int round = 0; round < 12 && spent_ < 2 * budget_; ++round) {
      const double near = 0.97 * top()->g;
      std::size_t widest = 0;
      double width = 1.1 * dt_;
      for (std::size_t k = 0; k + 1 < samples_.size(); ++k)
        if (std::max(samples_[k].g, samples_[k + 1].g) >= near && samples_[k + 1].t - samples_[k].t > width)
          width = samples_[widest = k + 1].t - samples_[k].t;
      if (widest == 0) return;
      norm_at(std::lround((samples_[widest].t - width / 2) / dt_), 1e-4);
    }
  }

  // Intervals halved until the parabola through three samples is the norm to 1e-6.
  void halve_beside_top() {
    for (int round = 0; round < 16; ++round) {
      const auto highest = top();
      Sample best = *highest;
      const bool between = highest != samples_.begin() && highest + 1 != samples_.end();
      if (between) best = parabola_top(*(highest - 1), *highest, *(highest + 1));
      result_.growth = best.g;
      result_.time = best.t;
      if (!between) return;
      const Sample left = *(highest - 1), middle = *highest, right = *(highest + 1);
      const bool first = middle.t - left.t > right.t - middle.t;
      const long from = std::lround((first ? left.t : middle.t) / dt_);
      const long to = std::lround((first ? middle.t : right.t) / dt_);
      if (to - from < 2 || best.g / std::min(left.g, right.g) < 1 + 1e-4 || spent_ > 4 * budget_) return;
      norm_at((from + to) / 2, 1e-7);
    }
  }

  // The highest sample; they are put in the order of time.
  std::vector<Sample>::const_iterator top() {
    std::sort(samples_.begin(), samples_.end(), [](const Sample& a, const Sample& b) { return a.t < b.t; });
    return std::max_element(samples_.begin(), samples_.end(),
                            [](const Sample& a, const Sample& b) { return a.g < b.g; });
  }

  static constexpr double budget_ = 1e9;  // unknowns times steps
  const LinearisedOperator& s_;
  Transient& result_;
  const double unknowns_, quick_, horizon_;
  const EnergyNorm energy_;
  const double dt_;
  const Propagator propagator_;
  std::vector<Complex> mixed_, x_;
  std::vector<Sample> samples_{{0, 1}};
  double spent_ = 0;
};

}  // namespace

std::optional<Transient> transient_growth(const LinearisedOperator& s, double growth_rate, bool iterate) {
  Transient result;
  const std::vector<LinearisedOperator::Wave> waves = s.exact_waves();
  if (!waves.empty() && !iterate) {
    result.method = "wavenumbers";
    result.abscissa = -std::numeric_limits<double>::infinity();
    for (const LinearisedOperator::Wave& w : waves) {
      const double kappa2 = s.symbol(w.k);
      if (!(s.point(0).stiffness(kappa2) > 0)) continue;
      const Matrix M = wave_matrix(s.point(0), int(s.dof()), kappa2);
      if (growth_rate < 0)
        grow_small(M, result);  // growth is bounded only where sliding is stable
      else
        result.abscissa = std::max(result.abscissa, abscissa_of(M));
    }
    return result;
  }
  if (!has_energy(s)) return std::nullopt;
  if (iterate || double(s.unknowns()) > most_dense) {
    if (s.N > 0) return std::nullopt;  // the abscissa's matrix is not banded like the stencil then
    result.method = "iteration";
    result.abscissa = band_abscissa(s);
    const double rounding = 1e-8 * std::sqrt(s.A * s.largest_stiffness());
    if (growth_rate < 0 && result.abscissa > rounding) GrowthInTime(s, growth_rate, result).find();
    return result;
  }
  result.method = "dense";
  const std::optional<Matrix> M = whole_matrix(s);
  if (!M) return std::nullopt;
  // the largest comes within a few damping or oscillation times
  const double slow = std::min(std::abs(growth_rate), std::sqrt(s.A * s.K0) + 1e-300);
  grow_large(*M, growth_rate < 0 ? 6 / slow : 0, result);
  return result;
}

}  // namespace stickslip
