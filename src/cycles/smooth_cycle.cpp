#include "stickslip/cycles/cycle.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "cycles/cell_field.hpp"
#include "cycles/cycle_waves.hpp"
#include "numerics/mesh_solve.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

using std::size_t;

// The phase of a cycle through y, or under a load what the number q stands for.
Condition number_condition(const CellField& field, const std::vector<double>& y) {
  return field.periods() > 0 ? number_of(y.size()) : plane_across(field, y);
}

// With its residual, multipliers and errors; `estimate` is the relative one of the period, or under a load,
// whose period is known, of psi.
SmoothCycle finished(const std::shared_ptr<const CellField>& field, PeriodicEquations& equations,
                     const std::vector<double>& x, const std::vector<Condition>& conditions,
                     double estimate) {
  SmoothCycle result;
  result.field = field;
  result.mesh = equations.mesh();
  result.values.assign(x.begin(), x.begin() + long((result.mesh.size() - 1) * equations.block()));
  result.cycle = cycle_of(*field, result.mesh, result.values, field->period(equations.q(x)).T);
  const PeriodicEquations::Step step = equations.step(x, conditions);
  result.cycle.residual = step.residual;
  // round-off: what one more step of Newton's method would move the period by, and a few units of the last
  // place
  const double noise = std::abs(step.dx[x.size() - size_t(equations.parameters())]);
  result.cycle.error_estimate = estimate + 4 * noise + 4e-15;
  set_multipliers(result);
  return result;
}

}  // namespace

void check_smooth_cell(const Scene& cell) {
  const CellField field(cell, cell.forced() ? 1 : 0);
  if (field.dim() > most_cell_unknowns)
    throw UsageError("a cycle of " + std::to_string(field.dim()) + " unknowns: at most " +
                     std::to_string(most_cell_unknowns) +
                     " are solved for; take fewer nodes (grid_n) or a smaller "
                     "cycle_cell");
}

SmoothCycle solve_cycle(const Scene& cell, const CycleGuess& guess, double tolerance) {
  const auto field = std::make_shared<const CellField>(cell, guess.periods);
  const size_t d = size_t(field->dim());
  const auto profile = [&](double phase, double* y) {
    std::vector<double> natural(field->nodes() * size_t(field->dof()));
    guess.at(phase, natural.data());
    const std::vector<double> here = in_band_order(*field, natural.data());
    std::copy(here.begin(), here.end(), y);
  };
  std::vector<double> start(d);
  profile(0, start.data());
  const std::vector<Condition> phase{number_condition(*field, start)};
  using Solution = MeshSolution<PeriodicEquations>;
  const auto solve = [&](Solution& s) {
    const PeriodicEquations::Newton newton = s.equations.newton(s.x, phase);
    s.last_step = newton.last_step;
    return newton.converged;
  };
  Solution s{PeriodicEquations(guess.mesh, field), {}};
  s.x = s.equations.fill(profile, guess.periods > 0 ? start[0] : std::log(guess.period));
  const double unit = field->unit(0);  // of psi
  const auto change = [&](const Solution& coarse, const Solution& fine) {
    return field->periods() > 0 ? std::abs(coarse.q() - fine.q()) / unit
                                : std::abs(std::expm1(coarse.q() - fine.q()));
  };
  if (solve(s))
    if (auto found = solve_to_accuracy<PeriodicEquations>(
            solve, std::move(s), {tolerance, d > 3 ? 8. : 12., field->joints(), {}, change, "the cycle"}))
      return finished(field, found->solution.equations, found->solution.x, phase, found->estimate);
  throw Failure("Newton's method does not converge to a cycle of period near " + rounded_text(guess.period));
}

namespace {

// The uniform cycle that a slip of this size settles on. Throws Failure where it settles on none.
SmoothCycle cycle_of_slip(const Scene& node, const Oscillator& oscillator, double tolerance, double slip) {
  const Orbit orbit = find_orbit(oscillator, 1, 1e-5, slip);
  const int dof = oscillator.dim();
  const CycleGuess guess{orbit.period,
                         [&](double phase, double* y) {
                           double at[train_max_dim];
                           orbit.at(phase, at);
                           y[0] = at[0];
                           y[1] = oscillator.eta(1, at);
                           if (dof == 3) y[2] = at[2];
                         },
                         orbit.mesh};
  return solve_cycle(node, guess, tolerance);
}

// Where sliding is stable a cycle may live beside it, out of reach of the slip that was tried: stronger ones,
// in friction forces above sliding.
constexpr double stronger_slips[] = {2, 4, 10, 30};

std::optional<SmoothCycle> cycle_of_stronger_slips(const Scene& node, const Oscillator& oscillator,
                                                   double tolerance) {
  for (const double slip : stronger_slips) {
    try {
      SmoothCycle found = cycle_of_slip(node, oscillator, tolerance, slip);
      if (growth_rate(found.cycle) < 0) return found;
    } catch (const Failure&) {
      continue;  // the next one
    }
  }
  return std::nullopt;
}

}  // namespace

