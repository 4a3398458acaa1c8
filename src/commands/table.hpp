// The commands by name, and what the program says of them and of itself. Not collective.
#pragma once

#include <string>
#include <vector>

#include "output/table.hpp"
#include "stickslip/commands/commands.hpp"

namespace stickslip {

// What each command writes, first the keys of its summary.
std::vector<TableText> boundary_tables();
std::vector<TableText> cycle_tables();
std::vector<TableText> fit_tables();
std::vector<TableText> laws_tables();
std::vector<TableText> run_tables();
std::vector<TableText> spectrum_tables();
std::vector<TableText> sweep_tables();
std::vector<TableText> wave_tables();

struct Command {
  const char* name;
  const char* does;
  int (*body)(const Options&);
  bool has_grid;
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
