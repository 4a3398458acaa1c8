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

// Reads scene files: options as YAML.
//
// The YAML understood is what scenes need: nested maps, as blocks or in braces, whose keys join with `_`;
// numbers, words and quoted text; lists in brackets or with dashes, which become comma-joined text; comments.
// Everything else that YAML knows (anchors, aliases, tags, block scalars, several documents) and every
// doubtful thing (duplicate keys, also two spellings of one option, values over several lines, bytes that are
// not text) is refused with file and line. Read by libyaml, whose words those are that tell of a mistake in
// the syntax.

bool has_scene_suffix(const std::string& path);  // .yaml, .yml; .opts too, which read_scene() refuses

// The options in the order in which they stand; `where` of each is name:line. Throw UsageError with
// name:line.
std::vector<Given> parse_yaml(const std::string& text, const std::string& name);

// Reads a file. UsageError also for PETSc's plain form, .opts, with what to do instead. Not collective: for
// rank 0.
std::vector<Given> read_scene(const std::string& path);

}  // namespace stickslip
