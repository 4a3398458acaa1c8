#include "model/loop_families.hpp"

namespace stickslip {

template LawTable<TangentFamily::Make>& TangentFamily::table();
template <>
TangentLoop loop_for(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
  return TangentFamily::of(p, sticking, places);
}

}  // namespace stickslip
