// A cycle that the motion from a start settles on or comes near to: the guess for collocation.
#include <fmt/format.h>
#include <petscts.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <optional>

#include "base/local_values.hpp"
#include "base/pulse.hpp"
#include "cycles/cell_field.hpp"
#include "cycles/profile.hpp"
#include "numerics/hermite.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/handle.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/cycles/smooth_cycle.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/direct_ksp.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

using std::size_t;

constexpr double tolerance_of_run = 1e-8;
constexpr double stiff_from = 5000;      // explicit steps a turn
constexpr double most_turns = 1000;      // without a slip of stiff friction
constexpr int most_turns_a_period = 12;  // a cycle of more turns is not looked for
// return, in units of the motion's range, from which Newton's method is tried
constexpr double near_enough = 1e-3;
constexpr double stays = 1e-6;       // return of a motion that is on its cycle, whatever the multipliers
constexpr double repels = 1e-6;      // growth in a period, of what is not neutral but for round-off
constexpr double most_memory = 5e8;  // bytes of the samples that are kept, those of the last twelve turns

struct Sample {
  double t;
  std::vector<double> y, f;
};

// Cubic between two samples.
double hermite(const Sample& a, const Sample& b, double t, size_t k) {
  const double h = b.t - a.t;
  return HermiteCubic(a.y[k], b.y[k], h * a.f[k], h * b.f[k])((t - a.t) / h);
}

PetscErrorCode rates_for_ts(TS, PetscReal t, Vec u, Vec f, void* context) {
  return guarded([&] {
    const Reading in(u);
    const Writing out(f);
    const auto& field = *static_cast<const CellField*>(context);
    field.rates_at(t / field.period(0).T, in, out);
  });
}

// u_t - f and its derivative, shift - J.
PetscErrorCode residual_for_ts(TS ts, PetscReal t, Vec u, Vec u_t, Vec r, void* context) {
  if (const PetscErrorCode failed = rates_for_ts(ts, t, u, r, context)) return failed;
  return VecAYPX(r, -1, u_t);
}
PetscErrorCode jacobian_for_ts(TS, PetscReal t, Vec u, Vec, PetscReal shift, Mat, Mat into, void* context) {
  return guarded([&] {
    const Reading in(u);
    const auto& field = *static_cast<const CellField*>(context);
    const PetscInt d = field.dim();
    std::vector<double> J(static_cast<size_t>(d * d));
    field.jacobian_at(t / field.period(0).T, in, J.data());
    for (PetscInt i = 0; i < d; ++i)
      for (PetscInt j = 0; j < d; ++j)
        SS_TRY(MatSetValue(into, i, j, (i == j ? shift : 0) - J[size_t(i * d + j)], INSERT_VALUES));
    SS_TRY(MatAssemblyBegin(into, MAT_FINAL_ASSEMBLY));
    SS_TRY(MatAssemblyEnd(into, MAT_FINAL_ASSEMBLY));
  });
}

// By the explicit pair of Dormand and Prince, order 5, or by an L-stable Rosenbrock method.
// `any`: the first, however many they are.
enum class Steps { plain, stiff, any };

// Steps that do not suit the motion: too many of plain ones, or stiff ones of a motion without slips.
struct NotByThese : Failure {
  using Failure::Failure;
};

