#include "stickslip/output/regime.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/pulse.hpp"
#include "output/field_watch.hpp"
#include "output/regime_classifier.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

std::string to_string(Motion motion) {
  switch (motion) {
    case Motion::sliding: return "sliding";
    case Motion::stick_slip: return "stick-slip";
    case Motion::stuck: return "stuck";
    case Motion::decaying: return "decaying";
    case Motion::growing: return "growing";
    case Motion::undecided: break;
  }
  return "undecided";
}

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Of a medium that differs along x the mean.
double mean_K0(const Scene& s) { return springless(s) ? 0 : s.averaged().K0(); }

// Whether nothing will ever move a medium at rest: no spring that pulls, or one that pulls where nothing
// gives way.
bool is_unloaded(const Scene& s) {
  if ((s.left == End::velocity && s.left_value != 0) || (s.right == End::velocity && s.right_value != 0))
    return s.mean_K1() == 0 && mean_K0(s) * s.v == 0;
  return mean_K0(s) * s.v == 0 || (s.v < 0 && !s.friction.back_slip);
}

// The force at which node i, if it hardly moves, gives way, over its amplitude: its static threshold, or
// steady friction at v where there is none.
double holding_force(const Model& model, PetscInt i, double state) {
  const Scene& s = model.scene();
  const Friction& f = model.friction_law(i);
  if (f.sticks) return f.threshold(state).value;
  const double steady = f.steady_state(std::abs(s.v));
  return std::isfinite(steady) ? f.force(std::abs(s.v), steady) + model.coefficients(i).B * std::abs(s.v)
                               : 0.;
}

const LogEvent& measuring() {
  static const LogEvent event("Measuring");
  return event;
}

// Half the largest range of a place in the last quarter of a record, extrema between the steps included.
double amplitude_of(const MotionRecord& r) {
  double largest = 0;
  for (std::size_t p = 0; p < r.places; ++p) {
    double low = infinity, high = -infinity;
    for (std::size_t w = r.windows - r.windows / 4; w < r.windows; ++w) {
      low = std::min(low, r.low[w * r.places + p]);
      high = std::max(high, r.high[w * r.places + p]);
    }
    largest = std::max(largest, (high - low) / 2);
  }
  return largest;
}

}  // namespace

struct Regime::Impl {
  const Model& model;
  std::function<double(PetscInt)> steady;
  Traces traces;
  FieldWatch field;
  double growth = std::numeric_limits<double>::quiet_NaN(), growth_taken = growth;
  double growth_resolved = growth;  // what the summary says; `growth` decides the word
  std::string growth_reason;
  std::optional<Measured> measured;  // at the last step
  bool jumps_at_rest, by_clusters = false;
  PeriodErrors errors;  // of steps
  double error_of_psi = 0;

  Impl(const Model& m, double t_end, const std::function<double(PetscInt)>& psi)
      : model(m), steady(psi ? psi : [v = m.scene().v](PetscInt) { return v; }), traces(m, steady, t_end),
        field(m, t_end), jumps_at_rest(m.scene().friction.sticks()) {}

  // Growth as the steps have it where its sign is certain. Without a state an oscillating mode grows at half
  // the mean, weighted by the mode, of what the nodes would grow by alone. Collective.
  std::optional<double> certain_growth(double t) const {
    if (std::isfinite(growth)) {
      if (!std::isfinite(growth_taken)) return std::nullopt;
      // a method that holds an instability down so far that the run does not see it
      if (growth_taken > 0 && growth_taken < 0.5 * growth && growth_taken * t < 0.5) return std::nullopt;
      // error control holds what long steps let grow at the size of its tolerance
      if (growth_taken > 0 && growth < 0) return std::nullopt;
      return growth_taken;
    }
    const Scene& s = model.scene();
    if (model.dof() == 3 || (s.v == 0 && jumps_at_rest) || s.massless()) return std::nullopt;
    double bounds[2] = {-infinity, -infinity};  // of C and -C
    for (PetscInt i = 0; i < model.local(); ++i) {
      if (model.held(model.first() + i)) continue;
      const double C = model.linear_point(i, steady(model.first() + i), 0).damping();
      bounds[0] = std::max(bounds[0], C);
      bounds[1] = std::max(bounds[1], -C);
    }
    largest_over(model.comm(), bounds, 2);
    if (bounds[0] < 0) return -bounds[0] / 2;
    if (bounds[1] < 0) return bounds[1] / 2;
    return std::nullopt;
  }

  // what holds depends on the state
  bool aged() const { return model.dof() == 3 && model.scene().friction.sticks(); }

