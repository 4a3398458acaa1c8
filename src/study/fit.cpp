#include "study/fit.hpp"

#include <petsctao.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include <Eigen/Dense>

#include "base/failure.hpp"
#include "base/pulse.hpp"
#include "options/values.hpp"
#include "output/series.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/study/start.hpp"
#include "stickslip/study/trial.hpp"
#include "study/simulate.hpp"

namespace stickslip {

namespace {

using TaoHandle = Handle<Tao, TaoDestroy>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double step_tolerance = 1e-9;     // of the runs, unless the user sets it
constexpr double difference = 1e-4;         // of a parameter; relative, or of a logarithm
constexpr double widest = 6.9077552789821;  // ln 1000: how far a logarithm goes from the scene's value
constexpr double most_spread = 1.1;         // ln 3: of the draws
constexpr int draws_a_start = 8;            // of which the search begins at the best
constexpr double same_basin = 0.15;         // of two draws, in units of the variables
constexpr double gradient = 1e-10;          // a row: where the search ends
constexpr double rough_gradient = 1e-5;     // and that which leads to where it begins
constexpr double failed_run = 1e3;          // residual of a run that fails, in units of the data's scatter
constexpr double same_place = 1e-3;         // of two ends of the search, in units of the variables
constexpr double told_apart = 1e-5;         // ratio of singular values below which parameters are not

// ---- the course of a run

class Course : public Measure {
 public:
  Course(const Model& model, CourseOf of, const std::vector<double>& times)
      : model_(model), of_(of), times_(times), slip_(model) {}

  void plan(ObservationPlan& plan) override {
    plan.next_times.emplace_back([this](double t) {
      if (of_ == CourseOf::displacement) return std::nextafter(t, HUGE_VAL);
      const auto next = std::upper_bound(times_.begin(), times_.end(), t);
      return next == times_.end() ? std::numeric_limits<double>::infinity() : *next;
    });
  }
  void step(const ObservedStep& step) override {
    double from = step.t_before;
    for (; sums_.size() < times_.size() && times_[sums_.size()] <= step.t;) {
      const double t = times_[sums_.size()];
      if (of_ == CourseOf::displacement)
        sums_.push_back(travel_ += slip_.between(step, std::exchange(from, t), t));
      else
        sums_.push_back(slip_.sum_at(step, t, of_ == CourseOf::force ? 1 : 0));
    }
    if (of_ == CourseOf::displacement) travel_ += slip_.between(step, from, step.t);
  }
  std::vector<double> values() const override {
    std::vector<double> all = sums_;
    sum_over(model_.comm(), all.data(), int(all.size()));
    for (double& value : all) value /= double(model_.scene().n);
    return all;
  }

