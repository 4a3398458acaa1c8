// Nodes that come into balance in no time, with mass and friction that goes by ln psi (`steep` laws).
//
// Where the force lies below friction by d, psi falls at A d, and friction that goes by a ln psi follows only
// when psi is d/a factors of e lower, so 60 or 260 decades for ordinary d: within the round-off of the time,
// as soon as psi is small. Steps show nothing of that way. One that ends upon it has a psi whose error is
// beyond all smallness and whose force is off by as much as before; the first stage of the next one, which is
// explicit, mirrors this, and the psi that goes with it is no number any more. So psi is put where
//     eta + N D2 psi - B psi - F(psi, state) = 0
// when it gets there within a moment.
#pragma once

#include "stickslip/model/model.hpp"
#include "stickslip/time/tolerances.hpp"

namespace stickslip {

// Does so at every node of u whose force is off by more than `tolerances` allow and whose way there at the
// rate psi_t takes less than `moment`, a time. Returns whether there was one on any rank. Collective.
bool balance_at_once(const Model& model, const Tolerances& tolerances, double moment, Vec u);

}  // namespace stickslip
