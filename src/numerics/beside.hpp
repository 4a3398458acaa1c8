// Values on both sides of a place, for differences.
#pragma once

#include <cmath>
#include <utility>

#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

template <class Value>
struct Beside {
  Value below, above;
  double width;  // between them
};

// Of f at `at` -+ eps. At an end of what its parameter may be, where it throws Refusal, the difference is
// one-sided: `here` is f(at). Throws Failure where it is refused on either side.
template <class Refusal, class Value, class Function>
Beside<Value> beside_of(const Function& f, double at, double eps, const Value& here) {
  double width = 0;
  const auto value = [&](double by) -> Value {
    try {
      Value found = f(at + by);
      width += std::abs(by);
      return found;
    } catch (const Refusal&) {
      return here;
    }
  };
  Value below = value(-eps), above = value(eps);
  if (!(width > 0)) throw Failure("the parameter cannot be varied at " + rounded_text(at, 12));
  return {std::move(below), std::move(above), width};
}

}  // namespace stickslip
