// Errors, warnings and the bridge between C++ exceptions and PETSc error codes.
//
// Three rules hold everywhere:
//  * C++ code calls PETSc through SS_TRY, which turns an error code into an exception;
//  * a function handed to PETSc as a callback has its body in guarded(), which turns an exception into an
//    error code and keeps it, so that the SS_TRY around the outer call throws the original one again;
//  * only main() prints an error and chooses the exit code.
#pragma once

#include <petscsys.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace stickslip {

// An error with the exit code it ends the program with. `collective`: raised on every rank alike, so that
// rank 0 alone prints it and all leave in order; an error of one rank alone ends the others by MPI_Abort.
class Error : public std::runtime_error {
 public:
  Error(int exit_code, bool collective, const std::string& what)
      : std::runtime_error(what), exit_code_(exit_code), collective_(collective) {}
  int exit_code() const { return exit_code_; }
  bool collective() const { return collective_; }

 private:
  int exit_code_;
  bool collective_;
};

// Wrong use, found before any work: exit code 2. Collective. The text names the option or file, the value and
// what would be right, in one line.
class UsageError : public Error {
 public:
  explicit UsageError(const std::string& what) : Error(2, true, what) {}
};

// An option that belongs to another form, law or kind of stick than the scene's.
class ForeignOption : public UsageError {
 public:
  using UsageError::UsageError;
};

// The computation failed (diverged, not finite, no root, disk trouble in mid run): exit code 1. Collective.
class Failure : public Error {
 public:
  explicit Failure(const std::string& what) : Error(1, true, what) {}
};

// One rank alone met something unforeseen: exit code 1, the other ranks are ended. An error code that PETSc
// returns is of this kind, since nothing says that the other ranks saw it.
class RankFailure : public Error {
 public:
  explicit RankFailure(const std::string& what) : Error(1, false, what) {}
};

// Prints `stickslip: warning: TEXT` once (on rank 0) and keeps it for the summary; a repeated text is
// dropped. Collective in the sense that every rank must reach it with the same text.
void warn(const std::string& text);
const std::vector<std::string>& warnings();

// While it lives, warnings go to `into` alone: neither printed nor kept for the summary.
class WarningsKept {
 public:
  explicit WarningsKept(std::vector<std::string>& into);
  ~WarningsKept();
  WarningsKept(const WarningsKept&) = delete;
  WarningsKept& operator=(const WarningsKept&) = delete;

 private:
  std::vector<std::string>* before_;
};

namespace detail {
void keep_pending(std::exception_ptr e);  // kept by guarded()
// the pending exception, else what PETSc's handler was told
[[noreturn]] void throw_petsc(PetscErrorCode code);
PetscErrorCode keep_line(MPI_Comm, int, const char*, const char*, PetscErrorCode, PetscErrorType, const char*,
                         void*);
}  // namespace detail

// Installs a PETSc error handler that keeps the first line instead of printing a trace.
void install_error_handler();

// Runs the body of a PETSc callback; an exception becomes an error code and is thrown again by SS_TRY
// outside.
template <class Body>
PetscErrorCode guarded(Body&& body) {
  try {
    body();
    return 0;
  } catch (...) {
    detail::keep_pending(std::current_exception());
    return PETSC_ERR_LIB;
  }
}

}  // namespace stickslip

// Calls PETSc, SLEPc or MPI and throws where the returned code is not zero.
#define SS_TRY(call)                                                         \
  do {                                                                       \
    const PetscErrorCode ss_code_ = (call);                                  \
    if (PetscUnlikely(ss_code_)) ::stickslip::detail::throw_petsc(ss_code_); \
  } while (0)
