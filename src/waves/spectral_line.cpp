
#include "waves/spectral_line.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

using Complex = std::complex<double>;
constexpr double spacing = .7;       // of samples, in radians of the slowest wave over a period
constexpr double longest_move = .8;  // of ln rho between samples
constexpr double of_interest = -.3;  // ln |y| from which on multipliers are told apart

}  // namespace

// Most samples that a line takes besides `even` even ones; such as match take some times as many.
double added_samples(double even) { return 1000 + 10 * even; }

Complex apart(Complex a, Complex b) {  // of logarithms
  return {a.real() - b.real(), std::remainder(a.imag() - b.imag(), 2 * M_PI)};
}

// The multiplier nearest to `log_rho`; how near it and the next nearest are.
int nearest(const Multipliers& m, Complex log_rho, double& distance, double& second) {
  int best = 0;
  distance = second = 1e300;
  for (int j = 0; j < m.count; ++j) {
    const double d = std::abs(apart(m.log_rho[j], log_rho));
    if (d < distance) {
      second = distance;
      distance = d;
      best = j;
    } else {
      second = std::min(second, d);
    }
  }
  return best;
}

int nearest(const Multipliers& m, Complex log_rho) {
  double distance, second;
  return nearest(m, log_rho, distance, second);
}

SpectralLine::SpectralLine(Transfer& transfer, double sigma)
    : transfer_(transfer), sigma_(sigma), top_(0), period_(transfer.train().period) {
  const Train& train = transfer.train();
  top_ = transfer.top_frequency(sigma) * std::abs(train.speed) / std::sqrt(train.oscillator->c2());
  double louder = 0;
  closed_ = quiet_beyond(louder);
  if (!closed_ && louder < 3 * top_) {
    top_ = 1.3 * louder;
    closed_ = quiet_beyond(louder);
  }
  if (!closed_) return;  // too far left: no frequency seems high enough
  scan();
  trace_arcs();
}

SpectralLine::Sample SpectralLine::sample(double omega) { return {omega, transfer_.at({sigma_, omega})}; }

double SpectralLine::size(const Sample& s, int j) const { return s.m.log_rho[j].real() - sigma_ * period_; }

bool SpectralLine::quiet_beyond(double& louder) {
  louder = 0;
  for (int k = 1; k <= 24; ++k) {  // an octave with steps that no harmonic follows, then two more
    const double omega = top_ * (k <= 16 ? 1 + (k - .38 * (k % 3)) / 16. : 2 * std::pow(2, (k - 16) / 4.));
    if (size(sample(omega), 0) > 0) louder = omega;
  }
  return louder == 0;
}

bool SpectralLine::matched(const Sample& a, const Sample& b) const {
  for (const auto& [one, other] : {std::pair(&a, &b), std::pair(&b, &a)})
    for (int j = 0; j < one->m.count; ++j) {
      if (size(*one, j) < of_interest) continue;
      double distance, second;
      nearest(other->m, one->m.log_rho[j], distance, second);
      if (distance > longest_move || second < 2 * distance) return false;
    }
  return true;
}

void SpectralLine::scan() {
  const Train& train = transfer_.train();
  const double V = std::abs(train.speed), c = std::sqrt(train.oscillator->c2());
  // ln rho turns at T c/(V + c) in Im lambda for one of the waves, at T c/(V - c) for the other, if that
  // lives at all
  const double decay =
      (sigma_ + transfer_.damping().mean / 2) * train.period * V * (1 + c / V) / (V * train.r2);
  const double rate = train.period * c / V / (decay < 3 ? train.r2 / (1 + c / V) : 1 + c / V);
  const double even = std::min(spacing / rate, top_ / 8);
  // near V = c the multipliers change with lambda over sqrt(r2 |dC/dt|), next to the passages through C = 0
  const double finest = .15 * std::sqrt(train.r2 * transfer_.damping().slope) * V / c;
  // Where multipliers are noise (round-off that fronts have amplified, near V = c) no sampling makes
  // neighbours match.
  double left = added_samples(top_ / even);
  std::vector<Sample> half{sample(0)};
  while (half.back().omega < top_) {
    const double step = std::min(even, std::max(finest, half.back().omega / 4));
    std::vector<Sample> ahead{sample(std::min(top_, half.back().omega + step))};
    while (!ahead.empty()) {
      const double gap = ahead.back().omega - half.back().omega;
      const bool same = matched(half.back(), ahead.back());
      if (same || gap < 1e-10 * top_ || left-- <= 0) {
        closed_ = closed_ && same;
        half.push_back(ahead.back());
        ahead.pop_back();
      } else {
        ahead.push_back(sample(half.back().omega + gap / 2));
      }
    }
  }
  for (size_t k = half.size(); k-- > 1;) {  // the equations are real
    Sample mirrored = half[k];
    mirrored.omega = -mirrored.omega;
    for (Complex& l : mirrored.m.log_rho) l = std::conj(l);
    samples_.push_back(mirrored);
  }
  samples_.insert(samples_.end(), half.begin(), half.end());
}

