// A stage of the table that -log_view prints, for as long as the object lives; one within another is counted
// for itself.
#pragma once

#include <petsclog.h>
#include <petscsys.h>

#include "stickslip/base/error.hpp"

namespace stickslip {

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

}  // namespace stickslip