  void look_at_each(Vec u, double pull, std::array<double, 4>& largest) const {
    const Scene& s = model.scene();
    const Reading values(u);
    const PetscInt n = model.local(), dof = model.dof();
    const bool differs = aged() || s.friction.varies() || s.medium.varies();
    double force = holding_force(model, 0, 0);
    for (PetscInt i = 0; i < n; ++i) {
      const double *at = &values[i * dof], psi = at[0];
      largest[0] = std::max(largest[0], std::abs(psi - steady(model.first() + i)));
      largest[1] = std::max(largest[1], std::abs(psi));
      if (differs) force = holding_force(model, i, aged() ? at[2] : 0);
      const double holds = model.amplitude()[i] * force;
      largest[2] = std::max(largest[2], std::abs(holds));
      if (pull > 0) {
        const double side = s.v > 0 ? 1 : -1;
        const double rate = std::max(model.coefficients(i).K0 * side * (s.v - psi), 0.1 * pull);
        largest[3] = std::max(largest[3], -std::max(0., holds - side * at[1]) / rate);
      }
    }
  }

  // Every step may err, and what it did is forgotten at the rate at which oscillations about v grow or die.
  double error_of(double amplitude, double rate, const MotionRecord& r) const {
    const SceneScales scales = scales_of(model.scene());
    const double time = r.t - r.begin, known = std::min(time, 1 / std::abs(rate));
    if (by_clusters || amplitude < 0.01 * scales.velocity || amplitude > scales.velocity) return 0;
    return r.steps * known / time * error_of_psi / amplitude;
  }

  SceneContext surroundings(Vec u, double t) const {
    const Scene& s = model.scene();
    SceneContext a;
    const SceneScales scales = scales_of(s);
    a.scale = scales.velocity;
    a.v = std::abs(s.v);  // in the plate's direction, as the record is
    // a rate of the size of round-off has no sign
    const double none = 1e-10 * scales.rate;
    a.growth = certain_growth(t);
    if (a.growth && std::abs(*a.growth) <= none) a.growth.reset();
    a.stable = growth < -none;
    a.unstable = growth > none;
    a.linear = std::isfinite(growth) ? growth : 0;
    a.unloaded = is_unloaded(s);
    a.sticks = jumps_at_rest;
    a.forcing = s.forcing_period();
    const double pull = mean_K0(s) * std::abs(s.v);
    // distance, speed, holding force, minus the time to give way
    std::array<double, 4> largest{0, 0, 0, -infinity};
    look_at_each(u, pull, largest);
    largest_over(model.comm(), largest.data(), 4);
    a.distance_now = largest[0];
    a.speed_now = largest[1];
    a.loading = std::isfinite(largest[3]) ? -largest[3] : 0;
    a.cycle = 2 * M_PI / scales.rate;
    if (pull > 0) a.cycle = std::max(a.cycle, 2 * largest[2] / pull);
    return a;
  }
};

Regime::Regime(const Model& model, double t_end, const std::function<double(PetscInt)>& steady)
    : impl_(std::make_unique<Impl>(model, t_end, steady)) {}
Regime::~Regime() = default;

void Regime::know(double growth, double growth_taken, const std::string& why_not, double beyond) {
  impl_->measured.reset();
  impl_->growth_reason = why_not;
  impl_->growth_resolved = growth;
  impl_->growth = std::isfinite(beyond) ? beyond : growth;
  impl_->growth_taken = growth_taken;
}

void Regime::errors_up_to(double step, double psi, double passage) {
  impl_->errors = {step, passage};
  impl_->error_of_psi = psi;
}

void Regime::step(const ObservedStep& step) {
  const LogEvent::Scope logged(measuring());
  impl_->measured.reset();
  impl_->traces.step(step);
  impl_->field.step(step);
}

void Regime::plan(ObservationPlan& plan) {
  impl_->by_clusters = plan.by_clusters;
  if (plan.by_clusters) plan.next_times.emplace_back([this](double t) { return impl_->field.next_look(t); });
}

void Regime::moved(const MovedNodes& nodes, const MediumNow&) {
  impl_->measured.reset();
  impl_->traces.moved(nodes);
  impl_->field.moved(nodes);
}

void Regime::archive(Archive& a) {
  if (impl_->traces.archive(a, impl_->by_clusters)) return impl_->field.archive(a, impl_->by_clusters);
  warn("restart: the checkpoint holds no record of the motion so far; the regime is judged from t = " +
       number_text(a.t()) + " on");
}