// Where multiplier i at a, j at b passes the unit circle between them. Phase as of itself alone.
ArcPoint SpectralLine::crossing(const Sample& a, int i, const Sample& b, int j) {
  const Complex from = a.m.log_rho[i], move = apart(b.m.log_rho[j], from);
  Complex found;
  const auto outside = [&](double omega) {
    const Multipliers m = transfer_.at({sigma_, omega});
    found = m.log_rho[nearest(m, from + move * (omega - a.omega) / (b.omega - a.omega))];
    return found.real() - sigma_ * period_;
  };
  const double at = find_root(outside, {a.omega, size(a, i), b.omega, size(b, j)}, 1e-7 / period_);
  outside(at);
  return {at, {0, from.imag() + apart(found, from).imag() - at * period_}};
}

void SpectralLine::trace_arcs() {
  struct Open {
    int root;
    Arc arc;
  };
  std::vector<Open> open;
  const auto point = [&](const Sample& s, int j) {
    return ArcPoint{s.omega, {size(s, j), s.m.log_rho[j].imag() - s.omega * period_}};
  };
  for (int j = 0; j < samples_[0].m.count; ++j)
    if (size(samples_[0], j) > 0) open.push_back({j, {point(samples_[0], j)}});
  for (size_t k = 1; k < samples_.size(); ++k) {
    const Sample &a = samples_[k - 1], &b = samples_[k];
    std::vector<Open> still;
    bool taken[train_max_dim] = {};
    // on along an arc: the phase turns as ln rho does, less the turns of exp(-lambda T), which may be very
    // many
    const auto extend = [&](Arc& arc, ArcPoint p, Complex log_rho, Complex before, double omega_before) {
      const double turn = apart(log_rho, before).imag() - (p.omega - omega_before) * period_;
      p.log_y = {p.log_y.real(), arc.back().log_y.imag() + turn};
      arc.push_back(p);
    };
    for (Open& o : open) {
      const Complex before = a.m.log_rho[o.root];
      const int j = nearest(b.m, before);
      if (size(b, j) > 0 && !taken[j]) {
        taken[j] = true;
        extend(o.arc, point(b, j), b.m.log_rho[j], before, a.omega);
        still.push_back({j, std::move(o.arc)});
      } else {
        const ArcPoint end = crossing(a, o.root, b, j);
        extend(o.arc, end, {0, end.log_y.imag() + end.omega * period_}, before, a.omega);
        arcs_.push_back(std::move(o.arc));
      }
    }
    for (int j = 0; j < b.m.count; ++j) {
      if (taken[j] || size(b, j) <= 0) continue;
      const int i = nearest(a.m, b.m.log_rho[j]);
      const ArcPoint begin = crossing(a, i, b, j);
      Arc arc{begin};
      extend(arc, point(b, j), b.m.log_rho[j], {0, begin.log_y.imag() + begin.omega * period_}, begin.omega);
      still.push_back({j, std::move(arc)});
    }
    open = std::move(still);
  }
  for (Open& o : open) {
    arcs_.push_back(std::move(o.arc));
    closed_ = false;
  }
}

ModeRange modes_between(double first, double last, PetscInt pulses) {
  const double per = double(pulses) / (2 * M_PI);
  return {(long long)std::ceil(last * per), (long long)std::floor(first * per)};
}

ModeRange modes_of(const Arc& arc, PetscInt pulses) {
  return modes_between(arc.front().log_y.imag(), arc.back().log_y.imag(), pulses);
}

long long SpectralLine::count(PetscInt pulses) const {
  long long sum = 0;
  for (const Arc& arc : arcs_) {
    const ModeRange range = modes_of(arc, pulses);
    sum += range.hi - range.lo + 1;
  }
  return sum;
}

