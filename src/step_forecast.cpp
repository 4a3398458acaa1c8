#include "step_forecast.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include "stickslip/error.hpp"

namespace stickslip {

SpectralBounds spectral_bounds(int dim, const std::vector<double>& m) {
  // lambda^3 - t lambda^2 + c lambda - d (with one root 0 for dim 2), its roots by Durand and Kerner's iteration
  double t, c, d = 0;
  if (dim == 2) {
    t = m[0] + m[3];
    c = m[0] * m[3] - m[1] * m[2];
  } else {
    t = m[0] + m[4] + m[8];
    c = m[0] * m[4] - m[1] * m[3] + m[0] * m[8] - m[2] * m[6] + m[4] * m[8] - m[5] * m[7];
    d = m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]);
  }
  if (dim == 2) {
    const std::complex<double> root = std::sqrt(std::complex<double>(t * t / 4 - c));
    return {t / 2 + root.real(), std::max(std::abs(t / 2 + root), std::abs(t / 2 - root))};
  }
  const double size = std::max({std::abs(t), std::sqrt(std::abs(c)), std::cbrt(std::abs(d)), 1e-300});
  std::complex<double> z[3] = {{size, 0}, {0.4 * size, 0.9 * size}, {-0.65 * size, 0.72 * size}};
  for (int round = 0; round < 200; ++round)
    for (int i = 0; i < 3; ++i) {
      const std::complex<double> value = ((z[i] - t) * z[i] + c) * z[i] - d;
      const std::complex<double> others = (z[i] - z[(i + 1) % 3]) * (z[i] - z[(i + 2) % 3]);
      if (std::abs(others) > 0) z[i] -= value / others;
    }
  return {std::max({z[0].real(), z[1].real(), z[2].real()}),
          std::max({std::abs(z[0]), std::abs(z[1]), std::abs(z[2])})};
}

