#include "model/law_family.hpp"

namespace stickslip {

LawTable<LawFamily::Make>& LawFamily::table() { return listed<LawFamily>(); }

namespace {

// Friction behind its virtual functions, which terms stand beside.
kernel::LawColumns of_any(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
  const auto laws =
      std::make_shared<const std::vector<std::shared_ptr<const Friction>>>(Friction::along(p, places));
  return with_flags(
      [&](auto state, auto steep, auto sticks) -> kernel::LawColumns {
        if constexpr (steep && (sticks || !state))
          throw std::logic_error("no law is like this");
        else
          return kernel::columns_of<sticks>(kernel::AnyFriction<state, steep>{laws}, p.regularised);
      },
      laws->front()->has_state, laws->front()->steep, sticking);
}

}  // namespace

kernel::LawColumns kernel::law_columns(const FrictionParameters& p, bool sticking,
                                       const FrictionPlaces& places) {
  if (!places.empty() && !p.terms.none()) return of_any(p, sticking, places);
  return LawFamily::table().of(p)(p, sticking, p.varies() ? places : FrictionPlaces());
}

}  // namespace stickslip
