// The scales that a law's class declares (law.hpp), for the parameters of a scene.
#pragma once

#include <algorithm>

#include "model/dispatch.hpp"

namespace stickslip {

struct ScalesFamily {
  using Make = LawScales (*)(const FrictionParameters&, const FrictionPlaces&);
  static LawTable<Make>& table();

  // Over the places the least velocity and state, and the largest force; without any, those everywhere.
  template <class L, class S>
  static LawScales make(const FrictionParameters& p, const FrictionPlaces& places) {
    return with_friction<L, S>(p, [&](const auto& friction) {
      if (places.empty()) return traits::scales(friction.law);
      const auto along = frictions_along(friction, p, places);
      LawScales all = traits::scales(along.front().law);
      for (const auto& f : along) {
        const LawScales here = traits::scales(f.law);
        if (here.velocity > 0) all.velocity = std::min(all.velocity, here.velocity);
        all.force = std::max(all.force, here.force);
        all.state = std::min(all.state, here.state);
        all.length = std::min(all.length, here.length);
      }
      return all;
    });
  }
};

}  // namespace stickslip
