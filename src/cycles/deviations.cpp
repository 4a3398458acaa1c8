#include "cycles/deviations.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/dense.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

namespace {

using std::size_t;
using Complex = std::complex<double>;
using Multipliers = std::vector<Complex>;

// What decays is carried to 1e-10 by Gauss's method in steps of so many decay times, and steps are halved for it up to four
// times (of large systems once or twice). What decays faster still has gone soon: by Radau's method, as Gauss's turns it
// into an oscillation.
constexpr double decay_of_step = 1, stiff_from = 2;
constexpr int most_halvings = 4, most_halvings_of_large = 1;
constexpr size_t large = 12;
// Steps in which a wave turns by no more than this carry it to 1e-11.
constexpr double turn_of_step = .7;
// The motion is known on twice as fine a mesh as deviations need, unless the phase mode says otherwise.
constexpr double phase_error_allowed = 1e-10;

}  // namespace

size_t nearest_to_one(const Multipliers& multipliers) {
  const auto nearer = [](Complex a, Complex b) { return std::abs(a - 1.) < std::abs(b - 1.); };
  return size_t(std::min_element(multipliers.begin(), multipliers.end(), nearer) - multipliers.begin());
}

Deviations::Deviations(const SmoothCycle& cycle) : cycle_(cycle), field_(*cycle.field), mesh_(cycle.mesh) {
  const size_t n = cycle.mesh.size() - 1;
  if (n % 2 == 0 && n >= 40) {
    mesh_.clear();
    for (size_t i = 0; i <= n; i += 2) mesh_.push_back(cycle.mesh[i]);
    const Multipliers found = multipliers();
    if (!(std::abs(found[nearest_to_one(found)] - 1.) < phase_error_allowed)) {
      mesh_ = cycle.mesh;
      pieces_.clear();
    }
  }
  for (size_t i = 0; i + 1 < mesh_.size(); ++i)
    longest_ = std::max(longest_, (mesh_[i + 1] - mesh_[i]) * cycle.cycle.period);
  if (field_.nodes() != 1) return;
  const size_t d = size_t(field_.dim());
  for (const Piece& piece : pieces(0)) {
    const Collocation& method = piece.stiff ? Collocation::radau5() : Collocation::gauss5();
    for (size_t j = 0; j < mesh_stages; ++j)
      mean_damping_ -= piece.h * method.b[j] * (piece.J[j * d * d] + piece.J[j * d * d + d + 1]) / cycle.cycle.period;
  }
}

const std::vector<Deviations::Piece>& Deviations::pieces(int halvings) {
  const auto [at, is_new] = pieces_.try_emplace(halvings);
  if (!is_new) return at->second;
  const int d = field_.dim();
  const size_t dd = size_t(d) * size_t(d);
  std::vector<double> y(static_cast<size_t>(d));
  const auto sample = [&](const Collocation& method, double begin, double phase, Piece& piece) {
    for (size_t j = 0; j < mesh_stages; ++j) {
      evaluate(Collocation::gauss5(), cycle_.mesh, cycle_.values.data(), d, begin + phase * method.c[j], y.data());
      field_.jacobian(y.data(), &piece.J[j * dd]);
    }
  };
  // over [begin, begin + phase]; the rate of the fastest decay
  const auto piece_of = [&](double begin, double phase, double& decay) {
    Piece piece{phase * cycle_.cycle.period, false, std::vector<double>(mesh_stages * dd)};
    sample(Collocation::gauss5(), begin, phase, piece);
    decay = 0;
    for (size_t j = 0; j < mesh_stages; ++j)
      for (size_t a = 0; a < size_t(d); ++a) decay = std::max(decay, -piece.J[j * dd + a * size_t(d + 1)]);
    piece.stiff = decay * piece.h > stiff_from;
    // c = 1 is the beginning of the next interval: a little before it stays in this one
    if (piece.stiff) sample(Collocation::radau5(), begin, phase * (1 - 1e-13), piece);
    return piece;
  };
  for (size_t i = 0; i + 1 < mesh_.size(); ++i) {
    double decay;
    const double width = mesh_[i + 1] - mesh_[i];
    Piece whole = piece_of(mesh_[i], width, decay);
    const int most = size_t(d) > large ? most_halvings_of_large : most_halvings;
    const double steps = decay * whole.h / decay_of_step;
    const int count = 1 << std::max(halvings, std::min(most, int(std::ceil(std::log2(std::max(1., steps))))));
    if (count == 1) at->second.push_back(std::move(whole));
    for (int k = 0; k < count && count > 1; ++k)
      at->second.push_back(piece_of(mesh_[i] + k * width / count, width / count, decay));
  }
  return at->second;
}

template <class T>
Multipliers Deviations::carried_round(int halvings, const std::vector<T>& added) {
  const int d = field_.dim();
  const size_t dd = size_t(d) * size_t(d);
  std::vector<T> matrices, J(mesh_stages * dd);
  for (const Piece& piece : pieces(halvings)) {
    for (size_t k = 0; k < J.size(); ++k) J[k] = piece.J[k] + added[k % dd];
    const Collocation& method = piece.stiff ? Collocation::radau5() : Collocation::gauss5();
    const std::vector<T> matrix = carried(method, d, field_.band(), piece.h, J.data());
    matrices.insert(matrices.end(), matrix.begin(), matrix.end());
  }
  return multipliers_of(d, pencil_of(d, matrices));
}

