#include "waves/viscous_train.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <utility>

#include "numerics/mesh_solve.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

namespace {

using std::size_t;

// y = (f, z[, s], g).
class TrainField : public VectorField {
 public:
  TrainField(std::shared_ptr<const Oscillator> oscillator, double N, double V)
      : o_(std::move(oscillator)), N_(N), V_(V), r2_(1 - o_->c2() / (V * V)) {}
  int dim() const override { return o_->dim() + 1; }
  void rates(const double* y, double* f) const override { viscous_rhs(*o_, N_, V_, r2_, y, f, nullptr); }
  void jacobian(const double* y, double* J) const override {
    double f[train_max_dim + 1];
    viscous_rhs(*o_, N_, V_, r2_, y, f, J);
  }

 private:
  std::shared_ptr<const Oscillator> o_;
  double N_, V_, r2_;
};

// The equations at a viscosity and a speed or length, with a solution of them.
class ViscousProfile {
 public:
  using Solution = MeshSolution<PeriodicEquations>;

  // The plain train, of which this is nearly one.
  ViscousProfile(const Scene& scene, const Train& plain, double N)
      : o_(plain.oscillator), pulses_(double(plain.pulses)), v_(scene.v), N_(N),
        length_(plain.length_given ? plain.length : 0),
        speed_(std::abs(plain.speed)), solution_{equations(plain.mesh, std::log(speed_)), {}} {
    solution_.x = solution_.equations.fill(
        [&](double phase, double* y) {
          double dy[4];
          plain.at(phase, y);
          o_->rhs(plain.r2, y, dy, nullptr);
          y[o_->dim()] = dy[0];
        },
        std::log(plain.period));
  }

  double N() const { return N_; }
  double V() const { return V_of(solution_); }
  double L() const { return pulses_ * V() * T_of(solution_); }
  static double T_of(const Solution& s) { return std::exp(s.q()); }
  double V_of(const Solution& s) const { return length_ > 0 ? std::exp(s.equations.lambda(s.x)) : speed_; }
  const Solution& solution() const { return solution_; }
  void set_solution(Solution s) { solution_ = std::move(s); }

  // Newton's method; false where it does not converge to a train.
  bool newton(Solution& s) const {
    const PeriodicEquations::Newton newton = s.equations.newton(s.x, conditions());
    s.last_step = newton.last_step;
    s.residual = newton.residual;
    const double V = V_of(s), range = ranges(s.x.data(), points_on(s.mesh()), s.equations.dim())[0];
    return newton.converged && range > 1e-6 * (1 + std::abs(v_)) && V * V > o_->c2();
  }
  bool solve() { return newton(solution_); }
  // To another viscosity, or another length.
  bool move(double N, double length) {
    const double N_before = N_, length_before = length_;
    N_ = N;
    if (length_ > 0) length_ = length;
    const auto mesh = equidistribute(solution_.mesh(), solution_.rough(), solution_.mesh().size() - 1);
    Solution there{equations(mesh, std::log(V())), {}};
    there.x = there.equations.fill(solution_.equations, solution_.x);
    if (newton(there)) {
      solution_ = std::move(there);
      return true;
    }
    N_ = N_before;
    length_ = length_before;
    return false;
  }

 private:
  PeriodicEquations equations(const std::vector<double>& mesh, double log_speed) const {
    if (!(length_ > 0)) return PeriodicEquations(mesh, std::make_shared<const TrainField>(o_, N_, speed_));
    const FieldFamily family = [o = o_, N = N_](double log_V) -> std::shared_ptr<const VectorField> {
      return std::make_shared<const TrainField>(o, N, std::exp(log_V));
    };
    return PeriodicEquations(mesh, family, log_speed, 1);
  }
  // f(0) = v, and ln V + ln T = ln(L/n)
  std::vector<Condition> conditions() const {
    Condition phase;
    phase.y0.assign(o_->dim() + 1, 0.);
    phase.y0[0] = 1;
    phase.right = v_;
    if (!(length_ > 0)) return {phase};
    Condition fits;
    fits.y0.assign(o_->dim() + 1, 0.);
    fits.q = fits.lambda = 1;
    fits.right = std::log(length_ / pulses_);
    return {phase, fits};
  }

