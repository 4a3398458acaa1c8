#include "stickslip/output/field.hpp"

#include <stdexcept>

#include "stickslip/model/friction.hpp"

namespace stickslip {

Field standard_field(const std::string& name) {
  if (name == "t") return {"t", "time", "time"};
  if (name == "psi") return {"psi", "length/time", "sliding velocity"};
  if (name == "eta") return {"eta", "1", "force over the friction amplitude"};
  for (const StateLaw law : all_state_laws())
    if (!law.none() && name == law->symbol) return {law->symbol, law->unit, law->meaning};
  if (name == "chi") return {"chi", "length", "displacement"};
  throw std::logic_error("no standard field '" + name + "'");
}

}  // namespace stickslip
