#include "base/budget.hpp"

#include <utility>

namespace stickslip {

namespace {
Budget* living = nullptr;  // the innermost
}  // namespace

Budget::Budget(double most) : left_(most), outer_(std::exchange(living, this)) {}
Budget::~Budget() { living = outer_; }

void work(double evaluations) {
  bool spent = false;
  for (Budget* budget = living; budget; budget = budget->outer_)
    spent = (budget->left_ -= evaluations) < 0 || spent;
  if (spent) throw Spent();
}

}  // namespace stickslip
