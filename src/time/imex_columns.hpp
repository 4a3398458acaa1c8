// The values of a step of an implicit-explicit method over a whole BandLayout: u, a stage, what is known of
// it, and the slopes of all stages, in columns; and their sums, as the tableau has them.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "model/kernel.hpp"
#include "stickslip/time/time.hpp"
#include "time/band_layout.hpp"
#include "numerics/stage_program.hpp"

namespace stickslip {

class ImexColumns {
 public:
  // `implicit`: wave or both.
  ImexColumns(const BandLayout& layout, const StageProgram& method, Implicit implicit);
  ImexColumns(const ImexColumns&) = delete;
  ImexColumns& operator=(const ImexColumns&) = delete;

  // Unknown d (0 psi, 1 eta, 2 the state) of a tile. eta of a stage is not kept.
  double* u(const BandTile& t, int d) const { return at(t, u_[d]); }
  double* stage(const BandTile& t, int d) const { return at(t, stage_[d == 0 ? 0 : 1]); }
  double* known(const BandTile& t, int d) const { return at(t, known_[d]); }
  double* d2(const BandTile& t) const { return at(t, d2_); }  // D2 psi of u
  // R' of a stage (newton_kernel.hpp)
  double* right_side(const BandTile& t) const { return at(t, right_side_); }
  // of psi since u, with everything implicit
  double* change(const BandTile& t) const { return at(t, change_); }
  enum Kind { of_implicit, of_explicit };
  // nullptr where the part does not act on the unknown, and of the explicit part of eta: friction there is
  // explicit_eta() times that of psi
  double* slope(const BandTile& t, Kind kind, int stage, int d) const {
    const int index = slopes_[kind][stage][d];
    return index < 0 ? nullptr : at(t, index);
  }

  double explicit_eta() const { return explicit_eta_; }

  // known = u + dt (the slopes before stage i), of psi without u: what is solved for is its change
  void sum_known(const BandTile& t, int i, double dt) const;
  // The new value of unknown d, and its error, from the tile's place on.
  void sum_solution(const BandTile& t, int d, double dt, double* into) const;
  void sum_error(const BandTile& t, int d, double dt, double* into) const;

 private:
  struct Sum {
    int base = -1;  // column; -1: 0
    std::vector<int> columns;
    std::vector<double> weights;
  };
  double* at(const BandTile& t, int index) const { return work_.get() + index * std::size_t(stride_) + t.at; }
  void add(Sum& sum, int d, const double* of_implicit, const double* of_explicit, int count) const;
  void take(const BandTile& t, const Sum& sum, double dt, double* into) const;

  int dof_;
  double explicit_eta_;
  PetscInt stride_;
  int u_[3] = {}, stage_[2] = {}, known_[3] = {}, d2_ = 0, right_side_ = 0, change_ = -1;
  std::vector<std::array<int, 3>> slopes_[2];  // by Kind, of the stages; -1: there is none
  std::vector<std::array<Sum, 3>> sums_;       // of the stages
  std::array<Sum, 3> solution_, error_;
  std::unique_ptr<double[]> work_;
  std::vector<double> zeros_;
  std::function<void(const kernel::Terms&)> add_;
};

}  // namespace stickslip
