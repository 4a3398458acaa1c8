#include "stickslip/options/command_line.hpp"

#include <algorithm>
#include <cstdlib>
#include <set>

#include "base/failure.hpp"
#include "base/json_values.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

namespace {

// -name or --name; a number such as -1.5 is none.
bool is_name(const std::string& word) {
  const std::size_t first = word.compare(0, 2, "--") == 0 ? 2 : 1;
  const char c = word.size() > first && word[0] == '-' ? lower_case(word)[first] : ' ';
  if (c < 'a' || c > 'z') return false;
  const std::string rest = lower_case(word.substr(first));
  return rest != "inf" && rest != "infinity";  // numbers, though not welcome ones
}
std::string name_in(const std::string& word) { return word.substr(word.compare(0, 2, "--") == 0 ? 2 : 1); }

// Whether `word` can be the value of option `name`; where not, it may be the scene. Text is anything; a list
// of frames is never a scene; and no option of a library takes a scene.
bool takes(const std::string& name, const std::string& word) {
  if (!has_scene_suffix(word)) return true;
  if (lower_case(name) == "options_file") return true;
  const OptionSpec* spec = find_option(name);
  return spec && spec->type != OptionType::boolean;
}

// Adds the options among the words to `given`; returns the words that belong to none.
std::vector<std::string> read_words(const std::vector<std::string>& words, const std::string& where,
                                    std::vector<Given>& given) {
  std::vector<std::string> stray;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (!is_name(words[i])) {
      stray.push_back(words[i]);
      continue;
    }
    given.push_back({name_in(words[i]), std::nullopt, where});
    if (i + 1 < words.size() && !is_name(words[i + 1]) && takes(given.back().name, words[i + 1]))
      given.back().text = words[++i];
  }
  return stray;
}

bool is_options_file(const Given& given) { return lower_case(given.name) == "options_file"; }
bool is_help(const Given& given) { return lower_case(given.name) == "help" || lower_case(given.name) == "h"; }

// A scene's own complaints that the table cannot make: a key without a value.
std::vector<Given> scene_options(const std::string& path) {
  std::vector<Given> given = read_scene(path);
  for (const Given& one : given) {
    if (is_options_file(one) || is_help(one) || one.name == "version")
      throw UsageError(one.where + ": " + one.name + " has no place in a scene");
    if (one.text) continue;
    const OptionSpec* spec = find_option(one.name);
    if (spec) throw usage_error("{}: {} needs a value, {}", one.where, one.name, requirement(*spec));
    for (const OptionSpec& other : option_table())
      if (lower_case(other.name).rfind(lower_case(one.name) + "_", 0) == 0)
        throw UsageError(one.where + ": nothing stands under " + one.name);
  }
  return given;
}

// Puts the numbers of a file of two columns in the place of its name: so they stand in every file that is
// written, and a restart does not read it again.
// `weights`: of its rows, a third column, whose name gives way to its numbers likewise.
void take_in_table(Given& given, Given* weights = nullptr) {
  const OptionSpec* spec = find_option(given.name);
  if (!spec || spec->type != OptionType::pairs || !given.text || takes_away(*spec, *given.text)) return;
  const bool may_be_pairs = given.text->find(':') != std::string::npos;
  if (may_be_pairs && (parse_pairs(*given.text) || !names_table(*given.text, given.where))) return;
  Pairs pairs;
  const std::size_t columns = weights ? 3 : 2;
  const std::string table = weights ? with_column(*given.text, given.where, *weights->text) : *given.text;
  const Rows rows = read_columns(spec->name, table, given.where, columns, columns);
  std::string third;
  for (const std::vector<double>& row : rows.values) {
    pairs.emplace_back(row[0], row[1]);
    if (weights) third += (third.empty() ? "" : ",") + number_text(row[2]);
  }
  if (weights) weights->text = third;
  std::size_t at = 0;
  const std::string fault = spec->fault ? spec->fault(pairs, at) : "";
  if (!fault.empty())
    throw usage_error("-{} {}:{}{}: {}", spec->name, stickslip::quoted(*given.text), rows.lines[at],
                      in_place(given.where), fault);
  const std::string text = pairs_text(pairs);
  if (!parse_pairs(text))
    throw usage_error("-{} {}{}: the first column must ascend, each number at most twice", spec->name,
                      stickslip::quoted(*given.text), in_place(given.where));
  given.text = text;
}

