#include "model/loop_families.hpp"

namespace stickslip {

template LawTable<StageFamily::Make>& StageFamily::table();
template <>
StageLoop loop_for(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
  return StageFamily::of(p, sticking, places);
}

}  // namespace stickslip
