#include "time/rosenbrock.hpp"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "stickslip/base/error.hpp"
#include "stickslip/base/handle.hpp"

namespace stickslip {

namespace {

// M Gamma^-1 for M of so many rows; Gamma is lower triangular.
std::vector<double> times_inverse(std::vector<double> M, const std::vector<double>& Gamma, int stages) {
  const std::size_t s = stages;
  for (std::size_t row = 0; row < M.size(); row += s)
    for (std::size_t j = s; j-- > 0;) {
      for (std::size_t k = j + 1; k < s; ++k) M[row + j] -= M[row + k] * Gamma[k * s + j];
      M[row + j] /= Gamma[j * s + j];
    }
  return M;
}

// In w.
StageProgram transformed(const RosenbrockW& m) {
  const auto in_w = [&](const std::vector<double>& rows) { return times_inverse(rows, m.Gamma, m.stages); };
  return {m.stages, in_w(m.A), in_w(m.b), in_w(m.embedded)};
}

int factor_columns(const Model& model) { return model.dof() == 3 ? 2 : 1; }

}  // namespace

const RosenbrockW& rosenbrock_w(const std::string& name) {
  // Rang and Angermann, BIT 45 (2005) 761: ROS34PW2, of order 3 and L-stable; its estimate is that of order
  // 2.
  constexpr double g = 4.3586652150845900e-01;
  static const RosenbrockW ra34pw2 = {
      "ra34pw2",
      4,
      3,
      {0, 0, 0, 0, 8.7173304301691801e-01, 0, 0, 0, 8.4457060015369423e-01, -1.1299064236484185e-01, 0, 0, 0,
       0, 1, 0},
      {g, 0, 0, 0, -8.7173304301691801e-01, g, 0, 0, -9.0338057013044082e-01, 5.4180672388095326e-02, g, 0,
       2.4212380706095346e-01, -1.2232505839045147e+00, 5.4526025533510214e-01, g},
      {2.4212380706095346e-01, -1.2232505839045147e+00, 1.5452602553351020e+00, g},
      {3.7810903145819369e-01, -9.6042292212423178e-02, 0.5, 2.1793326075422950e-01}};
  if (name != ra34pw2.name)
    throw std::logic_error("rosw " + name + ": its order asks for the whole Jacobian");
  return ra34pw2;
}

// A step of length 1 of u' = 1, in which every k is 1: its stages, as the library has them, are w = Gamma k,
// and k where the stage is explicit, for which it asks for the Jacobian alone.
std::vector<double> rosenbrock_rates(const std::string& subtype) {
  struct Probe {
    std::vector<double> rates;
    bool stage_is_explicit = false;
    static PetscErrorCode IFunction(TS, PetscReal, Vec, Vec udot, Vec f, void*) {
      return guarded([&] {
        SS_TRY(VecCopy(udot, f));
        SS_TRY(VecShift(f, -1));
      });
    }
    static PetscErrorCode IJacobian(TS, PetscReal, Vec, Vec, PetscReal shift, Mat, Mat J, void* probe) {
      return guarded([&] {
        static_cast<Probe*>(probe)->stage_is_explicit = shift == 0;
        SS_TRY(MatSetValue(J, 0, 0, shift, INSERT_VALUES));
        SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
        SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
      });
    }
    static PetscErrorCode PostStage(TS ts, PetscReal, PetscInt index, Vec* stages) {
      return guarded([&] {
        void* context;
        double sum;
        SS_TRY(TSGetApplicationContext(ts, &context));
        SS_TRY(VecSum(stages[index], &sum));
        auto& probe = *static_cast<Probe*>(context);
        probe.rates.push_back(std::exchange(probe.stage_is_explicit, false) ? 0 : sum);
      });
    }
  };
  Probe probe;
  TsHandle ts;
  VecHandle u;
  MatHandle J;
  TSAdapt adapt;
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, 1, u.out()));
  SS_TRY(MatCreateSeqDense(PETSC_COMM_SELF, 1, 1, nullptr, J.out()));
  SS_TRY(TSCreate(PETSC_COMM_SELF, ts.out()));
  SS_TRY(TSSetType(ts, TSROSW));
  SS_TRY(TSRosWSetType(ts, subtype.c_str()));
  SS_TRY(TSSetApplicationContext(ts, &probe));
  SS_TRY(TSSetIFunction(ts, nullptr, Probe::IFunction, nullptr));
  SS_TRY(TSSetIJacobian(ts, J, J, Probe::IJacobian, &probe));
  SS_TRY(TSSetPostStage(ts, Probe::PostStage));
  SS_TRY(TSGetAdapt(ts, &adapt));
  SS_TRY(TSAdaptSetType(adapt, TSADAPTNONE));
  SS_TRY(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_STEPOVER));
  SS_TRY(TSSetMaxTime(ts, 10));
  SS_TRY(TSSetTimeStep(ts, 1));
  SS_TRY(TSSetSolution(ts, u));
  SS_TRY(TSStep(ts));
  return probe.rates;
}

