// What a search tells beside its pulse (pulse.hpp): before a call that hears nothing, and where it was when a
// signal ended it.
#pragma once

#include <string>

#include "base/pulse.hpp"

namespace stickslip {

// The stage from now on, shown at once: a long call of a library begins, which hears no signal. `of`: what it
// is, of which a beat tells afterwards.
void announce(const std::string& text, const char* of);

// The stage, with the counts, at which a signal ended the search last; "" before.
std::string ended_during();

// Runs `body`. Where a signal ends it, `reached` keeps and says what was found until then.
template <class Body, class Reached>
void keeping_what_is_found(const Body& body, const Reached& reached) {
  try {
    body();
  } catch (const Interrupted&) {
    reached();
    throw;
  }
}

}  // namespace stickslip
