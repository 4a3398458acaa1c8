// The program: reads what the user typed, starts PETSc and SLEPc, calls the command, prints the one error there may be.
#include <slepceps.h>
#include <petscdmda.h>
#include <petscts.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <set>
#include <sstream>

#include "stickslip/command_line.hpp"
#include "stickslip/commands.hpp"
#include "stickslip/error.hpp"
#include "stickslip/handle.hpp"
#include "stickslip/library_options.hpp"
#include "stickslip/options.hpp"
#include "stickslip/provenance.hpp"
#include "stickslip/size.hpp"

namespace stickslip {
namespace {

struct Command {
  const char* name;
  const char* does;
  int (*body)(const Options&);
  bool has_grid;
};

// A new command gets its line here and its declaration in commands.hpp.
const std::vector<Command>& commands() {
  static const std::vector<Command> table = {
      {"run", "advances the scene in time", run_command, true},
      {"wave", "solves for a train of pulses: speed or length, stability, branches", wave_command, false},
      {"spectrum", "steady sliding, then the eigenvalues of the operator linearised about it", spectrum_command, true},
      {"laws", "tabulates friction laws", laws_command, false},
      {"boundary", "the boundary between sliding and stick-slip in one parameter, or traced in two", boundary_command,
       true},
      {"chart", "the same scene by many methods: error against seconds, or where each method fails", chart_command,
       true},
  };
  return table;
}

std::vector<std::string> command_names() {
  std::vector<std::string> names;
  for (const Command& command : commands()) names.push_back(command.name);
  return names;
}

int rank_of(MPI_Comm comm) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  return rank;
}

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

std::string general_help() {
  std::string text =
      "stickslip " + std::string(version()) +
      ": stick-slip friction of chains and continua, by the method of lines on PETSc and SLEPc\n\n"
      "usage: stickslip COMMAND [SCENE.yaml] [options]          mpirun -n 4 stickslip COMMAND ...\n\n"
      "commands:\n";
  for (const Command& command : commands())
    text += "  " + padded(command.name, 12) + command.does + "\n";
  return text +
         "\nA scene is a YAML file of options: `model: {gamma: 3}` is -model_gamma 3. PETSC_OPTIONS and the command\n"
         "line stand above it, with every option of PETSc and SLEPc (-ts_type, -ts_rtol, -log_view, ...).\n"
         "stickslip COMMAND -help lists the command's own options, -help all those of PETSc and SLEPc as well;\n"
         "stickslip --version tells the versions.\n";
}

std::string command_help(const Command& command) {
  std::string text = "stickslip " + std::string(command.name) + ": " + command.does +
                     "\n\nusage: stickslip " + command.name +
                     " [SCENE.yaml] [options]\n\nEach option with its [default], what it takes and its (unit); "
                     "-help all adds those of PETSc and SLEPc.\n";
  std::vector<std::string> groups;
  for (const OptionSpec& spec : option_table())
    if (reads_option(command.name, spec) && std::find(groups.begin(), groups.end(), spec.group) == groups.end())
      groups.push_back(spec.group);
  for (const std::string& group : groups) {
    text += "\n" + group + "\n";
    for (const OptionSpec& spec : option_table()) {
      if (spec.group != group || !reads_option(command.name, spec)) continue;
      const std::string value = spec.default_text.empty() ? spec.default_help : spec.default_text;
      const std::string takes = spec.type == OptionType::text ? "text" : requirement(spec);
      text += "  -" + spec.name + " [" + value + "]: " + takes + (spec.unit.empty() ? "" : " (" + spec.unit + ")") +
              "\n      " + wrapped(spec.help, 6) + "\n";
    }
  }
  return text;
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
  EpsHandle eps;
  SS_TRY(EPSCreate(PETSC_COMM_WORLD, eps.out()));
  SS_TRY(EPSSetFromOptions(eps));
}

// PETSc and SLEPc, started with the user's options for them and with nothing else: no .petscrc, and the environment
// has been read already.
class Libraries {
 public:
  Libraries(char* program, const Options& options, bool help) {
    unsetenv("PETSC_OPTIONS");
    unsetenv("PETSC_OPTIONS_YAML");
    install_error_handler();
    insert_library_options(options);
    SS_TRY(PetscOptionsSetValue(nullptr, "-no_signal_handler", "true"));
    if (help) SS_TRY(PetscOptionsSetValue(nullptr, "-help", nullptr));
    // What PETSc asks for before all else it must find on the command line: where such an option is set already, PETSc
    // sets it again from the very text that this frees.
    words_ = {program, "-skip_petscrc", "true"};
    for (const char* first : {"options_monitor", "options_monitor_cancel", "petsc_ci"}) {
      const std::string name = "-" + std::string(first);
      if (!options.is_set(first)) continue;
      SS_TRY(PetscOptionsClearValue(nullptr, name.c_str()));
      words_.push_back(name);
      if (!options.text(first).empty()) words_.push_back(options.text(first));
    }
    for (std::string& word : words_) pointers_.push_back(word.data());
    pointers_.push_back(nullptr);
    int argc = int(words_.size());
    char** argv = pointers_.data();
    SS_TRY(SlepcInitialize(&argc, &argv, nullptr, nullptr));
    install_error_handler();
  }
  Libraries(const Libraries&) = delete;
  Libraries& operator=(const Libraries&) = delete;
  // Ends them; what they write last (-log_view) may fail.
  void end() {
    ended_ = true;
    SS_TRY(SlepcFinalize());
  }
  ~Libraries() {
    if (!ended_) (void)SlepcFinalize();
  }

