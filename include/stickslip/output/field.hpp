// What a dataset says of itself.
#pragma once

#include <string>

namespace stickslip {

// One dataset: its name, its units in words ("time", "length/time", "1"; not "seconds", which readers take
// for dates) and what it is.
struct Field {
  std::string name, units, long_name;
};

// The standard fields, to be put into RunLayout::fields: psi, eta, tau, theta, chi; and t.
Field standard_field(const std::string& name);

}  // namespace stickslip
