#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/model/oscillator.hpp"

namespace stickslip {

namespace {

constexpr int stages = train_stages, max_dim = train_max_dim;

const Collocation& radau() { return Collocation::radau5(); }

struct Step {
  double t, h;
  double values[(stages + 1) * max_dim];  // at 0 and the stages
};

// The polynomial of a step with d components, by weights for its points.
void combine(const Step& step, int d, const double* weights, double* y) {
  for (int k = 0; k < d; ++k) {
    y[k] = 0;
    for (int j = 0; j <= stages; ++j) y[k] += weights[j] * step.values[j * d + k];
  }
}

class Integrator {
 public:
  Integrator(const Oscillator& oscillator, double r2, double tolerance)
      : o_(oscillator), r2_(r2), tolerance_(tolerance), d_(oscillator.dim()) {
    radau().basis.derivative_weights(test_point, slope_);
    radau().basis.weights(test_point, value_);
  }

  // One step of size h from y. False where Newton's method fails. It starts from the polynomial of the step `near`,
  // which begins `offset` of its length before y (null: from y). `error`: of the dense output against the tolerance.
  bool try_step(const double* y, double h, const Step* near, double offset, Step& step, double& error) {
    step.h = h;
    std::copy(y, y + d_, step.values);
    for (int i = 0; i < stages; ++i) {
      double* stage = step.values + (i + 1) * d_;
      if (near) {
        double w[stages + 1];
        radau().basis.weights(offset + radau().c[size_t(i)] * h / near->h, w);
        combine(*near, d_, w, stage);
      } else {
        std::copy(y, y + d_, stage);
      }
    }
    if (!solve_stages(step)) return false;
    error = defect(step);
    return std::isfinite(error);
  }

  // Advances y, t by one accepted step.
  void step(double& t, double* y, double& h, Step& out) {
    for (int attempt = 0; attempt < 200; ++attempt) {
      double error = 0;
      if (!try_step(y, h, have_last_ ? &last_ : nullptr, 1, out, error)) {
        if (!(have_last_ && at_rest_)) h /= 4;
        have_last_ = have_last_ && !at_rest_ && attempt < 2;
        continue;
      }
      const double factor = std::min(4., std::max(.2, .85 * std::pow(std::max(error, 1e-12), -1. / (stages + 1))));
      const double taken = h;
      h *= factor;
      if (error > 1) continue;
      out.t = t;
      t += taken;
      std::copy(out.values + stages * d_, out.values + (stages + 1) * d_, y);
      last_ = out;
      have_last_ = true;
      return;
    }
    throw Failure("the oscillation's integrator cannot go on: step " + std::to_string(h));
  }

  void restart() { have_last_ = at_rest_ = false; }
  // From now on psi may be all but zero, held there by friction so steep that Newton's own steps shoot through zero, and
  // that what is extrapolated from the last step is noise.
  void at_rest() { at_rest_ = o_.steep(); }

 private:
  bool solve_stages(Step& step) const {
    const int d = d_, n = stages * d;
    const double* y = step.values;
    double *stage = step.values + d, previous = 0;
    for (int iteration = 0; iteration < 12; ++iteration) {
      double G[stages * max_dim], J[stages * max_dim * max_dim];
      for (int i = 0; i < stages; ++i) o_.rhs(r2_, stage + i * d, G + i * d, J + i * d * d);
      double a[stages * max_dim * stages * max_dim], b[stages * max_dim];
      stage_matrix(radau(), d, step.h, J, a);
      for (int i = 0; i < n; ++i) {
        b[i] = y[i % d] - stage[i];
        for (int j = 0; j < stages; ++j) b[i] += step.h * radau().a[size_t(i / d * stages + j)] * G[j * d + i % d];
      }
      if (!solve_dense(n, a, 1, b)) return false;
      if (at_rest_)
        for (int i = 0; i < stages; ++i)
          b[i * d] = o_.newton_step(r2_, stage + i * d, b + i * d, step.h * radau().a[size_t(i * stages + i)]);
      double norm = 0;
      for (int i = 0; i < n; ++i) {
        stage[i] += b[i];
        norm = std::max(norm, std::abs(b[i]) / (1 + std::abs(stage[i])));
      }
      if (!std::isfinite(norm)) return false;
      if (norm < 1e-14 || (norm < 1e-10 && iteration > 0 && norm > previous / 4)) return true;
      if (iteration > 2 && norm > 2 * previous) return false;
      previous = norm;
    }
    return false;
  }

