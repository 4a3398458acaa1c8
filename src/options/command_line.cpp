#include "stickslip/options/command_line.hpp"

#include <algorithm>
#include <cstdlib>

#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/options/scene_file.hpp"

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

// Whether `word` can be the value of option `name`; where not, it may be the scene. Text is anything; a list of
// frames is never a scene; and no option of a library takes a scene.
bool takes(const std::string& name, const std::string& word) {
  if (!has_scene_suffix(word)) return true;
  if (lower_case(name) == "options_file") return true;
  const OptionSpec* spec = find_option(name);
  return spec && spec->type != OptionType::boolean;
}

struct Words {
  std::vector<Given> given;
  std::vector<std::string> stray;
};

Words read_words(const std::vector<std::string>& words, const std::string& where) {
  Words result;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (!is_name(words[i])) {
      result.stray.push_back(words[i]);
      continue;
    }
    Given given{name_in(words[i]), std::nullopt, where};
    if (i + 1 < words.size() && !is_name(words[i + 1]) && takes(given.name, words[i + 1])) given.text = words[++i];
    result.given.push_back(std::move(given));
  }
  return result;
}

// Words between spaces; quotes keep spaces together.
std::vector<std::string> split_environment(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  bool inside = false;
  char mark = 0;
  for (char c : text) {
    if (mark) {
      if (c == mark) {
        mark = 0;
      } else {
        word += c;
      }
    } else if (c == '"' || c == '\'') {
      mark = c;
      inside = true;
    } else if (c == ' ' || c == '\t' || c == '\n' || c == '\r') {
      if (inside) words.push_back(word);
      word.clear();
      inside = false;
    } else {
      word += c;
      inside = true;
    }
  }
  if (mark) throw UsageError("PETSC_OPTIONS: a quote is not closed");
  if (inside) words.push_back(word);
  return words;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
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
    if (spec) throw UsageError(one.where + ": " + one.name + " needs a value, " + requirement(*spec));
    for (const OptionSpec& other : option_table())
      if (lower_case(other.name).rfind(lower_case(one.name) + "_", 0) == 0)
        throw UsageError(one.where + ": nothing stands under " + one.name);
  }
  return given;
}

CommandLine read(const std::vector<std::string>& words, const std::vector<std::string>& commands) {
  const std::string usage = "stickslip COMMAND [SCENE.yaml] [options], COMMAND one of " + joined(commands) +
                            " (stickslip --help tells more)";
  CommandLine line;
  if (words.empty()) throw UsageError("no command; usage: " + usage);
  std::vector<std::string> rest(words.begin() + 1, words.end());
  const std::string& first = words[0];
  if (is_name(first)) {
    const std::string name = lower_case(name_in(first));
    line.help = name == "help" || name == "h";
    line.version = name == "version";
    if (!line.help && !line.version)
      throw UsageError("-" + quoted(name_in(first)) + " where the command should stand; usage: " + usage);
    if (!rest.empty() && !(line.help && rest == std::vector<std::string>{"all"}))
      throw UsageError(quoted(rest[0]) + ": not understood after " + first + "; usage: " + usage);
    line.help_all = !rest.empty();
    return line;
  }
  if (std::find(commands.begin(), commands.end(), first) == commands.end()) {
    const std::string near = nearest_name(first, commands);
    throw UsageError("unknown command " + quoted(first) + "; " +
                     (near.empty() ? "it is one of " + joined(commands) : "did you mean " + near + "?"));
  }
  line.command = first;

  const Words typed = read_words(rest, "");
  const char* environment = std::getenv("PETSC_OPTIONS");
  const Words from_environment = read_words(split_environment(environment ? environment : ""), "PETSC_OPTIONS");
  for (const Words* some : {&from_environment, &typed})
    for (const Given& given : some->given) {
      if (lower_case(given.name) == "version") line.version = true;
      if (!is_help(given)) continue;
      line.help = true;
      if (given.text && lower_case(*given.text) == "all") line.help_all = true;
    }
  // -help all keeps the options: with -ts_type bdf it shows those of bdf
  if (line.version || (line.help && !line.help_all)) return line;

  std::string scene;
  for (const std::string& word : typed.stray) {
    if (!has_scene_suffix(word))
      throw UsageError("stray word " + quoted(word) +
                       ": neither an option nor its value nor a scene (.yaml, .yml, .opts)");
    if (!scene.empty()) throw UsageError("two scenes, " + quoted(scene) + " and " + quoted(word) + "; one is read");
    scene = word;
  }
  if (!from_environment.stray.empty())
    throw UsageError("PETSC_OPTIONS: stray word " + quoted(from_environment.stray[0]) +
                     ": neither an option nor a value");

  const auto append = [&line](const std::vector<Given>& more) {
    line.given.insert(line.given.end(), more.begin(), more.end());
  };
  if (!scene.empty()) append(scene_options(scene));
  for (const Words* some : {&from_environment, &typed})
    for (const Given& given : some->given) {
      if (!is_options_file(given)) continue;
      if (!given.text) throw UsageError("-" + given.name + ": needs a file");
      append(scene_options(*given.text));
    }
  const char* yaml = std::getenv("PETSC_OPTIONS_YAML");
  if (yaml && *yaml) append(parse_yaml(yaml, "PETSC_OPTIONS_YAML"));
  for (const Words* some : {&from_environment, &typed})
    for (const Given& given : some->given)
      if (!is_help(given) && !is_options_file(given)) line.given.push_back(given);
  return line;
}

// A flat text of strings and back, to send the result of rank 0 to the others.
void pack(std::string& text, const std::string& item) { text += std::to_string(item.size()) + ':' + item; }
std::string unpack(const std::string& text, std::size_t& at) {
  const std::size_t colon = text.find(':', at), size = std::stoul(text.substr(at, colon - at));
  at = colon + 1 + size;
  return text.substr(colon + 1, size);
}

std::string packed(const CommandLine& line) {
  std::string text;
  pack(text, line.command);
  for (bool flag : {line.help, line.help_all, line.version}) pack(text, flag ? "1" : "");
  for (const Given& given : line.given) {
    pack(text, given.name);
    pack(text, given.text ? "=" + *given.text : "");
    pack(text, given.where);
  }
  return text;
}

CommandLine unpacked(const std::string& text) {
  std::size_t at = 0;
  CommandLine line;
  line.command = unpack(text, at);
  for (bool* flag : {&line.help, &line.help_all, &line.version}) *flag = !unpack(text, at).empty();
  while (at < text.size()) {
    Given given;
    given.name = unpack(text, at);
    const std::string value = unpack(text, at);
    if (!value.empty()) given.text = value.substr(1);
    given.where = unpack(text, at);
    line.given.push_back(std::move(given));
  }
  return line;
}

}  // namespace

CommandLine read_command_line(int argc, char** argv, const std::vector<std::string>& commands, MPI_Comm comm) {
  std::string text;
  on_root(comm, [&] {
    std::vector<std::string> words;
    for (int i = 1; i < argc; ++i) words.emplace_back(argv[i]);
    text = packed(read(words, commands));
  });
  int size = int(text.size());
  MPI_Bcast(&size, 1, MPI_INT, 0, comm);
  text.resize(std::size_t(size));
  MPI_Bcast(&text[0], size, MPI_CHAR, 0, comm);
  return unpacked(text);
}

}  // namespace stickslip
