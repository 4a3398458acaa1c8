// Methods behind their names: which one advances a scene, and those whose stages are taken tile by tile.
#pragma once

#include <petscts.h>

#include <memory>
#include <string>
#include <vector>

#include "numerics/tableau.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/time/time.hpp"
#include "time/tiles.hpp"

namespace stickslip {

// Which method advances a scene, and what it takes implicitly: the rule behind `auto`, and what the user
// asked for.

// Names are those of PETSc: -ts_type and the value of Capabilities::subtype_option.
struct Choice {
  std::string type;
  std::string subtype;  // "": PETSc's default, or there is none
  Implicit implicit;
  bool fused;        // all stages of a step tile by tile, where the type offers it
  bool named_fused;  // and this is what the user named (below)
};

// `spec` says what is wanted; -ts_type behind `prefix` overrides it. Throws UsageError for types that are
// not offered and for splits that the type or the scene does not have.
Choice choose_method(const Model& model, const Rates& rates, const MethodSpec& spec,
                     const std::string& prefix);

// How often a deviation of what is explicit dies away, or turns, while the state recovers from a slip. Where
// friction that bends at rest (asinh) has been lost in the slip, all the way down to the bend, psi is back at
// v at once, against B alone, and the state takes until it has slipped by D at that velocity or has aged: at
// each of its values on the way deviations go at K1 kappa^2/(B + F_psi), without mass (K0 + K1 kappa^2)/(B +
// F_psi), and no faster than waves, and explicit steps are no longer than about three of these times. At most
// so often: in the slip B psi, and what a spring gives to a mass, take over all that friction loses.
// Collective.
double turns_in_recovery(const Model& model);

// Whether PETSc's database holds the option (without the dash) behind the prefix.
bool user_set(const std::string& prefix, const std::string& option);

// Has PETSc's `ts` of this type take the tableau, or the order, of this name ("": its default); and which one
// it takes, "" where there is nothing to choose.
void set_subtype(TS ts, const std::string& type, const std::string& name);
std::string subtype_of(TS ts, const std::string& type);

// The library's type whose steps the type `fused` takes tile by tile; "" where it is none of these:
//
//     fusedrk       rk: -ts_rk_type names the tableau
//     fusedarkimex  arkimex, whatever is implicit: -ts_arkimex_type names the tableau
//     leapfrog      Stoermer and Verlet's, friction by the midpoint rule, which the library does not have
std::string library_type(const std::string& fused);
void register_fused_types();  // as names that -ts_type accepts and -ts_view shows

// A method whose stages are taken tile by tile (tiles.hpp), with the library's tableau and its values
// between steps.
class FusedMethod {
 public:
  // Of the library's `type`, rk or arkimex, or of leapfrog. `subtype`: "" for the library's default.
  FusedMethod(const std::string& type, const std::string& subtype);

  const std::string& subtype() const { return subtype_; }
  const StageProgram& program() const { return program_; }
  // `implicit`: of arkimex.
  std::unique_ptr<StepTaker> make(const Model& model, Implicit implicit, bool sticking) const;
  // How many slopes StepTaker::take keeps for values between steps, and their weights in u at the part s of a
  // step dt; none of a method whose polynomial is another (Capabilities::degree).
  int slopes() const;
  std::vector<double> weights_at(double s, double dt) const;

 private:
  std::string subtype_;
  StageProgram program_;
  TsHandle rk_;                       // of rk: the library's, which knows the polynomial
  std::unique_ptr<ImexMethod> imex_;  // of arkimex
};

// The tableau of a TS of type rk.
StageProgram tableau_of(TS rk);

std::vector<AddedTableau> added_tableaus();  // added_tableaus.cpp

// Leapfrog (Stoermer and Verlet) with friction implicit at the node, tile by tile.
//
//     eta* = eta_n + dt/2 K1 D2 psi_n                                     half a kick by the neighbours
//     (psi, eta, state) from (psi_n, eta*, state_n) through dt by the     everything pointwise: friction, the
//                                                                         free block,
//         midpoint rule: y = z + dt/2 g(y), new = 2 y - z                 damping, the state
//     eta_(n+1) = eta + dt/2 K1 D2 psi_(n+1)                              the other half
//
// Symmetric in time, of order 2. Waves of the grid are stable up to dt = 2/sqrt(A K1 kappa^2_max), kappa^2
// the symbol of -D2: as far as one evaluation a step can reach. The node's equation
// (model/implicit_kernel.hpp) has one root while dt A max(-F') < 2. The second half kick is the first one of
// the next step; it is computed again there, since to keep it would take as much memory traffic as the step
// itself. Viscosity between neighbours, which a kick cannot hold stable at order 2, is refused (choice.cpp).
// No estimate of the error: steps are fixed.
constexpr const char* leapfrog_type = "leapfrog";  // -ts_type

// As an additive method: f once at either end, g by the midpoint rule between.
const StageProgram& leapfrog();

}  // namespace stickslip
