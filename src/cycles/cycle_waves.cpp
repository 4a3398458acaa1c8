#include "cycles/cycle_waves.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cycles/cell_field.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

namespace {

using std::size_t;
using Complex = std::complex<double>;
using Multipliers = std::vector<Complex>;

// What decays is carried by Gauss's method in steps of so many decay times, for which an interval is halved
// once at most. What decays faster still has gone soon: by Radau's method, as Gauss's turns it into an
// oscillation. Halving further changes no multiplier by more than the last digits that the motion is known
// to.
constexpr double decay_of_step = 1, stiff_from = 2;
// Steps in which a wave turns by no more than this carry it to 1e-11.
constexpr double turn_of_step = .7;
// The motion is known on twice as fine a mesh as deviations need, unless the phase mode says otherwise.
constexpr double phase_error_allowed = 1e-10;

}  // namespace

const std::vector<IntervalPropagator>& CycleWaves::links(int halvings) {
  const auto [found, is_new] = links_.try_emplace(halvings);
  if (is_new) found->second = chain(halvings);
  return found->second;
}

Multipliers CycleWaves::of_wave(double kappa2) {
  const int halvings = std::max(0, int(std::ceil(std::log2(turn(kappa2)))));
  return multipliers_of(unknowns(), links(halvings), std::vector<double>{-kappa2});
}
Multipliers CycleWaves::of_phase(double theta) {
  return multipliers_of(unknowns(), links(0), weights_of_phase(theta));
}

size_t nearest_to_one(const Multipliers& multipliers) {
  const auto nearer = [](Complex a, Complex b) { return std::abs(a - 1.) < std::abs(b - 1.); };
  return size_t(std::min_element(multipliers.begin(), multipliers.end(), nearer) - multipliers.begin());
}

Deviations::Deviations(const SmoothCycle& cycle) : cycle_(cycle), field_(*cycle.field) {
  const size_t n = cycle.mesh.size() - 1;
  const bool forced = field_.periods() > 0;  // no phase mode tells how good a mesh is
  if (n % 2 == 0 && n >= 40 && !forced) {
    std::vector<double> coarse;
    for (size_t i = 0; i <= n; i += 2) coarse.push_back(cycle.mesh[i]);
    carry_on(coarse);
  }
  if (mesh_.empty() || forced ||
      !(std::abs(multipliers_[nearest_to_one(multipliers_)] - 1.) < phase_error_allowed))
    carry_on(cycle.mesh);
  if (field_.nodes() != 1) return;
  const size_t d = size_t(field_.dim());
  for (const StepJacobian& piece : pieces_)
    for (size_t j = 0; j < mesh_stages; ++j)
      mean_damping_ -= piece.h * piece.method().b[j] *
                       (piece.J[j * d * d] + (d > 1 ? piece.J[j * d * d + d + 1] : 0)) / cycle.cycle.period;
}

// Half the mean damping; with viscosity between neighbours, which damps psi ever faster, K1/N or what a state
// keeps, whose mean rate is what psi and eta leave of the exponents' sum.
double Deviations::short_waves() const {
  if (scene().N() == 0) return -mean_damping_ / 2;
  const Cycle& cycle = cycle_.cycle;
  double growth = -scene().K1() / scene().N(), sum = 0;
  for (const Complex m : cycle.multipliers) sum += std::log(std::abs(m)) / cycle.period;
  if (cycle.dof == 3) growth = std::max(growth, sum + mean_damping_);
  return growth;
}

double Deviations::speed() const {
  const Collocation& gauss = Collocation::gauss5();
  std::vector<double> y(size_t(field_.dim()));
  double sum = 0;
  for (size_t i = 0; i + 1 < mesh_.size(); ++i)
    for (size_t j = 0; j < mesh_stages; ++j) {
      const double width = mesh_[i + 1] - mesh_[i], at = mesh_[i] + width * gauss.c[j];
      evaluate(gauss, cycle_.mesh, cycle_.values.data(), field_.dim(), at, y.data());
      sum += width * gauss.b[j] * field_.speed(y.data());
    }
  return sum;
}

