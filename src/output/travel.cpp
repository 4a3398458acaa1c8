#include "output/travel.hpp"

#include <cmath>
#include <stdexcept>

#include "base/local_values.hpp"
#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

Travel::Travel(const Model& model, Displacement& displacement)
    : model_(model), displacement_(displacement), work_(model.create_vector()),
      chi_(std::size_t(model.local())), eta_(chi_), slip_(chi_), before_(chi_), now_(chi_) {}

void Travel::plan(ObservationPlan& plan) {
  plan.next_times.emplace_back([](double t) { return std::nextafter(t, HUGE_VAL); });  // within every step
}

void Travel::archive(Archive& a) {
  if (!a.has("travel.until"))
    throw std::runtime_error(
        "its run did not count the displacement, which with model_k0 0 is that since the start "
        "(out_displacement)");
  a.list("travel.until", [this](NumberList& x) { x(until_); });
  a.nodes("travel.start", {&chi_, &eta_});
  a.nodes("travel.slip", {&slip_});
  if (a.restores()) tell();
}

void Travel::step(const ObservedStep& step) {
  step_ = &step;
  if (step.index == 0) {
    const VecHandle chi = displacement_.create_vector();
    displacement_.solve_at_start(step.u, chi);
    const Reading u(step.u), x(chi);
    for (std::size_t i = 0; i < eta_.size(); ++i) {
      eta_[i] = u[PetscInt(i) * model_.dof() + 1];
      chi_[i] = x[PetscInt(i)];
    }
    tell();
    return;
  }
  before_ = slip_;
  add(step.t_before, step.t, slip_);
  until_ = step.t;
}

const std::vector<double>& Travel::at(double t) {
  if (t == until_) return slip_;
  now_ = before_;
  add(step_->t_before, t, now_);
  return now_;
}

// No dense output has a degree of more than 9.
void Travel::add(double from, double to, std::vector<double>& slip) {
  static const Tableau points = Tableau::gauss(5);
  for (int k = 0; k < points.s && to > from; ++k) {
    step_->interpolate(from + (to - from) * points.c[k], work_);
    const double weight = (to - from) * points.b[k];
    const Reading u(work_);
    for (std::size_t i = 0; i < slip.size(); ++i) slip[i] += weight * u[PetscInt(i) * model_.dof()];
  }
}

void Travel::tell() {
  displacement_.count(chi_, eta_, [this](double t) -> const std::vector<double>& { return at(t); });
}

double SlipOfStep::sum_at(const ObservedStep& step, double t, int unknown) {
  if (t < step.t) step.interpolate(t, work_);
  const Reading u(t < step.t ? work_.get() : step.u);
  double sum = 0;
  for (PetscInt i = 0; i < model_.local(); ++i) sum += u[i * model_.dof() + unknown];
  return sum;
}

// No dense output has a degree of more than 9.
double SlipOfStep::between(const ObservedStep& step, double from, double to) {
  static const Tableau points = Tableau::gauss(5);
  double sum = 0;
  for (int i = 0; i < points.s && to > from; ++i)
    sum += (to - from) * points.b[i] * sum_at(step, from + (to - from) * points.c[i], 0);
  return sum;
}

}  // namespace stickslip