namespace {

// F and the state's kinetics where the slope dF/dpsi is least and largest over all nodes and ranks.
struct Extremes {
  double F_psi, F_state, g_psi, g_state;
};

std::vector<Extremes> friction_extremes(const Model& model, Vec u) {
  const double* a;
  const int dof = model.dof();
  Extremes found[2] = {{HUGE_VAL, 0, 0, 0}, {-HUGE_VAL, 0, 0, 0}};
  SS_TRY(VecGetArrayRead(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double psi = a[i * dof], state = dof == 3 ? a[i * dof + 2] : 0;
    const Partials p = model.friction(i, psi, state);
    const RatePartials g = model.state_rate(psi, state);
    const Extremes here{p.F_psi, p.F_state, g.g_psi, g.g_state};
    if (here.F_psi < found[0].F_psi) found[0] = here;
    if (here.F_psi > found[1].F_psi) found[1] = here;
  }
  SS_TRY(VecRestoreArrayRead(u, &a));
  std::vector<Extremes> all;
  for (int side = 0; side < 2; ++side) {
    struct {
      double value;
      int rank;
    } best{side == 0 ? found[0].F_psi : -found[1].F_psi, 0};
    MPI_Comm_rank(model.comm(), &best.rank);
    MPI_Allreduce(MPI_IN_PLACE, &best, 1, MPI_DOUBLE_INT, MPI_MINLOC, model.comm());
    Extremes e = found[side];
    MPI_Bcast(&e, 4, MPI_DOUBLE, best.rank, model.comm());
    all.push_back(e);
  }
  return all;
}

}  // namespace

namespace {

// The method of `from`, without its monitors, viewers and error control.
void copy_method(TS from, const std::string& type, TS to) {
  SS_TRY(TSSetType(to, type.c_str()));
  const char* name = nullptr;
  if (type == TSRK) {
    SS_TRY(TSRKGetType(from, &name));
    SS_TRY(TSRKSetType(to, name));
  } else if (type == TSARKIMEX) {
    SS_TRY(TSARKIMEXGetType(from, &name));
    SS_TRY(TSARKIMEXSetType(to, name));
  } else if (type == TSROSW) {
    SS_TRY(TSRosWGetType(from, &name));
    SS_TRY(TSRosWSetType(to, name));
  } else if (type == TSSSP) {
    PetscInt stages;
    SS_TRY(TSSSPGetType(from, &name));
    SS_TRY(TSSSPGetNumStages(from, &stages));
    SS_TRY(TSSSPSetType(to, name));
    SS_TRY(TSSSPSetNumStages(to, stages));
  } else if (type == TSTHETA) {
    PetscReal theta;
    PetscBool endpoint;
    SS_TRY(TSThetaGetTheta(from, &theta));
    SS_TRY(TSThetaGetEndpoint(from, &endpoint));
    SS_TRY(TSThetaSetTheta(to, theta));
    SS_TRY(TSThetaSetEndpoint(to, endpoint));
  }
}

}  // namespace

StepForecast::StepForecast(const Model& model, Vec u, Implicit implicit, TS like) : dof_(model.dof()) {
  TSType now;
  SS_TRY(TSGetType(like, &now));
  const std::string type = now;
  if (type == TSBDF || type == TSALPHA) {
    propagates_ = false;
    return;
  }
  const Scene& s = model.scene();
  std::vector<Extremes> friction = friction_extremes(model, u);
  // Where sliding is unstable the cubic's motion reaches psi = 2, where its limit cycle turns, and a regularised
  // threshold is passed at its steepest.
  const bool oscillates = s.A() * (s.B() + friction[0].F_psi) + s.s_delta() < 0;
  if (oscillates && s.friction.law == Law::cubic) friction[1].F_psi = std::max(friction[1].F_psi, 3.);
  if (oscillates && s.friction.regularised) friction[1].F_psi = std::max(friction[1].F_psi, 1 / s.friction.eps);

  const double largest = s.n > 1 ? largest_symbol(s.order, s.form == Form::chain ? 1 : s.h()) : 0;
  for (const Extremes& f : friction)
    for (const double part : {0., 0.25, 0.5, 0.75, 1.}) {
      const auto d = static_cast<std::size_t>(dof_);
      std::vector<double> pointwise(d * d), stencil(d * d), reaction(d * d), wave(d * d);
      reaction[0] = -s.A() * f.F_psi;
      reaction[d] = s.s_delta() * f.F_psi;
      if (dof_ == 3) {
        reaction[2] = -s.A() * f.F_state;
        reaction[5] = s.s_delta() * f.F_state;
        reaction[6] = f.g_psi;
        reaction[8] = f.g_state;
      }
      stencil[d] = -s.K1() * largest * part;
      wave[0] = -s.A() * s.B();
      wave[1] = s.A();
      wave[d] = -s.K0() + stencil[d];
      wave[d + 1] = -s.s_delta();
      std::vector<double> full(d * d);
      for (std::size_t i = 0; i < d * d; ++i) {
        full[i] = wave[i] + reaction[i];
        pointwise[i] = full[i] - stencil[i];
      }
      const std::vector<double> zero(d * d);
      Wave w;
      w.growth = std::max(0., spectral_bounds(dof_, full).real_part);
      if (implicit == Implicit::none) w.explicit_part = full, w.implicit_part = zero;
      if (implicit == Implicit::both) w.explicit_part = zero, w.implicit_part = full;
      if (implicit == Implicit::friction) w.explicit_part = stencil, w.implicit_part = pointwise;
      if (implicit == Implicit::wave) w.explicit_part = reaction, w.implicit_part = wave;
      waves_.push_back(std::move(w));
    }

  const auto size = static_cast<PetscInt>(waves_.size()) * dof_ * dof_;
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, size, u_.out()));
  SS_TRY(TSCreate(PETSC_COMM_SELF, ts_.out()));
  copy_method(like, type, ts_);
  SS_TRY(TSSetProblemType(ts_, TS_NONLINEAR));
  if (implicit != Implicit::both) SS_TRY(TSSetRHSFunction(ts_, nullptr, RHSFunction, this));
  if (type != TSRK && type != TSSSP && type != TSEULER) {
    SS_TRY(TSSetIFunction(ts_, nullptr, IFunction, this));
    SS_TRY(MatCreateSeqBAIJ(PETSC_COMM_SELF, dof_, size, size, 1, nullptr, J_.out()));
    SS_TRY(TSSetIJacobian(ts_, J_, J_, IJacobian, this));
  }
  TSAdapt adapt;
  SS_TRY(TSGetAdapt(ts_, &adapt));
  SS_TRY(TSAdaptSetType(adapt, TSADAPTNONE));
  SS_TRY(TSSetExactFinalTime(ts_, TS_EXACTFINALTIME_STEPOVER));
  SS_TRY(TSSetMaxTime(ts_, 1e300));
  if (type != TSRK && type != TSSSP && type != TSEULER) {
    SNES snes;
    KSP ksp;
    PC pc;
    SS_TRY(TSGetSNES(ts_, &snes));
    SS_TRY(SNESSetType(snes, SNESKSPONLY));
    SS_TRY(SNESGetKSP(snes, &ksp));
    SS_TRY(KSPSetType(ksp, KSPPREONLY));
    SS_TRY(KSPGetPC(ksp, &pc));
    SS_TRY(PCSetType(pc, PCPBJACOBI));
  }
}