  // The defect of the polynomial between the stages against the tolerance, filtered so that stiff directions do not
  // exaggerate it.
  double defect(const Step& step) const {
    double u[max_dim], e[max_dim], g[max_dim], J[max_dim * max_dim], error = 0;
    combine(step, d_, value_, u);
    combine(step, d_, slope_, e);
    o_.rhs(r2_, u, g, J);
    for (int k = 0; k < d_; ++k) e[k] = filter * (e[k] - step.h * g[k]);
    for (int k = 0; k < d_ * d_; ++k) J[k] = (k % (d_ + 1) == 0 ? 1. : 0.) - filter * step.h * J[k];
    if (!solve_dense(d_, J, 1, e)) return std::nan("");
    for (int k = 0; k < d_; ++k) error = std::max(error, std::abs(e[k]) / (tolerance_ * (1 + std::abs(u[k]))));
    return error;
  }

  static constexpr double test_point = .5 * 0.85, filter = .15;
  const Oscillator& o_;
  double r2_, tolerance_;
  int d_;
  double slope_[stages + 1], value_[stages + 1];
  Step last_;
  bool have_last_ = false, at_rest_ = false;
};

// From y on the section f = v to the next passage of f = v upwards; y becomes the point there, the time is returned.
// Steps (the last cut at the section) are appended where asked for. `divergence`: integral of the trace of J.
class ReturnMap {
 public:
  ReturnMap(const Oscillator& o, double r2, double tolerance) : o_(o), r2_(r2), integrator_(o, r2, tolerance) {}

  double operator()(double* y, std::vector<Step>* steps = nullptr, double* divergence = nullptr) {
    const int d = o_.dim();
    integrator_.restart();
    double t = 0, g[max_dim], scale = 0;
    o_.rhs(r2_, y, g, nullptr);
    for (int k = 0; k < d; ++k) scale = std::max(scale, std::abs(g[k]) / (1 + std::abs(y[k])));
    double h = .01 / std::max(scale, 1e-6);
    bool below = false;
    if (divergence) *divergence = 0;
    constexpr long many_steps = 2000;  // a turn takes some hundred
    for (long count = 0; count < 200000 && t <= 1e9 / std::sqrt(o_.K0() * o_.A()); ++count) {
      if (count == many_steps) integrator_.at_rest();
      Step step;
      integrator_.step(t, y, h, step);
      const bool passed = below && y[0] >= o_.v();
      if (passed) cut_at_section(step, y);
      add(step, steps, divergence);
      if (passed) return step.t + step.h;
      below = below || y[0] < o_.v();
    }
    throw Failure("nothing oscillates: the motion settles without passing the plate velocity again");
  }

 private:
  // The passage lies in this step: found on the polynomial, then a step is made to end there.
  void cut_at_section(Step& step, double* y) {
    const int d = o_.dim();
    const auto above = [&](double part) {
      double w[stages + 1], at[max_dim];
      radau().basis.weights(part, w);
      combine(step, d, w, at);
      return at[0] - o_.v();
    };
    double end = find_root(above, {0, step.values[0] - o_.v(), 1, y[0] - o_.v()}, 1e-15) * step.h, error;
    Step cut;
    double* last = cut.values + stages * d;
    for (int k = 0; k < 6; ++k) {
      if (!integrator_.try_step(step.values, end, &step, 0, cut, error))
        throw Failure("the oscillation's integrator cannot go on at the section");
      double slope[max_dim];
      o_.rhs(r2_, last, slope, nullptr);
      const double correction = (o_.v() - last[0]) / slope[0];
      if (std::abs(correction) <= 1e-15 * step.h) break;
      end += correction;
    }
    cut.t = step.t;
    step = cut;
    std::copy(last, last + d, y);
    y[0] = o_.v();
  }

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
  double distance(const double* y) const { return distance(y, fixed_); }
  double distance(const double* y, const double* x) const {
    return d_ == 2 ? y[1] - x[1] : std::hypot(y[1] - x[1], size_ * (y[2] - x[2]));
  }