 private:
  const Model& model_;
  CourseOf of_;
  const std::vector<double>& times_;
  SlipOfStep slip_;
  std::vector<double> sums_;
  double travel_ = 0;
};

// ---- what is asked

FitParameter parameter_of(const std::string& name, const Options& options) {
  const OptionSpec* spec = find_option(name);
  if (!spec)
    throw usage_error("-fit_parameters {}: no such option{}", name,
                      did_you_mean(nearest_option(lower_case(name))));
  const bool number = spec->type == OptionType::real || spec->type == OptionType::real_or_word;
  const std::string text = options.text(spec->name);
  if (!number || !reads_option("run", *spec) || !parse_number(text))
    throw usage_error("-fit_parameters {}: it is no number that a run depends on{}", name,
                      number ? ", but " + quoted(text) : "");
  FitParameter p{spec->name, options.real(spec->name), nan, spec->low, spec->high, false};
  p.logarithm = p.value > 0 && p.low >= 0;
  if (p.logarithm) {
    p.low = std::max(p.low, p.value * std::exp(-widest));
    p.high = std::min(p.high, p.value * std::exp(widest));
  }
  return p;
}

// Dynamic friction above static friction is friction of another kind, for which data of slips may have a
// minimum of their own. A scene that begins in this order stays in it.
void put_in_order(std::vector<FitParameter>& parameters, const Scene& scene, const Options& options) {
  const auto place_of = [&](const std::string& name) {
    for (std::size_t k = 0; k < parameters.size(); ++k)
      if (parameters[k].name == name) return int(k);
    return -1;
  };
  const auto is_of_law = [&](const std::string& name) {
    const std::vector<Parameter>& known = scene.friction.law->parameters;
    return std::any_of(known.begin(), known.end(),
                       [&](const Parameter& p) { return std::string("friction_") + p.name == name; });
  };
  const std::string above = "friction_fs";
  for (const std::string below : {"friction_fd", "friction_fc"}) {
    if (!is_of_law(below) || !is_of_law(above)) continue;
    const double least = options.real(below), most = options.real(above);
    if (!(least <= most)) continue;
    const int k = place_of(below), j = place_of(above);
    if (k >= 0 && j >= 0) parameters[k].at_most = j;
    if (k >= 0 && j < 0) parameters[k].high = std::min(parameters[k].high, most);
    if (k < 0 && j >= 0) parameters[j].low = std::max(parameters[j].low, least);
  }
}

// When the load point has come so far.
double time_at(double place, const Scene& scene, double end) {
  const auto way = [&](double t) { return scene.load.varies() ? scene.load.integral(t) : scene.v * t; };
  if (place == 0) return 0;
  const double t =
      find_root([&](double at) { return way(at) - place; }, {0, -place, end, way(end) - place}, 0);
  if (std::isnan(t))
    throw usage_error("-fit_data: the load point does not come to {} before ts_max_time {}",
                      number_text(place), number_text(end));
  return t;
}

// Weights of the mean 1.
std::vector<double> weights_of(const Options& options, std::size_t rows) {
  std::vector<double> weights = options.reals("fit_weights");
  if (weights.empty()) return weights;
  if (weights.size() != rows)
    throw usage_error("-fit_weights: {} weights of {} rows of fit_data", weights.size(), rows);
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.);
  if (!(sum > 0)) throw UsageError("-fit_weights: all weights are 0");
  for (double& weight : weights) weight *= double(rows) / sum;
  return weights;
}

}  // namespace

FitProblem fit_problem(const Options& options) {
  FitProblem problem;
  problem.options = options.for_command("run");
  const Scene scene = Scene::from(problem.options, false);
  const double end = options.real("ts_max_time");
  if (!options.is_set("fit_data"))
    throw UsageError("-fit_data: give a file of two columns, what was measured");
  if (!options.is_set("fit_parameters"))
    throw UsageError("-fit_parameters: give the options that are sought, e.g. friction_a,friction_b");
  const std::string of = options.text("fit_of");
  problem.of = of == "force" ? CourseOf::force : of == "psi" ? CourseOf::psi : CourseOf::displacement;
  const bool against_time = options.text("fit_against") == "time";
  for (const auto& [place, value] : options.pairs("fit_data")) {
    const double t = against_time ? place : time_at(place, scene, end);
    if (!problem.times.empty() && !(t > problem.times.back()))
      throw usage_error("-fit_data: the first column must ascend{}: {}",
                        against_time ? "" : " as the load point goes", number_text(place));
    if (t < 0 || t > end)
      throw usage_error("-fit_data: {} lies outside the run, which is from 0 to ts_max_time {}",
                        number_text(place), number_text(end));
    problem.times.push_back(t);
    problem.data.push_back(value);
    if (options.text("fit_trend") == "linear")
      problem.drift.push_back(place - options.pairs("fit_data").front().first);
  }
  problem.weights = weights_of(options, problem.data.size());
  for (const std::string& name : options.words("fit_parameters")) {
    const FitParameter p = parameter_of(name, problem.options);
    for (const FitParameter& other : problem.parameters)
      if (other.name == p.name) throw usage_error("-fit_parameters: {} stands there twice", name);
    problem.parameters.push_back(p);
  }
  put_in_order(problem.parameters, scene, problem.options);
  const std::size_t rows = problem.weights.empty()
                               ? problem.data.size()
                               : problem.weights.size() -
                                     std::count(problem.weights.begin(), problem.weights.end(), 0.),
                    sought = problem.parameters.size() + (problem.drift.empty() ? 0 : 1);
  if (rows < sought)
    throw usage_error("-fit_data: {} rows cannot tell {} parameters{}", rows, sought,
                      problem.drift.empty() ? "" : " (fit_trend is one)");
  problem.starts = int(options.integer("fit_starts"));
  problem.seed = options.integer("fit_seed");
  return problem;
}