// The columns of a wave's propagator stand one behind the other: entry (wave, column, row).
PetscErrorCode StepForecast::RHSFunction(TS, PetscReal, Vec u, Vec f, void* context) {
  return guarded([&] {
    const auto& self = *static_cast<StepForecast*>(context);
    const double* a;
    double* b;
    SS_TRY(VecGetArrayRead(u, &a));
    SS_TRY(VecGetArrayWrite(f, &b));
    const int d = self.dof_;
    const double* at = a;
    double* out = b;
    for (const Wave& w : self.waves_)
      for (int column = 0; column < d; ++column, at += d, out += d)
        for (int row = 0; row < d; ++row) {
          out[row] = 0;
          for (int k = 0; k < d; ++k) out[row] += w.explicit_part[static_cast<std::size_t>(row * d + k)] * at[k];
        }
    SS_TRY(VecRestoreArrayWrite(f, &b));
    SS_TRY(VecRestoreArrayRead(u, &a));
  });
}

// udot - implicit part
PetscErrorCode StepForecast::IFunction(TS, PetscReal, Vec u, Vec udot, Vec f, void* context) {
  return guarded([&] {
    const auto& self = *static_cast<StepForecast*>(context);
    const double *a, *rate;
    double* b;
    SS_TRY(VecGetArrayRead(u, &a));
    SS_TRY(VecGetArrayRead(udot, &rate));
    SS_TRY(VecGetArrayWrite(f, &b));
    const int d = self.dof_;
    const double *at = a, *dot = rate;
    double* out = b;
    for (const Wave& w : self.waves_)
      for (int column = 0; column < d; ++column, at += d, dot += d, out += d)
        for (int row = 0; row < d; ++row) {
          out[row] = dot[row];
          for (int k = 0; k < d; ++k) out[row] -= w.implicit_part[static_cast<std::size_t>(row * d + k)] * at[k];
        }
    SS_TRY(VecRestoreArrayWrite(f, &b));
    SS_TRY(VecRestoreArrayRead(udot, &rate));
    SS_TRY(VecRestoreArrayRead(u, &a));
  });
}

PetscErrorCode StepForecast::IJacobian(TS, PetscReal, Vec, Vec, PetscReal shift, Mat, Mat P, void* context) {
  return guarded([&] {
    const auto& self = *static_cast<StepForecast*>(context);
    const PetscInt d = self.dof_;
    PetscInt block = 0;
    std::vector<double> values(static_cast<std::size_t>(d * d));
    for (const Wave& w : self.waves_)
      for (PetscInt column = 0; column < d; ++column, ++block) {
        for (std::size_t i = 0; i < values.size(); ++i) values[i] = -w.implicit_part[i];
        for (PetscInt k = 0; k < d; ++k) values[static_cast<std::size_t>(k * (d + 1))] += shift;
        SS_TRY(MatSetValuesBlocked(P, 1, &block, 1, &block, values.data(), INSERT_VALUES));
      }
    SS_TRY(MatAssemblyBegin(P, MAT_FINAL_ASSEMBLY));
    SS_TRY(MatAssemblyEnd(P, MAT_FINAL_ASSEMBLY));
  });
}

double StepForecast::excess_rate(double dt) {
  double* a;
  SS_TRY(VecGetArrayWrite(u_, &a));
  const auto d = static_cast<std::size_t>(dof_);
  for (std::size_t wave = 0; wave < waves_.size(); ++wave)
    for (std::size_t i = 0; i < d * d; ++i) a[wave * d * d + i] = i % (d + 1) == 0 ? 1 : 0;
  SS_TRY(VecRestoreArrayWrite(u_, &a));
  SS_TRY(TSSetTime(ts_, 0));
  SS_TRY(TSSetTimeStep(ts_, dt));
  SS_TRY(TSSetSolution(ts_, u_));
  SS_TRY(TSRestartStep(ts_));
  SS_TRY(TSSetConvergedReason(ts_, TS_CONVERGED_ITERATING));
  SS_TRY(TSStep(ts_));
  double rate = -HUGE_VAL;
  const double* b;
  SS_TRY(VecGetArrayRead(u_, &b));
  for (std::size_t wave = 0; wave < waves_.size(); ++wave) {
    const std::vector<double> P(b + wave * d * d, b + (wave + 1) * d * d);
    const bool finite = std::all_of(P.begin(), P.end(), [](double p) { return std::isfinite(p); });
    const double growth = finite ? std::log(spectral_bounds(dof_, P).modulus) / dt : HUGE_VAL;
    rate = std::max(rate, growth - waves_[wave].growth);
  }
  SS_TRY(VecRestoreArrayRead(u_, &b));
  return rate;
}

bool StepForecast::explodes(double dt, double duration) {
  return propagates_ && dt < duration && excess_rate(dt) * duration > std::log(1e6);
}

double StepForecast::limit(double dt, double duration) {
  double bad = dt, good = dt;
  for (int i = 0; i < 40 && explodes(good, duration); ++i) {
    bad = good;
    good /= 2;
  }
  for (int i = 0; i < 8 && bad > good; ++i) {
    const double middle = (good + bad) / 2;
    (explodes(middle, duration) ? bad : good) = middle;
  }
  return good;
}

}  // namespace stickslip
