// Options as text: numbers, lists, steps or times. Local to the process.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/options/options.hpp"

namespace stickslip {

constexpr double count_max = 9e15;  // below 2^53: exact as a double
// The largest integer of an option: one of PETSc's, of 32 or 64 bits, that is exact as a double.
constexpr double int_max = std::min(double(std::numeric_limits<PetscInt>::max()), count_max);

// A decimal number, nothing before or after it. Also returns the infinities and nan, and overflow as
// infinity.
std::optional<double> parse_number(const std::string& text);
// Decimal digits, or a number such as 1e6 whose value is an integer below 2^53.
std::optional<double> parse_integer(const std::string& text);
std::optional<bool> parse_boolean(const std::string& text);
std::vector<std::string> split_list(const std::string& text);  // at commas, without spaces around
// Number of bytes of the UTF-8 character at `at`, 0 where there is none.
int utf8_length(const std::string& text, std::size_t at);
// Words between blanks; one that begins with a quote ends with it, and may hold blanks. What follows a word
// that begins with `comment` (0: none does) is left out. Throws UsageError, which begins with `WHERE: `, for
// a quote that is not closed.
std::vector<std::string> split_words(const std::string& text, const std::string& where);
bool is_word(const OptionSpec& spec, const std::string& text);  // is it one of the spec's?
// x1:value1,x2:value2,... of finite numbers, x ascending, each at most twice.
using Pairs = std::vector<std::pair<double, double>>;
// What others call an option or one of its words, in the names of this program; "" where nobody does.
std::string name_by_meaning(const std::string& word);

std::optional<Pairs> parse_pairs(const std::string& text);
std::string pairs_text(const Pairs& pairs);
std::optional<StepsOrSeconds> parse_steps_or_time(const std::string& text);
// The real option of this name, in any case of letters, which the option `by` names. Throws UsageError: there
// is none (and which is the nearest), or it is not real; `why` it must be.
const OptionSpec& real_option(const std::string& by, const std::string& name, const std::string& why);
// " (scene.yaml:3)", for messages; "" for the command line.
std::string in_place(const std::string& where);

// Whether this is a word in place of the option's value that takes away what stands below it, say the load of
// a scene (-load_v none): `none` or `unlimited`, where the option's help shows that as its default and a text
// may not mean something else.
bool takes_away(const OptionSpec& spec, const std::string& text);

// Text files of numbers in columns, as measuring programs and spreadsheets write them. Not collective.
struct Rows {
  std::vector<std::vector<double>> values;
  std::vector<std::size_t> lines;  // of the file, from 1
};

// Whether there is such a file, `given` as below.
bool names_table(const std::string& given, const std::string& where);

// `given` with one column more than those that it names; than the first two where it names none.
std::string with_column(const std::string& given, const std::string& where, const std::string& column);

// Reads `given`: the name of a file, or FILE:COLUMN,COLUMN,... with columns by number from 1 or by their
// names in a header. Between columns stand semicolons, tabs, commas or blanks, whichever the first row of
// numbers has; where that is no comma, a comma is a decimal point. Words may stand in quotes. Lines that
// begin with # or % are comments, # after a blank begins one; rows of words before the numbers are a header.
// A file that is not there is looked for beside `where`, the scene's file and line that name it.
// A line among the words that close the command says what was read: how many rows, which columns, whether
// there is a header.
// Rows are of `least` to `most` numbers, each of as many as the first. Throws UsageError with the option, the
// file, the line and the column: cannot be read, no such column, not finite, no row at all.
Rows read_columns(const std::string& option, const std::string& given, const std::string& where,
                  std::size_t least, std::size_t most);

}  // namespace stickslip
