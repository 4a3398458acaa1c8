
#include "numerics/tableau.hpp"

#include <algorithm>
#include <numeric>

#include <Eigen/Dense>

#include "stickslip/base/error.hpp"
#include "stickslip/base/vectors.hpp"

namespace stickslip {

namespace {
constexpr PetscInt most_stages = 16;
}  // namespace

ImexMethod::ImexMethod(const std::string& subtype) {
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, 2 * most_stages, u_.out()));
  SS_TRY(TSCreate(PETSC_COMM_SELF, ts_.out()));
  SS_TRY(TSSetType(ts_, TSARKIMEX));
  SS_TRY(TSARKIMEXSetType(ts_, subtype.c_str()));
  SS_TRY(TSSetProblemType(ts_, TS_NONLINEAR));
  SS_TRY(TSSetRHSFunction(ts_, nullptr, RHSFunction, this));
  SS_TRY(TSSetIFunction(ts_, nullptr, IFunction, this));
  SS_TRY(MatCreateSeqAIJ(PETSC_COMM_SELF, 2 * most_stages, 2 * most_stages, 1, nullptr, J_.out()));
  SS_TRY(TSSetIJacobian(ts_, J_, J_, IJacobian, this));
  SS_TRY(TSSetApplicationContext(ts_, this));
  SS_TRY(TSSetPreStage(ts_, PreStage));
  SS_TRY(TSSetPostStage(ts_, PostStage));
  TSAdapt adapt;
  SNES snes;
  KSP ksp;
  PC pc;
  SS_TRY(TSGetAdapt(ts_, &adapt));
  SS_TRY(TSAdaptSetType(adapt, TSADAPTNONE));
  SS_TRY(TSGetSNES(ts_, &snes));
  SS_TRY(SNESSetType(snes, SNESKSPONLY));
  SS_TRY(SNESGetKSP(snes, &ksp));
  SS_TRY(KSPSetType(ksp, KSPPREONLY));
  SS_TRY(KSPGetPC(ksp, &pc));
  SS_TRY(PCSetType(pc, PCJACOBI));
  SS_TRY(TSSetExactFinalTime(ts_, TS_EXACTFINALTIME_STEPOVER));
  SS_TRY(TSSetMaxTime(ts_, 10));
  SS_TRY(TSSetTimeStep(ts_, 1));
  SS_TRY(TSSetSolution(ts_, u_));
  SS_TRY(TSStep(ts_));

  StageProgram& t = tableau_;
  t.stages = stage_ + 1;
  for (int i = 0; i < t.stages; ++i) {
    t.A.insert(t.A.end(), explicit_rows_[i].begin(), explicit_rows_[i].begin() + t.stages);
    t.At.insert(t.At.end(), implicit_rows_[i].begin(), implicit_rows_[i].begin() + t.stages);
  }
  read(u_, t.b, t.bt);
  const PetscInt* order;
  PetscInt candidates;
  SS_TRY(TSAdaptCandidatesGet(adapt, &candidates, &order, nullptr, nullptr, nullptr));
  t.order = int(order[0]);
  VecHandle embedded;
  PetscBool done = PETSC_FALSE;
  SS_TRY(VecDuplicate(u_, embedded.out()));
  SS_TRY(TSEvaluateStep(ts_, t.order - 1, embedded, &done));
  if (done) read(embedded, t.embedded, t.embedded_t);
}

std::vector<double> ImexMethod::weights_at(double s) const {
  VecHandle at;
  SS_TRY(VecDuplicate(u_, at.out()));
  SS_TRY(TSInterpolate(ts_, s, at));
  std::vector<double> of_explicit, of_implicit, all;
  read(at, of_explicit, of_implicit);
  for (std::size_t j = 0; j < of_implicit.size(); ++j) {
    all.push_back(of_implicit[j]);
    all.push_back(of_explicit[j]);
  }
  return all;
}

void ImexMethod::read(Vec from, std::vector<double>& of_explicit, std::vector<double>& of_implicit) const {
  const PetscInt count = tableau_.stages > 0 ? tableau_.stages : most_stages;
  const Reading a(from);
  of_explicit.assign(a + 0, a + count);
  of_implicit.assign(a + most_stages, a + most_stages + count);
}

