// A line of its own in -log_view, for a part of the program whose share of a run is asked for.
#pragma once

#include <petscsys.h>

#include "stickslip/base/error.hpp"

namespace stickslip {

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

}  // namespace stickslip
