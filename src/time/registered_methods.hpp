// The methods that register_method() added.
#pragma once

#include <vector>

#include "stickslip/time/register_method.hpp"

namespace stickslip {

struct RegisteredMethod {
  Method method;
  PetscErrorCode (*create)(TS);
};
const std::vector<RegisteredMethod>& registered_methods();

}  // namespace stickslip
