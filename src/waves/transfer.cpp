// Small dense linear systems with complex coefficients and several right-hand sides, eight of the same shape
// at once, by elimination with row exchanges in each.

#include "waves/spectral_line.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "base/pulse.hpp"
#include "model/kernel.hpp"
#include "numerics/elementary.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

// Rows of the matrices, each with the right-hand sides behind it, which become the solution; what belongs to
// a system stands in its lane.
template <int unknowns, int sides>
struct StageSystems {
  static constexpr int n = unknowns, width = n + sides;
  alignas(64) double re[n][width][kernel::lanes], im[n][width][kernel::lanes];
};

template <int unknowns, int sides>
struct StageElimination {
  using Systems = StageSystems<unknowns, sides>;
  using Lanes = kernel::Lanes;
  static constexpr int n = Systems::n, width = Systems::width;

  // False where a matrix is singular.
  bool operator()(Systems* systems) const {
    const auto re = [&](int i, int j) { return kernel::lanes_at(systems->re[i][j]); };
    const auto im = [&](int i, int j) { return kernel::lanes_at(systems->im[i][j]); };
    const auto size = [&](int i, int k) { return *re(i, k) * *re(i, k) + *im(i, k) * *im(i, k); };
    Lanes inverse_re[n], inverse_im[n];
    for (int k = 0; k < n; ++k) {
      Lanes most = size(k, k);
      for (int i = k + 1; i < n; ++i) {  // the larger pivot comes to row k
        const Lanes here = size(i, k);
        const auto larger = here > most;
        most = larger ? here : most;
        for (int j = k; j < width; ++j)
          for (const auto& [a, b] : {std::pair{re(k, j), re(i, j)}, std::pair{im(k, j), im(i, j)}}) {
            const Lanes of_k = *a;
            *a = larger ? *b : of_k;
            *b = larger ? of_k : *b;
          }
      }
      for (int lane = 0; lane < kernel::lanes; ++lane)
        if (!(most[lane] > 0)) return false;
      inverse_re[k] = *re(k, k) / most;
      inverse_im[k] = -*im(k, k) / most;
      for (int i = k + 1; i < n; ++i) {
        const Lanes f = *re(i, k) * inverse_re[k] - *im(i, k) * inverse_im[k],
                    g = *re(i, k) * inverse_im[k] + *im(i, k) * inverse_re[k];
        for (int j = k + 1; j < width; ++j) {
          *re(i, j) -= f * *re(k, j) - g * *im(k, j);
          *im(i, j) -= f * *im(k, j) + g * *re(k, j);
        }
      }
    }
    for (int k = n - 1; k >= 0; --k)
      for (int j = n; j < width; ++j) {
        Lanes x = *re(k, j), y = *im(k, j);
        for (int i = k + 1; i < n; ++i) {
          x -= *re(k, i) * *re(i, j) - *im(k, i) * *im(i, j);
          y -= *re(k, i) * *im(i, j) + *im(k, i) * *re(i, j);
        }
        *re(k, j) = x * inverse_re[k] - y * inverse_im[k];
        *im(k, j) = x * inverse_im[k] + y * inverse_re[k];
      }
    return true;
  }

  // In the version that suits this processor.
  static bool solve(Systems* systems) {
    static const auto best = kernel::compiled<std::function<bool(Systems*)>>(StageElimination());
    return best(systems);
  }
};

namespace {

using Complex = std::complex<double>;
constexpr int stages = 5, max_dim = train_max_dim;
constexpr double longest_phase = 1.5;  // of the waves in one interval: the five points give 1e-9 then
constexpr double dead = 30;            // a wave that has decayed by exp(-dead) need not be resolved
// relative change of C + lambda in its own time from which on they are made
constexpr double made = 3e-4;
constexpr double stiff = 8;  // decay in an interval beyond which Radau IIA takes over from Gauss
constexpr size_t most_intervals = 60000;
constexpr size_t together = kernel::lanes;  // intervals that are solved for at once
constexpr int lowest_level = -20;           // the coarsest mesh is for frequencies from 0 to 2^lowest_level

}  // namespace

// The train's Jacobians on a mesh that resolves waves up to a frequency c |Lambda|.
class TransferMesh {
 public:
  TransferMesh(const Train& train, double frequency, int refine)
      : d_(train.oscillator->dim()), T_(train.period), r2_(train.r2), V_(std::abs(train.speed)),
        c2_(train.oscillator->c2()), A_(train.oscillator->A()) {
    divide_all(train, frequency, refine);
  }

