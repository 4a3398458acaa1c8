// The program, for one of one's own that adds laws or methods (src/commands/register_law.hpp,
// stickslip/time/methods.hpp).
#pragma once

namespace stickslip {

// All commands, with what the user typed: to be called once, in place of all else that main does. Starts and
// ends MPI, PETSc and SLEPc. Returns the exit code.
int main(int argc, char** argv);

}  // namespace stickslip
