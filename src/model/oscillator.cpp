#include "stickslip/model/oscillator.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "model/return_map.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

const Scene& with_one_medium(const Scene& s) {
  if (s.medium.varies())
    throw UsageError(s.medium.profiles.begin()->first +
                     "_profile: what is asked for here needs a medium that is the same everywhere");
  return s;
}

}  // namespace

std::vector<double> joints_of(const FrictionParameters& friction) {
  std::vector<double> all;
  const Points& curve = friction.curve;
  const bool odd = !curve.empty() && curve.front().first >= 0;
  for (const auto& [velocity, force] : curve) {
    if (velocity == 0) continue;
    all.push_back(velocity);
    if (odd) all.push_back(-velocity);
  }
  return all;
}

Oscillator::Oscillator(const Scene& scene)
    : node_(with_one_medium(scene)), B_(scene.B()), c2_(scene.A() * scene.K1()), v_(scene.v) {
  const FrictionParameters& p = scene.friction;
  if (p.sticks())
    throw UsageError("friction_law " + to_string(p.law) +
                     " jumps at rest, which an oscillation passes: set friction_stick to regularised");
  friction_ = Friction::of(p);
  joints_ = joints_of(p);
  escape_ = escape_velocity(scene);
  scales_ = scales_of(scene).slip;
  if (scene.has_profile())
    throw UsageError(
        "friction_amplitude_profile: what is asked for here needs friction that is the same everywhere");
  node_.B += node_.s_delta / node_.A;
  node_.s_delta = node_.K1 = 0;
}

RatePartials Oscillator::rate(const double* y) const {
  return friction_->has_state ? friction_->rate_partials(y[0], y[2]) : RatePartials{0, 0, 0};
}

LinearPoint Oscillator::linear(double r2, const Partials& F, const RatePartials& g) const {
  LinearPoint point = node_;
  point.A /= r2;
  point.set(F, g);
  return point;
}

void Oscillator::rhs(double r2, const double* y, double* dy, double* J) const {
  const Partials F = friction_->partials(y[0], dim() == 3 ? y[2] : 0);
  const RatePartials g = rate(y);
  dy[0] = node_.A / r2 * (y[1] - node_.B * y[0] - F.F);
  dy[1] = node_.K0 * (v_ - y[0]);
  if (dim() == 3) dy[2] = g.g;
  if (J) linear(r2, F, g).block(Part::pointwise).write(dim(), J);
}

double Oscillator::eta(double r2, const double* y) const {
  const double F = friction_->force(y[0], dim() == 3 ? y[2] : 0);
  return (y[1] - node_.B * y[0] - F) / r2 + B_ * y[0] + F;
}

double Oscillator::newton_step(double r2, const double* y, const double* step, double dt) const {
  const bool state = dim() == 3;
  return friction_->newton_psi(y[0], state ? y[2] : 0, y[0] + step[0], state ? y[2] + step[2] : 0,
                               node_.B + r2 / (node_.A * dt)) -
         y[0];
}

void Oscillator::steady(double* y) const {
  const double s = dim() == 3 ? friction_->steady_state(v_) : 0;
  y[0] = v_;
  y[1] = node_.B * v_ + friction_->force(v_, s);
  if (dim() == 3) y[2] = s;
}

double Oscillator::v_c() const {
  return friction_->van_der_pol ? std::sqrt(std::max(0., 1 - node_.B)) : std::nan("");
}

bool Oscillator::sliding_unstable(double r2) const {
  double y[3];
  steady(y);
  return !linear(r2, friction_->partials(v_, dim() == 3 ? y[2] : 0), rate(y)).stable(0);
}

std::vector<double> PeriodicMotion::phases() const {
  std::vector<double> result;
  for (size_t i = 0; i < intervals(); ++i)
    for (double at : method->basis.points()) result.push_back(mesh[i] + (mesh[i + 1] - mesh[i]) * at);
  return result;
}

void PeriodicMotion::at(double phase, double* y) const {
  evaluate(*method, mesh, values.data(), oscillator->dim(), phase, y);
}

double PeriodicMotion::psi_at(double phase) const {
  double y[train_max_dim];
  at(phase, y);
  return y[0];
}