const Measured& Regime::result(Vec u) {
  if (impl_->measured) return *impl_->measured;
  const LogEvent::Scope logged(measuring());
  const MotionRecord record = impl_->traces.record();
  const SceneContext around = impl_->surroundings(u, record.t);
  const Judgement j = judge(record, around);
  const FieldWatch::Result field = impl_->field.result();
  Measured m;
  // Sliding, stick-slip and the rest are kinds of motion under a constant velocity of the plate.
  const bool loaded = impl_->model.scene().forced();
  if (!loaded) {
    m.motion = j.motion;
    m.rate = j.rate;
    m.time_to_decide = j.time_to_decide;
  }
  m.period = j.period;
  if (m.period) {
    const double periods = (record.t - record.begin) / *m.period;
    // passages are those of the second half
    m.period_error = j.period_error + impl_->errors.of(*m.period, record.steps / periods, periods / 2);
  }
  const bool forwards = forward(impl_->model.scene()) > 0;
  m.low = forwards ? j.low : -j.high;
  m.high = forwards ? j.high : -j.low;
  if (std::isfinite(impl_->growth_resolved)) m.growth = impl_->growth_resolved;
  m.amplitude = field.amplitude;
  if (m.amplitude && record.windows >= 4) m.amplitude = std::max(*m.amplitude, amplitude_of(record));
  m.wave_speed = field.wave_speed;
  if (m.amplitude && m.growth && !loaded)
    m.amplitude_error = impl_->error_of(*m.amplitude, *m.growth, record);
  m.pulses = field.pulses;
  if (m.pulses) *m.pulses *= static_cast<int>(impl_->model.scene().copies);
  m.steepest = field.steepest;
  double highest = 0;
  for (std::size_t k = 0; k < record.windows * record.places; ++k)
    highest = std::max({highest, std::abs(record.high[k]), std::abs(record.low[k])});
  const double v = std::abs(impl_->model.scene().v);
  m.never_moved = !loaded && highest <= v && around.speed_now <= 1e-9 * v && !around.unloaded;
  m.loaded_until = record.t + around.loading;
  return impl_->measured.emplace(m);
}

void Regime::summarise(Summary& summary, Vec u) {
  if (!u) return;
  const Measured& m = result(u);
  summary.set("regime", to_string(m.motion));
  const Scene& scene = impl_->model.scene();
  if (scene.forced())
    summary.set("regime_reason",
                (scene.normal.varies() ? "the normal load varies (load_normal, load_normal_sine_amplitude)"
                 : scene.force.amplitude != 0
                     ? "a harmonic force acts (load_force_sine_amplitude)"
                     : "the plate's velocity varies (load_v, load_sine_amplitude, load_halt)") +
                    std::string(": sliding, stick-slip and the like are said of a constant one"));
  summary.set("regime_rate", m.rate);
  summary.set("growth_rate", m.growth);
  if (!m.growth) summary.set("growth_rate_reason", impl_->growth_reason);
  summary.set("time_to_decide", m.time_to_decide);
  summary.set("amplitude", m.amplitude);
  if (m.period && !scene.forced())
    set_period(summary, *m.period, m.period_error);
  if (m.high >= m.low) {
    summary.set("psi_low", m.low);
    summary.set("psi_high", m.high);
  }
  summary.set("wave_speed", m.wave_speed);
  summary.set("pulses", m.pulses);
  if (impl_->growth > 0 && impl_->growth_resolved <= 0)
    warn(
        "about steady sliding waves of a few nodes, which the grid carries but does not resolve, grow at up "
        "to " +
        rounded_text(impl_->growth) +
        " per unit time; growth_rate is that of the resolved ones (`spectrum` tells what "
        "the continuum's short waves do)");
  const double t_end = impl_->field.end();
  summary.set("measured_over", std::vector<double>{0.75 * t_end, t_end});
  constexpr double too_much = 0.1;
  if (m.amplitude_error > too_much)
    warn("psi moves about v by " + rounded_text(*m.amplitude, 2) +
         " alone, and errors that steps may make add up to some " +
         rounded_text(100 * m.amplitude_error, 1) +
         " % of that over the time in which such a motion changes: its size and rate are known better at " +
         "stricter tolerances (ts_rtol and ts_atol auto:NUMBER)");
  if (m.never_moved)
    warn("nothing has slipped yet: loading takes until about t = " + rounded_text(m.loaded_until) +
         ", the regime is undecided before some slips (ts_max_time " + rounded_text(*m.time_to_decide) +
         " should decide)");
}

}  // namespace stickslip
