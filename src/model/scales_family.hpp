// The scales that a law's class declares (law.hpp), for the parameters of a scene.
#pragma once

#include <algorithm>

#include "model/dispatch.hpp"

namespace stickslip {

// And by how much friction that sticks drops as slip begins.
struct DroppingScales : LawScales {
  double drop = 0;
};

struct ScalesFamily {
  using Make = DroppingScales (*)(const FrictionParameters&, const FrictionPlaces&);
  static LawTable<Make>& table();

  // Over the places the least velocity and state, and the largest force; without any, those everywhere.
  template <class L, class S>
  static DroppingScales make(const FrictionParameters& p, const FrictionPlaces& places) {
    return with_friction<L, S>(p, [&](const auto& friction) {
      if (places.empty()) return of(friction);
      const auto along = frictions_along(friction, p, places);
      DroppingScales all = of(along.front());
      for (const auto& f : along) {
        const DroppingScales here = of(f);
        all.drop = std::min(all.drop, here.drop);
        if (here.velocity > 0) all.velocity = std::min(all.velocity, here.velocity);
        all.force = std::max(all.force, here.force);
        all.state = std::min(all.state, here.state);
        all.length = std::min(all.length, here.length);
      }
      return all;
    });
  }

 private:
  template <class F>
  static DroppingScales of(const F& f) {
    DroppingScales scales{f.law.scales()};
    if constexpr (F::sticks)
      scales.drop = std::max(0., f.law.threshold() - f.law.phi(0., SignFrozen{1}).value);
    return scales;
  }
};

}  // namespace stickslip
