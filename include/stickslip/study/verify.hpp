// Checks of the boundary of sliding by time integration of the full system on both sides of it.
#pragma once

#include <petscsys.h>

#include <functional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/stick_slip_end.hpp"
#include "stickslip/waves/train_limits.hpp"

namespace stickslip {

// What time integration of the full system finds beside the curve.
struct Verified {
  double value = 0, value2 = 0;  // of the options
  double growth = 0;             // growth rate there
  std::string of = "sliding";    // or stick-slip: beside whose end
  // what the point says: of sliding where perturbed sliding goes, of stick-slip where that goes
  std::string expected;
  std::string from_sliding;     // where slightly perturbed sliding goes: a word of output/regime.hpp
  std::string from_stick_slip;  // the same from large oscillations
  std::string regime;           // both the same, or `bistable` (hysteresis), or undecided
};

// `count` points of the curve, each checked on its unstable and its stable side, as far off as makes the
// growth rate 1 % of the frequency; `growth` is the growth rate of these options. `before_each` gets the
// number of the check and of all. Collective over PETSC_COMM_WORLD.
std::vector<Verified> verify_boundary(GrowthRate& growth, const Options& options,
                                      const std::vector<Crossing>& points, PetscInt count,
                                      const std::function<void(std::size_t, std::size_t)>& before_each = {});

// The same of points where the stick-slip of uniform motion ends: one node from perturbed sliding, and from a
// place of the cycle that exists beside the end (from rest where none is found), at 2 % of the box or more on
// either side.
std::vector<Verified> verify_end(GrowthRate& growth, StickSlipEnd& end, const Options& options,
                                 const std::vector<Crossing>& points, PetscInt count,
                                 const std::function<void(std::size_t, std::size_t)>& before_each = {});

// Options varied along axes: what an analysis of scenes with one or two parameters is given. Not collective.

// The options with those of the axes, and those that go with them, at these values; what depends on them
// follows. Throws UsageError where a value is out of an option's range.
Options options_with(const Options& options, const std::vector<Axis>& axes, double value, double value2 = 0);

// The scene of these, on its sliding branch (Scene::from). The callback owns a copy of both.
SceneAt scene_of(const Options& options, const std::vector<Axis>& axes);

// Where the motions of a ring other than steady sliding are stable, in two parameters: its uniform
// oscillation against the waves that fit, and travelling trains. Lines in the box of two axes, as those of
// sliding (stability/boundary.hpp) and of the end of stick-slip (stick_slip_end.hpp) are. Of continua on
// rings with smooth friction. Alike on every rank, nothing communicates.

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
