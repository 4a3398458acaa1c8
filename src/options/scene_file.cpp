#include "stickslip/options/command_line.hpp"

#include <sys/stat.h>
#include <yaml.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <new>

#include "base/failure.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

constexpr int deepest = 20;               // nesting of maps
constexpr std::size_t largest = 1 << 20;  // bytes

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_name_part(char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; }

// Whether a file name ends so, in capitals or small letters, and has more before it.
bool ends_with(const std::string& path, const std::string& suffix) {
  return path.size() > suffix.size() &&
         lower_case(path).compare(path.size() - suffix.size(), suffix.size(), suffix) == 0;
}

// Checks that the bytes are text, and gives them without a byte order mark.
std::string checked_text(std::string text, const std::string& name) {
  if (text.compare(0, 3, "\xEF\xBB\xBF") == 0) text.erase(0, 3);
  std::size_t line = 1;
  for (std::size_t i = 0; i < text.size();) {
    const int length = utf8_length(text, i);
    const unsigned char c = (unsigned char)text[i];
    const bool line_end = c == '\n' || (c == '\r' && i + 1 < text.size() && text[i + 1] == '\n');
    if (length == 0 || (c < 0x20 && c != '\t' && !line_end) || c == 0x7f)
      throw usage_error("{}:{}: not a text file (byte {}); a scene is YAML", name, line, int(c));
    if (c == '\n') ++line;
    i += length;
  }
  return text;
}

std::vector<std::string> lines_of(std::string text) {
  text.erase(std::remove(text.begin(), text.end(), '\r'), text.end());
  return split(text, '\n');
}

// PETSc's own form of a file, `-name value` a line: is its first option such a one?
bool is_plain_form(const std::string& text) {
  for (const std::string& line : lines_of(text)) {
    const std::size_t at = line.find_first_not_of(" \t");
    if (at == std::string::npos || line[at] == '#') continue;
    return line[at] == '-' && at + 1 < line.size() && is_letter(line[at + 1]) &&
           line.find(':') == std::string::npos;
  }
  return false;
}

[[noreturn]] void refuse_plain_form(const std::string& name) {
  throw UsageError("scene " + name +
                   ": a scene is YAML: write `name: value` where `-name value` stands, in a file .yaml; or "
                   "give the words of this file in PETSC_OPTIONS");
}

// Where each option was given first; throws where one comes again.
class FirstLines {
 public:
  FirstLines(std::string file, std::string what) : file_(std::move(file)), what_(std::move(what)) {}
  void add(const std::string& name, std::size_t line) {
    const auto [it, inserted] = lines_.emplace(lower_case(name), line);
    if (!inserted)
      throw usage_error("{}:{}: {} {} stands here again, first in line {}", file_, line, what_, quoted(name),
                        it->second);
  }

 private:
  std::string file_, what_;
  std::map<std::string, std::size_t> lines_;
};

// Options from the events of libyaml, which reads all of YAML: what a scene does not need is refused here.
class YamlReader {
 public:
  YamlReader(const std::string& text, std::string name)
      : name_(std::move(name)), lines_(lines_of(text)), options_(name_, "option") {
    if (!yaml_parser_initialize(&parser_)) throw std::bad_alloc();
    yaml_parser_set_encoding(&parser_, YAML_UTF8_ENCODING);
    yaml_parser_set_input_string(&parser_, reinterpret_cast<const unsigned char*>(text.data()), text.size());
  }
  ~YamlReader() {
    yaml_event_delete(&event_);
    yaml_parser_delete(&parser_);
  }
  YamlReader(const YamlReader&) = delete;
  YamlReader& operator=(const YamlReader&) = delete;

