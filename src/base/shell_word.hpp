// Commands to type.
#pragma once

#include <string>

namespace stickslip {

// A word as a POSIX shell would need it typed.
std::string shell_word(const std::string& word);

}  // namespace stickslip
