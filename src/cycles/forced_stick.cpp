// The cycle with rests that a motion under a load settles on: looked at from period to period of the load.
#include <algorithm>
#include <cmath>
#include <optional>

#include "base/pulse.hpp"
#include "cycles/past_states.hpp"
#include "cycles/stick_return_map.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scales.hpp"

namespace stickslip {

namespace {

constexpr int most_periods = PastStates::most;  // of the load in a cycle

class ForcedSearch {
 public:
  ForcedSearch(const StickMotion& m, int patience)
      : m_(m), period_(m.scene().forcing_period()), escape_(escape_velocity(m.scene())),
        seen_(std::size_t(m.dof())) {
    const Scene& s = m.scene();
    const double turn = 2 * M_PI / scales_of(s).rate;
    most_ = patience * std::max(1., turn / period_);
  }

  StickFate operator()(const std::vector<double>& start) {
    StickState p{0, start, {}, {}, 0};
    p.u.push_back(0);
    m_.decide(p);
    double next_try = 1;
    for (double periods = 1; periods <= most_; ++periods) {
      const bool changed = pass_period(p);
      const double t = periods * period_;
      if (fastest(p) > escape_) return {Fate::grows, {}, t};
      quiet_ = changed ? 0 : quiet_ + 1;
      const int back = seen_.repeats_after(p.u, m_.psi_scale(), m_.state_scale());
      if (back > 0 && quiet_ > most_periods) {
        StickFate ended{m_.free_nodes_rest(p) ? Fate::stuck : Fate::oscillates, {}, t};
        ended.cycle.start = p.u;
        return ended;
      }
      if (back == 0 || quiet_ > 0 || periods < next_try) continue;
      if (const std::optional<StickCycle> found = accepted_cycle(m_, on_section(p, back)))
        return {Fate::repeats, *found, t};
      next_try = 1.5 * periods;  // what only seems to repeat does so for long
    }
    return {Fate::wanders, {}, most_ * period_};
  }

 private:
  // On to the next beginning of a period, the clock set back. Whether a node has started or stopped.
  bool pass_period(StickState& p) const {
    bool changed = false;
    while (p.t < period_) {
      beat("slips");
      if (!m_.advance(p, period_).empty()) changed = true;
    }
    p.t = p.u.back() = 0;
    return changed;
  }
  double fastest(const StickState& p) const {
    double most = 0;
    for (int i = 0; i < m_.nodes(); ++i) most = std::max(most, std::abs(p.u[i * m_.dof()]));
    return most;
  }

  // The section: the middle of the longest time without a start or a stop.
  StickCycle on_section(const StickState& from, int periods) const {
    StickState p(from);
    const double end = periods * period_;
    std::vector<double> times;
    while (p.t < end)
      if (!m_.advance(p, end).empty()) times.push_back(p.t);
    double longest = 0, middle = 0;
    for (std::size_t k = 0; k < times.size(); ++k) {
      const double next = k + 1 < times.size() ? times[k + 1] : times[0] + end;
      if (next - times[k] <= longest) continue;
      longest = next - times[k];
      middle = std::fmod(times[k] + longest / 2, end);
    }
    p = from;
    while (p.t < middle) m_.advance(p, middle);
    StickCycle c;
    c.start = p.u;
    c.load = {periods, middle, {}};
    for (const double direction : p.direction) c.load.rests.push_back(direction == 0);
    return c;
  }

  const StickMotion& m_;
  double period_, escape_, most_;
  int quiet_ = 0;    // periods without a start or a stop
  PastStates seen_;  // at beginnings of a period
};

}  // namespace

StickFate forced_stick_fate(const Scene& scene, const std::vector<double>& start, int patience) {
  const StickMotion motion(scene);
  return ForcedSearch(motion, patience)(start);
}

}  // namespace stickslip
