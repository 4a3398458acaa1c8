// The jump of a deviation at a start or a stop, against motions on either side of the event.
#include <random>

#include "catch.hpp"
#include "model/stick_rule.hpp"

using namespace stickslip;

namespace {

// Straight motion: with the rates `before` until gradient . (u - event) = 0, then with `after`. Where it is
// after the time 1.
struct Straight {
  int dof;
  const double *event, *gradient, *before, *after;
  std::vector<double> operator()(const std::vector<double>& start) const {
    double distance = 0, speed = 0;
    for (int k = 0; k < dof; ++k) {
      distance += gradient[k] * (event[k] - start[std::size_t(k)]);
      speed += gradient[k] * before[k];
    }
    const double t = distance / speed;
    std::vector<double> end(start);
    for (int k = 0; k < dof; ++k) end[std::size_t(k)] += before[k] * t + after[k] * (1 - t);
    return end;
  }
};

}  // namespace

TEST_CASE("A deviation passes a start or a stop as the difference of two motions does",
          "[jump_matrix][serial]") {
  std::mt19937 draw(3);
  std::uniform_real_distribution<double> real(-1, 1);
  for (int k = 0; k < 200; ++k) {
    const int dof = 2 + k % 2;
    const bool stop = k % 4 < 2;
    const double side = k % 8 < 4 ? 1 : -1, slope = dof == 3 ? real(draw) : 0;
    double event[3], before[3], after[3];
    for (int i = 0; i < 3; ++i) {
      event[i] = real(draw);
      before[i] = real(draw);
      after[i] = real(draw);
    }
    event[0] = 0;
    (stop ? after : before)[0] = 0;
    const double at_stop[3] = {1, 0, 0}, at_start[3] = {0, side, -slope};
    const double* gradient = stop ? at_stop : at_start;
    const JumpMatrix jump = stop ? JumpMatrix::at_stop(dof, before, after, false)
                                 : JumpMatrix::at_start(dof, side, slope, before, after);
    // nearly tangent: a difference of 1e-6 need not pass in time
    if (std::abs(jump.event_rate()) < 0.1) continue;
    const Straight motion{dof, event, gradient, before, after};
    std::vector<double> start(event, event + dof), near(start), y(std::size_t(dof), 0.);
    for (int i = 0; i < dof; ++i) start[std::size_t(i)] -= 0.5 * before[i];
    for (int i = 0; i < dof; ++i) {
      y[std::size_t(i)] = !stop && i == 0 ? 0 : 1e-3 * real(draw);  // at rest psi does not deviate
      near[std::size_t(i)] = start[std::size_t(i)] + y[std::size_t(i)];
    }
    const std::vector<double> end = motion(start), there = motion(near);
    double rows[9];
    jump.write(rows);
    std::vector<double> passed(y);
    jump.apply(passed.data());
    for (int i = 0; i < dof; ++i) {  // straight motion: exact but for round-off of some 1e-16/0.1
      CHECK(there[std::size_t(i)] - end[std::size_t(i)] == Approx(passed[std::size_t(i)]).margin(1e-13));
      double by_rows = 0;
      for (int j = 0; j < dof; ++j) by_rows += rows[i * dof + j] * y[std::size_t(j)];
      CHECK(by_rows == Approx(passed[std::size_t(i)]).margin(1e-16));
    }
    if (stop) CHECK(std::abs(passed[0]) < 1e-17);
  }
}
