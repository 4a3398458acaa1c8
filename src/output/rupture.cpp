#include "output/rupture.hpp"

#include <algorithm>
#include <cmath>

namespace stickslip {

namespace {

constexpr PetscInt passed_over = 3, fewest = 6;

}  // namespace

Front front_of(const SlipEvent& event, const Scene& scene, int side) {
  const Front none{NAN, NAN};
  const std::vector<double>& times = event.rupture;
  const PetscInt n = scene.n, count = PetscInt(times.size()), at = (event.first - event.left + n) % n;
  const bool whole_ring = scene.ring() && count == n;
  const auto time = [&](PetscInt away) { return times[std::size_t((at + side * away + n) % n)]; };
  PetscInt last = side > 0 ? count - 1 - at : at;  // nodes on that side
  if (whole_ring) {
    const PetscInt latest = PetscInt(std::max_element(times.begin(), times.end()) - times.begin());
    const PetscInt to_the_right = (latest - at + n) % n;
    last = side > 0 ? to_the_right : n - 1 - to_the_right;
  }
  const PetscInt nodes = last - passed_over;
  if (nodes < fewest) return none;
  const double spacing = scene.form == Form::chain ? 1 : scene.h(), first_time = time(passed_over + 1);
  const double middle = double(passed_over + 1 + last) / 2;
  double mean = 0, times_squared = 0, product = 0, places_squared = 0;
  for (PetscInt k = passed_over + 1; k <= last; ++k) mean += (time(k) - first_time) / double(nodes);
  for (PetscInt k = passed_over + 1; k <= last; ++k) {
    const double t = time(k) - first_time - mean, x = side * spacing * (double(k) - middle);
    times_squared += t * t;
    product += t * x;
    places_squared += x * x;
  }
  if (!(times_squared > 0)) return none;
  const double speed = product / times_squared;
  const double scatter = std::max(0., places_squared - speed * product) / double(nodes - 2);
  return {speed, std::sqrt(scatter / times_squared)};
}

}  // namespace stickslip
