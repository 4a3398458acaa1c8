// A driving plate that halts (load_halt): it stands while any node slips, and goes at v while none does.
//
// Its load (load.hpp) has one corner, before all times of a run: the piece before it is that of a plate that
// stands, the one behind it that of a plate that goes. Which of them holds is said to the model by
// Plate::set(), not by the time.
//
// The plate has a clock of its own, which stands with it. That of the run, t everywhere else, goes on: psi is
// the rate of the displacement by it.
//
// Nothing here communicates; every rank has the same clock.
#pragma once

#include <limits>

#include "stickslip/model/load.hpp"
#include "stickslip/model/model.hpp"

namespace stickslip {

inline constexpr double before_all_times = -1;  // where the load of a plate that halts has its corner

inline Load halting_load(double v) { return {v, {{before_all_times, 0.}, {before_all_times, v}}}; }
inline bool halts(const Scene& scene) {
  return scene.load.next_corner(-std::numeric_limits<double>::infinity()) < 0;
}

// The plate of a run; where it does not halt its clock is that of the run.
struct Plate {
  double t = 0, time = 0;  // at the run's time t its clock shows `time`, and from there on it goes or stands
  bool goes = true;
  double end = std::numeric_limits<double>::infinity();  // the run ends where its clock shows this

  double at(double when) const { return goes ? time + (when - t) : time; }
  void set(const Model& model, double now, double shows, bool from_now_on_goes) {
    t = now;
    time = shows;
    goes = from_now_on_goes;
    model.begin_load(goes ? 0 : 2 * before_all_times);
  }
  // How far it has come when the run's clock shows that.
  double travel(const Scene& scene, double when) const {
    return halts(scene) || !scene.load.varies() ? scene.v * at(when) : scene.load.integral(when);
  }
};

}  // namespace stickslip
