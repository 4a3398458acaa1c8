// The branch of a cycle with rests: the return map with the parameter as one more unknown, so that the branch
// may turn round.
#include <algorithm>
#include <cmath>

#include "cycles/stick_return_map.hpp"
#include "numerics/beside.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/dense.hpp"

namespace stickslip {

namespace {

using std::size_t;

constexpr double difference = 1e-6;  // of the parameter's range: the map's derivative by it, to a millionth
constexpr double settled = 1e-12;    // change of Newton's method

class StickPath : public CyclePath {
 public:
  StickPath(std::function<Scene(double)> at, double from, double range, const StickCycle& first)
      : scene_at_(std::move(at)), range_(range) {
    const StickMotion m(scene_at_(from));
    there_.cycle = first;
    there_.x = free_values(m, first);
    const std::vector<size_t> free = free_unknowns(m, first);
    for (size_t k = 0; k < free.size(); ++k)
      scale_.push_back(m.scale(free[k]) + std::abs(there_.x[k]));
    there_.x.push_back(from);
    there_.t.assign(there_.x.size(), 0.);
    here_ = there_;
  }

  void go(double length, const Place& row, double right) override {
    Stand next = here_;
    for (size_t k = 0; k < next.x.size(); ++k) next.x[k] += length * here_.t[k] * unit(k);
    double last = StickMotion::never;
    for (int iteration = 0;; ++iteration) {
      std::vector<double> matrix, change;
      linearise(next, row, right, matrix, change);
      if (!solve_dense(int(next.x.size()), matrix.data(), 1, change.data()))
        throw Failure("the return map is singular");
      double largest = 0;
      for (size_t k = 0; k < next.x.size(); ++k) {
        next.x[k] += change[k] * unit(k);
        largest = std::max(largest, std::abs(change[k]));
      }
      if (!std::isfinite(largest) || iteration > 12) throw Failure("Newton's method on the return map fails");
      if (largest < settled || (largest < 1e-9 && largest >= last)) break;
      last = largest;
    }
    const StickMotion m(scene_at_(next.x.back()));
    set_free_values(m, free_of(next), next.cycle);
    close_cycle(m, next.cycle);
    if (next.cycle.sequence != here_.cycle.sequence)
      throw Failure("the sequence of starts and stops changes: " + next.cycle.sequence);
    there_ = std::move(next);
  }

  Place place() const override {
    Place p;
    for (size_t k = 0; k < there_.x.size(); ++k) p.push_back(there_.x[k] / unit(k));
    return p;
  }

  Place tangent(const Place& row) override {
    std::vector<double> matrix, right;
    linearise(there_, row, 0, matrix, right);
    std::fill(right.begin(), right.end(), 0.);
    right.back() = 1;
    if (!solve_dense(int(there_.x.size()), matrix.data(), 1, right.data()))
      throw Failure("the branch has no tangent");
    there_.t = of_length_one(right);
    return there_.t;
  }

  Place direction() const override { return of_length_one(there_.t); }
  Cycle cycle() const override { return described(scene_at_(there_.x.back()), there_.cycle); }
  const StickCycle& candidate() const { return there_.cycle; }
  void accept() override { here_ = there_; }
  std::unique_ptr<CyclePath> beside(std::function<Scene(double)> at, double from, double range,
                                    const Others& others) const override {
    auto other = std::make_unique<StickPath>(*this);
    for (const auto& [path, weight] : others) {
      const std::vector<double>& x = dynamic_cast<const StickPath&>(*path).there_.x;
      for (size_t k = 0; k < x.size(); ++k) other->there_.x[k] += weight * (x[k] - there_.x[k]);
    }
    other->scene_at_ = std::move(at);
    other->there_.t.back() *= range_ / range;
    other->range_ = range;
    other->there_.x.back() = from;
    other->here_ = other->there_;
    return other;
  }

 private:
  struct Stand {
    std::vector<double> x, t;  // free coordinates and the parameter; the tangent, in units of the places
    StickCycle cycle;
  };
  double unit(size_t k) const { return k < scale_.size() ? scale_[k] : range_; }
  static std::vector<double> free_of(const Stand& s) { return {s.x.begin(), s.x.end() - 1}; }

  std::vector<double> image(const Stand& s, double parameter) const {
    StickMotion m(scene_at_(parameter));
    if (std::isinf(s.cycle.clearance)) m.stop_at_turns();  // beside a graze the map goes on smoothly
    StickCycle c(s.cycle);
    set_free_values(m, free_of(s), c);
    c.start = return_map_of(m, c, {}).at.u;
    return free_values(m, c);
  }

  // The linear system of a step of Newton's method, in units of the places: (DP - 1, dP/dparameter; row)
  // change = right.
  void linearise(const Stand& s, const Place& row, double level, std::vector<double>& matrix,
                 std::vector<double>& right) const {
    const size_t n = scale_.size(), all = n + 1;
    matrix.assign(all * all, 0.);
    right.assign(all, 0.);
    if (n > 0) {
      const StickMotion m(scene_at_(s.x.back()));
      StickCycle c(s.cycle);
      set_free_values(m, free_of(s), c);
      const MapAt map = map_at(m, c);
      const auto sides = beside_of<UsageError>([&](double at) { return image(s, at); }, s.x.back(),
                                               difference * range_, map.image);
      for (size_t i = 0; i < n; ++i) {
        for (size_t j = 0; j < n; ++j)
          matrix[i * all + j] = (map.slopes[i * n + j] - (i == j ? 1 : 0)) * scale_[j] / scale_[i];
        matrix[i * all + n] = (sides.above[i] - sides.below[i]) / sides.width * range_ / scale_[i];
        right[i] = (s.x[i] - map.image[i]) / scale_[i];
      }
    }
    double here = 0;
    for (size_t k = 0; k < all; ++k) {
      matrix[n * all + k] = row[k];
      here += row[k] * s.x[k] / unit(k);
    }
    right[n] = level - here;
  }

  std::function<Scene(double)> scene_at_;
  double range_;
  std::vector<double> scale_;
  Stand here_, there_;
};

}  // namespace

std::unique_ptr<CyclePath> stick_path(std::function<Scene(double)> at, double from, double range,
                                      const StickCycle& first) {
  return std::make_unique<StickPath>(std::move(at), from, range, first);
}

const StickCycle& stick_candidate(const CyclePath& path) {
  return dynamic_cast<const StickPath&>(path).candidate();
}

}  // namespace stickslip
