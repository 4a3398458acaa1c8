#include "study/step_audit.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "numerics/tableau.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "time/methods.hpp"

namespace stickslip {

namespace {

double spectral_radius(const std::vector<Complex>& values) {
  double largest = 0;
  for (const Complex& l : values) largest = std::max(largest, std::abs(l));
  return largest;
}

// Largest modulus of the roots of a polynomial, coefficients highest power first: of the eigenvalues of its
// companion matrix.
double largest_root(const std::vector<Complex>& c) {
  if (std::abs(c[0]) == 0) return HUGE_VAL;
  const int n = int(c.size()) - 1;
  std::vector<Complex> companion(n * n);
  for (int i = 0; i < n; ++i) {
    companion[i] = -c[i + 1] / c[0];
    if (i > 0) companion[i * n + i - 1] = 1;
  }
  return spectral_radius(eigenvalues(n, companion));
}

// F and the state's kinetics where the slope dF/dpsi is least and largest over all nodes and ranks.
struct Slopes {
  Partials F;
  RatePartials g;
};

std::vector<Slopes> friction_extremes(const Model& model, Vec u) {
  const Reading a(u);
  const int dof = model.dof();
  Slopes found[2] = {{{0, HUGE_VAL, 0}, {}}, {{0, -HUGE_VAL, 0}, {}}};
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double psi = a[i * dof], state = dof == 3 ? a[i * dof + 2] : 0;
    const Slopes here{model.friction(i, psi, state), model.state_rate(i, psi, state)};
    if (here.F.F_psi < found[0].F.F_psi) found[0] = here;
    if (here.F.F_psi > found[1].F.F_psi) found[1] = here;
  }
  for (int side = 0; side < 2; ++side) {
    struct {
      double value;
      int rank;
    } best{side == 0 ? found[0].F.F_psi : -found[1].F.F_psi, rank_in(model.comm())};
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &best, 1, MPI_DOUBLE_INT, MPI_MINLOC, model.comm()));
    SS_TRY(MPI_Bcast(&found[side], sizeof(Slopes) / sizeof(double), MPI_DOUBLE, best.rank, model.comm()));
  }
  return {found[0], found[1]};
}

// Of steady sliding in a medium with the mean coefficients; none where there is no steady state. Collective.
std::optional<Slopes> slopes_of_sliding(const Model& model) {
  const Scene& s = model.scene();
  const auto at = [&](PetscInt i) {
    const double state = model.dof() == 3 ? model.steady_state(i, s.v) : 0;
    return Slopes{model.friction(i, s.v, state), model.state_rate(i, s.v, state)};
  };
  if (model.dof() == 3 && !std::isfinite(model.steady_state(0, s.v))) return std::nullopt;
  if (!s.has_profile() && !s.laws_differ()) {
    Slopes slopes = at(0);
    const double amplitude = model.amplitude()[0];  // their mean is 1
    slopes.F.F_psi /= amplitude;
    slopes.F.F_state /= amplitude;
    return slopes;
  }
  double sums[4] = {0, 0, 0, 0};
  for (PetscInt i = 0; i < model.local(); ++i) {
    const auto [F, g] = at(i);
    const double parts[4] = {F.F_psi, F.F_state, g.g_psi, g.g_state};
    for (int k = 0; k < 4; ++k) sums[k] += parts[k] / double(s.n);
  }
  sum_over(model.comm(), sums, 4);
  return Slopes{{0, sums[0], sums[1]}, {0, sums[2], sums[3]}};
}

// The method of `like`, without its monitors, viewers and error control.
void copy_method(const Integrator& like, TS to) {
  const std::string type = like.method().type;
  const TS from = like.ts();
  SS_TRY(TSSetType(to, type.c_str()));
  set_subtype(to, type, like.method().subtype);
  if (type == TSSSP) {
    PetscInt stages;
    SS_TRY(TSSSPGetNumStages(from, &stages));
    SS_TRY(TSSSPSetNumStages(to, stages));
  }
  if (type == TSTHETA) {
    PetscReal theta;
    PetscBool endpoint;
    SS_TRY(TSThetaGetTheta(from, &theta));
    SS_TRY(TSThetaGetEndpoint(from, &endpoint));
    SS_TRY(TSThetaSetTheta(to, theta));
    SS_TRY(TSThetaSetEndpoint(to, endpoint));
  }
}