// Of an option that is given more than once the last counts, and only what counts is judged.
void keep_last(std::vector<Given>& given) {
  std::set<std::string> seen;
  const auto is_later = [&seen](const Given& one) {
    const OptionSpec* spec = find_option(one.name);
    return !seen.insert(spec ? spec->name : lower_case(one.name)).second;
  };
  given.erase(given.begin(), std::remove_if(given.rbegin(), given.rend(), is_later).base());
}

// `labels: {model_v: disc speed}` is one option, whose text has each label behind its name.
void gather_labels(std::vector<Given>& given) {
  std::optional<Given> all;
  for (const Given& one : given) {
    const std::string low = lower_case(one.name), prefix = "labels_";
    const bool is_list = low == "labels";
    if (!one.text || (!is_list && low.rfind(prefix, 0) != 0)) continue;
    const std::string more = is_list ? *one.text : one.name.substr(prefix.size()) + ": " + *one.text;
    if (!is_list && one.text->find(',') != std::string::npos)
      throw usage_error("-{} {}{}: a label is words without a comma", one.name, stickslip::quoted(*one.text),
                        in_place(one.where));
    if (all)
      *all->text += "," + more;
    else
      all = Given{"labels", more, one.where};
  }
  if (!all) return;
  given.erase(std::remove_if(given.begin(), given.end(),
                             [](const Given& one) { return lower_case(one.name).rfind("labels", 0) == 0; }),
              given.end());
  given.push_back(*all);
}

// Help or the version, asked for without a command.
CommandLine read_without_command(const std::vector<std::string>& words, const std::string& usage) {
  CommandLine line;
  const std::string name = lower_case(name_in(words[0]));
  line.help = name == "help" || name == "h";
  line.version = name == "version";
  if (!line.help && !line.version)
    throw UsageError("-" + quoted(name_in(words[0])) + " where the command should stand; usage: " + usage);
  line.help_all = words.size() == 2 && line.help && words[1] == "all";
  if (words.size() > 1 && !line.help_all)
    throw usage_error("{}: not understood after {}; usage: {}", quoted(words[1]), words[0], usage);
  return line;
}

// The one scene among words that belong to no option; "" where there is none.
std::string scene_among(const std::vector<std::string>& stray) {
  std::string scene;
  for (const std::string& word : stray) {
    if (!has_scene_suffix(word))
      throw UsageError("stray word " + quoted(word) +
                       ": neither an option nor its value nor a scene (.yaml, .yml)");
    if (!scene.empty())
      throw usage_error("two scenes, {} and {}; one is read", stickslip::quoted(scene), quoted(word));
    scene = word;
  }
  return scene;
}