SmoothCycle uniform_cycle(const Scene& scene, double tolerance, double slip) {
  Scene node = scene;
  node.n = 1;
  node.left = node.right = End::periodic;
  node.length = scene.form == Form::chain ? 1 : scene.h();
  const Oscillator oscillator(node);
  const bool strong = slip > 1;  // strong slips were tried already
  // the cubic's cycle, and beyond its Hopf point none (Lienard)
  const bool only_one = !std::isnan(oscillator.v_c());
  std::optional<SmoothCycle> found;
  std::string why;
  try {
    found = cycle_of_slip(node, oscillator, tolerance, slip);
    if (strong || only_one || growth_rate(found->cycle) < 0) return *found;
  } catch (const Failure& e) {
    if (strong || only_one) throw Failure(std::string("no cycle: ") + e.what());
    why = e.what();
  }
  if (std::optional<SmoothCycle> stronger = cycle_of_stronger_slips(node, oscillator, tolerance))
    return *stronger;
  if (found) return *found;
  // what becomes of a slip in the end is said by the steps of a run
  std::vector<double> start = CellField(node).sliding();
  start[1] += slip * (start[1] - node.B() * node.v);  // a force of friction above sliding
  try {
    return settled_cycle(node, start, turns_to_settle, tolerance);
  } catch (const Failure& e) {
    throw Failure(e.what() + ("; " + why));
  }
}

namespace {

CycleGuess guess_of(const SmoothCycle& slide, const Scene& cell) {
  CycleGuess guess;
  guess.periods = 1;
  guess.period = cell.forcing_period();
  guess.mesh = slide.mesh;
  guess.at = [&slide, d = size_t(slide.field->dim())](double phase, double* y) {
    std::vector<double> there(d);
    evaluate(Collocation::gauss5(), slide.mesh, slide.values.data(), int(d), phase, there.data());
    unfold(*slide.field, there.data(), y);
  };
  return guess;
}

}  // namespace

SmoothCycle forced_slide_near(const SmoothCycle& other, const Scene& cell, double tolerance) {
  return solve_cycle(cell, guess_of(other, cell), tolerance);
}

SmoothCycle forced_slide(const Scene& cell, double tolerance) {
  constexpr int intervals = 12;
  constexpr double least_step = 1. / 64, rough = 1e-4;  // what is only on the way need not be known well
  CycleGuess guess;
  guess.periods = 1;
  guess.period = cell.forcing_period();
  for (int i = 0; i <= intervals; ++i) guess.mesh.push_back(double(i) / intervals);
  const CellField at_rest_of_load(cell, 1);
  const std::vector<double> sliding = at_rest_of_load.sliding();
  guess.at = [&](double, double* y) { unfold(at_rest_of_load, sliding.data(), y); };
  SmoothCycle found;
  Scene scene = cell;
  for (double grown = 0, step = 1; grown < 1;) {
    scene.load = cell.load.scaled(grown + step);
    scene.normal = cell.normal.scaled(grown + step);
    try {
      found = solve_cycle(scene, guess, grown + step < 1 ? rough : tolerance);
    } catch (const Failure&) {
      if ((step /= 2) < least_step) throw;
      continue;
    }
    grown += step;
    guess = guess_of(found, cell);
  }
  return found;
}

// The branch of a cycle of smooth friction: collocation with the parameter as one more unknown.

namespace {

using std::size_t;

// Of Newton's method: rate-and-state friction, nearly a logarithm of psi, takes a dozen where psi is tiny.
constexpr int most_steps = 25;
constexpr MeshFollowing few_unknowns{1e-9, 24, true, 1.5, 4}, many_unknowns{1e-7, 12, true, 1.5, 4};

FieldFamily family_of(const std::function<Scene(double)>& scene_at, int periods) {
  return [=](double lambda) { return std::make_shared<const CellField>(scene_at(lambda), periods); };
}

class SmoothFamily : public CycleFamily {
 public:
  SmoothFamily(std::function<Scene(double)> at, double from, double range, const SmoothCycle& first);

