#include "model/loop_families.hpp"

namespace stickslip {

template LawTable<NewtonFamily::Make>& NewtonFamily::table();
template <>
NewtonLoop loop_for(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
  return NewtonFamily::of(p, sticking, places);
}

}  // namespace stickslip