std::vector<double> course_of(const FitProblem& problem, const Options& options) {
  const Scene whole = Scene::from(options, false);
  const Problem solved = problem_of(whole, options, std::nullopt);
  MethodSpec spec = MethodSpec::from(options);
  if (!options.is_set("ts_rtol") && !options.is_set("ts_atol") && spec.tolerance == 0 &&
      !options.is_set("ts_dt"))
    spec.tolerance = step_tolerance;
  Integrator integrator(solved.model, spec, solved.u);
  Course course(solved.model, problem.of, problem.times);
  ObservationPlan plan;
  course.plan(plan);
  integrator.set_output_times([plan](double t) { return plan.next_time(t); });
  simulate(integrator, solved.u, {0, problem.times.back(), most_steps(options)}, {&course});
  std::vector<double> values = course.values();
  if (values.size() < problem.times.size())
    throw Failure("the run ended before the last row of fit_data: ts_max_steps");
  return values;
}

namespace {

// ---- the search

class FitSearch {
 public:
  explicit FitSearch(const FitProblem& problem)
      : problem_(problem), rows_(problem.data.size()), n_(problem.parameters.size()) {
    double mean = 0, scatter = 0;
    for (const double d : problem.data) mean += d / double(rows_);
    for (const double d : problem.data) scatter += (d - mean) * (d - mean) / double(rows_);
    unit_ = scatter > 0 ? std::sqrt(scatter) : std::max(std::abs(mean), 1e-300);
    roots_ = Vector::Ones(rows_);
    for (std::size_t i = 0; i < problem.weights.size(); ++i) roots_[i] = std::sqrt(problem.weights[i]);
    if (!problem.drift.empty())
      drift_ = Eigen::Map<const Vector>(problem.drift.data(), Eigen::Index(rows_)).cwiseProduct(roots_);
    make_vectors();
    make_solver();
  }

  using Vector = Eigen::VectorXd;

  Vector scene_values() const {
    Vector x(n_);
    for (std::size_t k = 0; k < n_; ++k) x[k] = variable(k, problem_.parameters[k].value);
    return x;
  }
  // Variables are beside the scene's value, whose unit the search does not feel; 1 where that is 0.
  double value(std::size_t k, double x) const {
    return measure(k) * (problem_.parameters[k].logarithm ? std::exp(x) : x);
  }
  double variable(std::size_t k, double value) const {
    const double beside = value / measure(k);
    return problem_.parameters[k].logarithm ? std::log(beside) : beside;
  }
  double measure(std::size_t k) const {
    const double value = std::abs(problem_.parameters[k].value);
    return value > 0 ? value : 1;
  }
  double low(std::size_t k) const { return variable(k, problem_.parameters[k].low); }
  double high(std::size_t k) const { return variable(k, problem_.parameters[k].high); }

