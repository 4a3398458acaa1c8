// How a deviation from a motion passes a start or a stop of one node of friction that sticks: the saltation
// matrix.
//
// A motion u(t) meets g(u) = 0 (a stop: g = psi of the node; a start: g = side eta - threshold(state)), u
// stays and its rates change from `before` to `after`. A motion that deviates by y meets it earlier by (grad
// g . y)/(grad g . before) and goes on at the other rates for so long:
//     y_after = y + (after - before) (grad g . y)/(grad g . before).
// The rates of the other nodes depend on this one's psi alone, which is continuous, so that they do not
// change: only the node's own psi, eta and state do. A deviation of several nodes that start or stop at once
// (alike, so that each would go first in turn) passes the matrix of each of them, in any order. After a stop
// y.psi is 0; at a start it is to be 0.
//
// With viscosity between neighbours the force on a node at rest is eta + N D2 psi (stick.hpp): at a start g
// has the share N D2 psi of its neighbours, which move, and whose rates depend on this node's psi, continuous
// still. `neighbour_force` below is that share of what the gradient is applied to. It holds for one node at a
// time, or where nodes start without a jump in psi_t.
//
// Source: R. I. Leine and H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, Springer
// 2004. Nothing here communicates or allocates. Rates have the units of the unknowns over time, as stored
// (friction.hpp).
#pragma once

namespace stickslip {

class JumpMatrix {
 public:
  // `dof` (2 or 3) rates of the node: psi, eta and the stored state, right before and right after.
  static JumpMatrix at_stop(int dof, const double* before, const double* after) {
    return JumpMatrix(dof, {1, 0, 0}, before, after);
  }
  // `side`: of the threshold, 1 or -1; `threshold_slope`: of the threshold in the stored state (0 without a
  // state); `neighbour_force`: N D2 of the nodes' psi_t before, less, under a normal load N(t), `side` times
  // what the threshold gains with time at a state that stands.
  static JumpMatrix at_start(int dof, double side, double threshold_slope, const double* before,
                             const double* after, double neighbour_force = 0) {
    JumpMatrix jump(dof, {0, side, -threshold_slope}, before, after);
    jump.event_rate_ += side * neighbour_force;
    return jump;
  }

  // grad g . before: how fast the motion goes through the event. Not 0, but where it only touches (grazing).
  double event_rate() const { return event_rate_; }
  // The deviation of the node, dof numbers, in place; `neighbour_force`: N D2 of the nodes' deviations in
  // psi, at a start.
  template <class T>
  void apply(T* y, T neighbour_force = 0) const {
    T event = gradient_.at[1] * neighbour_force;
    for (int k = 0; k < dof_; ++k) event += gradient_.at[k] * y[k];
    for (int k = 0; k < dof_; ++k) y[k] += jump_.at[k] / event_rate_ * event;
  }
  // dof rows of dof entries, one behind the other.
  void write(double* rows) const {
    for (int i = 0; i < dof_; ++i)
      for (int k = 0; k < dof_; ++k)
        rows[i * dof_ + k] = (i == k ? 1. : 0.) + jump_.at[i] / event_rate_ * gradient_.at[k];
  }

 private:
  struct Three {
    double at[3];
  };
  JumpMatrix(int dof, Three gradient, const double* before, const double* after)
      : dof_(dof), gradient_(gradient) {
    for (int k = 0; k < dof; ++k) {
      jump_.at[k] = after[k] - before[k];
      event_rate_ += gradient.at[k] * before[k];
    }
  }

  int dof_;
  Three gradient_, jump_{{0, 0, 0}};
  double event_rate_ = 0;
};

}  // namespace stickslip
