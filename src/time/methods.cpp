#include "stickslip/time/methods.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>

#include "base/failure.hpp"
#include "numerics/tableau.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/time/time.hpp"
#include "time/band.hpp"
#include "time/methods.hpp"
#include "time/sliding_step.hpp"

namespace stickslip {

namespace {
constexpr auto explicit_ = MethodKind::explicit_;
constexpr auto imex = MethodKind::imex;
constexpr auto implicit = MethodKind::implicit;
constexpr auto never = Adaptivity::never;
constexpr auto on_request = Adaptivity::on_request;
constexpr auto yes = Adaptivity::yes;

// What register_method() and register_tableau() added.
struct RegisteredMethod {
  Method method;
  PetscErrorCode (*create)(TS);
};
struct Registry {
  std::vector<RegisteredMethod> methods;
  std::vector<AddedTableau> tableaus;
  bool read = false;  // no more can be added
};
Registry& registry() {
  static Registry all;
  return all;
}

std::vector<AddedTableau> all_tableaus() {
  std::vector<AddedTableau> all = added_tableaus();
  all.insert(all.end(), registry().tableaus.begin(), registry().tableaus.end());
  return all;
}

}  // namespace

std::string Method::name() const { return *subtype ? std::string(type) + ":" + subtype : type; }

namespace {

std::vector<Method> make_table() {
  std::vector<Method> table = {
      {"rk", "5dp", explicit_, 5, yes,
       "the choice where nothing is stiff, but friction jumps or steps are fixed"},
      {"rk", "3bs", explicit_, 3, yes, "low accuracy, short steps"},
      {"rk", "5f", explicit_, 5, yes, "as 5dp"},
      {"rk", "5bs", explicit_, 5, yes, "accuracy of 1e-8 and better"},
      {"rk", "6vr", explicit_, 6, yes, "accuracy of 1e-9 and better"},
      {"rk", "7vr", explicit_, 7, yes, "the default where nothing is stiff; any accuracy"},
      {"rk", "8vr", explicit_, 8, yes, "reference solutions"},
      {"rk", "2a", explicit_, 2, yes, "comparison"},
      {"rk", "2b", explicit_, 2, never, "comparison"},
      {"rk", "3", explicit_, 3, never, "comparison"},
      {"rk", "4", explicit_, 4, never, "the classical method, for comparison"},
      {"rk", "1fe", explicit_, 1, never, "comparison"},
      {"euler", "", explicit_, 1, never, "comparison; unstable for waves without damping"},
      {"ssp", "rks2", explicit_, 2, never, "comparison"},
      {"ssp", "rks3", explicit_, 3, never, "comparison"},
      {"ssp", "rk104", explicit_, 4, never, "long fixed steps"},
      {"arkimex", "3", imex, 3, yes, "stiff friction or stiff waves, low accuracy"},
      {"arkimex", "4", imex, 4, yes, "stiff friction or stiff waves"},
      {"arkimex", "5", imex, 5, yes, "stiff friction or stiff waves, high accuracy"},
      {"arkimex", "2c", imex, 2, yes, "comparison"},
      {"arkimex", "2d", imex, 2, yes, "comparison"},
      {"arkimex", "2e", imex, 2, yes, "comparison"},
      {"arkimex", "a2", imex, 2, yes, "comparison"},
      {"arkimex", "l2", imex, 2, yes, "comparison"},
      {"arkimex", "ars122", imex, 2, yes, "comparison"},
      {"arkimex", "1bee", imex, 1, yes, "comparison"},
      {"arkimex", "ars443", imex, 3, never, "comparison"},
      {"arkimex", "prssp2", imex, 2, never, "comparison"},
      {"rosw", "ra34pw2", implicit, 3, yes, "everything stiff"},
      {"rosw", "rodas3", implicit, 3, yes, "everything stiff"},
      {"rosw", "sandu3", implicit, 3, yes, "everything stiff"},
      {"rosw", "ra3pw", implicit, 3, yes, "everything stiff"},
      {"rosw", "assp3p3s1c", implicit, 3, yes, "comparison"},
      {"rosw", "grk4t", implicit, 4, yes, "mildly stiff, accurate (not L-stable)"},
      {"rosw", "shamp4", implicit, 4, yes, "mildly stiff, accurate (not L-stable)"},
      {"rosw", "veldd4", implicit, 4, yes, "mildly stiff, accurate (not L-stable)"},
      {"rosw", "4l", implicit, 4, yes, "everything stiff, accurate"},
      {"rosw", "2m", implicit, 2, yes, "comparison"},
      {"rosw", "2p", implicit, 2, yes, "comparison"},
      {"rosw", "theta1", implicit, 1, never, "comparison"},
      {"rosw", "theta2", implicit, 2, never, "comparison"},
      {"bdf", "1", implicit, 1, yes, "comparison"},
      {"bdf", "2", implicit, 2, yes, "everything stiff, one Newton solve a step"},
      {"bdf", "3", implicit, 2, yes,
       "as bdf:2, adaptive only: fixed steps have order 2; unstable for undamped waves"},
      {"bdf", "4", implicit, 2, yes, "as bdf:3"},
      {"bdf", "5", implicit, 2, yes, "as bdf:3"},
      {"bdf", "6", implicit, 2, yes, "as bdf:3"},
      {"theta", "", implicit, 2, on_request, "midpoint rule (theta 1/2); steps far beyond the shortest wave"},
      {"cn", "", implicit, 2, on_request, "Crank and Nicolson"},
      {"beuler", "", implicit, 1, on_request,
       "backward Euler: hides instabilities when ts_dt > 2 Re(lambda)/abs(lambda)^2"},
      {"alpha", "", implicit, 2, on_request,
       "generalised alpha: damps the shortest waves by ts_alpha_radius"},
      {leapfrog_type, "", imex, 2, never, "the classical method for waves; long fixed steps"},
  };
  for (const AddedTableau& added : all_tableaus()) table.push_back(added.method);
  for (const RegisteredMethod& registered : registry().methods) table.push_back(registered.method);
  return table;
}

}  // namespace

void register_method(const Method& method, PetscErrorCode (*create)(TS),
                     const std::vector<std::string>& options) {
  const std::string type = method.type;
  if (registry().read) throw std::logic_error("method " + type + ": it is registered too late");
  if (*method.subtype) throw std::logic_error("method " + type + ": a type of one's own has no subtypes");
  for (const Method& other : make_table())
    if (type == other.type) throw std::logic_error("two methods are called " + type);
  registry().methods.push_back({method, create});
  for (const std::string& name : options) add_library_name(name);
}

void register_tableau(AddedTableau tableau) {
  const std::string name = tableau.method.name();
  const std::size_t stages = tableau.b.size();
  if (registry().read) throw std::logic_error("method " + name + ": it is registered too late");
  if (std::string(tableau.method.type) != "rk" || stages == 0 || tableau.A.size() != stages * stages ||
      (!tableau.embedded.empty() && tableau.embedded.size() != stages))
    throw std::logic_error("method " + name +
                           ": a tableau of type rk has s weights and s times s coefficients");
  for (const Method& other : make_table())
    if (name == other.name()) throw std::logic_error("two methods are called " + name);
  registry().tableaus.push_back(std::move(tableau));
}

const std::vector<Method>& methods() {
  registry().read = true;
  static const std::vector<Method> table = make_table();
  return table;
}

namespace {

// Types that have tableaus or orders to choose from: the option, and how a TS is told and tells.
struct Subtypes {
  const char *type, *option;
  PetscErrorCode (*set)(TS, const char*);
  PetscErrorCode (*get)(TS, const char**);
};
constexpr Subtypes subtypes[] = {
    {TSRK, "ts_rk_type", TSRKSetType, TSRKGetType},
    {TSARKIMEX, "ts_arkimex_type", TSARKIMEXSetType, TSARKIMEXGetType},
    {TSROSW, "ts_rosw_type", TSRosWSetType, TSRosWGetType},
    {TSSSP, "ts_ssp_type", TSSSPSetType, TSSSPGetType},
    {TSBDF, "ts_bdf_order", [](TS ts, const char* order) { return TSBDFSetOrder(ts, std::stoi(order)); },
     [](TS ts, const char** order) {
       static constexpr const char* orders[] = {"0", "1", "2", "3", "4", "5", "6"};
       PetscInt number;
       const PetscErrorCode failed = TSBDFGetOrder(ts, &number);
       if (!failed) *order = orders[number];
       return failed;
     }}};

// Types that take steps tile by tile, and of which type of the library; leapfrog is none of its.
constexpr struct {
  const char *fused, *library;
} type_names[] = {{"fusedrk", TSRK}, {"fusedarkimex", TSARKIMEX}, {leapfrog_type, leapfrog_type}};

std::string fused_type(const std::string& type) {
  for (const auto& names : type_names)
    if (type == names.library) return names.fused;
  return "";
}

const Subtypes* subtypes_of(const std::string& type) {
  for (const Subtypes& one : subtypes)
    if (type == one.type) return &one;
  return nullptr;
}

}  // namespace

std::string library_type(const std::string& fused) {
  for (const auto& names : type_names)
    if (fused == names.fused) return names.library;
  return "";
}

void set_subtype(TS ts, const std::string& type, const std::string& name) {
  const Subtypes* const of = subtypes_of(type);
  if (of && !name.empty()) SS_TRY(of->set(ts, name.c_str()));
}

std::string subtype_of(TS ts, const std::string& type) {
  const char* name = nullptr;
  if (const Subtypes* const of = subtypes_of(type)) SS_TRY(of->get(ts, &name));
  return name ? name : "";
}

Capabilities capabilities(const Method& method) {
  const std::string type = method.type, name = method.name();
  Capabilities can;
  can.is_explicit = method.kind == explicit_;
  can.has_estimate = method.adaptivity == yes;
  can.splits = method.kind == imex;
  can.multistep = type == TSBDF;
  can.remembers = can.multistep || type == TSALPHA;
  can.linearises = type == TSROSW;
  can.kicks = type == leapfrog_type;
  can.keeps_order = can.multistep || name == "arkimex:l2";
  if (can.splits) can.parts = {"friction", "wave", "both"};
  if (can.kicks) can.parts = {"friction"};
  can.falls_short = name == "arkimex:5";
  if (!can.multistep && !can.falls_short && name != "rk:5dp" && name != "arkimex:4")
    can.degree = can.is_explicit ? std::max(3, method.order - 1) : 3;
  if (const Subtypes* const of = subtypes_of(type)) can.subtype_option = of->option;
  can.fused_type = fused_type(type);
  return can;
}

void check_type_offered(const std::string& type) {
  static const std::map<std::string, std::string> why_not = {
      {"glee", "it ignores the implicit part and with it most of the equations"},
      {"eimex", "it gives wrong answers in this version of PETSc"},
      {"irk", "it fails on this problem in this version of PETSc"},
      {"mimex", "it gives wrong answers in this version of PETSc"},
      {"glle", "it fails on this problem in this version of PETSc"},
      {"pseudo", "it follows no time, only a steady state (see the command spectrum)"},
      {"alpha2", "it is for second-order systems"},
      {"mprk", "it is for problems partitioned by speed"},
      {"basicsymplectic", "it is for Hamiltonian systems, and friction is none"},
      {"discgrad", "it is for gradient systems, and friction is none"}};
  const auto& all = methods();
  if (!library_type(type).empty()) return;
  std::vector<std::string> types;
  for (const Method& m : all)
    if (std::find(types.begin(), types.end(), m.type) == types.end()) types.push_back(m.type);
  if (std::find(types.begin(), types.end(), type) != types.end()) return;
  const auto found = why_not.find(type);
  const std::string near = suggestion(type, types);
  throw UsageError("-ts_type " + quoted(type) + ": " +
                   (found != why_not.end()
                        ? found->second + "; use one of " + joined(types)
                        : "no such method" + (near.empty() ? "; it is one of " + joined(types) : near)));
}

const Method& offered_type(const std::string& type) {
  check_type_offered(type);
  const auto& all = methods();
  const std::string library = library_type(type);
  return *std::find_if(all.begin(), all.end(), [&](const Method& m) {
    return type == m.type || (!library.empty() && library == m.type);
  });
}

const Method& offered_method(const std::string& type, const std::string& subtype) {
  check_type_offered(type);
  for (const Method& m : methods())
    if (type == m.type && subtype == m.subtype) return m;
  const std::string what = capabilities(offered_type(type)).subtype_option + " " + subtype + ": ";
  if (type == "arkimex" && subtype == "bpr3")
    throw UsageError(what + "its order falls to 1 when the right-hand side is split; use arkimex 3");
  if (type == "rosw" && (subtype == "ark3" || subtype == "lassp3p4s2c" || subtype == "llssp3p4s2c"))
    throw UsageError(what + "its first stage has no implicit part, which ends in NaN here; use ra34pw2");
  std::vector<std::string> subtypes;
  for (const Method& m : methods())
    if (type == m.type) subtypes.push_back(m.subtype);
  throw UsageError(what + "not among the methods offered" + suggestion(subtype, subtypes));
}

MethodSpec MethodSpec::from(const Options& options) {
  MethodSpec spec;
  spec.implicit = options.text("imex_implicit");
  spec.fused = options.boolean("rk_fused");
  if (const std::string atol = options.text("ts_atol"); atol.rfind("auto:", 0) == 0)
    spec.parts = *parse_number(atol.substr(5));
  return spec;
}

MethodSpec MethodSpec::parse(const std::string& what, const std::string& text) {
  const std::vector<std::string> parts = split(text, ':');
  const std::string says = what + " " + quoted(text) + ": ";
  if (parts.size() > 3)
    throw UsageError(says + "a method is type[:subtype[:implicit]], e.g. rk:5dp or arkimex:4:friction");
  MethodSpec spec;
  spec.type = parts[0];
  if (const std::string library = library_type(spec.type); !library.empty()) spec.type = library;
  // the first of its type where no subtype is given
  const Method* first = nullptr;
  std::string subtypes, types;
  for (const Method& m : methods()) {
    if (spec.type == m.type) {
      if (!first) first = &m;
      subtypes += std::string(subtypes.empty() ? "" : ", ") + m.subtype;
    }
    if ((" " + types + ",").find(" " + std::string(m.type) + ",") == std::string::npos)
      types += (types.empty() ? "" : ", ") + std::string(m.type);
  }
  try {
    check_type_offered(spec.type);
    spec.subtype = parts.size() > 1 ? parts[1] : first->subtype;
    if (*first->subtype == '\0' && parts.size() == 3 && parts[1].empty()) spec.subtype = "";
    (void)spec.method();
  } catch (const UsageError& e) {
    throw UsageError(says + e.what() +
                     (first && *first->subtype ? "; " + spec.type + " has " + subtypes
                      : first                  ? "; " + spec.type + " has no subtypes"
                                               : "; types are " + types));
  }
  if (parts.size() < 3) return spec;
  spec.implicit = parts[2];
  const std::string& wish = spec.implicit;
  const bool known =
      wish == "auto" || wish == "none" || wish == "friction" || wish == "wave" || wish == "both";
  if (!known) throw UsageError(says + "what is implicit is one of auto, none, friction, wave, both");
  const Capabilities can = spec.can();
  if (can.is_explicit && wish != "none" && wish != "auto")
    throw UsageError(says + spec.type + " is explicit; use arkimex, or none");
  if (can.parts.size() == 1 && wish != "auto" && wish != can.parts[0])
    throw usage_error("{}{} takes {} implicitly and nothing else; use arkimex, or {}", says, spec.type,
                      can.parts[0], can.parts[0]);
  if (!can.is_explicit && !can.splits && wish != "both" && wish != "auto")
    throw usage_error("{}{} takes everything implicitly; use arkimex, or both", says, spec.type);
  return spec;
}

void register_time_steppers() {
  static bool done = false;
  if (std::exchange(done, true)) return;
  register_fused_types();
  for (const AddedTableau& t : all_tableaus()) {
    const PetscInt stages = t.b.size();
    SS_TRY(TSRKRegister(t.method.subtype, t.method.order, stages, t.A.data(), t.b.data(), nullptr,
                        t.embedded.empty() ? nullptr : t.embedded.data(), 0, nullptr));
  }
  for (const RegisteredMethod& own : registry().methods) SS_TRY(TSRegister(own.method.type, own.create));
}

// ---- steps taken tile by tile ----

namespace {

// What TSRKGetTableau gives.
struct RkParts {
  const PetscReal *A, *b, *c, *embedded, *interpolating;
  PetscInt stages, degree;
  PetscBool first_same_as_last;
  explicit RkParts(TS rk) {
    SS_TRY(TSRKGetTableau(rk, &stages, &A, &b, &c, &embedded, &degree, &interpolating, &first_same_as_last));
  }
};

}  // namespace

StageProgram tableau_of(TS rk) {
  const RkParts t(rk);
  StageProgram tableau{int(t.stages), {t.A, t.A + t.stages * t.stages}, {t.b, t.b + t.stages}, {}};
  if (t.embedded) tableau.embedded.assign(t.embedded, t.embedded + t.stages);
  return tableau;
}

FusedMethod::FusedMethod(const std::string& type, const std::string& subtype) : subtype_(subtype) {
  if (type == TSRK) {
    SS_TRY(TSCreate(PETSC_COMM_SELF, rk_.out()));
    SS_TRY(TSSetType(rk_, TSRK));
    stickslip::set_subtype(rk_, type, subtype);
    subtype_ = subtype_of(rk_, type);
    program_ = tableau_of(rk_);
    program_.order = offered_method(type, subtype_).order;
  } else if (type == TSARKIMEX) {
    if (subtype.empty()) subtype_ = TSARKIMEX3;  // as the library's default
    imex_ = std::make_unique<ImexMethod>(subtype_);
    program_ = imex_->tableau();
  } else if (type == leapfrog_type) {
    program_ = leapfrog();
  } else {
    throw std::logic_error("no fused steps for ts_type " + type);
  }
}

std::unique_ptr<StepTaker> FusedMethod::make(const Model& model, Implicit implicit, bool sticking) const {
  if (model.scene().massless()) return std::make_unique<SlidingStep>(model, program_);
  if (imex_ && (implicit == Implicit::wave || implicit == Implicit::both))
    return std::make_unique<BandedImex>(model, program_, implicit, sticking);
  return std::make_unique<TiledStep>(model, program_, sticking);
}

int FusedMethod::slopes() const {
  return !program_.dense ? 0 : program_.additive() ? 2 * program_.stages : program_.stages;
}

std::vector<double> FusedMethod::weights_at(double s, double dt) const {
  std::vector<double> weights;
  if (imex_) {
    weights = imex_->weights_at(s);
    for (double& w : weights) w *= dt;
  } else {
    const RkParts t(rk_);
    weights.resize(std::size_t(t.stages));
    for (PetscInt i = 0; i < t.stages; ++i) {
      double power = dt;
      for (PetscInt j = 0; j < t.degree; ++j) {
        power *= s;
        weights[i] += power * t.interpolating[i * t.degree + j];
      }
    }
  }
  return weights;
}

namespace {

// A TS that holds options and a name.
PetscErrorCode create_holder(TS ts, const char* name) {
  PetscFunctionBegin;
  TSAdapt adapt;
  TSAdaptType control;
  PetscCall(TSSetType(ts, TSEULER));
  PetscCall(PetscObjectChangeTypeName(reinterpret_cast<PetscObject>(ts), name));
  PetscCall(TSGetAdapt(ts, &adapt));
  PetscCall(TSAdaptGetType(adapt, &control));
  if (!control) PetscCall(TSAdaptSetType(adapt, TSADAPTBASIC));
  PetscFunctionReturn(0);
}
template <int number>
PetscErrorCode create(TS ts) {
  return create_holder(ts, type_names[number].fused);
}

}  // namespace

void register_fused_types() {
  SS_TRY(TSRegister(type_names[0].fused, create<0>));
  SS_TRY(TSRegister(type_names[1].fused, create<1>));
  SS_TRY(TSRegister(type_names[2].fused, create<2>));
}

const StageProgram& leapfrog() {
  static const StageProgram method = [] {
    StageProgram m{3, {0, 0, 0, 0.5, 0, 0, 0.5, 0, 0}, {0.5, 0, 0.5}, {}};
    m.At = {0, 0, 0, 0, 0.5, 0, 0, 1, 0};
    m.bt = {0, 1, 0};
    m.order = 2;
    m.dense = false;
    m.target = 1e-13;  // nobody gives a tolerance, and round-off is in reach
    return m;
  }();
  return method;
}

}  // namespace stickslip