  // A place as the search sees it, within its bounds: of parameters in order the ratio in place of the lower.
  Vector ordered(const Vector& x) const {
    Vector z = x;
    for (std::size_t k = 0; k < n_; ++k)
      if (const int j = problem_.parameters[k].at_most; j >= 0) {
        const double ratio = value(k, x[k]) / value(j, x[j]);
        z[k] = problem_.parameters[k].logarithm ? std::log(ratio) : ratio;
      }
    return z.cwiseMax(least_).cwiseMin(most_);
  }
  Vector plain(const Vector& z) const {
    Vector x = z;
    for (std::size_t k = 0; k < n_; ++k)
      if (const int j = problem_.parameters[k].at_most; j >= 0)
        x[k] = variable(k, value(j, z[j]) * (problem_.parameters[k].logarithm ? std::exp(z[k]) : z[k]));
    return x;
  }
  bool at_bound(const Vector& x, std::size_t k) const {
    const Vector z = ordered(x);
    return std::min(z[k] - least_[k], most_[k] - z[k]) < same_place;
  }
  double unit() const { return unit_; }
  long runs() const { return runs_; }
  std::string method() const {
    TaoType type;
    SS_TRY(TaoGetType(tao_, &type));
    return type;
  }

  std::vector<double> course_at(const Vector& x) {
    ++runs_;
    beat("runs");
    std::vector<std::string> unheard;
    const WarningsKept kept(unheard);
    Options options = problem_.options;
    for (std::size_t k = 0; k < n_; ++k) options = options.with(problem_.parameters[k].name, value(k, x[k]));
    return course_of(problem_, options);
  }
  // Roots of the weights.
  const Vector& roots() const { return roots_; }
  // What a drift of one a place does to the weighted residual; empty without one.
  const Vector& drift() const { return drift_; }

  // In units of the data's scatter, each times the root of its weight; orthogonal to a drift.
  Vector residual(const Vector& x) {
    const std::vector<double> course = course_at(x);
    Vector r(rows_);
    for (std::size_t i = 0; i < rows_; ++i) r[i] = roots_[i] * (course[i] - problem_.data[i]) / unit_;
    if (drift_.size() > 0) r -= drift_ * (drift_.dot(r) / drift_.squaredNorm());
    return r;
  }
  // Of a run that may fail: a value that no search stays at.
  std::optional<Vector> try_residual(const Vector& x) {
    try {
      Vector r = residual(x);
      if (!r.allFinite()) return std::nullopt;
      const double squares = r.squaredNorm();
      if (!best_ || squares < best_->squares) best_ = {x, squares};
      return r;
    } catch (const Error& e) {
      if (!e.collective() && ranks_in(PETSC_COMM_WORLD) > 1) throw;
    }
    return std::nullopt;
  }
  // Differences of runs: central ones, which cost twice as many; where a side cannot be had, and for the
  // search itself, to one side.
  Eigen::MatrixXd jacobian(const Vector& x, bool central) {
    Eigen::MatrixXd J(rows_, n_);
    for (std::size_t k = 0; k < n_; ++k) J.col(k) = slope(x, k, difference, central);
    return J;
  }
  // By central differences, of the residual with what a drift would take away.
  Eigen::MatrixXd jacobian_beside_drift(const Vector& x) {
    const Vector drift = std::exchange(drift_, Vector());
    last_.reset();
    Eigen::MatrixXd J = jacobian(x, true);
    drift_ = drift;
    last_.reset();
    return J;
  }
  Vector slope(const Vector& x, std::size_t k, double step, bool central) {
    if (!last_ || last_->first != x) last_ = {x, residual(x)};
    const Vector here = last_->second;
    const double h = step * (problem_.parameters[k].logarithm ? 1 : std::max(std::abs(x[k]), 1e-2));
    const auto at = [&](double place) {
      Vector beside = x;
      beside[k] = std::clamp(place, low(k), high(k));
      return std::pair(beside[k], beside[k] == x[k] ? here : try_residual(beside).value_or(here));
    };
    const auto [up, above] = at(x[k] + h);
    const auto [down, below] = central || up == x[k] ? at(x[k] - h) : std::pair(x[k], here);
    return (above - below) / (up - down);
  }

  struct Place {
    Vector x;
    double squares;
  };
  // Of all that minimise() has met; empty before.
  const std::optional<Place>& best() const { return best_; }