  std::shared_ptr<const Oscillator> o_;
  double pulses_, v_, N_, length_, speed_;
  Solution solution_;
};

// From N, L where the profile stands to others, in steps of either's logarithm that adapt. False where it
// does not get there.
bool lead(ViscousProfile& profile, double N, double L) {
  const double from[] = {std::log(profile.N()), std::log(profile.L())}, to[] = {std::log(N), std::log(L)};
  double done = 0,
         step = std::min(1., 0.7 / std::max({std::abs(to[0] - from[0]), 5 * std::abs(to[1] - from[1]), 0.7}));
  for (int k = 0; done < 1; ++k) {
    if (k == 400 || step < 1e-4) return false;
    const double next = std::min(1., done + step);
    const auto at = [&](int i) { return std::exp(from[i] + next * (to[i] - from[i])); };
    if (profile.move(next == 1 ? N : at(0), next == 1 ? L : at(1))) {
      done = next;
      step *= 1.4;
    } else {
      step /= 2;
    }
  }
  return true;
}

// A profile at a viscosity so small that the plain train is nearly one.
std::optional<ViscousProfile> begin(const Scene& scene, const Train& plain) {
  const double V2 = plain.speed * plain.speed, excess = V2 * plain.r2;  // V^2 - c^2
  double N = std::min(scene.N(), 0.01 * excess * excess / V2 / (scene.A() * scene.A()));
  for (int k = 0; k < 6; ++k, N /= 10) {
    ViscousProfile profile(scene, plain, N);
    if (profile.solve()) return profile;
  }
  return std::nullopt;
}

std::string none_of(const TrainRequest& request) {
  const std::string what = request.length ? "of length " + rounded_text(*request.length, 8)
                                          : "at the speed " + rounded_text(*request.speed, 8);
  return fmt::format("no train of {}{}{}: ", request.pulses, request.pulses == 1 ? " pulse " : " pulses ",
                     what);
}

// The plain train of the request, or of a longer ring where the plain medium has none of its length.
Train plain_train(const Scene& scene, const TrainRequest& request) {
  Scene plain = scene;
  plain.nu = 0;
  TrainRequest longer = request;
  for (int k = 0;; ++k) {
    try {
      return solve_train(plain, longer, 1e-8);
    } catch (const Failure&) {
      if (!request.length || k == 24) throw;
      *longer.length *= 1.25;
    }
  }
}

Train packed(const Scene& scene, const TrainRequest& request, const ViscousProfile& profile,
             std::shared_ptr<const Oscillator> oscillator) {
  Train train;
  const double V = profile.V();
  train.pulses = request.pulses;
  train.length_given = bool(request.length);
  train.speed = request.speed ? *request.speed : V;
  train.period = ViscousProfile::T_of(profile.solution());
  train.length = request.length ? *request.length : profile.L();
  train.r2 = 1 - oscillator->c2() / (V * V);
  train.nu = scene.nu;
  train.oscillator = std::move(oscillator);
  train.method = &Collocation::gauss5();
  train.mesh = profile.solution().mesh();
  const std::vector<double>& x = profile.solution().x;
  set_viscous_values(train, {x.begin(), x.end() - profile.solution().equations.parameters()});
  find_extrema(train);
  train.residual = profile.solution().residual;
  return train;
}

}  // namespace

void viscous_rhs(const Oscillator& oscillator, double N, double V, double r2, const double* y, double* dy,
                 double* J) {
  const int d = oscillator.dim(), n = d + 1;
  const double stiffness = V * V / N / oscillator.A();
  double inner[train_max_dim * train_max_dim];
  oscillator.rhs(1, y, dy, J ? inner : nullptr);
  dy[d] = stiffness * (r2 * y[d] - dy[0]);
  dy[0] = y[d];
  if (!J) return;
  std::fill(J, J + n * n, 0.);
  for (int j = 0; j < d; ++j) {
    J[d * n + j] = -stiffness * inner[j];
    for (int i = 1; i < d; ++i) J[i * n + j] = inner[i * d + j];
  }
  J[d] = 1;
  J[d * n + d] = stiffness * r2;
}

void set_viscous_values(Train& train, std::vector<double> y) {
  const Oscillator& o = *train.oscillator;
  const size_t d = size_t(o.dim());
  train.values.clear();
  for (size_t k = 0; k < y.size(); k += d + 1) {
    double dy[train_max_dim];
    o.rhs(1, &y[k], dy, nullptr);
    train.values.push_back(y[k]);
    // eta = z + (K1/V^2) g - (s delta/A) f, put into Oscillator::eta and solved for its z
    train.values.push_back(y[k + 1] + (1 - train.r2) * (train.r2 * y[k + d] - dy[0]) / o.A());
    if (d == 3) train.values.push_back(y[k + 2]);
  }
  train.viscous_values = std::move(y);
}

Train solve_viscous_train(const Scene& scene, const TrainRequest& request, double tolerance) {
  const std::string none = none_of(request);
  const Train plain = plain_train(scene, request);
  std::optional<ViscousProfile> profile = begin(scene, plain);
  if (!profile) throw Failure(none + "Newton's method does not reach it from the train without viscosity");
  if (!lead(*profile, scene.N(), profile->L()))
    throw Failure(none + "followed from the train without viscosity it ends at model_nu " +
                  rounded_text(scene.nu * profile->N() / scene.N(), 6));
  if (request.length && plain.length != *request.length && !lead(*profile, scene.N(), *request.length))
    throw Failure(fmt::format("{}followed from longer rings it ends at length {:.6g}, V = {:.6g}", none,
                              profile->L(), profile->V()));
  using Solution = ViscousProfile::Solution;
  const auto change = [&](const Solution& coarse, const Solution& fine) {
    return std::abs(request.speed ? ViscousProfile::T_of(coarse) / ViscousProfile::T_of(fine) - 1
                                  : profile->V_of(coarse) / profile->V_of(fine) - 1);
  };
  const auto found = solve_to_accuracy<PeriodicEquations>(
      [&](Solution& s) { return profile->newton(s); }, profile->solution(),
      {tolerance, 12, {0}, units_of_psi, change, none + "it"});
  if (!found) throw Failure(none + "Newton's method does not converge on a finer mesh");
  profile->set_solution(found->solution);
  Train train = packed(scene, request, *profile, plain.oscillator);
  train.error_estimate = (request.length ? train.speed : train.length) *
                         (found->estimate + 4 * found->solution.last_step + 4e-15);
  return train;
}

}  // namespace stickslip
