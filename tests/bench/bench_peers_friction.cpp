// The friction that people have, by other solvers: exact stick with CVODE, ARKODE and a loop of its own, the
// same smoothed, and rate-and-state friction in log velocity. Driven by peers_friction.py, which says what is
// compared; nothing here is shared with the program.
//
//     bench_peers_friction SCENE METHOD TOLERANCE EPS END
//
// SCENE: numbers in binary, as read below. METHOD: loop (Dormand and Prince's pair over all blocks; a start
// or a stop ends a step, found by steps of other lengths; with all blocks at rest to the next start in one
// go, as papers on catalogues describe it), erk, adams (with roots; a change of any block starts anew), bdf
// (banded; EPS > 0: friction smoothed over it). END: the unknowns at the end, in binary. Prints processor
// seconds, steps and starts of a block whose neighbours rest.
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

namespace {

using Values = std::vector<double>;

// Unknowns stand block behind block: psi and eta; ln psi and ln theta; with a mass ln psi, ln theta and eta.
struct Scene {
  bool sticks, one_way, slip_law;
  std::size_t n, kinds;
  double t_end, m, k0, k1, f0, zeta, v, alpha, a, b, D, mu0, psi0;
  Values strength, start;
  std::vector<int> going;  // exact stick: the direction of a block, 0 at rest
  double eps = 0;

  explicit Scene(const char* path) {
    std::ifstream file(path, std::ios::binary);
    double head[18];
    file.read(reinterpret_cast<char*>(head), sizeof head);
    double* const all[] = {&t_end, &m, &k0, &k1, &f0, &zeta, &v, &alpha, &a, &b, &D, &mu0, &psi0};
    sticks = head[0] > 0, one_way = head[1] > 0, slip_law = head[2] > 0;
    n = std::size_t(head[3]), kinds = std::size_t(head[4]);
    for (std::size_t k = 0; k < 13; ++k) *all[k] = head[5 + k];
    strength.resize(n), start.resize(n * kinds);
    file.read(reinterpret_cast<char*>(strength.data()), std::streamsize(n * sizeof(double)));
    file.read(reinterpret_cast<char*>(start.data()), std::streamsize(start.size() * sizeof(double)));
    if (!file) std::exit(2);
    going.assign(n, 0);
  }
  double coupling(const double* psi, std::size_t i) const {
    return (i ? psi[i - 1] - psi[i] : 0) + (i + 1 < n ? psi[i + 1] - psi[i] : 0);
  }
  double weakened(double speed) const { return 1 / (1 + 2 * alpha * std::abs(speed)); }

  void rates(const double* u, double* f) const { sticks ? rates_of_stick(u, f) : rates_with_a_state(u, f); }

