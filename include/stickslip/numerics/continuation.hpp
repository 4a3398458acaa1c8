// Families of orbits in one parameter: differences by it, and branches that are followed.
#pragma once

#include <cmath>
#include <complex>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

// Values on both sides of a place, for differences.
template <class Value>
struct Beside {
  Value below, above;
  double width;  // between them
};

// Of f at `at` -+ eps. At an end of what its parameter may be, where it throws Refusal, the difference is
// one-sided: `here` is f(at). Throws Failure where it is refused on either side.
template <class Refusal, class Value, class Function>
Beside<Value> beside_of(const Function& f, double at, double eps, const Value& here) {
  double width = 0;
  const auto value = [&](double by) -> Value {
    try {
      Value found = f(at + by);
      width += std::abs(by);
      return found;
    } catch (const Refusal&) {
      return here;
    }
  };
  Value below = value(-eps), above = value(eps);
  if (!(width > 0)) throw Failure("the parameter cannot be varied at " + rounded_text(at, 12));
  return {std::move(below), std::move(above), width};
}

// Pseudo-arclength continuation: the solutions of a family in one parameter as a curve that is followed round
// folds, with the special points on the way. What solves for one of them, for the curve's tangent there, and
// says what it is like, is a Family: cycles of smooth friction, cycles with rests, trains.
//
// Source: H. B. Keller, in Applications of Bifurcation Theory, Academic Press 1977, 359-384; Yu. A.
// Kuznetsov, Elements of Applied Bifurcation Theory, Springer 2004, sections 4.4, 5.3 and 10.2. Local to the
// process.

// Coordinates that tell the solutions of a branch apart, each in units in which a change of 1 is large; the
// parameter, over the length of its range, is the last.
using Place = std::vector<double>;
double dot(const Place& a, const Place& b);
Place of_length_one(Place p);

// What following a branch asks of a solution. A family derives from it what else it keeps of one.
struct Look {
  virtual ~Look() = default;
  double value = 0;      // of the parameter
  double period = 0;
  double amplitude = 0;  // negative once it has passed through zero, where the branch repeats itself
  // By how much the second half of a period differs from the first, all along it, over the range; empty where
  // it is not asked. Where it passes through zero the branch repeats itself, too: it has come to the solution
  // of half the period whose flip it was born in.
  std::vector<double> halves;
  bool stable = false;
  double wavenumber = 0;  // of the deviation that grows most
  // What becomes of deviations in a period, those that are no shift in time; empty where it is not asked.
  std::vector<std::complex<double>> multipliers;
  std::map<std::string, double> tests;  // functions whose changes of sign are special points of that name
};

// How a multiplier passes the unit circle: at 1 (a fold, or other solutions branch off), at -1 (a flip: the
// period doubles), or with its conjugate (a torus). Two real multipliers that are equal by symmetry, as of
// waves that run either way round a cell, come out as a pair whose imaginary part is round-off; one of a
// torus is far above it.
enum class Passing { at_one, at_minus_one, as_pair };
Passing passing(std::complex<double> multiplier);

// The solutions of a family beside the one where a branch stands. One is asked for by one linear condition on
// its place; solve() starts from a prediction along the tangent and keeps what it finds as the candidate,
// accept() moves there. At first the candidate is where the branch stands.
class Family {
 public:
  virtual ~Family() = default;
  // Solves for the solution with row . place = right, starting `length` along the tangent where the branch
  // stands. Throws Error where there is none.
  virtual void solve(double length, const Place& row, double right) = 0;
  virtual Place place() const = 0;              // of the candidate, like all below
  virtual Place tangent(const Place& row) = 0;  // of the branch, of length 1, on the side of `row`
  virtual std::shared_ptr<Look> look() = 0;
  virtual void accept() = 0;  // its tangent, as asked for last, is what solve() goes along
  // Where accept() has changed the coordinates of places: that tangent in the new ones.
  virtual std::optional<Place> renewed() const { return std::nullopt; }

  // In words: a solution, the option that says how many steps there are, what is left where the amplitude
  // vanishes.
  struct Words {
    std::string solution, steps, vanished;
  };
  virtual Words words() const = 0;
  // Why solve() has thrown last, where that is known beyond `last`: the kind of special point there, "" for
  // none, and words in place of those that no solution is found.
  struct Ending {
    std::string kind, words;
  };
  virtual Ending ending(const Look& last) const { return static_cast<void>(last), Ending{}; }
};

// A point between two of a branch, located to 1e-8 of the parameter's range. Kinds:
//   fold             the parameter turns round
//   flip, torus, branch   a multiplier passes the unit circle at -1, in a pair, or at 1 where the parameter
//                    does not turn: other solutions branch off
//   corner           a multiplier jumps across the unit circle: a motion touches a corner of its equations
//   hopf             the amplitude vanishes: the branch ends
//   halves           the two halves of the period become alike, at the flip of a solution of half the period:
//                    the branch ends
//   infinite-period  the period grows without bound: the branch ends; the parameter's limit
// the names of Look::tests, and the kinds of Family::ending.
struct SpecialPoint {
  std::string kind;
  double value = 0;  // of the parameter
  double period = 0;
  double wavenumber = 0;                // of Look, where kind is `wave`
  std::size_t after = 0;                // it lies behind this point of the branch
  std::shared_ptr<const Look> there{};  // empty where there is no solution at the point itself
};

// The way to go: the parameter's name, where it stands and goes to, in at most so many steps.
struct Way {
  std::string name;
  double from, to;
  int steps;
};

// How far a branch is followed: to its end, or only to the first special point behind which a solution is not
// stable any more. The family's candidate is that point then, with its tangent, and it is the one special
// point that is listed.
enum class Follow { whole, while_stable };

struct Followed {
  std::vector<std::shared_ptr<Look>> points;
  std::vector<SpecialPoint> special;
  std::string end;  // why it ends, in words
};

// Follows the branch from where the family stands. Ends at `to`, where the amplitude vanishes or two halves
// become alike, at an infinite period, where the parameter comes back past its start, where no solution is
// found further on, after all steps, or at a signal. Every turn of the parameter and every change of the
// number of multipliers outside of the unit circle between two points is a special point; where one cannot be
// located no step, however short, goes past it. `watch`, if given, adds to what is seen of each solution, and
// may throw Error: half the step is tried then. Throws Failure where the solution does not change with the
// parameter, or its branch turns back at once.
Followed follow(Family& family, const Way& way, Follow until = Follow::whole,
                const std::function<void(Look&)>& watch = nullptr);

// A function of a family's candidate that is zero at a special point of this kind (fold, flip, torus, branch,
// or a name of Look::tests) and smooth about it; NaN where it has no multiplier that could pass there.
double special_test(const std::string& kind, Family& family, const Place& row);

// The special point of this kind in a family that stands nearly there: its candidate then. `tangent`: about
// the branch's. `slope`: that of special_test along the branch there, if known, else NaN; afterwards that at
// the new point. Returns its parameter, or NaN where there is none within 0.2 along the branch.
double settle_on_special(const std::string& kind, Family& family, const Place& tangent, double range,
                         double& slope);

}  // namespace stickslip