// The motion of a cell, step by step.
class Motion {
 public:
  Motion(const CellField& field, std::vector<double> y, double escape, Steps steps)
      : field_(field), y_(std::move(y)), escape_(escape) {
    SS_TRY(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, PetscInt(y_.size()), y_.data(), u_.out()));
    SS_TRY(TSCreate(PETSC_COMM_SELF, ts_.out()));
    SS_TRY(TSSetProblemType(ts_, TS_NONLINEAR));
    if (steps == Steps::stiff) {
      take_implicitly();
    } else {
      SS_TRY(TSSetRHSFunction(ts_, nullptr, rates_for_ts, const_cast<CellField*>(&field)));
      SS_TRY(TSSetType(ts_, TSRK));
      SS_TRY(TSRKSetType(ts_, TSRK5DP));
    }
    VecHandle absolute;
    SS_TRY(VecDuplicate(u_, absolute.out()));
    {
      const Writing of(absolute);
      for (size_t k = 0; k < y_.size(); ++k) of[PetscInt(k)] = tolerance_of_run * field.unit(int(k));
    }
    SS_TRY(TSSetTolerances(ts_, tolerance_of_run, absolute, tolerance_of_run, nullptr));
    SS_TRY(TSSetMaxSNESFailures(ts_, -1));
    SS_TRY(TSSetMaxSteps(ts_, PETSC_MAX_INT));
    SS_TRY(TSSetMaxTime(ts_, 1e300));
    SS_TRY(TSSetExactFinalTime(ts_, TS_EXACTFINALTIME_STEPOVER));
    std::vector<double> f(y_.size());
    field.rates_at(0, y_.data(), f.data());
    double rate = 0;
    for (size_t k = 0; k < f.size(); ++k)
      rate = std::max(rate, std::abs(f[k]) / (field.unit(int(k)) + std::abs(y_[k])));
    SS_TRY(TSSetTimeStep(ts_, 1e-3 / std::max(rate, 1e-3 * scales_of(field.scene()).rate)));
    SS_TRY(TSSetSolution(ts_, u_));
  }
  Sample now() {
    Sample s{0, y_, std::vector<double>(y_.size())};
    SS_TRY(TSGetTime(ts_, &s.t));
    const Reading a(u_);
    std::copy(a + 0, a + y_.size(), s.y.begin());
    field_.rates_at(s.t / field_.period(0).T, s.y.data(), s.f.data());
    return s;
  }
  Sample step() {
    SS_TRY(TSStep(ts_));
    Sample s = now();
    beat("steps");
    for (const double value : s.y)
      if (!std::isfinite(value)) throw Failure("the motion from the start does not stay finite");
    for (size_t k = 0; k < field_.nodes() && std::isfinite(escape_); ++k)
      if (std::abs(field_.psi(s.y.data(), k)) > escape_)
        throw Failure("no cycle: the motion from the start grows without bound");
    return s;
  }

 private:
  void take_implicitly() {
    const PetscInt d = field_.dim();
    auto* const context = const_cast<CellField*>(&field_);
    SS_TRY(MatCreateSeqDense(PETSC_COMM_SELF, d, d, nullptr, J_.out()));
    SS_TRY(TSSetIFunction(ts_, nullptr, residual_for_ts, context));
    SS_TRY(TSSetIJacobian(ts_, J_, J_, jacobian_for_ts, context));
    SS_TRY(TSSetType(ts_, TSROSW));
    SS_TRY(TSRosWSetType(ts_, TSROSWRA34PW2));
    SNES equations = nullptr;
    KSP system = nullptr;
    SS_TRY(TSGetSNES(ts_, &equations));
    SS_TRY(SNESGetKSP(equations, &system));
    solve_by_banded_lu(system);
  }

  const CellField& field_;
  std::vector<double> y_;
  double escape_;  // see escape_velocity()
  VecHandle u_;
  MatHandle J_;
  TsHandle ts_;
};

// A passage of the section: psi of one node passes its mean upwards (downwards where v < 0, so that the cycle
// of a mirror image is the mirror image of the cycle). Under a load the begin of one of its periods.
struct Passage {
  double t;
  std::vector<double> y;
};

class Settling {
 public:
  Settling(const Scene& cell, const std::vector<double>& start, double tolerance, Steps steps)
      : cell_(cell), field_(cell, cell.forced() ? 1 : 0),
        motion_(field_, in_band_order(field_, start.data()), escape_velocity(cell), steps),
        tolerance_(tolerance), steps_(steps) {}
  SmoothCycle cycle(int turns);

