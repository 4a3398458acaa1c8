#include "study/step_audit.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/stability/linearised_operator.hpp"
#include "study/simulate.hpp"

namespace stickslip {

namespace {

constexpr double loose = 1e-3;         // tolerances from here on are looked after
constexpr int audits = 16;             // at equal times
constexpr double record = 1.5;         // a change of psi this much larger than any before is looked at
constexpr PetscInt looks = 1000;       // most steps at which the change of psi is measured, about
constexpr PetscInt most_again = 3000;  // of an accurate repetition

std::string percent(double x) {
  return x > 10 ? "more than 1000 %" : fmt::format("{:.{}f} %", 100 * x, x < 0.1 ? 1 : 0);
}

// Sums over the nodes of a field (psi, eta): |mine - exact|^2, |exact - before|^2, their product.
struct Sums {
  std::array<double, 2> error{}, change{}, product{};
};

Sums sums_of(const Model& model, Vec before, Vec exact, Vec mine) {
  const Reading a(before), b(exact), c(mine);
  double sums[6] = {};
  const int dof = model.dof();
  for (PetscInt i = 0; i < model.local(); ++i) {
    if (model.held(model.first() + i)) continue;
    for (int f = 0; f < 2; ++f) {
      const PetscInt at = i * dof + f;
      const double error = c[at] - b[at], change = b[at] - a[at];
      sums[3 * f] += error * error;
      sums[3 * f + 1] += change * change;
      sums[3 * f + 2] += error * change;
    }
  }
  sum_over(model.comm(), sums, 6);
  return {{sums[0], sums[3]}, {sums[1], sums[4]}, {sums[2], sums[5]}};
}

// Largest |b - a| and |b| of psi.
std::array<double, 2> psi_change(const Model& model, Vec a, Vec b) {
  const Reading x(a), y(b);
  std::array<double, 2> largest{};
  const int dof = model.dof();
  for (PetscInt i = 0; i < model.local(); ++i) {
    largest[0] = std::max(largest[0], std::abs(y[i * dof] - x[i * dof]));
    largest[1] = std::max(largest[1], std::abs(y[i * dof]));
  }
  largest_over(model.comm(), largest.data(), 2);
  return largest;
}

// Is psi within a tenth of its scale of v at half of the nodes, of which up to 4096 are asked?
bool near_sliding(const Model& model, Vec u) {
  const Reading a(u);
  const double v = model.scene().v, scale = scales_of(model.scene()).velocity;
  const PetscInt n = model.local(), dof = model.dof(), stride = (model.scene().n + 4095) / 4096;
  double near = 0;  // those that are, less those that are not, by two
  for (PetscInt i = (stride - model.first() % stride) % stride; i < n; i += stride)
    near += std::abs(a[i * dof] - v) < 0.1 * scale ? 0.5 : -0.5;
  return sum_over(model.comm(), near) >= 0;
}

}  // namespace

struct StepAudit::Impl {
  const Model& model;
  const Options& options;
  const Integrator& integrator;
  double t_begin, t_end;

  bool watching = false;  // are steps repeated?
  double tolerance = 0;   // of an adaptive run
  std::unique_ptr<Model> own_model;
  std::unique_ptr<Integrator> accurate;
  VecHandle before, exact;
  bool has_before = false;
  PetscInt stride = 1;
  int next_audit = 0;
  double largest_change = 0, largest_psi = 0;
  Sums sums;
  int repeated = 0, beyond = 0;
  double longest = 0;              // step repeated
  std::map<double, double> taken;  // time spent at step, in the second half
  // the same of the whole run, between looks that both found it near sliding; since the last look
  std::map<double, double> taken_near, since_look;
  bool is_near = false;
  int next_look = 0;

  Impl(const Model& m, const Options& o, const Integrator& i, double from, double to)
      : model(m), options(o), integrator(i), t_begin(from), t_end(to) {
    const double dt = integrator.next_step();
    tolerance = integrator.tolerances().largest();
    watching = !integrator.adaptive() || tolerance >= loose;
    if (!watching) return;
    before = model.create_vector();
    exact = model.create_vector();
    const double steps = (t_end - t_begin) / dt;
    if (!integrator.adaptive() && steps > double(looks))
      stride = static_cast<PetscInt>(std::min(steps / double(looks), 1e9));
  }