// Waves of the scene about sliding that a method is tried on: all of a few; of many the fastest of all and of
// the resolved ones, the ends of both rows, and some between, spread by kappa^2. Ascending.
std::set<std::int64_t> sampled_waves(const Waves& all, const Waves& resolved, const FastestWave& fastest,
                                     const FastestWave& leading) {
  std::set<std::int64_t> found{0, all.count - 1, fastest.index, leading.index};
  if (resolved.count > 0) found.insert(resolved.count - 1);
  if (all.count <= 16)
    for (std::int64_t j = 0; j < all.count; ++j) found.insert(j);
  const double largest = all.kappa2(all.count - 1);
  for (const double part : {1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.25, 0.5, 0.75})
    found.insert(std::min(all.first_beyond(part * largest), all.count - 1));
  return found;
}

}  // namespace

void StepForecast::add_wave(const LinearPoint& medium, Implicit implicit, double kappa2, bool resolved) {
  const auto rows_of = [&](Part terms) {
    std::vector<double> rows(dof_ * dof_);
    if (medium.massless())
      medium.massless_block(kappa2).write(dof_, rows.data());
    else
      medium.block(terms, kappa2).write(dof_, rows.data());
    return rows;
  };
  const std::vector<double> full = rows_of(Part::full), zero(full.size());
  Wave w;
  w.resolved = resolved;
  w.lambda = eigenvalues(dof_, full);
  w.growth = -HUGE_VAL;
  for (const Complex& l : w.lambda) w.growth = std::max(w.growth, l.real());
  const PartsOfStep parts = parts_of(implicit);
  const auto rows = [&](const std::optional<Part>& terms) { return terms ? rows_of(*terms) : zero; };
  w.explicit_part = rows(parts.of_explicit);
  w.implicit_part = rows(parts.of_implicit);
  waves_.push_back(std::move(w));
}

StepForecast::StepForecast(const Model& model, Vec u, const Integrator& like)
    : StepForecast(model, u, like, false) {}
StepForecast StepForecast::anywhere(const Model& model, const Integrator& like) {
  return {model, nullptr, like, true};
}

StepForecast::StepForecast(const Model& model, Vec u, const Integrator& like, bool anywhere)
    : dof_(model.scene().massless() ? model.dof() - 1 : model.dof()),
      all_implicit_(like.report().implicit == Implicit::both) {
  const Implicit implicit = like.report().implicit;
  const std::string type = like.method().type;
  if (type == TSBDF) bdf_order_ = std::stoi(like.method().subtype);
  is_alpha_ = type == TSALPHA;
  if (type == leapfrog_type) stages_ = &leapfrog();
  if (is_alpha_) SS_TRY(TSAlphaGetParams(like.ts(), &alpha_m_, &alpha_f_, &alpha_gamma_));
  add_waves_about_sliding(model, implicit);
  about_sliding_ = waves_.size();
  if (u || anywhere) add_waves_about(model, u, implicit);
  if (bdf_order_ == 0 && !is_alpha_ && !stages_) make_ts(like, implicit);
}

void StepForecast::add_waves_about(const Model& model, Vec u, Implicit implicit) {
  const Scene s = model.scene().averaged();
  const SlopeBounds bounds = model.slope_bounds();
  std::vector<Slopes> friction = {{{0, -bounds.falling, 0}, {}}, {{0, bounds.rising, 0}, {}}};
  if (u) friction = friction_extremes(model, u);
  least_slope_ = friction[0].F.F_psi;
  // Where sliding is unstable, at v or where it is, the motion reaches the steepest friction: the cubic's
  // where its limit cycle turns, that of a regularised threshold at rest.
  const bool oscillates = !s.massless() && (growth_.of_all > 0 ||
                                            LinearPoint(s, friction[0].F, friction[0].g).damping() < 0);
  if (oscillates && bounds.rising > 0) friction[1].F.F_psi = std::max(friction[1].F.F_psi, bounds.rising);
  double largest = s.n > 1 ? largest_symbol(s.order, s.form == Form::chain ? 1 : s.h()) : 0;
  // the fastest wave where it is fastest, in the mean medium
  if (model.scene().medium.varies() && largest > 0 && s.K1() > 0)
    largest = (std::pow(model.wave_frequency(), 2) / s.A() - s.K0()) / s.K1();
  for (const Slopes& f : friction)
    for (const double part : {0., 0.25, 0.5, 0.75, 1.})
      add_wave(LinearPoint(s, f.F, f.g), implicit, largest * part, false);
}

