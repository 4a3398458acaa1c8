// Where the motions of a ring other than steady sliding are stable, in two parameters: its uniform
// oscillation against the waves that fit, and travelling trains. Lines in the box of two axes, as those of
// sliding (stability/boundary.hpp) and of the end of stick-slip (stick_slip_end.hpp) are. Of continua on
// rings with smooth friction. Alike on every rank, nothing communicates.
#pragma once

#include <petscsys.h>

#include <functional>
#include <string>
#include <vector>

#include "stickslip/stability/boundary.hpp"
#include "stickslip/waves/train_limits.hpp"

namespace stickslip {

// Largest growth rate, 1/time, of deviations from the uniform oscillation of a continuum on a ring of length
// L: uniform ones, and waves exp(ikx), k = 2 pi m/L, m >= 1: all of the first hundred, further on every
// fiftieth part. NaN where there is no such oscillation.
double growth_on_uniform(const Scene& ring);

class MediumLines : public OnAxes {
 public:
  // `pulses`: of the trains. `each` is called before every evaluation.
  MediumLines(SceneAt scene_at, std::vector<Axis> axes, PetscInt pulses, std::function<void()> each);

  // Why a scene has no such lines; empty where it has.
  static std::string refusal(const Scene& scene);

  // About `count` points of the line on which growth_on_uniform is zero: `of` "waves", kind `wave`, with the
  // wavenumber of the wave that grows fastest there.
  std::vector<Crossing> waves(PetscInt count, std::vector<std::string>& notes);
  // growth_on_uniform as sampled for it, 9 x 9, the first axis fastest.
  const std::vector<double>& growth() const { return growth_; }

  // Lines at which stable trains begin: `of` "trains", kind `fold`, `hopf` or `zero`
  // (waves/train_limits.hpp). Trains are followed along the first axis at both ends and the middle of the
  // second; what bounds their stability there is followed through the box, about `count` points in all. Left
  // out are those beyond which trains are unstable all the same. `notes`: what was seen and not located.
  std::vector<Crossing> trains(PetscInt count, std::vector<std::string>& notes);
  const std::vector<TrainSample>& samples() const { return samples_; }  // coordinates on the axes

 private:
  Crossing crossing(double x, double y, const char* of) const;
  void follow_trains(double y, std::vector<TrainLimitLine>& lines, std::vector<std::string>& notes);

  PetscInt pulses_;
  std::vector<double> growth_;
  std::vector<TrainSample> samples_;
};

}  // namespace stickslip