  void monodromy(Complex lambda, Complex* Y, double& log_scale) const {
    const int d = d_;
    for (int a = 0; a < d * d; ++a) Y[a] = a % (d + 1) == 0 ? 1. : 0.;
    log_scale = 0;
    Complex phis[together * max_dim * max_dim], next[max_dim * max_dim];
    for (size_t i = 0; i < step_.size(); ++i) {
      if (i % together == 0) transfer(i, lambda, phis);
      const Complex* const phi = phis + i % together * size_t(d * d);
      double size = 0;
      for (int a = 0; a < d; ++a)
        for (int b = 0; b < d; ++b) {
          Complex sum = 0;
          for (int k = 0; k < d; ++k) sum += product(phi[a * d + k], Y[k * d + b]);
          next[a * d + b] = sum;
          size = std::max({size, std::abs(sum.real()), std::abs(sum.imag())});
        }
      if (!(size > 0) || !std::isfinite(size))
        throw Failure("perturbations of the train cannot be followed round it");
      const double scale = size > 1e-100 && size < 1e100 ? 1 : size;
      for (int a = 0; a < d * d; ++a) Y[a] = next[a] / scale;
      log_scale += std::log(scale);
    }
  }

 private:
  // Jacobians at the points of a rule in an interval; returns the least decay exponent of P in it, and its
  // range.
  double jacobians(const Train& train, double at, double h, const Collocation& rule, double* J,
                   double* range = nullptr) const {
    double least = 1e300, most = -1e300;
    for (double c : rule.c) {
      double y[max_dim], dy[max_dim];
      train.at(at + h * c, y);
      train.oscillator->rhs(r2_, y, dy, J);
      least = std::min(least, -J[0] * h * T_);
      most = std::max(most, -J[0] * h * T_);
      J += d_ * d_;
    }
    if (range) *range = most - least;
    return least;
  }

  void divide_all(const Train& train, double frequency, int refine) {
    const double cV = std::sqrt(c2_) / V_;
    // waves that run against the train and with it, in xi
    const double slow = frequency / (1 + cV) * T_, fast = frequency * (1 + cV) / r2_ * T_;
    std::vector<double> decay(train.intervals()), steepness(train.intervals());
    const double least_frequency = frequency > std::ldexp(1., lowest_level) ? frequency / 2 : 0;
    std::vector<double> J(size_t(stages * d_ * d_));
    for (size_t i = 0; i < decay.size(); ++i) {
      decay[i] = jacobians(train, train.mesh[i], train.mesh[i + 1] - train.mesh[i], Collocation::gauss5(),
                           J.data(), &steepness[i]);
      steepness[i] /= std::pow(std::abs(decay[i]), 2) +
                      std::pow(least_frequency * cV / r2_ * T_ * (train.mesh[i + 1] - train.mesh[i]), 2);
    }
    // A fast wave is made where C changes within the time r2/|C + lambda|. Once it has died out, P follows Z
    // and is as smooth as the train, which the mesh is made for. Twice round, to know what comes in.
    double since = 0;
    for (const bool count_only : {true, false})
      for (size_t i = 0; i < train.intervals(); ++i) {
        const double h = train.mesh[i + 1] - train.mesh[i];
        if (steepness[i] > made) since = 0;
        // the part of the interval in which the fast wave lives, and the rest
        const double alive = decay[i] > 0 ? std::clamp((dead - since) / decay[i], 0., 1.) : 1;
        since = std::max(0., since + decay[i]);
        if (count_only) continue;
        divide(train, train.mesh[i], alive * h, fast, refine, alive * decay[i]);
        divide(train, train.mesh[i] + alive * h, (1 - alive) * h, slow, refine, (1 - alive) * decay[i]);
        if (step_.size() > most_intervals * size_t(refine))
          throw Failure("the spectrum needs too fine a mesh: V/c - 1 = " + rounded_text(1 / cV - 1) +
                        ", waves of frequency " + rounded_text(frequency) + " in a medium at rest");
      }
  }

