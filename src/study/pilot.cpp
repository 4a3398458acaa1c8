#include "study/ladder.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/output/probe.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/time/stick.hpp"
#include "time/methods.hpp"

namespace stickslip {

namespace {

// Of a pair of PETSc's.
const StageProgram& tableau_of(const std::string& pair) {
  static std::map<std::string, StageProgram> known;
  const auto found = known.find(pair);
  if (found != known.end()) return found->second;
  TsHandle ts;
  SS_TRY(TSCreate(PETSC_COMM_SELF, ts.out()));
  SS_TRY(TSSetType(ts, TSRK));
  SS_TRY(TSRKSetType(ts, pair.c_str()));
  return known[pair] = stickslip::tableau_of(ts.get());
}

VecHandle vector_for(const Model& model) {
  VecHandle u;
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, model.local() * model.dof(), u.out()));
  return u;
}

// In which the user wants the error of a step to be held.
NormType norm_set() {
  NormType type = NORM_2;
  SS_TRY(PetscOptionsGetEnum(nullptr, nullptr, "-ts_adapt_wnormtype", NormTypes,
                             reinterpret_cast<PetscEnum*>(&type), nullptr));
  return type;
}

// As TSADAPTBASIC with its defaults chooses steps.
constexpr double safety = 0.9, reject_safety = 0.5, shortest = 0.1, longest = 10, when_not_finite = 0.25;
constexpr int most_rejections = 60;

}  // namespace

Pilot::Pilot(const Options& options, const Scene& scene)
    : options_(options), scene_(scene), start_(scene, options), t_end_(options.real("ts_max_time")),
      reduces_(options.text("scene_reduce") != "off") {}

bool Pilot::suits(const Scene& scene, const MethodSpec& method) {
  return method.type == "rk" && method.can().has_estimate && !Stick::applies_to(scene) && !scene.massless();
}

Model Pilot::model(int order, PetscInt n) const {
  const Scene scene = on_grid(scene_, n, order);
  const PetscInt cells = reduces_ ? promised_cells(scene, options_) : 1;
  return Model(PETSC_COMM_SELF, cells > 1 ? cell_of(scene, cells) : scene);
}

Pilot::AtStart Pilot::at_start(int order, PetscInt n) const {
  std::vector<std::string> unheard;
  const WarningsKept kept(unheard);
  AtStart start{model(order, n), {}};
  const VecHandle u = vector_for(start.model);
  start_.fill(start.model, u);
  start.rates = rates_of(start.model, u);
  return start;
}

MethodSpec Pilot::automatic(const AtStart& start, double tolerance) const {
  std::vector<std::string> unheard;
  const WarningsKept kept(unheard);
  MethodSpec open = MethodSpec::from(options_);
  open.tolerance = tolerance;
  const Choice choice = choose_method(start.model, start.rates, open, "");
  if (choice.implicit == Implicit::none) return MethodSpec::parse("accuracy", "rk:7vr");
  return MethodSpec::parse("accuracy", choice.type + ":" + choice.subtype + ":" + to_string(choice.implicit));
}

double Pilot::longest_step(const Setting& setting) const {
  if (options_.is_set("ts_adapt_dt_max")) return options_.real("ts_adapt_dt_max");
  if (setting.method.name() != "rk:7vr") return 0;
  const Scene scene = on_grid(scene_, setting.n, setting.order);
  const bool waves = !reduces_ || promised_cells(scene, options_) < scene.n;
  return waves ? 4.4 / stencil_rate(scene) : 0;
}

