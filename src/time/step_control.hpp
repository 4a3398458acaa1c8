// How long steps are that PETSc does not take itself: by the rules of its TSAdapt `basic`, `dsp` and `none`,
// and by the same options (-ts_adapt_...).
#pragma once

#include <petscts.h>

#include <array>
#include <cstdint>
#include <string>

namespace stickslip {

class StepControl {
 public:
  // What `ts` has been told is read when it is asked for; `usual_norm`: of errors, where no option names one.
  StepControl(TS ts, const std::string& prefix, NormType usual_norm);

  bool adapts() const { return kind_ != none; }
  NormType norm() const { return norm_; }  // NORM_2: root mean square over all unknowns; NORM_INFINITY
  double after_failure(double h) const;    // where equations were not solved

  struct Tried {
    const char *type, *subtype;  // of the method
    int order;
    double t, h, t_end;  // where the step begins, its length, and the time to be hit
    std::int64_t index;  // steps before it
    double error;        // over what is allowed; negative: there is no estimate
    bool again;          // it had been tried longer
    bool steady;         // the next one is not to be longer
    bool restarts;       // what is remembered of earlier steps means nothing
  };
  struct Choice {
    bool accepted;
    double h;  // of the next one, or of the same one tried again
  };
  Choice choose(const Tried& tried);

 private:
  enum Kind { none, basic, dsp };
  Choice by_error(const Tried& tried) const;
  Choice by_filter(const Tried& tried);
  void read_filter(const std::string& prefix);
  void monitor(const Tried& tried, const Choice& choice) const;

  TS ts_;
  TSAdapt adapt_;
  Kind kind_;
  NormType norm_;
  bool always_accepts_ = false, monitors_ = false;
  // Of dsp (G. Soederlind, ACM Trans. Math. Software 29 (2003) 1): parameters; errors and ratios of steps.
  std::array<double, 3> beta_{}, errors_{1, 1, 1}, ratios_{1, 1, 1};
  std::array<double, 2> alpha_{};
};

}  // namespace stickslip
