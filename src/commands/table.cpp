#include "commands/command.hpp"

#include <petscdmda.h>
#include <petscts.h>
#include <slepceps.h>

#include <fmt/format.h>
#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "stickslip/base/error.hpp"
#include "stickslip/base/provenance.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/study/chart.hpp"
#include "stickslip/time/methods.hpp"

namespace stickslip {

// Each stands in a source of its own; a new one is named here, twice.
Command run_command(), wave_command(), spectrum_command(), laws_command(), boundary_command(),
    cycle_command(), chart_command(), sweep_command(), fit_command();
const std::vector<Command>& commands() {
  static const std::vector<Command> table = {run_command(),   wave_command(),     spectrum_command(),
                                             laws_command(),  boundary_command(), cycle_command(),
                                             chart_command(), sweep_command(),    fit_command()};
  return table;
}

std::vector<std::string> command_names() {
  std::vector<std::string> names;
  for (const Command& command : commands()) names.push_back(command.name);
  return names;
}

const Command& command_named(const std::string& name) {
  for (const Command& one : commands())
    if (name == one.name) return one;
  throw std::logic_error("no command '" + name + "'");
}

std::string tables_text() {
  std::vector<std::pair<const char*, std::vector<TableText>>> all = {{"limits", limit_tables()},
                                                                     {"every", {common_quantities()}}};
  for (const Command& command : commands()) all.emplace_back(command.name, command.tables());
  std::string text;
  for (const auto& [name, tables] : all)
    text += fmt::format("{}\"{}\": {}", text.empty() ? "{" : ",\n", name, json_text(tables));
  return text + "}\n";
}

namespace {

// Breaks a text at spaces so that lines behind `indent` columns stay within 100.
std::string wrapped(const std::string& text, std::size_t indent) {
  std::istringstream stream(text);
  std::string result;
  std::size_t column = indent;
  for (std::string word; stream >> word;) {
    if (column > indent && column + word.size() + 1 > 100) {
      result += "\n" + std::string(indent, ' ');
      column = indent;
    } else if (column > indent) {
      result += " ";
      ++column;
    }
    result += word;
    column += word.size();
  }
  return result;
}

std::string padded(const std::string& text, std::size_t width) {
  return text + std::string(text.size() < width ? width - text.size() : 1, ' ');
}

}  // namespace

std::string general_help() {
  std::string text =
      "stickslip " + std::string(version()) +
      ": stick-slip friction of chains and continua, by the method of lines on PETSc and SLEPc\n\n"
      "usage: stickslip COMMAND [SCENE.yaml] [options]          mpirun -n 4 stickslip COMMAND ...\n\n"
      "commands:\n";
  for (const Command& command : commands()) text += "  " + padded(command.name, 12) + command.does + "\n";
  return text +
         "\nA scene is a YAML file of options: `model: {gamma: 3}` is -model_gamma 3. PETSC_OPTIONS and the "
         "command\n"
         "line override it, with every option of PETSc and SLEPc (-ts_type, -ts_rtol, -log_view, ...).\n"
         "stickslip COMMAND -help lists the command's own options, -help all those of PETSc and SLEPc as "
         "well;\n"
         "stickslip --version tells the versions.\n";
}

namespace {

std::string first_word(const std::string& group) { return lower_case(group.substr(0, group.find(' '))); }

bool is_profile(const std::string& group) { return first_word(group) == "profiles"; }

std::string option_help(const OptionSpec& spec) {
  const std::string value = spec.default_text.empty() ? spec.default_help : spec.default_text;
  const std::string takes = spec.type == OptionType::text ? "text" : requirement(spec);
  return "  -" + spec.name + " [" + value + "]: " + takes +
         (spec.unit.empty() ? "" : " (" + spec.unit + ")") + "\n      " + wrapped(spec.help, 6) + "\n";
}

// PETSc's option for the method, whose values are those of the table of methods.
std::string method_help() {
  OptionSpec spec{"ts_type", OptionType::choice,
                  "",        "chosen for the scene",
                  "",        0,
                  0,         false,
                  {},        "method of time stepping, type:subtype",
                  "",        ""};
  for (const Method& method : methods()) spec.words.push_back(method.name());
  return option_help(spec);
}

// What the options of profiles have in common, in place of two lines for each.
std::string profiles_help(const Command& command) {
  std::vector<std::string> names;
  for (const OptionSpec& spec : option_table())
    if (const auto end = spec.name.rfind("_profile"); is_profile(spec.group) && end != std::string::npos &&
                                                      end + 8 == spec.name.size() &&
                                                      reads_option(command.name, spec))
      names.push_back(spec.name.substr(0, end));
  return "  -NAME_profile [none]: x1:value1,x2:value2,... or a file of two columns; -NAME_factor [1] "
         "multiplies it\n"
         "      " +
         wrapped(
             "NAME along x, in place of one value: " + joined(names) + ". -help profiles has a line for each",
             6) +
         "\n";
}

}  // namespace

std::string command_help(const Command& command, const std::string& topic) {
  // in the order of the table, but what is rarely set last
  std::vector<std::string> groups;
  for (const bool rare : {false, true})
    for (const OptionSpec& spec : option_table())
      if (reads_option(command.name, spec) && is_profile(spec.group) == rare &&
          std::find(groups.begin(), groups.end(), spec.group) == groups.end())
        groups.push_back(spec.group);
  std::string text;
  std::vector<std::string> topics;
  for (const std::string& group : groups) {
    topics.push_back(first_word(group));
    if (!topic.empty() && topic != topics.back()) continue;
    text += "\n" + group + "\n";
    if (topics.back() == "time") text += method_help();
    for (const OptionSpec& spec : option_table()) {
      if (spec.group != group || !reads_option(command.name, spec)) continue;
      if (topic.empty() && is_profile(group) && spec.name != "profile_kind") continue;
      text += option_help(spec);
    }
    if (topic.empty() && is_profile(group)) text += profiles_help(command);
  }
  const std::string list = joined(topics);
  if (text.empty())
    throw UsageError("-help " + quoted(topic) + ": no such group of options; there are " + list);
  return "stickslip " + std::string(command.name) + ": " + command.does + "\n\nusage: stickslip " +
         command.name +
         " [SCENE.yaml] [options]\n\nEach option with its [default], what it takes and its (unit). -help "
         "GROUP "
         "shows one group:\n" +
         wrapped(list + "; -help all adds the options of PETSc and SLEPc.", 0) + "\n" + text;
}

std::string version_text() {
  char petsc[256] = "", slepc[256] = "", mpi[MPI_MAX_LIBRARY_VERSION_STRING] = "";
  SS_TRY(PetscGetVersion(petsc, sizeof petsc));
  SS_TRY(SlepcGetVersion(slepc, sizeof slepc));
  int length = 0;
  MPI_Get_library_version(mpi, &length);
  std::string text = "stickslip " + std::string(version()) + "\ngit " + git_revision() + "\n";
  for (std::string library : {petsc, slepc, mpi}) {
    library = library.substr(0, std::min(library.find('\n'), library.find(", package")));
    library.erase(library.find_last_not_of(' ') + 1);
    text += library + "\n";
  }
  return text;
}

// PETSc prints the options of an object while that takes them, so make one of each kind.
void print_library_help() {
  DmHandle dm;
  SS_TRY(DMDACreate1d(PETSC_COMM_WORLD, DM_BOUNDARY_PERIODIC, 64, 2, 1, nullptr, dm.out()));
  SS_TRY(DMSetUp(dm));
  TsHandle ts;
  SS_TRY(TSCreate(PETSC_COMM_WORLD, ts.out()));
  SS_TRY(TSSetDM(ts, dm));
  SS_TRY(TSSetType(ts, TSARKIMEX));
  SS_TRY(TSSetFromOptions(ts));
  Handle<EPS, EPSDestroy> eps;
  SS_TRY(EPSCreate(PETSC_COMM_WORLD, eps.out()));
  SS_TRY(EPSSetFromOptions(eps));
}

// The command `chart`: error against seconds, or where each method fails.

namespace {

int chart(const Options& options) {
  return options.text("chart_kind") == "limits" ? chart_limits(options) : chart_errors(options);
}

}  // namespace

Command chart_command() {
  return {"chart", "the same scene by many methods: error against seconds, or where each method fails", chart,
          true, chart_tables};
}

}  // namespace stickslip
