// The time-stepping methods of PETSc that are offered, and what is known of each. tests/test_methods.cpp measures
// every entry and writes the table of docs/methods.md.
#pragma once

#include <string>
#include <vector>

namespace stickslip {

enum class MethodKind {
  explicit_,  // takes the whole right-hand side
  imex,       // splits it as imex_implicit says
  implicit    // takes everything implicitly
};

enum class Adaptivity {
  never,       // no error estimate: every step is ts_dt
  on_request,  // only with ts_adapt_type basic
  yes          // unless ts_adapt_type is none
};

struct Method {
  const char *type, *subtype;  // -ts_type, and the value of subtype_option(type) ("" where there is none)
  MethodKind kind;
  int order;                   // measured with fixed steps, split in every way that it offers
  Adaptivity adaptivity;
  const char* use;             // when to use it, for the documentation

  std::string name() const;    // "rk:5dp", "cn"
};

const std::vector<Method>& methods();

// The option that chooses among the methods of one type, without the dash: "ts_rk_type", "ts_bdf_order"; "" where
// there is nothing to choose.
std::string subtype_option(const std::string& type);

// The entry of a method. Throws UsageError, with what to use instead, for types and subtypes that give no answer or a
// wrong one here.
void check_type_offered(const std::string& type);
const Method& offered_method(const std::string& type, const std::string& subtype);

}  // namespace stickslip
