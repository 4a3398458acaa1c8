// Where a result comes from: version, revision, command line, options, date. Written into every file and summary.
#pragma once

#include <map>
#include <string>

namespace stickslip {

const char* version();       // of the program, e.g. "0.1.0"
const char* git_revision();  // of the source tree it was built from; "-dirty" appended where it had changes

struct Provenance {
  std::string command;                         // run, spectrum, ...
  std::map<std::string, std::string> options;  // name without dash to text, defaults included (Options::all)
  std::string command_line;                    // as typed, quoted for a shell
  std::string date;                            // start of this program, ISO 8601, UTC
  int ranks = 1;

  // Not collective, but reads the command line and MPI's size from PETSc, which must be initialized.
  static Provenance of(const std::string& command, const std::map<std::string, std::string>& options);

  std::string option(const std::string& name) const;  // its text, or ""
};

}  // namespace stickslip
