// The equations linearised about a cycle, carried round one period: multipliers of deviations and of waves on the motion.
//
// Gauss's points where the step is short beside the rates of decay; where friction is stiffer those of Radau, which damp
// what decays at once. Local to the process.
#pragma once

#include <complex>
#include <map>
#include <vector>

#include "cycles/cell_field.hpp"
#include "stickslip/cycles/smooth_cycle.hpp"

namespace stickslip {

class Deviations {
 public:
  explicit Deviations(const SmoothCycle& cycle);

  std::vector<std::complex<double>> multipliers();  // largest first
  // Of waves exp(ikx) on nodes that are all alike, kappa2 = kappa^2(k); of deviations exp(i theta) times as large in the next
  // cell.
  std::vector<std::complex<double>> of_wave(double kappa2);
  std::vector<std::complex<double>> of_twist(double theta);
  double mean_damping() const { return mean_damping_; }  // of -trace J over psi and eta, over the period; one node

 private:
  // One step: its length and the Jacobian at its points.
  struct Piece {
    double h;
    bool stiff;
    std::vector<double> J;
  };
  // Of a wave on one node kappa^2 alone changes from wave to wave, times a matrix u (x) e_psi of rank one. What is inverted
  // once for a piece leaves each wave a system of as many unknowns as there are stages: `end` and `psi` of the stages carry
  // what stands at the beginning, `end_of_u` and `psi_of_u` what u feeds into the stages.
  struct Response {
    std::vector<double> end, psi, end_of_u, psi_of_u;
  };
  const std::vector<Piece>& pieces(int halvings);
  const std::vector<Response>& responses(int halvings);
  std::vector<double> slope_in_kappa2() const;  // u
  template <class T>
  std::vector<std::complex<double>> carried_round(int halvings, const std::vector<T>& added);

  const SmoothCycle& cycle_;
  const CellField& field_;
  std::vector<double> mesh_;
  std::map<int, std::vector<Piece>> pieces_;
  std::map<int, std::vector<Response>> responses_;
  double longest_ = 0, mean_damping_ = 0;  // step
};

// Fills in the multipliers of a cycle and which of them is the phase mode's: the nearest to 1.
void set_multipliers(SmoothCycle& cycle);
std::size_t nearest_to_one(const std::vector<std::complex<double>>& multipliers);

}  // namespace stickslip
