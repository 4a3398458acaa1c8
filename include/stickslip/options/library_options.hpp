// Options of PETSc and SLEPc: which names they read, the ranges of well-known numbers, and what was never
// read.
//
// The libraries accept any name in silence and leave the name out of most complaints about a value. So the
// program checks before they do: a name must be one that they read, a well-known number must lie in its
// range, and of an option that was not used a warning says so.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"

namespace stickslip {

// Names are without the dash and in lower case.
bool is_library_option(const std::string& name);  // PETSc or SLEPc may read it
// Of the program's own and theirs; "" where none is near.
std::string nearest_option(const std::string& name);
// Throws UsageError where the option is not the user's to set, or its number out of range. Returns the value
// as PETSc reads it. Does not need PETSc.
std::optional<std::string> check_library_value(const std::string& name,
                                               const std::optional<std::string>& text,
                                               const std::string& where);
// views, monitors, converged-reason, log_*: change no result
bool only_looks(const std::string& name);

// Puts the library options into PETSc's database. May be called before PetscInitialize.
void insert_library_options(const Options& options);

// Types by name (-ts_type, -ksp_type, ...) against what the libraries have registered, and whether the files
// of views and monitors can be written. After SlepcInitialize. Collective.
void check_library_types(const Options& options);

// To be called by a command once its objects have taken their options (XxxSetFromOptions) and before any
// work: UsageError for a choice (-..._type) that nobody has read although its object is there: it belongs to
// another method. `objects` lists those that are there whatever was asked, e.g. "ts snes ksp pc".
void check_unused_after_setup(const Options& options, const std::string& objects = "");

// The options of solvers of equations, which a method that solves none does not use; the caller tells the
// user.
std::vector<std::string> options_of_solvers(const Options& options);

// To be called when the work is done: warns of each option of the libraries' objects that nobody has read
// until now, once.
void warn_unused_at_end(const Options& options);

// The user's library option whose value PETSc complains of in `message` ("" where there is none): PETSc names
// the value and not the option. For errors while objects take their options.
std::string option_behind(const std::string& message, const Options& options);

// The name by which this release of PETSc reads an option: 3.25 has renamed some. PETSc itself moves a value
// to the newer name, but not where one stands there already, of another run in this process.
std::string name_in_database(const std::string& name);
// Takes a library's option out of PETSc's database.
void clear_library_option(const std::string& name);
// PETSc's database, which holds the library options of `before`, holds those of `after` while this lives.
class LibraryOptionsHeld {
 public:
  LibraryOptionsHeld(const Options& before, const Options& after);
  ~LibraryOptionsHeld();
  LibraryOptionsHeld(const LibraryOptionsHeld&) = delete;
  LibraryOptionsHeld& operator=(const LibraryOptionsHeld&) = delete;

 private:
  Options before_, after_;
};

// The names of options that PETSc and SLEPc read, asked of the libraries themselves: each asks for an option
// by a text "-name" that stands in its read-only data, whatever its version and whenever it is read. An
// object made on purpose would say less: options of factorisations, line searches or trajectories are asked
// for only when these are first used.

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
