// SUNDIALS on the systems of bench_peers: CVODE, and ARKODE with the tableaus of newer releases, vectors and
// linear solvers given to it.
#pragma once

#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <memory>

#include "peers_system.hpp"
#include "peers_tableaus.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/time/time.hpp"

namespace peers {

constexpr long most_steps = 300000;  // a run that needs more is no rival

struct Outcome {
  bool done = false;
  std::vector<double> u;
  long steps = 0, evaluations = 0;
};

struct Parts {
  System* system;
  Part explicit_part, implicit_part;
};
template <bool implicit>
int sun_rhs(realtype, N_Vector y, N_Vector f, void* data) {
  const Parts& p = *static_cast<Parts*>(data);
  p.system->rhs(implicit ? p.implicit_part : p.explicit_part, N_VGetArrayPointer(y), N_VGetArrayPointer(f));
  return p.system->is_late() ? -1 : 0;
}

// Debian compiles SUNDIALS without optimisation. Its vectors and matrices are made to be replaced, so that
// what takes the time is given to it compiled as the rest of this program.
template <class Body>
void for_all(N_Vector z, const Body& body) {
  const sunindextype n = N_VGetLength(z);
  double* const out = N_VGetArrayPointer(z);
  for (sunindextype i = 0; i < n; ++i) out[i] = body(i);
}
inline void fast_sum(double a, N_Vector x, double b, N_Vector y, N_Vector z) {
  const double *p = N_VGetArrayPointer(x), *q = N_VGetArrayPointer(y);
  for_all(z, [=](sunindextype i) { return a * p[i] + b * q[i]; });
}
inline int fast_combination(int count, double* c, N_Vector* X, N_Vector z) {
  constexpr sunindextype block = 512;  // a piece stays in the cache while all vectors are added
  const sunindextype n = N_VGetLength(z);
  double *const out = N_VGetArrayPointer(z), sum[block];
  for (sunindextype begin = 0; begin < n; begin += block) {
    const sunindextype length = std::min(block, n - begin);
    const double* first = N_VGetArrayPointer(X[0]) + begin;
    for (sunindextype i = 0; i < length; ++i) sum[i] = c[0] * first[i];
    for (int k = 1; k < count; ++k) {
      const double *x = N_VGetArrayPointer(X[k]) + begin, factor = c[k];
      for (sunindextype i = 0; i < length; ++i) sum[i] += factor * x[i];
    }
    std::copy(sum, sum + length, out + begin);
  }
  return 0;
}
inline int fast_add_multi(int count, double* a, N_Vector x, N_Vector* Y, N_Vector* Z) {
  for (int k = 0; k < count; ++k) fast_sum(a[k], x, 1, Y[k], Z[k]);
  return 0;
}
inline double fast_wrms(N_Vector x, N_Vector w) {
  const sunindextype n = N_VGetLength(x);
  const double *p = N_VGetArrayPointer(x), *q = N_VGetArrayPointer(w);
  double sum[4] = {0, 0, 0, 0};
  sunindextype i = 0;
  for (; i + 4 <= n; i += 4)
    for (int k = 0; k < 4; ++k) sum[k] += (p[i + k] * q[i + k]) * (p[i + k] * q[i + k]);
  for (; i < n; ++i) sum[0] += (p[i] * q[i]) * (p[i] * q[i]);
  return std::sqrt((sum[0] + sum[1] + sum[2] + sum[3]) / double(n));
}
inline void make_fast(N_Vector y) {
  N_Vector_Ops o = y->ops;
  o->nvlinearsum = fast_sum;
  o->nvlinearcombination = fast_combination;
  o->nvscaleaddmulti = fast_add_multi;
  o->nvwrmsnorm = fast_wrms;
  o->nvscale = [](double c, N_Vector x, N_Vector z) {
    const double* p = N_VGetArrayPointer(x);
    for_all(z, [=](sunindextype i) { return c * p[i]; });
  };
  o->nvconst = [](double c, N_Vector z) { for_all(z, [=](sunindextype) { return c; }); };
  o->nvabs = [](N_Vector x, N_Vector z) {
    const double* p = N_VGetArrayPointer(x);
    for_all(z, [=](sunindextype i) { return std::abs(p[i]); });
  };
  o->nvinv = [](N_Vector x, N_Vector z) {
    const double* p = N_VGetArrayPointer(x);
    for_all(z, [=](sunindextype i) { return 1 / p[i]; });
  };
  o->nvaddconst = [](N_Vector x, double b, N_Vector z) {
    const double* p = N_VGetArrayPointer(x);
    for_all(z, [=](sunindextype i) { return p[i] + b; });
  };
}

// A matrix I - h J as the place and the h at which it is to be made: Reduced makes it.
struct Place {
  std::vector<double> u;
  double h = 0;
};
inline Place& place_of(SUNMatrix J) { return *static_cast<Place*>(J->content); }

inline SUNMatrix new_matrix(SUNContext context, std::size_t size) {
  SUNMatrix J = SUNMatNewEmpty(context);
  J->content = new Place{std::vector<double>(size), 0};
  J->ops->getid = [](SUNMatrix) { return SUNMATRIX_CUSTOM; };
  J->ops->clone = [](SUNMatrix A) { return new_matrix(A->sunctx, place_of(A).u.size()); };
  J->ops->destroy = [](SUNMatrix A) {
    delete static_cast<Place*>(A->content);
    SUNMatFreeEmpty(A);
  };
  J->ops->zero = [](SUNMatrix) { return SUNMAT_SUCCESS; };
  J->ops->copy = [](SUNMatrix A, SUNMatrix B) {
    place_of(B) = place_of(A);
    return SUNMAT_SUCCESS;
  };
  J->ops->scaleaddi = [](double c, SUNMatrix A) {
    place_of(A).h = -c;
    return SUNMAT_SUCCESS;
  };
  return J;
}

inline int sun_jacobian(realtype, N_Vector y, N_Vector, SUNMatrix J, void*, N_Vector, N_Vector, N_Vector) {
  const double* a = N_VGetArrayPointer(y);
  std::copy(a, a + place_of(J).u.size(), place_of(J).u.begin());
  return 0;
}

inline SUNLinearSolver new_solver(SUNContext context, Reduced& reduced) {
  SUNLinearSolver solver = SUNLinSolNewEmpty(context);
  solver->content = &reduced;
  solver->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
  solver->ops->initialize = [](SUNLinearSolver) { return 0; };
  solver->ops->setup = [](SUNLinearSolver S, SUNMatrix A) {
    Reduced& r = *static_cast<Reduced*>(S->content);
    r.set_slopes(place_of(A).u.data());
    r.factor(place_of(A).h);
    return 0;
  };
  solver->ops->solve = [](SUNLinearSolver S, SUNMatrix, N_Vector x, N_Vector b, double) {
    if (x != b) N_VScale(1, b, x);
    static_cast<Reduced*>(S->content)->solve(N_VGetArrayPointer(x));
    return 0;
  };
  solver->ops->free = [](SUNLinearSolver S) {
    SUNLinSolFreeEmpty(S);
    return 0;
  };
  return solver;
}

// What every run of SUNDIALS needs; freed in the right order.
struct Sun {
  SUNContext context = nullptr;
  N_Vector y = nullptr;
  SUNMatrix J = nullptr;
  SUNLinearSolver solver = nullptr;
  SUNNonlinearSolver iteration = nullptr;
  std::unique_ptr<Reduced> reduced;
  void *cvode = nullptr, *ark = nullptr, *erk = nullptr;
  explicit Sun(System& system) {
    if (SUNContext_Create(nullptr, &context) != 0) throw Failure("SUNDIALS: no context");
    y = N_VNew_Serial(system.size, context);
    make_fast(y);
    std::copy(system.start.begin(), system.start.end(), N_VGetArrayPointer(y));
    system.evaluations = 0;
  }
  ~Sun() {
    if (cvode) CVodeFree(&cvode);
    if (ark) ARKStepFree(&ark);
    if (erk) ERKStepFree(&erk);
    if (iteration) SUNNonlinSolFree(iteration);
    if (solver) SUNLinSolFree(solver);
    if (J) SUNMatDestroy(J);
    if (y) N_VDestroy(y);
    SUNContext_Free(&context);
  }
  Sun(const Sun&) = delete;
  Sun& operator=(const Sun&) = delete;
  void make_solver(const System& system, Part part) {
    reduced = std::make_unique<Reduced>(system, part);
    J = new_matrix(context, std::size_t(system.size));
    solver = new_solver(context, *reduced);
  }
  Outcome outcome(const System& system, int flag, long steps) const {
    const double* a = N_VGetArrayPointer(y);
    return {flag >= 0, std::vector<double>(a, a + system.size), steps, system.evaluations};
  }
};

inline Outcome cvode(System& system, double t_end, double tolerance, int family) {
  Sun sun(system);
  Parts parts{&system, Part::full, Part::full};
  sun.cvode = CVodeCreate(family, sun.context);
  CVodeInit(sun.cvode, sun_rhs<true>, 0, sun.y);
  CVodeSStolerances(sun.cvode, tolerance, tolerance);
  CVodeSetUserData(sun.cvode, &parts);
  CVodeSetMaxNumSteps(sun.cvode, most_steps);
  CVodeSetErrFile(sun.cvode, nullptr);
  if (family == CV_ADAMS) {
    sun.iteration = SUNNonlinSol_FixedPoint(sun.y, 0, sun.context);
    CVodeSetNonlinearSolver(sun.cvode, sun.iteration);
  } else {
    sun.make_solver(system, Part::full);
    CVodeSetLinearSolver(sun.cvode, sun.solver, sun.J);
    CVodeSetJacFn(sun.cvode, sun_jacobian);
  }
  CVodeSetStopTime(sun.cvode, t_end);
  double t;
  const int flag = CVode(sun.cvode, t_end, sun.y, &t, CV_NORMAL);
  long steps = 0;
  CVodeGetNumSteps(sun.cvode, &steps);
  return sun.outcome(system, flag, steps);
}

// A table of SUNDIALS made of a tableau; with `check`, the conditions of order that it and this program know
// must hold. Without, the time of a last stage at the end of the step that is not the new solution is moved:
// ERKStep 6.4 takes such a stage's slope for that of the solution (one evaluation a step too few, and the
// order lost), and nothing here depends on t.
inline ARKodeButcherTable table_of(const Tableau& t, bool check = false) {
  std::vector<double> A = t.A, b = t.b, c = t.c(), d = t.embedded;
  if (!check && !std::equal(b.begin(), b.end(), A.end() - t.stages)) c.back() = std::min(c.back(), 0.875);
  ARKodeButcherTable table =
      ARKodeButcherTable_Create(t.stages, t.order, t.embedded_order, c.data(), A.data(), b.data(), d.data());
  if (!table) throw Failure("SUNDIALS takes no table of " + std::to_string(t.stages) + " stages");
  if (!check) return table;
  int q = 0, p = 0;
  if (ARKodeButcherTable_CheckOrder(table, &q, &p, nullptr) < 0 || q < std::min(t.order, 6) ||
      p < std::min(t.embedded_order, 6) || violation(t, t.b, t.order) > 1e-13 ||
      violation(t, t.embedded, t.embedded_order) > 1e-13)
    throw Failure("a table of order " + std::to_string(t.order) + " does not have it");
  return table;
}

inline Tableau tableau_of(ARKODE_ERKTableID number) {
  ARKodeButcherTable table = ARKodeButcherTable_LoadERK(number);
  const auto s = std::size_t(table->stages);
  Tableau t{table->stages, table->q, table->p, {}, {table->b, table->b + s}, {table->d, table->d + s}};
  for (std::size_t i = 0; i < s; ++i) t.A.insert(t.A.end(), table->A[i], table->A[i] + s);
  ARKodeButcherTable_Free(table);
  return t;
}

// `held`: steps are kept within what the waves allow. Where a step beyond that is once accepted, its noise,
// which waves do not lose, holds ARKODE's error control at a tenth of that from then on; where friction damps
// waves, steps may be longer.
inline Outcome arkode_explicit(System& system, double t_end, double tolerance, const Tableau& tableau,
                               bool held = false) {
  Sun sun(system);
  Parts parts{&system, Part::full, Part::full};
  sun.erk = ERKStepCreate(sun_rhs<false>, 0, sun.y, sun.context);
  ERKStepSStolerances(sun.erk, tolerance, tolerance);
  ERKStepSetUserData(sun.erk, &parts);
  ERKStepSetMaxNumSteps(sun.erk, most_steps);
  ERKStepSetErrFile(sun.erk, nullptr);
  ARKodeButcherTable table = table_of(tableau);
  ERKStepSetTable(sun.erk, table);
  ARKodeButcherTable_Free(table);
  if (held) ERKStepSetMaxStep(sun.erk, 0.7 * reach(tableau) / stencil_rate(system.scene));
  ERKStepSetStopTime(sun.erk, t_end);
  double t;
  const int flag = ERKStepEvolve(sun.erk, t_end, sun.y, &t, ARK_NORMAL);
  long steps = 0;
  ERKStepGetNumSteps(sun.erk, &steps);
  return sun.outcome(system, flag, steps);
}

struct ImexTables {
  ARKODE_DIRKTableID implicit;
  ARKODE_ERKTableID explicit_;
};
inline Outcome arkode_implicit(System& system, double t_end, double tolerance, const ImexTables& tables,
                               Implicit implicit) {
  Sun sun(system);
  Parts parts{&system, Part::full, Part::full};
  if (implicit == Implicit::friction) parts = {&system, Part::stencil, Part::pointwise};
  if (implicit == Implicit::wave) parts = {&system, Part::reaction, Part::wave};
  const bool all = implicit == Implicit::both;
  sun.ark = ARKStepCreate(all ? nullptr : sun_rhs<false>, sun_rhs<true>, 0, sun.y, sun.context);
  ARKStepSStolerances(sun.ark, tolerance, tolerance);
  ARKStepSetUserData(sun.ark, &parts);
  ARKStepSetMaxNumSteps(sun.ark, most_steps);
  ARKStepSetErrFile(sun.ark, nullptr);
  ARKStepSetTableNum(sun.ark, tables.implicit, all ? ARKODE_ERK_NONE : tables.explicit_);
  sun.make_solver(system, parts.implicit_part);
  ARKStepSetLinearSolver(sun.ark, sun.solver, sun.J);
  ARKStepSetJacFn(sun.ark, sun_jacobian);
  if (implicit == Implicit::wave) ARKStepSetLinear(sun.ark, 0);
  ARKStepSetStopTime(sun.ark, t_end);
  double t;
  const int flag = ARKStepEvolve(sun.ark, t_end, sun.y, &t, ARK_NORMAL);
  long steps = 0;
  ARKStepGetNumSteps(sun.ark, &steps);
  return sun.outcome(system, flag, steps);
}

}  // namespace peers
