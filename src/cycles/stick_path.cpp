// The branch of a cycle with rests: from one value of the parameter to the next, as far as the slips come to rest.
#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/cycles/stick_cycle.hpp"

namespace stickslip {

namespace {

// The parameter alone tells the cycles apart: a branch of this kind does not turn round. It ends where a slip only
// grazes rest.
class StickPath : public CyclePath {
 public:
  StickPath(std::function<Scene(double)> at, double from, double range, const StickCycle& first)
      : scene_at_(std::move(at)), range_(range), here_{from, first}, there_(here_) {}

  void go(double length, const Place& row, double right) override {
    (void)length;
    const double value = right / row[0] * range_;
    const StickCycle found = polish(scene_at_(value), here_.cycle);
    if (found.sequence != here_.cycle.sequence)
      throw Failure("the sequence of starts and stops changes: " + found.sequence);
    there_ = {value, found};
  }
  Place place() const override { return {there_.value / range_}; }
  Place tangent(const Place& row) override { return {row[0] < 0 ? -1. : 1.}; }
  Cycle cycle() const override { return described(scene_at_(there_.value), there_.cycle); }
  const StickCycle& candidate() const { return there_.cycle; }
  void accept() override { here_ = there_; }

 private:
  struct Stand {
    double value;
    StickCycle cycle;
  };
  std::function<Scene(double)> scene_at_;
  double range_;
  Stand here_, there_;
};

}  // namespace

std::unique_ptr<CyclePath> stick_path(std::function<Scene(double)> at, double from, double range,
                                      const StickCycle& first) {
  return std::make_unique<StickPath>(std::move(at), from, range, first);
}

const StickCycle& stick_candidate(const CyclePath& path) { return dynamic_cast<const StickPath&>(path).candidate(); }

}  // namespace stickslip
