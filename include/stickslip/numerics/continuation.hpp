// Pseudo-arclength continuation: the solutions of a family in one parameter as a curve that is followed round
// folds, whatever is solved for. What solves for one of them and for the curve's tangent there is BranchPath;
// what a branch is made of, and where it ends, say the hooks of Continuation.
//
// Source: H. B. Keller, in Applications of Bifurcation Theory, Academic Press 1977, 359-384. Local to the
// process.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace stickslip {

// Coordinates that tell the solutions of a branch apart, each in units in which a change of 1 is large; the
// parameter, over the length of its range, is the last.
using Place = std::vector<double>;
double dot(const Place& a, const Place& b);
Place of_length_one(Place p);

// The solutions of a family beside the one where a branch stands. One is asked for by one linear condition on
// its place; go() solves for it from a prediction along the tangent and keeps it as the candidate, accept()
// moves there. At first the candidate is where the branch stands.
class BranchPath {
 public:
  virtual ~BranchPath() = default;
  // Solves for the solution with row . place = right, starting `length` along the tangent where the branch
  // stands. Throws Error where there is none.
  virtual void go(double length, const Place& row, double right) = 0;
  virtual Place place() const = 0;              // of the candidate, like all below
  virtual Place tangent(const Place& row) = 0;  // of the branch, of length 1, on the side of `row`
  virtual void accept() = 0;                    // its tangent, as asked for last, is what go() goes along
  // Where accept() has changed the coordinates of places: that tangent in the new ones.
  virtual std::optional<Place> renewed() const { return std::nullopt; }
};

// The walk along a branch, towards the value `to` of the parameter `name`, which stands at `from`, in at most
// `steps` steps. A hook that throws Error has half the step tried; one that returns words ends the branch.
class Continuation {
 public:
  using End = std::optional<std::string>;  // why a branch ends, in words
  Continuation(BranchPath& path, std::string name, double from, double to, int steps);
  virtual ~Continuation() = default;
  // Throws Failure where the solution does not change with the parameter, or its branch turns back at once.
  void begin();
  // To the end of the branch; nothing where all steps were taken.
  End follow();

 protected:
  // Of a step, in turn: its candidate is solved for, at this distance along the tangent; the candidate's own
  // tangent is known; the branch stands there.
  virtual End reached(double distance) = 0;
  virtual End turned(double distance, const Place& tangent) = 0;
  virtual End accepted() = 0;
  // The words where no step, however short, goes on; `refusal` is what kept the last from it.
  virtual std::string stuck(const std::string& refusal) = 0;
  virtual double longest() const { return longest_; }  // step
  // Of the candidate's parameter.
  virtual double value() const { return path_.place().back() * range_; }

  // The candidate at this distance along the tangent from where the branch stands.
  void go(double distance);
  // The special point of this kind on the step's way to the distance `length`: where the test function of the
  // candidate, whose values at the ends are `before` and `after`, is zero; the candidate stands there then.
  // Nothing where it jumps.
  std::optional<double> locate(const std::string& kind, const std::function<double()>& test, double length,
                               double before, double after);
  // A point that cannot be reached from here: a shorter step may reach it, and is not taken past it in
  // silence.
  [[noreturn]] static void passed_unseen(const std::string& kind, const std::string& why);

  BranchPath& path_;
  std::string name_;
  double from_, to_, range_;
  Place here_, t_;  // where the branch stands, and its tangent

 private:
  End step();
  void accept();  // the branch stands at the candidate

  int steps_;
  double longest_, ds_;
  bool strayed_ = false;  // the path has been elsewhere since the step's end
};

}  // namespace stickslip