  // Equal pieces short enough for a wave that turns by `frequency` a unit of phase.
  void divide(const Train& train, double at, double h, double frequency, int refine, double decay) {
    if (!(h > 0)) return;
    const int pieces =
        refine * int(std::clamp(std::ceil(h * frequency / longest_phase), 1., double(most_intervals)));
    for (int k = 0; k < pieces; ++k) add(train, at + h * k / pieces, h / pieces, decay / pieces);
  }

  void add(const Train& train, double at, double h, double decay) {
    const Collocation& rule = decay > stiff ? Collocation::radau5() : Collocation::gauss5();
    step_.push_back(h * T_);
    rule_.push_back(&rule);
    J_.resize(J_.size() + size_t(stages * d_ * d_));
    jacobians(train, at, h, rule, &J_[J_.size() - size_t(stages * d_ * d_)]);
  }

  // The matrix of Q' = M Q from a Jacobian: (P, Z[, S]).
  void matrix(const double* J, Complex lambda, Complex* M) const {
    const int d = d_;
    const Complex wave = lambda / V_;
    for (int k = 0; k < d * d; ++k) M[k] = J[k];
    M[d] += c2_ / A_ * product(wave, wave);
    M[0] -= 2 * c2_ / (V_ * r2_) * wave;
  }

  // y at the end of an interval from y at its beginning, for `together` intervals from the first on, if there
  // are so many.
  void transfer(size_t first, Complex lambda, Complex* phi) const {
    if (d_ == 2) return transfer_of<2>(first, lambda, phi);
    transfer_of<max_dim>(first, lambda, phi);
  }
  template <int d>
  void transfer_of(size_t first, Complex lambda, Complex* phi) const {
    const size_t count = std::min(together, step_.size() - first);
    typename Stages<d>::Systems systems;
    Complex mu = 0;
    for (size_t lane = 0; lane < together; ++lane)  // a spare lane repeats the last
      mu = write_stages<d>(first + std::min(lane, count - 1), lane, lambda, systems);
    if (!Stages<d>::solve(&systems)) throw Failure("the linearised equations of an interval are singular");
    for (size_t lane = 0; lane < count; ++lane)
      read_end<d>(first + lane, lane, mu, systems, phi + lane * size_t(d * d));
  }

  // Z' = mu P with one mu, so that Z at the points is that at the beginning and h mu times sums of P: only
  // the others are solved for.
  template <int d>
  using Stages = StageElimination<(d - 1) * stages, d>;
  static int unknown(int other) { return other == 0 ? 0 : other + 1; }

  // The stages of interval i; returns mu.
  template <int d>
  Complex write_stages(size_t i, size_t lane, Complex lambda, typename Stages<d>::Systems& systems) const {
    constexpr int others = d - 1, n = others * stages;
    const Collocation& rule = *rule_[i];
    const double h = step_[i];
    const auto put = [&](int row, int column, Complex value) {
      systems.re[row][column][lane] = value.real();
      systems.im[row][column][lane] = value.imag();
    };
    Complex M[max_dim * max_dim];
    for (int j = 0; j < stages; ++j) {
      matrix(&J_[(i * stages + size_t(j)) * size_t(d_ * d_)], lambda, M);
      for (int p = 0; p < others; ++p) {
        const Complex* const of_p = M + unknown(p) * d;
        const Complex by_z = h * h * product(of_p[1], M[d]);
        for (int k = 0; k < stages; ++k) {
          const double weight = h * rule.a[size_t(k * stages + j)];
          for (int q = 0; q < others; ++q)
            put(k * others + p, j * others + q,
                (k == j && p == q ? 1. : 0.) - weight * of_p[unknown(q)] -
                    (q == 0 ? rule.a2[size_t(k * stages + j)] * by_z : 0.));
        }
        for (int q = 0; q < d; ++q)
          put(j * others + p, n + q,
              q == 1 ? h * rule.c[size_t(j)] * of_p[1] : Complex(q == unknown(p) ? 1 : 0));
      }
    }
    return M[d];
  }

  template <int d>
  void read_end(size_t i, size_t lane, Complex mu, const typename Stages<d>::Systems& systems,
                Complex* phi) const {
    constexpr int others = d - 1, n = others * stages;
    const Collocation& rule = *rule_[i];
    const auto sum = [&](const double* weights, int p, int q) {
      Complex all = 0;
      for (int j = 0; j < stages; ++j)
        all += weights[j] *
               Complex(systems.re[j * others + p][n + q][lane], systems.im[j * others + p][n + q][lane]);
      return all;
    };
    for (int q = 0; q < d; ++q) {
      phi[d + q] = (q == 1 ? 1. : 0.) + step_[i] * product(mu, sum(rule.b.data(), 0, q));
      for (int p = 0; p < others; ++p)
        phi[unknown(p) * d + q] = (unknown(p) == q ? rule.end[0] : 0.) + sum(rule.end.data() + 1, p, q);
    }
  }

