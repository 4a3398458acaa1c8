#include "time/fused_methods.hpp"

#include "numerics/imex_tableau.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/time/methods.hpp"
#include "time/banded_imex.hpp"

namespace stickslip {

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

class FusedRk : public FusedMethod {
 public:
  FusedRk() {
    SS_TRY(TSCreate(PETSC_COMM_SELF, library_.out()));
    SS_TRY(TSSetType(library_, TSRK));
  }
  const char* type() const override { return TSRK; }
  const char* subtype() const override {
    const char* name;
    SS_TRY(TSRKGetType(library_, &name));
    return name;
  }
  void set_subtype(const char* name) override {
    SS_TRY(TSRKSetType(library_, name));
    order_ = 0;
  }
  std::unique_ptr<StepTaker> make(const Model& model, Implicit, bool sticking) const override {
    return std::make_unique<TiledStep>(model, tableau_of(library_), sticking);
  }
  int order() const override {
    if (order_ == 0) order_ = offered_method(TSRK, subtype()).order;  // looked up once, not in every step
    return order_;
  }
  int slopes() const override { return int(RkParts(library_).stages); }
  std::vector<double> weights_at(double s, double dt) const override {
    const RkParts t(library_);
    std::vector<double> weights(t.stages);
    for (PetscInt i = 0; i < t.stages; ++i) {
      double power = dt;
      for (PetscInt j = 0; j < t.degree; ++j) {
        power *= s;
        weights[i] += power * t.interpolating[i * t.degree + j];
      }
    }
    return weights;
  }
  TS library() const override { return library_; }

 private:
  TsHandle library_;
  mutable int order_ = 0;  // 0: not looked up yet
};

class FusedArkimex : public FusedMethod {
 public:
  const char* type() const override { return TSARKIMEX; }
  const char* subtype() const override { return name_.c_str(); }
  void set_subtype(const char* name) override {
    name_ = name;
    method_.reset();
  }
  std::unique_ptr<StepTaker> make(const Model& model, Implicit implicit, bool sticking) const override {
    if (implicit == Implicit::wave || implicit == Implicit::both)
      return std::make_unique<BandedImex>(model, method().tableau(), implicit, sticking);
    return std::make_unique<TiledStep>(model, method().tableau(), sticking);
  }
  int order() const override { return method().tableau().order; }
  int slopes() const override { return 2 * method().tableau().stages; }
  std::vector<double> weights_at(double s, double dt) const override {
    std::vector<double> weights = method().weights_at(s);
    for (double& w : weights) w *= dt;
    return weights;
  }

 private:
  const ImexMethod& method() const {
    if (!method_) method_ = std::make_unique<ImexMethod>(name_);
    return *method_;
  }
  std::string name_ = TSARKIMEX3;  // as the library's default
  mutable std::unique_ptr<ImexMethod> method_;
};

class FusedLeapfrog : public FusedMethod {
 public:
  const char* type() const override { return leapfrog_type; }
  const char* subtype() const override { return ""; }
  void set_subtype(const char*) override {}
  std::unique_ptr<StepTaker> make(const Model& model, Implicit, bool sticking) const override {
    return std::make_unique<TiledStep>(model, leapfrog(), sticking);
  }
  int order() const override { return leapfrog().order; }
};

}  // namespace

std::unique_ptr<FusedMethod> FusedMethod::of(const std::string& type) {
  if (type == TSRK) return std::make_unique<FusedRk>();
  if (type == TSARKIMEX) return std::make_unique<FusedArkimex>();
  if (type == leapfrog_type) return std::make_unique<FusedLeapfrog>();
  throw std::logic_error("no fused steps for ts_type " + type);
}

namespace {

constexpr struct {
  const char *fused, *library;
} type_names[] = {{"fusedrk", TSRK}, {"fusedarkimex", TSARKIMEX}, {leapfrog_type, leapfrog_type}};

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

std::string fused_type(const std::string& type) {
  for (const auto& names : type_names)
    if (type == names.library) return names.fused;
  return "";
}

std::string library_type(const std::string& fused) {
  for (const auto& names : type_names)
    if (fused == names.fused) return names.library;
  return "";
}

void register_fused_types() {
  SS_TRY(TSRegister(type_names[0].fused, create<0>));
  SS_TRY(TSRegister(type_names[1].fused, create<1>));
  SS_TRY(TSRegister(type_names[2].fused, create<2>));
}

StageProgram tableau_of(TS rk) {
  const RkParts t(rk);
  StageProgram tableau{int(t.stages), {t.A, t.A + t.stages * t.stages}, {t.b, t.b + t.stages}, {}};
  if (t.embedded) tableau.embedded.assign(t.embedded, t.embedded + t.stages);
  return tableau;
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
