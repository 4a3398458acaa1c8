#include "stickslip/study/chart.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/regime.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/study/start.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/time.hpp"
#include "study/simulate.hpp"
#include "study/step_audit.hpp"

namespace stickslip {

// psi at a few nodes after every step of a run, which says whether another run goes through the same motion.
class PsiRecord : public Observer {
 public:
  explicit PsiRecord(const Model& model);
  void step(const ObservedStep& step) override;

  // The first time at which psi is further than `room`, in parts of half the range of the true motion, from
  // all that the true one goes through within `lag` of that time, in parts of it; empty where there is none.
  std::optional<double> leaves(const PsiRecord& truth, double room, double lag) const;
  // The mean time between passages upwards through the middle of its range, at the node where that is
  // largest, in the second half of the run; empty with fewer than three such times, or where one is off by
  // more than this part of it.
  std::optional<double> period(double irregular) const;

 private:
  struct Range {
    double low, high;
  };
  Range range(std::size_t node, double from) const;
  Range within(std::size_t node, double from, double to) const;
  double at(std::size_t node, double t) const;  // straight between steps

  PetscInt first_, local_;
  int dof_;
  MPI_Comm comm_;
  std::vector<PetscInt> nodes_;
  std::vector<double> t_;
  std::vector<std::vector<double>> psi_;  // of every node
};

namespace {
constexpr PetscInt most_nodes = 8;
constexpr std::size_t least_passages = 4;
}  // namespace

PsiRecord::PsiRecord(const Model& model)
    : first_(model.first()), local_(model.local()), dof_(model.dof()), comm_(model.comm()) {
  const PetscInt n = model.scene().n, count = std::min(n, most_nodes);
  for (PetscInt k = 0; k < count; ++k) nodes_.push_back((2 * k + 1) * n / (2 * count));
  psi_.resize(nodes_.size());
}

void PsiRecord::step(const ObservedStep& step) {
  std::vector<double> values(nodes_.size(), 0.);
  {
    const Reading a(step.u);
    for (std::size_t k = 0; k < nodes_.size(); ++k)
      if (nodes_[k] >= first_ && nodes_[k] < first_ + local_) values[k] = a[(nodes_[k] - first_) * dof_];
  }
  sum_over(comm_, values.data(), int(values.size()));
  t_.push_back(step.t);
  for (std::size_t k = 0; k < nodes_.size(); ++k) psi_[k].push_back(values[k]);
}

PsiRecord::Range PsiRecord::range(std::size_t node, double from) const {
  return within(node, from, t_.back());
}

PsiRecord::Range PsiRecord::within(std::size_t node, double from, double to) const {
  const double a = at(node, from), b = at(node, to);
  Range range{std::min(a, b), std::max(a, b)};
  for (auto i = std::upper_bound(t_.begin(), t_.end(), from); i != t_.end() && *i < to; ++i) {
    const double psi = psi_[node][i - t_.begin()];
    range = {std::min(range.low, psi), std::max(range.high, psi)};
  }
  return range;
}

double PsiRecord::at(std::size_t node, double t) const {
  const std::vector<double>& psi = psi_[node];
  const auto above = std::size_t(std::upper_bound(t_.begin(), t_.end(), t) - t_.begin());
  if (above == 0 || above == t_.size()) return above == 0 ? psi.front() : psi.back();
  const double part = (t - t_[above - 1]) / (t_[above] - t_[above - 1]);
  return psi[above - 1] + part * (psi[above] - psi[above - 1]);
}

std::optional<double> PsiRecord::leaves(const PsiRecord& truth, double room, double lag) const {
  double widest = 0;
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const Range all = truth.range(k, truth.t_.front());
    widest = std::max(widest, (all.high - all.low) / 2);
  }
  for (std::size_t i = 0; i < t_.size(); ++i)
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const Range near = truth.within(k, (1 - lag) * t_[i], std::min((1 + lag) * t_[i], truth.t_.back()));
      const double psi = psi_[k][i];
      if (!(psi >= near.low - room * widest && psi <= near.high + room * widest)) return t_[i];
    }
  return std::nullopt;
}

