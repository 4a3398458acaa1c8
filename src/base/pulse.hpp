// What a long computation tells while it goes on, and what ends it: lines of -log_view, progress, the pulse
// of a search, signals, and how much work it may do.
#pragma once

#include <petsclog.h>
#include <petscsys.h>

#include <array>
#include <csignal>
#include <exception>
#include <string>

#include "stickslip/base/error.hpp"

namespace stickslip {

// A stage of the table that -log_view prints, for as long as the object lives; one within another is counted
// for itself.
class LogStage {
 public:
  explicit LogStage(const char* name) {
    PetscLogStage stage;
    SS_TRY(PetscLogStageGetId(name, &stage));
    if (stage < 0) SS_TRY(PetscLogStageRegister(name, &stage));
    SS_TRY(PetscLogStagePush(stage));
  }
  ~LogStage() { (void)PetscLogStagePop(); }
  LogStage(const LogStage&) = delete;
  LogStage& operator=(const LogStage&) = delete;
};

// A line of its own in -log_view, for a part of the program whose share of a run is asked for.
class LogEvent {
 public:
  // Of PETSc's own events that of this name, or one more.
  explicit LogEvent(const char* name) {
    PetscClassId program;
    SS_TRY(PetscLogEventGetId(name, &id_));
    if (id_ >= 0) return;
    SS_TRY(PetscClassIdRegister("stickslip", &program));
    SS_TRY(PetscLogEventRegister(name, program, &id_));
  }
  // What happens while it lives is counted, and its time taken; nothing is unless -log_view asks for it.
  class Scope {
   public:
    explicit Scope(const LogEvent& event) : id_(event.id_) { (void)begin(); }
    ~Scope() { (void)end(); }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    PetscErrorCode begin() const {
      PetscFunctionBegin;
      PetscCall(PetscLogEventBegin(id_, 0, 0, 0, 0));
      PetscFunctionReturn(0);
    }
    PetscErrorCode end() const {
      PetscFunctionBegin;
      PetscCall(PetscLogEventEnd(id_, 0, 0, 0, 0));
      PetscFunctionReturn(0);
    }
    PetscLogEvent id_;
  };

 private:
  PetscLogEvent id_ = -1;
};

// How far long work is: one line on standard error, written anew about twice a second on a terminal and every
// five seconds elsewhere, by rank 0 alone. `progress` is on, off or auto (on a terminal only). Not
// collective.
class Progress {
 public:
  // `wish`: the option `progress`, on, off or auto; `what` stands before every line ("chart: ").
  Progress(const std::string& wish, std::string what);
  ~Progress();  // the line goes, so that what follows stands alone
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Whether it is time for another line, so that text is made only when it is shown.
  bool due() const;
  void show(const std::string& text);
  void tell(const std::string& text) const;  // a line that stays
  // ", 12 s left" if `part` of the work (0 to 1) took the time since restart_clock or the start; "" at the
  // beginning.
  std::string left(double part) const;
  void restart_clock();

 private:
  std::string what_;
  double begin_, last_;
  bool on_ = false, terminal_ = false, shown_ = false;
};

// The pulse of a search: its deep loops beat, wherever they are, so that the command shows how far it is and
// ends after a signal. What a search may do at most is bounded by counts of its own, which do not depend on
// the machine.
//
// Local to the process; each rank has its own.

// What SIGINT, SIGTERM and SIGUSR1 ask for before the first SignalWatch is kept for that from now on, so that
// a signal ends a command in the same way however early it comes. Where none begins within ten seconds, or
// another signal comes after two, it ends the program. For main, once.
void keep_signals();

// While it lives, SIGINT and SIGTERM ask for an end, SIGUSR1 for a checkpoint; where a Pulse lives a second
// one, two seconds later, ends the program. One within another knows what the outer one has caught.
class SignalWatch {
 public:
  SignalWatch();
  ~SignalWatch();
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;
  static int caught();              // SIGINT or SIGTERM on this rank, 0: neither so far
  static bool checkpoint_wanted();  // SIGUSR1, since checkpoint_written
  static void checkpoint_written();

 private:
  std::array<struct sigaction, 3> before_{};
};

// SIGINT or SIGTERM ended a search. No Error: nothing that tries another way where one fails may take it for
// a failure.
class Interrupted : public std::exception {
 public:
  explicit Interrupted(int signal) : signal_(signal) {}
  int exit_code() const { return 128 + signal_; }
  const char* what() const noexcept override { return signal_ == SIGINT ? "SIGINT" : "SIGTERM"; }

 private:
  int signal_;
};

// While it lives, beats are counted by what they are of and shown as `progress` says, and end
// the work after a signal. One within another is a part of the outer one's work.
class Pulse {
 public:
  explicit Pulse(const std::string& wish, const std::string& command);
  ~Pulse();
  Pulse(const Pulse&) = delete;
  Pulse& operator=(const Pulse&) = delete;

  // What is being done, to stand before the counts.
  static void stage(const std::string& text);

 private:
  friend void beat(const char*, long);
  void show();

  SignalWatch watch_;
  Progress progress_;
  LogStage log_;
  Pulse* before_;
  std::string stage_;
  bool ends_ = true;
};

// `count` more pieces of work, of which `of` (a literal, in the plural) says what they are. Costs
// nanoseconds. Throws Interrupted after SIGINT or SIGTERM where a Pulse lives.
void beat(const char* of, long count = 1);

// What a search tells beside its pulse (pulse.hpp): before a call that hears nothing, and where it was when a
// signal ended it.

// The stage from now on, shown at once: a long call of a library begins, which hears no signal. `of`: what it
// is, of which a beat tells afterwards.
void announce(const std::string& text, const char* of);

// The stage, with the counts, at which a signal ended the search last; "" before.
std::string ended_during();

// Runs `body`. Where a signal ends it, `reached` keeps and says what was found until then.
template <class Body, class Reached>
void keeping_what_is_found(const Body& body, const Reached& reached) {
  try {
    body();
  } catch (const Interrupted&) {
    reached();
    throw;
  }
}

// What a search may do at most, counted in work and not in seconds, so that the same request has the same
// answer on every machine. Deep loops say what they do, wherever they are (work()); a search whose length
// nobody foresees holds a Budget, and ends with what it knows where that is spent.
//
// The unit is about one evaluation of the equations of one node. Local to the process; each rank has its own.

// The budget of a search is spent. No Error: nothing that tries another way where one fails may take it for
// a failure.
class Spent : public std::exception {
 public:
  const char* what() const noexcept override { return "the work that a search may do is done"; }
};

// While it lives, work() counts towards it and throws Spent beyond `most`. What is done within an inner one
// counts for both.
class Budget {
 public:
  explicit Budget(double most);
  ~Budget();
  Budget(const Budget&) = delete;
  Budget& operator=(const Budget&) = delete;

 private:
  friend void work(double);
  double left_;
  Budget* outer_;
};

void work(double evaluations);

}  // namespace stickslip
