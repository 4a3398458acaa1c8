#include "stickslip/waves/train.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "waves/train_equations.hpp"

namespace stickslip {

namespace {

constexpr int stages = train_stages, max_dim = train_max_dim;

// The largest psi (sign 1) or the least (-1): the best point, then the way down to the polynomial's own extremum.
double extremum(const TrainEquations& problem, const std::vector<double>& x, int sign) {
  const std::vector<double>& mesh = problem.mesh();
  const size_t d = size_t(problem.dim()), n = mesh.size() - 1, b = problem.block();
  size_t best = 0;
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j <= stages; ++j)
      if (sign * x[i * b + j * d] > sign * x[best]) best = i * b + j * d;
  double value = x[best];
  const size_t at_interval = best / b;
  for (size_t i : {at_interval, (at_interval + n - 1) % n, (at_interval + 1) % n}) {
    double low = mesh[i], high = mesh[i + 1], y[max_dim];
    const double golden = (std::sqrt(5.) - 1) / 2;
    for (int k = 0; k < 60; ++k) {
      const double p1 = high - golden * (high - low), p2 = low + golden * (high - low);
      double f1, f2;
      evaluate(mesh, x.data(), int(d), p1, y);
      f1 = y[0];
      evaluate(mesh, x.data(), int(d), std::min(p2, std::nextafter(1., 0.)), y);
      f2 = y[0];
      value = sign * std::max({sign * value, sign * f1, sign * f2});
      (sign * f1 > sign * f2 ? high : low) = sign * f1 > sign * f2 ? p2 : p1;
    }
  }
  return value;
}

}  // namespace

Train pack(const TrainEquations& problem, const std::vector<double>& x) {
  Train train;
  const TrainSetting& setting = problem.setting();
  const std::vector<double>& mesh = problem.mesh();
  const size_t d = size_t(problem.dim()), n = mesh.size() - 1, b = problem.block();
  const TrainSetting::At at = setting.at(x[n * b]);
  train.pulses = setting.request.pulses;
  train.length_given = bool(setting.request.length);
  train.speed = setting.request.speed ? *setting.request.speed : at.speed;
  train.period = at.T;
  train.length = setting.request.length ? *setting.request.length : double(train.pulses) * at.speed * at.T;
  train.r2 = at.r2;
  train.oscillator = setting.oscillator;
  train.mesh = mesh;
  for (size_t i = 0; i < n; ++i) {
    train.nodes.insert(train.nodes.end(), x.begin() + long(i * b), x.begin() + long(i * b + d));
    train.stages.insert(train.stages.end(), x.begin() + long(i * b + d), x.begin() + long((i + 1) * b));
  }
  train.psi_max = extremum(problem, x, 1);
  train.psi_min = extremum(problem, x, -1);
  return train;
}

namespace {

// The largest change of psi at the points of the finer mesh.
double change_of_profile(const std::vector<double>& mesh, const std::vector<double>& x, const TrainEquations& finer,
                         const std::vector<double>& y) {
  double change = 0;
  const std::vector<double>& fine_mesh = finer.mesh();
  const size_t d = size_t(finer.dim());
  for (size_t i = 0; i + 1 < fine_mesh.size(); ++i)
    for (size_t j = 0; j <= stages; ++j) {
      double at[max_dim];
      const double phase = fine_mesh[i] + (fine_mesh[i + 1] - fine_mesh[i]) * train_dense().points()[j];
      evaluate(mesh, x.data(), int(d), phase, at);
      change = std::max(change, std::abs(at[0] - y[i * finer.block() + j * d]));
    }
  return change;
}

// Solves on the mesh of `x`'s profile (adapted), then on the mesh halved; refines until the answer is good enough.
bool solve_to(const TrainSetting& setting, std::vector<double> mesh, const Profile& start, double q, double tolerance,
              bool adapt, Train& train) {
  TrainEquations problem(setting, mesh, q);
  std::vector<double> x = problem.fill(start, q);
  if (!newton(problem, x)) return false;
  const int d = problem.dim();
  double least = 12;
  for (int round = 0; round < 12; ++round) {
    // the profile to 1e-9 of its range or the tolerance asked for, whichever is finer, within reason
    if (adapt) {
      const std::vector<double> rough = roughness(mesh, x.data(), d);
      const double wanted = intervals_for(mesh, rough, std::max(tolerance, 1e-12) * 10);
      const size_t intervals = size_t(std::min(20000., std::max(least, .5 * wanted)));
      least = 1.5 * double(intervals);  // should there be a next round
      std::vector<double> better = equidistribute(mesh, rough, intervals);
      TrainEquations on_better(setting, better, x.back());
      std::vector<double> guess =
          on_better.fill([&](double phase, double* y) { evaluate(mesh, x.data(), d, phase, y); }, x.back());
      if (!newton(on_better, guess)) continue;  // too coarse
      problem = on_better;
      mesh = better;
      x = guess;
    }
    TrainEquations finer(setting, halved(mesh), x.back());
    std::vector<double> y =
        finer.fill([&](double phase, double* to) { evaluate(mesh, x.data(), d, phase, to); }, x.back());
    double last_step = 0;
    if (!newton(finer, y, &last_step)) {
      if (adapt) continue;
      return false;
    }
    // Halving divides the error of q by 2^10 once the mesh is fine, and by less before; 8 is on the safe side.
    const double profile = change_of_profile(mesh, x, finer, y);
    const std::vector<double>& fine_mesh = finer.mesh();
    const TrainSetting::At coarse = setting.at(x.back()), fine = setting.at(y.back());
    const double relative = std::abs(setting.request.speed ? coarse.T / fine.T - 1 : coarse.speed / fine.speed - 1);
    const double estimate = relative / 8;
    const bool good = estimate <= tolerance && profile / 32 <= std::max({1e-9, tolerance, last_step});
    if (good || round == 11 || fine_mesh.size() > 40000) {
      if (!good) throw Failure("the train needs more than " + std::to_string(fine_mesh.size()) + " mesh intervals");
      train = pack(finer, y);
      const double unknown = setting.request.speed ? train.length : std::abs(train.speed);
      std::vector<double> F(finer.size()), noise(finer.size());
      finer.residual(y.data(), F.data());
      for (double r : F) train.residual = std::max(train.residual, std::abs(r));
      // round-off: what one more step of Newton's method would move q by, and a few units of the last place
      finer.linearise(y.data());
      finer.solve(F.data(), noise.data());
      train.error_estimate = unknown * (estimate + 4 * std::abs(noise.back()) + 4e-15);
      train.profile_error = profile / 32 + last_step;
      return true;
    }
    if (!adapt) {
      problem = finer;
      mesh = fine_mesh;
      x = y;
    }
  }
  return false;
}

double cubic_shortest(const Scene& scene) {
  const double a2 = 1 - scene.s_delta() / scene.gamma, w2 = scene.v * scene.v / a2;
  if (!(a2 > 0) || w2 >= 1) return 0;
  return scene.gamma * a2 * scene.c * (3 - (1 - w2) * std::log((4 - w2) / (1 - w2)));
}

bool plain_cubic(const Scene& scene) {
  return Friction::of(scene.friction)->van_der_pol;
}

}  // namespace

