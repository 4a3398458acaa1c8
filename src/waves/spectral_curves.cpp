#include "waves/spectral_curves.hpp"

#include <algorithm>
#include <cmath>

namespace stickslip {

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
