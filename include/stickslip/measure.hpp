// What a run measures from its fields: amplitude, regime, number of pulses, wave speed, how steep its fronts are.
//
// The window is the last quarter of the run, sampled at equal times; the third quarter serves to tell whether the
// motion is still changing. All of it works on whole fields, on the rank that has them.
//
//   amplitude   half the largest range, over the nodes, that psi runs through in time, in the samples and, where they
//               are told by widen(), in the steps between them
//   regime      `stick-slip`: the amplitude is at least a fifth of |v| (of 1 where v = 0) and within a quarter of that
//               of the third quarter; `sliding`: below a thousandth of it, or falling so fast that the next window of
//               that length would halve it again; `undecided` otherwise
//   pulses      upward passages of psi through v along x at the end, on a ring or between the ends
//   wave speed  on a ring with m pulses the slope of the phase of the m-th Fourier coefficient, -2 pi m V/L, by least
//               squares; elsewhere the least-squares slope of the times at which the nodes of the middle half last
//               passed v upwards, along each pulse. Positive to the right; none where the phase is not linear in time
//               to 0.3 rad, where pulses of one direction hold fewer than 80 % of the nodes, or where the times of
//               passage are off the straight line by more than a tenth of what they climb: no one speed then.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/scene.hpp"

namespace stickslip {

class Measurement {
 public:
  Measurement(const Scene& scene, double t_end);

  // When to sample: `quarter` times in the third quarter, four times as many in the last, the end included.
  static constexpr int quarter = 64;
  const std::vector<double>& times() const { return times_; }

  void sample(double t, const std::vector<double>& psi);
  // psi of every node ran from low to high in the third (part 0) or last (1) quarter.
  void widen(int part, const std::vector<double>& low, const std::vector<double>& high);

  struct Result {
    std::string regime = "undecided";
    std::optional<double> amplitude, wave_speed;
    std::optional<int> pulses;
    double steepest = 0;  // largest step of psi between neighbours over its range, in the window
    double window_begin, window_end;
  };
  Result result() const;

  // Everything sampled so far, for a checkpoint.
  std::map<std::string, std::vector<double>> save() const;
  // Throws std::runtime_error where they are of another scene.
  void restore(const std::map<std::string, std::vector<double>>& saved);

 private:
  std::optional<double> ring_speed() const;
  std::optional<double> passage_speed() const;

  Scene scene_;
  double t_end_;
  std::vector<double> times_;
  // ranges of psi at each node in the third (0) and the last quarter (1)
  std::vector<double> low_[2], high_[2];
  std::vector<double> last_, passed_;  // the last sample, and when each node last passed v upwards
  std::vector<double> sample_t_, phase_t_, phase_;  // phase of the Fourier coefficient, unwrapped
  double mode_ = 0;                    // number of pulses at the beginning of the window
  double steepest_ = 0;
};

}  // namespace stickslip