const Tableau& train_tableau() {
  static const Tableau t = Tableau::gauss(stages);
  return t;
}

const Lagrange& train_dense() {
  static const Lagrange l = [] {
    std::vector<double> points{0};
    for (double c : train_tableau().c) points.push_back(c);
    return Lagrange(points);
  }();
  return l;
}

void Train::at(double phase, double* y) const {
  phase -= std::floor(phase);
  const size_t n = intervals(), d = size_t(oscillator->dim());
  const size_t i = std::min(size_t(std::upper_bound(mesh.begin(), mesh.end(), phase) - mesh.begin() - 1), n - 1);
  double w[train_stages + 1];
  train_dense().weights((phase - mesh[i]) / (mesh[i + 1] - mesh[i]), w);
  for (size_t a = 0; a < d; ++a) {
    y[a] = w[0] * nodes[i * d + a];
    for (size_t j = 0; j < train_stages; ++j) y[a] += w[j + 1] * stages[(i * train_stages + j) * d + a];
  }
}

double Train::psi_at(double phase) const {
  double y[max_dim];
  at(phase, y);
  return y[0];
}

double Train::eta_at(double phase) const {
  double y[max_dim];
  at(phase, y);
  return oscillator->eta(r2, y);
}

double Train::state_at(double phase) const {
  double y[max_dim];
  at(phase, y);
  return oscillator->dim() == 3 ? y[2] : 0;
}

void check_train_scene(const Scene& scene) {
  if (scene.form == Form::chain)
    throw UsageError("model_form chain: travelling trains are solved for in the continuum only (the chain's obey an "
                     "advance-delay equation); use model_form continuum");
  if (scene.spread > 0)
    throw UsageError("friction_spread " + rounded_text(scene.spread, 8) +
                     ": a train travels through a uniform medium only; set friction_spread to 0");
  (void)Oscillator(scene);  // refuses a law that jumps
}

double shortest_pulse(const Scene& scene) {
  return plain_cubic(scene) ? cubic_shortest(scene) : scene.c == 0 ? 0 : std::nan("");
}

Train correct_train(const Scene& scene, const TrainRequest& request, const Train& guess, bool adapt) {
  const TrainSetting setting = TrainSetting::of(scene, request);
  const double q = setting.number_of(guess);
  Train train;
  if (!solve_to(setting, guess.mesh, [&](double phase, double* y) { guess.at(phase, y); }, q, 1e-10, adapt, train))
    throw Failure("Newton's method does not reach a train from the one nearby");
  return train;
}