 private:
  double turn() const { return 2 * M_PI / scales_of(cell_).rate; }
  void choose_section();
  double above(double psi) const { return cell_.v < 0 ? level_ - psi : psi - level_; }
  bool forced() const { return field_.periods() > 0; }
  double last_begin(double t) const { return std::floor(t / field_.period(0).T) * field_.period(0).T; }
  bool passes(const Sample& a, const Sample& b) const {
    if (forced()) return last_begin(b.t) > a.t;
    return above(psi(a)) < 0 && above(psi(b)) >= 0;
  }
  double psi(const Sample& s) const { return field_.psi(s.y.data(), section_); }
  double psi_between(const Sample& a, const Sample& b, double t) const;
  Passage passage(const Sample& a, const Sample& b) const;
  double distance(const Passage& a, const Passage& b) const;
  [[noreturn]] void dies_out() const;
  bool attempt(size_t back, SmoothCycle& found);
  SmoothCycle shortest(const SmoothCycle& found, int turns) const;
  void check_steps(size_t steps) const;
  void keep(Sample next);
  bool oscillates() const;

  const Scene& cell_;
  CellField field_;
  Motion motion_;
  double tolerance_;
  Steps steps_;
  size_t section_ = 0;  // the node whose psi it is
  double level_ = 0;
  std::vector<double> range_;
  std::deque<Sample> samples_;
  std::deque<Passage> passages_;
};

// The node that moves most in the first turns, and its mean velocity there; or v where friction is stiff:
// then the motion creeps for any number of turns between its slips, and two of these are what is looked at.
void Settling::choose_section() {
  const size_t d = size_t(field_.dim()), nodes = field_.nodes();
  std::vector<double> low(d, 1e300), high(d, -1e300), slowest(nodes, 1e300), fastest(nodes, -1e300),
      sum(nodes);
  Sample last = motion_.now();
  const bool slips = steps_ == Steps::stiff;
  double end = (slips ? most_turns : 8) * turn(), from = (slips ? most_turns : 2) * turn();
  level_ = cell_.v;
  for (size_t steps = 0, passed = 0; last.t < end; check_steps(++steps)) {
    if (steps_ == Steps::plain && double(steps) > stiff_from * (1 + last.t / turn()))
      throw NotByThese("stiff");
    const Sample next = motion_.step();
    if (slips && passes(last, next)) {
      if (passed == 0) from = last.t;
      if (++passed == 3) end = next.t;
    }
    for (size_t k = 0; k < d && next.t > from; ++k) {
      low[k] = std::min(low[k], next.y[k]);
      high[k] = std::max(high[k], next.y[k]);
    }
    for (size_t k = 0; k < nodes && next.t > from; ++k) {
      const double before = field_.psi(last.y.data(), k), now = field_.psi(next.y.data(), k);
      slowest[k] = std::min(slowest[k], now);
      fastest[k] = std::max(fastest[k], now);
      sum[k] += (next.t - last.t) * (now + before) / 2;
    }
    last = next;
  }
  if (slips && last.t >= most_turns * turn()) throw NotByThese("no slips");
  for (size_t k = 0; k < nodes; ++k)
    if (fastest[k] - slowest[k] > fastest[section_] - slowest[section_]) section_ = k;
  if (!slips)
    level_ = std::min(fastest[section_], std::max(slowest[section_], sum[section_] / (last.t - from)));
  for (size_t k = 0; k < d; ++k) range_.push_back(std::max(high[k] - low[k], 1e-9 * field_.unit(int(k))));
  samples_ = {last};
}

double Settling::psi_between(const Sample& a, const Sample& b, double t) const {
  const size_t width = size_t(field_.width()), from = section_ * width;
  if (width == size_t(field_.dof())) return hermite(a, b, t, from);
  std::vector<double> y(a.y);
  for (size_t k = from; k < from + width; ++k) y[k] = hermite(a, b, t, k);
  return field_.psi(y.data(), section_);
}

