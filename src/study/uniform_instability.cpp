// Waves on a uniform motion: which of those that fit a scene grows fastest (reduce.hpp).
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/dense.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "study/step_forecast.hpp"

namespace stickslip {

namespace {

constexpr int stages = 5, max_dim = 3;
constexpr double orbit_tolerance = 1e-8, least_growth = 1e-6;  // relative; of a multiplier beyond 1

// The wave among 1..last where `rate` is largest: of 400 spread evenly, or all, and then among the neighbours
// of that.
template <class Rate>
PetscInt fastest(PetscInt last, const Rate& rate) {
  PetscInt step = (last + 399) / 400, best = 0;
  double largest = 0;
  const auto look = [&](PetscInt j) {
    const double here = rate(j);
    if (best != 0 && !(here > largest)) return false;
    largest = here;
    best = j;
    return true;
  };
  for (PetscInt j = 1; j <= last; j += step) look(j);
  while (step > 1) {
    step = (step + 1) / 2;
    while (best + step <= last && look(best + step)) continue;
    while (best > step && look(best - step)) continue;
  }
  return best;
}

// What waves add to the Jacobian of uniform motion in (psi, z[, state]): -kappa^2 E, where E takes psi to K1
// in z' and to A N in psi'.
struct Neighbours {
  double K1, A_N;
  explicit Neighbours(const Scene& s) : K1(s.K1()), A_N(s.A() * s.N()) {}
};

// The linear system y' = (J(t) - kappa^2 E) y of a wave, carried round the orbit once. Radau IIA of order 9
// on the orbit's own steps, halved where the wave is fast. In its stages
//     (1 - h a (x) J + kappa^2 h a (x) E) Y = 1 (x) y
// only the number kappa^2 depends on the wave and E has rank one: what is inverted once for a piece of the
// orbit leaves each wave a system of as many unknowns as there are stages.
class CarriedRound {
 public:
  CarriedRound(const Oscillator& oscillator, const Orbit& orbit, const Neighbours& neighbours)
      : o_(oscillator), orbit_(orbit), E_(neighbours), d_(oscillator.dim()) {}

  double largest_multiplier(double kappa2) {
    const double omega = std::sqrt(o_.A() * (o_.K0() + E_.K1 * kappa2));
    double Y[max_dim * max_dim] = {}, log_size = 0;
    for (int i = 0; i < d_; ++i) Y[i * d_ + i] = 1;
    for (std::size_t i = 0; i + 1 < orbit_.mesh.size(); ++i) {
      const double turned = (orbit_.mesh[i + 1] - orbit_.mesh[i]) * orbit_.period * omega;
      const int halvings = std::max(0, int(std::ceil(std::log2(turned / 1.5))));
      for (const Transition& piece : pieces(i, halvings)) {
        carry(piece, kappa2, Y);
        double size = 0;
        for (int k = 0; k < d_ * d_; ++k) size = std::max(size, std::abs(Y[k]));
        if (size > 1e-50 && size < 1e50) continue;  // growth and decay may be huge on the way
        for (int k = 0; k < d_ * d_; ++k) Y[k] /= size;
        log_size += std::log(size);
      }
    }
    return spectral_bounds(d_, {Y, Y + d_ * d_}).modulus * std::exp(log_size);
  }

 private:
  // Without the wave: the end and psi at the stages from the beginning, and both from E's part of the stages.
  struct Transition {
    double end[max_dim * max_dim], psi[stages * max_dim];
    double end_of_E[max_dim * stages], psi_of_E[stages * stages];
  };

  const std::vector<Transition>& pieces(std::size_t interval, int halvings) {
    const auto [at, is_new] = pieces_.try_emplace({interval, halvings});
    if (!is_new) return at->second;
    const int count = 1 << halvings;
    const double phase = (orbit_.mesh[interval + 1] - orbit_.mesh[interval]) / count;
    for (int k = 0; k < count; ++k) at->second.push_back(piece(orbit_.mesh[interval] + k * phase, phase));
    return at->second;
  }

