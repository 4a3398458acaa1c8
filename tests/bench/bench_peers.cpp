// Time to accuracy beside SUNDIALS: CVODE (Adams, BDF) and ARKODE (explicit, implicit and IMEX Runge-Kutta) advance the
// same semi-discrete systems, with this program's own loops as their right-hand side, so that integrators are compared
// and nothing else.
//
//     cmake --build build --target bench_peers && build/tests/bench_peers
//     python3 tests/bench/peers.py build/tests/bench_peers      # the same and SciPy, as one table
//
// Three scenes: a smooth ring; stiff friction (gamma 300) and stiff coupling (c 100) between free ends, where the
// Jacobian is banded, so that SUNDIALS can use its banded solver with Jacobians written by hand.
// Errors are the largest over psi and eta of all nodes at the end, against a solution of order 8 with tolerance 1e-13,
// whose own error is taken as its distance from ARKODE's order 8 at the same tolerance. Every method
// goes down in tolerance by factors of sqrt(10) until it has each accuracy; that run is then repeated and the median of
// the processor times kept, everything (set-up, factors) included. Relative and absolute tolerance are equal.
// Options: -peers_repeat [5], -peers_out DIR (for peers.py: start, end and rows in files).
#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <slepcsys.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>

#include "bench.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/time/time.hpp"

using namespace stickslip;

namespace {

struct Case {
  std::string name;
  Scene scene;
  double t_end;
};

std::vector<Case> cases() {
  Scene ring;
  ring.n = 2048;
  Scene friction;
  friction.gamma = 300;
  friction.n = 512;
  friction.left = friction.right = End::free;
  Scene coupling = friction;
  coupling.gamma = 3;
  coupling.c = 100;
  return {{"smooth ring", ring, 10}, {"stiff friction", friction, 60}, {"stiff coupling", coupling, 10}};
}

// One scene's system on arrays.
class System {
 public:
  explicit System(const Scene& s)
      : scene(s), model(PETSC_COMM_SELF, s), size(model.dof() * s.n), u_(model.create_vector()),
        f_(model.create_vector()) {
    for (PetscInt i = 0; i < s.n; ++i) {
      const double angle = 2 * M_PI * s.x(i) / s.length;
      start.push_back(0.1 + 0.5 * (s.ring() ? std::sin(angle) : std::cos(angle)));
      start.push_back(0.1);
    }
  }
  void rhs(Part part, const double* u, double* f) {
    ++evaluations;
    SS_TRY(VecPlaceArray(u_, u));
    SS_TRY(VecPlaceArray(f_, f));
    model.rhs(part, u_, f_);
    SS_TRY(VecResetArray(f_));
    SS_TRY(VecResetArray(u_));
  }
  // Entries of d(rhs part)/du by rows: add(row, column, value).
  template <class Add>
  void jacobian(Part part, const double* u, const Add& add) {
    const Scene& s = scene;
    const bool wave = part != Part::reaction, friction = part != Part::wave, coupled = part == Part::full || part == Part::wave;
    if (rows_.empty())
      for (PetscInt i = 0; i < s.n; ++i) rows_.push_back(second_difference_row(s, i));
    for (PetscInt i = 0; i < s.n; ++i) {
      const PetscInt psi = 2 * i, eta = psi + 1;
      const double slope = friction ? u[psi] * u[psi] - 1 : 0;
      add(psi, psi, -s.A() * slope);
      add(psi, eta, wave ? s.A() : 0);
      add(eta, eta, wave ? -s.s_delta() : 0);
      add(eta, psi, (wave ? -s.K0() : 0) + s.s_delta() * slope);
      if (coupled)
        for (const auto& [node, weight] : rows_[std::size_t(i)]) add(eta, 2 * node, s.K1() * weight);
    }
  }

  Scene scene;
  Model model;
  PetscInt size;
  std::vector<double> start;
  long evaluations = 0;

