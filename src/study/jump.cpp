#include "study/ladder.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/output/probe.hpp"
#include "stickslip/study/reduce.hpp"

namespace stickslip {

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
  if (!trial.is_answer()) return std::nullopt;
  return trial.measured[0];
}

}  // namespace stickslip