 private:
  bool ended_ = false;
  std::vector<std::string> words_;  // PETSc keeps the pointers
  std::vector<char*> pointers_;
};

void print(const std::string& text) {
  if (std::fputs(text.c_str(), stdout) < 0 || std::fflush(stdout) != 0)
    throw RankFailure("standard output cannot be written");
}

// The ranks that work on this run: all, or with run_seeds those of one seed.
MPI_Comm team = MPI_COMM_WORLD;

// NAME.h5 for one seed: NAME-seed7.h5.
std::string name_of_seed(const std::string& path, const std::string& seed) {
  const std::size_t dot = path.rfind('.'), slash = path.rfind('/');
  const bool has_end = dot != std::string::npos && (slash == std::string::npos || dot > slash + 1) && dot > 0;
  return path.substr(0, has_end ? dot : path.size()) + "-seed" + seed + (has_end ? path.substr(dot) : "");
}

// Splits the ranks over run_seeds, before PETSc starts, and gives each team the options of its seed.
Options of_own_seed(const Options& options) {
  const std::vector<PetscInt> seeds = options.integers("run_seeds");
  const std::string shown = "run_seeds " + options.text("run_seeds") + ": ";
  int ranks;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  if (std::set<PetscInt>(seeds.begin(), seeds.end()).size() != seeds.size())
    throw UsageError(shown + "each seed once, or runs would write the same file");
  if (int(seeds.size()) > ranks)
    throw UsageError(shown + std::to_string(seeds.size()) + " runs side by side need as many ranks, and there " +
                     (ranks == 1 ? "is 1" : "are " + std::to_string(ranks)) + " (mpirun -n)");
  if (options.is_set("restart"))
    throw UsageError(shown + "not with restart; continue each seed's run by itself");
  if (options.text("summary") == "-") throw UsageError(shown + "the summaries need a file, not standard output");
  const int own = int(long(rank_of(MPI_COMM_WORLD)) * long(seeds.size()) / ranks);
  if (MPI_Comm_split(MPI_COMM_WORLD, own, rank_of(MPI_COMM_WORLD), &team) != MPI_SUCCESS)
    throw Failure("the ranks cannot be split over run_seeds");
  PETSC_COMM_WORLD = team;
  const std::string seed = std::to_string(seeds[std::size_t(own)]);
  Options mine = options.with("run_seeds", "").with("friction_seed", seed).with("init_seed", seed);
  for (const char* file : {"out_file", "summary"})
    if (options.is_set(file)) mine = mine.with(file, name_of_seed(options.text(file), seed));
  return mine;
}

// read_command_line() lets no other name pass.
const Command& command_named(const std::string& name) {
  for (const Command& one : commands())
    if (name == one.name) return one;
  throw std::logic_error("no command '" + name + "'");
}

int program(int argc, char** argv) {
  note_command_line(argc, argv);
  const CommandLine line = read_command_line(argc, argv, command_names(), MPI_COMM_WORLD);
  const bool speaks = rank_of(MPI_COMM_WORLD) == 0;
  if (line.help && speaks) print(line.command.empty() ? general_help() : command_help(command_named(line.command)));
  if (line.help && !line.help_all) return 0;
  Options options = Options::from(line.command, line.given);
  if (line.command == "run" && options.is_set("run_seeds")) options = of_own_seed(options);
  try {
    Libraries libraries(argv[0], options, line.help_all);
    int code = 0;
    if (line.version) {
      if (speaks) print(version_text());
    } else {
      check_library_types(options);
      check_library_names(options);
      if (line.help_all) {
        print_library_help();
      } else {
        const Command& command = command_named(line.command);
        if (command.has_grid && !options.is_set("restart")) check_size(options);
        code = command.body(options);
        if (code == 0) warn_unused_at_end(options);
      }
    }
    libraries.end();
    return code;
  } catch (const RankFailure& e) {
    // a value that PETSc refused while an object took its options: every rank has met it
    const std::string name = option_behind(e.what(), options);
    if (name.empty()) throw;
    throw UsageError("-" + name + " " + quoted(options.text(name)) + ": " + e.what());
  }
}

// One line, whatever the text holds.
void print_error(const std::string& text) {
  std::string line = "stickslip: error: " + text;
  for (char& c : line)
    if ((unsigned char)c < 0x20 || c == 0x7f) c = ' ';
  line += '\n';
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

// One rank failed and the others do not know: it speaks and ends them all.
int end_all(const std::string& text) {
  int size = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &size);
  if (size > 1) usleep(useconds_t(100000) * useconds_t(rank_of(MPI_COMM_WORLD)));  // where all fail, the first speaks
  print_error(text);
  if (size > 1) MPI_Abort(MPI_COMM_WORLD, 1);
  return 1;
}

}  // namespace
}  // namespace stickslip

int main(int argc, char** argv) {
  using namespace stickslip;
  std::signal(SIGXFSZ, SIG_IGN);  // a limit of file size is met as an error of the write, like a full disk
  int provided = 0;
  if (MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided) != MPI_SUCCESS) return 1;
  int code = 1;
  try {
    code = program(argc, argv);
  } catch (const Error& e) {
    code = e.exit_code();
    if (!e.collective()) {
      code = end_all(e.what());
    } else if (rank_of(team) == 0) {
      print_error(e.what());
    }
  } catch (const std::bad_alloc&) {
    code = end_all("out of memory");
  } catch (const std::exception& e) {
    code = end_all(std::string("internal error: ") + e.what());
  }
  if (team != MPI_COMM_WORLD) {  // the launcher ends all ranks when one ends with an error: none before all are done
    MPI_Allreduce(MPI_IN_PLACE, &code, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    MPI_Comm_free(&team);
  }
  MPI_Finalize();
  return code;
}