  void solve(double length, const Place& row, double right) override;
  Place place() const override { return place_of(there_.y0(), there_.x); }
  Place tangent(const Place& row) override;
  Place direction() const override { return of_length_one(place_of(there_.t, there_.t)); }
  Cycle cycle() const override { return smooth().cycle; }
  void accept() override;
  std::unique_ptr<CycleFamily> beside(std::function<Scene(double)> at, double from, double range,
                                    const Others& others) const override;
  SmoothCycle smooth() const;

 protected:
  std::string ends() const override { return comes_to_rest_ ? "graze" : ""; }
  std::vector<double> halves() const override;

 private:
  struct Stand {
    std::vector<double> mesh, x;  // the last entries of x: q and lambda
    std::vector<double> t;        // tangent in all unknowns, of length 1 in the places
    double period_error = 0;      // relative: how far two meshes differ
    double q() const { return x[x.size() - 2]; }
    std::vector<double> y0() const { return {x.begin(), x.begin() + long(d)}; }
    size_t d = 0;
  };
  void mix(const Others& others);
  Stand begun_at_mean(Stand stand) const;
  PeriodicEquations equations(const std::vector<double>& mesh, double lambda) const {
    return {mesh, family_, lambda, range_};
  }
  // Through the middle of the cycle, which small cycles still cross; or the unknown `section_` stays what it
  // is, so that the phase does not creep along the motion from one cycle to the next.
  // Under a load: what q stands for.
  Condition plane(const VectorField& of, const Stand& at) const {
    if (periods_ > 0) return number_of(d_);
    return section_ < 0 ? plane_through(of, at.y0(), mean_of(at.mesh, at.x.data(), at.d))
                        : plane_of(size_t(section_), at.y0());
  }
  void stand_at(std::vector<double> x, const std::vector<double>& mesh, double period_error,
                const Condition& phase);
  // Under a load, friction that sticks where nothing stops.
  bool slides() const { return periods_ > 0 && last_field_ && last_field_->scene().friction.sticks(); }
  Cycle course(const CellField& cell) const {
    return cycle_of(cell, there_.mesh, {there_.x.begin(), there_.x.end() - 2}, cell.period(there_.q()).T);
  }
  Place place_of(const std::vector<double>& y0, const std::vector<double>& x) const;
  Condition condition(const Place& row, double right) const;
  const CellField& field(double lambda) const {
    last_field_ = std::make_shared<const CellField>(scene_at_(lambda), periods_);
    return *last_field_;
  }

