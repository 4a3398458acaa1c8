// Branches that are followed, of families whose solutions are known.

#include <cmath>
#include <memory>

#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/continuation.hpp"

using namespace stickslip;

namespace {

// One solution for each value of the parameter, from which others branch off at `branches`: the equations are
// singular there, and are solved in no place nearer than `singular`.
class Straight : public Family {
 public:
  Straight(double branches, double singular) : branches_(branches), singular_(singular) {}

  void solve(double, const Place& row, double right) override {
    const double value = right / row.back();
    if (std::abs(value - branches_) < singular_) throw Failure("Newton's method does not converge");
    value_ = value;
  }
  Place place() const override { return {0, value_}; }
  Place tangent(const Place& row) override { return {0, row.back() < 0 ? -1. : 1.}; }
  std::shared_ptr<Look> look() override {
    auto seen = std::make_shared<Look>();
    seen->value = value_;
    seen->period = seen->amplitude = 1;
    // two that pass together, to which the solution brings an error of its own
    seen->multipliers = {1 + .3 * (branches_ - value_), 1 + .3 * (branches_ - value_) + 1e-9, .5};
    return seen;
  }
  void accept() override {}
  Words words() const override { return {"solution", "steps", ""}; }

 private:
  double branches_, singular_, value_ = 0;
};

}  // namespace

TEST_CASE("a branch passes where others branch off and its equations are singular", "[cycle]") {
  for (const double singular : {0., 1e-9, 3e-7, 2e-6}) {
    Straight family(0.43217, singular);
    const Followed followed = follow(family, {"parameter", 0, 1, 50}, Follow::whole, nullptr);
    INFO(singular << ": " << followed.end);
    CHECK(followed.points.back()->value == Approx(1));
    REQUIRE(followed.special.size() == 1);
    CHECK(followed.special[0].kind == "branch");
    CHECK(std::abs(followed.special[0].value - 0.43217) < 1e-8);  // as every special point
  }
}