  void note_step(double from, double to) {
    if (to > t_begin + 0.5 * (t_end - t_begin)) add_to(taken, to - from);
    if (is_near) add_to(since_look, to - from);
  }
  void add_to(std::map<double, double>& times, double dt) const {
    if (!integrator.adaptive() && !times.empty()) {
      times.begin()->second += dt;  // the last one may be shorter
      return;
    }
    // Steps within a tenth of each other are taken for the same.
    times[integrator.adaptive() ? std::exp2(std::round(8 * std::log2(dt)) / 8) : dt] += dt;
  }
  // The time at which so many audits are due.
  double due(double count) const { return t_begin + (t_end - t_begin) * count / audits; }
  void look(const ObservedStep& step) {
    if (step.t < due(next_look)) return;
    const bool was_near = std::exchange(is_near, near_sliding(model, step.u));
    for (const auto& [dt, time] : since_look)
      if (was_near && is_near) taken_near[dt] += time;
    since_look.clear();
    while (next_look <= audits && step.t >= due(next_look)) ++next_look;
  }

  void after(const ObservedStep& step) {
    const bool is_step = step.t > step.t_before;
    if (is_step) note_step(step.t_before, step.t);
    look(step);
    if (!watching) return;
    if (is_step && has_before) {
      const std::array<double, 2> now = psi_change(model, before, step.u);
      largest_psi = std::max(largest_psi, now[1]);
      const bool new_record = now[0] > record * largest_change;
      if (new_record) largest_change = now[0];
      if (new_record || step.t >= due(next_audit + 0.5)) repeat(step, now[0]);
    }
    while (next_audit < audits && step.t >= due(next_audit + 0.5)) ++next_audit;
    has_before = (step.index + 1) % stride == 0;
    if (has_before) SS_TRY(VecCopy(step.u, before));
  }