namespace {

void check_request(const Scene& scene, const TrainRequest& request) {
  if (request.pulses < 1) throw UsageError("wave_pulses " + std::to_string(request.pulses) + ": at least 1 is needed");
  if (bool(request.length) == bool(request.speed))
    throw UsageError("wave_length and wave_speed: exactly one of the two is needed");
  if (request.length && !(*request.length > 0))
    throw UsageError("wave_length " + rounded_text(*request.length, 8) + ": a positive length is needed");
  const double c = scene.c;
  if (request.speed && !(std::abs(*request.speed) > c))
    throw UsageError("wave_speed " + rounded_text(*request.speed, 8) +
                     ": periodic waves need a speed beyond c, |V| > model_c = " + rounded_text(c, 8));
}

Orbit orbit_at(const TrainSetting& setting, double r2) {
  try {
    return find_orbit(*setting.oscillator, r2, 1e-5, 0);
  } catch (const Failure& e) {
    throw Failure(std::string("no train: ") + e.what());
  }
}

// The train from an integrated orbit; false where Newton's method does not reach it.
bool from_orbit(const TrainSetting& setting, const Orbit& orbit, double q, double tolerance, Train& train) {
  auto attempt = [&](const Orbit& guess) {
    return solve_to(setting, guess.steps(), [&](double phase, double* y) { guess.at(phase, y); }, q, tolerance, true,
                    train);
  };
  if (attempt(orbit)) return true;
  // fronts so steep that Newton's method wants a better start
  for (double finer : {1e-7, 1e-9, 1e-11})
    if (attempt(find_orbit(*setting.oscillator, setting.at(q).r2, finer, 0))) return true;
  return false;
}

// The fastest train of the length that is given; false where none is found down to V = c.
bool fastest_of_length(const TrainSetting& setting, double c, double tolerance, Train& train) {
  const double pulse = *setting.request.length / double(setting.request.pulses);
  // mismatch(q) = ln(V T/(length of a pulse)), from high speed down; the first change of sign is the fastest train
  const Orbit uniform = orbit_at(setting, 1);
  auto mismatch = [&](double q, Orbit& orbit) {
    const TrainSetting::At at = setting.at(q);
    orbit = orbit_at(setting, at.r2);
    return std::log(at.speed * orbit.period / pulse);
  };
  Orbit orbit;
  double high = std::log(pulse / uniform.period), at_high = mismatch(high, orbit);
  while (at_high <= 0) at_high = mismatch(high += .5, orbit);
  const double floor = std::log(std::max(c, 1e-30)) - 14;  // V/c - 1 = 3e-13
  double step = .5;
  while (high > floor) {
    double low = high - step, at_low = mismatch(low, orbit);
    if (c == 0 && low < high - 40) break;
    if (at_low > 0) {
      high = low;
      at_high = at_low;
      step = std::min(1., step * 1.5);
      continue;
    }
    double a = low, b = high, fa = at_low, fb = at_high, q = low;
    for (int k = 0; k < 60 && b - a > 1e-5 * std::max(1., std::abs(b)); ++k) {
      q = k % 3 == 2 ? (a + b) / 2 : b - fb * (b - a) / (fb - fa);
      const double fq = mismatch(q, orbit);
      if (std::abs(fq) < 1e-6) break;
      if (fq > 0) {
        b = q;
        fb = fq;
      } else {
        a = q;
        fa = fq;
      }
    }
    if (from_orbit(setting, orbit, q, tolerance, train)) return true;
    high = low;  // a jump of the period, not a root: go on below
    at_high = at_low;
    while (high > floor && at_high <= 0) at_high = mismatch(high -= .5, orbit);
  }
  return false;
}

}  // namespace

Train solve_train(const Scene& scene, const TrainRequest& request, double tolerance) {
  check_train_scene(scene);
  check_request(scene, request);
  if (plain_cubic(scene)) {
    const double a2 = 1 - scene.s_delta() / scene.gamma, vc = a2 > 0 ? std::sqrt(a2) : 0;
    if (std::abs(scene.v) >= vc)
      throw Failure("no train: uniform sliding at model_v = " + rounded_text(scene.v, 8) +
                    " is stable (|v| >= v_c = " + rounded_text(vc, 8) + ")");
  }
  const TrainSetting setting = TrainSetting::of(scene, request);
  Train train;
  if (request.speed) {
    const Orbit orbit = orbit_at(setting, setting.at(0).r2);
    if (!from_orbit(setting, orbit, std::log(orbit.period), tolerance, train))
      throw Failure("Newton's method does not converge to the train from the integrated orbit");
    return train;
  }
  if (fastest_of_length(setting, scene.c, tolerance, train)) return train;
  const std::string none = "no train of " + std::to_string(request.pulses) + (request.pulses == 1 ? " pulse" : " pulses") +
                           " on a ring of length " + rounded_text(*request.length, 8);
  double l = shortest_pulse(scene);
  if (std::isnan(l)) {
    try {
      l = scene.c * find_orbit(Oscillator(scene), 2e-12, 1e-8, 0).period;
    } catch (const Failure&) {
      throw Failure(none + " was found, and none is left as V falls to c: wave_speed shows which speeds have one");
    }
  }
  const double most = std::ceil(*request.length / l) - 1;
  const std::string fits = most < 1 ? "none fits" : "at most " + rounded_text(most, 8) + (most == 1 ? " fits" : " fit");
  throw Failure(none + ": as V falls to c a pulse still takes " + rounded_text(l, 8) + ", so that " + fits);
}

}  // namespace stickslip