  // The residual's integral over time. Slips that do not fall together leave the residual as it is whatever
  // their distance, its integral grows with that: it leads to the right slips from farther off.
  Vector integral(const Vector& r) const {
    if (rows_ == 1) return r;
    const double mean = (problem_.times.back() - problem_.times.front()) / double(rows_ - 1);
    Vector sum(rows_);
    double total = 0;
    for (std::size_t i = 0; i < rows_; ++i) {
      const double part = i > 0 ? problem_.times[i] - problem_.times[i - 1] : mean;
      sum[i] = total += r[i] * part / mean / std::sqrt(double(rows_));
    }
    return sum;
  }

  // From x to a minimum, of the residual or roughly of its integral.
  Vector minimise(const Vector& x, bool integrated = false) {
    integrated_ = integrated;
    {
      const Writing to(x_);
      const Vector z = within_reach(ordered(x));
      std::copy_n(z.data(), n_, static_cast<double*>(to));
    }
    make_solver();  // anew: POUNDERS keeps vectors of every solution that it does not free
    SS_TRY(TaoSolve(tao_));
    return plain(vector_of(x_));
  }

 private:
  void make_vectors();
  void make_solver();
  // So far below the upper bounds that POUNDERS' first steps, which go up, stay within them.
  Vector within_reach(const Vector& z) const {
    PetscReal delta = 0.1;  // its own
    SS_TRY(PetscOptionsGetReal(nullptr, nullptr, "-tao_pounders_delta", &delta, nullptr));
    return z.cwiseMin((most_.array() - 1.01 * delta).matrix()).cwiseMax(least_);
  }
  Vector vector_of(Vec v) const {
    const Reading a(v);
    return Eigen::Map<const Vector>(a, Eigen::Index(n_));
  }
  static PetscErrorCode Residual(Tao, Vec x, Vec r, void* context) {
    return guarded([&] {
      auto& self = *static_cast<FitSearch*>(context);
      const Vector at = self.plain(self.vector_of(x));
      const auto found = self.try_residual(at);
      if (found) self.last_ = {at, *found};
      const Writing to(r);
      const Vector shown = found && self.integrated_ ? self.integral(*found) : found.value_or(Vector());
      for (std::size_t i = 0; i < self.rows_; ++i) to[i] = found ? shown[i] : failed_run;
    });
  }
  static PetscErrorCode Jacobian(Tao, Vec x, Mat J, Mat, void* context) {
    return guarded([&] {
      auto& self = *static_cast<FitSearch*>(context);
      const Vector z = self.vector_of(x), at = self.plain(z);
      Eigen::MatrixXd found = self.jacobian(at, false);
      for (std::size_t k = 0; k < self.n_; ++k) {
        const FitParameter& p = self.problem_.parameters[k];
        if (p.at_most < 0) continue;
        found.col(p.at_most) += (p.logarithm ? 1 : at[k]) * found.col(k);
        if (!p.logarithm) found.col(k) *= self.value(p.at_most, z[p.at_most]) / self.measure(k);
      }
      for (std::size_t k = 0; k < self.n_ && self.integrated_; ++k)
        found.col(k) = self.integral(found.col(k));
      double* entries;
      SS_TRY(MatDenseGetArray(J, &entries));
      std::copy_n(found.data(), found.size(), entries);  // both column by column
      SS_TRY(MatDenseRestoreArray(J, &entries));
      SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
      SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
    });
  }