void Deviations::carry_on(const std::vector<double>& mesh) {
  mesh_ = mesh;
  longest_ = std::numeric_limits<double>::infinity();
  pieces_ = pieces(0);
  longest_ = 0;
  for (const StepJacobian& piece : pieces_) longest_ = std::max(longest_, piece.reach);
  std::vector<double> matrices;
  for (const StepJacobian& piece : pieces_) {
    std::vector<double> J(piece.J);  // in units of the unknowns, whose multipliers are the same
    const size_t d = size_t(field_.dim());
    for (size_t k = 0; k < J.size(); ++k) J[k] *= field_.unit(int(k % d)) / field_.unit(int(k / d % d));
    const std::vector<double> matrix =
        carried(piece.method(), field_.dim(), field_.band(), piece.h, J.data());
    matrices.insert(matrices.end(), matrix.begin(), matrix.end());
  }
  multipliers_ = multipliers_of(field_.dim(), pencil_of(field_.dim(), matrices));
}

std::vector<Deviations::StepJacobian> Deviations::pieces(int halvings) const {
  const int d = field_.dim();
  const size_t dd = size_t(d) * size_t(d);
  std::vector<double> y(static_cast<size_t>(d));
  const auto sample = [&](const Collocation& method, double begin, double phase, StepJacobian& piece) {
    piece.by.clear();
    for (size_t j = 0; j < mesh_stages; ++j) {
      const double at = begin + phase * method.c[j];
      evaluate(Collocation::gauss5(), cycle_.mesh, cycle_.values.data(), d, at, y.data());
      field_.jacobian_at(at, y.data(), &piece.J[j * dd]);
      const std::vector<double> by = field_.feed_slopes(y.data());
      piece.by.insert(piece.by.end(), by.begin(), by.end());
    }
  };
  // over [begin, begin + phase]; the rate of the fastest decay
  const auto piece_of = [&](double begin, double phase, double& decay) {
    StepJacobian piece{phase * cycle_.cycle.period, false, std::vector<double>(mesh_stages * dd)};
    sample(Collocation::gauss5(), begin, phase, piece);
    piece.reach = field_.reach(piece.h, piece.by);
    decay = 0;
    for (size_t j = 0; j < mesh_stages; ++j)
      for (size_t a = 0; a < size_t(d); ++a) decay = std::max(decay, -piece.J[j * dd + a * size_t(d + 1)]);
    piece.stiff = decay * piece.h > stiff_from;
    // c = 1 is the beginning of the next interval: a little before it stays in this one
    if (piece.stiff) sample(Collocation::radau5(), begin, phase * (1 - 1e-13), piece);
    return piece;
  };
  const double longest = std::ldexp(longest_, -halvings);
  std::vector<StepJacobian> all;
  for (size_t i = 0; i + 1 < mesh_.size(); ++i) {
    double decay;
    const double width = mesh_[i + 1] - mesh_[i];
    StepJacobian whole = piece_of(mesh_[i], width, decay);
    const int by_decay = decay * whole.h > decay_of_step ? 1 : 0;
    const double by_length = std::log2(std::max(1., whole.reach / longest * (1 - 1e-12)));
    const int count = 1 << std::max(int(std::ceil(by_length)), by_decay);
    if (count == 1) all.push_back(std::move(whole));
    for (int k = 0; k < count && count > 1; ++k)
      all.push_back(piece_of(mesh_[i] + k * width / count, width / count, decay));
  }
  return all;
}

double Deviations::turn(double kappa2) const { return field_.fastest(kappa2) * longest_ / turn_of_step; }

std::vector<IntervalPropagator> Deviations::chain(int halvings) const {
  LowRankCoupling feed = field_.feed();
  std::vector<IntervalPropagator> links;
  for (const StepJacobian& piece : halvings == 0 ? pieces_ : pieces(halvings)) {
    feed.by = piece.by;
    links.emplace_back(piece.method(), field_.dim(), field_.band(), piece.h, piece.J.data(), feed);
  }
  return links;
}

