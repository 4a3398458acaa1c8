#include "options/values.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>

#include "base/failure.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {
constexpr double inf = std::numeric_limits<double>::infinity();
}  // namespace

int utf8_length(const std::string& text, std::size_t at) {
  const auto byte = [&text](std::size_t i) { return i < text.size() ? (unsigned char)text[i] : 0u; };
  const unsigned first = byte(at);
  if (first < 0x80) return 1;
  const int length = first >= 0xF0 && first < 0xF5   ? 4
                     : first >= 0xE0 && first < 0xF0 ? 3
                     : first >= 0xC2 && first < 0xE0 ? 2
                                                     : 0;
  for (int i = 1; i < length; ++i)
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
  return length;
}

std::optional<double> parse_number(const std::string& text) {
  const char *first = text.data(), *last = first + text.size();
  if (first != last && *first == '+' && text.size() > 1 && text[1] != '-' && text[1] != '+') ++first;
  double value = 0;
  const auto [end, error] = std::from_chars(first, last, value);
  if (error == std::errc::invalid_argument || end != last) return std::nullopt;
  if (error == std::errc::result_out_of_range) {
    // The library does not say whether it was too large or too small: an exponent sign of minus is too small.
    return lower_case(text).find("e-") == std::string::npos ? inf : 0;
  }
  return value;
}

std::optional<double> parse_integer(const std::string& text) {
  const std::optional<double> value = parse_number(text);
  if (!value || !std::isfinite(*value) || *value != std::floor(*value)) return std::nullopt;
  return value;
}

std::optional<bool> parse_boolean(const std::string& text) {
  const std::string word = lower_case(text);
  for (const char* yes : {"true", "yes", "on", "1"})
    if (word == yes) return true;
  for (const char* no : {"false", "no", "off", "0"})
    if (word == no) return false;
  return std::nullopt;
}

std::string name_by_meaning(const std::string& word) {
  static const std::map<std::string, std::vector<std::string>> meanings = {
      {"friction_fs or -friction_fd", {"mu", "coefficient_of_friction"}},
      {"friction_fs", {"mu_s", "mus", "static_friction", "static"}},
      {"friction_fd",
       {"mu_k", "mu_d", "muk", "mud", "kinetic_friction", "dynamic_friction", "kinetic", "dynamic"}},
      {"friction_D", {"dc", "d_c", "dcrit", "d_rs", "drs"}},
      {"friction_psi0", {"v0", "v_ref", "vref", "reference_velocity"}},
      {"model_k0", {"k", "kp", "k_p", "stiffness", "spring", "spring_constant"}},
      {"model_v", {"velocity", "speed", "vp", "v_p", "plate_velocity", "loading_velocity", "belt_speed"}},
      {"model_zeta", {"damping", "damper", "dashpot", "viscosity"}},
      {"model_m", {"mass"}},
      {"model_f0", {"normal_force", "normal_load", "normal_stress"}},
      {"grid_n", {"blocks", "nodes", "points", "size"}},
      {"ts_max_time", {"time", "t_end", "tend", "tmax", "t_max", "end_time", "final_time", "ts_final_time"}},
      {"ts_dt", {"dt", "time_step", "timestep"}},
      {"ts_rtol", {"rtol", "tolerance", "tol"}},
      {"out_file", {"o", "out", "output", "outfile", "output_file"}},
      {"rate-and-state", {"rate-state", "rate_state", "rate_and_state", "rsf"}},
      {"velocity", {"fixed", "held", "dirichlet", "clamped"}},
      {"periodic", {"ring", "cyclic"}},
      {"ageing", {"aging-law", "dieterich-ruina"}},
      {"slip", {"ruina", "slip-law"}}};
  const std::string low = lower_case(word);
  const std::size_t group = low.find('_');
  for (const std::string& name : {low, group == std::string::npos ? low : low.substr(group + 1)})
    for (const auto& [own, others] : meanings)
      if (std::find(others.begin(), others.end(), name) != others.end()) return own;
  return "";
}

std::vector<std::string> split_list(const std::string& text) {
  std::vector<std::string> parts = split(text, ',');
  for (std::string& part : parts) part = trimmed(part);
  return parts;
}

