#include "model/massless.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>

#include "stickslip/base/text.hpp"

namespace stickslip {

namespace {

constexpr double lost = std::numeric_limits<double>::quiet_NaN();
constexpr double round_off = 8 * std::numeric_limits<double>::epsilon();  // what a law's formula may err by

}  // namespace

Partials MasslessNode::force(double psi, double state, double direction) const {
  const Partials p = direction != 0 ? law.sliding_partials(psi, state, direction) : law.partials(psi, state);
  return {amplitude * p.F, amplitude * p.F_psi, amplitude * p.F_state};
}

double MasslessNode::velocity(double eta, double state, double guess) const {
  if (amplitude == 0) return eta / B;
  if (law.steep) return steep_zero(eta, state, guess);
  if (!law.sticks) return zero(eta, state, guess, 0);
  const double limit = amplitude * law.threshold(state).value;
  if (eta <= limit && (eta >= -limit || !back_slip)) return 0;
  const double direction = eta > 0 ? 1 : -1;
  return zero(eta, state, direction * guess > 0 ? guess : 0, direction);
}

// Newton's method, inside a bracket once there is one. Beyond `good`, the last place where r rises, no other
// branch is taken: a step that leaves the branch is halved.
double MasslessNode::zero(double eta, double state, double guess, double direction) const {
  double good = guess, psi = guess, low = -HUGE_VAL, high = HUGE_VAL;
  for (int round = 0; round < 200; ++round) {
    const Partials p = force(psi, state, direction);
    const double own = B * psi, r = own + p.F - eta, slope = B + p.F_psi;
    if (!(slope > 0) || !std::isfinite(r)) {
      if (psi == good || std::abs(psi - good) <= round_off * std::abs(good)) return lost;
      psi = good + (psi - good) / 2;
      continue;
    }
    good = psi;
    (r < 0 ? low : high) = psi;
    double next = psi - r / slope;
    if (!(next > low && next < high))
      next = low > -HUGE_VAL && high < HUGE_VAL ? low + (high - low) / 2 : next;
    const bool done = std::abs(r) <= round_off * (std::abs(own) + std::abs(p.F) + std::abs(eta)) ||
                      std::abs(next - psi) <= round_off * std::abs(psi);
    if (done) return rises_between(guess, psi, state, direction) ? psi : lost;
    psi = next;
  }
  return lost;
}

// In y = ln |psi| the law is a line, or convex where it bends at rest, and B psi convex; in psi itself B psi
// is a line and the law concave. So Newton's step in y ends at or above the zero and that in psi at or below
// it; of what lies between them the next place is the one where B psi weighs as much as the law, since
// either step is good on its own side of it.
double MasslessNode::steep_zero(double eta, double state, double guess) const {
  constexpr double least = std::numeric_limits<double>::min(), most = 1e300;
  const auto excess = [&](double psi) { return B * psi + force(psi, state, 0).F - eta; };
  if (!std::isfinite(eta) || !std::isfinite(state)) return lost;
  const bool forwards = excess(least) < 0, backwards = excess(-least) > 0;
  // a law for psi > 0 alone is no number at -least, and never comes to rest
  if (!forwards && !backwards) return std::isnan(excess(-least)) ? least : 0;
  const double side = forwards ? 1 : -1;
  double low = least, high = HUGE_VAL, psi = std::clamp(side * guess, least, most);
  for (int round = 0; round < 200; ++round) {
    const Partials p = force(side * psi, state, 0);
    const double own = B * psi, F = side * p.F, r = own + F - side * eta, slope = B + p.F_psi;
    if (std::isnan(r)) return lost;
    if (std::abs(r) <= round_off * (own + std::abs(F) + std::abs(eta))) return side * psi;
    (r < 0 ? low : high) = psi;
    const double below = psi - r / slope, above = psi * std::exp(std::min(-r / (slope * psi), 700.));
    const double balance = psi * p.F_psi / B;  // infinite without B: then all is the law's
    double next = std::min(std::max(below, balance), above);
    if (!(next > low && next < high)) next = std::sqrt(low) * std::sqrt(std::min(high, most));
    if (std::abs(next - psi) <= round_off * psi || high <= low * (1 + round_off)) return side * psi;
    if (low >= most / 2) return lost;
    psi = next;
  }
  return lost;
}

bool MasslessNode::rises_between(double from, double to, double state, double direction) const {
  const double low = std::min(from, to), high = std::max(from, to);
  if (high - low <= 0.25 * std::min(std::abs(low), std::abs(high))) return true;
  const auto rises = [&](double psi) { return B + force(psi, state, direction).F_psi > 0; };
  if (low < 0 && high > 0 && !rises(0)) return false;
  // outwards on either side of 0, from where psi is small against the whole
  const double least = 1e-12 * (high - low);
  for (const double side : {-1., 1.}) {
    const double inner = std::max({side > 0 ? low : -high, 0., least}), outer = side > 0 ? high : -low;
    for (double psi = inner; psi < outer; psi *= 1.25)
      if (!rises(side * psi)) return false;
  }
  return true;
}

MasslessNode::Slopes MasslessNode::slopes(double psi, double state) const {
  if (amplitude == 0) return {1 / B, 0};
  if (law.sticks && psi == 0) return {0, 0};
  const Partials p = force(psi, state, law.sticks ? (psi > 0 ? 1 : -1) : 0);
  const double slope = B + p.F_psi;
  return {1 / slope, -p.F_state / slope};
}

std::string jump_at_rest(const MasslessNode& node) {
  if (!node.law.sticks || node.amplitude == 0) return "";
  const double state = 1;  // a factor of both forces
  const Partials p = node.law.sliding_partials(0, state, 1);
  const double threshold = node.law.threshold(state).value;
  if (threshold - p.F > 1e-12 * threshold)
    return "friction falls from its threshold to " + rounded_text(p.F / threshold, 6) +
           " of it as a block begins to slip, and its velocity would jump";
  // with a state it shows when the motion comes there
  if (!node.law.has_state && !(node.B + node.amplitude * p.F_psi > 0))
    return fmt::format(
        "as a block begins to slip friction falls with velocity at least as fast as the resistance zeta/f0 = "
        "{:.6g} can balance (slope {:.6g}), and its velocity would jump",
        node.B, node.amplitude * p.F_psi);
  return "";
}

}  // namespace stickslip