PetscErrorCode ImexMethod::PreStage(TS ts, PetscReal) {
  return guarded([&] {
    void* context;
    SS_TRY(TSGetApplicationContext(ts, &context));
    if (++static_cast<ImexMethod*>(context)->stage_ == most_stages)
      throw std::logic_error("a tableau of too many stages");
  });
}
PetscErrorCode ImexMethod::PostStage(TS ts, PetscReal, PetscInt index, Vec* stages) {
  return guarded([&] {
    void* context;
    SS_TRY(TSGetApplicationContext(ts, &context));
    auto& self = *static_cast<ImexMethod*>(context);
    std::vector<double> of_explicit, of_implicit;
    self.read(stages[index], of_explicit, of_implicit);
    self.explicit_rows_.push_back(of_explicit);
    self.implicit_rows_.push_back(of_implicit);
  });
}

PetscErrorCode ImexMethod::RHSFunction(TS, PetscReal, Vec, Vec f, void* context) {
  return guarded([&] {
    SS_TRY(VecZeroEntries(f));
    SS_TRY(VecSetValue(f, static_cast<ImexMethod*>(context)->stage_, 1, INSERT_VALUES));
    SS_TRY(VecAssemblyBegin(f));
    SS_TRY(VecAssemblyEnd(f));
  });
}
// udot - g
PetscErrorCode ImexMethod::IFunction(TS, PetscReal, Vec, Vec udot, Vec f, void* context) {
  return guarded([&] {
    SS_TRY(VecCopy(udot, f));
    SS_TRY(VecSetValue(f, most_stages + static_cast<ImexMethod*>(context)->stage_, -1, ADD_VALUES));
    SS_TRY(VecAssemblyBegin(f));
    SS_TRY(VecAssemblyEnd(f));
  });
}
PetscErrorCode ImexMethod::IJacobian(TS, PetscReal, Vec, Vec, PetscReal shift, Mat, Mat J, void*) {
  return guarded([&] {
    for (PetscInt i = 0; i < 2 * most_stages; ++i) SS_TRY(MatSetValue(J, i, i, shift, INSERT_VALUES));
    SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
    SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  });
}

double StageProgram::diagonal() const {
  for (int i = 0; i < stages && additive(); ++i)
    if (At[i * (stages + 1)] != 0) return At[i * (stages + 1)];
  return 0;
}

double StageProgram::time(int stage) const {
  const double* const row = &(additive() ? At : A)[stage * stages];
  return std::accumulate(row, row + stage + 1, 0.);
}

bool StageProgram::ends_at_last_stage() const {
  const std::vector<double>& new_u = additive() ? bt : b;
  const double* const last = &(additive() ? At : A)[(stages - 1) * stages];
  return std::equal(new_u.begin(), new_u.end(), last, [](double x, double y) { return is_no_weight(x - y); });
}

std::vector<double> StageProgram::lacking() const {
  std::vector<double> of_f = b;
  for (int j = 0; j < stages && ends_at_last_stage(); ++j) of_f[j] -= A[(stages - 1) * stages + j];
  return of_f;
}

namespace {
std::vector<double> difference(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> all;
  for (std::size_t j = 0; j < b.size(); ++j) all.push_back(a[j] - b[j]);
  return all;
}
}  // namespace

std::vector<double> StageProgram::error_of_f() const { return difference(b, embedded); }
std::vector<double> StageProgram::error_of_g() const { return difference(bt, embedded_t); }

std::vector<double> propagator(const StageProgram& method, int dim, const std::vector<double>& of_f,
                               const std::vector<double>& of_g, double dt) {
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Matrix> F(of_f.data(), dim, dim), G(of_g.data(), dim, dim);
  const Matrix one = Matrix::Identity(dim, dim);
  std::vector<Matrix> f, g;
  const auto sum = [&](const double* a, const double* at) {  // of the slopes so far
    Matrix y = one;
    for (std::size_t j = 0; j < f.size(); ++j) y += dt * (a[j] * f[j] + (at ? at[j] : 0) * g[j]);
    return y;
  };
  for (int i = 0; i < method.stages; ++i) {
    const double* const at = method.additive() ? &method.At[i * method.stages] : nullptr;
    Matrix y = sum(&method.A[i * method.stages], at);
    if (at) y = (one - dt * at[i] * G).partialPivLu().solve(y).eval();
    f.push_back(F * y);
    g.push_back(G * y);
  }
  const Matrix P = sum(method.b.data(), method.additive() ? method.bt.data() : nullptr);
  return {P.data(), P.data() + P.size()};
}

}  // namespace stickslip