long long SpectralLine::count(PetscInt pulses, PetscInt m) const {
  const auto below = [&](long long M) {  // how many of the numbers of class m are <= M, from some start
    const long long shifted = M - m;
    return shifted >= 0 ? shifted / pulses : -((-shifted + pulses - 1) / pulses);
  };
  long long sum = 0;
  for (const Arc& arc : arcs_) {
    const ModeRange range = modes_of(arc, pulses);
    sum += below(range.hi) - below(range.lo - 1);
  }
  return sum;
}

namespace {

using std::size_t;
using Complex = std::complex<double>;
constexpr double longest_turn = .6;   // of ln rho in a step along a curve
constexpr double farthest_off = .01;  // of ln rho, from what its slopes say
constexpr double landed = 1e-8;       // of a curve that is back on the line, times the period
constexpr double same_end = 1e-3;     // of ln rho and the phase, at the end of an arc
constexpr size_t most_points = 20000;

Complex along(const CurvePoint& p, double T) { return Complex(0, 1) / (p.slope - T); }  // d lambda/d phase

// lambda a part of the way in phase from one point to the next: Hermite's cubic.
Complex between(const CurvePoint& a, const CurvePoint& b, double part, double T) {
  const double h = b.phase(T) - a.phase(T), rest = 1 - part;
  return rest * rest * ((1 + 2 * part) * a.lambda + part * h * along(a, T)) +
         part * part * ((1 + 2 * rest) * b.lambda - rest * h * along(b, T));
}

// d ln rho/d lambda, by a difference over `step`.
Complex slope_at(Transfer& transfer, Complex lambda, Complex log_rho, Complex step) {
  const Multipliers m = transfer.at(lambda + step);
  return apart(m.log_rho[nearest(m, log_rho)], log_rho) / step;
}

// A step by `turn` of the phase. False where it does not lead where it should: what ln rho has gained must be
// what its slopes at both ends say, up to the third order in the step. `off`: by how much it is not.
bool advance(Transfer& transfer, CurvePoint& p, double turn, double& off) {
  CurvePoint next = p;
  if (!follow(transfer, next, p.phase(transfer.train().period) + turn, 1e-6)) return false;
  const Complex move = next.lambda - p.lambda;
  next.slope = slope_at(transfer, next.lambda, next.log_rho, 1e-3 * move);
  off = std::abs(next.log_rho - p.log_rho - (p.slope + next.slope) / 2. * move);
  if (!(off < farthest_off)) return false;
  p = next;
  return true;
}

// The place of largest growth between three points of a curve, by parabolas in the phase.
CurvePoint summit(Transfer& transfer, CurvePoint left, CurvePoint top, CurvePoint right) {
  const double T = transfer.train().period;
  for (int it = 0; it < 12; ++it) {
    const double a = left.phase(T), b = top.phase(T), c = right.phase(T);
    const double fa = left.lambda.real(), fb = top.lambda.real(), fc = right.lambda.real();
    const double p = (b - a) * (fb - fc), q = (b - c) * (fb - fa);
    if (p == q) break;
    double at = b - ((b - a) * p - (b - c) * q) / (2 * (p - q));
    if (!((at - a) * (at - c) < 0) || at == b) break;
    CurvePoint next = top;
    if (!follow(transfer, next, at, 1e-9)) break;
    const double gain = next.lambda.real() - top.lambda.real();
    if (gain > 0) {
      ((at - b) * (c - b) > 0 ? left : right) = top;
      top = next;
    } else {
      ((at - b) * (c - b) > 0 ? right : left) = next;
    }
    if (std::abs(gain) < 1e-11) break;
  }
  return top;
}

// Puts the place of largest growth beside every point that has more of it than its neighbours.
void add_summits(Transfer& transfer, SpectralCurve& curve) {
  const std::vector<CurvePoint> points = std::move(curve.points);
  curve.points = points;
  std::vector<CurvePoint> with;
  for (size_t k = 0; k < points.size(); ++k) {
    if (!curve.is_summit(k)) {
      with.push_back(points[k]);
      continue;
    }
    const CurvePoint top = summit(transfer, points[k - 1], points[k], points[k + 1]);
    const double T = transfer.train().period, passed = points[k].phase(T) - top.phase(T);
    if (passed < 0) with.push_back(top);
    with.push_back(points[k]);
    if (passed > 0) with.push_back(top);
  }
  curve.points = std::move(with);
}

class Tracer {
 public:
  Tracer(Transfer& transfer, const SpectralLine& line, double longest)
      : transfer_(transfer), arcs_(line.arcs()), sigma_(line.sigma()), T_(transfer.train().period),
        longest_(longest), begun_(arcs_.size(), false), ended_(arcs_.size(), false) {
    found_.whole = line.closed();
    double turned = 0, turned_by_arcs = 0;
    for (size_t k = 0; k < arcs_.size(); ++k) turned_by_arcs += turn_of(arcs_[k]);
    for (size_t k = 0; k < arcs_.size(); ++k) {
      if (begun_[k]) continue;
      begun_[k] = true;
      SpectralCurve curve;
      const size_t end = trace(k, curve.points);
      if (end == none || ended_[end]) {
        found_.whole = false;
        continue;
      }
      ended_[end] = true;
      mark_image(k, end, curve);
      turned += (curve.points.front().phase(T_) - curve.points.back().phase(T_)) * (curve.has_image ? 2 : 1);
      found_.list.push_back(std::move(curve));
    }
    if (!(std::abs(turned - turned_by_arcs) < same_end * (1 + double(arcs_.size())) + 1e-9 * turned_by_arcs))
      found_.whole = false;
  }
  SpectralCurves found() { return std::move(found_); }

