// The equations linearised about a cycle with rests, carried round one period for waves: Gauss's points on
// the slips, jump matrices at starts and stops.
//
// A wave has the starts and stops of the cell in every cell, each a little earlier or later; so a change of a
// node multiplies its deviation by the cell's own jump matrix, in which with viscosity between neighbours the
// next cells have their share. While every node rests nothing but the state deviates further. Local to the
// process.
#pragma once

#include <complex>
#include <map>
#include <vector>

#include "cycles/propagator.hpp"
#include "cycles/stick_return_map.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

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
