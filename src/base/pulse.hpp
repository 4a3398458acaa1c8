// The pulse of a search: its deep loops beat, wherever they are, so that the command shows how far it is and
// ends after a signal. What a search may do at most is bounded by counts of its own, which do not depend on
// the machine.
//
// Local to the process; each rank has its own.
#pragma once

#include <array>
#include <csignal>
#include <exception>
#include <string>

#include "base/log_stage.hpp"
#include "base/progress.hpp"

namespace stickslip {

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

// While it lives, beats are counted by what they are of and shown as `progress` (base/progress.hpp) says, and
// end the work after a signal. One within another is a part of the outer one's work.
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

}  // namespace stickslip