 private:
  static constexpr size_t none = size_t(-1);
  static double turn_of(const Arc& arc) { return arc.front().log_y.imag() - arc.back().log_y.imag(); }

  CurvePoint start(const Arc& arc) {
    const Complex lambda(sigma_, arc[0].omega), log_rho = arc[0].log_y + lambda * T_;
    const Complex step(0, 1e-3 * (arc[1].omega - arc[0].omega));
    return {lambda, log_rho, slope_at(transfer_, lambda, log_rho, step)};
  }

  // From the beginning of an arc until the curve is back on the line. The arc whose end this is, or `none`.
  size_t trace(size_t k, std::vector<CurvePoint>& points) {
    points = {start(arcs_[k])};
    double step = std::max(turn_of(arcs_[k]) / 8, 1e-6);
    while (points.size() < most_points) {
      CurvePoint next = points.back();
      const double limit = longest_ / (std::abs(next.slope * along(next, T_)) + 1e-12);
      step = std::min(step, limit);
      if (step < 1e-9 * limit) return none;
      double off;
      if (!advance(transfer_, next, -step, off)) {
        step /= 2;
      } else if (next.lambda.real() > sigma_ && dips(points.back(), next)) {
        step /= 2;
      } else if (next.lambda.real() > sigma_) {
        points.push_back(next);
        step *= off < farthest_off / 10 ? 2 : off < farthest_off / 3 ? 1.3 : 1;
      } else if (points.size() == 1) {  // over the whole curve at once
        step /= 2;
      } else {
        return land(points, next) ? end_at(points.back()) : none;
      }
    }
    return none;
  }

  // Whether the curve passes left of the line between two points right of it.
  bool dips(const CurvePoint& a, const CurvePoint& b) const {
    constexpr int parts = 8;
    for (int k = 1; k < parts; ++k)
      if (between(a, b, double(k) / parts, T_).real() < sigma_) return true;
    return false;
  }

  // The point between the last one and one left of the line that lies on it.
  bool land(std::vector<CurvePoint>& points, const CurvePoint& beyond) {
    const CurvePoint before = points.back();
    double inside = 0, outside = beyond.phase(T_) - before.phase(T_);
    double f_inside = before.lambda.real() - sigma_, f_outside = beyond.lambda.real() - sigma_;
    CurvePoint at = beyond;
    for (int it = 0; it < 40 && std::abs(at.lambda.real() - sigma_) * T_ > landed; ++it) {
      const double cut = std::clamp(f_inside / (f_inside - f_outside), .05, .95);
      const double turn = it % 3 == 2 ? (inside + outside) / 2 : inside + (outside - inside) * cut;
      at = before;
      if (!follow(transfer_, at, before.phase(T_) + turn, 1e-9)) return false;
      const double f = at.lambda.real() - sigma_;
      (f > 0 ? inside : outside) = turn;
      (f > 0 ? f_inside : f_outside) = f;
      if (std::abs(outside - inside) < 1e-13 * (1 + std::abs(before.phase(T_)))) break;
    }
    points.push_back(at);
    return true;
  }

