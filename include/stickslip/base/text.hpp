// Text for people: numbers, names, what was typed. Local to the process.
#pragma once

#include <map>
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

// What quantities are measured in and what options are called in words for people: the options units_* and
// labels. The one place that knows the unit of a quantity, by its dimension in length, time and force. No
// number depends on any of it. Noted once, as a command begins; local to the process.
struct Names {
  // texts of the user's, "" where they were not given
  std::string length, time, force;
  // Of a chain places are counted in blocks: what is measured along it (x, speeds of waves) has no length.
  bool counts_blocks = false;
  std::map<std::string, std::string> labels;  // option to words
};
void note_names(Names names);
const Names& names();

// "m^2/s" for the dimension "length^2/time", written as columns and options do: length, time, force, velocity
// and powers of them; of "A; chain: B" what holds for the form. "" where that is 1 or nothing known, or where
// the units that it takes were not given. `name`: of the quantity or option.
std::string unit_of(const std::string& dimension, const std::string& name = "");
// A number as text, with the unit behind it.
std::string in_unit(const std::string& number, const std::string& dimension, const std::string& name = "");
std::string in_unit(double value, int digits, const std::string& dimension, const std::string& name = "");
// "0.01227 +- 0.00031": down to the second digit of the error; six digits of the value where that is unknown.
std::string with_error(double value, double error);
// A frequency in radians a unit of time: "623 1/s (99.2 Hz)"; the number alone without a unit of time.
std::string frequency_text(double value, int digits);
// "0.0101 s (99.2 Hz)".
std::string period_text(double value, int digits);
// What an option is called: its label, or its name.
std::string called(const std::string& option);

}  // namespace stickslip
