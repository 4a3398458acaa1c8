// A method of a program of one's own, as a type of PETSc's TS: every command that takes -ts_type or a list of
// methods has it.
#pragma once

#include <petscts.h>

#include <string>
#include <vector>

#include "stickslip/time/methods.hpp"

namespace stickslip {

// `method`: its row of the table, without a subtype; what it says (explicit or not, order, error estimate) is
// relied on. `create`: what TSRegister takes; called once PETSc has started. `options`: names that the type
// reads itself, without the dash, e.g. "ts_heun_weight". To be called before stickslip::main. Throws
// std::logic_error for a type that is there already, and once the table has been read.
void register_method(const Method& method, PetscErrorCode (*create)(TS),
                     const std::vector<std::string>& options = {});

}  // namespace stickslip