void StepForecast::add_waves_about_sliding(const Model& model, Implicit implicit) {
  const std::optional<Slopes> slopes = slopes_of_sliding(model);
  if (!slopes) return;
  const LinearPoint medium(model.scene().averaged(), slopes->F, slopes->g);
  const Waves all = Waves::of(model.scene()), resolved = all.resolved(model.scene());
  const auto fastest = fastest_wave(medium, all, same_growth(medium));
  if (!fastest) return;
  const auto leading = fastest_wave(medium, resolved, same_growth(medium));
  growth_.of_all = fastest->value.real();
  growth_.resolved = leading ? leading->value.real() : growth_.of_all;
  for (const std::int64_t j : sampled_waves(all, resolved, *fastest, leading ? *leading : *fastest)) {
    const double kappa2 = all.kappa2(j);
    // the shift of everything neither grows nor decays
    if (medium.stiffness(kappa2) == 0 && !(rightmost_root(medium, kappa2).value_or(-1).real() > 0)) continue;
    add_wave(medium, implicit, kappa2, j < resolved.count || !leading);
  }
}

void StepForecast::make_ts(const Integrator& like, Implicit implicit) {
  const auto size = static_cast<PetscInt>(waves_.size()) * dof_ * dof_;
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, size, u_.out()));
  SS_TRY(TSCreate(PETSC_COMM_SELF, ts_.out()));
  copy_method(like, ts_);
  SS_TRY(TSSetProblemType(ts_, TS_NONLINEAR));
  // of zeros: time/petsc_stepper.cpp
  if (implicit != Implicit::both || capabilities(like.method()).splits)
    SS_TRY(TSSetRHSFunction(ts_, nullptr, RHSFunction, this));
  TSAdapt adapt;
  SS_TRY(TSGetAdapt(ts_, &adapt));
  SS_TRY(TSAdaptSetType(adapt, TSADAPTNONE));
  SS_TRY(TSSetExactFinalTime(ts_, TS_EXACTFINALTIME_STEPOVER));
  SS_TRY(TSSetMaxTime(ts_, 1e300));
  if (capabilities(like.method()).is_explicit) return;
  SS_TRY(TSSetIFunction(ts_, nullptr, IFunction, this));
  SS_TRY(MatCreateSeqBAIJ(PETSC_COMM_SELF, dof_, size, size, 1, nullptr, J_.out()));
  SS_TRY(TSSetIJacobian(ts_, J_, J_, IJacobian, this));
  SNES snes;
  KSP ksp;
  SS_TRY(TSGetSNES(ts_, &snes));
  SS_TRY(SNESSetType(snes, SNESKSPONLY));
  SS_TRY(SNESGetKSP(snes, &ksp));
  solve_by_blocks(ksp);
}

// The columns of a wave's propagator stand one behind the other: entry (wave, column, row) of `a` and `out`.
void StepForecast::add_product(double factor, std::vector<double> Wave::*part, const double* a,
                               double* out) const {
  const int d = dof_;
  for (const Wave& w : waves_)
    for (int column = 0; column < d; ++column, a += d, out += d)
      for (int row = 0; row < d; ++row)
        for (int k = 0; k < d; ++k) out[row] += factor * (w.*part)[row * d + k] * a[k];
}

PetscErrorCode StepForecast::RHSFunction(TS, PetscReal, Vec u, Vec f, void* context) {
  return guarded([&] {
    SS_TRY(VecSet(f, 0));
    static_cast<StepForecast*>(context)->add_product(1, &Wave::explicit_part, Reading(u), Writing(f));
  });
}

