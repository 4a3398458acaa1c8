#include "stickslip/waves/oscillator.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>

#include "stickslip/base/error.hpp"

namespace stickslip {

// ---- the oscillator -----------------------------------------------------------------------------------------------

struct Oscillator::Law {
  bool has_state = false;
  std::function<Partials(double, double)> partials;
  std::function<RatePartials(double, double)> rate;
  std::function<double(double)> steady_state;
};

Oscillator::Oscillator(const Scene& scene)
    : law_(new Law),
      A_(scene.A()),
      B_(scene.B()),
      Bd_(scene.B() + scene.s_delta() / scene.A()),
      K0_(scene.K0()),
      c2_(scene.A() * scene.K1()),
      sd_(scene.s_delta()),
      v_(scene.v) {
  const FrictionParameters& p = scene.friction;
  if (p.sticks())
    throw UsageError("friction_law " + to_string(p.law) +
                     " jumps at rest, which an oscillation passes: set friction_stick to regularised");
  const auto friction = Friction::of(p);
  law_->has_state = friction->has_state;
  law_->partials = [friction](double psi, double s) { return friction->partials(psi, s); };
  law_->rate = [friction](double psi, double s) { return friction->rate_partials(psi, s); };
  law_->steady_state = [friction](double psi) { return friction->steady_state(psi); };
  dim_ = law_->has_state ? 3 : 2;
}
Oscillator::~Oscillator() = default;
Oscillator::Oscillator(Oscillator&&) noexcept = default;

Partials Oscillator::partials(double psi, double state) const { return law_->partials(psi, state); }
RatePartials Oscillator::rate(double psi, double state) const { return law_->rate(psi, state); }

void Oscillator::rhs(double r2, const double* y, double* dy, double* J) const {
  const double s = dim_ == 3 ? y[2] : 0;
  const Partials p = law_->partials(y[0], s);
  dy[0] = A_ / r2 * (y[1] - Bd_ * y[0] - p.F);
  dy[1] = K0_ * (v_ - y[0]);
  if (J) {
    J[0] = -A_ / r2 * (Bd_ + p.F_psi);
    J[1] = A_ / r2;
    J[dim_] = -K0_;
    J[dim_ + 1] = 0;
  }
  if (dim_ == 3) {
    const RatePartials g = law_->rate(y[0], s);
    dy[2] = g.g;
    if (J) {
      J[2] = -A_ / r2 * p.F_state;
      J[5] = 0;
      J[6] = g.g_psi;
      J[7] = 0;
      J[8] = g.g_state;
    }
  }
}

double Oscillator::eta(double r2, const double* y) const {
  const double F = law_->partials(y[0], dim_ == 3 ? y[2] : 0).F;
  return (y[1] - Bd_ * y[0] - F) / r2 + B_ * y[0] + F;
}

void Oscillator::steady(double* y) const {
  const double s = dim_ == 3 ? law_->steady_state(v_) : 0;
  y[0] = v_;
  y[1] = Bd_ * v_ + law_->partials(v_, s).F;
  if (dim_ == 3) y[2] = s;
}

bool Oscillator::sliding_unstable(double r2) const {
  double y[3], dy[3], J[9];
  steady(y);
  rhs(r2, y, dy, J);
  if (dim_ == 2) return J[0] > 0;
  // lambda^3 + c2 lambda^2 + c1 lambda + c0
  const double a2 = -(J[0] + J[4] + J[8]);
  const double a1 = J[0] * J[8] - J[2] * J[6] - J[1] * J[3];
  const double a0 = J[1] * J[3] * J[8];
  return !(a2 > 0 && a0 > 0 && a2 * a1 > a0);
}

// ---- the integrator -----------------------------------------------------------------------------------------------

namespace {

constexpr int stages = 5, max_dim = 3;

const Tableau& radau() {
  static const Tableau t = Tableau::radau(stages);
  return t;
}

// 0 and the stages: the points of the dense output.
const Lagrange& dense() {
  static const Lagrange l = [] {
    std::vector<double> points{0};
    for (double c : radau().c) points.push_back(c);
    return Lagrange(points);
  }();
  return l;
}

struct Step {
  double t, h;
  double values[(stages + 1) * max_dim];  // at 0 and the stages
};

class Integrator {
 public:
  Integrator(const Oscillator& oscillator, double r2, double tolerance)
      : o_(oscillator), r2_(r2), tolerance_(tolerance), d_(oscillator.dim()) {
    dense().derivative_weights(test_point, slope_);
    dense().weights(test_point, value_);
  }