  void repeat(const ObservedStep& step, double change) {
    const double dt = step.t - step.t_before;
    if (!accurate) {
      own_model = std::make_unique<Model>(model.comm(), model.scene());
      MethodSpec automatic;
      automatic.fused = options.boolean("rk_fused");
      accurate = std::make_unique<Integrator>(*own_model, automatic, before, "step_audit_");
      accurate->set_next_step(dt / 8);
    }
    SS_TRY(VecCopy(before, exact));
    const Scales scales = scales_of(model.scene()).least;
    accurate->set_tolerances(
        Tolerances::automatic(scales, Tolerances::usual, std::max(1e-3 * change / scales.psi, 1e-12)));
    accurate->count_from(0);
    try {
      simulate(*accurate, exact, {step.t_before, step.t, most_again}, {});
      if (accurate->report().stop != Stop::end_time) {
        ++beyond;
        return;
      }
    } catch (const Failure&) {
      ++beyond;
      accurate.reset();
      return;
    }
    accurate->set_next_step(dt / 8);  // the last step was cut short to end there
    const Sums now = sums_of(model, before, exact, step.u);
    for (std::size_t f = 0; f < 2; ++f) {
      sums.error[f] += now.error[f];
      sums.change[f] += now.change[f];
      sums.product[f] += now.product[f];
    }
    longest = std::max(longest, dt);
    ++repeated;
  }
};

StepAudit::StepAudit(const Model& model, const Options& options, const Integrator& integrator, double t_begin,
                     double t_end)
    : impl_(std::make_unique<Impl>(model, options, integrator, t_begin, t_end)) {}
StepAudit::~StepAudit() = default;

void StepAudit::step(const ObservedStep& step) { impl_->after(step); }

StepAudit::Verdict StepAudit::verdict(Vec u) const {
  const Impl& m = *impl_;
  Verdict v;
  v.repeated = m.repeated;
  v.beyond = m.beyond;
  // A motion of round-off size is none.
  const double rest =
      1e-7 * m.largest_psi * std::sqrt(double(std::max(1, m.repeated)) * double(m.model.scene().n));
  if (m.repeated > 0 && m.sums.change[0] > rest * rest) {
    double miss = 0;
    for (std::size_t f = 0; f < 2; ++f)
      if (m.sums.change[f] > 0) miss = std::max(miss, std::sqrt(m.sums.error[f] / m.sums.change[f]));
    v.miss = miss;
    v.shift = m.sums.product[0] / m.sums.change[0];
  }
  v.near_sliding = near_sliding(m.model, u);
  // What the mean medium does says little of one whose parts differ, and nothing slides steadily under a
  // load.
  if (m.model.scene().has_profile() || m.model.scene().forced()) return v;
  StepForecast forecast(m.model, nullptr, m.integrator);
  for (const auto& [dt, time] : m.taken_near) v.near_time += time;
  v.truly = forecast.sliding_growth();
  v.near = forecast.sliding_growth(m.taken_near);
  v.taken = forecast.sliding_growth(m.taken);
  return v;
}

bool StepAudit::is_near_sliding(const Model& model, Vec u) { return near_sliding(model, u); }

double StepAudit::longest_near_sliding(const Model& model, const Integrator& integrator, Vec u,
                                       double duration) {
  const double any = std::numeric_limits<double>::infinity();
  if (!integrator.adaptive() || !capabilities(integrator.method()).is_explicit || !near_sliding(model, u))
    return any;
  StepForecast forecast(model, nullptr, integrator);
  const double growth = std::max(0., forecast.sliding_growth().of_all);
  // a growing mode has left sliding by the time that it is 1/round-off times as large
  const double time = growth > 0 ? std::min(duration, -std::log(PETSC_MACHINE_EPSILON) / growth) : duration;
  const auto wrong = [&](double dt) {
    return !((forecast.sliding_growth({{dt, 1.}}).of_all - growth) * time <= largest_short_growth_error);
  };
  if (std::isnan(forecast.sliding_growth().of_all)) return any;
  // far inside the stability region, and where it begins to fail
  const double good = 0.1 / stencil_rate(model.scene());
  double bad = good;
  while (!wrong(bad) && bad < 100 * good) bad *= 1.5;
  if (!wrong(bad)) return any;
  return last_place([&](double dt) { return !wrong(dt); }, good, bad, (bad - good) / 1000);
}

bool StepAudit::warn_of(const Verdict& v, Motion motion) const {
  const Impl& m = *impl_;
  const std::string method = m.integrator.report().method;
  const char* const remedy =
      m.integrator.adaptive() ? "tighten ts_rtol and ts_atol" : "reduce ts_dt, or use an adaptive method";
  bool told = false;
  if (v.miss && !(*v.miss <= largest_miss)) {
    told = true;
    const double shift = std::abs(*v.shift);
    warn(fmt::format(
        "the steps of {} do not follow the motion: {} of them, made again accurately, miss {} of its "
        "change{}; wave speeds, periods and the regime may be wrong ({})",
        method, v.repeated, percent(*v.miss),
        shift > 0.01
            ? fmt::format(", and it runs {} too {} in them", percent(shift), *v.shift > 0 ? "far" : "short")
            : "",
        remedy));
  }
  if (v.beyond > 0) {
    told = true;
    warn(fmt::format(
        "{} of the {} steps of {} that were looked at could not be made again accurately (at most {} "
        "steps were tried for each): nothing vouches for them",
        v.beyond, v.beyond + v.repeated, method, most_again));
  }
  const double duration = m.t_end - m.t_begin, longest = m.taken.empty() ? 0 : m.taken.rbegin()->first;
  const std::string step = fmt::format("steps of up to {:.3g} with {}", longest, method);
  if (v.near_sliding && motion == Motion::sliding && v.truly.resolved * duration > 5 &&
      v.taken.resolved < 0.5 * v.truly.resolved) {
    warn(fmt::format(
        "steady sliding is unstable here, its perturbations grow like exp({:.3g} t), but {} let them {} "
        "like exp({:.3g} t): the regime `{}` is the method's, not the scene's (reduce ts_dt{})",
        v.truly.resolved, step, v.taken.resolved > 0 ? "grow" : "decay", v.taken.resolved, to_string(motion),
        m.integrator.adaptive() ? ", ts_rtol or ts_atol" : ""));
    return true;
  }
  // Once stick-slip is reached, in truth and here, its amplitude no longer depends on how: only a motion that
  // is near sliding up to where regime and amplitude are measured, or should be, comes out wrong.
  const double resolved = (v.near.resolved - v.truly.resolved) * v.near_time;
  const double all = (v.near.of_all - v.truly.of_all) * v.near_time;
  const bool is_short = std::abs(resolved) <= largest_growth_error && all > largest_short_growth_error;
  const double growth = v.truly.resolved, taken = is_short ? v.near.of_all : v.near.resolved;
  const double excess = is_short ? all : resolved, near_truly = v.near_time * std::max(1., taken / growth);
  if (growth > 0 && near_truly > 0.45 * duration && std::abs(excess) > largest_growth_error) {
    told = true;
    const double size = std::abs(excess);
    warn(fmt::format(
        "perturbations of steady sliding grow like exp({:.3g} t), with the steps of {}{} like exp({:.3g} t): "
        "after {:.3g} near sliding their amplitude, and with it the time at which stick-slip sets in, is "
        "wrong by a factor of {} ({})",
        growth, method, is_short ? " those of a few nodes" : "", taken, v.near_time,
        size < 20 ? fmt::format("about {:.3g}", std::exp(size)) : "more than 1e8", remedy));
  }
  if (!m.integrator.adaptive() && v.truly.of_all <= 0 && motion != Motion::sliding &&
      v.taken.of_all * duration > 1) {
    told = true;
    warn(fmt::format(
        "steady sliding is stable here, but {} make its perturbations grow like exp({:.3g} t): the regime "
        "`{}` may be the method's, not the scene's (reduce ts_dt)",
        step, v.taken.of_all, to_string(motion)));
  }
  return told;
}

namespace {

bool has_held_end(const Scene& s) { return s.left == End::velocity || s.right == End::velocity; }

// Processor time, in seconds, of the search for the rightmost mode and of so many right-hand sides: dense
// matrices up to 200 unknowns, then banded ones.
double search_seconds(double unknowns) {
  return unknowns <= 200 ? 1.2e-8 * std::pow(unknowns, 3) : 0.1 + 1e-4 * unknowns;
}
double steps_seconds(double unknowns, long evaluations) {
  return double(evaluations) * (1e-6 + 1e-9 * unknowns);
}

// So many nodes beside a held end that what it does to steady sliding, (K0 - K1 D2)(psi - v) = 0, is
// forgotten behind them; the whole line where nothing makes it fall.
PetscInt nodes_of_layer(const Scene& s) {
  if (s.medium.varies() || s.K0() == 0 || s.K1() == 0) return s.n;
  const double nodes = nodes_to_forget(s) + 4 * s.order;
  return nodes < double(s.n) ? static_cast<PetscInt>(nodes) : s.n;
}

// psi of the nodes beside one held end, in their order along the line.
std::vector<double> layer(const Scene& whole, PetscInt nodes, bool at_left) {
  if ((at_left ? whole.left : whole.right) != End::velocity) return {};
  Scene part = whole;
  part.n = nodes;
  part.length = whole.h() * double(nodes - 1);
  (at_left ? part.right : part.left) = End::free;
  return SteadySliding(part).psi;
}

}  // namespace

std::function<double(PetscInt)> steady_velocity(const Scene& scene) {
  if (!has_held_end(scene)) return {};
  try {
    const PetscInt nodes = nodes_of_layer(scene);
    if (scene.v == 0 || nodes > scene.n / 4) {
      const auto psi = std::make_shared<std::vector<double>>(SteadySliding(scene).psi);
      return [psi](PetscInt node) { return (*psi)[node]; };
    }
    const auto left = std::make_shared<std::vector<double>>(layer(scene, nodes, true));
    const auto right = std::make_shared<std::vector<double>>(layer(scene, nodes, false));
    return [left, right, v = scene.v, n = scene.n](PetscInt node) {
      const auto from_left = std::size_t(node), from_right = std::size_t(n - 1 - node);
      return from_left < left->size()     ? (*left)[from_left]
             : from_right < right->size() ? (*right)[right->size() - 1 - from_right]
                                          : v;
    };
  } catch (const Error&) {
    return {};
  }
}

NearestGrowth nearest_growth(const Model& model, const StepAudit::Verdict& audit, long evaluations) {
  const Scene& s = model.scene();
  const auto none = [](const std::string& why) { return NearestGrowth{NAN, NAN, why}; };
  if (s.force.amplitude != 0) return none("a harmonic force acts, so that nothing slides steadily");
  if (s.load.varies()) return none("the plate's velocity varies, so that nothing slides steadily");
  if (s.normal.varies()) return none("the normal load varies, so that nothing slides steadily");
  if (s.v == 0 && s.friction.sticks() && (slides_uniformly(s) || !has_held_end(s)))
    return none("friction jumps at psi = 0: it has no slope there");
  if (slides_uniformly(s)) {
    if (!std::isfinite(audit.truly.resolved))
      return none("there is no steady sliding: the state has no steady value" +
                  std::string(s.v == 0 ? " at v = 0" : " in motion"));
    if (audit.truly.resolved > 0 || !(audit.truly.of_all > 0))
      return {audit.truly.resolved, audit.taken.resolved, ""};
    return {audit.truly.resolved, audit.taken.of_all, "", audit.truly.of_all};
  }
  const auto unknowns = double(model.unknowns());
  if (search_seconds(unknowns) > std::max(0.01, 0.05 * steps_seconds(unknowns, evaluations)))
    return none("the nodes differ, and with " + number_text(unknowns) +
                " unknowns it would take more than a twentieth of the time of the run's steps; `spectrum` "
                "computes it");
  try {
    GrowthRate growth(model.comm(), [&s](double, double) { return s; }, {{"growth_rate"}});
    const double found = growth(0);
    if (!std::isfinite(found)) return none("there is no steady sliding");
    const double shift = audit.taken.resolved - audit.truly.resolved;
    return {found, found + (std::isfinite(shift) ? shift : 0), ""};
  } catch (const Failure& e) {
    return none(e.what());
  }
}

}  // namespace stickslip
