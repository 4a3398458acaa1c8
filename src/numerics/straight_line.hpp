// The straight line by least squares through points (x, y), of weights that may differ. Sums are about the
// means so far: nothing is lost where x or y are large beside their range.
#pragma once

#include <algorithm>
#include <cmath>

namespace stickslip {

class StraightLine {
 public:
  void add(double x, double y, double weight = 1) {
    count_ += 1;
    all_ += weight;
    const double part = weight / all_, dx = x - x_, dy = y - y_;
    x_ += part * dx;
    y_ += part * dy;
    xx_ += weight * dx * (x - x_);
    xy_ += weight * dx * (y - y_);
    yy_ += weight * dy * (y - y_);
  }
  double count() const { return count_; }
  double slope() const { return xy_ / xx_; }
  double weight() const { return all_; }
  // Sums of the squares of x and of y about their means, of their products, and of the squares of what y is
  // beside the line.
  double width() const { return xx_; }
  double height() const { return yy_; }
  double product() const { return xy_; }
  double left() const { return std::max(0., yy_ - slope() * xy_); }
  // Variance of y beside the line, for points of equal weight, three or more.
  double variance() const { return left() / (count_ - 2); }

  // Of what keeps a line: list(number ...).
  template <class List>
  void archive(List& list) {
    list(count_, all_, x_, y_, xx_, xy_, yy_);
  }

 private:
  double count_ = 0, all_ = 0, x_ = 0, y_ = 0, xx_ = 0, xy_ = 0, yy_ = 0;
};

}  // namespace stickslip