  // One step of size h from y. False where Newton's method fails. It starts from the polynomial of the step `near`,
  // which begins `offset` of its length before y (null: from y). `error`: of the dense output against the tolerance.
  bool try_step(const double* y, double h, const Step* near, double offset, Step& step, double& error) {
    const int d = d_, n = stages * d;
    step.h = h;
    double* stage = step.values + d;
    std::copy(y, y + d, step.values);
    for (int i = 0; i < stages; ++i) {
      if (near) {
        double w[stages + 1];
        dense().weights(offset + radau().c[size_t(i)] * h / near->h, w);
        for (int k = 0; k < d; ++k) {
          stage[i * d + k] = 0;
          for (int j = 0; j <= stages; ++j) stage[i * d + k] += w[j] * near->values[j * d + k];
        }
      } else {
        std::copy(y, y + d, stage + i * d);
      }
    }
    double previous = 0;
    for (int iteration = 0; iteration < 12; ++iteration) {
      double G[stages * max_dim], J[stages * max_dim * max_dim];
      for (int i = 0; i < stages; ++i) o_.rhs(r2_, stage + i * d, G + i * d, J + i * d * d);
      double a[stages * max_dim * stages * max_dim], b[stages * max_dim];
      for (int i = 0; i < stages; ++i) {
        for (int k = 0; k < d; ++k) {
          double r = y[k] - stage[i * d + k];
          for (int j = 0; j < stages; ++j) {
            const double ha = h * radau().a[size_t(i * stages + j)];
            r += ha * G[j * d + k];
            for (int l = 0; l < d; ++l)
              a[(i * d + k) * n + j * d + l] = (i == j && k == l ? 1. : 0.) - ha * J[(j * d + k) * d + l];
          }
          b[i * d + k] = r;
        }
      }
      if (!solve_dense(n, a, 1, b)) return false;
      double norm = 0;
      for (int i = 0; i < n; ++i) {
        stage[i] += b[i];
        norm = std::max(norm, std::abs(b[i]) / (1 + std::abs(stage[i])));
      }
      if (!std::isfinite(norm)) return false;
      if (norm < 1e-14 || (norm < 1e-10 && iteration > 0 && norm > previous / 4)) break;
      if (iteration == 11 || (iteration > 2 && norm > 2 * previous)) return false;
      previous = norm;
    }
    // The defect of the polynomial between the stages, filtered so that stiff directions do not exaggerate it.
    double u[max_dim] = {}, du[max_dim] = {}, g[max_dim], J[max_dim * max_dim], a[max_dim * max_dim], e[max_dim];
    for (int j = 0; j <= stages; ++j)
      for (int k = 0; k < d; ++k) {
        u[k] += value_[j] * step.values[j * d + k];
        du[k] += slope_[j] * step.values[j * d + k];
      }
    o_.rhs(r2_, u, g, J);
    for (int k = 0; k < d; ++k) {
      e[k] = filter * (du[k] - h * g[k]);
      for (int l = 0; l < d; ++l) a[k * d + l] = (k == l ? 1. : 0.) - filter * h * J[k * d + l];
    }
    if (!solve_dense(d, a, 1, e)) return false;
    error = 0;
    for (int k = 0; k < d; ++k) error = std::max(error, std::abs(e[k]) / (tolerance_ * (1 + std::abs(u[k]))));
    return std::isfinite(error);
  }

  // Advances y, t by one accepted step.
  void step(double& t, double* y, double& h, Step& out) {
    for (int attempt = 0; attempt < 200; ++attempt) {
      double error = 0;
      if (!try_step(y, h, have_last_ ? &last_ : nullptr, 1, out, error)) {
        h /= 4;
        have_last_ = have_last_ && attempt < 2;
        continue;
      }
      const double factor = std::min(4., std::max(.2, .85 * std::pow(std::max(error, 1e-12), -1. / (stages + 1))));
      if (error > 1) {
        h *= factor;
        continue;
      }
      out.t = t;
      t += h;
      std::copy(out.values + stages * d_, out.values + (stages + 1) * d_, y);
      last_ = out;
      have_last_ = true;
      h *= factor;
      return;
    }
    throw Failure("the oscillation's integrator cannot go on: step " + std::to_string(h));
  }

  void restart() { have_last_ = false; }

