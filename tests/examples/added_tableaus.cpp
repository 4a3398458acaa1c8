// Zonneveld's pair of orders 4 and 3 (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
// table 4.2).
#include "time/methods.hpp"

namespace stickslip {

std::vector<AddedTableau> added_tableaus() {
  return {{{"rk", "zonneveld", MethodKind::explicit_, 4, Adaptivity::yes, "an example"},
           {0, 0, 0, 0, 0, 1 / 2., 0, 0,       0,       0,        0,        1 / 2., 0,
            0, 0, 0, 0, 1, 0,      0, 5 / 32., 7 / 32., 13 / 32., -1 / 32., 0},
           {1 / 6., 1 / 3., 1 / 3., 1 / 6., 0},
           {-1 / 2., 7 / 3., 7 / 3., 13 / 6., -16 / 3.}}};
}

}  // namespace stickslip
