// What the fused types of TS (fused_ts.hpp) take from the library's own types: subtypes, tableaus, values
// between steps; and leapfrog, which the library does not have.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "stickslip/time/time.hpp"
#include "time/fused_step.hpp"

namespace stickslip {

class FusedMethod {
 public:
  // For the library's `type`, rk, arkimex or rosw, or for leapfrog.
  static std::unique_ptr<FusedMethod> of(const std::string& type);
  virtual ~FusedMethod() = default;

  virtual const char* type() const = 0;     // the library's
  virtual const char* subtype() const = 0;  // its tableau
  virtual void set_subtype(const char* name) = 0;
  // `implicit`: of arkimex.
  virtual std::unique_ptr<StepTaker> make(const Model& model, Implicit implicit, bool sticking) const = 0;
  virtual int order() const = 0;  // as the error control takes it
  // How many slopes TiledStep::take keeps, and their weights in u at the part s of a step dt; a method
  // without such a polynomial of its own keeps none (dense_output.hpp).
  virtual int slopes() const { return 0; }
  virtual std::vector<double> weights_at(double, double) const {
    throw std::logic_error(std::string(type()) + " has no polynomial of its own");
  }
  // A TS of the library's type with this tableau; nullptr where none is needed.
  virtual TS library() const { return nullptr; }
};

// The tableau of a TS of type rk.
StageProgram tableau_of(TS rk);

}  // namespace stickslip
