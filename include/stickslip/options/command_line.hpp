// What the user typed: the command, and every option from the scene, PETSC_OPTIONS and the command line.
//
//     stickslip COMMAND [SCENE.yaml] [options]
//
// The scene may stand anywhere after the command. Order of precedence, lowest first: the scene; files named
// by -options_file; the environment's PETSC_OPTIONS_YAML and PETSC_OPTIONS; the command line. PETSc's
// .petscrc files are not read: a scene means the same in every folder and for every user.
#pragma once

#include <petscsys.h>

#include <string>
#include <vector>

#include "stickslip/options/options.hpp"

namespace stickslip {

struct CommandLine {
  std::string command;  // "" where help or version was asked for without one
  bool help = false;
  bool help_all = false;  // PETSc's and SLEPc's options too
  bool version = false;
  std::string help_topic;  // the first word of a group of options, where only that was asked for
  std::vector<Given> given;  // lowest precedence first; empty where help or version was asked for
};

// Rank 0 reads; every rank gets its result or throws its UsageError. Needs MPI, not PETSc. Collective.
CommandLine read_command_line(int argc, char** argv, const std::vector<std::string>& commands, MPI_Comm comm);

}  // namespace stickslip