std::optional<double> PsiRecord::period(double irregular) const {
  const double begin = (t_.front() + t_.back()) / 2;
  std::size_t widest = 0;
  for (std::size_t k = 1; k < nodes_.size(); ++k) {
    const Range one = range(k, begin), best = range(widest, begin);
    if (one.high - one.low > best.high - best.low) widest = k;
  }
  const Range all = range(widest, begin);
  const double middle = (all.low + all.high) / 2;
  const std::vector<double>& psi = psi_[widest];
  std::vector<double> passages;
  for (std::size_t i = 1; i < t_.size(); ++i)
    if (t_[i - 1] >= begin && psi[i - 1] < middle && psi[i] >= middle)
      passages.push_back(t_[i - 1] + (middle - psi[i - 1]) / (psi[i] - psi[i - 1]) * (t_[i] - t_[i - 1]));
  if (passages.size() < least_passages) return std::nullopt;
  const double mean = (passages.back() - passages.front()) / double(passages.size() - 1);
  for (std::size_t i = 1; i < passages.size(); ++i)
    if (std::abs(passages[i] - passages[i - 1] - mean) > irregular * mean) return std::nullopt;
  return mean;
}

namespace {

const char* const prefix = "limits_";

// What one run came to.
struct Observed : Outcome {
  Motion motion = Motion::undecided;
  double amplitude = NAN, speed = NAN, largest = 0;
  bool warned = false;  // of its steps
  std::shared_ptr<PsiRecord> record;
};

double largest_psi(const Model& model, Vec u) {
  const Reading a(u);
  double largest = 0;
  for (PetscInt i = 0; i < model.local(); ++i) largest = std::max(largest, std::abs(a[i * model.dof()]));
  return largest_over(model.comm(), largest);
}

// Root mean square of psi - v; or of its part that alternates from node to node, with that of eta in the norm
// that waves of that length conserve.
double off_sliding(const Model& model, Vec u, bool alternating) {
  const Scene& s = model.scene();
  (void)model.friction_law();  // the same everywhere
  const double state = model.dof() == 3 ? model.steady_state(s.v) : 0;
  const double eta = s.B() * s.v + model.friction(0, s.v, state).F;
  const Reading a(u);
  double sums[2] = {0, 0};
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double psi = a[i * model.dof()] - s.v, sign = (model.first() + i) % 2 == 0 ? 1 : -1;
    sums[0] += alternating ? sign * psi : psi * psi;
    sums[1] += sign * (a[i * model.dof() + 1] - eta);
  }
  sum_over(model.comm(), sums, 2);
  const double n = double(s.n);
  return alternating ? std::hypot(sums[0], sums[1] * s.A() / model.wave_frequency()) / n
                     : std::sqrt(sums[0] / n);
}

// Runs as the command `run` would, by the method given.
Observed observe(const Options& options, const MethodSpec& method, const Model& model, Vec start,
                 double t_end) {
  Observed seen;
  seen.record = std::make_shared<PsiRecord>(model);
  VecHandle u = model.create_vector();
  SS_TRY(VecCopy(start, u));
  Regime regime(model, t_end, steady_velocity(model.scene()));
  std::optional<StepAudit> audit;
  Experiment run{model, method, prefix, {0, t_end}};
  run.watch = [&](Integrator& integrator) -> std::vector<Observer*> {
    seen.warned = warn_of_steps(model, integrator, u, t_end);
    audit.emplace(model, options, integrator, 0, t_end);
    return {&*audit, &regime, seen.record.get()};
  };
  run.goes_on = [&](const Integrator::Step& step, Outcome&) {
    seen.largest = std::max(seen.largest, largest_psi(model, step.u));
    return true;
  };
  run.at_end = [&](const Integrator& integrator) {
    const StepAudit::Verdict verdict = audit->verdict(u);
    const NearestGrowth near = nearest_growth(model, verdict, integrator.report().rhs_evaluations);
    regime.know(near.growth, near.taken, near.why_not, near.beyond);
    const Measured r = regime.result(u);
    seen.motion = r.motion;
    seen.amplitude = r.amplitude.value_or(NAN);
    seen.speed = r.wave_speed.value_or(NAN);
    seen.warned = audit->warn_of(verdict, r.motion) || seen.warned;
  };
  carry_out(run, u, seen);
  return seen;
}

}  // namespace