RosenbrockStep::RosenbrockStep(const Model& model, const RosenbrockW& method, bool sticking)
    : TiledStep(model, transformed(method), sticking, factor_columns(model)), gamma_(method.Gamma[0]),
      tangents_(tile::tangents(model.scene(), sticking, tiles_.places())) {
  const std::size_t s = method.stages;
  std::vector<double> C(s * s);
  for (std::size_t i = 0; i < s; ++i) {
    stages_[i].time = std::accumulate(&method.A[i * s], &method.A[i * s] + s, 0.);
    stages_[i].rate = std::accumulate(&method.Gamma[i * s], &method.Gamma[i * s] + s, 0.);
    stages_[i].used = true;  // in C if not in A'
    C[i * s + i] = -1;
  }
  C = times_inverse(C, method.Gamma, method.stages);
  for (std::size_t i = 0; i < s; ++i) {
    before_.emplace_back();
    add_to_row(before_.back(), &C[i * s], int(i), slopes_from);
  }
}

// J and the factors, on all nodes of the tile that a stage takes.
long RosenbrockStep::prepare(const Tile& t, const Step& step) const {
  const auto [begin, end] = around(t, explicit_slopes(step.all) - 1);
  const PetscInt count = end - begin;
  const bool has_state = tiles_.dof() == 3;
  double *const inverse = at(t, others_, 0, begin), *const q_of = at(t, others_, 1, begin);
  double* const of_state = has_state ? at(t, others_, 2, begin) : nullptr;
  double* const own = has_state ? at(t, others_ + 1, 0, begin) : nullptr;
  double* const follows = has_state ? at(t, others_ + 1, 1, begin) : nullptr;
  const double* const direction = tiles_.direction(begin);
  tangents_(kernel::Tangents{at(t, 0, 0, begin), has_state ? at(t, 0, 2, begin) : nullptr,
                             tiles_.amplitude(begin), direction, inverse, of_state, follows, own, count,
                             tiles_.number(begin)});
  const kernel::Coefficients& c = coefficients_;
  const double theta = gamma_ * step.dt, q = theta * c.A / (1 + theta * c.s_delta);
  const double a = 1 + theta * c.A * c.B + q * theta * c.K0;
  long unsolved = 0;
  for (PetscInt i = 0; i < count; ++i) {
    const bool moves = !direction || direction[i] != 0;
    double slope = inverse[i];
    if (has_state) {
      own[i] = 1 / (1 - theta * own[i]);
      follows[i] *= theta * own[i];
      slope += of_state[i] * follows[i];
      of_state[i] *= moves ? q * own[i] : 0;
    }
    const double factor = moves ? a + q * slope : 1;
    q_of[i] = moves ? q : 0;
    inverse[i] = 1 / factor;
    unsolved += factor > 0 ? 0 : 1;
  }
  tiles_.for_held(begin, end, [&](PetscInt node) {
    *at(t, others_, 0, node) = 1;
    *at(t, others_, 1, node) = 0;
    if (has_state) *at(t, others_, 2, node) = 0;
  });
  return step.estimate ? unsolved : 0;
}

// The slope f of stage i becomes w_i.
void RosenbrockStep::finish_stage(const Tile& t, int i, const Step& step, PetscInt begin,
                                  PetscInt end) const {
  const int w = slopes_from + i, dof = tiles_.dof();
  for (int d = 0; d < dof && i > 0; ++d)
    tiles_.sum(t, d, tiles_.column(w, d), before_[i], 1, begin, end, tiles_.column(w, d));
  const kernel::Coefficients& c = coefficients_;
  const double gamma = gamma_, theta = gamma * step.dt, per_A = c.s_delta / c.A;
  const double pull = theta * (c.K0 + c.s_delta * c.B);  // what w_psi does to eta
  double *const psi = at(t, w, 0, begin), *const eta = at(t, w, 1, begin);
  double* const state = dof == 3 ? at(t, w, 2, begin) : nullptr;
  const double *const inverse = at(t, others_, 0, begin), *const q = at(t, others_, 1, begin);
  const double* const of_state = state ? at(t, others_, 2, begin) : nullptr;
#pragma GCC ivdep
  for (PetscInt j = 0; j < end - begin; ++j) {
    double known = psi[j] + q[j] * eta[j];
    if (state) known -= of_state[j] * state[j];
    const double r_psi = gamma * psi[j], w_psi = gamma * known * inverse[j];
    psi[j] = w_psi;
    // eta - F, linearised, as psi's own equation has it
    eta[j] = gamma * eta[j] - pull * w_psi - per_A * (w_psi - r_psi);
  }
  if (!state) return;
  const double *const own = at(t, others_ + 1, 0, begin), *const follows = at(t, others_ + 1, 1, begin);
#pragma GCC ivdep
  for (PetscInt j = 0; j < end - begin; ++j) state[j] = gamma * state[j] * own[j] + follows[j] * psi[j];
}

}  // namespace stickslip
