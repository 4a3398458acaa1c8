// Kinks of the equations along a periodic motion: where a velocity passes 0 and the rates, which contain
// |psi|, turn a corner; or where it passes from one piece of friction into the next.
//
// Inside an interval of collocation a kink costs all but the second order, and halving the interval says
// little of what is left, for that hangs on where in the interval it lies. With a node at the kink both sides
// are smooth. Local to the process.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

// Where kinks may be: unknowns that are velocities, and where beside 0 pieces of friction meet.
struct Joints {
  std::vector<int> velocities;
  std::vector<double> levels;
};

struct Kinks {
  std::vector<double> phases;  // rising
  // the Jacobian grows beyond bounds there, as psi ln|psi| makes it: of second order with a node too
  bool singular = false;

  // The farthest of them from the nearest node of a mesh.
  double farthest_off(const std::vector<double>& mesh) const;
};

// Of the motion x on a mesh (d values; periodic_equations.hpp): where a velocity passes a level; and 0,
// if the Jacobian of the rates differs on its sides. Pieces so short that more levels are passed than the
// mesh has intervals are left alone: what they do to a solution is as small as they are.
Kinks kinks_of(const std::vector<double>& mesh, const double* x, int d, const Joints& joints,
               const std::function<void(const double* y, double* J)>& jacobian);

// The mesh with a node at each kink: the nearest moved there where it is near, else one more.
std::vector<double> with_nodes(std::vector<double> mesh, const Kinks& kinks);

// Periodic solutions by collocation on meshes that suit them: solved until the answer is as good as asked
// for, or, as along a branch, again on a better mesh.
//
// `Equations` on a mesh of phases have mesh(), dim(), on(mesh, x): the same on another mesh, near x,
// fill(from, x): their unknowns for a solution x of others, q(x): the number among them, and
// jacobian(x, y, J): that of the rates at y. Source: U. M. Ascher, R. M. M. Mattheij, R. D. Russell,
// Numerical Solution of Boundary Value Problems, SIAM 1995, chapter 9. Local to the process.
template <class Equations>
struct MeshSolution {
  Equations equations;
  std::vector<double> x;
  double last_step = 0, residual = 0;  // of Newton's method

  const std::vector<double>& mesh() const { return equations.mesh(); }
  double q() const { return equations.q(x); }
  std::vector<double> rough() const { return roughness(mesh(), x.data(), equations.dim()); }
};

// The same equations solved on another mesh, from a solution; nothing where newton(solution) is false:
// Newton's method does not converge.
template <class Equations, class Newton>
std::optional<MeshSolution<Equations>> solved_on(const Newton& newton, std::vector<double> mesh,
                                                 const MeshSolution<Equations>& near) {
  MeshSolution<Equations> there{near.equations.on(std::move(mesh), near.x), {}};
  there.x = there.equations.fill(near.equations, near.x);
  if (!newton(there)) return std::nullopt;
  return there;
}

// Solves with nodes at the kinks, which move with the solution, until they stay. What the change of the
// number sought, where the mesh is halved, is to be divided by for an estimate of its error: halving divides
// the error by 2^10 once the mesh is fine, by less before, and by 4 beside a singularity; where no node could
// be placed at a kink the change says little.
template <class Equations, class Newton>
double settle_on_kinks(const Newton& newton, const Joints& joints, MeshSolution<Equations>& s) {
  // In phase. Of a number sought what is left of a kink costs the square, which at `on_node` is round-off; of
  // multipliers it costs the first power, so that nodes move on while they come nearer.
  constexpr double on_node = 1e-10, as_near_as_zeros = 1e-13;
  const auto kinks_here = [&] {
    return kinks_of(s.mesh(), s.x.data(), s.equations.dim(), joints,
                    [&](const double* y, double* J) { s.equations.jacobian(s.x, y, J); });
  };
  Kinks kinks = kinks_here();
  double off = kinks.farthest_off(s.mesh()), last = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 4 && (off > on_node || (off > as_near_as_zeros && off < .1 * last)); ++round) {
    auto moved = solved_on(newton, with_nodes(s.mesh(), kinks), s);
    if (!moved) break;
    s = std::move(*moved);
    kinks = kinks_here();
    last = off;
    off = kinks.farthest_off(s.mesh());
  }
  return off > on_node ? .1 : kinks.singular ? 2 : 8;
}

// What is asked of a solution.
template <class Equations>
struct MeshAccuracy {
  double tolerance, least;      // relative; intervals to begin with
  Joints joints;
  std::vector<double> units;    // of the components; empty: their ranges, or 1e-3 of their units
  // Relative change of the number sought from one solution to a finer one.
  std::function<double(const MeshSolution<Equations>& coarse, const MeshSolution<Equations>& fine)> change;
  std::string what;  // is solved for, in messages
};
template <class Equations>
struct AccurateSolution {
  MeshSolution<Equations> solution;  // on a halved mesh
  double estimate;                   // relative error of the number sought
};

