// The time-stepping methods of PETSc that are offered, and what is known of each. tests/test_methods.cpp
// measures every entry and writes the table of docs/methods.md. Nothing here communicates.
#pragma once

#include <petscts.h>

#include <string>
#include <vector>

#include "stickslip/options/options.hpp"

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
  const char *type, *subtype;  // -ts_type, and the value of Capabilities::subtype_option ("": there is none)
  MethodKind kind;
  int order;  // measured with fixed steps, split in every way that it offers
  Adaptivity adaptivity;
  const char* use;  // when to use it, for the documentation

  std::string name() const;  // "rk:5dp", "cn"
};

const std::vector<Method>& methods();

// What a method can do, and what follows from the way in which it does it.
struct Capabilities {
  bool is_explicit = false;   // takes the whole right-hand side
  bool has_estimate = false;  // chooses its steps by an estimate of their error unless the user fixes them
  bool splits = false;        // a part alone is implicit, or may be:
  std::vector<std::string> parts;  // of these one, as imex_implicit says it

  bool remembers = false;   // earlier steps: begins anew with a step of less accuracy
  bool multistep = false;   // and what it remembers are their values, not a slope alone
  bool linearises = false;  // Rosenbrock: solves linear equations, and takes the right-hand side for steady
  bool kicks = false;       // Stoermer and Verlet: friction alone, with mass, between kicks by the neighbours
  bool keeps_order = false;  // where friction is stiff

  // Of values between steps: the degree of a polynomial through slopes, 0 where the method has one of its
  // own; and whether that one errs by an order more than the step.
  int degree = 0;
  bool falls_short = false;

  // The option that chooses among the methods of its type, without the dash: "ts_rk_type", "ts_bdf_order"; ""
  // where there is nothing to choose.
  std::string subtype_option;
  // The type that takes its steps tile by tile (-ts_type names it too); "" where there is none.
  std::string fused_type;
};

// Read off the method's kind, estimate and name.
Capabilities capabilities(const Method& method);

// The entry of a method. Throws UsageError, with what to use instead, for types and subtypes that give no
// answer or a wrong one here.
void check_type_offered(const std::string& type);
const Method& offered_type(const std::string& type);  // the first entry of the type
const Method& offered_method(const std::string& type, const std::string& subtype);

// How a system is to be advanced in time: a method as the user names it, type[:subtype[:implicit]], e.g.
// rk:5dp, arkimex:4:friction, cn; and how long its steps are. What is left open is chosen for the scene.
struct MethodSpec {
  std::string type;               // "": chosen for the scene, or as ts_type says
  std::string subtype;            // "": there is none, or PETSc's default
  std::string implicit = "auto";  // of an IMEX method, as imex_implicit says it
  double tolerance = 0;           // of a step, relative and in parts of the scene's scales; 0: as set
  double parts = 1e-6;            // the latter, where tolerance is 0 and ts_atol no number
  double step = 0;                // of fixed steps; 0: chosen by the method's estimate, or as ts_dt says
  bool fused = true;              // rk takes its stages tile by tile (rk_fused)

  // What the options say of it: imex_implicit and rk_fused. The rest stands in PETSc's database.
  static MethodSpec from(const Options& options);
  // Throws UsageError, which begins with `WHAT TEXT: `, for what is not offered here or does not split so.
  static MethodSpec parse(const std::string& what, const std::string& text);

  // The entry of `type` and `subtype`, which are given; and what it says.
  const Method& method() const { return offered_method(type, subtype); }
  std::string name() const { return method().name(); }
  int order() const { return method().order; }
  Capabilities can() const { return capabilities(method()); }
};

// A method of a program of one's own, as a type of PETSc's TS: every command that takes -ts_type or a list of
// methods has it.

// `method`: its row of the table, without a subtype; what it says (explicit or not, order, error estimate) is
// relied on. `create`: what TSRegister takes; called once PETSc has started. `options`: names that the type
// reads itself, without the dash, e.g. "ts_heun_weight". To be called before stickslip::main. Throws
// std::logic_error for a type that is there already, and once the table has been read.
void register_method(const Method& method, PetscErrorCode (*create)(TS),
                     const std::vector<std::string>& options = {});

// An explicit Runge-Kutta method that the library lacks: type rk, the name of the tableau, and what else the
// table of methods holds; with the tableau, s stages.
struct AddedTableau {
  Method method;
  std::vector<double> A;  // s x s, row-major, below its diagonal
  std::vector<double> b;  // weights of the step
  // weights of the pair's other step, for the error estimate; none: fixed steps only
  std::vector<double> embedded;
};
// Has every command take it, as -ts_type rk:NAME too. To be called before stickslip::main. Throws
// std::logic_error for a name that is there already, sizes that do not fit, and once the table has been read.
void register_tableau(AddedTableau tableau);

}  // namespace stickslip
