#include "stickslip/options/options.hpp"

#include <algorithm>
#include <set>

#include "base/failure.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"

namespace stickslip {

// Whether an option's value is the name of one that a command varies.
static bool names_an_option(const std::string& name) {
  static const std::set<std::string> single = {"boundary_parameter", "boundary_parameter2",
                                               "cycle_continue",     "wave_continue",
                                               "wave_continue2",     "chart_parameter"};
  return single.count(name) > 0;
}

bool takes_away(const OptionSpec& spec, const std::string& text) {
  const bool any_text =
      (spec.type == OptionType::text && !names_an_option(spec.name)) || spec.type == OptionType::text_list;
  return !any_text && (text == "none" || text == "unlimited") && text == spec.default_help &&
         spec.default_text.empty();
}

// The program's own notation of a method: rk:5dp, or arkimex:4:friction.
static std::vector<Given> parts_of_method(const std::string& text, const std::string& where) {
  const std::vector<std::string> parts = split(text, ':');
  const std::string type = lower_case(parts[0]), family = type.rfind("fused", 0) == 0 ? type.substr(5) : type;
  std::vector<Given> given = {{"ts_type", type, where},
                              {family == "bdf" ? "ts_bdf_order" : "ts_" + family + "_type", parts[1], where}};
  if (parts.size() > 2) given.push_back({"imex_implicit", parts[2], where});
  return given;
}

void Options::set(const Given& given) {
  const OptionSpec* spec = find_option(given.name);
  if (spec) {
    std::string text = given.text.value_or("");
    if (!given.text) {
      if (spec->type != OptionType::boolean)
        throw usage_error("-{}{}: needs a value, {}", spec->name, in_place(given.where), requirement(*spec));
      text = "true";
    }
    const bool gone = takes_away(*spec, text);
    if (!gone) check_value(*spec, text, given.where);
    lines_[spec->name] = gone || given.where.find(':') == std::string::npos ? "" : given.where;
    if (gone || (spec->type == OptionType::integer && is_word(*spec, text)))  // the latter: auto
      values_.erase(spec->name);
    else
      values_[spec->name] = text;
    return;
  }
  const std::string name = lower_case(given.name);
  if (const std::string advice = instead_of_gone(name); !advice.empty())
    throw usage_error("-{}{}: this option is gone; {}", given.name, in_place(given.where), advice);
  if (!is_library_option(name)) {
    std::string message = "unknown option -" + quoted(given.name) + in_place(given.where);
    const auto equals = given.name.find('=');
    if (equals != std::string::npos && (find_option(given.name.substr(0, equals)) ||
                                        is_library_option(lower_case(given.name.substr(0, equals))))) {
      message += "; write the value as a word of its own: -" + given.name.substr(0, equals) + " " +
                 quoted(given.name.substr(equals + 1));
    } else {
      const std::string near = did_you_mean(nearest_option(given.name), "-");
      message += near.empty() ? "; -help lists the options" : near;
    }
    throw UsageError(message);
  }
  if (name == "ts_type" && given.text && given.text->find(':') != std::string::npos) {
    for (const Given& part : parts_of_method(*given.text, given.where)) set(part);
    return;
  }
  library_[name] = check_library_value(name, given.text, given.where).value_or("");
}

Options Options::from(const std::string& command, const std::vector<Given>& given) {
  Options options;
  for (const Given& one : given) options.set(one);
  return options.for_command(command);
}

Options Options::for_command(const std::string& command) const {
  Options options = *this;
  options.command_ = command;
  const auto only_one = [&options](const std::vector<const char*>& names) {
    std::string set;
    int count = 0;
    for (const char* name : names) {
      if (!options.is_set(name)) continue;
      set += (count++ ? " and -" : "-") + std::string(name) + " " + quoted(options.text(name));
    }
    if (count > 1) throw UsageError(set + ": give only one of them");
  };
  if (command == "run") only_one({"out_every", "out_frames", "out_times"});
  if (command == "wave") only_one({"wave_length", "wave_speed"});
  return options;
}

Options Options::with(const std::string& name, const std::string& text) const {
  Options copy = *this;
  const OptionSpec* spec = find_option(name);
  if (text.empty()) {
    copy.values_.erase(spec ? spec->name : name);
    copy.library_.erase(lower_case(name));
  } else {
    copy.set({name, text, ""});
  }
  return copy;
}

Options Options::with(const std::string& name, double value) const { return with(name, number_text(value)); }

Options Options::resumed_from(const std::map<std::string, std::string>& stored) const {
  const auto may_differ = [](const std::string& name) {
    static const std::set<std::string> names = {"ts_max_time", "ts_max_steps", "ts_max_wall", "ts_max_plate",
                                                "summary",     "progress",     "restart"};
    return names.count(name) || name.rfind("out_", 0) == 0 || only_looks(name);
  };
  Options merged;
  merged.command_ = command_;
  for (const auto& [name, text] : stored) {
    if (name == "restart") continue;
    // A frame rule of this command line replaces that of the file.
    const bool frames = name == "out_every" || name == "out_frames" || name == "out_times";
    if (frames && (is_set("out_every") || is_set("out_frames") || is_set("out_times"))) continue;
    if (only_looks(name)) continue;
    merged.set({name, text, "the checkpoint"});
  }
  std::map<std::string, std::string> wishes = given();
  for (const auto& [name, line] : lines_)  // a word has taken the others away
    if (wishes.count(name) == 0) wishes[name] = find_option(name)->default_help;
  for (const auto& [name, text] : wishes) {
    const auto it = stored.find(name);
    if (!is_set(name) && (may_differ(name) || it == stored.end())) {
      merged.values_.erase(name);
      continue;
    }
    if (may_differ(name)) {
      if (find_option(name)) {
        merged.values_[name] = text;
      } else {
        merged.library_[name] = library_.at(name);
      }
      continue;
    }
    if (it == stored.end() || it->second != text)
      throw usage_error(
          "-{} {}: a restart takes its settings from the checkpoint ({}); only ts_max_time, ts_max_steps, "
          "ts_max_wall, ts_max_plate, out_*, summary and progress may differ",
          name, quoted(text), it == stored.end() ? "where it is not set" : quoted(it->second));
  }
  return merged;
}

// The options that take other values in the course of the command.
static std::set<std::string> varied_by(const Options& options) {
  std::set<std::string> names;
  for (const OptionSpec& spec : option_table()) {
    const bool list = spec.name.rfind("sweep_parameter", 0) == 0 || spec.name == "boundary_same";
    if (!list && !names_an_option(spec.name)) continue;
    for (const std::string& name : split_list(options.text(spec.name))) names.insert(lower_case(name));
  }
  return names;
}

std::vector<std::string> Options::idle() const {
  std::vector<std::string> all;
  const std::set<std::string> varied = varied_by(*this);
  for (const auto& [name, text] : values_) {
    const OptionSpec& spec = *find_option(name);
    if (!spec.idle_of || !reads_option(command_, spec) || varied.count(lower_case(name))) continue;
    const std::string why = spec.idle_of(*this);
    if (!why.empty() && !varied.count(why.substr(0, why.find(' '))))
      all.push_back("-" + name + " (" + why + ")");
  }
  return all;
}

bool Options::is_set(const std::string& name) const {
  const OptionSpec* spec = find_option(name);
  return spec ? values_.count(spec->name) > 0 : library_.count(lower_case(name)) > 0;
}

std::string Options::line_in_scene(const std::string& name) const {
  const auto it = lines_.find(name);
  return it == lines_.end() ? "" : it->second;
}

static std::string default_of(const OptionSpec& spec, const Options& options) {
  if (!spec.default_text.empty()) return spec.default_text;
  return spec.default_of ? spec.default_of(options) : "";
}

std::string Options::text(const std::string& name) const {
  const OptionSpec* spec = find_option(name);
  if (!spec) {
    const auto it = library_.find(lower_case(name));
    return it == library_.end() ? "" : it->second;
  }
  const auto it = values_.find(spec->name);
  return it != values_.end() ? it->second : default_of(*spec, *this);
}

namespace {

// What the text of an option was read as; it has been checked before.
template <class T>
T checked(const std::optional<T>& value, const std::string& name, const std::string& text) {
  if (!value) throw std::logic_error("option " + name + " has no such value: " + quoted(text));
  return *value;
}

}  // namespace

double Options::real(const std::string& name) const {
  return checked(parse_number(text(name)), name, text(name));
}

PetscInt Options::integer(const std::string& name) const {
  return PetscInt(checked(parse_integer(text(name)), name, text(name)));
}

PetscInt Options::integer_of(const std::string& text) { return PetscInt(*parse_integer(text)); }

bool Options::boolean(const std::string& name) const {
  return checked(parse_boolean(text(name)), name, text(name));
}

std::vector<double> Options::reals(const std::string& name) const {
  std::vector<double> values;
  for (const std::string& word : words(name)) values.push_back(*parse_number(word));
  return values;
}

std::vector<PetscInt> Options::integers(const std::string& name) const {
  std::vector<PetscInt> values;
  for (const std::string& word : words(name)) values.push_back(PetscInt(*parse_integer(word)));
  return values;
}

std::vector<std::string> Options::words(const std::string& name) const {
  const std::string list = text(name);
  return list.empty() ? std::vector<std::string>() : split_list(list);
}

std::vector<std::pair<double, double>> Options::pairs(const std::string& name) const {
  const std::string list = text(name);
  if (list.empty()) return {};
  const std::optional<Pairs> read = parse_pairs(list);
  if (!read) throw std::logic_error("option " + name + " has no such value: " + quoted(list));
  return *read;
}

std::optional<double> Options::real_if_set(const std::string& name) const {
  return is_set(name) ? std::optional<double>(real(name)) : std::nullopt;
}

std::optional<PetscInt> Options::integer_if_set(const std::string& name) const {
  return is_set(name) ? std::optional<PetscInt>(integer(name)) : std::nullopt;
}

StepsOrSeconds Options::steps_or_seconds(const std::string& name) const {
  return parse_steps_or_time(text(name)).value_or(StepsOrSeconds());
}

std::map<std::string, std::string> Options::all() const {
  std::map<std::string, std::string> result;
  for (const OptionSpec& spec : option_table()) {
    const auto set = values_.find(spec.name);
    if (set != values_.end())
      result[spec.name] = set->second;
    else if (reads_option(command_, spec))
      result[spec.name] = default_of(spec, *this);
  }
  for (const auto& [name, text] : given()) result[name] = text;
  return result;
}

std::map<std::string, std::string> Options::given() const {
  std::map<std::string, std::string> result = values_;
  for (const auto& [name, text] : library_) result[name] = text.empty() ? "true" : text;
  return result;
}

}  // namespace stickslip
