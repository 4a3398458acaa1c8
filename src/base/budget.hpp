// What a search may do at most, counted in work and not in seconds, so that the same request has the same
// answer on every machine. Deep loops say what they do, wherever they are (work()); a search whose length
// nobody foresees holds a Budget, and ends with what it knows where that is spent.
//
// The unit is about one evaluation of the equations of one node. Local to the process; each rank has its own.
#pragma once

#include <exception>

namespace stickslip {

// The budget of a search is spent. No Error: nothing that tries another way where one fails may take it for
// a failure.
class Spent : public std::exception {
 public:
  const char* what() const noexcept override { return "the work that a search may do is done"; }
};

// While it lives, work() counts towards it and throws Spent beyond `most`. What is done within an inner one
// counts for both.
class Budget {
 public:
  explicit Budget(double most);
  ~Budget();
  Budget(const Budget&) = delete;
  Budget& operator=(const Budget&) = delete;

 private:
  friend void work(double);
  double left_;
  Budget* outer_;
};

void work(double evaluations);

}  // namespace stickslip
