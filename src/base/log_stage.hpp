// A stage of the table that -log_view prints, for as long as the object lives; one within another is counted
// for itself.
#pragma once

#include <petsclog.h>

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

}  // namespace stickslip
