// What memory a process may still take.
#pragma once

namespace stickslip {

// In bytes, on this machine: what Linux says is available, or what a control group leaves where that is less;
// elsewhere all that the machine has. Swap does not count. Infinite where nothing is known.
double memory_of_machine();

// What the limit of addresses (ulimit -v) leaves to this process; infinite where there is none.
double memory_of_process();

}  // namespace stickslip
