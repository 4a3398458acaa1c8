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
  bool named_fused;  // and this is what the user named (fused_ts.hpp)
};

// `spec` says what is wanted; -ts_type behind `prefix` overrides it. Throws UsageError for types that are
// not offered and for splits that the type or the scene does not have.
Choice choose_method(const Model& model, const Rates& rates, const MethodSpec& spec,
                     const std::string& prefix);

// Whether PETSc's database holds the option (without the dash) behind the prefix.
bool user_set(const std::string& prefix, const std::string& option);

}  // namespace stickslip
