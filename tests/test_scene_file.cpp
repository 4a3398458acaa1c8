// Scene files: what is understood, and what is refused with file and line.

#include <petscsys.h>

#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/command_line.hpp"

using namespace stickslip;
using Catch::Matchers::StartsWith;

namespace {

// "name=value;..." with ~ for a name that stands alone
std::string flat(const std::vector<Given>& list) {
  std::string text;
  for (const Given& one : list) text += (text.empty() ? "" : ";") + one.name + "=" + one.text.value_or("~");
  return text;
}
std::string yaml(const std::string& text) { return flat(parse_yaml(text, "s.yaml")); }

#define REFUSED(text, where, part)                                           \
  do {                                                                       \
    INFO(text);                                                              \
    CHECK_THROWS_WITH(yaml(text), StartsWith(where ": ") && Contains(part)); \
    CHECK_THROWS_AS(yaml(text), UsageError);                                 \
  } while (0)

}  // namespace

TEST_CASE("scene files: what YAML scenes may hold") {
  CHECK(yaml("model_gamma: 3\n") == "model_gamma=3");
  CHECK(yaml("model_gamma: 3") == "model_gamma=3");
  CHECK(yaml("# c\n---\nmodel:\n  gamma: 3 # three\n  c: -1.5e-3\n\nbc: {left: free, right: free}\n...\n# "
             "end\n") == "model_gamma=3;model_c=-1.5e-3;bc_left=free;bc_right=free");
  CHECK(yaml("a:\n    b:\n      c: 1\n      d: 2\n    e: 3\nf: 4\n") == "a_b_c=1;a_b_d=2;a_e=3;f=4");
  CHECK(yaml("out: {times: [1, 2.5,\n  3],  # comment\n file: 'a b.h5'}\n") ==
        "out_times=1,2.5,3;out_file=a b.h5");
  CHECK(yaml("out_times:\n  - 1\n  - 2 # two\n\n  - '3'\nx: 1\n") == "out_times=1,2,3;x=1");
  CHECK(yaml("out_times:\n- 1\n- -2\nx: 1\n") == "out_times=1,-2;x=1");
  CHECK(yaml("a: \"x # y: z\\\"\"\nb: 'it''s'\n") == "a=x # y: z\";b=it's");
  CHECK(yaml("a: b#c\n") == "a=b#c");
  CHECK(yaml("file: C:/x\n") == "file=C:/x");
  CHECK(yaml("ts_view:\nb: ~\nc: null\n") == "ts_view=~;b=~;c=~");
  CHECK(yaml("{model: {gamma: 3, c: 1,}, \"x\":1, y: {}}\n") == "model_gamma=3;model_c=1;x=1");
  CHECK(yaml("\xEF\xBB\xBF"
             "a: 1\r\nb:\r\n  c: 2\r\n") == "a=1;b_c=2");
  CHECK(yaml("a: 1\t\nb:\t2 # \xC3\xA9\n") == "a=1;b=2");
  CHECK(parse_yaml("\n\na:\n  b: 2\n", "s.yaml")[0].where == "s.yaml:4");
}

TEST_CASE("scene files: what is refused") {
  REFUSED("", "s.yaml:1", "empty");
  REFUSED("# nothing\n\n", "s.yaml:3", "empty");
  REFUSED("---\n", "s.yaml:2", "empty");
  REFUSED(std::string("a: 1\nb\0c: 1\n", 12), "s.yaml:2", "not a text file");
  REFUSED(std::string("\0\0\0", 3), "s.yaml:1", "not a text file");
  REFUSED("a: \xff\n", "s.yaml:1", "not a text file");
  REFUSED("\x89HDF\r\n\x1a\n", "s.yaml:1", "not a text file");
  REFUSED("a: 1\n---\nb: 2\n", "s.yaml:2", "several documents");
  REFUSED("a: 1\n...\nb: 2\n", "s.yaml:3", "several documents");
  REFUSED("a:\n  b: 1\n---\n", "s.yaml:3", "several documents");
  REFUSED("%YAML 1.2\n---\na: 1\n", "s.yaml:1", "directives");
  REFUSED("a: 1\nb: 2\nA: 3\n", "s.yaml:3", "first in line 1");
  REFUSED("model: {gamma: 3}\nmodel_gamma: 3\n", "s.yaml:2",
          "option model_gamma stands here again, first in line 1");
  REFUSED("model:\n  gamma: 3\nMODEL:\n  c: 3\n", "s.yaml:3", "key MODEL stands here again");
  REFUSED("model: {gamma: 3, Gamma: 4}\n", "s.yaml:1", "again");
  REFUSED("model:\n\tgamma: 3\n", "s.yaml:2", "tab");
  REFUSED("model: {gamma: 3\nx: 1\n", "s.yaml:1", "on one line");
  REFUSED("model: {gamma: '3'\nx: 1\n", "s.yaml:2", "flow mapping");
  REFUSED("model: {gamma: 3,\n# c\n", "s.yaml:3", "not closed");
  REFUSED("a: [1, 2\n", "s.yaml:1", "not closed");
  REFUSED("a: 'x\n", "s.yaml:1", "quote is not closed");
  REFUSED("a: \"x\\n\"\n", "s.yaml:1", "escapes");
  REFUSED("a: &x 3\n", "s.yaml:1", "anchors");
  REFUSED("a: 3\nb: *a\n", "s.yaml:2", "anchors");
  REFUSED("a: !!int 3\n", "s.yaml:1", "tags");
  REFUSED("a: |\n  3\n", "s.yaml:1", "block text");
  REFUSED("<<: {a: 1}\n", "s.yaml:1", "no option name");
  REFUSED("a 3\n", "s.yaml:1", "no colon");
  REFUSED("gamma\n", "s.yaml:1", "no colon");
  REFUSED("a:3\n", "s.yaml:1", "space is missing");
  REFUSED("a: b: 3\n", "s.yaml:1", "two names on one line; write a: {b: 3}");
  REFUSED("-model_gamma: 3\n", "s.yaml:1", "without its dash");
  REFUSED("- a: 3\n", "s.yaml:1", "list");
  REFUSED("a: 1\n  b: 2\n", "s.yaml:1", "on one line");
  REFUSED("a:\n   b: 2\n  c: 1\n", "s.yaml:3", "did not find expected key");
  REFUSED("a: [1, [2]]\n", "s.yaml:1", "plain values");
  REFUSED("a:\n  - {b: 1}\n", "s.yaml:2", "plain values");
  REFUSED("a: ['1,2']\n", "s.yaml:1", "without comma");
  REFUSED("a: 1}\n", "s.yaml:1", "unexpected }");
  REFUSED("a: 'x' y\n", "s.yaml:1", "did not find expected key");
  REFUSED(": 3\n", "s.yaml:1", "did not find expected key");
  REFUSED("1a: 3\n", "s.yaml:1", "no option name");
  std::string deep;
  for (int i = 0; i < 5000; ++i) deep += "{a: ";
  REFUSED(deep, "s.yaml:1", "too deeply");
  deep.clear();
  for (int i = 0; i < 300; ++i) deep += std::string(std::size_t(i), ' ') + "a:\n";
  REFUSED(deep, "s.yaml:21", "too deeply");
}