void set_multipliers(SmoothCycle& cycle) {
  Deviations deviations(cycle);
  Multipliers& found = cycle.cycle.multipliers = deviations.multipliers();
  cycle.cycle.phase_mode = cycle.field->periods() > 0 ? found.size() : nearest_to_one(found);
  // of two unknowns the other's is known to all digits (Liouville), however small
  if (found.size() == 2 && cycle.field->periods() == 0) {
    found[1 - cycle.cycle.phase_mode] = std::exp(-deviations.mean_damping() * cycle.cycle.period);
    cycle.cycle.phase_mode =
        std::abs(found[0]) < std::abs(found[1]) ? 1 - cycle.cycle.phase_mode : cycle.cycle.phase_mode;
    if (std::abs(found[0]) < std::abs(found[1])) std::swap(found[0], found[1]);
  }
}

namespace {

using std::size_t;
using Complex = std::complex<double>;

// of the motion's own steps, of up to StickMotion's longest, which are short beside everything else
constexpr double turn_of_longest = 1.2;

}  // namespace

StickDeviations::StickDeviations(const Scene& cell, const StickCycle& cycle) : motion_(cell), cycle_(cycle) {
  for (PetscInt i = 0; i < cell.n; ++i) rows_.push_back(turned_row(cell, i));
  at_ends_ = nodes_at_ends(rows_);
}

// What psi of the next cells does to the rates: as D2 psi of the node.
LowRankCoupling StickDeviations::feed(const std::vector<double>& direction) const {
  const Scene& s = motion_.scene();
  const size_t dof = size_t(motion_.dof());
  LowRankCoupling feed;
  for (const size_t i : at_ends_) {
    const bool slides = direction[i] != 0;
    std::vector<double> into(motion_.scene().n * dof);
    const NodeCoefficients c = s.coefficients(PetscInt(i));
    into[i * dof] = slides ? c.A * s.N() : 0;
    into[i * dof + 1] = s.mean_K1() - (slides ? c.s_delta * s.N() : 0);
    feed.into.push_back(std::move(into));
    feed.of.push_back(i * dof);
  }
  return feed;
}

// Nothing moves: psi does not deviate, and eta keeps what it has.
IntervalPropagator StickDeviations::resting(double from, double to,
                                            const std::function<void(double, double*)>& at) const {
  const size_t d = size_t(unknowns()), dof = size_t(motion_.dof());
  std::vector<double> begin(motion_.size()), end(motion_.size()), matrix(d * d);
  at(from, begin.data());
  at(to, end.data());
  for (size_t k = 0; k < d; ++k) {
    if (k % dof == 1) matrix[k * d + k] = 1;
    if (k % dof == 2)
      matrix[k * d + k] = motion_.state_contraction(int(k / dof), begin[k], end[k], to - from);
  }
  return {int(d), std::move(matrix), {}};
}

IntervalPropagator StickDeviations::jump(const std::vector<double>& was, const StickState& now) const {
  const size_t d = size_t(unknowns()), dof = size_t(motion_.dof());
  const double N = motion_.scene().N();
  std::vector<double> matrix(d * d), unit(d);
  for (size_t k = 0; k < d; ++k) matrix[k * d + k] = 1;
  LowRankCoupling beside;
  if (N > 0) beside = feed(std::vector<double>(size_t(motion_.nodes())));
  for (std::vector<double>& into : beside.into) std::fill(into.begin(), into.end(), 0.);
  for (const StickMotion::Jump& jump : motion_.jumps(was, now)) {
    const size_t first = size_t(jump.change.node) * dof;
    const bool starts = jump.change.before == 0;
    if (starts) check_release(size_t(jump.change.node), now);
    for (size_t k = 0; k < d; ++k) {
      std::fill(unit.begin(), unit.end(), 0.);
      unit[k] = 1;
      jump.matrix.apply(&unit[first], starts ? motion_.neighbour_force(jump.change.node, unit.data()) : 0);
      for (size_t a = first; a < first + dof; ++a) matrix[a * d + k] = unit[a];
    }
    for (size_t a = 0; a < beside.of.size(); ++a)
      if (starts && beside.of[a] == first) jump.matrix.apply(&beside.into[a][first], N);
  }
  return {int(d), std::move(matrix), beside};
}