  size_t end_at(const CurvePoint& p) const {
    for (size_t k = 0; k < arcs_.size(); ++k) {
      const ArcPoint& end = arcs_[k].back();
      const Complex log_rho = end.log_y + Complex(sigma_, end.omega) * T_;
      if (std::abs(p.lambda.imag() - end.omega) * T_ < same_end &&
          std::abs(apart(p.log_rho, log_rho)) < same_end)
        return k;
    }
    return none;
  }

  // The mirror image runs from where this curve's end is mirrored to where its beginning is.
  void mark_image(size_t first, size_t last, SpectralCurve& curve) {
    const double begins = -arcs_[last].back().omega, ends = -arcs_[first].front().omega;
    if (std::abs(begins - arcs_[first].front().omega) * T_ < same_end) return;  // its own
    for (size_t b = 0; b < arcs_.size(); ++b) {
      if (begun_[b] || std::abs(arcs_[b].front().omega - begins) * T_ > same_end) continue;
      for (size_t e = 0; e < arcs_.size(); ++e) {
        if (ended_[e] || std::abs(arcs_[e].back().omega - ends) * T_ > same_end) continue;
        begun_[b] = ended_[e] = curve.has_image = true;
        return;
      }
    }
  }

  Transfer& transfer_;
  const std::vector<Arc>& arcs_;
  double sigma_, T_, longest_;
  std::vector<bool> begun_, ended_;
  SpectralCurves found_;
};

}  // namespace

bool follow(Transfer& transfer, CurvePoint& p, double phase, double tolerance) {
  const double T = transfer.train().period;
  const Complex target(0, phase);
  Complex at = p.lambda, log_rho = p.log_rho, slope = p.slope;
  Complex step = (target - (log_rho - at * T)) / (slope - T);
  for (int it = 0; it < 14; ++it) {
    if (!std::isfinite(step.real()) || !std::isfinite(step.imag())) return false;
    const Complex there = at + step, guess = log_rho + slope * step;
    const Multipliers m = transfer.at(there);
    double distance, second;
    const Complex move = apart(m.log_rho[nearest(m, guess, distance, second)], guess);
    // which of them is it?
    if (distance > 1 || (second < 2 * distance && distance > tolerance)) return false;
    if (std::abs(step) > 1e-7 * (1 + std::abs(there))) slope += move / step;
    at = there;
    log_rho = guess + move;
    const double last = std::abs(step);
    step = (target - (log_rho - at * T)) / (slope - T);
    // near V = c what the fronts amplify leaves round-off of 1e-8 in ln rho: there the steps cease to shrink
    const bool stagnant = std::abs(step) > last / 2 && std::abs(step) * T < 1e-6;
    if (stagnant || std::abs(step) * T < tolerance + 4e-16 * std::abs(at) * T) {
      p = {at + step, log_rho + slope * step, slope};
      return true;
    }
  }
  return false;
}

ModeRange SpectralCurve::modes(double period, PetscInt pulses) const {
  return modes_between(points.front().phase(period), points.back().phase(period), pulses);
}

bool SpectralCurve::is_summit(size_t k) const {
  const auto growth = [&](size_t j) { return points[j].lambda.real(); };
  return k > 0 && k + 1 < points.size() && growth(k) >= growth(k - 1) && growth(k) > growth(k + 1);
}

Complex SpectralCurve::lambda_near(double phase, double period, size_t& nearest) const {
  size_t k = 0;
  while (k + 2 < points.size() && points[k + 1].phase(period) > phase) ++k;
  const CurvePoint &a = points[k], &b = points[k + 1];
  const double part = (phase - a.phase(period)) / (b.phase(period) - a.phase(period));
  nearest = part < .5 ? k : k + 1;
  return between(a, b, part, period);
}

SpectralCurves curves_of(Transfer& transfer, const SpectralLine& line) {
  SpectralCurves found = Tracer(transfer, line, longest_turn).found();
  // two curves that nearly meet, or one that leaves the line for a moment, take shorter steps
  if (!found.whole && line.closed()) {
    SpectralCurves again = Tracer(transfer, line, longest_turn / 4).found();
    if (again.whole) found = std::move(again);
  }
  for (SpectralCurve& curve : found.list) add_summits(transfer, curve);
  return found;
}

}  // namespace stickslip
