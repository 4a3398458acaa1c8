#include "stickslip/base/error.hpp"

#include <algorithm>
#include <cstdio>
#include <exception>

#include "stickslip/base/root.hpp"

namespace stickslip {

namespace {
std::exception_ptr pending;
std::string petsc_line;
const char* const out_of_memory = "out of memory";
std::vector<std::string> kept_warnings;
std::vector<std::string>* diverted = nullptr;  // of the innermost WarningsKept
}  // namespace

WarningsKept::WarningsKept(std::vector<std::string>& into) : before_(std::exchange(diverted, &into)) {}
WarningsKept::~WarningsKept() { diverted = before_; }

void warn(const std::string& text) {
  if (diverted) {
    if (std::find(diverted->begin(), diverted->end(), text) == diverted->end()) diverted->push_back(text);
    return;
  }
  if (std::find(kept_warnings.begin(), kept_warnings.end(), text) != kept_warnings.end()) return;
  kept_warnings.push_back(text);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) std::fprintf(stderr, "stickslip: warning: %s\n", text.c_str());
}

const std::vector<std::string>& warnings() { return kept_warnings; }

void Trouble::share(MPI_Comm comm, int from) const {
  int told[2] = {exit_code, static_cast<int>(text.size())};
  SS_TRY(MPI_Bcast(told, 2, MPI_INT, from, comm));
  if (told[0] == 0) return;
  std::string its = text;
  its.resize(told[1]);
  SS_TRY(MPI_Bcast(&its[0], told[1], MPI_CHAR, from, comm));
  if (told[0] == 2) throw UsageError(its);
  throw Failure(its);
}

namespace detail {

void keep_pending(std::exception_ptr e) {
  if (!pending) pending = std::move(e);
}

void throw_petsc(PetscErrorCode code) {
  if (pending) std::rethrow_exception(std::exchange(pending, nullptr));
  const std::string line = std::exchange(petsc_line, "");
  if (line == out_of_memory) throw RankFailure(line);
  throw RankFailure("PETSc error " + std::to_string(code) + (line.empty() ? "" : ": " + line));
}

PetscErrorCode keep_line(MPI_Comm, int, const char* function, const char*, PetscErrorCode code,
                         PetscErrorType type, const char* message, void*) {
  if (type == PETSC_ERROR_INITIAL) {
    const std::string where = function ? function : "?";
    petsc_line =
        where == "PetscMallocAlign" ? out_of_memory : (message ? message : "") + (" (in " + where + ")");
    for (char& c : petsc_line)
      if (c == '\n') c = ' ';
  }
  return code;
}

}  // namespace detail

}  // namespace stickslip

// LAPACK and BLAS call this where an argument is wrong, one that is not finite among them. Theirs prints a
// line and ends the program with exit code 0.
extern "C" [[noreturn]] void xerbla_(const char* routine, const int* argument, std::size_t length) {
  std::string name(routine, std::min<std::size_t>(length, 16));
  name.erase(name.find_last_not_of(" \0") + 1);
  throw stickslip::RankFailure(
      "LAPACK's " + name + " refuses its argument " + std::to_string(*argument) +
      ": most likely a number that is not finite; are parameters or grid beyond measure?");
}

namespace stickslip {

void install_error_handler() { (void)PetscPushErrorHandler(detail::keep_line, nullptr); }

}  // namespace stickslip