double PeriodicMotion::eta_at(double phase) const {
  double y[train_max_dim];
  at(phase, y);
  return oscillator->eta(r2, y);
}

double PeriodicMotion::state_at(double phase) const {
  double y[train_max_dim];
  at(phase, y);
  return oscillator->dim() == 3 ? y[2] : 0;
}

namespace {

constexpr int stages = train_stages, max_dim = train_max_dim;

// Points of the section f = v, f' > 0 (f' < 0 where v < 0: Oscillator::side), told apart from steady sliding:
// (z, s) about it, s in units of z.
class Section {
 public:
  explicit Section(const Oscillator& o) : d_(o.dim()), side_(o.side()) {
    o.steady(fixed_);
    size_ = std::max(std::abs(o.partials(fixed_[0], d_ == 3 ? fixed_[2] : 0).F), .1) + 1. / 3;
    of_state_ = std::copysign(size_ / o.scale(2), fixed_[d_ - 1]);
  }
  // How far out to begin: the size of the friction force, or of its range over the slips that v drives.
  double size() const { return size_; }
  // What a change of s by 1 counts as; its sign is that of s of sliding, which a mirror image turns where it
  // turns s.
  double of_state() const { return of_state_; }
  double side() const { return side_; }
  const double* sliding() const { return fixed_; }
  void start(double distance, double* y) const {
    std::copy(fixed_, fixed_ + d_, y);
    y[1] += side_ * distance;
  }
  double distance(const double* y) const { return distance(y, fixed_); }
  double distance(const double* y, const double* x) const {
    return d_ == 2 ? side_ * (y[1] - x[1]) : std::hypot(y[1] - x[1], of_state_ * (y[2] - x[2]));
  }

 private:
  int d_;
  double side_, fixed_[max_dim], size_, of_state_;
};

[[noreturn]] void nothing_oscillates(const Oscillator& o, const std::string& why) {
  throw Failure("nothing oscillates: uniform sliding at v = " + rounded_text(o.v()) + why);
}

// One coordinate a on the section: the image P(a), q(a) = ln(P(a)/a), positive inside a stable cycle and
// negative outside, and dq/d ln a, exact.
struct Gain {
  double image, q, slope;
};
Gain gain(const Oscillator& o, double r2, ReturnMap& map, const Section& section, double a) {
  double divergence, start[max_dim], end[max_dim], p[max_dim];
  section.start(a, p);
  o.rhs(r2, p, start, nullptr);
  map(p, nullptr, &divergence);
  o.rhs(r2, p, end, nullptr);
  const double image = section.distance(p), slope = std::exp(divergence) * start[0] / end[0];
  return {image, std::log(image / a), slope * a / image - 1};
}

// q is negative at both, rises at a and falls at b: a place between them where it is positive; NaN where its
// largest value is negative, too.
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

// The outermost stable cycle within a: Newton's method in ln a, kept between bounds. Beside a fold it may
// step over the stable cycle and the one that repels at once, which q shows: it rises there.
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

// Two coordinates: Newton's method with differences, as far as round-off (and kinks of the law) let it. It
// leaves y alone where it leaves its neighbourhood or does not settle.
enum class Found { none, repels, attracts };
Found cycle_of_two(ReturnMap& map, const Section& section, double tolerance, double* y) {
  const double of_state = section.of_state(), begun = section.distance(y);
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
      const double eps = 1e-5 * distance / (j == 0 ? section.side() : of_state);
      moved[1 + j] += eps;
      map(moved);
      for (int i = 0; i < 2; ++i) a[i * 2 + j] = (i == j ? 1. : 0.) - (moved[1 + i] - image[1 + i]) / eps;
    }
    for (int i = 0; i < 2; ++i) b[i] = image[1 + i] - p[1 + i];
    // of the map's derivative
    const double trace = 2 - a[0] - a[3], det = (1 - a[0]) * (1 - a[3]) - a[1] * a[2];
    if (!solve_dense(2, a, 1, b)) return Found::none;
    const double change = std::max(std::abs(b[0]), std::abs(of_state * b[1])) / distance;
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

// What became of slips of several sizes, in friction forces above sliding; of one end all its sizes.
class Outcomes {
 public:
  void add(double size, const std::string& end) {
    for (auto& [other, sizes] : ends_)
      if (other == end) {
        sizes += ", " + rounded_text(size);
        return;
      }
    ends_.emplace_back(end, rounded_text(size));
  }
  std::string text() const {
    std::string all;
    for (const auto& [end, sizes] : ends_)
      all += "; a slip that begins " + sizes + " friction forces above it " + end;
    return all;
  }