  std::function<Scene(double)> scene_at_;
  FieldFamily family_;
  // The range of each unknown in the first cycle; under a load, which grows from nothing, not below its unit.
  std::vector<double> scale_;
  size_t d_;
  int periods_;  // of the load, in a cycle
  Stand here_, there_;
  int section_ = -1;
  bool comes_to_rest_ = false;  // where solve() has been last
  double turn_ = 1, candidate_turn_ = 1;                 // -1 once the amplitude has passed through zero
  mutable std::shared_ptr<const CellField> last_field_;  // of the candidate
};

SmoothFamily::SmoothFamily(std::function<Scene(double)> at, double from, double range,
                           const SmoothCycle& first)
    : CycleFamily(range), scene_at_(std::move(at)), d_(size_t(first.field->dim())),
      periods_(first.field->periods()) {
  family_ = family_of(scene_at_, periods_);
  for (const double of : ranges(first.values.data(), points_on(first.mesh), first.field->dim()))
    scale_.push_back(std::max(of, (periods_ > 0 ? 1 : 1e-12) * first.field->unit(int(scale_.size()))));
  there_.d = d_;
  there_.mesh = first.mesh;
  there_.x = first.values;
  there_.x.push_back(periods_ > 0 ? first.values[0] : std::log(first.cycle.period));
  there_.x.push_back(from);
  there_.t.assign(there_.x.size(), 0.);
  there_.period_error = first.cycle.error_estimate;
  here_ = there_;
  last_field_ = first.field;
}

Place SmoothFamily::place_of(const std::vector<double>& y0, const std::vector<double>& x) const {
  Place p;
  for (size_t a = 0; a < d_; ++a) p.push_back(y0[a] / scale_[a]);
  p.push_back(periods_ > 0 ? 0 : x[x.size() - 2]);  // one of y0, under a load
  p.push_back(x.back() / range_);
  return p;
}

Condition SmoothFamily::condition(const Place& row, double right) const {
  Condition c;
  for (size_t a = 0; a < d_; ++a) c.y0.push_back(row[a] / scale_[a]);
  c.q = row[d_];
  c.lambda = row[d_ + 1] / range_;
  c.right = right;
  return c;
}

void SmoothFamily::solve(double length, const Place& row, double right) {
  comes_to_rest_ = false;
  using Solution = MeshSolution<PeriodicEquations>;
  Solution s{equations(here_.mesh, here_.x.back()), here_.x};
  const std::vector<Condition> conditions{plane(s.equations.field(), here_), condition(row, right)};
  for (size_t k = 0; k < s.x.size(); ++k) s.x[k] += length * here_.t[k];
  const auto solve = [&](Solution& at) {
    return at.equations.newton(at.x, conditions, most_steps).converged;
  };
  const double change = solve_on_suiting_mesh(solve, d_ <= 12 ? few_unknowns : many_unknowns, s);
  (void)settle_on_kinks(solve, last_field_->joints(), s);
  const double unit = s.equations.field().unit(0);
  const double moved = periods_ > 0 ? change / unit : std::expm1(change);
  const double period_error = std::isnan(change) ? here_.period_error : std::abs(moved) + 4e-15;
  stand_at(std::move(s.x), s.mesh(), period_error, conditions[0]);
  comes_to_rest_ = slides() && !(least_along(course(*last_field_), last_field_->scene().v) > 0);
  if (comes_to_rest_) throw Failure("a slip comes to rest");
}

// The candidate. The plane of its phase is on the other side where the amplitude has passed through zero.
void SmoothFamily::stand_at(std::vector<double> x, const std::vector<double>& mesh, double period_error,
                          const Condition& phase) {
  there_.mesh = mesh;
  there_.x = std::move(x);
  there_.t.assign(there_.x.size(), 0.);
  there_.period_error = period_error;
  const Condition after = plane(field(there_.x.back()), there_);
  double dot = 0;
  for (size_t a = 0; a < d_; ++a) {
    const double unit = last_field_->unit(int(a));
    dot += after.y0[a] * unit * phase.y0[a] * unit;
  }
  candidate_turn_ = dot < 0 ? -turn_ : turn_;
}

Place SmoothFamily::tangent(const Place& row) {
  if (std::any_of(there_.t.begin(), there_.t.end(), [](double value) { return value != 0; })) {
    const Place known = direction();
    if (dot(known, row) > 0) return known;
  }
  PeriodicEquations problem = equations(there_.mesh, there_.x.back());
  there_.t = problem.tangent(there_.x, {plane(problem.field(), there_), condition(row, 0)});
  const Place t = place_of(there_.t, there_.t);
  const double length = std::sqrt(dot(t, t));
  for (double& value : there_.t) value /= length;
  return direction();
}

std::vector<double> SmoothFamily::halves() const {
  constexpr int places = 32;
  std::vector<double> off, first(d_), second(d_);
  for (int k = 0; k < places; ++k) {
    const double phase = double(k) / (2 * places);
    evaluate(Collocation::gauss5(), there_.mesh, there_.x.data(), int(d_), phase, first.data());
    evaluate(Collocation::gauss5(), there_.mesh, there_.x.data(), int(d_), phase + .5, second.data());
    for (size_t a = 0; a < d_; ++a)
      off.push_back((second[a] - first[a]) / scale_[a] / std::sqrt(double(places) * double(d_)));
  }
  return off;
}

void SmoothFamily::accept() {
  here_ = there_;
  turn_ = candidate_turn_;
}

// A mixture of candidates. Each is taken on a mesh of its own that follows it, and the meshes are mixed too,
// so that fronts which move in phase from one to the next stay fronts.
void SmoothFamily::mix(const Others& others) {
  const size_t intervals = there_.mesh.size() - 1;
  Stand sum;
  const auto add = [&](const Stand& stand, double weight) {
    const PeriodicEquations own(stand.mesh, last_field_);
    const std::vector<double> rough = roughness(stand.mesh, stand.x.data(), int(d_));
    const PeriodicEquations even(equidistribute(stand.mesh, rough, intervals), last_field_);
    const std::vector<double> x = even.fill(own, {stand.x.begin(), stand.x.end() - 1});
    sum.x.resize(x.size());
    sum.mesh.resize(intervals + 1);
    for (size_t k = 0; k < x.size(); ++k) sum.x[k] += weight * x[k];
    for (size_t k = 0; k <= intervals; ++k) sum.mesh[k] += weight * even.mesh()[k];
  };
  double rest = 1;
  for (const auto& [path, weight] : others) {
    add(begun_at_mean(dynamic_cast<const SmoothFamily&>(*path).there_), weight);
    rest -= weight;
  }
  add(there_, rest);
  for (size_t k = 0; k < intervals; ++k)
    if (!(sum.mesh[k + 1] > sum.mesh[k])) return;  // the meshes do not go together: this candidate alone
  sum.mesh.back() = 1;
  sum.x.push_back(there_.x.back());
  there_.x = std::move(sum.x);
  there_.mesh = std::move(sum.mesh);
}

// The same with phase 0 where unknown `section_`, a velocity or without mass a force, passes its mean upwards
// (downwards where v < 0): there every cycle of a family passes, large or small.
SmoothFamily::Stand SmoothFamily::begun_at_mean(Stand stand) const {
  const Collocation& gauss = Collocation::gauss5();
  const std::vector<double> mean = mean_of(stand.mesh, stand.x.data(), d_);
  const size_t k = size_t(section_), block = d_ * (mesh_stages + 1), n = stand.mesh.size() - 1;
  const double side = scene_at_(stand.x.back()).v < 0 ? -1 : 1;
  std::vector<double> y(d_);
  const auto above = [&](double phase) {
    evaluate(gauss, stand.mesh, stand.x.data(), int(d_), phase, y.data());
    return side * (y[k] - mean[k]);
  };
  double begin = 0;
  for (size_t i = 0; i < n; ++i) {
    const double low = side * (stand.x[i * block + k] - mean[k]),
                 high = side * (stand.x[(i + 1) % n * block + k] - mean[k]);
    if (low < 0 && high >= 0) begin = find_root(above, {stand.mesh[i], low, stand.mesh[i + 1], high}, 1e-12);
  }
  std::vector<double> mesh;  // the old nodes, seen from there, the nearest moved there: no interval is tiny
  for (size_t i = 0; i < n; ++i) mesh.push_back(stand.mesh[i] - begin - std::floor(stand.mesh[i] - begin));
  std::sort(mesh.begin(), mesh.end());
  if (1 - mesh.back() < mesh[0]) mesh.insert(mesh.begin(), 0), mesh.pop_back();
  mesh[0] = 0;
  mesh.push_back(1);
  for (std::vector<double>* of : {&stand.x, &stand.t}) {
    std::vector<double> moved((mesh.size() - 1) * block);
    for (size_t i = 0; i + 1 < mesh.size(); ++i)
      for (size_t j = 0; j <= mesh_stages; ++j)
        evaluate(gauss, stand.mesh, of->data(), int(d_),
                 begin + mesh[i] + (mesh[i + 1] - mesh[i]) * gauss.basis.points()[j],
                 &moved[i * block + j * d_]);
    moved.insert(moved.end(), of->end() - 2, of->end());
    *of = std::move(moved);
  }
  stand.mesh = mesh;
  return stand;
}

std::unique_ptr<CycleFamily> SmoothFamily::beside(std::function<Scene(double)> at, double from,
                                                  double range, const Others& others) const {
  auto other = std::make_unique<SmoothFamily>(*this);
  if (section_ < 0) {
    const size_t width = size_t(last_field_->width());
    other->section_ = 0;
    for (size_t a = 0; a < d_; a += width)
      if (scale_[a] > scale_[size_t(other->section_)]) other->section_ = int(a);
  }
  other->there_ = other->begun_at_mean(there_);
  if (!others.empty()) other->mix(others);
  other->scene_at_ = std::move(at);
  other->family_ = family_of(other->scene_at_, periods_);
  other->range_ = range;
  other->there_.x.back() = from;
  other->here_ = other->there_;
  other->turn_ = candidate_turn_;
  return other;
}

SmoothCycle SmoothFamily::smooth() const {
  SmoothCycle result;
  const auto cell = std::make_shared<const CellField>(scene_at_(there_.x.back()), periods_);
  result.field = cell;
  result.mesh = there_.mesh;
  result.values.assign(there_.x.begin(), there_.x.end() - 2);
  PeriodicEquations problem(there_.mesh, cell);
  const std::vector<double> x(there_.x.begin(), there_.x.end() - 1);
  const PeriodicEquations::Step step = problem.step(x, {plane(*cell, there_)});
  result.cycle = course(*cell);
  result.cycle.residual = step.residual;
  result.cycle.error_estimate = there_.period_error;
  if (slides()) result.cycle.tests["graze"] = -least_along(result.cycle, cell->scene().v);
  if (periods_ == 0) result.cycle.tests["hopf"] = candidate_turn_ * result.cycle.amplitude;
  set_multipliers(result);
  return result;
}

}  // namespace

std::unique_ptr<CycleFamily> smooth_family(std::function<Scene(double)> at, double from, double range,
                                           const SmoothCycle& first) {
  return std::make_unique<SmoothFamily>(std::move(at), from, range, first);
}

SmoothCycle smooth_candidate(const CycleFamily& path) {
  return dynamic_cast<const SmoothFamily&>(path).smooth();
}

}  // namespace stickslip
