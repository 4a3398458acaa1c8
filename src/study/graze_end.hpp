// The end of the stick-slip of uniform motion with friction that sticks exactly: zeros of distance_from_graze
// (cycles/stick_cycle.hpp). Where a state lets the cycle end before, by a fold, its multiplier says where.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stickslip/cycles/stick_cycle.hpp"
#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/study/stick_slip_end.hpp"

namespace stickslip {

class GrazeEnd : public StickSlipEnd {
 public:
  GrazeEnd(SceneAt scene_at, std::vector<Axis> axes) : StickSlipEnd(std::move(scene_at), std::move(axes)) {}

  std::vector<Crossing> points(std::vector<std::string>& notes) override;
  std::vector<Crossing> curve(PetscInt count, std::vector<std::string>& notes) override;
  double operator()(double x, double y = 0) override { return distance(x, y, exact_step); }
  Scene scene(double x, double y = 0) const override;
  std::string fate(double x, double y = 0) const override;
  std::vector<double> on_cycle(double x, double y = 0) const override;

 private:
  double distance(double x, double y, double tolerance);
  Crossing crossing(double x, double y, double nx, double ny);
  PlanePoint last_digits(PlanePoint at, PlanePoint across);
  void place_fold(Crossing& c, double nx, double ny);
  bool lives(double x, double y);
  std::optional<bool> ends_at(const Crossing& c, double nx, double ny);
  void remark(const std::string& what, const Crossing& at);
  void tell_remarks(std::vector<std::string>& notes);
  void ask_motion(const std::vector<Crossing>& found, std::vector<std::string>& notes);

  struct Remark {  // what is said of places, each kind of it once
    std::string what;
    std::vector<Crossing> at;
  };
  std::vector<Remark> remarks_;
  double period_ = 0;    // of the cycle at the last evaluation
  bool passes_ = false;  // there: what it is zero of
};

}  // namespace stickslip
