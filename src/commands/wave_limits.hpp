// What the command `wave` says of the places where trains end and where their stability changes.
#pragma once

#include "stickslip/options/options.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/summary.hpp"
#include "stickslip/waves/branch.hpp"

namespace stickslip {

// Keys `special`, with wave_continue2 `curves`, in the summary and in the file.
void add_limits(Summary& summary, ResultFile& file, const Options& options, const Branch& branch);

}  // namespace stickslip
