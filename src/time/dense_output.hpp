// Values between the steps of a method that has no polynomial of its own for them.
//
// The cubic through u and its slopes at both ends of the step errs by dt^4. Slopes of that cubic inside the
// step err by as much, times dt in their integral: the quartic through them errs by dt^5, and so on, one
// order for each round of new slopes. Degrees above 3 only for explicit methods, whose steps are short enough
// for it.
#pragma once

#include <memory>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/time.hpp"
#include "time/stepper.hpp"

namespace stickslip {

class DenseOutput {
 public:
  DenseOutput(const Model& model, int degree)
      : model_(model), degree_(degree), work_(model.create_vector()) {}
  // The degree that a method needs here; 0: it has a polynomial of its own.
  static int degree_for(const Method& method);
  // Memory of a node whose unknowns take `unknowns` bytes: slopes only once values are asked for.
  static double bytes_a_node(double unknowns, int degree, bool asked) {
    return (1 + (asked ? 2 * degree : 0)) * unknowns;
  }
  // A new step, of which nothing is known.
  void forget() { degree_now_ = 0; }
  // u at the part s of the step of length dt from `before`, at the time t, to `after`. Collective; costs
  // evaluations of the right-hand side the first time in a step.
  void interpolate(Vec before, Vec after, double t, double dt, double s, Vec into);

 private:
  void refine(Vec before, Vec after, double t, double dt);
  void polynomial(Vec before, Vec after, double dt, double s, Vec into) const;

  const Model& model_;
  int degree_;
  int degree_now_ = 0;                             // of the polynomial that slopes_ stand for; 0: none yet
  std::vector<VecHandle> slopes_, better_slopes_;  // at equal distances over the step
  VecHandle work_;
};

// Values between the steps where no polynomial is as good as the steps: those of a step that ends there.
//
// The polynomial of arkimex:5 is of one order less than its steps. And polynomials through slopes mean
// nothing where what is taken implicitly acts many times within a step. The end of a step misses the
// balance that a stiff unknown keeps by the error e of the step, harmless there since the next step leads
// back to it; but its slope as the right-hand side has it is then off by the rate times e, for a light
// block by A e = f0/m e, and a cubic through slopes by up to 4/27 dt rate e. There, from where that is more
// than e itself, values are those of a step of the same method from the same start: as stable as the step,
// and no less accurate.
class ShorterStep {
 public:
  explicit ShorterStep(const Model& model) : model_(model) {}

  // What takes the steps: `fused`, or where there is none the library's steps of `method` with `implicit`.
  void set_up(FusedStepper* fused, const Method& method, Implicit implicit, bool adaptive);
  // Whether u is needed at the beginning of each step that is asked for values within.
  bool may_be_asked() const { return asks_; }

  void forget() { looked_ = false; }  // a new step
  bool is_needed(Vec before, Vec after, double dt);
  // u at the part s of the step from `before` at the time t to `after`; `tolerances`: of the steps.
  // Collective.
  void take(Vec before, Vec after, double t, double dt, double s, const Tolerances& tolerances,
            Vec into);

 private:
  double rate(Vec u) const;
  bool take_by_library(Vec before, double t, double length, const Tolerances& tolerances, Vec u);

  const Model& model_;
  FusedStepper* fused_ = nullptr;
  MethodSpec spec_;
  Implicit implicit_ = Implicit::none;
  bool always_ = false, asks_ = false, adaptive_ = false;
  bool looked_ = false, stiff_ = false;
  std::unique_ptr<Integrator> own_;  // the library's, of such steps
};

}  // namespace stickslip