  std::vector<Given> read() {
    next();  // of the stream
    next();
    const auto empty = [this] { fail(lines_.size(), "no options in it: the scene is empty"); };
    if (event_.type == YAML_STREAM_END_EVENT) empty();
    const auto& start = event_.data.document_start;
    if (start.version_directive || start.tag_directives.start != start.tag_directives.end)
      fail("directives are not understood");
    next();
    if (event_.type == YAML_SEQUENCE_START_EVENT) fail("a list where `name: value` should stand");
    if (event_.type == YAML_SCALAR_EVENT) {
      if (text().empty()) empty();
      fail_key(text());
    }
    map("", 1);
    next();  // the document's end
    next();
    if (event_.type != YAML_STREAM_END_EVENT) fail("several documents; a scene is one");
    return std::move(given_);
  }

 private:
  [[noreturn]] void fail(std::size_t line, const std::string& what) const {
    throw usage_error("{}:{}: {}", name_, std::min(line, lines_.size()), what);
  }
  [[noreturn]] void fail(const std::string& what) const { fail(line(), what); }
  std::size_t line() const { return event_.start_mark.line + 1; }
  std::string text() const {
    return {reinterpret_cast<const char*>(event_.data.scalar.value), event_.data.scalar.length};
  }
  bool is_plain() const { return event_.data.scalar.style == YAML_PLAIN_SCALAR_STYLE; }

  void next() {
    yaml_event_delete(&event_);
    if (!yaml_parser_parse(&parser_, &event_)) fail_syntax();
    const bool scalar = event_.type == YAML_SCALAR_EVENT, sequence = event_.type == YAML_SEQUENCE_START_EVENT,
               mapping = event_.type == YAML_MAPPING_START_EVENT;
    const yaml_char_t* anchor = scalar     ? event_.data.scalar.anchor
                                : sequence ? event_.data.sequence_start.anchor
                                : mapping  ? event_.data.mapping_start.anchor
                                           : nullptr;
    const yaml_char_t* tag = scalar     ? event_.data.scalar.tag
                             : sequence ? event_.data.sequence_start.tag
                             : mapping  ? event_.data.mapping_start.tag
                                        : nullptr;
    if (anchor || event_.type == YAML_ALIAS_EVENT) fail("anchors and aliases are not understood in a scene");
    if (tag) fail("tags are not understood in a scene");
  }

  // model: v: 0.5 as model: {v: 0.5}.
  static std::string nested(const std::string& line) {
    const std::size_t colon = line.find(": ");
    return line.substr(0, colon + 2) + "{" + trimmed(line.substr(colon + 2)) + "}";
  }

  // What libyaml could not read, in its words, unless a more helpful one is known.
  [[noreturn]] void fail_syntax() const {
    const std::size_t at = parser_.problem_mark.line;
    const std::string& here = lines_[std::min(at, lines_.size() - 1)];
    const std::size_t first = here.find_first_not_of(' ');
    if (first != std::string::npos && here[first] == '\t') fail(at + 1, "a tab as indentation; use spaces");
    const std::string problem = parser_.problem ? parser_.problem : "not understood";
    if (problem.find("<document start>") != std::string::npos)
      fail(at + 1, "several documents; a scene is one");
    if (problem.find("mapping values are not allowed") != std::string::npos && first != std::string::npos)
      fail(at + 1, "two names on one line; write " + nested(here.substr(first)));
    if (at + 1 >= lines_.size() && parser_.context)
      fail(parser_.context_mark.line + 1, "a brace, bracket or quote is not closed");
    fail(at + 1, (parser_.context ? parser_.context + std::string(": ") : "") + problem);
  }

  // A word that stands where a key and its colon should.
  [[noreturn]] void fail_key(const std::string& word) const {
    const std::size_t colon = word.find(':');
    if (colon != std::string::npos && colon + 1 < word.size())
      fail("a space is missing after the colon of " + quoted(word.substr(0, colon)));
    fail("no colon after " + quoted(word) + "; a scene consists of `name: value`");
  }

