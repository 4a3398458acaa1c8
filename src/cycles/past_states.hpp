// States that a motion has passed, to see after how many of them it repeats: at releases of a node, at
// beginnings of a period of the load.
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <vector>

namespace stickslip {

inline constexpr double looks_equal =
    1e-4;  // of two states, in eta, and psi and the state of friction over their sizes

class PastStates {
 public:
  static constexpr std::size_t most = 12;  // with which one is compared

  // psi is every dof-th unknown, from the first on.
  explicit PastStates(std::size_t dof) : dof_(dof) {}

  double largest_psi() const {
    double largest = 0;
    for (const auto& u : seen_)
      for (std::size_t k = 0; k < u.size(); k += dof_) largest = std::max(largest, std::abs(u[k]));
    return largest;
  }

  // How many states ago it looked the same; 0 where in none that is remembered. Remembers this one.
  int repeats_after(const std::vector<double>& now, double psi_size, double state_size) {
    int found = 0;
    for (std::size_t back = 0; back < seen_.size() && found == 0; ++back) {
      double apart = 0;
      for (std::size_t k = 0; k < now.size(); ++k) {
        const double size = k % dof_ == 0 ? psi_size : k % dof_ == 1 ? 1 : state_size;
        apart = std::max(apart, std::abs(now[k] - seen_[back][k]) / size);
      }
      if (apart < looks_equal) found = int(back) + 1;
    }
    seen_.push_front(now);
    if (seen_.size() > most) seen_.pop_back();
    return found;
  }

 private:
  std::size_t dof_;
  std::deque<std::vector<double>> seen_;
};

}  // namespace stickslip