// With viscosity a node's copies in the next cells begin to slip with it, and where these are its neighbours
// motions beside it do it one by one: no matter where they do it without a jump in psi_t.
void StickDeviations::check_release(size_t node, const StickState& now) const {
  const TurnedRow& row = rows_[node];
  if (motion_.scene().N() == 0 || std::none_of(row.begin(), row.end(), [&](const TurnedTerm& t) {
        return t.turns != 0 && size_t(t.node) == node;
      }))
    return;
  std::vector<double> rates(motion_.size());
  motion_.rates(now.direction, now.u.data(), rates.data());
  if (rates[node * size_t(motion_.dof())] != 0)
    throw Failure(
        "cycle_spectrum: with viscosity between neighbours nodes that are alike begin to slip at once with a "
        "jump in their acceleration: in a wave on them they do it one by one, in an order of its own");
}

std::vector<IntervalPropagator> StickDeviations::chain(int halvings) const {
  std::vector<IntervalPropagator> links;
  const size_t d = size_t(unknowns()), all = motion_.size();
  const double longest = std::ldexp(motion_.longest() * turn_of_step / turn_of_longest, -halvings);
  const Collocation& gauss = Collocation::gauss5();
  std::vector<double> direction, u(all), whole(all * all), J(mesh_stages * d * d);
  StickReturnMapOptions wishes;
  wishes.changed = [&](const std::vector<double>& was, const StickState& now) {
    if (was != now.direction) links.push_back(jump(was, now));
    direction = now.direction;
  };
  wishes.passed = [&](double from, double to, const std::function<void(double, double*)>& at) {
    if (!(to > from)) return;
    if (std::all_of(direction.begin(), direction.end(), [](double going) { return going == 0; }))
      return links.push_back(resting(from, to, at));
    const LowRankCoupling beside = feed(direction);
    const int count = std::max(1, int(std::ceil((to - from) / longest * (1 - 1e-12))));
    const double h = (to - from) / count;
    for (int k = 0; k < count; ++k) {
      for (size_t j = 0; j < mesh_stages; ++j) {
        at(from + (k + gauss.c[j]) * h, u.data());
        motion_.jacobian(direction, u.data(), whole.data());
        for (size_t a = 0; a < d; ++a) std::copy_n(&whole[a * all], d, &J[(j * d + a) * d]);
      }
      links.emplace_back(gauss, int(d), int(d) - 1, h, J.data(), beside);
    }
  };
  return_map_of(motion_, cycle_, wishes);
  return links;
}

double StickDeviations::turn(double kappa2) const {
  const Scene& s = scene();
  const double own = std::sqrt(s.A() * s.K0()),
               wave = std::sqrt(std::max(0., s.A() * (s.K0() + s.K1() * kappa2)));
  return std::max(wave, s.A() * s.N() * std::abs(kappa2)) / own;
}
double StickDeviations::speed() const { return std::sqrt(scene().A() * scene().K1()); }
double StickDeviations::short_waves() const { return std::nan(""); }

using std::size_t;