Passage Settling::passage(const Sample& a, const Sample& b) const {
  const auto excess = [&](double t) { return above(psi_between(a, b, t)); };
  const double t =
      forced() ? last_begin(b.t)
               : find_root(excess, {a.t, above(psi(a)), b.t, above(psi(b))}, 1e-14 * b.t);
  Passage p{t, {}};
  for (size_t k = 0; k < a.y.size(); ++k) p.y.push_back(hermite(a, b, p.t, k));
  return p;
}

double Settling::distance(const Passage& a, const Passage& b) const {
  double largest = 0;
  for (size_t k = 0; k < a.y.size(); ++k) largest = std::max(largest, std::abs(a.y[k] - b.y[k]) / range_[k]);
  return largest;
}

// Collocation from the motion since the passage `back` turns ago.
bool Settling::attempt(size_t back, SmoothCycle& found) {
  const Passage &end = passages_.back(), &begin = passages_[passages_.size() - 1 - back];
  const double period = end.t - begin.t;
  std::vector<double> times;
  for (const Sample& s : samples_)
    if (s.t > begin.t && s.t < end.t) times.push_back(s.t);
  CycleGuess guess{period,
                   [&](double phase, double* natural) {
                     const double t = begin.t + phase * period;
                     const auto after = std::lower_bound(samples_.begin() + 1, samples_.end() - 1, t,
                                                         [](const Sample& s, double at) { return s.t < at; });
                     std::vector<double> y(range_.size());
                     for (size_t k = 0; k < y.size(); ++k) y[k] = hermite(*(after - 1), *after, t, k);
                     unfold(field_, y.data(), natural);
                   },
                   {0},
                   forced() ? int(std::lround(period / field_.period(0).T)) : 0};
  const size_t intervals = std::min<size_t>(times.size(), field_.dim() > 30 ? 40 : 80);
  for (size_t i = 1; i < intervals; ++i)
    guess.mesh.push_back((times[i * times.size() / intervals] - begin.t) / period);
  guess.mesh.push_back(1);
  try {
    const SmoothCycle whole = solve_cycle(cell_, guess, tolerance_);
    // near the motion that it was sought from, and no rest
    if (!forced() && !(whole.cycle.amplitude > 1e-6 * field_.unit_of_psi() &&
                       std::abs(whole.cycle.period / period - 1) < .1))
      return false;
    found = shortest(whole, int(back));
  } catch (const Failure&) {
    return false;
  }
  return true;
}

// A cycle that has repeated within its turns, or under a load within its periods, as it seems to beside a
// doubling, is the shorter one.
SmoothCycle Settling::shortest(const SmoothCycle& found, int turns) const {
  constexpr double same = 1e-6;
  const int d = field_.dim(), periods = forced() ? found.cycle.forcing_periods : turns;
  const auto at = [&](double phase) {
    std::vector<double> y(static_cast<size_t>(d));
    evaluate(Collocation::gauss5(), found.mesh, found.values.data(), d, phase, y.data());
    return y;
  };
  const std::vector<double> begin = at(0);
  for (int part = 1; part < periods; ++part) {
    if (periods % part != 0) continue;
    const double share = double(part) / periods;
    const std::vector<double> there = at(share);
    double apart = 0;
    for (size_t k = 0; k < begin.size(); ++k)
      apart = std::max(apart, std::abs(there[k] - begin[k]) / range_[k]);
    if (apart > same) continue;
    CycleGuess guess{
        share * found.cycle.period,
        [&](double phase, double* natural) { unfold(field_, at(share * phase).data(), natural); },
        {},
        forced() ? part : 0};
    const int intervals = std::max(12, int(found.mesh.size()) / periods);
    for (int i = 0; i <= intervals; ++i) guess.mesh.push_back(double(i) / intervals);
    return solve_cycle(cell_, guess, tolerance_);
  }
  return found;
}