TEST_CASE("scene files: files that cannot be read", "[serial]") {
  CHECK_THROWS_WITH(read_scene("/nonexistent/s.yaml"), Contains("No such file"));
  CHECK_THROWS_WITH(read_scene("/tmp"), Contains("is a directory"));
  CHECK_THROWS_WITH(read_scene("/dev/null"), Contains("not a regular file"));
  CHECK_THROWS_WITH(read_scene("s.opts"), Contains("a scene is YAML: write `name: value`"));
  CHECK(has_scene_suffix("a/b.YAML"));
  CHECK_FALSE(has_scene_suffix(".yaml"));
  CHECK_FALSE(has_scene_suffix("a.txt"));
}

TEST_CASE("scene files: what is understood is what PETSc's own reader of YAML understands") {
  // PETSc's parser is the reference for the meaning; ours refuses more, and says where.
  const auto same_as_petsc = [](const std::string& text) {
    INFO(text);
    PetscOptions database = nullptr;
    REQUIRE(PetscOptionsCreate(&database) == 0);
    CHECK(PetscOptionsInsertStringYAML(database, text.c_str()) == 0);
    for (const Given& one : parse_yaml(text, "s.yaml")) {
      char value[200] = "";
      PetscBool found = PETSC_FALSE;
      INFO(one.name);
      CHECK(PetscOptionsGetString(database, nullptr, ("-" + one.name).c_str(), value, sizeof value, &found) ==
            0);
      CHECK(found == PetscBool(one.text && !one.text->empty()));
      if (one.text) CHECK(*one.text == value);
    }
    REQUIRE(PetscOptionsDestroy(&database) == 0);
  };
  same_as_petsc("model:\n  gamma: 3 # three\n  c: -1.5e-3\n\nbc: {left: free, right: 'a b'}\n");
  same_as_petsc("---\na:\n    b:\n      c: 1\n      d: \"x # y\"\n    e: 3\nf: a#b\n...\n");
  same_as_petsc("out_times:\n  - 1\n  - 2 # two\n\n  - '3'\nx: 'it''s'\n");
  same_as_petsc("out: {times: [1, 2.5,\n  3],  # comment\n probes: [-1],}\n");
  same_as_petsc("{model: {gamma: 3, c: \"\\\"q\\\\\"}, x: C:/y}\n");

  // random nesting, styles and values
  unsigned state = 1;
  const auto draw = [&state](unsigned below) {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % below;
  };
  const std::vector<std::string> values = {"1",         "-2.5e-3", "free",  "'q ''x'", "\"a: b\"",
                                           "[1, 2, 3]", "[ -1 ]",  "a b c", "true",    "[a,'b']",
                                           "x:y",       "-",       "5dp",   "~x"};
  for (int scene = 0; scene < 300; ++scene) {
    std::string text;
    int names = 0;
    const auto name = [&names] { return "k" + std::to_string(names++); };
    const auto value = [&] {
      const std::string& chosen = values[draw(unsigned(values.size()))];
      return chosen == "-" ? std::string("'-'") : chosen;
    };
    for (unsigned entries = 1 + draw(5); entries > 0; --entries) {
      switch (draw(4)) {
        case 0: text += name() + ": " + value() + (draw(2) ? " # c" : "") + "\n"; break;
        case 1:
          text += name() + ": {" + name() + ": " + value() + ", " + name() + ": {" + name() + ": 1}}\n";
          break;
        case 2:
          text +=
              name() + ":\n  " + name() + ": " + value() + "\n\n  " + name() + ":\n     " + name() + ": 7\n";
          break;
        default: text += name() + ":\n- 1\n- " + std::string(draw(2) ? "'x y'" : "-3") + "\n"; break;
      }
    }
    same_as_petsc(text);
  }
}