  void rates_of_stick(const double* u, double* f) const {
    static thread_local Values psi;
    psi.resize(n);
    for (std::size_t i = 0; i < n; ++i) psi[i] = u[2 * i];
    for (std::size_t i = 0; i < n; ++i) {
      const double sign = eps > 0 ? std::tanh(psi[i] / eps) : going[i];
      const bool moves = eps > 0 || going[i];
      const double force = f0 * (u[2 * i + 1] - strength[i] * sign * weakened(psi[i])) - zeta * psi[i];
      f[2 * i] = moves ? force / m : 0;
      f[2 * i + 1] = (k0 * (v - psi[i]) + k1 * coupling(psi.data(), i)) / f0;
    }
  }
  void rates_with_a_state(const double* u, double* f) const {
    static thread_local Values psi;
    psi.resize(n);
    for (std::size_t i = 0; i < n; ++i) psi[i] = std::exp(u[kinds * i]);
    for (std::size_t i = 0; i < n; ++i) {
      const double s = u[kinds * i + 1], pull = k0 * (v - psi[i]) + k1 * coupling(psi.data(), i);
      const double s_t = slip_law ? -psi[i] / D * (std::log(psi[i] / D) + s) : std::exp(-s) - psi[i] / D;
      f[kinds * i + 1] = s_t;
      if (kinds == 2) {
        f[kinds * i] = (pull - f0 * b * s_t) / (f0 * a + zeta * psi[i]);
        continue;
      }
      const double friction = mu0 + a * (u[kinds * i] - std::log(psi0)) + b * (s + std::log(psi0 / D));
      f[kinds * i] = (f0 * (u[kinds * i + 2] - friction) - zeta * psi[i]) / (m * psi[i]);
      f[kinds * i + 2] = pull / f0;
    }
  }
  // Below 0: block i changes, from slip to rest or from rest to slip.
  double gap(const double* u, std::size_t i) const {
    if (going[i]) return u[2 * i] * going[i];
    return strength[i] - (one_way ? u[2 * i + 1] : std::abs(u[2 * i + 1]));
  }
  // At its change: what block i does now.
  void change(double* u, std::size_t i) {
    const bool holds = std::abs(u[2 * i + 1]) < strength[i] || (one_way && u[2 * i + 1] < strength[i]);
    if (going[i]) u[2 * i] = 0;
    going[i] = going[i] && holds ? 0 : u[2 * i + 1] > 0 ? 1 : -1;
  }
  bool at_rest() const { return std::all_of(going.begin(), going.end(), [](int g) { return g == 0; }); }
  void begin() {
    if (!sticks || eps > 0) return;
    for (std::size_t i = 0; i < n; ++i) {
      const double psi = start[2 * i];
      going[i] = psi > 0 ? 1 : psi < 0 ? -1 : 0;
      if (!going[i] && gap(start.data(), i) < 0) change(start.data(), i);
    }
  }
};

struct Count {
  long steps = 0, events = 0;
};

// ---- a loop of its own ----

constexpr double weights[7][7] = {{},
                                  {1. / 5},
                                  {3. / 40, 9. / 40},
                                  {44. / 45, -56. / 15, 32. / 9},
                                  {19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729},
                                  {9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656},
                                  {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84}};
constexpr double errors[7] = {71. / 57600,      0,          -71. / 16695, 71. / 1920,
                              -17253. / 339200, 22. / 525., -1. / 40};

struct Pair {
  Scene& s;
  std::array<Values, 7> k;
  Values stage;
  explicit Pair(Scene& scene) : s(scene), stage(scene.start.size()) {
    for (Values& slope : k) slope.resize(stage.size());
  }
  // The end of a step of h from u, whose slope is in k[0]; its error beside tolerances.
  double step(const Values& u, double h, Values& end, double tolerance) {
    for (int i = 1; i < 7; ++i) {
      Values& to = i == 6 ? end : stage;
      for (std::size_t q = 0; q < u.size(); ++q) {
        double sum = 0;
        for (int j = 0; j < i; ++j) sum += weights[i][j] * k[j][q];
        to[q] = u[q] + h * sum;
      }
      s.rates(to.data(), k[i].data());
    }
    double largest = 0;
    for (std::size_t q = 0; q < u.size(); ++q) {
      double sum = 0;
      for (int j = 0; j < 7; ++j) sum += errors[j] * k[j][q];
      largest = std::max(largest, std::abs(h * sum) / (1 + std::max(std::abs(u[q]), std::abs(end[q]))));
    }
    return std::isfinite(largest) ? largest / tolerance : 1e10;
  }
};

// The block whose gap is least.
std::size_t furthest(const Scene& s, const Values& u) {
  std::size_t first = 0;
  for (std::size_t i = 1; i < s.n; ++i)
    if (s.gap(u.data(), i) < s.gap(u.data(), first)) first = i;
  return first;
}

Count loop(Scene& s, double tolerance) {
  Count count;
  Pair pair(s);
  Values u = s.start, end(u.size());
  double t = 0, h = 1e-6 * s.t_end;
  const bool changes = s.sticks && s.eps == 0;
  bool fresh = true;
  while (t < s.t_end) {
    if (changes && s.at_rest()) {
      const double rate = s.k0 * s.v / s.f0;
      double wait = s.t_end - t;
      std::size_t first = s.n;
      for (std::size_t i = 0; i < s.n; ++i) {
        const double own = (s.strength[i] - u[2 * i + 1]) / rate;
        if (own < wait) wait = own, first = i;
      }
      for (std::size_t i = 0; i < s.n; ++i) u[2 * i + 1] += rate * wait;
      t += wait;
      if (first == s.n) break;
      s.going[first] = 1;
      ++count.events, fresh = true;
    }
    if (fresh) s.rates(u.data(), pair.k[0].data());
    h = std::min(h, s.t_end - t);
    const double error = pair.step(u, h, end, tolerance);
    const double factor = std::clamp(0.9 * std::pow(error + 1e-12, -0.2), 0.2, 5.);
    ++count.steps;
    fresh = false;
    if (error > 1) {
      h *= factor;
      continue;
    }
    std::size_t i = changes ? furthest(s, end) : 0;
    if (!changes || s.gap(end.data(), i) >= 0) {
      t += h, h *= factor;
      u.swap(end);
      pair.k[0].swap(pair.k[6]);
      continue;
    }
    // of the blocks that change within the step the one that does so first, by steps of other lengths
    double taken = h;
    for (bool before = true; before;) {
      double low = 0, high = taken, at_low = s.gap(u.data(), i), at_high = s.gap(end.data(), i);
      at_low = std::max(at_low, 1e-3 * std::abs(at_high));  // one that has just begun to slip
      for (int round = 0; round < 40 && std::abs(s.gap(end.data(), i)) > 1e-14; ++round) {
        taken = low + (high - low) * at_low / (at_low - at_high);
        pair.step(u, taken, end, tolerance);
        const double gap = s.gap(end.data(), i);
        if ((gap < 0) == (at_high < 0))
          high = taken, at_high = gap, at_low /= 2;
        else
          low = taken, at_low = gap, at_high /= 2;
      }
      const std::size_t other = furthest(s, end);
      before = other != i && s.gap(end.data(), other) < -1e-12;
      if (before) i = other;
    }
    t += taken;
    u.swap(end);
    const bool starts = !s.going[i];
    s.change(u.data(), i);
    count.events += starts && (i == 0 || !s.going[i - 1]) && (i + 1 == s.n || !s.going[i + 1]);
    fresh = true;
  }
  s.start = u;
  return count;
}

// ---- SUNDIALS ----

int sun_rates(double, N_Vector y, N_Vector f, void* data) {
  static_cast<Scene*>(data)->rates(N_VGetArrayPointer(y), N_VGetArrayPointer(f));
  return 0;
}
int sun_gaps(double, N_Vector y, double* gaps, void* data) {
  const Scene& s = *static_cast<Scene*>(data);
  for (std::size_t i = 0; i < s.n; ++i) gaps[i] = s.gap(N_VGetArrayPointer(y), i);
  return 0;
}

// `advance` to the end or the next change, `found` tells which blocks change, `again` starts anew.
template <class Advance, class Found, class Again>
long from_change_to_change(Scene& s, N_Vector y, Advance advance, Found found, Again again) {
  double t = 0;
  long changes = 0;
  std::vector<int> roots(s.n);
  while (t < s.t_end) {
    const int flag = advance(&t);
    if (flag < 0) std::exit(1);
    if (flag != CV_ROOT_RETURN) break;
    found(roots.data());
    for (std::size_t i = 0; i < s.n; ++i)
      if (roots[i]) s.change(N_VGetArrayPointer(y), i);
    again(t);
    ++changes;
  }
  return changes;
}

Count by_sundials(Scene& s, const std::string& method, double tolerance) {
  Count count;
  SUNContext context;
  SUNContext_Create(nullptr, &context);
  N_Vector y = N_VMake_Serial(sunindextype(s.start.size()), s.start.data(), context);
  const bool changes = s.sticks && s.eps == 0;
  const int roots = changes ? int(s.n) : 0;
  if (method == "erk") {
    void* solver = ERKStepCreate(sun_rates, 0, y, context);
    ERKStepSetUserData(solver, &s), ERKStepSStolerances(solver, tolerance, tolerance);
    ERKStepSetTableNum(solver, ARKODE_DORMAND_PRINCE_7_4_5);
    ERKStepSetMaxNumSteps(solver, 100000000), ERKStepSetStopTime(solver, s.t_end);
    if (roots) ERKStepRootInit(solver, roots, sun_gaps);
    long all = 0, part = 0;
    from_change_to_change(
        s, y, [&](double* t) { return ERKStepEvolve(solver, s.t_end, y, t, ARK_NORMAL); },
        [&](int* found) { ERKStepGetRootInfo(solver, found); },
        [&](double t) {
          ERKStepGetNumSteps(solver, &part), all += part;
          ERKStepReInit(solver, sun_rates, t, y), ERKStepSetStopTime(solver, s.t_end);
        });
    ERKStepGetNumSteps(solver, &part);
    count.steps = all + part;
    return count;
  }
  const bool stiff = method == "bdf";
  void* solver = CVodeCreate(stiff ? CV_BDF : CV_ADAMS, context);
  CVodeInit(solver, sun_rates, 0, y);
  CVodeSetUserData(solver, &s), CVodeSStolerances(solver, tolerance, tolerance);
  CVodeSetMaxNumSteps(solver, 100000000), CVodeSetStopTime(solver, s.t_end);
  if (stiff) {
    const auto width = sunindextype(2 * s.kinds - 1), size = sunindextype(s.start.size());
    SUNMatrix J = SUNBandMatrix(size, std::min(width, size - 1), std::min(width, size - 1), context);
    CVodeSetLinearSolver(solver, SUNLinSol_Band(y, J, context), J);
  } else {
    CVodeSetNonlinearSolver(solver, SUNNonlinSol_FixedPoint(y, 0, context));
  }
  if (roots) CVodeRootInit(solver, roots, sun_gaps);
  long all = 0, part = 0;
  from_change_to_change(
      s, y, [&](double* t) { return CVode(solver, s.t_end, y, t, CV_NORMAL); },
      [&](int* found) { CVodeGetRootInfo(solver, found); },
      [&](double t) {
        CVodeGetNumSteps(solver, &part), all += part;
        CVodeReInit(solver, t, y), CVodeSetStopTime(solver, s.t_end);
      });
  CVodeGetNumSteps(solver, &part);
  count.steps = all + part;
  return count;
}

}  // namespace

int main(int count, char** words) {
  if (count != 6) return 2;
  Scene scene(words[1]);
  const std::string method = words[2];
  const double tolerance = std::atof(words[3]);
  scene.eps = std::atof(words[4]);
  const std::clock_t begin = std::clock();
  scene.begin();
  const Count done = method == "loop" ? loop(scene, tolerance) : by_sundials(scene, method, tolerance);
  std::printf("%.9g %ld %ld\n", double(std::clock() - begin) / CLOCKS_PER_SEC, done.steps, done.events);
  const auto bytes = std::streamsize(scene.start.size() * sizeof(double));
  std::ofstream(words[5], std::ios::binary).write(reinterpret_cast<const char*>(scene.start.data()), bytes);
  return 0;
}
