// Which method advances a scene, and what it takes implicitly: the rule behind `auto`, and what the user
// asked for.
#pragma once

#include <string>

#include "stickslip/time/time.hpp"

namespace stickslip {

// Names are those of PETSc: -ts_type and the value of subtype_option(type).
struct Choice {
  std::string type;
  std::string subtype;  // "": PETSc's default, or there is none
  Implicit implicit;
  bool fused;        // all stages of a step tile by tile, where the type offers it
  bool named_fused;  // and this is what the user named (fused_methods.hpp)
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

}  // namespace stickslip