  const FitProblem& problem_;
  std::size_t rows_, n_;
  double unit_ = 1;
  Vector roots_, drift_;
  long runs_ = 0;
  std::optional<std::pair<Vector, Vector>> last_;  // x, and the residual there
  std::optional<Place> best_;
  Vector least_, most_;  // bounds of the variables as the search sees them
  bool integrated_ = false;
  TaoHandle tao_;
  VecHandle x_, r_, low_, high_;
  MatHandle J_;
};

// Every rank solves the same small problem, whose runs they share.
void FitSearch::make_vectors() {
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, PetscInt(n_), x_.out()));
  SS_TRY(VecDuplicate(x_, low_.out()));
  SS_TRY(VecDuplicate(x_, high_.out()));
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, PetscInt(rows_), r_.out()));
  SS_TRY(MatCreateSeqDense(PETSC_COMM_SELF, PetscInt(rows_), PetscInt(n_), nullptr, J_.out()));
  least_.resize(Eigen::Index(n_));
  most_.resize(Eigen::Index(n_));
  const Writing lowest(low_), highest(high_);
  for (std::size_t k = 0; k < n_; ++k) {
    const FitParameter& p = problem_.parameters[k];
    const bool ratio = p.at_most >= 0;
    least_[k] = !ratio        ? std::max(low(k), double(PETSC_NINFINITY))
                : p.logarithm ? std::log(p.value / problem_.parameters[p.at_most].value) - widest
                              : 0;
    most_[k] = !ratio ? std::min(high(k), double(PETSC_INFINITY)) : p.logarithm ? 0 : 1;
    lowest[k] = least_[k];
    highest[k] = most_[k];
  }
}

void FitSearch::make_solver() {
  tao_ = {};
  SS_TRY(TaoCreate(PETSC_COMM_SELF, tao_.out()));
  SS_TRY(TaoSetType(tao_, TAOPOUNDERS));
  SS_TRY(TaoSetSolution(tao_, x_));
  SS_TRY(TaoSetResidualRoutine(tao_, r_, Residual, this));
  SS_TRY(TaoSetJacobianResidualRoutine(tao_, J_, J_, Jacobian, this));
  SS_TRY(TaoSetVariableBounds(tao_, low_, high_));
  SS_TRY(TaoSetMaximumIterations(tao_, 500));
  SS_TRY(TaoSetMaximumFunctionEvaluations(tao_, 2000));
  SS_TRY(TaoSetTolerances(tao_, (integrated_ ? rough_gradient : gradient) * double(rows_), 0, 0));
  SS_TRY(TaoSetFromOptions(tao_));
}

// How far neighbouring residuals are alike, and how many independent rows tell as much: the sum of the
// autocorrelations, up to five of the times that it gives (Sokal's window), over which longer ones are noise.
void judge_independence(const Eigen::VectorXd& r, Fit& fit) {
  const Eigen::Index rows = r.size();
  const double squares = r.squaredNorm();
  const auto correlation = [&](Eigen::Index lag) {
    return r.head(rows - lag).dot(r.tail(rows - lag)) / squares;
  };
  fit.independent_rows = double(rows);
  if (!(squares > 0) || rows < 3) return;
  fit.residual_correlation = correlation(1);
  double times = 1;
  for (Eigen::Index lag = 1; lag < rows / 4 && double(lag) < 5 * times; ++lag) times += 2 * correlation(lag);
  fit.independent_rows = double(rows) / std::max(times, 1.);
}