struct Limits::Impl {
  Options options;
  double t_end;
  Scene scene;
  Model model;
  VecHandle start;
  Observed truth;

  explicit Impl(const Options& o)
      : options(o), t_end(o.real("ts_max_time")), scene(Scene::from(options, false)),
        model(PETSC_COMM_WORLD, scene), start(model.create_vector()) {
    set_start(model, options, start);
    MethodSpec accurate;
    accurate.fused = options.boolean("rk_fused");
    accurate.tolerance = 1e-8;
    truth = observe(options, accurate, model, start, t_end);
    if (!truth.is_answer()) throw Failure("the accurate run of the scene failed: " + truth.failed);
  }

  // The method with steps of dt.
  MethodSpec fixed(const MethodSpec& method, double dt) const {
    MethodSpec spec = method;
    spec.step = dt;
    spec.fused = options.boolean("rk_fused");
    return spec;
  }

  Observed run(const MethodSpec& method, double dt) const {
    return observe(options, fixed(method, dt), model, start, t_end);
  }

  std::string breakdown(const Observed& o) const {
    if (o.fault == Fault::not_finite) return "blow-up";
    if (o.fault == Fault::not_solved) return "Newton's method fails";
    if (!o.is_answer()) return o.failed;
    return o.largest > 2 * truth.largest ? "psi out of bounds" : "";
  }
  std::string mistake(const Observed& o) const {
    if (std::string b = breakdown(o); !b.empty()) return b;
    // Where the scene is too short to decide, a trend that steps add shows in the amplitude.
    const bool trend = o.motion == Motion::growing || o.motion == Motion::decaying;
    if (o.motion != truth.motion && !(trend && truth.motion == Motion::undecided))
      return "regime " + to_string(o.motion);
    if (!(std::abs(o.amplitude - truth.amplitude) <= 0.1 * truth.amplitude) &&
        truth.motion != Motion::sliding)
      return "amplitude " + rounded_text(o.amplitude / truth.amplitude) + " times the true one";
    if (std::isfinite(truth.speed) && !(std::abs(o.speed - truth.speed) <= 0.02 * std::abs(truth.speed)))
      return std::isfinite(o.speed)
                 ? "wave speed " + rounded_text(o.speed / truth.speed) + " times the true one"
                 : "no wave speed";
    return std::isfinite(truth.speed) ? "" : mistake_in_time(o);
  }
  // Where no speed tells the time that things take: the motion itself while the scene is too short to say
  // what it is, which leaves nothing else to compare, and then the period.
  std::string mistake_in_time(const Observed& o) const {
    if (truth.motion == Motion::undecided) {
      const std::optional<double> left = o.record->leaves(*truth.record, 0.1, 0.02);
      return left ? "off the true motion at t = " + rounded_text(*left) : "";
    }
    const std::optional<double> period = o.record->period(HUGE_VAL), true_period = truth.record->period(0.05);
    if (truth.motion != Motion::stick_slip || !true_period) return "";
    if (period && std::abs(*period - *true_period) <= 0.02 * *true_period) return "";
    return period ? "period " + rounded_text(*period / *true_period) + " times the true one" : "no period";
  }

  // A run's verdict: why it is no answer at all, why it is a wrong one, "" where it is not.
  struct Judged {
    double dt;
    std::string breaks, wrong;
  };
  Judged judge(const MethodSpec& method, double dt, LimitRow& row) const {
    const Observed o = run(method, dt);
    const Judged judged{dt, breakdown(o), mistake(o)};
    ++row.runs;
    if (!judged.wrong.empty() && o.is_answer() && !o.warned) {
      row.warned = false;
      row.silent.push_back(dt);
    }
    return judged;
  }

