#include "base/pulse.hpp"

#include <unistd.h>

#include <fmt/format.h>
#include <array>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <utility>

namespace stickslip {

namespace {

volatile std::sig_atomic_t caught_signal = 0;
volatile std::sig_atomic_t checkpoint_asked = 0;
volatile std::sig_atomic_t pulses = 0;
std::time_t caught_at = 0;
volatile std::sig_atomic_t watches = 0;
bool kept = false;  // from the start

extern "C" void on_signal(int number) {
  if (number == SIGUSR1) {
    checkpoint_asked = 1;
    return;
  }
  const std::time_t now = std::time(nullptr);
  if (caught_signal == 0) {
    caught_at = now;
    // a search that did not hear the first, which mpirun may send twice
  } else if ((pulses > 0 || watches == 0) && now > caught_at + 1) {
    std::signal(number, SIG_DFL);
    std::raise(number);
  }
  caught_signal = number;
  if (watches == 0) alarm(10);
}

extern "C" void on_alarm(int) {
  if (watches > 0) return;
  std::signal(caught_signal, SIG_DFL);
  std::raise(caught_signal);
}

constexpr std::array<int, 3> numbers{SIGINT, SIGTERM, SIGUSR1};

struct sigaction action_of(void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  return action;
}

constexpr std::size_t most_kinds = 8;  // of work, that are shown
struct Count {
  const char* of = nullptr;
  long count = 0;
};
Pulse* living = nullptr;  // the innermost
bool shows_next = false;  // beat, whatever the clock says
std::string interrupted_during;
std::array<Count, most_kinds> counts;
long beats = 0;

}  // namespace

void keep_signals() {
  kept = true;
  const struct sigaction action = action_of(on_signal), late = action_of(on_alarm);
  for (const int number : numbers) sigaction(number, &action, nullptr);
  sigaction(SIGALRM, &late, nullptr);
}

SignalWatch::SignalWatch() {
  if (watches == 0 && !kept) caught_signal = checkpoint_asked = 0;
  watches = watches + 1;
  const struct sigaction action = action_of(on_signal);
  for (std::size_t i = 0; i < numbers.size(); ++i) sigaction(numbers[i], &action, &before_[i]);
}

SignalWatch::~SignalWatch() {
  watches = watches - 1;
  for (std::size_t i = 0; i < numbers.size(); ++i) sigaction(numbers[i], &before_[i], nullptr);
}

int SignalWatch::caught() { return caught_signal; }
bool SignalWatch::checkpoint_wanted() { return checkpoint_asked != 0; }
void SignalWatch::checkpoint_written() { checkpoint_asked = 0; }

Pulse::Pulse(const std::string& wish, const std::string& command)
    : progress_(wish, command + ": "), log_(command.c_str()), before_(std::exchange(living, this)) {
  if (!before_) counts = {};
  int ranks = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  // Ranks that share a point of a sweep could not leave it at the same place: it comes to its end, and the
  // sweep stops.
  ends_ = watches == 1 || ranks == 1;
  pulses = pulses + 1;
}

Pulse::~Pulse() {
  living = before_;
  pulses = pulses - 1;
}

void Pulse::stage(const std::string& text) {
  if (living) living->stage_ = text;
}

void Pulse::show() {
  std::string text = stage_;
  for (const Count& c : counts)
    if (c.of && c.count > 0) text += (text.empty() ? "" : ", ") + std::to_string(c.count) + " " + c.of;
  if (caught_signal == 0)
    progress_.show(text);
  else
    interrupted_during = text;
}

void announce(const std::string& text, const char* of) {
  Pulse::stage(text);
  shows_next = true;
  beat(of, 0);
}

std::string ended_during() { return interrupted_during; }

void beat(const char* of, long count) {
  if (!living) return;
  if (caught_signal != 0 && living->ends_) {
    living->show();
    throw Interrupted(caught_signal);
  }
  for (Count& c : counts) {
    if (c.of && c.of != of && std::strcmp(c.of, of) != 0) continue;
    c.of = of;
    c.count += count;
    break;
  }
  // the clock is asked at every 16th beat: short ones come by the thousand
  if ((++beats % 16 == 0 && living->progress_.due()) || std::exchange(shows_next, false)) living->show();
}

namespace {
// the cursor to the beginning of the line, and the line empty
constexpr const char* erase = "\r\033[K";
}  // namespace

Progress::Progress(const std::string& wish, std::string what)
    : what_(std::move(what)), begin_(MPI_Wtime()), last_(begin_), terminal_(isatty(STDERR_FILENO) != 0) {
  int rank;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  on_ = rank == 0 && (wish == "on" || (wish == "auto" && terminal_));
}

Progress::~Progress() {
  if (shown_ && terminal_) std::fputs(erase, stderr);
}

bool Progress::due() const { return on_ && MPI_Wtime() - last_ >= (terminal_ ? 0.5 : 5); }

void Progress::show(const std::string& text) {
  if (!on_) return;
  last_ = MPI_Wtime();
  shown_ = true;
  std::fprintf(stderr, "%s%s%s%s", terminal_ ? erase : "", what_.c_str(), text.c_str(),
               terminal_ ? "" : "\n");
  std::fflush(stderr);
}

void Progress::tell(const std::string& text) const {
  if (on_) std::fprintf(stderr, "stickslip: %s\n", text.c_str());
}

std::string Progress::left(double part) const {
  return part <= 0 ? "" : fmt::format(", {:.0f} s left", (MPI_Wtime() - begin_) * (1 - part) / part);
}

void Progress::restart_clock() { begin_ = MPI_Wtime(); }

namespace {
Budget* budgets = nullptr;  // the innermost
}  // namespace

Budget::Budget(double most) : left_(most), outer_(std::exchange(budgets, this)) {}
Budget::~Budget() { budgets = outer_; }

void work(double evaluations) {
  bool spent = false;
  for (Budget* budget = budgets; budget; budget = budget->outer_)
    spent = (budget->left_ -= evaluations) < 0 || spent;
  if (spent) throw Spent();
}

}  // namespace stickslip