 private:
  std::vector<std::pair<std::string, std::string>> ends_;  // with sizes
};

// Turns that wander, about a cycle that repels if there is one.
class Turns {
 public:
  explicit Turns(const Section& section) : section_(section) {}
  // y follows `last` in a turn.
  void add(const double* last, const double* y) {
    Turn turn;
    std::copy(last, last + max_dim, turn.from);
    std::copy(y, y + max_dim, turn.to);
    all_.push_back(turn);
  }
  // No search begins again from those so far.
  void are_looked_at() { seen_ = std::ptrdiff_t(all_.size()); }
  // Behind the one that moved least, of those that are new.
  void least(double* y) const {
    const auto move = [&](const Turn& t) { return std::abs(section_.distance(t.to, t.from)); };
    const auto least = std::min_element(all_.begin() + seen_, all_.end(),
                                        [&](const Turn& a, const Turn& b) { return move(a) < move(b); });
    std::copy(least->to, least->to + max_dim, y);
  }
  // Between the two nearest to each other that move against each other, one of them new, as far from each as
  // it moves; false where there are none.
  bool between(double* y) const {
    double nearest = 1e300;
    for (auto b = all_.begin() + seen_; b != all_.end(); ++b)
      for (const Turn& a : all_) {
        double against = 0, move_a = 0, move_b = 0, apart = 0;
        for (int i = 1; i < max_dim; ++i) {
          const double of_a = a.to[i] - a.from[i], of_b = b->to[i] - b->from[i], gap = b->from[i] - a.from[i];
          against += of_a * of_b;
          move_a += of_a * of_a;
          move_b += of_b * of_b;
          apart += gap * gap;
        }
        if (!(against < 0 && apart < nearest)) continue;
        nearest = apart;
        const double part = 1 / (1 + std::sqrt(move_b / move_a));
        for (int i = 0; i < max_dim; ++i) y[i] = a.from[i] + part * (b->from[i] - a.from[i]);
      }
    return nearest < 1e300;
  }