  // The step from which on runs are bad, as `why` has it, and how: after `ladder`, runs with longer and
  // longer steps.
  struct Found {
    std::optional<double> good;  // the largest below the first bad one
    bool ends = false;           // is there a bad one?
    std::string how;
  };
  Found first_bad(const std::vector<Judged>& ladder, std::string Judged::*why, const MethodSpec& method,
                  LimitRow& row) const {
    const auto bad =
        std::find_if(ladder.begin(), ladder.end(), [&](const Judged& j) { return !(j.*why).empty(); });
    Found found;
    if (bad != ladder.begin()) found.good = std::prev(bad)->dt;
    if (bad == ladder.end()) return found;
    found.ends = true;
    found.how = *bad.*why;
    double least_bad = bad->dt;
    const auto is_good = [&](double dt) {
      const Judged judged = judge(method, dt, row);
      if (!(judged.*why).empty()) found.how = judged.*why;
      return (judged.*why).empty();
    };
    // methods of low order fail below the first step already
    const double first = ladder.front().dt;
    for (double dt = first / 4; !found.good && dt > first / 100; dt /= 4) {
      if (is_good(dt))
        found.good = dt;
      else
        least_bad = dt;
    }
    if (found.good) found.good = narrowed(is_good, *found.good, least_bad, 1.05);
    return found;
  }

  // The last place known, between one that is good and one that is not, to this factor. Steps are compared by
  // ratio.
  template <class Good>
  static double narrowed(const Good& is_good, double good, double bad, double factor) {
    return std::exp(last_place([&](double log_dt) { return is_good(std::exp(log_dt)); }, std::log(good),
                               std::log(bad), std::log(factor)));
  }

  void scan(const MethodSpec& method, LimitRow& row, double first) const {
    std::vector<Judged> ladder;
    for (double dt = first; dt <= t_end / 8 && (ladder.empty() || ladder.back().breaks.empty()); dt *= 2) {
      ladder.push_back(judge(method, dt, row));
      row.longest = dt;
    }
    if (ladder.empty()) return;
    const Found breaks = first_bad(ladder, &Judged::breaks, method, row);
    const Found errs = first_bad(ladder, &Judged::wrong, method, row);
    if (breaks.ends) row.limit = breaks.good;
    row.how = breaks.how;
    row.followed = errs.good;
    row.wrong = errs.how;
  }

  // Growth rate of noise about sliding in the second half of so many steps; infinite where the run breaks
  // down. Where the noise outgrows what is linear before that, as a method may let it without breaking down,
  // the rate until then.
  double rate_of_noise(const MethodSpec& method, double dt, int steps, double noise, bool alternating) const {
    Outcome outcome;
    const WarningsKept kept(outcome.warnings);
    const Options calm = options.with("init_type", "uniform")
                             .with("init_psi", "steady")
                             .with("init_eta", "steady")
                             .with("init_noise", noise)
                             .with("init_noise_length", "0");
    VecHandle u = model.create_vector();
    set_start(model, calm, u);
    constexpr double linear = 1e-3;
    double middle = 0, end = 0, first = 0, outgrown_at = 0;
    const int window = std::max(1, steps / 4);
    Experiment run{model, fixed(method, dt), prefix, {0, steps * dt}};
    run.goes_on = [&](const Integrator::Step& step, Outcome&) {
      // the largest over a while, since waves go up and down
      const double now = off_sliding(model, step.u, alternating);
      if (step.index == 1) first = now;
      if (now > linear && first < linear) {
        outgrown_at = step.t;
        end = now;
        return false;
      }
      if (step.index > steps / 2 - window && step.index <= steps / 2) middle = std::max(middle, now);
      if (step.index > steps - window) end = std::max(end, now);
      return true;
    };
    carry_out(run, u, outcome);
    if (!outcome.is_answer()) return HUGE_VAL;
    if (outgrown_at > 0) return std::log(end / first) / (outgrown_at - dt);
    const auto second_half = steps - steps / 2;
    return std::log(end / middle) / (double(second_half) * dt);
  }