 private:
  static constexpr double test_point = .5 * 0.85, filter = .15;
  const Oscillator& o_;
  double r2_, tolerance_;
  int d_;
  double slope_[stages + 1], value_[stages + 1];
  Step last_;
  bool have_last_ = false;
};

// From y on the section f = v to the next passage of f = v upwards; y becomes the point there, the time is returned.
// Steps (the last cut at the section) are appended where asked for. `divergence`: integral of the trace of J.
class ReturnMap {
 public:
  ReturnMap(const Oscillator& o, double r2, double tolerance) : o_(o), r2_(r2), integrator_(o, r2, tolerance) {}

  double operator()(double* y, std::vector<Step>* steps, double* divergence) {
    const int d = o_.dim();
    integrator_.restart();
    double t = 0, g[max_dim], scale = 0;
    o_.rhs(r2_, y, g, nullptr);
    for (int k = 0; k < d; ++k) scale = std::max(scale, std::abs(g[k]) / (1 + std::abs(y[k])));
    double h = .01 / std::max(scale, 1e-6);
    bool below = false;
    if (divergence) *divergence = 0;
    for (long count = 0; count < 200000; ++count) {
      Step step;
      double start[max_dim];
      std::copy(y, y + d, start);
      integrator_.step(t, y, h, step);
      if (below && y[0] >= o_.v()) {
        // the passage lies in this step: find it on the polynomial, then end a step there
        double low = 0, high = 1;
        for (int k = 0; k < 60 && high - low > 1e-15; ++k) {
          double w[stages + 1], f = 0;
          const double mid = (low + high) / 2;
          dense().weights(mid, w);
          for (int j = 0; j <= stages; ++j) f += w[j] * step.values[j * d];
          (f < o_.v() ? low : high) = mid;
        }
        double end = (low + high) / 2 * step.h, error;
        Step cut;
        for (int k = 0; k < 6; ++k) {
          if (!integrator_.try_step(start, end, &step, 0, cut, error))
            throw Failure("the oscillation's integrator cannot go on at the section");
          double out[max_dim];
          o_.rhs(r2_, cut.values + stages * d, out, nullptr);
          const double correction = (o_.v() - cut.values[stages * d]) / out[0];
          if (std::abs(correction) <= 1e-15 * step.h) break;
          end += correction;
        }
        cut.t = step.t;
        std::copy(cut.values + stages * d, cut.values + (stages + 1) * d, y);
        y[0] = o_.v();
        add(cut, steps, divergence);
        return cut.t + end;
      }
      below = below || y[0] < o_.v();
      add(step, steps, divergence);
      if (t > 1e9 / std::sqrt(o_.K0() * o_.A())) break;
    }
    throw Failure("nothing oscillates: the motion settles without passing the plate velocity again");
  }

 private:
  void add(const Step& step, std::vector<Step>* steps, double* divergence) {
    if (steps) steps->push_back(step);
    if (!divergence) return;
    const int d = o_.dim();
    for (int j = 0; j < stages; ++j) {
      double g[max_dim], J[max_dim * max_dim];
      o_.rhs(r2_, step.values + (j + 1) * d, g, J);
      for (int k = 0; k < d; ++k) *divergence += step.h * radau().b[size_t(j)] * J[k * d + k];
    }
  }
  const Oscillator& o_;
  double r2_;
  Integrator integrator_;
};

// Points of the section f = v, f' > 0, told apart from steady sliding: (z, s) about it, s in units of z.
class Section {
 public:
  explicit Section(const Oscillator& o) : d_(o.dim()) {
    o.steady(fixed_);
    size_ = std::max(std::abs(o.partials(fixed_[0], d_ == 3 ? fixed_[2] : 0).F), .1) + 1. / 3;
  }
  // How far out to begin: the size of the friction force, or of its range over the slips that v drives.
  double size() const { return size_; }
  const double* sliding() const { return fixed_; }
  void start(double distance, double* y) const {
    std::copy(fixed_, fixed_ + d_, y);
    y[1] += distance;
  }
  double distance(const double* y) const {
    return d_ == 2 ? y[1] - fixed_[1] : std::hypot(y[1] - fixed_[1], size_ * (y[2] - fixed_[2]));
  }