 private:
  int d_;
  double fixed_[max_dim], size_;
};

[[noreturn]] void nothing_oscillates(const Oscillator& o, const std::string& why) {
  throw Failure("nothing oscillates: uniform sliding at v = " + rounded_text(o.v()) + why);
}

// One coordinate a on the section: the image P(a), q(a) = ln(P(a)/a), positive inside a stable cycle and negative outside,
// and dq/d ln a, exact.
struct Gain {
  double image, q, slope;
};
Gain gain(const Oscillator& o, double r2, ReturnMap& map, const Section& section, double a) {
  const double* fixed = section.sliding();
  double divergence, start[max_dim], end[max_dim], p[max_dim] = {fixed[0], fixed[1] + a, 0};
  o.rhs(r2, p, start, nullptr);
  map(p, nullptr, &divergence);
  o.rhs(r2, p, end, nullptr);
  const double image = p[1] - fixed[1], slope = std::exp(divergence) * start[0] / end[0];
  return {image, std::log(image / a), slope * a / image - 1};
}

// q is negative at both, rises at a and falls at b: a place between them where it is positive; NaN where its largest
// value is negative, too.
template <class GainAt>
double where_it_grows(GainAt&& gain_at, double a, double b) {
  while (b > a * (1 + 1e-7)) {
    const double middle = std::sqrt(a * b);
    const Gain g = gain_at(middle);
    if (g.q > 0) return middle;
    (g.slope > 0 ? a : b) = middle;
  }
  return std::nan("");
}

// The outermost stable cycle within a: Newton's method in ln a, kept between bounds. Beside a fold it may step over the stable
// cycle and the one that repels at once, which q shows: it rises there.
double cycle_of_one(const Oscillator& o, double r2, ReturnMap& map, const Section& section, double a,
                    double tolerance) {
  const double* fixed = section.sliding();
  double low = 0, high = 1e300, falling = 0;
  for (int k = 0; k < 100; ++k) {
    const auto [image, q, dq] = gain(o, r2, map, section, a);
    if (q < 0 && dq > 0 && low == 0 && falling > a) {
      low = where_it_grows([&](double at) { return gain(o, r2, map, section, at); }, a, falling);
      if (low > 0) {
        a = low;
        high = falling;
        continue;
      }
      low = falling = 0;
    }
    if (q < 0 && dq < 0) falling = a;
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

// Two coordinates: Newton's method with differences, as far as round-off (and kinks of the law) let it. It leaves y alone
// where it leaves its neighbourhood or does not settle.
enum class Found { none, repels, attracts };
Found cycle_of_two(ReturnMap& map, const Section& section, double tolerance, double* y) {
  const double size = section.size(), begun = section.distance(y);
  double last_change = 1e300, p[max_dim];
  std::copy(y, y + max_dim, p);
  for (int k = 0; k < 30; ++k) {
    double image[max_dim], a[4], b[2];
    const double distance = section.distance(p);
    if (!(distance > .2 * begun && distance < 5 * begun)) return Found::none;
    std::copy(p, p + max_dim, image);
    map(image);
    for (int j = 0; j < 2; ++j) {
      double moved[max_dim];
      std::copy(p, p + max_dim, moved);
      const double eps = 1e-5 * distance / (j == 0 ? 1 : size);
      moved[1 + j] += eps;
      map(moved);
      for (int i = 0; i < 2; ++i) a[i * 2 + j] = (i == j ? 1. : 0.) - (moved[1 + i] - image[1 + i]) / eps;
    }
    for (int i = 0; i < 2; ++i) b[i] = image[1 + i] - p[1 + i];
    const double trace = 2 - a[0] - a[3], det = (1 - a[0]) * (1 - a[3]) - a[1] * a[2];  // of the map's derivative
    if (!solve_dense(2, a, 1, b)) return Found::none;
    const double change = std::max(std::abs(b[0]), size * std::abs(b[1])) / distance;
    p[1] += b[0];
    p[2] += b[1];
    if (change < tolerance || (change < 1e-8 && change > .3 * last_change)) {
      std::copy(p, p + max_dim, y);
      return det < 1 && std::abs(trace) < 1 + det ? Found::attracts : Found::repels;
    }
    last_change = change;
  }
  return Found::none;
}

// Turn upon turn, where a kink of the law keeps Newton's method from its goal: false where 50 do not settle.
bool settles_by_itself(ReturnMap& map, const Section& section, double tolerance, double* y) {
  for (int k = 0; k < 50; ++k) {
    double before[max_dim];
    std::copy(y, y + max_dim, before);
    map(y);
    if (std::abs(section.distance(y, before)) <= std::max(tolerance, 1e-8) * section.distance(y)) return true;
  }
  return false;
}

// The cycle of a problem with a state, from slips of several sizes, each followed until it settles; what became of
// every one of them is the reason of a refusal. Of uniform motion, which goes on in time, a cycle that repels is taken
// only where no slip settles on another.
void settle(const Oscillator& o, double r2, const Section& section, double tolerance, double slip, double* y) {
  // differences of 1e-5 want a map that is better than that
  ReturnMap coarse(o, r2, 1e-8), fine(o, r2, std::min(tolerance, 1e-10));
  const bool unstable = o.sliding_unstable(r2);
  std::string seen;
  int died = 0;
  std::vector<double> repelling;
  for (const double part : {1., .1, .01, 4.}) {
    section.start(part * slip * section.size(), y);
    const std::string from = "; a slip that begins " + rounded_text(part * slip) + " friction forces above it ";
    try {
      double amplitude = section.distance(y), least_move = 1e300, nearest[max_dim];
      bool dies = false;
      for (int k = 1, next_try = 1; k <= (slip > 1 ? 150 : 1000) && !dies; ++k) {
        double last[max_dim];
        std::copy(y, y + max_dim, last);
        const double before = amplitude;
        coarse(y);
        amplitude = section.distance(y);
        if (const double move = std::abs(section.distance(y, last)); move < least_move) {
          least_move = move;
          std::copy(y, y + max_dim, nearest);
        }
        dies = amplitude < 1e-7 * section.size() ||
               (!unstable && amplitude < 1e-3 * section.size() && amplitude < before);
        // what wanders still after many turns may do so about a cycle that repels: near where it moved least
        const bool slow = std::abs(amplitude - before) < 1e-4 * amplitude;
        if (dies || k < next_try || !(slow || k >= 60)) continue;
        const Found found = cycle_of_two(fine, section, std::max(tolerance, 1e-13), nearest);
        if (found == Found::attracts || (found == Found::repels && r2 != 1)) {
          std::copy(nearest, nearest + max_dim, y);
          return;
        }
        if (found == Found::repels) repelling.assign(nearest, nearest + max_dim);
        if (slow && settles_by_itself(fine, section, tolerance, y)) return;
        next_try = k + k / 4 + 1;
        least_move = 1e300;
      }
      died += dies;
      seen += from + (dies ? "dies out" : "settles on no cycle, its size still " + rounded_text(amplitude));
    } catch (const Failure& e) {
      seen += from + "ends so: " + e.what();
    }
    if ((!unstable && died == 2) || slip > 1) break;  // the outermost, if it is reached
  }
  if (!repelling.empty()) {
    std::copy(repelling.begin(), repelling.end(), y);
    return;
  }
  nothing_oscillates(o, std::string(unstable ? " is unstable to waves of this speed, but no cycle was reached"
                                             : " is stable to waves of this speed") + seen);
}

// The point of the section f = v, f' > 0 from which the map returns to itself.
void find_cycle(const Oscillator& o, double r2, double tolerance, double slip, double* y) {
  const Section section(o);
  if (o.dim() == 3) return settle(o, r2, section, tolerance, slip, y);
  ReturnMap coarse(o, r2, std::max(tolerance, 1e-8)), fine(o, r2, tolerance);
  const bool unstable = o.sliding_unstable(r2);
  section.start(slip * section.size(), y);
  double amplitude = slip * section.size();
  for (int k = 0; k < (slip > 1 ? 30 : 4); ++k) {  // then Newton's method, which from far out may pass by a cycle
    coarse(y);
    const double before = amplitude;
    amplitude = section.distance(y);
    if (amplitude < 1e-7 * section.size() || (!unstable && amplitude < 1e-3 * section.size() && amplitude < before))
      nothing_oscillates(o, " is stable, and slips die out to it");
    if (std::abs(amplitude - before) < 1e-4 * amplitude) break;
  }
  section.start(cycle_of_one(o, r2, fine, section, amplitude, tolerance), y);
}

}  // namespace

Orbit find_orbit(const Oscillator& o, double r2, double tolerance, double slip) {
  double start[max_dim] = {}, J[max_dim * max_dim], before[max_dim], after[max_dim];
  // just beyond the threshold the orbit is small and gains little a turn, which rough steps would drown
  o.steady(start);
  o.rhs(r2, start, before, J);
  if (std::abs(J[0]) < .1 * std::sqrt(o.K0() * o.A() / r2)) tolerance = std::min(tolerance, 1e-11);
  if (std::abs(o.v()) >= o.v_c()) nothing_oscillates(o, " is stable (|v| >= v_c = " + rounded_text(o.v_c(), 8) + ")");
  find_cycle(o, r2, tolerance, slip, start);
  std::vector<Step> steps;
  double divergence, end[max_dim];
  std::copy(start, start + max_dim, end);
  Orbit orbit;
  orbit.period = ReturnMap(o, r2, tolerance)(end, &steps, &divergence);
  o.rhs(r2, start, before, nullptr);
  o.rhs(r2, end, after, nullptr);
  orbit.multiplier = std::exp(divergence) * before[0] / after[0];
  orbit.r2 = r2;
  orbit.oscillator = std::make_shared<const Oscillator>(o);
  orbit.method = &radau();
  for (const Step& step : steps) {
    orbit.mesh.push_back(step.t / orbit.period);
    orbit.values.insert(orbit.values.end(), step.values, step.values + (stages + 1) * o.dim());
  }
  orbit.mesh.push_back(1);
  return orbit;
}

Orbit uniform_orbit(const Scene& scene) {
  return find_orbit(Oscillator(scene), 1);
}

namespace {

// The part of its amplitude that a small oscillation about stable sliding loses in a turn; NaN where it makes none.
double lost_by_small(ReturnMap& map, const Section& section) {
  double y[max_dim], amplitude = 0, before = 0;
  section.start(1e-3 * section.size(), y);
  try {
    for (int turn = 0; turn < 3; ++turn) {  // the first may be of modes that die out faster
      map(y);
      before = amplitude;
      amplitude = section.distance(y);
    }
  } catch (const Failure&) {
    return std::nan("");
  }
  return 1 - amplitude / before;
}

}  // namespace

bool strong_slips_last(const Oscillator& o) {
  constexpr double strong = 10, settled = 1e-4;  // friction forces above sliding; change of a turn, relative
  constexpr int most_turns = 200, sure = 3;
  if (std::abs(o.v()) >= o.v_c()) return false;
  if (o.sliding_unstable(1)) return true;  // there is nothing to settle on
  const Section section(o);
  ReturnMap map(o, 1, 1e-5);
  const double small = lost_by_small(map, section);
  double y[max_dim];
  section.start(strong * section.size(), y);
  double amplitude = section.distance(y), lost = 0;
  try {
    for (int turn = 0, still = 0, like_small = 0; turn < most_turns; ++turn) {
      double last[max_dim];
      std::copy(y, y + max_dim, last);
      const double before = amplitude, lost_before = lost;
      map(y);
      amplitude = section.distance(y);
      lost = 1 - amplitude / before;
      if (amplitude < 1e-3 * section.size() && lost > 0) return false;
      still = std::abs(section.distance(y, last)) < settled * amplitude ? still + 1 : 0;
      if (still >= 2 && !(std::abs(lost) > .1 * small)) return true;
      // as a small oscillation: it dies out. Towards a cycle the turns lose less and less.
      const bool alike = std::abs(lost / small - 1) < .1 && std::abs(lost / lost_before - 1) < .01;
      like_small = alike ? like_small + 1 : 0;
      if (like_small == sure) return false;
    }
  } catch (const Failure&) {  // sliding is reached without another turn
    return false;
  }
  return true;  // neither dies out nor repeats
}

}  // namespace stickslip