  // The step between low and high from which on `beyond` holds, to 2 %; empty where it holds at low or not at
  // high.
  template <class Beyond>
  std::optional<double> edge(double low, double high, const Beyond& beyond) const {
    if (beyond(low) || !beyond(high)) return std::nullopt;
    return 1.01 * narrowed([&](double dt) { return !beyond(dt); }, low, high, 1.02);
  }

  void find_shortest(const MethodSpec& method, LimitRow& row, StepForecast& forecast) const {
    const double frequency = stencil_rate(model.scene()), allowed = 0.02 * frequency;
    const double growth = forecast.sliding_growth().of_all;
    const auto grows = [&](double dt) { return forecast.shortest_wave_excess(dt) > allowed; };
    double dt = 0.003 / frequency;
    while (dt < 100 / frequency && !grows(dt)) dt *= 1.1;
    if (dt >= 100 / frequency) return;
    row.shortest_theory = edge(dt / 1.5, dt, grows);
    if (!row.shortest_theory) return;
    row.shortest = edge(*row.shortest_theory / 1.25, *row.shortest_theory * 1.25, [&](double step) {
      ++row.runs;
      // so few steps that the noise stays small where it grows as it should, and other waves do not feed this
      // one
      const double steps = growth > 0 ? 14 / (growth * step) : 400;
      const double rate = rate_of_noise(method, step, int(std::clamp(steps, 8., 400.)), 1e-11, true);
      return rate - forecast.shortest_growth() > allowed;
    });
  }

  void find_damping(const MethodSpec& method, LimitRow& row, StepForecast& forecast) const {
    const double growth = forecast.sliding_growth().of_all;
    if (!(growth > 0)) return;
    const auto hides = [&](double dt) { return forecast.sliding_growth({{dt, 1.}}).of_all < 0; };
    // The step from which on it is so: sought from long steps down. Backward Euler's is 2 growth/|lambda|^2,
    // which is short where sliding is hardly unstable.
    const double frequency = stencil_rate(model.scene());
    const double longest = 300 / growth,
                 shortest = std::min(1e-3 / growth, 0.2 * growth / (frequency * frequency));
    double dt = longest;
    while (dt > shortest && hides(dt)) dt /= 1.25;
    if (dt == longest || dt <= shortest) return;
    row.damps_theory = edge(dt, 1.25 * dt, hides);
    row.damps = edge(*row.damps_theory / 1.25, *row.damps_theory * 1.25, [&](double step) {
      ++row.runs;
      return rate_of_noise(method, step, 160, 1e-8, false) < 0;
    });
  }
};

Limits::Limits(const Options& options) : impl_(std::make_unique<Impl>(options)) {}
Limits::~Limits() = default;

LimitRow Limits::row(const MethodSpec& method) {
  const Impl& m = *impl_;
  LimitRow row;
  row.order = m.scene.order;
  row.n = m.scene.n;
  // as long as the accurate run's own steps
  double first = m.t_end / double(std::max<std::int64_t>(m.truth.report.steps, 16));
  std::vector<std::string> ignored;
  const WarningsKept kept(ignored);
  VecHandle u = m.model.create_vector();
  SS_TRY(VecCopy(m.start, u));
  row.method = method.name();
  row.implicit = method.implicit;
  std::unique_ptr<Integrator> made;
  try {
    made = std::make_unique<Integrator>(m.model, m.fixed(method, first), u, prefix);
  } catch (const UsageError& e) {
    row.how = row.wrong = std::string("refused: ") + e.what();
    return row;
  }
  const Integrator& integrator = *made;
  row.implicit = to_string(integrator.report().implicit);
  StepForecast forecast(m.model, u, integrator);
  const double longest = m.t_end / 8;
  if (forecast.explodes(longest, m.t_end)) {
    row.theory = forecast.limit(longest, m.t_end);
    first = std::min(first, *row.theory / 2);
  }
  m.find_shortest(method, row, forecast);
  m.find_damping(method, row, forecast);
  m.scan(method, row, first);
  return row;
}

}  // namespace stickslip
