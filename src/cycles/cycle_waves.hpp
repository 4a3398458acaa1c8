// What becomes in one period of deviations from a cycle, and of waves on the motion: the equations linearised
// about it, carried round on steps of collocation. Local to the process.
#pragma once

#include <complex>
#include <map>
#include <vector>

#include "cycles/cell_field.hpp"
#include "cycles/stick_motion.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

class CycleWaves {
 public:
  virtual ~CycleWaves() = default;
  virtual const Scene& scene() const = 0;  // the cell
  // At which waves travel, about, in the mean over the period.
  virtual double speed() const = 0;
  // The growth rate that waves on one node tend to in the continuum as they get shorter; NaN where that is
  // not known.
  virtual double short_waves() const = 0;

  // Multipliers, largest first: of a wave exp(ikx) on the motion of one node, kappa2 = kappa^2(k); of a
  // deviation that is exp(i theta) times as large in the next cell of a ring.
  std::vector<std::complex<double>> of_wave(double kappa2);
  std::vector<std::complex<double>> of_phase(double theta);

 protected:
  virtual int unknowns() const = 0;
  virtual std::vector<std::complex<double>> weights_of_phase(double theta) const = 0;
  // By how much the fastest of these waves turns, or dies away, in the longest step, over what it may.
  virtual double turn(double kappa2) const = 0;
  // The steps of a period, halved as many times.
  virtual std::vector<IntervalPropagator> chain(int halvings) const = 0;

 private:
  const std::vector<IntervalPropagator>& links(int halvings);
  std::map<int, std::vector<IntervalPropagator>> links_;
};

// On smooth cycles: by Gauss's points where the step is short beside the rates of decay; where friction is
// stiffer by those of Radau, which damp what decays at once.
class Deviations : public CycleWaves {
 public:
  explicit Deviations(const SmoothCycle& cycle);

  const std::vector<std::complex<double>>& multipliers() const { return multipliers_; }  // largest first
  // of -trace J over psi and eta, over the period; one node
  double mean_damping() const { return mean_damping_; }
  const Scene& scene() const override { return field_.scene(); }
  double speed() const override;  // without mass as fast as the state follows psi
  double short_waves() const override;

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
  int unknowns() const override { return field_.dim(); }
  std::vector<std::complex<double>> weights_of_phase(double theta) const override {
    return field_.weights_of_phase(theta);
  }
  double turn(double kappa2) const override;
  std::vector<IntervalPropagator> chain(int halvings) const override;

  const SmoothCycle& cycle_;
  const CellField& field_;
  std::vector<double> mesh_;
  std::vector<std::complex<double>> multipliers_;
  std::vector<StepJacobian> pieces_;       // without halvings
  double longest_ = 0, mean_damping_ = 0;  // reach of a step
};

// Fills in the multipliers of a cycle and which of them is the phase mode's: the nearest to 1.
void set_multipliers(SmoothCycle& cycle);
std::size_t nearest_to_one(const std::vector<std::complex<double>>& multipliers);

// On cycles with rests: Gauss's points on the slips, jump matrices at starts and stops.
//
// A wave has the starts and stops of the cell in every cell, each a little earlier or later; so a change of a
// node multiplies its deviation by the cell's own jump matrix, in which with viscosity between neighbours the
// next cells have their share. While every node rests nothing but the state deviates further. The time of a
// load is no unknown here, as it does not deviate.
class StickDeviations : public CycleWaves {
 public:
  StickDeviations(const Scene& cell, const StickCycle& cycle);
  const Scene& scene() const override { return motion_.scene(); }
  double speed() const override;
  double short_waves() const override;

 private:
  LowRankCoupling feed(const std::vector<double>& direction) const;
  IntervalPropagator resting(double from, double to, const std::function<void(double, double*)>& at) const;
  IntervalPropagator jump(const std::vector<double>& was, const StickState& now) const;
  void check_release(std::size_t node, const StickState& now) const;
  int unknowns() const override { return motion_.nodes() * motion_.dof(); }
  std::vector<std::complex<double>> weights_of_phase(double theta) const override {
    return phase_weights(rows_, at_ends_, theta);
  }
  double turn(double kappa2) const override;
  std::vector<IntervalPropagator> chain(int halvings) const override;

  StickMotion motion_;
  StickCycle cycle_;
  std::vector<TurnedRow> rows_;       // of D2, of every node
  std::vector<std::size_t> at_ends_;  // nodes with neighbours in other cells
};

}  // namespace stickslip