// Columns of the stages: y at the beginning, then u_a at each point in turn.
IntervalPropagator::IntervalPropagator(const Collocation& method, int d, int band, double h, const double* J,
                                       const LowRankCoupling& feed)
    : d_(size_t(d)), r_(feed.of.size()), points_(mesh_stages), end_(d_ * d_), end_of_u_(d_ * r_ * points_),
      psi_(r_ * points_ * d_), psi_of_u_(r_ * points_ * r_ * points_) {
  const size_t s = points_, fed = r_ * s, columns = d_ + fed;
  std::vector<double> R(s * d_ * columns);
  for (size_t j = 0; j < s; ++j)
    for (size_t p = 0; p < d_; ++p) {
      double* row = &R[(j * d_ + p) * columns];
      row[p] = 1;
      for (size_t a = 0; a < r_; ++a)
        for (size_t k = 0; k < s; ++k) row[d_ + a * s + k] = h * method.a[j * s + k] * feed.into[a][p];
    }
  solve_stages(method, d, band, h, J, int(columns), R);
  for (size_t p = 0; p < d_; ++p) {
    for (size_t l = 0; l < columns; ++l) {
      double sum = l == p ? method.end[0] : 0;
      for (size_t j = 0; j < s; ++j) sum += method.end[j + 1] * R[(j * d_ + p) * columns + l];
      (l < d_ ? end_[p * d_ + l] : end_of_u_[p * fed + l - d_]) = sum;
    }
  }
  for (size_t b = 0; b < r_; ++b)
    for (size_t j = 0; j < s; ++j)
      for (size_t m = 0; m < feed.width; ++m) {
        const double by = feed.by.empty() ? 1 : feed.by[(j * r_ + b) * feed.width + m];
        const double* row = &R[(j * d_ + feed.of[b] + m) * columns];
        for (size_t l = 0; l < d_; ++l) psi_[(b * s + j) * d_ + l] += by * row[l];
        for (size_t l = 0; l < fed; ++l) psi_of_u_[(b * s + j) * fed + l] += by * row[d_ + l];
      }
}

IntervalPropagator::IntervalPropagator(int d, std::vector<double> matrix, const LowRankCoupling& feed)
    : d_(size_t(d)), r_(feed.of.size()), points_(1), end_(std::move(matrix)), end_of_u_(d_ * r_),
      psi_(r_ * d_), psi_of_u_(r_ * r_) {
  for (size_t a = 0; a < r_; ++a) {
    for (size_t p = 0; p < d_; ++p) end_of_u_[p * r_ + a] = feed.into[a][p];
    psi_[a * d_ + feed.of[a]] = 1;
  }
}

// With z = psi_b at the points: z = psi y + psi_of_u (w x 1) z, and the end is end y + end_of_u (w x 1) z.
template <class T>
void IntervalPropagator::carry(const T* w, std::vector<T>& matrices) const {
  const size_t s = points_, fed = r_ * s, first = matrices.size();
  matrices.insert(matrices.end(), end_.begin(), end_.end());
  if (fed == 0) return;
  std::vector<T> S(fed * fed), z(psi_.begin(), psi_.end());
  const auto weighted = [&](const double* row, size_t b, size_t j) {  // entry (b, j) of row (w x 1)
    T sum = 0;
    for (size_t a = 0; a < r_; ++a) sum += row[a * s + j] * w[a * r_ + b];
    return sum;
  };
  for (size_t i = 0; i < fed; ++i)
    for (size_t b = 0; b < r_; ++b)
      for (size_t j = 0; j < s; ++j)
        S[i * fed + b * s + j] = (i == b * s + j ? 1. : 0.) - weighted(&psi_of_u_[i * fed], b, j);
  if (!solve_dense(int(fed), S.data(), int(d_), z.data()))
    throw Failure("the linearised oscillation cannot be integrated");
  for (size_t p = 0; p < d_; ++p)
    for (size_t b = 0; b < r_; ++b)
      for (size_t j = 0; j < s; ++j) {
        const T factor = weighted(&end_of_u_[p * fed], b, j);
        for (size_t l = 0; l < d_; ++l) matrices[first + p * d_ + l] += factor * z[(b * s + j) * d_ + l];
      }
}

template <class T>
std::vector<std::complex<double>> multipliers_of(int d, const std::vector<IntervalPropagator>& links,
                                                 const std::vector<T>& w) {
  std::vector<T> matrices;
  matrices.reserve(links.size() * size_t(d) * size_t(d));
  for (const IntervalPropagator& link : links) link.carry(w.data(), matrices);
  return multipliers_of(d, pencil_of(d, matrices));
}
template std::vector<std::complex<double>> multipliers_of(int, const std::vector<IntervalPropagator>&,
                                                          const std::vector<double>&);
template std::vector<std::complex<double>> multipliers_of(int, const std::vector<IntervalPropagator>&,
                                                          const std::vector<std::complex<double>>&);

}  // namespace stickslip