// udot - implicit part
PetscErrorCode StepForecast::IFunction(TS, PetscReal, Vec u, Vec udot, Vec f, void* context) {
  return guarded([&] {
    SS_TRY(VecCopy(udot, f));
    static_cast<StepForecast*>(context)->add_product(-1, &Wave::implicit_part, Reading(u), Writing(f));
  });
}

PetscErrorCode StepForecast::IJacobian(TS, PetscReal, Vec, Vec, PetscReal shift, Mat, Mat P, void* context) {
  return guarded([&] {
    auto& self = *static_cast<StepForecast*>(context);
    self.last_shift_ = shift;
    const PetscInt d = self.dof_;
    PetscInt block = 0;
    std::vector<double> values(d * d);
    for (const Wave& w : self.waves_)
      for (PetscInt column = 0; column < d; ++column, ++block) {
        for (std::size_t i = 0; i < values.size(); ++i) values[i] = -w.implicit_part[i];
        for (PetscInt k = 0; k < d; ++k) values[k * (d + 1)] += shift;
        SS_TRY(MatSetValuesBlocked(P, 1, &block, 1, &block, values.data(), INSERT_VALUES));
      }
    SS_TRY(MatAssemblyBegin(P, MAT_FINAL_ASSEMBLY));
    SS_TRY(MatAssemblyEnd(P, MAT_FINAL_ASSEMBLY));
  });
}

double StepForecast::multistep_modulus(Complex z) const {
  std::vector<Complex> c;
  if (is_alpha_) {
    // The slope w = dt u_t is carried along: (a_m mu + 1 - a_m) w = z (a_f mu + 1 - a_f) u,
    // (mu - 1) u = (g mu + 1 - g) w.
    const double m = alpha_m_, f = alpha_f_, g = alpha_gamma_;
    c = {m - z * f * g, 1 - 2 * m - z * (f * (1 - g) + g * (1 - f)), m - 1 - z * (1 - f) * (1 - g)};
  } else {
    // sum over j of (1 - 1/mu)^j/j = z
    c.assign(bdf_order_ + 1, 0);
    c[0] = -z;
    std::vector<double> power = {1};
    for (int j = 1; j <= bdf_order_; ++j) {
      power.push_back(0);
      for (std::size_t i = power.size() - 1; i > 0; --i) power[i] -= power[i - 1];
      for (std::size_t i = 0; i < power.size(); ++i) c[i] += power[i] / j;
    }
  }
  return largest_root(c);
}

std::vector<double> StepForecast::rates(double dt) {
  std::vector<double> rates;
  if (waves_.empty()) return rates;
  const auto add_rate = [&](const std::vector<double>& propagator) {
    double largest = 0;
    for (const double p : propagator) largest = std::isfinite(p) ? std::max(largest, std::abs(p)) : HUGE_VAL;
    rates.push_back(std::log(largest < 1e60 ? spectral_radius(eigenvalues(dof_, propagator)) : largest) / dt);
  };
  if (stages_) {
    for (const Wave& w : waves_) add_rate(propagator(*stages_, dof_, w.explicit_part, w.implicit_part, dt));
    return rates;
  }
  if (bdf_order_ > 0 || is_alpha_) {
    for (const Wave& w : waves_) {
      double modulus = 0;
      for (const Complex& l : w.lambda) modulus = std::max(modulus, multistep_modulus(dt * l));
      rates.push_back(std::log(modulus) / dt);
    }
    return rates;
  }
  const auto d = static_cast<std::size_t>(dof_), entries = d * d;
  {
    const Writing unit(u_);
    for (std::size_t i = 0; i < waves_.size() * entries; ++i) unit[i] = i % entries % (d + 1) == 0 ? 1 : 0;
  }
  SS_TRY(TSSetTime(ts_, 0));
  SS_TRY(TSSetTimeStep(ts_, dt));
  SS_TRY(TSSetSolution(ts_, u_));
  SS_TRY(TSRestartStep(ts_));
  SS_TRY(TSSetConvergedReason(ts_, TS_CONVERGED_ITERATING));
  SS_TRY(TSStep(ts_));
  const Reading b(u_);
  for (std::size_t wave = 0; wave < waves_.size(); ++wave)
    add_rate({b + wave * entries, b + (wave + 1) * entries});
  return rates;
}