// Where neither kind of steps suits the motion they are so short that a dozen turns do not fit into memory,
// or into anybody's patience.
void Settling::check_steps(size_t steps) const {
  const size_t bytes = sizeof(Sample) + 2 * (size_t(field_.dim()) * sizeof(double) + 16),
               most = size_t(most_memory) / bytes;
  if (steps <= most) return;
  throw Failure("no cycle: the motion from the start is too stiff to be followed: " + std::to_string(most) +
                " steps, which take " + std::to_string(size_t(most_memory) / 1000000) +
                " MB, are less than " + std::to_string(most_turns_a_period) + " turns");
}

void Settling::keep(Sample next) {
  samples_.push_back(std::move(next));
  while (samples_.size() > 2 && !passages_.empty() && samples_[1].t < passages_.front().t)
    samples_.pop_front();
  check_steps(samples_.size());
}

bool Settling::oscillates() const {
  double low = 1e300, high = -1e300;
  for (const Sample& s : samples_) {
    low = std::min(low, psi(s));
    high = std::max(high, psi(s));
  }
  return high - low >= 1e-7 * field_.unit_of_psi();
}

// What became of a motion that oscillates no more.
void Settling::dies_out() const {
  const double last = psi(samples_.back());
  const bool slides = std::abs(last) > 1e-2 * std::abs(cell_.v);
  throw Failure("no cycle: the motion from the start " +
                (slides ? "settles on steady sliding" : "comes to rest, psi " + rounded_text(last, 2)));
}

// Beside a fold the motion lingers where Newton's method finds the cycle that repels: that one is taken only
// where the motion stays, or settles on no other.
SmoothCycle Settling::cycle(int turns) {
  choose_section();
  // without a passage it slides or rests; a load's come without fail, in any number to a turn of the motion
  const double turns_of_patience = steps_ == Steps::stiff ? most_turns : 20;
  const double patience = forced() ? std::numeric_limits<double>::infinity() : turns_of_patience * turn();
  if (forced()) turns = int(std::ceil(turns * std::max(1., turn() / field_.period(0).T)));
  double end = samples_.back().t + patience, best = 1e300, tried = near_enough;
  SmoothCycle found;
  std::optional<SmoothCycle> repelling;
  for (int count = 0; count < turns;) {
    keep(motion_.step());
    const Sample &a = samples_[samples_.size() - 2], &b = samples_.back();
    const bool passed = b.t <= end && passes(a, b);
    if (passed) {
      ++count;
      end = b.t + std::max(patience, passages_.empty() ? 0. : 20 * (b.t - passages_.back().t));
      passages_.push_back(passage(a, b));
      if (passages_.size() > most_turns_a_period + 1) passages_.pop_front();
    }
    if (b.t > end || (passed && passages_.size() > 1 && !forced() && !oscillates())) {
      if (repelling) return *repelling;
      dies_out();
    }
    for (size_t back = 1; passed && back < passages_.size(); ++back) {
      const double returned = distance(passages_.back(), passages_[passages_.size() - 1 - back]);
      best = std::min(best, returned);
      if (!(returned < tried)) continue;
      if (attempt(back, found)) {
        if (returned < stays || growth_rate(found.cycle) * found.cycle.period < repels) return found;
        repelling = found;
      }
      tried = returned / 4;
    }
  }
  if (repelling) return *repelling;
  throw Failure(
      fmt::format("no cycle: in {} {} the motion from the start never repeats; its nearest return "
                  "within {} of them misses by {:.3g} of its range (chaos, or a slow transient: another "
                  "start may settle)",
                  turns, forced() ? "periods of the load" : "turns", most_turns_a_period, best));
}

}  // namespace

SmoothCycle settled_cycle(const Scene& cell, const std::vector<double>& start, int turns, double tolerance) {
  check_smooth_cell(cell);
  const auto settled = [&](Steps steps) { return Settling(cell, start, tolerance, steps).cycle(turns); };
  if (cell.forced() || !cell.friction.has_state()) return settled(Steps::any);
  for (const Steps steps : {Steps::plain, Steps::stiff}) {
    try {
      return settled(steps);
    } catch (const NotByThese&) {
    }
  }
  return settled(Steps::any);
}

}  // namespace stickslip
