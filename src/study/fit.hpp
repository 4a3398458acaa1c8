// Parameters of a scene out of a measured course: least squares,
//     r_i(p) = y(t_i; p) - d_i,      |r|^2 -> min,
// y the course of a run of the scene with the options p, d the data. Options that are positive are sought by
// their logarithms. PETSc's TAO minimises, by POUNDERS, which models r from its values at a few places (Wild,
// in: Advances and Trends in Optimization (2017) 529): no derivative of a run is needed, whose course may
// have corners. It begins at the scene's values and then at the best of draws around them, several for each
// start, that lie apart: a course of slips has a minimum for each number of slips that fall together. Every
// second search minimises the integral of r over time first, roughly. With the derivatives by differences of
// runs that TAO's Gauss and Newton's method (-tao_type brgn) is given here it takes ten times as many runs.
//
// With weights w_i the squares are w_i r_i^2, the mean weight being 1. A drift of the measurement, y + s
// (x_i - x_0) with x the first column of the data, is linear in s: for every p the best s follows by itself,
// so that the search is that of what is left when r is made orthogonal to the drift.
//
// Errors and correlations are those of the linearised problem at the minimum: covariance s^2 (J^T J)^-1, s^2
// = |r|^2/(rows - parameters), a drift counted among them. They hold for rows whose noise is independent. Of
// correlated residuals n rows tell as much as n/T independent ones, T = 1 + 2 (the sum of the
// autocorrelations), and errors of what varies slowly over the rows are sqrt(T) times as large.
//
// Collective over PETSC_COMM_WORLD; the same on every rank.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"

namespace stickslip {

// What was measured, of the mean over the nodes.
enum class CourseOf { force, psi, displacement };

struct FitParameter {
  std::string name;  // of an option
  double value = 0;  // of the scene, then of the best fit
  double error = 0;  // standard error; NaN where the data do not tell
  double low, high;  // of the search
  bool logarithm;
  // Place in the list of the parameter that this one never exceeds, as dynamic friction does not exceed
  // static friction; -1: none. Sought is then the ratio of the two.
  int at_most = -1;
  bool at_bound = false;
};

struct FitProblem {
  Options options;  // of `run`
  CourseOf of = CourseOf::force;
  std::vector<double> times, data;  // times ascend
  std::vector<double> weights;      // of the mean 1; empty: all alike
  std::vector<double> drift;        // x - x_0 where a drift is sought; else empty
  std::vector<FitParameter> parameters;
  int starts = 1;
  PetscInt seed = 1;
};

struct Fit {
  std::vector<FitParameter> parameters;
  std::vector<double> course;                    // at the times, the drift included
  std::optional<double> drift;                   // s, and
  double drift_error = 0;                        // its standard error
  double residual_correlation = 0;               // of neighbouring rows
  double independent_rows = 0;                   // n/T
  std::vector<std::vector<double>> correlation;  // NaN where an error is
  double residual = 0;                           // root of the mean square, in the data's unit
  int same = 0;                                  // starts that ended at the best
  long runs = 0;
  std::string method;
  // parameters that the data do not tell apart; empty where they do
  std::vector<std::string> together;
};

// The problem that options ask for (fit_...). Throws UsageError: an option that is no number or is named
// twice, fewer rows than parameters, rows outside the run, a load point that goes back and forth.
FitProblem fit_problem(const Options& options);

// The course of the scene as it is.
std::vector<double> course_of(const FitProblem& problem, const Options& options);

// `told`, if given, is called with each start's end, the best so far, and where a signal ends the search with
// the best that it has met. Throws UsageError where a
// parameter has no effect, Failure where no start comes to an end.
Fit solve_fit(const FitProblem& problem, const std::function<void(const Fit& best)>& told = {});

}  // namespace stickslip