  Transition piece(double begin, double phase) const {
    const Collocation& radau = Collocation::radau5();
    const int d = d_, n = stages * d, columns = d + stages;
    const double h = phase * orbit_.period;
    double J[stages * max_dim * max_dim], a[stages * max_dim * stages * max_dim] = {},
                                                                        b[stages * max_dim * 8] = {};
    for (int s = 0; s < stages; ++s) {
      double y[max_dim + 1], dy[max_dim];
      orbit_.at(begin + phase * radau.c[s], y);
      o_.rhs(1, y, dy, J + s * d * d);
      for (int k = 0; k < d; ++k) b[(s * d + k) * columns + k] = 1;
      for (int r = 0; r < stages; ++r) {
        const double weight = h * radau.a[s * stages + r];
        b[s * d * columns + d + r] = weight * E_.A_N;
        b[(s * d + 1) * columns + d + r] = weight * E_.K1;
      }
    }
    stage_matrix(radau, d, h, J, a);
    if (!solve_dense(n, a, columns, b)) throw Failure("the linearised oscillation cannot be integrated");
    Transition p;
    const auto take = [&](int row, int first, int count, double* to) {
      std::copy(b + row * columns + first, b + row * columns + first + count, to);
    };
    for (int s = 0; s < stages; ++s) {
      take(s * d, 0, d, p.psi + s * d);
      take(s * d, d, stages, p.psi_of_E + s * stages);
    }
    for (int k = 0; k < d; ++k) {
      take(n - d + k, 0, d, p.end + k * d);
      take(n - d + k, d, stages, p.end_of_E + k * stages);
    }
    return p;
  }

  void carry(const Transition& p, double kappa2, double* Y) const {
    const int d = d_;
    double a[stages * stages], psi[stages * max_dim] = {}, end[max_dim * max_dim] = {};
    for (int i = 0; i < stages * stages; ++i) a[i] = kappa2 * p.psi_of_E[i] + (i % (stages + 1) == 0 ? 1 : 0);
    for (int s = 0; s < stages; ++s)
      for (int k = 0; k < d; ++k)
        for (int c = 0; c < d; ++c) psi[s * d + c] += p.psi[s * d + k] * Y[k * d + c];
    if (!solve_dense(stages, a, d, psi)) throw Failure("the linearised oscillation cannot be integrated");
    for (int i = 0; i < d; ++i)
      for (int c = 0; c < d; ++c) {
        for (int k = 0; k < d; ++k) end[i * d + c] += p.end[i * d + k] * Y[k * d + c];
        for (int s = 0; s < stages; ++s)
          end[i * d + c] -= kappa2 * p.end_of_E[i * stages + s] * psi[s * d + c];
      }
    std::copy(end, end + d * d, Y);
  }

  const Oscillator& o_;
  const Orbit& orbit_;
  const Neighbours E_;
  int d_;
  std::map<std::pair<std::size_t, int>, std::vector<Transition>> pieces_;  // by interval and halvings
};

}  // namespace

UniformInstability instability_of_sliding(const Scene& scene) {
  const auto medium = sliding_medium(scene);
  const auto found = medium ? fastest_wave(*medium, Waves::of(scene), same_growth(*medium), 1) : std::nullopt;
  if (!found || !(found->value.real() > 0)) return {};
  return {found->value.real(), found->wavenumber, 0, 1};
}

UniformInstability instability_of_oscillation(const Scene& scene) {
  const Oscillator o(scene);
  const Orbit orbit = find_orbit(o, 1, orbit_tolerance);
  CarriedRound carried(o, orbit, Neighbours(scene));
  const Waves waves = Waves::of(scene);
  const auto multiplier = [&](PetscInt j) { return carried.largest_multiplier(waves.kappa2(j)); };
  PetscInt low = 1, last = std::max<PetscInt>(1, PetscInt(waves.count) - 1);  // the last with c k T < 100
  while (low < last) {
    const PetscInt middle = low + (last - low + 1) / 2;
    if (std::sqrt(scene.A() * scene.K1() * waves.kappa2(middle)) * orbit.period < 100)
      low = middle;
    else
      last = middle - 1;
  }
  const PetscInt best = waves.count < 2 ? 0 : fastest(last, multiplier);
  const double growth = best == 0 ? 0 : multiplier(best);
  if (growth < 1 + least_growth) return {0, 0, orbit.period, 1};
  return {std::log(growth) / orbit.period, waves.k(best), orbit.period, growth};
}

}  // namespace stickslip