 private:
  struct Turn {
    double from[max_dim], to[max_dim];
  };
  const Section& section_;
  std::vector<Turn> all_;
  std::ptrdiff_t seen_ = 0;
};

// The cycle of a problem with a state, from slips of several sizes, each followed until it settles; what
// became of every one of them is the reason of a refusal. Of uniform motion, which goes on in time, a cycle
// that repels is taken only where no slip settles on another.
void run_until_periodic(const Oscillator& o, double r2, const Section& section, double tolerance, double slip,
                        double* y) {
  // differences of 1e-5 want a map that is better than that
  ReturnMap coarse(o, r2, 1e-8), fine(o, r2, std::min(tolerance, 1e-10));
  const bool unstable = o.sliding_unstable(r2);
  Outcomes seen;
  int died = 0;
  std::vector<double> repelling;
  for (const double part : {1., .1, .01, 4.}) {
    section.start(part * slip * section.size(), y);
    try {
      double amplitude = section.distance(y), nearest[max_dim];
      Turns turns(section);
      bool dies = false;
      for (int k = 1, next_try = 1; k <= (slip > 1 ? 150 : 1000) && !dies; ++k) {
        double last[max_dim];
        std::copy(y, y + max_dim, last);
        const double before = amplitude;
        coarse(y);
        amplitude = section.distance(y);
        turns.add(last, y);
        dies = amplitude < 1e-7 * section.size() ||
               (!unstable && amplitude < 1e-3 * section.size() && amplitude < before);
        // what wanders still after many turns may do so about a cycle that repels: near where it moved least
        const bool slow = std::abs(amplitude - before) < 1e-4 * amplitude;
        if (dies || k < next_try || !(slow || k >= 60)) continue;
        const auto close = [&] { return cycle_of_two(fine, section, std::max(tolerance, 1e-13), nearest); };
        turns.least(nearest);
        Found found = close();
        if (found == Found::none && !slow && turns.between(nearest)) found = close();
        if (found == Found::attracts || (found == Found::repels && r2 != 1)) {
          std::copy(nearest, nearest + max_dim, y);
          return;
        }
        if (found == Found::repels) repelling.assign(nearest, nearest + max_dim);
        if (slow && settles_by_itself(fine, section, tolerance, y)) return;
        next_try = k + k / 4 + 1;
        turns.are_looked_at();
      }
      died += dies;
      seen.add(part * slip,
               dies ? "dies out" : "settles on no cycle, its size still " + rounded_text(amplitude));
    } catch (const Failure& e) {
      seen.add(part * slip, std::string("ends so: ") + e.what());
    }
    if ((!unstable && died == 2) || slip > 1) break;  // the outermost, if it is reached
  }
  if (!repelling.empty()) {
    std::copy(repelling.begin(), repelling.end(), y);
    return;
  }
  nothing_oscillates(o, std::string(unstable ? " is unstable to waves of this speed, but no cycle was reached"
                                             : " is stable to waves of this speed") +
                            seen.text());
}

// The point of the section from which the map returns to itself.
void find_cycle(const Oscillator& o, double r2, double tolerance, double slip, double* y) {
  const Section section(o);
  if (o.dim() == 3) return run_until_periodic(o, r2, section, tolerance, slip, y);
  ReturnMap coarse(o, r2, std::max(tolerance, 1e-8)), fine(o, r2, tolerance);
  const bool unstable = o.sliding_unstable(r2);
  section.start(slip * section.size(), y);
  double amplitude = slip * section.size();
  // then Newton's method, which from far out may pass by a cycle
  for (int k = 0; k < (slip > 1 ? 30 : 4); ++k) {
    coarse(y);
    const double before = amplitude;
    amplitude = section.distance(y);
    if (amplitude < 1e-7 * section.size() ||
        (!unstable && amplitude < 1e-3 * section.size() && amplitude < before))
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
  if (std::abs(o.v()) >= o.v_c())
    nothing_oscillates(o, " is stable (|v| >= v_c = " + rounded_text(o.v_c(), 8) + ")");
  find_cycle(o, r2, tolerance, slip, start);
  std::vector<OrbitStep> steps;
  double divergence, end[max_dim];
  std::copy(start, start + max_dim, end);
  Orbit orbit;
  orbit.period = ReturnMap(o, r2, tolerance)(end, &steps, &divergence);
  o.rhs(r2, start, before, nullptr);
  o.rhs(r2, end, after, nullptr);
  orbit.multiplier = std::exp(divergence) * before[0] / after[0];
  orbit.r2 = r2;
  orbit.oscillator = std::make_shared<const Oscillator>(o);
  orbit.method = &Collocation::radau5();
  for (const OrbitStep& step : steps) {
    orbit.mesh.push_back(step.t / orbit.period);
    orbit.values.insert(orbit.values.end(), step.values, step.values + (stages + 1) * o.dim());
  }
  orbit.mesh.push_back(1);
  return orbit;
}

Orbit uniform_orbit(const Scene& scene) { return find_orbit(Oscillator(scene), 1); }

namespace {

// The part of its amplitude that a small oscillation about stable sliding loses in a turn; NaN where it makes
// none.
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
  const bool unstable = o.sliding_unstable(1);
  if (unstable && std::isinf(o.escape())) return true;  // there is nothing to settle on
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
      if (amplitude < 1e-3 * section.size() && lost > 0) return unstable;
      still = std::abs(section.distance(y, last)) < settled * amplitude ? still + 1 : 0;
      if (still >= 2 && !(std::abs(lost) > .1 * small)) return true;
      // as a small oscillation: it dies out. Towards a cycle the turns lose less and less.
      const bool alike = std::abs(lost / small - 1) < .1 && std::abs(lost / lost_before - 1) < .01;
      like_small = alike ? like_small + 1 : 0;
      if (like_small == sure) return unstable;
    }
  } catch (const Failure&) {  // sliding is reached without another turn
    return false;
  }
  return true;  // neither dies out nor repeats
}

}  // namespace stickslip