  std::string key() {
    if (event_.type != YAML_SCALAR_EVENT) fail("a key must be an option name");
    const std::string name = text();
    if (name.empty()) fail("a key is missing");
    if (name[0] == '-' && name.size() > 1 && is_letter(name[1]))
      fail("write the name without its dash: " + quoted(name.substr(1)));
    for (char c : name)
      if (!is_name_part(c)) fail(quoted(name) + " is no option name; a scene consists of `name: value`");
    return name;
  }

  // The text of a scalar; nothing where it is null.
  std::optional<std::string> scalar() const {
    const std::string value = text();
    if (event_.start_mark.line != event_.end_mark.line ||
        event_.data.scalar.style == YAML_LITERAL_SCALAR_STYLE ||
        event_.data.scalar.style == YAML_FOLDED_SCALAR_STYLE)
      fail("a value must stand on one line; block text is not understood in a scene");
    for (const char c : value)
      if ((unsigned char)c < 0x20 && c != '\t')
        fail("a value must be one line of text, without such escapes");
    if (!is_plain()) return value;
    const std::size_t brace = value.find_first_of("{}[]");
    if (brace != std::string::npos) fail(std::string("unexpected ") + value[brace]);
    if (value.empty() || value == "~" || value == "null" || value == "Null" || value == "NULL")
      return std::nullopt;
    return value;
  }

  std::string list() {
    std::string joined;
    for (next(); event_.type != YAML_SEQUENCE_END_EVENT; next()) {
      if (event_.type != YAML_SCALAR_EVENT) fail("a list holds plain values only");
      const std::string item = scalar().value_or("");
      if (item.empty() || item.find(',') != std::string::npos)
        fail("an item of a list must be a value without comma: " + quoted(item));
      joined += (joined.empty() ? "" : ",") + item;
    }
    return joined;
  }

  void map(const std::string& prefix, int depth) {
    if (depth > deepest) fail("maps are nested too deeply");
    FirstLines keys(name_, "key");
    for (next(); event_.type != YAML_MAPPING_END_EVENT; next()) {
      const std::string own = key(), name = prefix + own;
      const std::size_t at = line();
      keys.add(own, at);
      next();
      if (event_.type == YAML_MAPPING_START_EVENT) {
        map(name + "_", depth + 1);
      } else {
        give(name, event_.type == YAML_SEQUENCE_START_EVENT ? std::optional<std::string>(list()) : scalar(),
             at);
      }
    }
  }

  void give(const std::string& name, std::optional<std::string> text, std::size_t at) {
    options_.add(name, at);
    if (!is_letter(name[0])) fail(at, quoted(name) + " is no option name");
    given_.push_back({name, std::move(text), name_ + ":" + std::to_string(at)});
  }

  std::string name_;
  std::vector<std::string> lines_;
  FirstLines options_;
  std::vector<Given> given_;
  yaml_parser_t parser_{};
  yaml_event_t event_{};
};

}  // namespace

bool has_scene_suffix(const std::string& path) {
  return ends_with(path, ".yaml") || ends_with(path, ".yml") || ends_with(path, ".opts");
}

std::vector<Given> parse_yaml(const std::string& text, const std::string& name) {
  return YamlReader(checked_text(text, name), name).read();
}

std::vector<Given> read_scene(const std::string& path) {
  const std::string name = quoted(path);
  if (ends_with(path, ".opts")) refuse_plain_form(name);
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) throw UsageError("scene " + name + ": " + std::strerror(errno));
  if (S_ISDIR(status.st_mode)) throw UsageError("scene " + name + ": is a directory");
  if (!S_ISREG(status.st_mode)) throw UsageError("scene " + name + ": is not a regular file");
  if (std::size_t(status.st_size) > largest)
    throw usage_error("scene {}: {} bytes are too many for a scene", name, status.st_size);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw UsageError("scene " + name + ": " + std::strerror(errno));
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (file.bad()) throw UsageError("scene " + name + ": cannot be read");
  if (is_plain_form(text)) refuse_plain_form(name);
  return parse_yaml(text, name);
}

}  // namespace stickslip
