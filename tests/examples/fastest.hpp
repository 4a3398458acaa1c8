// The largest |psi| that any node has in a run, and when: `fastest` of the summary.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/json_values.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class Fastest : public Observer {
 public:
  static std::vector<SummaryKey> keys() {
    return {{"fastest", "", "with `psi`: the largest abs(psi) that any node has in the run, and when, `t`"}};
  }
  explicit Fastest(const Model& model) : model_(model) {}

  void step(const ObservedStep& step) override {
    const Reading u(step.u);
    double here = 0;
    for (PetscInt i = 0; i < model_.local(); ++i) here = std::max(here, std::abs(u[i * model_.dof()]));
    const double largest = largest_over(model_.comm(), here);
    if (largest > psi_) t_ = step.t;
    psi_ = std::max(psi_, largest);
  }
  void archive(Archive& a) override { a("fastest", psi_, t_); }
  void summarise(Summary& summary, Vec) override { summary.set("fastest", Json{{"psi", psi_}, {"t", t_}}); }

 private:
  const Model& model_;
  double psi_ = -1, t_ = 0;
};

}  // namespace stickslip