Multipliers Deviations::multipliers() {
  return carried_round(0, std::vector<double>(size_t(field_.dim()) * size_t(field_.dim())));
}

std::vector<double> Deviations::slope_in_kappa2() const {
  const size_t d = size_t(field_.dim());
  std::vector<double> without(d * d), with(d * d), u;
  field_.jacobian(cycle_.values.data(), 0., without.data());
  field_.jacobian(cycle_.values.data(), 1., with.data());
  for (size_t a = 0; a < d; ++a) u.push_back(with[a * d] - without[a * d]);
  return u;
}

const std::vector<Deviations::Response>& Deviations::responses(int halvings) {
  const auto [at, is_new] = responses_.try_emplace(halvings);
  if (!is_new) return at->second;
  const size_t d = size_t(field_.dim()), s = mesh_stages, columns = d + s;
  const std::vector<double> u = slope_in_kappa2();
  std::vector<double> M(s * d * s * d), R(s * d * columns);
  for (const Piece& piece : pieces(halvings)) {
    const Collocation& method = piece.stiff ? Collocation::radau5() : Collocation::gauss5();
    std::fill(R.begin(), R.end(), 0.);
    for (size_t j = 0; j < s; ++j)
      for (size_t a = 0; a < d; ++a) {
        double* row = &R[(j * d + a) * columns];
        row[a] = 1;
        for (size_t k = 0; k < s; ++k) row[d + k] = piece.h * method.a[j * s + k] * u[a];
      }
    stage_matrix(method, int(d), piece.h, piece.J.data(), M.data());
    if (!solve_dense(int(s * d), M.data(), int(columns), R.data()))
      throw Failure("the linearised oscillation cannot be integrated");
    Response r{std::vector<double>(d * d), {}, std::vector<double>(d * s), {}};
    for (size_t a = 0; a < d; ++a)
      for (size_t l = 0; l < columns; ++l) {
        double sum = l == a ? method.end[0] : 0;
        for (size_t j = 0; j < s; ++j) sum += method.end[j + 1] * R[(j * d + a) * columns + l];
        (l < d ? r.end[a * d + l] : r.end_of_u[a * s + l - d]) = sum;
      }
    for (size_t j = 0; j < s; ++j) {
      const double* row = &R[j * d * columns];
      r.psi.insert(r.psi.end(), row, row + d);
      r.psi_of_u.insert(r.psi_of_u.end(), row + d, row + columns);
    }
    at->second.push_back(std::move(r));
  }
  return at->second;
}

Multipliers Deviations::of_wave(double kappa2) {
  const size_t d = size_t(field_.dim()), s = mesh_stages;
  const Scene& scene = field_.scene();
  const double decay = std::abs(slope_in_kappa2()[0] * kappa2);  // by viscosity between neighbours
  const double turn = std::max(decay, std::sqrt(std::max(0., scene.A() * (scene.K0() + scene.K1() * kappa2)))) * longest_;
  const int halvings = std::max(0, int(std::ceil(std::log2(turn / turn_of_step))));
  std::vector<double> matrices, S(s * s), psi(s * d);
  for (const Response& r : responses(halvings)) {
    for (size_t k = 0; k < s * s; ++k) S[k] = (k % (s + 1) == 0 ? 1. : 0.) - kappa2 * r.psi_of_u[k];
    psi = r.psi;
    if (!solve_dense(int(s), S.data(), int(d), psi.data()))
      throw Failure("the linearised oscillation cannot be integrated");
    for (size_t a = 0; a < d; ++a)
      for (size_t l = 0; l < d; ++l) {
        double sum = r.end[a * d + l];
        for (size_t j = 0; j < s; ++j) sum += kappa2 * r.end_of_u[a * s + j] * psi[j * d + l];
        matrices.push_back(sum);
      }
  }
  return multipliers_of(int(d), pencil_of(int(d), matrices));
}

Multipliers Deviations::of_twist(double theta) {
  const size_t dd = size_t(field_.dim()) * size_t(field_.dim());
  std::vector<Complex> without(dd), with(dd);
  const double* y = cycle_.values.data();
  field_.jacobian(y, Complex(1), without.data());
  field_.jacobian(y, std::polar(1., theta), with.data());
  for (size_t k = 0; k < dd; ++k) with[k] -= without[k];
  return carried_round(0, with);
}

void set_multipliers(SmoothCycle& cycle) {
  Deviations deviations(cycle);
  Multipliers& found = cycle.cycle.multipliers = deviations.multipliers();
  cycle.cycle.phase_mode = nearest_to_one(found);
  // of two unknowns the other's is known to all digits (Liouville), however small
  if (found.size() == 2) {
    found[1 - cycle.cycle.phase_mode] = std::exp(-deviations.mean_damping() * cycle.cycle.period);
    cycle.cycle.phase_mode = std::abs(found[0]) < std::abs(found[1]) ? 1 - cycle.cycle.phase_mode : cycle.cycle.phase_mode;
    if (std::abs(found[0]) < std::abs(found[1])) std::swap(found[0], found[1]);
  }
}

}  // namespace stickslip
