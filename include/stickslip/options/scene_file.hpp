// Reads scene files: options as YAML.
//
// The YAML understood is what scenes need: nested maps, as blocks or in braces, whose keys join with `_`;
// numbers, words and quoted text; lists in brackets or with dashes, which become comma-joined text; comments.
// Everything else that YAML knows (anchors, aliases, tags, block scalars, several documents) and every
// doubtful thing (duplicate keys, also two spellings of one option, values over several lines, bytes that are
// not text) is refused with file and line. Read by libyaml, whose words those are that tell of a mistake in
// the syntax.
#pragma once

#include <string>
#include <vector>

#include "stickslip/options/options.hpp"

namespace stickslip {

bool has_scene_suffix(const std::string& path);  // .yaml, .yml; .opts too, which read_scene() refuses

// The options in the order in which they stand; `where` of each is name:line. Throw UsageError with
// name:line.
std::vector<Given> parse_yaml(const std::string& text, const std::string& name);

// Reads a file. UsageError also for PETSc's plain form, .opts, with what to do instead. Not collective: for
// rank 0.
std::vector<Given> read_scene(const std::string& path);

}  // namespace stickslip
