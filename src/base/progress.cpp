#include "base/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

namespace stickslip {

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

}  // namespace stickslip
