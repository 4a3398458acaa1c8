// The equations linearised about a cycle, carried round one period: multipliers of deviations and of waves on
// the motion.
//
// Gauss's points where the step is short beside the rates of decay; where friction is stiffer those of Radau,
// which damp what decays at once. Local to the process.
#pragma once

#include <complex>
#include <map>
#include <vector>

#include "cycles/cell_field.hpp"
#include "cycles/propagator.hpp"
#include "cycles/stick_return_map.hpp"
#include "stickslip/cycles/smooth_cycle.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

class Deviations {
 public:
  explicit Deviations(const SmoothCycle& cycle);

  const std::vector<std::complex<double>>& multipliers() const { return multipliers_; }  // largest first
  // Of waves exp(ikx) on nodes that are all alike, kappa2 = kappa^2(k); of deviations exp(i theta) times as
  // large in the next cell.
  std::vector<std::complex<double>> of_wave(double kappa2);
  std::vector<std::complex<double>> of_phase(double theta);
  // of -trace J over psi and eta, over the period; one node
  double mean_damping() const { return mean_damping_; }
  // At which deviations travel, over the period; without mass as fast as the state follows psi.
  double mean_speed() const;

 private:
  // One step: its length, the Jacobian at its points, and there CellField::feed_slopes.
  struct StepJacobian {
    double h;
    bool stiff;
    std::vector<double> J, by = {};
    double reach = 0;  // CellField::reach
    const Collocation& method() const { return stiff ? Collocation::radau5() : Collocation::gauss5(); }
  };
  // Carries deviations round on the steps of `mesh`.
  void carry_on(const std::vector<double>& mesh);
  // On steps that reach no further than the longest of the mesh over 2^halvings.
  std::vector<StepJacobian> pieces(int halvings) const;
  const std::vector<IntervalPropagator>& links(int halvings);

  const SmoothCycle& cycle_;
  const CellField& field_;
  std::vector<double> mesh_;
  std::vector<std::complex<double>> multipliers_;
  std::vector<StepJacobian> pieces_;  // without halvings
  std::map<int, std::vector<IntervalPropagator>> links_;
  double longest_ = 0, mean_damping_ = 0;  // reach of a step
};

// Fills in the multipliers of a cycle and which of them is the phase mode's: the nearest to 1.
void set_multipliers(SmoothCycle& cycle);
std::size_t nearest_to_one(const std::vector<std::complex<double>>& multipliers);

// The equations linearised about a cycle with rests, carried round one period for waves: Gauss's points on
// the slips, jump matrices at starts and stops.
//
// A wave has the starts and stops of the cell in every cell, each a little earlier or later; so a change of a
// node multiplies its deviation by the cell's own jump matrix, in which with viscosity between neighbours the
// next cells have their share. While every node rests nothing but the state deviates further. Local to the
// process.

class StickDeviations {
 public:
  StickDeviations(const Scene& cell, const StickCycle& cycle);

  // Multipliers, largest first: of a wave exp(ikx) on the motion of one node, kappa2 = kappa^2(k); of a
  // deviation that is exp(i theta) times as large in the next cell of a ring.
  std::vector<std::complex<double>> of_wave(double kappa2);
  std::vector<std::complex<double>> of_phase(double theta);

 private:
  // On steps in which the fastest of these waves turns little enough: of the cell alone, times 2^halvings.
  const std::vector<IntervalPropagator>& links(int halvings);
  LowRankCoupling feed(const std::vector<double>& direction) const;
  IntervalPropagator resting(double from, double to, const std::function<void(double, double*)>& at) const;
  IntervalPropagator jump(const std::vector<double>& was, const StickState& now) const;
  void check_release(std::size_t node, const StickState& now) const;

  StickMotion motion_;
  StickCycle cycle_;
  std::vector<TurnedRow> rows_;       // of D2, of every node
  std::vector<std::size_t> at_ends_;  // nodes with neighbours in other cells
  std::map<int, std::vector<IntervalPropagator>> links_;
};

}  // namespace stickslip
