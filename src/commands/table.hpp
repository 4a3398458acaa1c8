// The commands by name, and what the program says of them and of itself. Not collective.
#pragma once

#include <string>
#include <vector>

#include "output/table.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// A command: its row is made by a function that stands in its own source and is named in table.cpp.
struct Command {
  const char* name;
  const char* does;
  // Reads its options, does its work and returns the exit code (0, or that of a signal it stopped for).
  // Errors leave as exceptions (error.hpp). Collective.
  int (*body)(const Options&);
  bool has_grid;
  std::vector<TableText> (*tables)();  // what it writes, first the keys of its summary
};

const std::vector<Command>& commands();
std::vector<std::string> command_names();
const Command& command_named(const std::string& name);  // one of command_names()

std::string tables_text();  // of all commands, for scripts/tables.py
std::string general_help();
// Of all groups of options, or of that whose name begins with the word `topic`. Throws UsageError where there
// is no such group.
std::string command_help(const Command& command, const std::string& topic = "");
std::string version_text();  // versions of the libraries too: once they have started
void print_library_help();   // what PETSc and SLEPc print of their options; collective

}  // namespace stickslip