Trial Pilot::run(const Setting& setting, double limit) const {
  Trial trial;
  trial.method = setting.method.name();
  trial.implicit = "none";
  const double begin = processor_seconds();
  const WarningsKept kept(trial.warnings);
  const Model model = this->model(setting.order, setting.n);
  VecHandle u = vector_for(model), next = vector_for(model);
  start_.fill(model, u);
  const TiledStep step(model, tableau_of(setting.method.subtype));
  const double exponent = -1. / setting.method.order();
  static const std::vector<VecHandle> no_slopes;
  double most = longest_step(setting);
  if (most == 0) most = t_end_;
  const Scales scales = scales_of(model.scene()).least;
  const ErrorNorm norm{Tolerances::automatic(scales, setting.tolerance, setting.tolerance), norm_set()};
  const auto fail = [&](Fault fault, const char* why) {
    trial.fault = fault;
    trial.failed = why;
  };
  double t = 0, until = 0, dt = std::min({rates_of(model, u).first_step(), most, t_end_});
  for (int rejected = 0; t < t_end_ && trial.failed.empty();) {
    if (t == until) {  // the start, or a corner of the load
      until = std::min(t_end_, model.scene().load.next_corner(t));
      model.begin_load(t);
      dt = std::min(dt, until - t);
    }
    const TiledStep::Outcome outcome = step.take(u, dt, norm, true, next, no_slopes, nullptr, t);
    if (!outcome.finite || outcome.error > 1) {
      const double safe = rejected > 0 ? safety * reject_safety : safety;
      dt *= outcome.finite ? std::clamp(safe * std::pow(outcome.error, exponent), shortest, longest)
                           : when_not_finite;
      ++trial.rejections;
      if (++rejected > most_rejections || t + dt == t) fail(Fault::failed, "the steps shrink to nothing");
      continue;
    }
    std::swap(u, next);
    ++trial.steps;
    rejected = 0;
    t = until - t <= dt ? until : t + dt;
    const double left = until - t;
    dt *= outcome.error > 0 ? std::clamp(safety * std::pow(outcome.error, exponent), shortest, longest)
                            : longest;
    dt = std::min(dt, most);
    if (left > 0 && 1.01 * dt > left)
      dt = left;
    else if (left > 0 && 2 * dt > left)
      dt = left / 2;
    if (trial.steps + trial.rejections >= setting.most_attempts)
      fail(Fault::too_many_steps, "too many steps");
    if (trial.steps % 64 == 0) {
      const double spent = processor_seconds() - begin;
      if (spent > limit || (spent > 0.25 * limit && spent * t_end_ > 4 * limit * t))
        fail(Fault::too_slow, "too long");
    }
  }
  trial.t = t;
  trial.rhs_evaluations = model.rhs_evaluations();
  if (trial.failed.empty()) {
    model.set_held(u);
    const Reading a(u);
    std::vector<double> psi, eta, state;
    for (PetscInt i = 0; i < setting.n; ++i) {
      const double* at = a + i % model.local() * model.dof();
      psi.push_back(at[0]);
      eta.push_back(at[1]);
      if (model.dof() > 2) state.push_back(at[2]);
    }
    trial.end = fields_with_friction(model.scene(), std::move(psi), std::move(eta), std::move(state));
  }
  trial.seconds = processor_seconds() - begin;
  return trial;
}

namespace {

constexpr double widths = 6;                 // ahead
constexpr double finest = 0.02;              // a step, in units of 1/A
constexpr PetscInt most_nodes_ahead = 1000;  // where nothing jumps
constexpr double tolerance_ahead = 1e-10;

// J along the characteristic, beside a run of what is ahead of it.
class HeightAhead final : public Measure {
 public:
  HeightAhead(const Model& model, const Scene& whole, const Jump& jump, double height)
      : model_(model), whole_(whole), jump_(jump), friction_(Friction::of(whole.friction)),
        work_(model.create_vector()), J_(height) {}

  void plan(ObservationPlan& plan) override {
    plan.next_times.push_back([](double t) { return std::nextafter(t, HUGE_VAL); });
  }

  // The classical Runge-Kutta method.
  void step(const ObservedStep& step) override {
    const double parts = std::ceil((step.t - step.t_before) * whole_.A() / finest),
                 dt = (step.t - step.t_before) / parts;
    if (step.index == 0) last_ = ahead(step, step.t);
    for (int k = 0; k < parts; ++k) {
      const double t = step.t_before + k * dt;
      const Ahead begin = last_, middle = ahead(step, t + dt / 2),
                  end = ahead(step, k + 1 < parts ? t + dt : step.t);
      const double k1 = rate(begin, J_), k2 = rate(middle, J_ + dt / 2 * k1),
                   k3 = rate(middle, J_ + dt / 2 * k2), k4 = rate(end, J_ + dt * k3);
      J_ += dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      last_ = end;
    }
  }