std::vector<std::string> split_words(const std::string& text, const std::string& where) {
  const char* const blank = " \t\r\n";
  std::vector<std::string> words;
  for (std::size_t at = 0; (at = text.find_first_not_of(blank, at)) != std::string::npos;) {
    const bool in_quotes = text[at] == '"' || text[at] == '\'';
    const std::size_t begin = in_quotes ? at + 1 : at;
    const std::size_t end =
        std::min(text.size(), in_quotes ? text.find(text[at], begin) : text.find_first_of(blank, begin));
    if (in_quotes && end == text.size()) throw UsageError(where + ": a quote is not closed");
    words.push_back(text.substr(begin, end - begin));
    at = in_quotes ? end + 1 : end;
  }
  return words;
}

std::optional<Pairs> parse_pairs(const std::string& text) {
  Pairs pairs;
  for (const std::string& part : split_list(text)) {
    const std::size_t colon = part.find(':');
    if (colon == std::string::npos) return std::nullopt;
    const std::optional<double> x = parse_number(trimmed(part.substr(0, colon)));
    const std::optional<double> value = parse_number(trimmed(part.substr(colon + 1)));
    if (!x || !value || !std::isfinite(*x) || !std::isfinite(*value)) return std::nullopt;
    const std::size_t n = pairs.size();
    if (n > 0 && *x < pairs[n - 1].first) return std::nullopt;
    if (n > 1 && *x == pairs[n - 2].first) return std::nullopt;
    pairs.emplace_back(*x, *value);
  }
  return pairs;
}

std::string pairs_text(const Pairs& pairs) {
  std::string text;
  for (const auto& [x, value] : pairs)
    text += (text.empty() ? "" : ",") + number_text(x) + ":" + number_text(value);
  return text;
}

std::optional<StepsOrSeconds> parse_steps_or_time(const std::string& text) {
  static const std::map<char, double> seconds_in = {{'s', 1}, {'m', 60}, {'h', 3600}};
  StepsOrSeconds result;
  const auto unit = seconds_in.find(text.empty() ? ' ' : text.back());
  if (unit != seconds_in.end()) {
    const std::optional<double> value = parse_number(text.substr(0, text.size() - 1));
    if (!value || !std::isfinite(*value) || *value <= 0) return std::nullopt;
    result.seconds = *value * unit->second;
  } else {
    const std::optional<double> value = parse_integer(text);
    if (!value || *value < 1 || *value > int_max) return std::nullopt;
    result.steps = PetscInt(*value);
  }
  return result;
}

namespace {

bool in_range(const OptionSpec& spec, double value) {
  return (spec.open_low ? value > spec.low : value >= spec.low) && value <= spec.high;
}

bool is_acceptable(const OptionSpec& spec, const std::string& text) {
  const auto real = [&spec](const std::string& part) {
    const std::optional<double> value = parse_number(part);
    return value && std::isfinite(*value) && in_range(spec, *value);
  };
  const auto integer = [&spec](const std::string& part) {
    const std::optional<double> value = parse_integer(part);
    return value && in_range(spec, *value);
  };
  const auto every = [&text](const auto& accepts) {
    const std::vector<std::string> parts = split_list(text);
    return std::all_of(parts.begin(), parts.end(), accepts);
  };
  switch (spec.type) {
    case OptionType::real: return real(text);
    case OptionType::integer: return is_word(spec, text) || integer(text);
    case OptionType::boolean: return bool(parse_boolean(text));
    case OptionType::text: return !text.empty();
    case OptionType::choice: return is_word(spec, text);
    case OptionType::real_list: return every(real);
    case OptionType::integer_list: return every(integer);
    case OptionType::text_list: return every([](const std::string& part) { return !part.empty(); });
    case OptionType::real_or_word: return is_word(spec, text) || real(text);
    case OptionType::pairs: {
      const std::optional<Pairs> pairs = parse_pairs(text);
      return pairs && std::all_of(pairs->begin(), pairs->end(),
                                  [&spec](const auto& pair) { return in_range(spec, pair.second); });
    }
    case OptionType::steps_or_time: return bool(parse_steps_or_time(text));
    case OptionType::wall_time: {
      const std::optional<StepsOrSeconds> value = parse_steps_or_time(text);
      return value && value->seconds > 0;
    }
  }
  return false;
}

std::string range_text(const OptionSpec& spec) {
  if (spec.high < inf && spec.low > -inf)
    return " from " + number_text(spec.low) + " to " + number_text(spec.high);
  if (spec.low > -inf) return (spec.open_low ? " > " : " >= ") + number_text(spec.low);
  if (spec.high < inf) return " <= " + number_text(spec.high);
  return "";
}

std::string or_words(const OptionSpec& spec) {
  return spec.words.empty() ? "" : ", or " + joined(spec.words);
}

}  // namespace

