// Text for people: numbers, names, what was typed. Local to the process.
#pragma once

#include <string>
#include <vector>

namespace stickslip {

// The name in `names` nearest to `name` (by edit distance, or with its beginning or end left out), or ""
// where none is near.
std::string nearest_name(const std::string& name, const std::vector<std::string>& names);

// "; did you mean X?", or "" without a name.
std::string did_you_mean(const std::string& name, const char* before = "");
// With the nearest name.
std::string suggestion(const std::string& name, const std::vector<std::string>& names,
                       const char* before = "");

// Shortest text that reads back as the same number.
std::string number_text(double value);
// To so many significant digits, for messages.
std::string rounded_text(double value, int digits = 3);

// The text with blanks for control characters, whatever it holds.
std::string one_line(std::string text);
// Text as it may stand in a one-line message: control characters replaced, cut at 80 characters.
std::string quoted(const std::string& text);

std::string lower_case(std::string text);

// The parts between separators; one more than there are separators, each possibly empty.
std::vector<std::string> split(const std::string& text, char separator);
// The inverse.
std::string joined(const std::vector<std::string>& parts, const std::string& separator = ", ");
// Without blanks and tabs at its ends.
std::string trimmed(const std::string& text);

}  // namespace stickslip