 private:
  int d_;
  double fixed_[max_dim], size_;
};

[[noreturn]] void nothing_oscillates(const Oscillator& o, const std::string& why) {
  throw Failure("nothing oscillates: uniform sliding at v = " + rounded_text(o.v()) + why);
}

// One coordinate on the section: q(a) = ln(P(a)/a) is positive inside a stable cycle and negative outside; Newton's
// method in ln a with P' exact, kept between bounds.
double cycle_of_one(const Oscillator& o, double r2, ReturnMap& map, const Section& section, double a,
                    double tolerance) {
  const double* fixed = section.sliding();
  double low = 0, high = 1e300;
  for (int k = 0; k < 100; ++k) {
    double divergence, start[max_dim], end[max_dim], p[max_dim] = {fixed[0], fixed[1] + a, 0};
    o.rhs(r2, p, start, nullptr);
    map(p, nullptr, &divergence);
    o.rhs(r2, p, end, nullptr);
    const double image = p[1] - fixed[1], slope = std::exp(divergence) * start[0] / end[0];
    const double q = std::log(image / a), dq = slope * a / image - 1;
    (q > 0 ? low : high) = a;
    double next = a * (dq < 0 ? std::exp(std::min(1.5, std::max(-1.5, -q / dq))) : q > 0 ? 4. : .25);
    if (!(next > low && next < high)) next = high < 1e300 && low > 0 ? std::sqrt(low * high) : image;
    if (next < 1e-7 * section.size()) nothing_oscillates(o, " is stable, and slips die out to it");
    const double change = std::abs(next - a);
    a = next;
    if (change <= 4e-16 * (std::abs(fixed[1]) + a) || (k > 2 && change <= .1 * tolerance * a)) break;
  }
  return a;
}

// Two coordinates: Newton's method with differences, as far as round-off (and kinks of the law) let it. False where it
// leaves the neighbourhood of y or does not settle.
bool cycle_of_two(ReturnMap& map, const Section& section, double tolerance, double* y) {
  const double size = section.size(), begun = section.distance(y);
  double last_change = 1e300, p[max_dim];
  std::copy(y, y + max_dim, p);
  for (int k = 0; k < 30; ++k) {
    double image[max_dim], a[4], b[2];
    const double distance = section.distance(p);
    if (!(distance > .2 * begun && distance < 5 * begun)) return false;
    std::copy(p, p + max_dim, image);
    map(image, nullptr, nullptr);
    for (int j = 0; j < 2; ++j) {
      double moved[max_dim];
      std::copy(p, p + max_dim, moved);
      const double eps = 1e-5 * distance / (j == 0 ? 1 : size);
      moved[1 + j] += eps;
      map(moved, nullptr, nullptr);
      for (int i = 0; i < 2; ++i) a[i * 2 + j] = (i == j ? 1. : 0.) - (moved[1 + i] - image[1 + i]) / eps;
    }
    for (int i = 0; i < 2; ++i) b[i] = image[1 + i] - p[1 + i];
    if (!solve_dense(2, a, 1, b)) return false;
    const double change = std::max(std::abs(b[0]), size * std::abs(b[1])) / distance;
    p[1] += b[0];
    p[2] += b[1];
    if (change < tolerance || (change < 1e-8 && change > .3 * last_change)) {
      std::copy(p, p + max_dim, y);
      return true;
    }
    last_change = change;
  }
  return false;
}

// The cycle of a problem with a state, from slips of several sizes, each followed until it settles; what became of
// every one of them is the reason of a refusal.
void settle(const Oscillator& o, double r2, const Section& section, double tolerance, double* y) {
  // differences of 1e-5 want a map that is better than that
  ReturnMap coarse(o, r2, 1e-8), fine(o, r2, std::min(tolerance, 1e-10));
  const bool unstable = o.sliding_unstable(r2);
  std::string seen;
  int died = 0;
  for (const double part : {1., .1, .01, 4.}) {
    section.start(part * section.size(), y);
    const std::string from = "; a slip that begins " + rounded_text(part) + " friction forces above it ";
    try {
      double amplitude = section.distance(y), before = 0;
      bool dies = false;
      for (int k = 1; k <= 1000 && !dies; ++k) {
        coarse(y, nullptr, nullptr);
        before = amplitude;
        amplitude = section.distance(y);
        dies = amplitude < 1e-7 * section.size() ||
               (!unstable && amplitude < 1e-3 * section.size() && amplitude < before);
        const bool slow = std::abs(amplitude - before) < (k % 100 == 0 ? 1e-2 : 1e-4) * amplitude;
        if (!dies && slow && cycle_of_two(fine, section, std::max(tolerance, 1e-13), y)) return;
      }
      died += dies;
      seen += from + (dies ? "dies out" : "settles on no cycle, its size still " + rounded_text(amplitude));
    } catch (const Failure& e) {
      seen += from + "ends so: " + e.what();
    }
    if (!unstable && died == 2) break;
  }
  nothing_oscillates(o, std::string(unstable ? " is unstable to waves of this speed, but no cycle was reached"
                                             : " is stable to waves of this speed") + seen);
}

// The point of the section f = v, f' > 0 from which the map returns to itself.
void find_cycle(const Oscillator& o, double r2, double tolerance, double* y) {
  const Section section(o);
  if (o.dim() == 3) return settle(o, r2, section, tolerance, y);
  ReturnMap coarse(o, r2, std::max(tolerance, 1e-8)), fine(o, r2, tolerance);
  const bool unstable = o.sliding_unstable(r2);
  section.start(section.size(), y);
  double amplitude = section.size();
  for (int k = 0; k < 4; ++k) {  // then Newton's method
    coarse(y, nullptr, nullptr);
    const double before = amplitude;
    amplitude = section.distance(y);
    if (amplitude < 1e-7 * section.size() || (!unstable && amplitude < 1e-3 * section.size() && amplitude < before))
      nothing_oscillates(o, " is stable, and slips die out to it");
    if (std::abs(amplitude - before) < 1e-4 * amplitude) break;
  }
  section.start(cycle_of_one(o, r2, fine, section, amplitude, tolerance), y);
}

}  // namespace

Orbit find_orbit(const Oscillator& o, double r2, double tolerance, int samples) {
  Orbit orbit;
  {
    // just beyond the threshold the orbit is small and gains little a turn, which rough steps would drown
    double y[max_dim], dy[max_dim], J[max_dim * max_dim];
    o.steady(y);
    o.rhs(r2, y, dy, J);
    if (std::abs(J[0]) < .1 * std::sqrt(o.K0() * o.A() / r2)) tolerance = std::min(tolerance, 1e-11);
  }
  double start[max_dim] = {};
  find_cycle(o, r2, tolerance, start);
  std::vector<Step> steps;
  double divergence, end[max_dim], before[max_dim], after[max_dim];
  std::copy(start, start + max_dim, end);
  ReturnMap map(o, r2, tolerance);
  orbit.period = map(end, &steps, &divergence);
  o.rhs(r2, start, before, nullptr);
  o.rhs(r2, end, after, nullptr);
  orbit.multiplier = std::exp(divergence) * before[0] / after[0];
  const int d = o.dim();
  orbit.dim_ = d;
  for (const Step& step : steps) {
    orbit.steps_.push_back(step.t / orbit.period);
    for (int j = 0; j <= stages; ++j) {
      const double* y = step.values + j * d;
      for (int k = 0; k < d; ++k) orbit.values_.push_back(y[k]);
      orbit.values_.push_back(o.eta(r2, y));
    }
  }
  orbit.steps_.push_back(1);
  for (int i = 0; i < samples; ++i) {
    const double phase = double(i) / samples;
    orbit.psi.push_back(orbit.psi_at(phase));
    orbit.eta.push_back(orbit.eta_at(phase));
    if (d == 3) orbit.state.push_back(orbit.state_at(phase));
  }
  return orbit;
}

void Orbit::at(double phase, double* y) const {
  phase -= std::floor(phase);
  const size_t i = std::min(size_t(std::upper_bound(steps_.begin(), steps_.end(), phase) - steps_.begin() - 1),
                            steps_.size() - 2);
  double w[stages + 1];
  dense().weights((phase - steps_[i]) / (steps_[i + 1] - steps_[i]), w);
  const int d = dim_ + 1;
  for (int k = 0; k < d; ++k) {
    y[k] = 0;
    for (int j = 0; j <= stages; ++j) y[k] += w[j] * values_[(i * (stages + 1) + size_t(j)) * size_t(d) + size_t(k)];
  }
}

double Orbit::psi_at(double phase) const {
  double y[max_dim + 1];
  at(phase, y);
  return y[0];
}
double Orbit::eta_at(double phase) const {
  double y[max_dim + 1];
  at(phase, y);
  return y[dim_];
}
double Orbit::state_at(double phase) const {
  double y[max_dim + 1];
  at(phase, y);
  return dim_ == 3 ? y[2] : 0;
}

Orbit uniform_orbit(const Scene& scene) {
  const Oscillator oscillator(scene);
  const double vc2 = 1 - scene.s_delta() / scene.A() - scene.B();
  if (Friction::of(scene.friction)->van_der_pol && scene.v * scene.v >= vc2)
    throw Failure("nothing oscillates: uniform sliding at v = " + std::to_string(scene.v) +
                  " is stable (|v| >= v_c = " + std::to_string(vc2 > 0 ? std::sqrt(vc2) : 0.) + ")");
  return find_orbit(oscillator, 1);
}

}  // namespace stickslip
