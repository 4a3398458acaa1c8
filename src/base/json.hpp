// JSON: the values of nlohmann's library, with objects that keep the order of their keys, and their text.
// Where values are made, base/json_values.hpp is included as well.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace stickslip {

using Json = nlohmann::ordered_json;

// indent 0: all in one line. Otherwise one member a line, arrays of plain values in one line. Reals are
// written with the fewest digits that give the same double back (and always look like reals: 60.0); what is
// not finite becomes null; text that is not UTF-8 has its bad bytes replaced by U+FFFD.
std::string json_text(const Json& value, int indent = 2);

// An object of texts in one line, and read back. Throws std::runtime_error where the text is something else.
std::string text_of_map(const std::map<std::string, std::string>& values);
std::map<std::string, std::string> parse_text_map(const std::string& json);

}  // namespace stickslip
