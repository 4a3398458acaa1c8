#include "output/mean_travel.hpp"

#include <cmath>
#include <stdexcept>

#include "base/broadcast.hpp"

namespace stickslip {

MeanTravel::MeanTravel(const Model& model, Displacement& displacement)
    : model_(model), displacement_(displacement), slip_(model), eta_(std::size_t(model.local())) {}

void MeanTravel::plan(ObservationPlan& plan) {
  plan.next_times.emplace_back([](double t) { return std::nextafter(t, HUGE_VAL); });  // within every step
}

void MeanTravel::archive(Archive& a) {
  if (!a.has("travel.mean"))
    throw std::runtime_error(
        "its run did not count the displacement, which with model_k0 0 is that since the start "
        "(out_displacement)");
  a.list("travel.mean", [&](NumberList& x) { x(travelled_); });
  a.nodes("travel.start", {&eta_});
  if (a.restores()) tell();
}

void MeanTravel::step(const ObservedStep& step) {
  step_ = &step;
  before_ = travelled_;
  if (step.index == 0) {
    const Reading u(step.u);
    for (std::size_t i = 0; i < eta_.size(); ++i) eta_[i] = u[PetscInt(i) * model_.dof() + 1];
    tell();
    return;
  }
  travelled_ = at(step.t);
}

double MeanTravel::at(double t) {
  if (t == step_->t && travelled_ != before_) return travelled_;
  const double slip = sum_over(model_.comm(), slip_.between(*step_, step_->t_before, t));
  return before_ + slip / double(model_.scene().n);
}

void MeanTravel::tell() {
  displacement_.count_from(eta_, [this](double t) { return at(t); });
}

}  // namespace stickslip