// The largest change of a profile at the points of the finer mesh.
template <class Equations>
double change_of_profile(const MeshSolution<Equations>& coarse, const MeshSolution<Equations>& fine,
                         std::vector<double> units) {
  const int d = fine.equations.dim();
  const std::vector<double> from = fine.equations.fill(coarse.equations, coarse.x);
  const std::size_t count = points_on(fine.mesh()) * d;
  if (units.empty())
    for (const double range : ranges(fine.x.data(), points_on(fine.mesh()), d))
      units.push_back(std::max(range, 1e-3 * fine.equations.field().unit(int(units.size()))));
  double change = 0;
  for (std::size_t i = 0; i < count; ++i)
    change = std::max(change, std::abs(from[i] - fine.x[i]) / units[i % d]);
  return change;
}

// From a solution: on a mesh that suits it and on that mesh halved, refined until the two agree, the profile
// to 1e-9 or the tolerance, whichever is larger. Nothing where Newton's method does not converge; throws
// Failure where too many intervals are needed.
template <class Equations, class Newton>
std::optional<AccurateSolution<Equations>> solve_to_accuracy(const Newton& newton, MeshSolution<Equations> s,
                                                             const MeshAccuracy<Equations>& asked) {
  constexpr int most_rounds = 12;
  constexpr double most_intervals = 20000;
  double least = asked.least;
  for (int round = 1; round <= most_rounds; ++round) {
    // the profile to 1e-9 of its range or the tolerance asked for, whichever is finer, within reason
    const std::vector<double> rough = s.rough();
    const double wanted = intervals_for(s.mesh(), rough, std::max(asked.tolerance, 1e-12) * 10);
    const std::size_t intervals = std::size_t(std::min(most_intervals, std::max(least, .5 * wanted)));
    least = 1.5 * double(intervals);  // should there be a next round
    auto better = solved_on(newton, equidistribute(s.mesh(), rough, intervals), s);
    if (!better) continue;  // too coarse
    s = std::move(*better);
    const double gain = settle_on_kinks(newton, asked.joints, s);
    auto finer = solved_on(newton, halved(s.mesh()), s);
    if (!finer) continue;
    const double estimate = asked.change(s, *finer) / gain;
    if (estimate <= asked.tolerance &&
        change_of_profile(s, *finer, asked.units) / 32 <= std::max({1e-9, asked.tolerance, finer->last_step}))
      return AccurateSolution<Equations>{std::move(*finer), estimate};
    if (round == most_rounds || double(finer->mesh().size()) > 2 * most_intervals)
      throw Failure(asked.what + " needs more than " + std::to_string(finer->mesh().size()) +
                    " mesh intervals");
  }
  return std::nullopt;
}

// How the mesh follows a solution along a branch: an interpolation error of its range, at least so many
// intervals. Where a front has moved off the intervals that followed it, many more seem to be wanted than are
// once they follow it again: so the number grows by no more than a factor at once, and some meshes are tried.
struct MeshFollowing {
  double error, least;
  bool keeps = false;  // a mesh that suits
  double most_growth = std::numeric_limits<double>::infinity();
  int most_meshes = 1;
};

// Solves where s stands, then again on a mesh that suits the solution. The change of q by the last mesh; NaN
// where the first was kept. Throws Failure where Newton's method does not converge.
template <class Equations, class Newton>
double solve_on_suiting_mesh(const Newton& newton, const MeshFollowing& rule, MeshSolution<Equations>& s) {
  const char* const fails = "Newton's method does not converge";
  if (!newton(s)) throw Failure(fails);
  double change = std::numeric_limits<double>::quiet_NaN();
  for (int round = 1;; ++round) {
    const std::vector<double> rough = s.rough();
    if (rule.keeps && suits(s.mesh(), rough, rule.error)) return change;
    const double now = double(s.mesh().size() - 1), wanted = intervals_for(s.mesh(), rough, rule.error);
    const bool settled = wanted < rule.most_growth * now || round == rule.most_meshes;
    const double intervals =
        std::min(4000., std::max(rule.least, settled ? std::min(wanted, rule.most_growth * now) : now));
    auto better = solved_on(newton, equidistribute(s.mesh(), rough, std::size_t(intervals)), s);
    if (!better) throw Failure(fails);
    change = better->q() - s.q();
    s = std::move(*better);
    if (settled) return change;
  }
}

}  // namespace stickslip
