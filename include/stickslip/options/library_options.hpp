// Options of PETSc and SLEPc: which names may be theirs, what the well-known ones take, and which were never
// read.
//
// The libraries accept any name in silence and leave the name out of most complaints about a value. So the
// program checks before they do: a name must carry the prefix of one of their objects, the value of a
// well-known option must be of its kind, and what nobody has read once everything is set up ends the program.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"

namespace stickslip {

// Names are without the dash and in lower case.
bool is_library_option(const std::string& name);  // carries the prefix of a PETSc or SLEPc object
std::vector<std::string> known_options();         // the program's own and well-known ones of theirs
// Throws UsageError where the name is well known and the value is not of its kind, or where the name is
// nearly one of the program's own. Returns the value as PETSc reads it. Does not need PETSc.
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

// UsageError, with the nearest name, for an option that carries the prefix of a library's object and that
// such an object does not read. After SlepcInitialize. Collective.
void check_library_names(const Options& options);

// To be called by a command once its objects have taken their options (XxxSetFromOptions) and before any
// work: UsageError for a library option that nobody has read although the object is there: it belongs to
// another method. Left for the end are views, monitors and the like, which are read later, and options of
// objects that the command does not always make; `not_made` lists further ones it did not make this time,
// e.g. "snes ksp pc" for an explicit method.
void check_unused_after_setup(const Options& options, const std::string& not_made = "");

// To be called when the work is done: warns of each library option that nobody has read until now.
void warn_unused_at_end(const Options& options);

// The user's library option whose value PETSc complains of in `message` ("" where there is none): PETSc names
// the value and not the option. For errors while objects take their options.
std::string option_behind(const std::string& message, const Options& options);

}  // namespace stickslip
