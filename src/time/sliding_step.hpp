// A step of an explicit method for a massless chain whose friction is a y with a velocity for every y (laws
// that give one): rate-and-state friction.
//
// Without mass eta = B psi + a_i a y says what psi is, by an equation that is to be solved at every node and
// stage where eta is what moves. With y in its place psi is a formula, and so is
//     (a_i a + B psi_y) y_t = eta_t - B psi_state state_t,     eta_t = K0 (v - psi) + K1 D2 psi
// (eta_t = B dpsi/dt + a_i a y_t). psi = 2 psi0 exp(-l) sinh(y) has the sign of its force at every stage and
// may fall by any number of decades, and what a step may err by has no unit: ts_rtol of
// d ln psi = (psi_y dy + psi_state dstate)/psi_y, which at rest is dy, and of the state, a logarithm.
#pragma once

#include <functional>
#include <vector>

#include "time/tiles.hpp"

namespace stickslip {

class SlidingStep : public StepTaker {
 public:
  // Whether there are such steps of this model.
  static bool applies_to(const Model& model);

  SlidingStep(const Model& model, const StageProgram& method);
  Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
               const std::vector<VecHandle>& slopes, Vec last_slope = nullptr, double t = 0) const override;
  void set_direction(const std::vector<double>& direction) override { tiles_.set_direction(direction); }
  int stages() const override { return int(stages_.size()); }
  // y in the place of eta, and back, with psi.
  void begin_sum(Vec u) const override;
  void end_sum(Vec u) const override;

 private:
  static constexpr int slopes_from = 2;
  struct Stage {
    double time;
    SlopeSum sum;  // before it
  };
  double* at(const Tile& t, int index, int d, PetscInt i) const {
    return tiles_.column(index, d) + (i - t.from);
  }
  struct Moved {
    const double *psi, *psi_y, *psi_state, *state_rate;
    const double* strength;  // a_i a
    double* f;               // K1 D2 psi becomes y_t
    PetscInt count;
  };
  struct Rates {
    void operator()(const kernel::Coefficients& coefficients, const Moved& nodes) const;
  };
  using RatesLoop = std::function<void(const kernel::Coefficients&, const Moved&)>;
  // Nodes of a tile side by side: psi, eta or y, and the state, the first of them node `first`.
  struct Nodes {
    double *psi, *force, *state;
    PetscInt first, count;
  };
  // body() may write over the values of held nodes in a column from node `first` on: they stand as before.
  template <class Body>
  void keeping_held(double* column, PetscInt first, PetscInt count, const Body& body) const;
  void to_y(const Nodes& nodes) const;
  void to_eta(const Nodes& nodes) const;  // psi stands already
  // psi in columns 1, and into the scratch columns its slopes, of columns `index`; g: nullptr or the rate of
  // the state.
  void velocities(const Tile& t, int index, double* g, PetscInt begin, PetscInt end) const;
  void through(const Tile& t, double dt, double begin) const;

  Tiles tiles_;
  int scratch_;  // columns: psi_y, psi_state, and what nobody asks for
  std::vector<Stage> stages_;
  SlopeSum solution_, error_;
  kernel::Coefficients coefficients_;
  kernel::LawColumns law_;
  StencilLoop stencil_;
  RatesLoop rates_;
  std::vector<double> strength_;  // a_i a of every node of this rank and its halo, 1 of held ones
  mutable std::vector<double> rate_of_state_;  // where nobody asks for it
};

}  // namespace stickslip