  std::vector<double> values() const override { return {J_}; }

 private:
  struct Ahead {
    double psi, state, amplitude;
  };
  Ahead ahead(const ObservedStep& step, double t) {
    const double x = jump_.x(t);
    if (t < step.t)
      step.interpolate(t, work_);
    else
      SS_TRY(VecCopy(step.u, work_));
    Probes at(model_, whole_, {x});
    Ahead found{at.read(work_).psi[0], 0, whole_.unit_amplitude() ? 1 : friction_amplitude_at(whole_, x)};
    if (model_.dof() < 3) return found;
    {  // the state, interpolated as psi is
      const Writing u(work_);
      for (PetscInt i = 0; i < model_.local(); ++i) u[i * model_.dof()] = u[i * model_.dof() + 2];
    }
    found.state = at.read(work_).psi[0];
    return found;
  }
  double rate(const Ahead& a, double J) const {
    const double difference = friction_->force(a.psi + J, a.state) - friction_->force(a.psi, a.state);
    return -(whole_.A() * a.amplitude * difference + whole_.s_delta() * J) / 2;
  }

  const Model& model_;
  const Scene whole_;
  const Jump& jump_;
  std::shared_ptr<const Friction> friction_;
  VecHandle work_;
  Ahead last_{};
  double J_;
};

}  // namespace

std::optional<Jump> Jump::of(const Scene& scene, const Start& start) {
  if (scene.form != Form::continuum || scene.nu != 0) return std::nullopt;
  const Start::Misfit misfit = start.misfit(scene);
  const double ends = std::abs(scene.left_value) + std::abs(scene.right_value);
  const double least = 1e-8 * (scales_of(scene).slip.psi + ends);
  const bool left = std::abs(misfit.left) > least, right = std::abs(misfit.right) > least;
  if (left == right) return std::nullopt;
  return Jump(scene, left, left ? misfit.left : misfit.right);
}

double Jump::x(double t) const {
  const double L = scene_.length, gone = std::fmod(scene_.c * t, 2 * L),
               folded = gone > L ? 2 * L - gone : gone;
  return from_left_ ? folded : L - folded;
}

double Jump::ahead(const Scene& grid, double t) const {
  return widths * grid.h() * std::pow(1 + scene_.c * t / grid.h(), 1 / (1. + grid.order));
}

Jump::Extent Jump::extent(const Scene& grid, double t) const {
  const bool returns = std::fmod(scene_.c * t, 2 * scene_.length) > scene_.length,
             rightwards = from_left_ != returns;
  const double right = rightwards ? ahead(grid, t) : behind(t),
               left = rightwards ? behind(t) : ahead(grid, t);
  return {x(t) - left, x(t) + right};
}

double Jump::least_cells(int order, double t) const {
  Scene grid = scene_;
  grid.order = order;
  for (double cells = 16;; cells *= 1.25) {
    grid.n = PetscInt(cells) + 1;
    if (ahead(grid, t) <= behind(t) || cells > 1e6) return cells;
  }
}

std::optional<double> Jump::height(const Options& options, const Setting& setting) const {
  if (scene_.c * options.real("ts_max_time") > scene_.length || scene_.laws_differ() ||
      scene_.medium.varies())
    return std::nullopt;
  const std::string end = from_left_ ? "bc_left" : "bc_right";
  Setting ahead = setting;
  ahead.n = std::min(setting.n, most_nodes_ahead);
  ahead.method =
      MethodSpec::parse("accuracy", setting.method.can().is_explicit ? "rk:7vr" : setting.method.name());
  ahead.tolerance = setting.method.can().is_explicit ? std::min(setting.tolerance, tolerance_ahead)
                                                     : 1e-2 * setting.tolerance;
  const Trial trial = run_trial(options.with(end, "free").with(end + "_value", ""), ahead, "ahead_", HUGE_VAL,
                                [&](const Model& model, const Scene& whole) {
                                  return std::make_unique<HeightAhead>(model, whole, *this, start_);
                                });
  if (!trial.failed.empty()) return std::nullopt;
  return trial.measured[0];
}

}  // namespace stickslip
