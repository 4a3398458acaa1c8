// The names of options that PETSc and SLEPc read, asked of the libraries themselves: each asks for an option
// by a text "-name" that stands in its read-only data, whatever its version and whenever it is read. An
// object made on purpose would say less: options of factorisations, line searches or trajectories are asked
// for only when these are first used.
#pragma once

#include <string>
#include <vector>

namespace stickslip {

// All that stand there, in lower case, without the dash. Names without an underscore, which chance may put
// there, are left out. The libraries need not have been started.
const std::vector<std::string>& library_names();
// One more, of an object that the program has added to the libraries, before they are asked for.
void add_library_name(const std::string& name);

// The name of an inner object's option as its own object asks for it: ksp_rtol for st_ksp_rtol, pc_type for
// sub_pc_type, mg_levels_1_pc_type and fieldsplit_u_pc_type.
std::string without_nesting(const std::string& name);

// May the libraries read this option, of an inner object or not?
bool library_reads(const std::string& name);

}  // namespace stickslip
