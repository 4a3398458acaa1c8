#include "stickslip/model/load.hpp"

#include <algorithm>
#include <cmath>

namespace stickslip {

Load::Load(double v, const std::vector<std::pair<double, double>>& points, double amplitude, double period)
    : amplitude_(amplitude), period_(period) {
  if (points.empty() && amplitude == 0) return;
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
  const double w = p.slope == 0 ? p.v : p.v + p.slope * (t - p.begin);
  return amplitude_ == 0 ? w : w + amplitude_ * std::sin(2 * M_PI * t / period_);
}

double Load::integral(double t) const {
  const int piece = piece_from(t);
  const Interval& p = pieces_[piece];
  const double since = t - (piece == 0 ? 0 : p.begin), half = std::sin(M_PI * t / period_);
  const double w = p.travel + since * (p.v + p.slope * since / 2);
  return amplitude_ == 0 ? w : w + amplitude_ * period_ / M_PI * half * half;
}

double Load::next_corner(double t) const {
  for (const Interval& p : pieces_)
    if (p.begin > t) return p.begin;
  return std::numeric_limits<double>::infinity();
}

double Load::largest() const {
  double largest = 0;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    const Interval& p = pieces_[i];
    const double end =
        i + 1 < pieces_.size() && i > 0 ? p.v + p.slope * (pieces_[i + 1].begin - p.begin) : p.v;
    largest = std::max({largest, std::abs(p.v), std::abs(end)});
  }
  return largest + std::abs(amplitude_);
}

}  // namespace stickslip
