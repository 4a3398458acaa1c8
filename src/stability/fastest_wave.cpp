#include "stickslip/stability/fastest_wave.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip {

double Waves::kappa2(std::int64_t j) const { return h > 0 ? symbol(order, h, k(j)) : k(j) * k(j); }

std::int64_t Waves::first_beyond(double kappa2_from, std::int64_t from) const {
  std::int64_t low = from, high = count;
  while (low < high) {
    const std::int64_t middle = low + (high - low) / 2;
    if (kappa2(middle) < kappa2_from)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

Waves Waves::of(const Scene& s) {
  Waves w;
  const bool chain = s.form == Form::chain, left = s.left == End::velocity, right = s.right == End::velocity;
  w.order = s.order;
  w.h = chain ? 1 : s.h();
  if (s.ring()) {
    w.factor = 2 * M_PI;
    w.span = double(s.n) * w.h;
    w.count = s.n / 2 + 1;
    return w;
  }
  const double beyond = chain ? 0.5 : 0;
  w.factor = M_PI;
  w.first = left && right ? 1 : left || right ? 0.5 : 0;
  w.span = (double(s.n - 1) + (left ? 0 : beyond) + (right ? 0 : beyond)) * w.h;
  w.count = std::max<std::int64_t>(0, s.n - left - right);
  return w;
}

Waves Waves::of_continuum(const Scene& s, std::int64_t count) {
  Waves w = of(s);
  w.h = 0;
  w.span = s.length;
  w.count = count;
  return w;
}

Waves Waves::resolved(const Scene& s) const {
  if (s.form == Form::chain || count == 0) return *this;
  Waves w = *this;
  const double last = resolved_wavenumber(s.order, s.h()) * span / factor - first;
  w.count = std::clamp<std::int64_t>(std::int64_t(std::floor(last)) + 1, 0, count);
  return w;
}

double resolved_wavenumber(int order, double h) {
  const double shortest = M_PI / h;
  const auto carried = [&](double k) { return k == 0 || 1 - std::sqrt(symbol(order, h, k)) / k < 0.01; };
  return carried(shortest) ? shortest : last_place(carried, 0, shortest);
}

bool slides_at_v(const Scene& s) {
  return !(s.left == End::velocity && s.left_value != s.v) &&
         !(s.right == End::velocity && s.right_value != s.v);
}

std::optional<LinearPoint> sliding_medium(const Scene& s) {
  if (s.medium.varies()) return std::nullopt;
  const auto friction = Friction::of(s.friction);
  const double state = friction->steady_state(s.v);
  if (!std::isfinite(state) || (s.v == 0 && friction->sticks)) return std::nullopt;
  return LinearPoint(s, friction->partials(s.v, state), friction->rate_partials(s.v, state));
}

double same_growth(const LinearPoint& m) {
  const double damping = m.massless() ? 0 : std::abs(m.damping());
  return 1e-9 * (m.rate_of(m.K0 > 0 ? m.K0 : m.K1) + 1e-300 + damping);
}

std::optional<Complex> rightmost_root(const LinearPoint& medium, double kappa2) {
  std::vector<Complex> roots;
  if (medium.K0 > 0 || kappa2 > 0) {
    roots = dispersion(medium, kappa2);
  } else {  // the root 0 left out
    const auto [c2, c1, c0] = medium.characteristic(kappa2);
    if (medium.massless() && medium.has_state) roots = {Complex(-c1)};
    if (!medium.massless())
      roots = medium.has_state ? polynomial_roots({1, c2, c1}) : std::vector<Complex>{Complex(-c2)};
  }
  std::optional<Complex> best;
  for (const Complex& z : roots)
    if (z.imag() >= 0 && (!best || z.real() > best->real())) best = z;
  return best;
}

namespace {

// at0 + slope t
struct Line {
  double at0, slope;
  Line operator+(double c) const { return {at0 + c, slope}; }
  Line operator*(double c) const { return {at0 * c, slope * c}; }
  Line operator+(const Line& o) const { return {at0 + o.at0, slope + o.slope}; }
};

constexpr int most_rounds = 1000;  // where round-off makes waves that are alike pass each other

void add_root(const Line& f, std::vector<double>& roots) {
  if (f.slope != 0) roots.push_back(-f.at0 / f.slope);
}

void add_roots(double a, double b, double c, std::vector<double>& roots) {  // of a t^2 + b t + c
  if (a == 0) return add_root({c, b}, roots);
  const double discriminant = b * b - 4 * a * c;
  if (discriminant < 0) return;
  const double q = -(b + std::copysign(std::sqrt(discriminant), b)) / 2;
  roots.push_back(q / a);
  if (q != 0) roots.push_back(c / q);
}

class FasterThan {
 public:
  FasterThan(const LinearPoint& medium, const Waves& waves, std::int64_t from)
      : medium_(medium), waves_(waves), from_(from), largest_(waves.kappa2(waves.count - 1)) {
    const auto low = medium.characteristic(0), high = medium.characteristic(largest_);
    const auto line = [](double a, double b) { return Line{a, b - a}; };
    const Line c2 = line(low.c2, high.c2), c1 = line(low.c1, high.c1), c0 = line(low.c0, high.c0);
    const int degree = (medium.massless() ? 1 : 2) + (medium.has_state ? 1 : 0);
    if (degree == 3)
      c_ = {c2, c1, c0};
    else if (degree == 2)
      c_ = medium.massless() ? std::vector<Line>{c1, c0} : std::vector<Line>{c2, c1};
    else
      c_ = {c1};
  }

  double growth(std::int64_t j) const {
    const auto root = rightmost_root(medium_, waves_.kappa2(j));
    return root ? root->real() : -HUGE_VAL;
  }

  // The stretches [a, b) of waves that grow faster than sigma all, or none.
  std::vector<std::array<std::int64_t, 2>> stretches(double sigma) const {
    std::vector<double> places;  // of kappa^2, in parts of the largest
    if (c_.size() == 3) {
      const Line a = c_[0] + 3 * sigma, b = c_[1] + c_[0] * (2 * sigma) + 3 * sigma * sigma;
      const Line c = c_[2] + c_[1] * sigma + c_[0] * (sigma * sigma) + sigma * sigma * sigma;
      add_root(a, places);
      add_root(c, places);
      add_roots(a.slope * b.slope, a.at0 * b.slope + a.slope * b.at0 - c.slope, a.at0 * b.at0 - c.at0,
                places);
    } else if (c_.size() == 2) {
      add_root(c_[0] + 2 * sigma, places);
      add_root(c_[1] + c_[0] * sigma + sigma * sigma, places);
    } else {
      add_root(c_[0] + sigma, places);
    }
    std::sort(places.begin(), places.end());
    std::vector<std::array<std::int64_t, 2>> found;
    std::int64_t begin = from_;
    for (const double t : places) {
      const std::int64_t end = !(t > 0) ? from_
                               : t >= 1 ? waves_.count
                                        : waves_.first_beyond(t * largest_, from_);
      if (end > begin) found.push_back({begin, end});
      begin = std::max(begin, end);
    }
    if (begin < waves_.count) found.push_back({begin, waves_.count});
    return found;
  }

 private:
  const LinearPoint& medium_;
  const Waves& waves_;
  std::int64_t from_;
  double largest_;
  // of the polynomial in lambda, the leading 1 left out, over kappa^2 in parts of the largest
  std::vector<Line> c_;
};

}  // namespace

std::optional<FastestWave> fastest_wave(const LinearPoint& medium, const Waves& waves, double level,
                                        std::int64_t from) {
  if (from >= waves.count) return std::nullopt;
  const FasterThan search(medium, waves, from);
  std::int64_t best = from;
  double most = search.growth(from);
  const auto look = [&](std::int64_t j) {
    const double here = search.growth(j);
    if (!(here > most + 1e-4 * level)) return false;
    most = here;
    best = j;
    return true;
  };
  look(waves.count - 1);
  look(std::min(from + 1, waves.count - 1));  // the uniform wave may have no root that counts
  bool faster = std::isfinite(most);
  for (int round = 0; round < most_rounds && faster; ++round) {  // two or three, as a rule
    faster = false;
    for (const auto& [a, b] : search.stretches(most))
      for (const std::int64_t j : {a, a + (b - a) / 2, b - 1})  // round-off may leave the best itself in it
        if (look(j)) faster = true;
  }
  if (!std::isfinite(most)) return std::nullopt;
  FastestWave found;
  const auto alike = [&](std::int64_t j) {
    return j >= from && j < waves.count && search.growth(j) >= most - level;
  };
  const auto near_best = search.stretches(most - level);
  found.index = best;
  for (const auto& [a, b] : near_best)
    for (const std::int64_t j : {a, a + 1})
      if (j < found.index && alike(j)) found.index = j;
  for (const auto& [a, b] : near_best)
    for (const std::int64_t j : {a, a + (b - a) / 2, b - 1})
      found.degenerate = found.degenerate || (j != found.index && alike(j));
  for (const std::int64_t j : {found.index - 1, found.index + 1, best})
    found.degenerate = found.degenerate || (j != found.index && alike(j));
  found.wavenumber = waves.k(found.index);
  found.value = *rightmost_root(medium, waves.kappa2(found.index));
  return found;
}

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

// From this wavenumber on N k^2 outweighs all else.
double last_that_may_lead(const LinearPoint& medium) {
  const double drag = std::abs(medium.beta()) + std::abs(medium.q()) / std::max(medium.r(), 1e-300);
  return 30 * (std::sqrt((drag + std::sqrt(medium.K0 / medium.A)) / medium.N) +
               (medium.K1 > 0 ? std::sqrt(medium.K0 / medium.K1) : 0));
}

}  // namespace

double spring_frequency(const LinearisedOperator& s) {
  const double K = s.scene.form == Form::chain ? s.K0 + s.K1 : s.K0;
  return K > 0 ? s.rate_of(K) : s.rate;
}
double own_rate(const LinearisedOperator& s) {
  const double w = spring_frequency(s);
  return w / (1 + damping_scale(s) / w);
}
double damping_scale(const LinearisedOperator& s) {
  return s.scene.massless() ? 0 : std::abs(s.mean().damping());
}

std::optional<ContinuumLead> continuum_lead(const LinearisedOperator& s) {
  if (s.scene.form != Form::continuum || !s.uniform || s.size() == 0) return std::nullopt;
  const LinearPoint medium = s.mean();
  const double level = same_growth(medium);
  Waves waves = Waves::of_continuum(s.scene, 2);
  const bool between = s.N > 0 && s.has_state();
  if (between) waves.count += std::int64_t(std::min(last_that_may_lead(medium) / waves.k(1), 1e12));

  ContinuumLead best;
  best.growth = -infinite;
  const auto offer = [&](double k, Complex value) {
    const double ahead = value.real() - best.growth;
    if (ahead > level)
      best = {value.real(), value.imag(), k, false};
    else if (ahead > -level && k != best.wavenumber)
      best.degenerate = true;
  };
  const std::int64_t lead = between ? fastest_wave(medium, waves, level)->index : 0;
  for (const std::int64_t j : {lead, lead + 1})  // the second only to tell whether the first is alone
    offer(waves.k(j), *rightmost_root(medium, waves.kappa2(j)));
  if (s.N > 0) {
    offer(infinite, std::max(-s.K1 / s.N, s.has_state() ? -medium.r() : -infinite));
  } else if (s.K1 > 0) {
    const double oscillating = -medium.damping() / 2, decaying = s.has_state() ? -medium.r() : -infinite;
    offer(infinite, oscillating >= decaying ? Complex(oscillating, infinite) : Complex(decaying, 0));
  }
  return best;
}

namespace {

// The fastest wave on uniform sliding at psi. lambda = 0 of the uniform mode is the shift of the whole.
void find_growth(const Scene& scene, UniformState& u) {
  Scene sliding = scene;
  sliding.v = u.psi;
  const LinearPoint medium = LinearisedOperator(sliding).mean();
  const auto found = fastest_wave(medium, Waves::of(scene), 1e-3 * same_growth(medium));
  u.slope = medium.slow_beta();
  u.growth_rate = found ? found->value.real() : -std::numeric_limits<double>::infinity();
  u.frequency = found ? found->value.imag() : 0;
  u.wavenumber = found ? found->wavenumber : 0;
  u.stable = u.growth_rate < 0;
}

}  // namespace

bool has_uniform_states(const Scene& s) {
  return s.form == Form::chain && s.k0 == 0 && s.spread == 0 && !s.friction.varies() && !s.medium.varies() &&
         s.left != End::velocity && s.right != End::velocity;
}

std::vector<UniformState> uniform_states(const Scene& scene, double stress) {
  constexpr double lowest = -290, highest = 8, step = 1 / 16.;  // of log10 |psi/unit|
  const double unit = scales_of(scene).slip.psi;
  const auto friction = Friction::of(scene.friction);
  const auto excess = [&](double psi) {
    return scene.B() * psi + friction->force(psi, friction->steady_state(psi)) - stress;
  };
  std::vector<double> found;
  for (const double sign : {-1., 1.}) {
    const auto at = [&](double exponent) { return excess(sign * unit * std::pow(10., exponent)); };
    double before = lowest, f_before = at(before);
    for (double e = lowest + step; e <= highest; e += step) {
      const double f = at(e);
      if (std::isfinite(f) && std::isfinite(f_before) && f != 0 &&
          (f_before == 0 || (f < 0) != (f_before < 0)))
        found.push_back(sign * unit * std::pow(10., find_root(at, {before, f_before, e, f}, 0)));
      before = e;
      f_before = f;
    }
  }
  const double state = friction->steady_state(0);
  const bool rest = friction->sticks ? std::abs(stress) <= friction->threshold_at_long_rest()
                                     : std::isfinite(state) && excess(0) == 0;
  if (rest) found.push_back(0);
  std::sort(found.begin(), found.end());
  std::vector<UniformState> states;
  for (const double psi : found) {
    UniformState u;
    u.psi = psi;
    u.rests = psi == 0 && friction->sticks;
    const double s = friction->steady_state(psi);
    if (friction->has_state && std::isfinite(s)) u.state = state_to_output(scene.friction.state, s);
    if (u.rests)
      u.stable = true;
    else
      find_growth(scene, u);
    states.push_back(u);
  }
  return states;
}

}  // namespace stickslip