double StepForecast::excess_rate(double dt) {
  const std::vector<double> rate = rates(dt);
  double excess = -HUGE_VAL;
  for (std::size_t i = about_sliding_; i < waves_.size(); ++i) {
    const double growth = std::max(0., waves_[i].growth);
    if (!(all_implicit_ && rate[i] < 2 * growth)) excess = std::max(excess, rate[i] - growth);
  }
  return excess;
}

bool StepForecast::explodes(double dt, double duration) {
  return dt < duration && excess_rate(dt) * duration > std::log(1e6);
}

SlidingGrowth StepForecast::sliding_growth(const std::map<double, double>& time_at_step) {
  if (time_at_step.empty()) return growth_;
  std::vector<double> mean(about_sliding_);
  double time = 0;
  for (const auto& [dt, duration] : time_at_step) time += duration;
  for (const auto& [dt, duration] : time_at_step) {
    std::vector<double>& rate = rates_at_[dt];
    if (rate.empty()) rate = rates(dt);
    for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += duration / time * rate[i];
  }
  SlidingGrowth largest;
  for (std::size_t i = 0; i < mean.size(); ++i) {
    largest.of_all = std::fmax(largest.of_all, mean[i]);
    if (waves_[i].resolved) largest.resolved = std::fmax(largest.resolved, mean[i]);
  }
  return largest;
}

double StepForecast::shortest_wave_excess(double dt) {
  if (about_sliding_ == 0) return std::numeric_limits<double>::quiet_NaN();
  return rates(dt)[about_sliding_ - 1] - shortest_growth();
}

double StepForecast::shift(double dt) {
  last_shift_ = 0;
  if (bdf_order_ > 0) {
    for (int j = 1; j <= bdf_order_; ++j) last_shift_ += 1 / (j * dt);
  } else if (is_alpha_) {
    last_shift_ = alpha_m_ / (alpha_f_ * alpha_gamma_ * dt);
  } else if (stages_) {
    last_shift_ = 1 / (stages_->diagonal() * dt);
  } else {
    (void)rates(dt);
  }
  return last_shift_;
}

double StepForecast::limit(double dt, double duration) {
  double good = dt;
  for (int i = 0; i < 40 && explodes(good, duration); ++i) good /= 2;
  if (good == dt) return dt;
  return last_place([&](double step) { return !explodes(step, duration); }, good, 2 * good, good / 256);
}

