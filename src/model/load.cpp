#include "stickslip/model/load.hpp"

#include <algorithm>
#include <cmath>

namespace stickslip {

double common_period(double a, double b) {
  constexpr int most = 100;
  constexpr double same = 1e-9;
  if (a == 0 || b == 0) return std::max(a, b);
  if (!std::isfinite(a) || !std::isfinite(b)) return std::numeric_limits<double>::infinity();
  for (int k = 1; k <= most; ++k) {
    const double ratio = k * a / b, whole = std::round(ratio);
    if (whole >= 1 && whole <= most && std::abs(ratio - whole) < same * whole) return k * a;
  }
  return std::numeric_limits<double>::infinity();
}

double Sine::at(double t) const { return amplitude * std::sin(2 * M_PI * t / period + phase); }

Load::Load(double v, const std::vector<std::pair<double, double>>& points, const std::vector<Sine>& sines) {
  double shortest = std::numeric_limits<double>::infinity();
  for (const Sine& sine : sines) {
    period_ = common_period(period_, sine.period);
    if (sine.amplitude == 0) continue;
    sines_.push_back(sine);
    shortest = std::min(shortest, sine.period);
    smooth_time_ = shortest / (2 * double(sines_.size()));
  }
  if (points.empty() && sines_.empty()) return;
  pieces_.push_back(
      {-std::numeric_limits<double>::infinity(), points.empty() ? v : points.front().second, 0, 0});
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& [t, value] = points[i];
    const bool last = i + 1 == points.size();
    const double length = last ? 0 : points[i + 1].first - t;
    if (!last && length == 0) continue;  // a jump: the second value begins
    pieces_.push_back({t, value, last ? 0 : (points[i + 1].second - value) / length, 0});
  }
  // How far the plate has come at the beginning of each, counted from t = 0 at the first, constant piece.
  for (std::size_t i = 1; i < pieces_.size(); ++i) {
    const Interval& before = pieces_[i - 1];
    const double from = i == 1 ? 0 : before.begin, t = pieces_[i].begin - from;
    pieces_[i].travel = before.travel + t * (before.v + before.slope * t / 2);
  }
}

int Load::piece_from(double t) const {
  int piece = 0;
  while (std::size_t(piece) + 1 < pieces_.size() && pieces_[std::size_t(piece) + 1].begin <= t) ++piece;
  return piece;
}

double Load::in_piece(int piece, double t) const {
  const Interval& p = pieces_[piece];
  double v = p.slope == 0 ? p.v : p.v + p.slope * (t - p.begin);
  for (const Sine& sine : sines_) v += sine.at(t);
  return v;
}

double Load::before(double t) const { return in_piece(piece_from(std::nextafter(t, -1.)), t); }

double Load::slope_in_piece(int piece, double t) const {
  double slope = pieces_[std::size_t(piece)].slope;
  for (const Sine& sine : sines_) {
    const double turn = 2 * M_PI / sine.period;
    slope += sine.amplitude * turn * std::cos(turn * t + sine.phase);
  }
  return slope;
}

double Load::integral(double t) const {
  const int piece = piece_from(t);
  const Interval& p = pieces_[piece];
  const double since = t - (piece == 0 ? 0 : p.begin);
  double way = p.travel + since * (p.v + p.slope * since / 2);
  for (const Sine& sine : sines_) {
    const double half = M_PI * t / sine.period;
    way += sine.amplitude * sine.period / M_PI * std::sin(half) * std::sin(half + sine.phase);
  }
  return way;
}

double Load::next_corner(double t) const {
  for (const Interval& p : pieces_)
    if (p.begin > t) return p.begin;
  return std::numeric_limits<double>::infinity();
}

Load Load::scaled(double factor) const {
  Load other(*this);
  for (Sine& sine : other.sines_) sine.amplitude *= factor;
  return other;
}

namespace {

// w at both ends of every piece.
template <class Pieces>
std::vector<double> values_at_ends(const Pieces& pieces) {
  std::vector<double> values;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const auto& p = pieces[i];
    values.push_back(p.v);
    if (i > 0 && i + 1 < pieces.size()) values.push_back(p.v + p.slope * (pieces[i + 1].begin - p.begin));
  }
  return values;
}

}  // namespace

double Load::largest() const {
  double largest = 0;
  for (const double w : values_at_ends(pieces_)) largest = std::max(largest, std::abs(w));
  for (const Sine& sine : sines_) largest += std::abs(sine.amplitude);
  return largest;
}

double Load::smallest() const {
  double smallest = std::numeric_limits<double>::infinity();
  for (const double w : values_at_ends(pieces_)) smallest = std::min(smallest, w);
  for (const Sine& sine : sines_) smallest -= std::abs(sine.amplitude);
  return smallest;
}

}  // namespace stickslip