 private:
  VecHandle u_, f_;
  std::vector<Combination> rows_;
};

struct Outcome {
  bool done = false;
  std::vector<double> u;
  long steps = 0, evaluations = 0;
};

struct Method {
  std::string library, name;
  bool implicit_only_where_banded;  // not on the ring
  std::function<Outcome(System&, double t_end, double tolerance)> run;
};

// ---- this program ----

Outcome ours(System& system, double t_end, double tolerance, const std::string& type, const std::string& subtype,
             const std::string& implicit) {
  const std::string p = "-peer_", text = number_text(tolerance);
  std::map<std::string, std::string> set{{"ts_type", type}, {"ts_rtol", text}, {"ts_atol", text}};
  if (!subtype.empty()) set[subtype_option(type)] = subtype;
  for (const auto& [name, value] : set) SS_TRY(PetscOptionsSetValue(nullptr, (p + name).c_str(), value.c_str()));
  Options options;
  if (!implicit.empty()) options = options.with("imex_implicit", implicit);
  Outcome out;
  VecHandle u = system.model.create_vector();
  double* a;
  SS_TRY(VecGetArray(u, &a));
  std::copy(system.start.begin(), system.start.end(), a);
  SS_TRY(VecRestoreArray(u, &a));
  try {
    Integrator integrator(system.model, MethodSpec::from(options), u, "peer_");
    const TimeReport r =
        integrator.advance(u, 0, t_end, [](const Integrator::Step&) { return Integrator::Verdict::go_on; });
    SS_TRY(VecGetArray(u, &a));
    out = {true, std::vector<double>(a, a + system.size), long(r.steps), r.rhs_evaluations};
    SS_TRY(VecRestoreArray(u, &a));
  } catch (const Error&) {  // diverged, or not finite
  }
  for (const auto& [name, value] : set) SS_TRY(PetscOptionsClearValue(nullptr, (p + name).c_str()));
  return out;
}

// ---- SUNDIALS ----

struct Parts {
  System* system;
  Part explicit_part, implicit_part;
};
template <bool implicit>
int sun_rhs(realtype, N_Vector y, N_Vector f, void* data) {
  const Parts& p = *static_cast<Parts*>(data);
  p.system->rhs(implicit ? p.implicit_part : p.explicit_part, N_VGetArrayPointer(y), N_VGetArrayPointer(f));
  return 0;
}
int sun_jacobian(realtype, N_Vector y, N_Vector, SUNMatrix J, void* data, N_Vector, N_Vector, N_Vector) {
  const Parts& p = *static_cast<Parts*>(data);
  SUNMatZero(J);
  p.system->jacobian(p.implicit_part, N_VGetArrayPointer(y),
                     [&](PetscInt row, PetscInt column, double value) { SM_ELEMENT_B(J, row, column) += value; });
  return 0;
}

// Debian compiles SUNDIALS without optimisation. Its vectors and matrices are made to be replaced, so that what takes
// the time is given to it compiled as the rest of this program; banded systems are solved by LAPACK in place.
template <class Body>
void for_all(N_Vector z, const Body& body) {
  const sunindextype n = N_VGetLength(z);
  double* const out = N_VGetArrayPointer(z);
  for (sunindextype i = 0; i < n; ++i) out[i] = body(i);
}
void fast_sum(double a, N_Vector x, double b, N_Vector y, N_Vector z) {
  const double *p = N_VGetArrayPointer(x), *q = N_VGetArrayPointer(y);
  for_all(z, [=](sunindextype i) { return a * p[i] + b * q[i]; });
}
int fast_combination(int count, double* c, N_Vector* X, N_Vector z) {
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
int fast_add_multi(int count, double* a, N_Vector x, N_Vector* Y, N_Vector* Z) {
  for (int k = 0; k < count; ++k) fast_sum(a[k], x, 1, Y[k], Z[k]);
  return 0;
}
double fast_wrms(N_Vector x, N_Vector w) {
  const sunindextype n = N_VGetLength(x);
  const double *p = N_VGetArrayPointer(x), *q = N_VGetArrayPointer(w);
  double sum[4] = {0, 0, 0, 0};
  sunindextype i = 0;
  for (; i + 4 <= n; i += 4)
    for (int k = 0; k < 4; ++k) sum[k] += (p[i + k] * q[i + k]) * (p[i + k] * q[i + k]);
  for (; i < n; ++i) sum[0] += (p[i] * q[i]) * (p[i] * q[i]);
  return std::sqrt((sum[0] + sum[1] + sum[2] + sum[3]) / double(n));
}
void make_fast(N_Vector y) {
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

extern "C" {
void dgbtrf_(const int* m, const int* n, const int* kl, const int* ku, double* ab, const int* ldab, int* pivots,
             int* info);
void dgbtrs_(const char* trans, const int* n, const int* kl, const int* ku, const int* columns, const double* ab,
             const int* ldab, const int* pivots, double* b, const int* ldb, int* info);
}
std::vector<int> pivots;  // of the one factorisation alive

void make_fast(SUNMatrix J, SUNLinearSolver solver) {
  J->ops->zero = [](SUNMatrix A) {
    std::fill(SM_DATA_B(A), SM_DATA_B(A) + SM_LDATA_B(A), 0.);
    return SUNMAT_SUCCESS;
  };
  J->ops->copy = [](SUNMatrix A, SUNMatrix B) {
    std::copy(SM_DATA_B(A), SM_DATA_B(A) + SM_LDATA_B(A), SM_DATA_B(B));
    return SUNMAT_SUCCESS;
  };
  J->ops->scaleaddi = [](double c, SUNMatrix A) {
    double* const data = SM_DATA_B(A);
    for (sunindextype i = 0; i < SM_LDATA_B(A); ++i) data[i] *= c;
    for (sunindextype j = 0; j < SM_COLUMNS_B(A); ++j) data[j * SM_LDIM_B(A) + SM_SUBAND_B(A)] += 1;
    return SUNMAT_SUCCESS;
  };
  solver->ops->setup = [](SUNLinearSolver, SUNMatrix A) {
    const int n = int(SM_COLUMNS_B(A)), lower = int(SM_LBAND_B(A)), upper = int(SM_UBAND_B(A));
    const int rows = int(SM_LDIM_B(A));
    int info;
    pivots.resize(std::size_t(n));
    dgbtrf_(&n, &n, &lower, &upper, SM_DATA_B(A), &rows, pivots.data(), &info);
    return info;
  };
  solver->ops->solve = [](SUNLinearSolver, SUNMatrix A, N_Vector x, N_Vector b, double) {
    const int n = int(SM_COLUMNS_B(A)), lower = int(SM_LBAND_B(A)), upper = int(SM_UBAND_B(A));
    const int rows = int(SM_LDIM_B(A));
    int one = 1, info;
    if (x != b) N_VScale(1, b, x);
    dgbtrs_("N", &n, &lower, &upper, &one, SM_DATA_B(A), &rows, pivots.data(), N_VGetArrayPointer(x), &n, &info);
    return info;
  };
}

// What every run of SUNDIALS needs; freed in the right order.
struct Sun {
  SUNContext context = nullptr;
  N_Vector y = nullptr;
  SUNMatrix J = nullptr;
  SUNLinearSolver solver = nullptr;
  SUNNonlinearSolver iteration = nullptr;
  void *cvode = nullptr, *ark = nullptr, *erk = nullptr;
  explicit Sun(const System& system) {
    if (SUNContext_Create(nullptr, &context) != 0) throw Failure("SUNDIALS: no context");
    y = N_VNew_Serial(system.size, context);
    make_fast(y);
    std::copy(system.start.begin(), system.start.end(), N_VGetArrayPointer(y));
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
  void make_banded(const System& system, Part part) {
    const sunindextype reach = part == Part::full || part == Part::wave ? system.scene.order + 1 : 1;
    J = SUNBandMatrix(system.size, reach, reach, context);
    solver = SUNLinSol_Band(y, J, context);
    make_fast(J, solver);
  }
  Outcome outcome(const System& system, int flag, long steps) const {
    const double* a = N_VGetArrayPointer(y);
    return {flag >= 0, std::vector<double>(a, a + system.size), steps, system.evaluations};
  }
};

Outcome cvode(System& system, double t_end, double tolerance, int family) {
  Sun sun(system);
  Parts parts{&system, Part::full, Part::full};
  system.evaluations = 0;
  sun.cvode = CVodeCreate(family, sun.context);
  CVodeInit(sun.cvode, sun_rhs<true>, 0, sun.y);
  CVodeSStolerances(sun.cvode, tolerance, tolerance);
  CVodeSetUserData(sun.cvode, &parts);
  CVodeSetMaxNumSteps(sun.cvode, 10000000);
  CVodeSetErrFile(sun.cvode, nullptr);
  if (family == CV_ADAMS) {
    sun.iteration = SUNNonlinSol_FixedPoint(sun.y, 0, sun.context);
    CVodeSetNonlinearSolver(sun.cvode, sun.iteration);
  } else {
    sun.make_banded(system, Part::full);
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

Outcome arkode_explicit(System& system, double t_end, double tolerance, ARKODE_ERKTableID table) {
  Sun sun(system);
  Parts parts{&system, Part::full, Part::full};
  system.evaluations = 0;
  sun.erk = ERKStepCreate(sun_rhs<false>, 0, sun.y, sun.context);
  ERKStepSStolerances(sun.erk, tolerance, tolerance);
  ERKStepSetUserData(sun.erk, &parts);
  ERKStepSetMaxNumSteps(sun.erk, 10000000);
  ERKStepSetErrFile(sun.erk, nullptr);
  ERKStepSetTableNum(sun.erk, table);
  ERKStepSetStopTime(sun.erk, t_end);
  double t;
  const int flag = ERKStepEvolve(sun.erk, t_end, sun.y, &t, ARK_NORMAL);
  long steps = 0;
  ERKStepGetNumSteps(sun.erk, &steps);
  return sun.outcome(system, flag, steps);
}

Outcome arkode_implicit(System& system, double t_end, double tolerance, int order, Implicit implicit) {
  Sun sun(system);
  Parts parts{&system, Part::full, Part::full};
  if (implicit == Implicit::friction) parts = {&system, Part::stencil, Part::pointwise};
  if (implicit == Implicit::wave) parts = {&system, Part::reaction, Part::wave};
  system.evaluations = 0;
  sun.ark = ARKStepCreate(implicit == Implicit::both ? nullptr : sun_rhs<false>, sun_rhs<true>, 0, sun.y, sun.context);
  ARKStepSStolerances(sun.ark, tolerance, tolerance);
  ARKStepSetUserData(sun.ark, &parts);
  ARKStepSetMaxNumSteps(sun.ark, 10000000);
  ARKStepSetErrFile(sun.ark, nullptr);
  ARKStepSetOrder(sun.ark, order);
  sun.make_banded(system, parts.implicit_part);
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

std::vector<Method> methods() {
  std::vector<Method> all;
  for (const std::string rk : {"3bs", "5dp", "6vr", "7vr", "8vr"})
    all.push_back({"stickslip", "rk:" + rk, false, [rk](System& s, double t, double tol) {
                     return ours(s, t, tol, "rk", rk, "");
                   }});
  for (const std::string rosw : {"ra34pw2", "4l", "rodas3"})
    all.push_back({"stickslip", "rosw:" + rosw, true, [rosw](System& s, double t, double tol) {
                     return ours(s, t, tol, "rosw", rosw, "");
                   }});
  for (const std::string order : {"3", "4", "5"})
    for (const std::string implicit : {"friction", "wave", "both"})
      all.push_back({"stickslip", "arkimex:" + order + ":" + implicit, true, [=](System& s, double t, double tol) {
                       return ours(s, t, tol, "arkimex", order, implicit);
                     }});
  const std::map<std::string, ARKODE_ERKTableID> explicit_tables{{"3 Bogacki-Shampine", ARKODE_BOGACKI_SHAMPINE_4_2_3},
                                                                 {"4 Zonneveld", ARKODE_ZONNEVELD_5_3_4},
                                                                 {"5 Cash-Karp", ARKODE_CASH_KARP_6_4_5},
                                                                 {"5 Dormand-Prince", ARKODE_DORMAND_PRINCE_7_4_5},
                                                                 {"6 Verner", ARKODE_VERNER_8_5_6},
                                                                 {"8 Fehlberg", ARKODE_FEHLBERG_13_7_8}};
  for (const auto& [name, table] : explicit_tables)
    all.push_back({"SUNDIALS", "ERK " + name, false, [table = table](System& s, double t, double tol) {
                     return arkode_explicit(s, t, tol, table);
                   }});
  for (const int family : {CV_ADAMS, CV_BDF})
    all.push_back({"SUNDIALS", family == CV_BDF ? "BDF" : "Adams", family == CV_BDF,
                   [=](System& s, double t, double tol) { return cvode(s, t, tol, family); }});
  for (const int order : {3, 4, 5})
    for (const Implicit implicit : {Implicit::friction, Implicit::wave, Implicit::both})
      all.push_back({"SUNDIALS", (implicit == Implicit::both ? "DIRK " : "ARK ") + std::to_string(order) +
                                     (implicit == Implicit::both ? "" : ":" + to_string(implicit)),
                     true,
                     [=](System& s, double t, double tol) { return arkode_implicit(s, t, tol, order, implicit); }});
  return all;
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(a[i])) return HUGE_VAL;
    largest = std::max(largest, std::abs(a[i] - b[i]));
  }
  return largest;
}

void write_doubles(const std::string& path, const std::vector<double>& values) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(values.data()), std::streamsize(values.size() * sizeof(double)));
}

void run() {
  PetscInt repeat = 5;
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-peers_repeat", &repeat, nullptr));
  char folder[512] = "";
  SS_TRY(PetscOptionsGetString(nullptr, nullptr, "-peers_out", folder, sizeof folder, nullptr));
  const std::vector<double> targets{1e-4, 1e-6, 1e-9};
  const double longest = 1;  // second of one run, after which a method goes no further
  std::ofstream rows;
  if (*folder) rows.open(std::string(folder) + "/rows.tsv");
  SS_TRY(PetscPrintf(PETSC_COMM_WORLD, "# %d repeats, processor time; flags: %s\n", int(repeat), STICKSLIP_FLAGS));
  int number = 0;
  for (const Case& c : cases()) {
    System system(c.scene);
    const Outcome reference = ours(system, c.t_end, 1e-13, "rk", "8vr", "");
    const Outcome other = arkode_explicit(system, c.t_end, 1e-13, ARKODE_FEHLBERG_13_7_8);
    if (!reference.done || !other.done) throw Failure(c.name + ": no reference");
    std::printf("\n%s: n %d, t %g; reference to %.0e\n", c.name.c_str(), int(c.scene.n), c.t_end,
                distance(reference.u, other.u));
    std::printf("%-10s %-24s %8s %9s %10s %8s %8s\n", "library", "method", "target", "tol", "error", "steps", "ms");
    if (*folder) {
      const std::string stem = std::string(folder) + "/" + std::to_string(number);
      write_doubles(stem + ".start", system.start);
      write_doubles(stem + ".end", reference.u);
    }
    for (const Method& m : methods()) {
      if (m.implicit_only_where_banded && c.scene.ring()) continue;
      double tolerance = 1e-2;
      for (const double target : targets) {
        double error = HUGE_VAL, first = 0;
        Outcome out;
        while (tolerance > 3e-15 && first < longest) {
          const double begin = bench::now(true);
          out = m.run(system, c.t_end, tolerance);
          first = bench::now(true) - begin;
          error = out.done ? distance(out.u, reference.u) : HUGE_VAL;
          if (error <= target) break;
          tolerance /= std::sqrt(10.);
        }
        if (!(error <= target)) break;
        std::vector<double> seconds;
        for (PetscInt k = 0; k < (first > 1 ? 1 : repeat); ++k) {
          const double begin = bench::now(true);
          m.run(system, c.t_end, tolerance);
          seconds.push_back(bench::now(true) - begin);
        }
        std::sort(seconds.begin(), seconds.end());
        const double median = seconds[seconds.size() / 2];
        std::printf("%-10s %-24s %8.0e %9.1e %10.1e %8ld %8.2f\n", m.library.c_str(), m.name.c_str(), target, tolerance,
                    error, out.steps, 1e3 * median);
        std::fflush(stdout);
        if (rows.is_open())
          rows << number << '\t' << m.library << '\t' << m.name << '\t' << target << '\t' << error << '\t' << median
               << std::endl;
      }
    }
    ++number;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (SlepcInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  install_error_handler();
  try {
    run();
  } catch (const std::exception& e) {
    (void)PetscPrintf(PETSC_COMM_WORLD, "bench_peers: %s\n", e.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
  return SlepcFinalize() ? 1 : 0;
}
