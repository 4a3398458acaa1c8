#include "stickslip/numerics/continuation.hpp"

#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

double dot(const Place& a, const Place& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

Place of_length_one(Place p) {
  const double length = std::sqrt(dot(p, p));
  for (double& value : p) value /= length;
  return p;
}

Continuation::Continuation(BranchPath& path, std::string name, double from, double to, int steps)
    : path_(path), name_(std::move(name)), from_(from), to_(to), range_(std::abs(to - from)), steps_(steps),
      longest_(std::max(.02, std::min(.2, 4. / steps))), ds_(longest_ / 2) {}

void Continuation::begin() {
  here_ = path_.place();
  Place ahead(here_.size());
  ahead.back() = to_ > from_ ? 1 : -1;
  t_ = path_.tangent(ahead);
  accept();
}

void Continuation::accept() {
  path_.accept();
  here_ = path_.place();
  if (const std::optional<Place> renewed = path_.renewed()) t_ = *renewed;
}

Continuation::End Continuation::follow() {
  std::string refusal;
  for (int taken = 0; taken < steps_;) {
    if (ds_ < 1e-9) return stuck(refusal);
    try {
      if (End end = step()) return end;
      ++taken;
      beat("points of branches");
    } catch (const Error& e) {
      ds_ /= 2;
      refusal = e.what();
    }
  }
  return std::nullopt;
}

Continuation::End Continuation::step() {
  // the last step goes to the end value exactly
  const double ahead = t_.back() != 0 ? (to_ / range_ - here_.back()) / t_.back() : -1;
  const bool arrive = ahead > 0 && ahead <= 1.5 * ds_;
  const double length = arrive ? ahead : ds_;
  Place row = t_;
  if (arrive) {
    std::fill(row.begin(), row.end(), 0.);
    row.back() = 1;
  }
  const auto to_the_end = [&] { path_.go(length, row, arrive ? to_ / range_ : dot(t_, here_) + length); };
  to_the_end();
  Place moved = path_.place();
  for (std::size_t k = 0; k < moved.size(); ++k) moved[k] -= here_[k];
  if (std::sqrt(dot(moved, moved)) > 2 * length) throw Failure("the step left the branch");
  // at which go() finds this place: length, but not on arrival
  const double distance = dot(t_, moved);
  if (End end = reached(distance)) return end;
  Place tangent = path_.tangent(t_);
  // turning by more than a quarter of a right angle: the step was too long to trust
  const double cosine = dot(t_, tangent);
  if (cosine < .92 && ds_ > 1e-4 && !arrive) throw Failure("the branch turns within the step");
  strayed_ = false;
  if (End end = turned(distance, tangent)) return end;
  if (strayed_) {
    to_the_end();
    tangent = path_.tangent(t_);
  }
  t_ = tangent;
  accept();
  if (End end = accepted()) return end;
  if (arrive) return "reached " + name_ + " = " + rounded_text(to_, 8);
  if ((value() - from_) * (to_ - from_) < 0)
    return "the branch came back past its start, " + name_ + " = " + rounded_text(from_, 8);
  if (cosine > .98) ds_ = std::min(longest(), 1.4 * ds_);
  return std::nullopt;
}

void Continuation::go(double distance) {
  strayed_ = true;
  path_.go(distance, t_, dot(t_, here_) + distance);
}

void Continuation::passed_unseen(const std::string& kind, const std::string& why) {
  throw Failure("a special point (" + kind + ") is passed that cannot be located: " + why);
}

std::optional<double> Continuation::locate(const std::string& kind, const std::function<double()>& test,
                                           double length, double before, double after) {
  std::string why;
  const auto at = [&](double distance) {
    try {
      go(distance);
    } catch (const Error& e) {
      why = e.what();
      return std::nan("");
    }
    return test();
  };
  const double zero = find_root(at, {0, before, length, after}, 1e-11);
  if (std::isnan(zero) && !why.empty()) passed_unseen(kind, why);
  if (std::isnan(zero)) return std::nullopt;
  go(zero);
  const bool jumps = !(std::abs(test()) < 1e-4 * std::max(std::abs(before), std::abs(after)));
  return jumps ? std::nullopt : std::optional(zero);
}

}  // namespace stickslip