bool is_word(const OptionSpec& spec, const std::string& text) {
  const auto means = [&](const std::string& word) {
    const auto colon = word.find(":NUMBER");  // a positive one stands there
    if (colon == std::string::npos || text.compare(0, colon + 1, word, 0, colon + 1) != 0)
      return text == word;
    const std::optional<double> number = parse_number(text.substr(colon + 1));
    return number && *number > 0 && std::isfinite(*number);
  };
  return std::any_of(spec.words.begin(), spec.words.end(), means);
}

std::string requirement(const OptionSpec& spec) {
  switch (spec.type) {
    case OptionType::real: return "a finite number" + range_text(spec);
    case OptionType::integer: return "an integer" + range_text(spec) + or_words(spec);
    case OptionType::boolean: return "true or false";
    case OptionType::text: return "not empty";
    case OptionType::choice: return "one of " + joined(spec.words);
    case OptionType::real_list: return "finite numbers" + range_text(spec) + ", separated by commas";
    case OptionType::integer_list: return "integers" + range_text(spec) + ", separated by commas";
    case OptionType::text_list: return "words separated by commas";
    case OptionType::real_or_word: return "a finite number" + range_text(spec) + or_words(spec);
    case OptionType::pairs:
      if (spec.fault)
        return "x1:y1,x2:y2,... with x ascending, each once, or a file of two columns (FILE:1,3 of more)";
      return "x1:value1,x2:value2,... with x ascending, each at most twice, and values that are finite" +
             range_text(spec) + ", or a file of two columns (FILE:1,3 of more)";
    case OptionType::steps_or_time: return "a number of steps (500) or a time (30s, 10m, 2h)";
    case OptionType::wall_time: return "a time (30s, 10m, 2h)";
  }
  return "";
}

const OptionSpec& real_option(const std::string& by, const std::string& name, const std::string& why) {
  const auto is_real = [](const OptionSpec& o) {
    return o.type == OptionType::real || o.type == OptionType::real_or_word;
  };
  const OptionSpec* spec = find_option(name);
  if (spec && is_real(*spec)) return *spec;
  if (spec) throw usage_error("{} {}: takes {}; {}", by, spec->name, requirement(*spec), why);
  std::vector<std::string> names;
  for (const OptionSpec& o : option_table())
    if (is_real(o)) names.push_back(o.name);
  const std::string near = suggestion(lower_case(name), names);
  throw usage_error("{} {}: no such option{}", by, quoted(name),
                    near.empty() ? "; give a real one, such as model_v" : near);
}

std::string in_place(const std::string& where) { return where.empty() ? "" : " (" + where + ")"; }

void check_value(const OptionSpec& spec, const std::string& text, const std::string& where) {
  if (is_acceptable(spec, text)) {
    if (!spec.fault) return;
    std::size_t at = 0;
    const std::string fault = spec.fault(*parse_pairs(text), at);
    if (fault.empty()) return;
    throw usage_error("-{}{}, point {}: {}", spec.name, in_place(where), at + 1, fault);
  }
  if (spec.type == OptionType::real && text.find(',') != std::string::npos) {
    std::string point = text;
    std::replace(point.begin(), point.end(), ',', '.');
    if (is_acceptable(spec, point))
      throw usage_error("-{} {}{}: a decimal point, not a comma: {}", spec.name, quoted(text),
                        in_place(where), point);
  }
  const std::size_t ending = text.rfind('.');  // of a file: letters
  if (spec.type == OptionType::pairs && ending != std::string::npos && ending + 1 < text.size() &&
      std::isalpha(static_cast<unsigned char>(text[ending + 1])))
    throw usage_error("-{} {}{}: there is no such file, and it is not {}", spec.name, quoted(text),
                      in_place(where), requirement(spec));
  const std::string meant = name_by_meaning(text);
  const bool is_meant = std::find(spec.words.begin(), spec.words.end(), meant) != spec.words.end();
  // The bound itself is the value whose refusal may surprise: what the option is says why.
  const bool at_bound = spec.type == OptionType::real && spec.open_low && parse_number(text) == spec.low;
  throw usage_error("-{} {}{}: must be {}{}{}", spec.name, quoted(text), in_place(where), requirement(spec),
                    at_bound ? " (" + spec.help + ")" : "",
                    is_meant ? did_you_mean(meant) : suggestion(text, spec.words));
}

}  // namespace stickslip