namespace {

// Least slope of friction over the velocities that a scene may have, at steady state; with profiles of all
// nodes, else of amplitude 1. Collective.
double least_slope(const Model& model) {
  const bool all = model.scene().has_profile() || model.scene().laws_differ();
  const SceneScales scales = scales_of(model.scene());
  double least = 0;
  for (PetscInt i = 0; i < (all ? model.local() : 1); ++i)
    for (double psi = 1e-6 * scales.least.psi; psi < 100 * scales.slip.psi; psi *= 1.2)
      for (const double sign : {-1., 1.}) {
        const double state = model.dof() == 3 ? model.steady_state(i, sign * psi) : 0;
        least =
            std::min(least, model.friction(i, sign * psi, state).F_psi / (all ? 1 : model.amplitude()[0]));
      }
  return all ? -largest_over(model.comm(), -least) : least;
}

bool solves_friction(const Integrator& integrator) {
  const Implicit implicit = integrator.report().implicit;
  return implicit == Implicit::friction || implicit == Implicit::both;
}

// At shift r = 1/(a dt) the implicit equations of uniform motion have the determinant r^2 + C r + A K0, C = A
// (B + F') + s delta. Where it is negative at the least slope F', it changes sign along psi, and the
// equations have several solutions.
bool warn_of_several_solutions(const Model& model, const Integrator& integrator, double dt,
                               StepForecast& forecast) {
  if (std::string(integrator.method().type) == TSROSW || !solves_friction(integrator)) return false;
  const Scene s = model.scene().averaged();
  if (s.massless()) return false;  // shift eta + K psi(eta) rises with eta
  const auto damping = [&s](double slope) { return LinearPoint(s, {0, slope, 0}, {}).damping(); };
  // the motion stays clear of weakening friction
  if (damping(forecast.least_slope()) >= 0 && !(forecast.sliding_growth().of_all > 0)) return false;
  const double C = damping(least_slope(model)), product = s.A() * s.K0();
  if (C >= 0 || C * C <= 4 * product) return false;
  const double r = forecast.shift(dt), root = std::sqrt(C * C / 4 - product), high = -C / 2 + root;
  if (r <= 0 || r >= high || r <= -C / 2 - root) return false;
  warn(fmt::format(
      "ts_dt {} is so long that the implicit equations of {} have several solutions (friction falls with "
      "velocity; one alone up to about {:.3g}): Newton's method may find one that the motion does not lead "
      "to",
      number_text(dt), integrator.method().name(), dt * r / high));
  return true;
}

// Where a step is long against the time in which friction acts, the stages of Runge-Kutta and Rosenbrock
// methods err by more than the step should (docs/limits.md has the orders measured); bdf and arkimex l2 keep
// theirs.
bool warn_of_order_reduction(const Model& model, const Integrator& integrator, double dt, Vec u) {
  constexpr double stiff = 30;  // dt times the rate of friction, from where on orders fall
  const Method& method = integrator.method();
  const bool keeps = std::string(method.type) == TSBDF || method.name() == "arkimex:l2";
  if (!solves_friction(integrator) || method.order < 2 || keeps) return false;
  const double rate = model.friction_rate(u);
  if (!(dt * rate > stiff)) return false;
  warn(fmt::format(
      "friction acts at up to {:.3g} per unit time, {:.3g} times in a ts_dt of {}: in so stiff a scene the "
      "order of {} falls from {} to 2, 1 or less; use error control, bdf:2 or arkimex:l2",
      rate, dt * rate, number_text(dt), method.name(), method.order));
  return true;
}

// A method that the user named: the choice goes by the same count (time/methods.hpp).
bool warn_of_recovery(const Model& model, const Integrator& integrator) {
  constexpr double many = 1e5, turns_a_step = 3;
  if (integrator.report().implicit == Implicit::both) return false;
  const double turns = turns_in_recovery(model);
  if (!(turns > many)) return false;
  warn(fmt::format(
      "{}: a slip loses so much friction that deviations die away or turn {:.1g} times while the state "
      "recovers from it, and explicit steps are no longer than about {} of these times: {:.1g} steps for "
      "each slip; take ts_type arkimex with imex_implicit both, the method chosen where none is named",
      integrator.method().name(), turns, turns_a_step, turns / turns_a_step));
  return true;
}

}  // namespace

bool warn_of_steps(const Model& model, const Integrator& integrator, Vec u, double duration) {
  if (integrator.adaptive()) return warn_of_recovery(model, integrator);
  const double dt = integrator.next_step();
  if (dt >= duration) return false;
  StepForecast forecast(model, u, integrator);
  const bool several = warn_of_several_solutions(model, integrator, dt, forecast),
             stiff = warn_of_order_reduction(model, integrator, dt, u);
  if (!forecast.explodes(dt, duration)) return several || stiff;
  const std::string damped =
      model.viscous() ? fmt::format("viscosity damps it at {:.3g}, ", viscous_rate(model.scene())) : "";
  warn(fmt::format(
      "ts_dt {} is beyond the stability limit of {}, which is about {:.3g} here (the shortest wave turns at "
      "{:.3g} per unit time, {}friction acts at up to {:.3g}): the solution grows without bound, or is "
      "bounded and wrong",
      number_text(dt), integrator.method().name(), forecast.limit(dt, duration), model.wave_frequency(),
      damped, rates_of(model, u).friction));
  return true;
}

std::string limit_in_words(const Integrator& integrator, double duration) {
  const Model& model = integrator.model();
  if (integrator.adaptive() || model.scene().massless()) return "";
  const double dt = integrator.next_step();
  StepForecast forecast = StepForecast::anywhere(model, integrator);
  if (!forecast.explodes(dt, duration)) return "";
  return fmt::format("; the stability limit of {} is about {:.3g} where friction is steepest",
                     integrator.method().name(), forecast.limit(dt, duration));
}

}  // namespace stickslip
