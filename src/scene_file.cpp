#include "stickslip/scene_file.hpp"

#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>

#include "stickslip/error.hpp"

namespace stickslip {

namespace {

constexpr int deepest = 20;             // nesting of maps
constexpr std::size_t largest = 1 << 20;  // bytes

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_name_part(char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; }
bool is_space(char c) { return c == ' ' || c == '\t'; }

// Whether a file name ends so, in capitals or small letters, and has more before it.
bool ends_with(const std::string& path, const std::string& suffix) {
  return path.size() > suffix.size() &&
         lower_case(path).compare(path.size() - suffix.size(), suffix.size(), suffix) == 0;
}

// Number of bytes of the UTF-8 character at `at`, 0 where there is none.
int utf8_length(const std::string& text, std::size_t at) {
  const auto byte = [&text](std::size_t i) { return i < text.size() ? (unsigned char)text[i] : 0u; };
  const unsigned first = byte(at);
  if (first < 0x80) return 1;
  const int length = first >= 0xF0 && first < 0xF5 ? 4 : first >= 0xE0 && first < 0xF0 ? 3
                   : first >= 0xC2 && first < 0xE0 ? 2 : 0;
  for (int i = 1; i < length; ++i)
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
  return length;
}

// Checks that the bytes are text, and splits them into lines.
std::vector<std::string> lines_of(std::string text, const std::string& name) {
  if (text.compare(0, 3, "\xEF\xBB\xBF") == 0) text.erase(0, 3);  // byte order mark
  std::vector<std::string> lines(1);
  for (std::size_t i = 0; i < text.size();) {
    const int length = utf8_length(text, i);
    const unsigned char c = (unsigned char)text[i];
    const bool line_end = c == '\n' || (c == '\r' && i + 1 < text.size() && text[i + 1] == '\n');
    if (length == 0 || (c < 0x20 && c != '\t' && !line_end) || c == 0x7f)
      throw UsageError(name + ":" + std::to_string(lines.size()) + ": not a text file (byte " + std::to_string(int(c)) +
                       "); a scene is YAML or one option a line");
    if (c == '\n') {
      lines.emplace_back();
    } else if (!line_end) {
      lines.back().append(text, i, std::size_t(length));
    }
    i += std::size_t(length);
  }
  return lines;
}

// Where each option was given first; throws where one comes again.
class Seen {
 public:
  Seen(std::string file, std::string what) : file_(std::move(file)), what_(std::move(what)) {}
  void add(const std::string& name, std::size_t line) {
    const auto [it, inserted] = lines_.emplace(lower_case(name), line);
    if (!inserted)
      throw UsageError(file_ + ":" + std::to_string(line) + ": " + what_ + " " + quoted(name) +
                       " stands here again, first in line " + std::to_string(it->second));
  }

 private:
  std::string file_, what_;
  std::map<std::string, std::size_t> lines_;
};

// A recursive descent over the lines. Block structure is read line by line, what stands in braces, brackets or
// quotes character by character.
class YamlReader {
 public:
  YamlReader(const std::string& text, std::string name)
      : lines_(lines_of(text, name)), name_(std::move(name)), options_(name_, "option") {}

