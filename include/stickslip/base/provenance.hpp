// Where a result comes from: version, revision, command line, options, date. Written into every file and
// summary.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace stickslip {

const char* version();  // of the program, e.g. "0.1.0"
// What to type for a script of postprocess/: `stickslip-plot` where it is installed beside the program, else
// `postprocess/plot.py`.
std::string script_call(const std::string& name);
const char* git_revision();  // of the source tree it was built from; "-dirty" appended where it had changes

// Keeps the words of the command line for all provenance to come. PETSc knows only the program's name.
void note_command_line(int argc, char** argv);

struct Provenance {
  std::string command;                         // run, spectrum, ...
  std::map<std::string, std::string> options;  // name without dash to text, defaults included (Options::all)
  std::string command_line;                    // as typed, quoted for a shell
  std::string date;                            // start of this program, ISO 8601, UTC
  int ranks = 1;

  // Not collective, but asks MPI for the number of ranks.
  static Provenance of(const std::string& command, const std::map<std::string, std::string>& options);

  std::string option(const std::string& name) const;  // its text, or ""
};

// What files of the user's were taken for, a line each, for the words that close a command; a repeated line
// is dropped. Not collective.
void note_reading(const std::string& line);
const std::vector<std::string>& readings();

}  // namespace stickslip
