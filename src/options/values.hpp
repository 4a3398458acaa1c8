// Options as text: numbers, lists, steps or times. Local to the process.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"

namespace stickslip {

// A decimal number, nothing before or after it. Also returns the infinities and nan, and overflow as infinity.
std::optional<double> parse_number(const std::string& text);
// Decimal digits, or a number such as 1e6 whose value is an integer below 2^53.
std::optional<double> parse_integer(const std::string& text);
std::optional<bool> parse_boolean(const std::string& text);
std::vector<std::string> split_list(const std::string& text);  // at commas, without spaces around
std::optional<StepsOrSeconds> parse_steps_or_time(const std::string& text);
// " (scene.yaml:3)", for messages; "" for the command line.
std::string in_place(const std::string& where);

}  // namespace stickslip
