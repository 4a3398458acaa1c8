// Reads what the user typed, starts PETSc and SLEPc, calls the command, prints the one error there may be.
#include "stickslip/commands/program.hpp"

#include <slepceps.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>

#include "base/process.hpp"
#include "base/pulse.hpp"
#include "commands/command.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/provenance.hpp"
#include "stickslip/options/command_line.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/study/size.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {
namespace {

int rank_of(MPI_Comm comm) {
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  return rank;
}

void print(const std::string& text) {
  if (std::fputs(text.c_str(), stdout) < 0 || std::fflush(stdout) != 0)
    throw RankFailure("standard output cannot be written");
}

// PETSc and SLEPc, started with the user's options for them and with nothing else: no .petscrc, and the
// environment has been read already.
class Libraries {
 public:
  Libraries(char* program, const Options& options, bool help) {
    unsetenv("PETSC_OPTIONS");
    unsetenv("PETSC_OPTIONS_YAML");
    install_error_handler();
    insert_library_options(options);
    SS_TRY(PetscOptionsSetValue(nullptr, "-no_signal_handler", "true"));
    // what was left unused is said by this program, in its own words; names that a later release will drop
    // hold here
    if (!options.is_set("options_left")) SS_TRY(PetscOptionsSetValue(nullptr, "-options_left", "false"));
    PetscBool used;  // asked for only where there is one
    SS_TRY(PetscOptionsSetValue(nullptr, "-options_suppress_deprecated_warnings", "true"));
    SS_TRY(PetscOptionsHasName(nullptr, nullptr, "-options_suppress_deprecated_warnings", &used));
    if (help) SS_TRY(PetscOptionsSetValue(nullptr, "-help", nullptr));
    // What PETSc asks for before all else it must find on the command line: where such an option is set
    // already, PETSc sets it again from the very text that this frees.
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
    register_time_steppers();
  }
  // A stage of the library's own that nothing here enters: one that never was has no name in -log_view.
  static void name_stages() {
    PetscLogStage stage;
    SS_TRY(PetscLogStageGetId("PCMPI", &stage));
    if (stage < 0) return;
    SS_TRY(PetscLogStagePush(stage));
    SS_TRY(PetscLogStagePop());
  }
  Libraries(const Libraries&) = delete;
  Libraries& operator=(const Libraries&) = delete;
  // Ends them; what they write last (-log_view) may fail.
  void end() {
    ended_ = true;
    name_stages();
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

// The program's own options that the user gave; those alone that the command does not read. PETSc, to whose
// -options_view and -options_left this is added, knows only its own.
std::string own_options(const Options& options, bool unread) {
  std::string text =
      unread ? "#Own options that " + options.command() + " does not read:\n" : "#Own options:\n";
  for (const auto& [name, value] : options.given()) {
    const OptionSpec* spec = find_option(name);
    if (spec && !(unread && reads_option(options.command(), *spec))) text += "-" + name + " " + value + "\n";
  }
  return text;
}

int program(int argc, char** argv) {
  note_command_line(argc, argv);
  const CommandLine line = read_command_line(argc, argv, command_names(), MPI_COMM_WORLD);
  const bool speaks = rank_of(MPI_COMM_WORLD) == 0;
  if (line.help && speaks)
    print(line.command.empty()
              ? general_help()
              : command_help(command_named(line.command), line.help_all ? "" : line.help_topic));
  if (line.help && !line.help_all) return 0;
  const Options options = Options::from(line.command, line.given);
  try {
    Libraries libraries(argv[0], options, line.help_all);
    int code = 0;
    if (line.version) {
      if (speaks) print(version_text());
    } else {
      if (options.is_set("ts_type")) check_type_offered(options.text("ts_type"));
      check_library_types(options);
      if (line.help_all) {
        print_library_help();
      } else {
        const Command& command = command_named(line.command);
        if (command.has_grid && !options.is_set("restart")) check_size(options);
        if (options.is_set("options_view") && speaks) print(own_options(options, false));
        if (const std::vector<std::string> idle = options.idle(); !idle.empty() && line.command != "run")
          warn("without effect here: " + joined(idle));
        note_names(names_of(options));  // of a run that goes on those of its checkpoint take their place
        const auto body = [&] { return command.body(options); };
        code = command.has_grid && !options.is_set("restart") ? on_ranks_of(options, body) : body();
        if (options.is_set("options_left") && speaks) print(own_options(options, true));
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
  std::fputs(("stickslip: error: " + one_line(text) + "\n").c_str(), stderr);
  std::fflush(stderr);
}

// One rank failed and the others do not know: it speaks and ends them all.
int end_all(const std::string& text) {
  int size = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &size);
  // where all fail, the first speaks
  if (size > 1) usleep(useconds_t(100000) * useconds_t(rank_of(MPI_COMM_WORLD)));
  print_error(text);
  if (size > 1) MPI_Abort(MPI_COMM_WORLD, 1);
  return 1;
}

// A signal ended a search on each of several ranks where it stood: the first writes its summary, then all are
// ended.
int end_interrupted(const Interrupted& e) {
  int size = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &size);
  if (size > 1) {
    if (rank_of(MPI_COMM_WORLD) > 0) sleep(2);
    MPI_Abort(MPI_COMM_WORLD, e.exit_code());
  }
  return e.exit_code();
}

}  // namespace
}  // namespace stickslip

int stickslip::main(int argc, char** argv) {
  if (argc == 2 && std::string(argv[1]) == "--tables") return std::fputs(tables_text().c_str(), stdout) < 0;
  std::signal(SIGXFSZ, SIG_IGN);  // a limit of file size is met as an error of the write, like a full disk
  keep_signals();
  if (!start_mpi(argc, argv)) return 1;
  int code = 1;
  try {
    code = program(argc, argv);
  } catch (const Interrupted& e) {
    code = end_interrupted(e);
  } catch (const Error& e) {
    code = e.exit_code();
    if (!e.collective()) {
      code = end_all(e.what());
    } else if (rank_of(MPI_COMM_WORLD) == 0) {
      print_error(e.what());
    }
  } catch (const std::bad_alloc&) {
    code = end_all("out of memory");
  } catch (const std::exception& e) {
    code = end_all(std::string("internal error: ") + e.what());
  }
  MPI_Finalize();
  return code;
}
