// Steps with all their stages taken tile by tile, as types of PETSc's TS: they have its error control,
// options and views, and the tableaus of the library's own types.
//
//     fusedrk       rk: -ts_rk_type names the tableau
//     fusedarkimex  arkimex, whatever is implicit: -ts_arkimex_type names the tableau
//     leapfrog      Stoermer and Verlet's, friction by the midpoint rule (leapfrog.hpp)
//
// A TS of such a type is no use before it is bound to a model. In no other file than the source of this one
// is PETSc's private header for writers of TS types included; where an installation lacks that, there are no
// such types.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stickslip/time/register_method.hpp"
#include "time/fused_methods.hpp"

namespace stickslip {

class FusedTs {
 public:
  // The type that takes the steps of the library's `type` tile by tile, and the way back; "" where there is
  // none. Leapfrog, of which the library has nothing, is both.
  static std::string fused_type(const std::string& type);
  static std::string library_type(const std::string& fused);
  // What stands behind a TS; nullptr where that is of another type.
  static FusedTs* of(TS ts);

  // Memory of a node whose unknowns take `unknowns` bytes: u before the step, and the slopes that are kept.
  static double bytes_a_node(double unknowns, int slopes) { return (1 + slopes) * unknowns; }
  explicit FusedTs(const std::string& library_type) : method_(FusedMethod::of(library_type)) {}
  // To be called before TSSetUp. `keep_slopes(until)`: will values inside a step to `until` be asked for?
  void bind(const Model& model, Implicit implicit, bool sticking,
            std::function<bool(double until)> keep_slopes);
  // The last stage, where it is taken at the new u, leaves its slope in the Vec that this returns.
  void leave_slope_in(std::function<Vec()> slope) { slope_at_end_ = std::move(slope); }
  void weigh_errors_by(const Tolerances& tolerances) { tolerances_ = tolerances; }
  void set_direction(const std::vector<double>& direction) { step_->set_direction(direction); }
  bool last_is_solution() const { return step_->last_is_solution(); }

  // u at the part s of the last step, by the method's own polynomial.
  void interpolate(double s, Vec into);
  // The same by a step that ends there; false where it finds no solution.
  bool shorter(double s, Vec into) const;

  Vec before() const { return before_; }           // u at the beginning of the step
  bool finite() const { return outcome_.finite; }  // the last step
  bool solved() const { return outcome_.solved; }  // its implicit equations

  struct Callbacks;         // what the TS calls
  static void add_types();  // registers them with the library

 private:
  void set_up();
  void take(TS ts);
  bool attempt(TS ts, PetscInt rejected);
  void make_slopes();

  std::unique_ptr<FusedMethod> method_;
  const Model* model_ = nullptr;
  Implicit implicit_ = Implicit::none;
  bool sticking_ = false;
  std::function<bool(double)> keep_slopes_;
  std::function<Vec()> slope_at_end_;
  std::unique_ptr<StepTaker> step_;
  VecHandle before_;
  StepTaker::Outcome outcome_{};
  std::vector<VecHandle> slopes_;
  bool adaptive_ = false;
  bool slopes_kept_ = false;  // those of the last step
  double t_ = 0, dt_ = 0;     // of the last step: where it begins, its length
  Tolerances tolerances_;
  ErrorNorm norm_{};
};

// The methods that register_method() added.
struct RegisteredMethod {
  Method method;
  PetscErrorCode (*create)(TS);
};
const std::vector<RegisteredMethod>& registered_methods();

}  // namespace stickslip