  std::vector<Given> read() {
    if (next_content() && line().compare(0, 3, "---") == 0) {
      column_ = 3;
      end_of_line();
    }
    if (!next_content()) fail("no options in it: the scene is empty");
    if (line()[0] == '%') fail("directives are not understood");
    if (indent() > 0) fail("the first key must stand at the beginning of its line");
    if (line()[0] == '{') {
      column_ = 0;
      flow_map("", 1);
      end_of_line();
    } else {
      block_map(0, "", 1);
    }
    if (next_content()) {
      if (line().compare(0, 3, "...") == 0) {
        column_ = 3;
        end_of_line();
        if (next_content()) fail("several documents; a scene is one");
      } else if (line().compare(0, 3, "---") == 0) {
        fail("several documents; a scene is one");
      } else {
        fail("not understood here: " + quoted(line()));
      }
    }
    return std::move(given_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw UsageError(name_ + ":" + std::to_string(std::min(at_, lines_.size() - 1) + 1) + ": " + what);
  }
  const std::string& line() const { return lines_[at_]; }

  // To the next line that holds more than a comment; false at the end.
  bool next_content() {
    for (; at_ < lines_.size(); ++at_) {
      const std::size_t first = line().find_first_not_of(" \t");
      if (first != std::string::npos && line()[first] != '#') return true;
    }
    return false;
  }
  std::size_t indent() const {
    const std::size_t first = line().find_first_not_of(' ');
    if (line()[first] == '\t') fail("a tab as indentation; use spaces");
    return first;
  }
  bool at_document_mark() const {
    return line().compare(0, 3, "---") == 0 || line().compare(0, 3, "...") == 0;
  }
  char peek(std::size_t ahead = 0) const {
    return column_ + ahead < line().size() ? line()[column_ + ahead] : '\n';
  }
  void skip_spaces() {
    while (column_ < line().size() && is_space(line()[column_])) ++column_;
  }
  bool comment_or_end() {
    skip_spaces();
    return column_ >= line().size() || (line()[column_] == '#' && (column_ == 0 || is_space(line()[column_ - 1])));
  }
  void end_of_line() {
    if (!comment_or_end()) fail("not understood after the value: " + quoted(line().substr(column_)));
    ++at_;
    column_ = 0;
  }
  // Spaces, comments and line ends inside braces and brackets.
  void skip_flow_space() {
    const std::size_t opened = at_;
    while (comment_or_end()) {
      ++at_;
      column_ = 0;
      if (at_ >= lines_.size()) {
        at_ = opened;
        fail("a brace or bracket is not closed");
      }
    }
  }

  void not_understood(char c) const {
    switch (c) {
      case '&': case '*': fail("anchors and aliases are not understood in a scene");
      case '!': fail("tags are not understood in a scene");
      case '|': case '>': fail("block text is not understood in a scene; put the value on one line");
      case '@': case '`': case '%': fail(std::string("a value cannot begin with ") + c);
      default: break;
    }
  }

  std::string quoted_scalar() {
    const char mark = line()[column_++];
    std::string text;
    while (true) {
      if (column_ >= line().size()) fail("a quote is not closed in its line");
      char c = line()[column_++];
      if (c == mark) {
        if (mark == '"' || peek() != '\'') return text;
        ++column_;
      } else if (c == '\\' && mark == '"') {
        c = peek();
        if (c != '"' && c != '\\' && c != '/') fail("of the escapes only \\\", \\\\ and \\/ are understood");
        ++column_;
      }
      text += c;
    }
  }

  // Up to a comment, the end of the line or, inside braces and brackets, one of ,]}
  std::string plain_scalar(bool flow) {
    not_understood(peek());
    const std::size_t begin = column_;
    while (column_ < line().size()) {
      const char c = line()[column_];
      if (c == '#' && column_ > begin && is_space(line()[column_ - 1])) break;
      if (flow && std::strchr(",]}", c)) break;
      if (c == ':' && (peek(1) == '\n' || is_space(peek(1)) || (flow && std::strchr(",]}", peek(1)))))
        fail("a second colon; nest maps with braces or on lines of their own");
      if (std::strchr("{}[]", c)) fail(std::string("unexpected ") + c);
      ++column_;
    }
    std::string text = line().substr(begin, column_ - begin);
    text.erase(text.find_last_not_of(" \t") + 1);
    if (text == "-" || text.compare(0, 2, "- ") == 0 || text == "?" || text.compare(0, 2, "? ") == 0)
      fail("not understood here: " + quoted(text));
    return text;
  }

  // A key and its colon.
  std::string key(bool flow) {
    std::string name;
    const bool is_quoted = peek() == '"' || peek() == '\'';
    if (is_quoted) {
      name = quoted_scalar();
    } else {
      not_understood(peek());
      const std::size_t begin = column_;
      while (column_ < line().size() && !std::strchr(":,{}[]#", line()[column_])) ++column_;
      name = line().substr(begin, column_ - begin);
      name.erase(name.find_last_not_of(" \t") + 1);
    }
    skip_spaces();
    if (name.empty()) fail("a key is missing: " + quoted(line()));
    if (name[0] == '-' && name.size() > 1 && is_letter(name[1]))
      fail("write the name without its dash: " + quoted(name.substr(1)));
    for (char c : name)
      if (!is_name_part(c)) fail(quoted(name) + " is no option name; a scene consists of `name: value`");
    if (peek() != ':') fail("no colon after " + quoted(name) + "; a scene consists of `name: value`");
    ++column_;
    if (peek() != '\n' && !is_space(peek()) && !is_quoted && !(flow && std::strchr(",}", peek())))
      fail("a space is missing after the colon of " + quoted(name));
    return name;
  }

  void give(const std::string& name, std::optional<std::string> text, std::size_t at) {
    options_.add(name, at + 1);
    if (!is_letter(name[0])) fail(quoted(name) + " is no option name");
    given_.push_back({name, std::move(text), name_ + ":" + std::to_string(at + 1)});
  }

  static bool is_null(const std::string& text) {
    return text.empty() || text == "~" || text == "null" || text == "Null" || text == "NULL";
  }

  std::string list_item(bool flow) {
    const bool is_quoted = peek() == '"' || peek() == '\'';
    if (peek() == '{' || peek() == '[') fail("a list holds plain values only");
    std::string text = is_quoted ? quoted_scalar() : plain_scalar(flow);
    if (text.empty() || text.find(',') != std::string::npos)
      fail("an item of a list must be a value without comma: " + quoted(text));
    return text;
  }

  std::string flow_list() {
    ++column_;
    std::string text;
    while (true) {
      skip_flow_space();
      if (peek() == ']') break;
      text += (text.empty() ? "" : ",") + list_item(true);
      skip_flow_space();
      if (peek() == ',') {
        ++column_;
      } else if (peek() != ']') {
        fail("a comma or ] is missing: " + quoted(line().substr(column_)));
      }
    }
    ++column_;
    return text;
  }

  // What stands behind `name:`; `in_flow`: between braces, where a comma or a brace ends it.
  void value(const std::string& name, bool in_flow, int depth, std::size_t at) {
    if (peek() == '{') {
      flow_map(name + "_", depth + 1);
    } else if (peek() == '[') {
      give(name, flow_list(), at);
    } else if (peek() == '"' || peek() == '\'') {
      give(name, quoted_scalar(), at);
    } else {
      const std::string text = plain_scalar(in_flow);
      give(name, is_null(text) ? std::nullopt : std::optional<std::string>(text), at);
    }
  }

  void flow_map(const std::string& prefix, int depth) {
    if (depth > deepest) fail("maps are nested too deeply");
    ++column_;
    Seen keys(name_, "key");
    while (true) {
      skip_flow_space();
      if (peek() == '}') break;
      const std::size_t at = at_;
      const std::string own = key(true), name = prefix + own;
      keys.add(own, at + 1);
      skip_flow_space();
      value(name, true, depth, at);
      skip_flow_space();
      if (peek() == ',') {
        ++column_;
      } else if (peek() != '}') {
        fail("a comma or } is missing: " + quoted(line().substr(column_)));
      }
    }
    ++column_;
  }

  bool at_dash() const {
    const std::size_t first = line().find_first_not_of(' ');
    return line()[first] == '-' && (first + 1 >= line().size() || is_space(line()[first + 1]));
  }

  std::string block_list(std::size_t width) {
    std::string text;
    while (next_content() && indent() == width && at_dash()) {
      column_ = width + 1;
      if (comment_or_end()) fail("a list holds plain values only, one after each dash");
      text += (text.empty() ? "" : ",") + list_item(false);
      end_of_line();
    }
    return text;
  }

  void block_map(std::size_t width, const std::string& prefix, int depth) {
    if (depth > deepest) fail("maps are nested too deeply");
    Seen keys(name_, "key");
    while (next_content()) {
      if (at_document_mark()) return;
      const std::size_t here = indent();
      if (here < width) return;
      if (here > width) fail("unexpected indentation");
      if (at_dash()) fail("a list where `name: value` should stand");
      const std::size_t at = at_;
      column_ = here;
      const std::string own = key(false), name = prefix + own;
      keys.add(own, at + 1);
      if (!comment_or_end()) {
        value(name, false, depth, at);
        end_of_line();
        continue;
      }
      ++at_;
      column_ = 0;
      if (!next_content() || at_document_mark() || indent() < here || (indent() == here && !at_dash())) {
        give(name, std::nullopt, at);
      } else if (at_dash()) {
        give(name, block_list(indent()), at);
      } else {
        block_map(indent(), name + "_", depth + 1);
      }
    }
  }

  std::vector<std::string> lines_;
  std::string name_;
  Seen options_;
  std::vector<Given> given_;
  std::size_t at_ = 0, column_ = 0;  // line and character
};

}  // namespace

bool has_scene_suffix(const std::string& path) {
  return ends_with(path, ".yaml") || ends_with(path, ".yml") || ends_with(path, ".opts");
}

std::vector<Given> parse_yaml(const std::string& text, const std::string& name) {
  return YamlReader(text, name).read();
}

std::vector<Given> parse_plain(const std::string& text, const std::string& name) {
  const std::vector<std::string> lines = lines_of(text, name);
  std::vector<Given> given;
  Seen options(name, "option");
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string where = name + ":" + std::to_string(i + 1);
    std::vector<std::string> words;
    for (std::size_t at = 0; at < lines[i].size();) {
      const char c = lines[i][at];
      if (is_space(c)) {
        ++at;
        continue;
      }
      if (c == '#') break;
      std::size_t end = at;
      if (c == '"' || c == '\'') {
        end = lines[i].find(c, at + 1);
        if (end == std::string::npos) throw UsageError(where + ": a quote is not closed in its line");
        words.push_back(lines[i].substr(at + 1, end - at - 1));
        at = end + 1;
        continue;
      }
      while (end < lines[i].size() && !is_space(lines[i][end])) ++end;
      words.push_back(lines[i].substr(at, end - at));
      at = end;
    }
    if (words.empty()) continue;
    if (words[0].size() < 2 || words[0][0] != '-' || !is_letter(words[0][1]) || words.size() > 2)
      throw UsageError(where + ": not understood: " + quoted(lines[i]) + "; each line holds one option, -name value");
    const std::string option = words[0].substr(1);
    options.add(option, i + 1);
    given.push_back({option, words.size() > 1 ? std::optional<std::string>(words[1]) : std::nullopt, where});
  }
  if (given.empty()) throw UsageError(name + ":1: no options in it: the scene is empty");
  return given;
}

std::vector<Given> read_scene(const std::string& path) {
  const std::string name = quoted(path);
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) throw UsageError("scene " + name + ": " + std::strerror(errno));
  if (S_ISDIR(status.st_mode)) throw UsageError("scene " + name + ": is a directory");
  if (!S_ISREG(status.st_mode)) throw UsageError("scene " + name + ": is not a regular file");
  if (std::size_t(status.st_size) > largest)
    throw UsageError("scene " + name + ": " + std::to_string(status.st_size) + " bytes are too many for a scene");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw UsageError("scene " + name + ": " + std::strerror(errno));
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (file.bad()) throw UsageError("scene " + name + ": cannot be read");
  return ends_with(path, ".yaml") || ends_with(path, ".yml") ? parse_yaml(text, name) : parse_plain(text, name);
}

}  // namespace stickslip