// Covariance in the variables, out of the singular values of J with columns of length 1; what the data leave
// open has no error.
void judge(FitSearch& search, const Eigen::VectorXd& x, const FitProblem& problem, Fit& fit) {
  const std::size_t n = problem.parameters.size(), rows = problem.data.size();
  const Eigen::VectorXd r = search.residual(x), drift = search.drift();
  judge_independence(r, fit);
  fit.residual = search.unit() * std::sqrt(r.squaredNorm() / double(rows));
  fit.correlation.assign(n, std::vector<double>(n, nan));
  fit.course = search.course_at(x);
  Eigen::MatrixXd J = search.jacobian_beside_drift(x);
  std::vector<std::string> names;
  for (const FitParameter& p : problem.parameters) names.push_back(p.name);
  if (drift.size() > 0) {
    double along = 0;
    for (std::size_t i = 0; i < rows; ++i)
      along += drift[i] * search.roots()[i] * (problem.data[i] - fit.course[i]);
    fit.drift = along / drift.squaredNorm();
    for (std::size_t i = 0; i < rows; ++i) fit.course[i] += *fit.drift * problem.drift[i];
    J.conservativeResize(Eigen::NoChange, Eigen::Index(n) + 1);
    J.col(n) = drift;
    names.emplace_back("fit_trend");
  }
  fit.drift_error = nan;
  const std::size_t sought = names.size();
  const Eigen::VectorXd lengths = J.colwise().norm();
  for (std::size_t k = 0; k < sought; ++k)
    if (!(lengths[k] > 0)) fit.together.push_back(names[k]);
  if (!fit.together.empty()) return;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(J * lengths.cwiseInverse().asDiagonal(), Eigen::ComputeThinV);
  const Eigen::VectorXd& s = svd.singularValues();
  if (!(s[sought - 1] > told_apart * s[0])) {
    // the change of the variables that the course does not feel, by what each does to it alone, and by itself
    const Eigen::VectorXd effect = svd.matrixV().col(sought - 1).cwiseAbs();
    Eigen::VectorXd change = effect.cwiseQuotient(lengths);
    for (std::size_t k = 0; k < n; ++k)
      if (!problem.parameters[k].logarithm) change[k] /= std::max(std::abs(x[k]), 1e-2);
    for (std::size_t k = 0; k < sought; ++k)
      if (change[k] > 0.1 * change.maxCoeff() || effect[k] > 0.1) fit.together.push_back(names[k]);
    return;
  }
  const std::size_t counted = std::size_t((search.roots().array() > 0).count());
  if (counted == sought) return;
  const Eigen::MatrixXd inverse =
      svd.matrixV() * s.cwiseAbs2().cwiseInverse().asDiagonal() * svd.matrixV().transpose();
  const double variance = r.squaredNorm() / double(counted - sought);
  const auto error = [&](std::size_t k) { return std::sqrt(variance * inverse(k, k)) / lengths[k]; };
  if (fit.drift) fit.drift_error = error(n) * search.unit();
  for (std::size_t k = 0; k < n; ++k) {
    FitParameter& p = fit.parameters[k];
    p.error = error(k) * (p.logarithm ? p.value : search.measure(k));
    for (std::size_t j = 0; j < n; ++j)
      fit.correlation[k][j] = inverse(k, j) / std::sqrt(inverse(k, k) * inverse(j, j));
  }
}

// Around the scene's values, near them and farther off in turn.
Eigen::VectorXd drawn(const FitSearch& search, const FitProblem& problem, int number) {
  Eigen::VectorXd z = search.ordered(search.scene_values());
  const double spread = most_spread / double(1 << (2 - (number + 2) % 3));
  for (std::size_t k = 0; k < problem.parameters.size(); ++k) {
    const double u = counter_uniform(problem.seed, PetscInt(number * problem.parameters.size() + k));
    const double width = problem.parameters[k].logarithm ? spread : spread * std::max(std::abs(z[k]), 0.1);
    z[k] += (2 * u - 1) * width;
  }
  return search.plain(search.ordered(search.plain(z)));  // within bounds
}

bool beside(const Eigen::VectorXd& a, const Eigen::VectorXd& b, double distance) {
  const Eigen::ArrayXd scale = b.array().abs().max(1);
  return ((a - b).array().abs() < distance * scale).all();
}

// Where the searches begin: at the scene's values, then at the draws that come nearest and lie apart.
std::vector<Eigen::VectorXd> places_to_begin(FitSearch& search, const FitProblem& problem) {
  std::vector<FitSearch::Place> draws;
  for (int number = 1; number <= draws_a_start * (problem.starts - 1); ++number) {
    const Eigen::VectorXd x = drawn(search, problem, number);
    const auto r = search.try_residual(x);
    draws.push_back({x, r ? search.integral(*r).squaredNorm() : HUGE_VAL});
  }
  std::stable_sort(draws.begin(), draws.end(),
                   [](const auto& a, const auto& b) { return a.squares < b.squares; });
  std::vector<Eigen::VectorXd> places{search.scene_values()};
  for (const double apart : {same_basin, 1e-12})  // the second where too few lie apart
    for (const FitSearch::Place& draw : draws) {
      const bool taken = std::any_of(places.begin(), places.end(), [&](const Eigen::VectorXd& place) {
        return beside(draw.x, place, apart);
      });
      if (int(places.size()) < problem.starts && !taken) places.push_back(draw.x);
    }
  places.resize(problem.starts, search.scene_values());
  return places;
}

