// A one-step method as data: of which slopes its stages, the new values and their error are made.
//
//     y_i = u + dt sum_{j < i} A_ij f_j + dt sum_{j <= i} At_ij g_j,   f_j = f(y_j), g_j = g(y_j)
//     u_new = u + dt sum_j (b_j f_j + bt_j g_j)
//     error = dt sum_j ((b_j - embedded_j) f_j + (bt_j - embedded_t_j) g_j)
//
// An additive method takes the right-hand side f + g in two parts, g implicitly where At_ii is not 0; of an
// explicit one f is the whole and there is no g (Ascher, Ruuth and Spiteri, Appl. Numer. Math. 25 (1997)
// 151).
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "stickslip/base/vectors.hpp"

namespace stickslip {

struct StageProgram {
  int stages = 0;
  std::vector<double> A;            // stages x stages, by rows
  std::vector<double> b, embedded;  // embedded: empty where there is no estimate of the error
  std::vector<double> At = {}, bt = {}, embedded_t = {};  // empty: an explicit method
  int order = 0;                                          // of the step, as the error control takes it
  // Values between steps are sums of the slopes of all stages, those too that the step makes no use of.
  bool dense = true;
  double target = 0;  // of the implicit equations; 0: as the error norm has it

  bool additive() const { return !At.empty(); }
  // The first diagonal entry of At that is not 0, or 0.
  double diagonal() const;
  double time(int stage) const;  // when it is taken, in parts of the step
  // The new u is the last stage, of an additive method but for what is explicit: for `lacking()`, the weights
  // of f in the new u that the last stage does not have, or all where it ends otherwise.
  bool ends_at_last_stage() const;
  std::vector<double> lacking() const;
  // Weights of the slopes in the error; empty where there is no estimate.
  std::vector<double> error_of_f() const, error_of_g() const;
};

// The round-off of a tableau that was computed.
inline bool is_no_weight(double weight) { return std::abs(weight) < 1e-14; }

// What a step dt makes of u' = (F + G) u with f = F u and g = G u, the stability matrix R(dt F, dt G): dim x
// dim, by rows, as F and G. With an explicit method F is the whole.
std::vector<double> propagator(const StageProgram& method, int dim, const std::vector<double>& F,
                               const std::vector<double>& G, double dt);

// The tableaus of PETSc's arkimex. The library hands none out, so that each is read off a step of the method
// itself: one of length 1 from 0 in which the explicit slope of stage j is the unit vector j, and the
// implicit one another.
class ImexMethod {
 public:
  explicit ImexMethod(const std::string& subtype);
  ImexMethod(ImexMethod&&) = delete;
  const StageProgram& tableau() const { return tableau_; }
  // Weights of g_0, f_0, g_1, f_1, ... in u at the part s of the step, of a method that interpolates.
  std::vector<double> weights_at(double s) const;

 private:
  static PetscErrorCode RHSFunction(TS, PetscReal, Vec, Vec f, void* context);
  static PetscErrorCode IFunction(TS, PetscReal, Vec, Vec udot, Vec f, void* context);
  static PetscErrorCode IJacobian(TS, PetscReal, Vec, Vec, PetscReal shift, Mat, Mat J, void*);
  static PetscErrorCode PreStage(TS, PetscReal);
  static PetscErrorCode PostStage(TS, PetscReal, PetscInt, Vec* stages);
  void read(Vec from, std::vector<double>& of_explicit, std::vector<double>& of_implicit) const;

  TsHandle ts_;
  VecHandle u_;
  MatHandle J_;
  int stage_ = -1;
  std::vector<std::vector<double>> explicit_rows_, implicit_rows_;
  StageProgram tableau_;
};

}  // namespace stickslip