CommandLine read(const std::vector<std::string>& words, const std::vector<std::string>& commands) {
  const std::string usage = "stickslip COMMAND [SCENE.yaml] [options], COMMAND one of " + joined(commands) +
                            " (stickslip --help tells more)";
  if (words.empty()) throw UsageError("no command; usage: " + usage);
  if (words[0] == "help") {  // help COMMAND is COMMAND -help
    std::vector<std::string> same(words.begin() + 1, words.end());
    same.insert(same.empty() ? same.begin() : same.begin() + 1, "-help");
    return read(same, commands);
  }
  if (is_name(words[0])) return read_without_command(words, usage);
  CommandLine line;
  line.command = words[0];
  if (std::find(commands.begin(), commands.end(), line.command) == commands.end()) {
    if (has_scene_suffix(line.command))
      throw UsageError("no command before the scene: stickslip run " + stickslip::quoted(line.command));
    if (line.command == "plot")
      throw UsageError("no command plot: pictures are drawn by postprocess/plot.py FILE.h5");
    const std::string near = suggestion(line.command, commands);
    throw UsageError("unknown command " + stickslip::quoted(line.command) +
                     (near.empty() ? "; it is one of " + joined(commands) : near));
  }

  std::vector<Given> typed;  // what the environment holds comes first
  const char* environment = std::getenv("PETSC_OPTIONS");
  const auto misplaced =
      read_words(split_words(environment ? environment : "", "PETSC_OPTIONS"), "PETSC_OPTIONS", typed);
  const auto stray = read_words({words.begin() + 1, words.end()}, "", typed);
  for (const Given& given : typed) {
    if (lower_case(given.name) == "version") line.version = true;
    if (!is_help(given)) continue;
    line.help = true;
    if (!given.text || has_scene_suffix(*given.text)) continue;
    line.help_topic = lower_case(*given.text);
    if (line.help_topic == "all") line.help_all = true;
  }
  // -help all keeps the options: with -ts_type bdf it shows those of bdf
  if (line.version || (line.help && !line.help_all)) return line;

  const std::string scene = scene_among(stray);
  if (!misplaced.empty())
    throw UsageError("PETSC_OPTIONS: stray word " + quoted(misplaced[0]) + ": neither an option nor a value");
  const auto append = [&line](const std::vector<Given>& more) {
    line.given.insert(line.given.end(), more.begin(), more.end());
  };
  if (!scene.empty()) append(scene_options(scene));
  for (const Given& given : typed) {
    if (!is_options_file(given)) continue;
    if (!given.text) throw UsageError("-" + given.name + ": needs a file");
    append(scene_options(*given.text));
  }
  const char* yaml = std::getenv("PETSC_OPTIONS_YAML");
  if (yaml && *yaml)
    throw UsageError(
        "PETSC_OPTIONS_YAML: is not read; give -options_file FILE.yaml, or PETSC_OPTIONS with its words");
  for (const Given& given : typed)
    if (!is_help(given) && !is_options_file(given)) line.given.push_back(given);
  keep_last(line.given);
  gather_labels(line.given);
  const auto named = [&](const char* name) {
    return std::find_if(line.given.begin(), line.given.end(), [&](const Given& one) {
      const OptionSpec* spec = find_option(one.name);
      return spec && spec->name == name && one.text;
    });
  };
  const auto weights = named("fit_weights"), data = named("fit_data");
  if (weights != line.given.end() && data != line.given.end() &&
      weights->text->find(',') == std::string::npos &&
      !takes_away(*find_option("fit_weights"), *weights->text))
    take_in_table(*data, &*weights);
  for (Given& given : line.given) take_in_table(given);
  return line;
}

// As bytes and back, to send the result of rank 0 to the others.
std::vector<std::uint8_t> packed(const CommandLine& line) {
  Json given = Json::array();
  for (const Given& one : line.given) given.push_back(Json::array({one.name, Json(one.text), one.where}));
  return Json::to_msgpack(
      Json::array({line.command, line.help, line.help_all, line.version, line.help_topic, given}));
}

CommandLine unpacked(const std::vector<std::uint8_t>& bytes) {
  const Json json = Json::from_msgpack(bytes);
  CommandLine line{json[0], json[1], json[2], json[3], json[4], {}};
  for (const Json& one : json[5]) {
    line.given.push_back({one[0], std::nullopt, one[2]});
    if (!one[1].is_null()) line.given.back().text = one[1].get<std::string>();
  }
  return line;
}

}  // namespace

CommandLine read_command_line(int argc, char** argv, const std::vector<std::string>& commands,
                              MPI_Comm comm) {
  std::vector<std::uint8_t> bytes;
  on_root(comm, [&] { bytes = packed(read({argv + 1, argv + argc}, commands)); });
  broadcast(bytes, comm);
  return unpacked(bytes);
}

}  // namespace stickslip