  int d_;
  double T_, r2_, V_, c2_, A_;
  std::vector<double> step_;
  std::vector<const Collocation*> rule_;
  std::vector<double> J_;
};

Transfer::Transfer(const Train& train, int refine) : train_(train), refine_(refine) {}
Transfer::~Transfer() = default;

const TransferMesh& Transfer::mesh_for(double frequency) {
  const int level = std::max(lowest_level, int(std::ceil(std::log2(std::max(frequency, 1e-9)))));
  auto& slot = meshes_[level];
  if (!slot) slot = std::make_unique<TransferMesh>(train_, std::ldexp(1., level), refine_);
  return *slot;
}

Multipliers Transfer::at(Complex lambda) {
  beat("transfers round a train");
  const int d = train_.oscillator->dim();
  Complex Y[max_dim * max_dim];
  double log_scale, size = 0;
  const TransferMesh& mesh = mesh_for(std::sqrt(train_.oscillator->c2()) * std::abs(lambda / train_.speed));
  mesh.monodromy(lambda, Y, log_scale);
  for (int k = 0; k < d * d; ++k) size = std::max(size, std::abs(Y[k]));
  for (int k = 0; k < d * d; ++k) Y[k] /= size;
  log_scale += std::log(size);
  Multipliers m;
  m.count = d;
  int k = 0;
  for (const Complex& root : eigenvalues(d, std::vector<Complex>(Y, Y + d * d)))
    m.log_rho[k++] = std::log(std::abs(root) > 1e-300 ? root : Complex(1e-300)) + log_scale;
  return m;
}

namespace {

// Visits C at the Gauss points of a train with their weights in phase, in order.
template <class Visit>
void each_damping(const Train& train, Visit&& visit) {
  const int d = train.oscillator->dim();
  for (size_t i = 0; i < train.intervals(); ++i)
    for (size_t j = 0; j < stages; ++j) {
      double dy[max_dim], J[max_dim * max_dim];
      train.oscillator->rhs(train.r2, &train.values[(i * (stages + 1) + j + 1) * size_t(d)], dy, J);
      visit(-train.r2 * J[0], (train.mesh[i + 1] - train.mesh[i]) * train.method->b[j]);
    }
}

}  // namespace

TrainDamping Transfer::damping() const {
  TrainDamping result{0, std::sqrt(train_.oscillator->A() * train_.oscillator->K0()), 0};
  double last = 0;
  bool first = true;
  each_damping(train_, [&](double C, double weight) {
    result.mean += weight * C;
    result.usual = std::max(result.usual, -C);
    if (!first) result.slope += std::abs(C - last) / train_.period;
    last = C;
    first = false;
  });
  return result;
}

double Transfer::damping_within(double most) const {
  double mean = 0;
  each_damping(train_, [&](double C, double weight) { mean += weight * std::min(C, most); });
  return mean;
}

// With exp(-int C/2) taken out of u'' + C u' + W^2 u = 0 there remains v'' + (W^2 - q) v = 0 with q = C^2/4 +
// C'/2, whose solutions grow at most at the mean of |q|/(2 W): that much may be lost on -mean C/2. What C has
// beyond some value only takes energy from the wave and may be left out: the value is chosen that says most.
double Transfer::top_frequency(double growth) const {
  const double own = std::sqrt(train_.oscillator->A() * train_.oscillator->K0());
  double top = 1e300;
  for (double most = damping().usual, end = 1e6 * most; most < end; most *= 1.5) {
    double mean = 0, square = 0, variation = 0, last = 0;
    bool first = true;
    each_damping(train_, [&](double C, double weight) {
      C = std::min(C, most);
      mean += weight * C;
      square += weight * C * C;
      if (!first) variation += std::abs(C - last);
      last = C;
      first = false;
    });
    const double room = mean / 2 + growth;
    if (room > 0) top = std::min(top, (square / 4 + variation / (2 * train_.period)) / (2 * room));
  }
  return std::max(4 * own, top);
}

}  // namespace stickslip