// Whether the course depends on a parameter there. One that only takes the run along other steps changes the
// course by their errors, however far it is moved: its slopes fall with the distance.
bool has_effect(FitSearch& search, const FitProblem& problem, const Eigen::VectorXd& x, std::size_t k) {
  constexpr double hardly = 1e-2;  // of the data's scatter, by a change as large as the parameter
  const double near = search.slope(x, k, difference, false).norm();
  if (near == 0) return false;
  return near >= hardly * std::sqrt(double(problem.data.size())) ||
         search.slope(x, k, 1, false).norm() > near / 2;
}

// Throws UsageError where a run does not depend on a parameter, neither at the scene's values nor beside
// them, where the others do not hide it: at the first of a few draws whose run comes to its end.
void check_effect(FitSearch& search, const FitProblem& problem) {
  constexpr int most_draws = 5;
  for (std::size_t k = 0; k < problem.parameters.size(); ++k) {
    bool found = has_effect(search, problem, search.scene_values(), k), asked = false;
    for (int number = 1; number <= most_draws && !found && !asked; ++number) {
      const Eigen::VectorXd x = drawn(search, problem, number);
      asked = search.try_residual(x).has_value();
      found = asked && has_effect(search, problem, x, k);
    }
    if (!found)
      throw usage_error("-fit_parameters {}: it has no effect on these data", problem.parameters[k].name);
  }
}

}  // namespace

Fit solve_fit(const FitProblem& problem, const std::function<void(const Fit& best)>& told) {
  FitSearch search(problem);
  course_of(problem, problem.options);  // its errors and warnings are the user's to see
  check_effect(search, problem);
  using Place = FitSearch::Place;
  std::vector<Place> ends;
  Fit fit;
  fit.method = search.method();
  const auto tell = [&](const Place& best) {
    fit.parameters = problem.parameters;
    for (std::size_t k = 0; k < fit.parameters.size(); ++k) {
      FitParameter& p = fit.parameters[k];
      p.value = search.value(k, best.x[k]);
      p.at_bound = search.at_bound(best.x, k);
    }
    for (FitParameter& p : fit.parameters)
      if (p.at_most >= 0) p.high = fit.parameters[p.at_most].value;
    fit.residual = search.unit() * std::sqrt(best.squares / double(problem.data.size()));
    fit.same = int(std::count_if(ends.begin(), ends.end(),
                                 [&](const Place& end) { return beside(end.x, best.x, same_place); }));
    fit.runs = search.runs();
    if (told) told(fit);
  };
  const auto tell_best = [&] {
    if (search.best()) tell(*search.best());
  };
  Pulse::stage("draws");
  std::vector<Eigen::VectorXd> places;
  keeping_what_is_found([&] { places = places_to_begin(search, problem); }, tell_best);
  for (int start = 0; start < problem.starts; ++start) {
    Pulse::stage(fmt::format("start {} of {}", start + 1, problem.starts));
    Eigen::VectorXd x;
    const bool is_led = start % 2 == 1;
    keeping_what_is_found(
        [&] { x = search.minimise(is_led ? search.minimise(places[start], true) : places[start]); },
        tell_best);
    const auto r = search.try_residual(x);
    if (!r) continue;
    ends.push_back({x, r->squaredNorm()});
    std::sort(ends.begin(), ends.end(), [](const Place& a, const Place& b) { return a.squares < b.squares; });
    tell(ends[0]);
  }
  if (ends.empty()) throw Failure("no start of the search came to an end: every run failed there");
  Pulse::stage("errors");
  judge(search, ends[0].x, problem, fit);
  fit.runs = search.runs();
  return fit;
}

}  // namespace stickslip
