#include "stickslip/boundary.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "stickslip/error.hpp"
#include "stickslip/stencil.hpp"

namespace stickslip {

double Axis::value(double c) const {
  if (c == 0) return from;
  if (c == 1) return to;
  return logarithmic ? from * std::pow(to / from, c) : from + (to - from) * c;
}

GrowthRate::GrowthRate(MPI_Comm comm, const Options& options, std::vector<Axis> axes)
    : comm_(comm), options_(options), axes_(std::move(axes)) {
  for (const double x : {0., 1.})
    for (const double y : {0., 1.}) (void)Scene::from(options_at(x, y), true);
}

Options GrowthRate::options_at(double x, double y) const {
  Options o = options_;
  for (std::size_t k = 0; k < axes_.size(); ++k) {
    const double value = axes_[k].value(k == 0 ? x : y);
    o = o.with(axes_[k].name, value);
    for (const std::string& name : axes_[k].same) o = o.with(name, value);
  }
  return o;
}

bool GrowthRate::enters() const {
  const auto same = [](const Sliding& a, const Sliding& b) {
    return a.A == b.A && a.K0 == b.K0 && a.K1 == b.K1 && a.s_delta == b.s_delta && a.beta == b.beta && a.r == b.r &&
           a.F_state == b.F_state && a.g_psi == b.g_psi && a.scene.h() == b.scene.h();
  };
  try {
    const Sliding a(Scene::from(options_at(0.2), true)), b(Scene::from(options_at(0.6), true));
    return !same(a, b);
  } catch (const Failure&) {
    return true;
  }
}

// The psi of a mode of the exact relation: a standing wave that fits the ends.
Mode GrowthRate::with_vector(const Sliding& s, const Mode& mode) const {
  Mode m = mode;
  if (!m.psi.empty()) return m;
  m.psi.resize(s.size());
  const double h = s.scene.form == Form::chain ? 1 : s.scene.h(), half = s.scene.form == Form::chain ? 0.5 : 0;
  for (std::size_t i = 0; i < s.size(); ++i) {
    const double x = double(s.node[i]) * h;
    m.psi[i] = s.scene.left == End::velocity ? std::sin(m.wavenumber * x)
               : s.scene.ring()             ? std::cos(m.wavenumber * x)
                                            : std::cos(m.wavenumber * (x + half * h));
  }
  return m;
}

std::optional<GrowthRate::Leading> GrowthRate::leading(double x, double y) {
  ++evaluations_;
  std::optional<Sliding> sliding;
  try {
    sliding.emplace(Scene::from(options_at(x, y), true));
  } catch (const Failure&) {
    return std::nullopt;
  }
  const Sliding& s = *sliding;
  const double height = resolved_frequency(s) * (1 + 1e-12);
  // equal, to round-off
  const double level = 1e-9 * (std::sqrt(s.A * (s.K0 + 1e-300)) + std::abs(s.A * s.mean_beta()));

  // all modes of the exact relation
  const std::vector<Sliding::Wave> waves = s.exact_waves();
  if (!waves.empty()) {
    const double h = s.scene.form == Form::chain ? 1 : s.scene.h();
    const double b = s.mean_beta(), q = s.mean_q(), r = s.mean_r();
    Leading best{{}, false};
    best.mode.value = -std::numeric_limits<double>::infinity();
    for (const Sliding::Wave& w : waves) {
      bool neutral = s.neutral() && w.k == 0;
      for (const Complex& z : s.dispersion(s.K0 + s.K1 * symbol(s.scene.order, h, w.k), b, q, r)) {
        if (z.imag() < 0 || z.imag() > height) continue;
        if (neutral && std::abs(z) <= level) {
          neutral = false;
          continue;
        }
        const double ahead = z.real() - best.mode.value.real();
        if (ahead > level) {
          best.mode.value = z;
          best.mode.wavenumber = w.k;
          best.degenerate = false;
        } else if (ahead > -level && w.k != best.mode.wavenumber) {
          best.degenerate = true;
        }
      }
    }
    return best;
  }

  const auto counts = [&](const Mode& m) { return m.value.imag() <= height && !is_neutral(s, m); };
  Place here = place_of(s, x, y);
  // few unknowns: every eigenvalue is had for less than following some
  bool known = !due_ && !pool_.empty() && s.size() * s.dof() > 64;
  if (known && !near(here, *pool_at_)) {
    const auto other = std::find_if(places_.begin(), places_.end(), [&](const Place& p) { return near(here, p); });
    known = other != places_.end();
    if (known) {
      take_up(s, other->found, height);
      pool_at_ = *other;
      pool_at_->found.clear();
    }
  }
  if (known)
    if (auto best = leading_followed(s, height, level)) return best;
  due_ = false;
  SpectrumSettings settings;
  settings.count = 6;
  settings.compare = false;
  // all means the first time, then what the shifts find besides the modes followed so far
  settings.quick = searched_;
  settings.effort = 2e6 + 400 * double(s.size()) * std::log2(double(s.size()));
  searched_ = true;
  std::vector<Mode> found;
  for (Followed& f : pool_)
    if (f.mode.psi.size() == s.size() && polish(s, f.mode) && counts(f.mode)) found.push_back(std::move(f.mode));
  for (Mode& m : compute_spectrum(comm_, s, settings).modes) {
    const auto twin = std::find_if(found.begin(), found.end(), [&](const Mode& o) {
      return std::abs(o.value - m.value) < 1e-7 * (1 + std::abs(m.value));
    });
    if (counts(m) && twin == found.end()) found.push_back(std::move(m));
  }
  std::sort(found.begin(), found.end(), [](const Mode& a, const Mode& b) { return a.value.real() > b.value.real(); });
  pool_.clear();
  for (Mode& m : found) {
    if (pool_.size() == 4) break;
    std::vector<Complex> left = left_vector(s, m);
    pool_.push_back({std::move(m), std::move(left)});
  }
  pool_at_ = here;
  if (pool_.empty()) return std::nullopt;
  if ((places_.size() + 1) * s.size() < 500000 && s.size() * s.dof() > 64) {
    here.found = pool_;
    places_.push_back(std::move(here));
  }
  leader_ = 0;
  Leading best{pool_[0].mode, false};
  for (const Followed& f : pool_)
    if (best.mode.value.real() - f.mode.value.real() <= level && std::abs(f.mode.value - best.mode.value) > 1e3 * level)
      best.degenerate = true;
  return best;
}

GrowthRate::Place GrowthRate::place_of(const Sliding& s, double x, double y) {
  Place p{x, y, s.A * s.K0, s.A * s.largest_stiffness(), s.beta, s.r, {}};
  for (std::size_t i = 0; i < p.drag.size(); ++i) {
    if (s.has_state()) p.drag[i] += s.F_state[i] * s.g_psi[i] / s.r[i];
    p.drag[i] *= s.A;
  }
  return p;
}

bool GrowthRate::near(const Place& a, const Place& b) const {
  if (std::hypot(a.x - b.x, a.y - b.y) > reach_ || a.drag.size() != b.drag.size()) return false;
  const auto ratio = [](double p, double q) { return p == q ? 1 : std::max(p, q) / std::min(p, q); };
  if (!(ratio(a.K0, b.K0) < 2) || !(ratio(a.stiffest, b.stiffest) < 2)) return false;
  const double allowed = 0.5 * std::sqrt(std::max(a.K0, 1e-3 * a.stiffest));
  for (std::size_t i = 0; i < a.drag.size(); ++i)
    if (!(std::abs(a.drag[i] - b.drag[i]) <= allowed) || (!a.r.empty() && !(ratio(a.r[i], b.r[i]) < 2))) return false;
  return true;
}

// lambda with w S(lambda) p = 0 for the vectors that a mode had elsewhere: its error is second order in what they have
// changed. Nothing where the equation is ill-conditioned (nearly double eigenvalues).
std::optional<Complex> GrowthRate::estimate(const Sliding& s, const Followed& f) {
  const std::vector<Complex>&p = f.mode.psi, &w = f.left;
  Complex lambda = f.mode.value;
  const double scale = std::abs(lambda) + std::sqrt(s.A * s.K0) + 1e-300;
  for (int k = 0; k < 8; ++k) {
    const std::vector<Complex> r = s.apply(lambda, p), slope = s.apply_slope(lambda, p);
    Complex above = 0, below = 0;
    double size = 0;
    for (std::size_t i = 0; i < p.size(); ++i) {
      above += w[i] * r[i];
      below += w[i] * slope[i];
      size += std::abs(w[i] * slope[i]);
    }
    if (!(std::abs(below) > 1e-3 * size)) return std::nullopt;
    const Complex step = above / below;
    lambda -= step;
    if (!(std::abs(step) < 0.3 * scale)) return std::nullopt;
    if (std::abs(step) <= 1e-13 * scale) return lambda;
  }
  return std::nullopt;
}

// Rayleigh's quotient iteration on both eigenvectors, one factorisation a step: errors are cubed by each.
bool GrowthRate::follow(const Sliding& s, Followed& f) {
  BandLU lu;
  const auto unit = [](std::vector<Complex>& v) {
    double largest = 0;
    Complex at = 1;
    for (const Complex& z : v)
      if (std::norm(z) > largest) largest = std::norm(at = z);
    for (Complex& z : v) z /= at;
  };
  for (int k = 0; k < 5; ++k) {
    const auto start = estimate(s, f);
    if (!start) return false;
    const double scale = std::abs(*start) + std::sqrt(s.A * s.K0);
    f.mode.value = *start;
    s.factor(*start, lu);
    f.mode.psi = s.apply_slope(*start, f.mode.psi);
    s.solve(lu, f.mode.psi);
    unit(f.mode.psi);
    if (s.symmetric) {
      f.left = left_vector(s, f.mode);
    } else {
      f.left = s.apply_slope(*start, f.left);  // S' is diagonal
      s.solve_transposed(lu, f.left);
      unit(f.left);
    }
    const auto value = estimate(s, f);
    if (!value) return false;
    const double change = std::abs(*value - *start);
    f.mode.value = *value;
    if (change > 1e-6 * scale) continue;
    if (f.mode.value.imag() < 0) {
      f.mode.value = std::conj(f.mode.value);
      for (auto* v : {&f.mode.psi, &f.left})
        for (Complex& z : *v) z = std::conj(z);
    }
    f.mode.wavenumber = s.wavenumber(f.mode.psi);
    return true;
  }
  return false;
}

// Follows the modes of another place to this one, beside those of the pool; the rightmost stay.
void GrowthRate::take_up(const Sliding& s, const std::vector<Followed>& more, double height) {
  std::vector<Followed> all;
  for (const std::vector<Followed>* list : {const_cast<const std::vector<Followed>*>(&pool_), &more})
    for (Followed f : *list) {
      if (f.mode.psi.size() != s.size() || !follow(s, f) || f.mode.value.imag() > height || is_neutral(s, f.mode))
        continue;
      const bool twin = std::any_of(all.begin(), all.end(), [&](const Followed& o) {
        return std::abs(o.mode.value - f.mode.value) < 1e-7 * (1 + std::abs(f.mode.value));
      });
      if (!twin) all.push_back(std::move(f));
    }
  std::sort(all.begin(), all.end(),
            [](const Followed& a, const Followed& b) { return a.mode.value.real() > b.mode.value.real(); });
  if (all.size() > 4) all.resize(4);
  pool_ = std::move(all);
  leader_ = 0;
}

// The leading one of the modes followed; nothing where the last one was lost, or too few are left. All are estimated,
// and those that might lead are taken along.
std::optional<GrowthRate::Leading> GrowthRate::leading_followed(const Sliding& s, double height, double level) {
  struct Guess {
    std::size_t index;
    double value, shift;
  };
  std::vector<Guess> guesses;
  std::vector<char> lost(pool_.size(), 0);
  for (std::size_t k = 0; k < pool_.size(); ++k) {
    if (pool_[k].mode.psi.size() != s.size()) return std::nullopt;
    const auto value = estimate(s, pool_[k]);
    if (value) guesses.push_back({k, value->real(), std::abs(*value - pool_[k].mode.value)});
    else lost[k] = 1;
  }
  std::sort(guesses.begin(), guesses.end(), [](const Guess& a, const Guess& b) { return a.value > b.value; });
  const Followed* best = nullptr;
  bool degenerate = false;
  for (const Guess& g : guesses) {
    Followed& f = pool_[g.index];
    const double scale = std::abs(f.mode.value) + std::sqrt(s.A * s.K0);
    // the estimate is better than this by far, unless the mode has moved a long way
    if (best && g.shift < 0.05 * scale && g.value + 0.5 * g.shift + level < best->mode.value.real()) continue;
    if (!follow(s, f) || f.mode.value.imag() > height || is_neutral(s, f.mode)) {
      lost[g.index] = 1;
      continue;
    }
    if (best) {
      const double apart = std::abs(f.mode.value - best->mode.value);
      const double ahead = f.mode.value.real() - best->mode.value.real();
      if (std::abs(ahead) <= level && apart > 1e3 * level) degenerate = true;
      else if (ahead > level) degenerate = false;
      if (ahead <= 0) continue;
    }
    best = &f;
  }
  if (!best || lost[leader_]) return std::nullopt;
  const Leading result{best->mode, degenerate};
  leader_ = std::size_t(best - pool_.data());
  for (std::size_t k = pool_.size(); k-- > 0;)
    if (lost[k]) {
      if (leader_ > k) --leader_;
      pool_.erase(pool_.begin() + std::ptrdiff_t(k));
    }
  return result;
}

double GrowthRate::operator()(double x, double y) {
  const auto at = leading(x, y);
  return at ? at->mode.value.real() : std::numeric_limits<double>::quiet_NaN();
}

double GrowthRate::slope(double x, const Leading& at) {
  const double step = 1e-6, low = std::max(0., x - step), high = std::min(1., x + step);
  const Sliding middle(Scene::from(options_at(x), true));
  const Sliding below(Scene::from(options_at(low), true)), above(Scene::from(options_at(high), true));
  const Mode m = with_vector(middle, at.mode);
  const std::vector<Complex> w = left_vector(middle, m), s = middle.apply_slope(m.value, m.psi);
  const std::vector<Complex> a = above.apply(m.value, m.psi), b = below.apply(m.value, m.psi);
  Complex change = 0, scale = 0;
  for (std::size_t i = 0; i < w.size(); ++i) {
    change += w[i] * (a[i] - b[i]);
    scale += w[i] * s[i];
  }
  return -(change / scale).real() / (high - low);
}

Crossing GrowthRate::crossing(double x, double y) {
  const auto at = leading(x, y);
  if (!at) throw Failure("no steady sliding on the boundary");
  const Sliding s(Scene::from(options_at(x, y), true));
  Mode m = with_vector(s, at->mode);
  polish(s, m);
  Crossing c;
  c.x = x;
  c.y = y;
  c.value = axes_[0].value(x);
  c.value2 = axes_.size() > 1 ? axes_[1].value(y) : 0;
  c.growth = m.value.real();
  c.frequency = m.value.imag();
  c.wavenumber = m.wavenumber;
  c.residual = m.residual;
  c.degenerate = at->degenerate;
  const double scale = std::sqrt(s.A * (s.K0 + s.K1 * std::pow(m.wavenumber, 2))) + std::abs(m.value);
  c.kind = m.value.imag() <= 1e-6 * scale ? "zero" : "hopf";
  return c;
}

bool GrowthRate::vanishes(const Crossing& c) const {
  const Sliding s(Scene::from(options_at(c.x, c.y), true));
  return std::abs(c.growth) <= 1e-6 * (std::sqrt(s.A * (s.K0 + 1e-300)) + std::abs(c.frequency));
}

void GrowthRate::count_growing(Crossing& c, std::size_t number, std::size_t points) {
  const Sliding s(Scene::from(options_at(c.x, c.y), true));
  const double n = double(s.size()), each = 50 * n * (std::log2(n) + 1) + 1e5, all = 4e7;
  if (number % std::size_t(std::max(1., std::ceil(double(points) * each / all))) != 0) return;
  if (!s.exact_waves().empty()) {  // the growth rate is the largest of all there
    c.complete = true;
    return;
  }
  // as far right of the axis as the zero may be wrong
  const double margin = 1e-7 * (std::sqrt(s.A * (s.K0 + s.K1)) + c.frequency) + std::max(0., 2 * c.growth);
  const double height = std::min(1.01 * s.imaginary_bound(), resolved_frequency(s));
  const auto count = count_right(comm_, s, margin, height, 20 * each);
  c.complete.reset();
  if (count) c.complete = *count == 0;
}

std::optional<double> closed_form_velocity(const Scene& s) {
  const bool flat = s.left != End::velocity && s.right != End::velocity;
  if (s.spread != 0 || s.friction.state != StateLaw::none || s.friction.regularised || !flat) return std::nullopt;
  if (s.friction.law == Law::cubic) {
    const double a2 = s.form == Form::continuum ? 1 - s.s_delta() / s.gamma : 1 - s.zeta / s.f0;
    if (a2 >= 0) return std::sqrt(a2);
  }
  if (s.friction.law == Law::carlson_langer && s.form == Form::chain && s.zeta > 0 && s.zeta <= s.f0)
    return std::sqrt(s.f0 / s.zeta) - 1;
  // continuum: gamma/(1 + |v|)^2 = s delta
  if (s.friction.law == Law::carlson_langer && s.form == Form::continuum && s.s_delta() > 0 && s.s_delta() <= s.gamma)
    return std::sqrt(s.gamma / s.s_delta()) - 1;
  return std::nullopt;
}

// ---- one option ---------------------------------------------------------------------------------------------------

namespace {

// The zero of f between a and b, where f changes sign: regula falsi with halved weights (Illinois), bisection where it
// stalls. The bracket shrinks to `tolerance`, or f is zero.
double bracketed_root(const std::function<double(double)>& f, double a, double fa, double b, double fb,
                      double tolerance) {
  double x = a, last_width = std::abs(b - a);
  for (int k = 0; k < 200; ++k) {
    if (fa == 0) return a;
    if (fb == 0) return b;
    const double width = std::abs(b - a);
    if (width <= tolerance) break;
    x = (k % 4 == 3 && width > 0.5 * last_width) ? (a + b) / 2 : b - fb * (b - a) / (fb - fa);
    if (k % 4 == 3) last_width = width;
    const double edge = 0.3 * tolerance;
    if (std::abs(x - a) < edge) x = a + std::copysign(edge, b - a);
    if (std::abs(x - b) < edge) x = b + std::copysign(edge, a - b);
    const double fx = f(x);
    if (!std::isfinite(fx)) return std::numeric_limits<double>::quiet_NaN();
    if ((fx > 0) == (fb > 0)) {
      fa *= 0.5;
    } else {
      a = b;
      fa = fb;
    }
    b = x;
    fb = fx;
  }
  return b;
}

// Newton's iteration with the slope from the eigenvectors, kept in the bracket; each step is one eigenproblem.
double newton_root(GrowthRate& growth, double a, double fa, double b, double fb) {
  double x = a - fa * (b - a) / (fb - fa);
  for (int k = 0; k < 60; ++k) {
    const auto at = growth.leading(x);
    if (!at) throw Failure("no steady sliding near a zero of the growth rate");
    const double f = at->mode.value.real();
    if (f == 0) return x;
    ((f > 0) == (fa > 0) ? a : b) = x;
    double next = x - f / growth.slope(x, *at);
    if (!(next > std::min(a, b) && next < std::max(a, b))) next = (a + b) / 2;
    const double step = std::abs(next - x);
    x = next;
    if (step <= 1e-14 || std::abs(b - a) <= 1e-14) return x;
  }
  return x;
}

}  // namespace

std::vector<Crossing> boundary_points(GrowthRate& growth, Samples& samples, std::vector<std::string>& notes) {
  const int pieces = 32;
  std::vector<double> x, f;
  for (int k = 0; k <= pieces; ++k) {
    x.push_back(double(k) / pieces);
    f.push_back(growth(x.back()));
  }
  samples = {pieces + 1, f};
  // an end without steady sliding (a threshold law at v = 0): as near to it as can be
  for (const auto& [end, inside] : {std::pair<std::size_t, double>{0, 1e-9}, {x.size() - 1, 1 - 1e-9}})
    if (std::isnan(f[end])) {
      x[end] = inside;
      f[end] = growth(inside);
    }
  // A zero that G only touches, or two close together: look at the least |G| between samples of one sign.
  for (std::size_t k = 1; k + 1 < x.size(); ++k) {
    if (!(f[k] * f[k - 1] > 0 && f[k] * f[k + 1] > 0)) continue;
    if (std::abs(f[k]) > std::abs(f[k - 1]) || std::abs(f[k]) > std::abs(f[k + 1])) continue;
    if (std::abs(f[k]) > 2 * std::max(std::abs(f[k - 1] - f[k]), std::abs(f[k + 1] - f[k]))) continue;
    double low = x[k - 1], high = x[k + 1];
    const double sign = f[k] > 0 ? 1 : -1, golden = 0.3819660112501051;
    double inner1 = low + golden * (high - low), inner2 = high - golden * (high - low);
    double f1 = sign * growth(inner1), f2 = sign * growth(inner2);
    for (int step = 0; step < 60 && f1 > 0 && f2 > 0 && high - low > 1e-9; ++step) {
      if (f1 < f2) {
        high = inner2;
        inner2 = inner1;
        f2 = f1;
        f1 = sign * growth(inner1 = low + golden * (high - low));
      } else {
        low = inner1;
        inner1 = inner2;
        f1 = f2;
        f2 = sign * growth(inner2 = high - golden * (high - low));
      }
    }
    const double least = std::min(f1, f2), where = f1 < f2 ? inner1 : inner2;
    if (least <= 1e-12) {
      x.insert(x.begin() + std::ptrdiff_t(k) + (where > x[k] ? 1 : 0), where);
      f.insert(f.begin() + std::ptrdiff_t(k) + (where > x[k + 1] ? 1 : 0),
               least <= 0 && least > -1e-12 ? 0 : sign * least);
      ++k;
    }
  }
  std::vector<Crossing> roots;
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (f[k] == 0) roots.push_back(growth.crossing(x[k]));
    if (k + 1 < x.size() && f[k] * f[k + 1] < 0) {
      const Crossing c = growth.crossing(newton_root(growth, x[k], f[k], x[k + 1], f[k + 1]));
      if (growth.vanishes(c)) {
        roots.push_back(c);
      } else {
        notes.push_back("the growth rate jumps through zero at " + growth.axes()[0].name + " = " +
                        number_text(c.value) + ", where a mode enters or leaves what the grid resolves: no boundary");
      }
    }
  }
  for (std::size_t k = 0; k < roots.size(); ++k) growth.count_growing(roots[k], k, roots.size());
  return roots;
}

// ---- two options --------------------------------------------------------------------------------------------------

namespace {

struct Point {
  double x, y;
};
double distance(Point a, Point b) { return std::hypot(a.x - b.x, a.y - b.y); }
Point clamped(Point p) { return {std::clamp(p.x, 0., 1.), std::clamp(p.y, 0., 1.)}; }
bool inside(Point p) { return p.x >= 0 && p.x <= 1 && p.y >= 0 && p.y <= 1; }

double distance_to_segment(Point p, Point a, Point b) {
  const double dx = b.x - a.x, dy = b.y - a.y, l = dx * dx + dy * dy;
  const double t = l > 0 ? std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / l, 0., 1.) : 0;
  return distance(p, {a.x + t * dx, a.y + t * dy});
}

struct Piece {
  std::vector<Point> points;
  bool closed = false;
};

// The zero of f near 0: secant steps, the first one with `slope` (then set to the last one's; NaN or null: unknown), or
// a bracket grown about 0 where they do not settle. NaN where there is none within 0.1.
double zero_near(const std::function<double(double)>& f, double* slope) {
  double s0 = 0, f0 = f(0);
  if (f0 == 0) return 0;
  const double at_zero = f0;
  double s1 = slope && std::isfinite(*slope) ? -f0 / *slope : 1e-5;
  for (int k = 0; k < 8 && std::abs(s1) < 0.02; ++k) {
    const double f1 = f(s1), m = (f1 - f0) / (s1 - s0), step = f1 == 0 ? 0 : -f1 / m;
    if (!std::isfinite(step)) break;
    if (slope && f1 != f0) *slope = m;
    if (std::abs(step) <= 1e-10) return s1 + step;
    s0 = s1;
    f0 = f1;
    s1 += step;
  }
  for (double reach = 1e-4; reach < 0.1; reach *= 4)
    for (const double s : {reach, -reach})
      if (const double there = f(s); there * at_zero <= 0) return bracketed_root(f, 0, at_zero, s, there, 1e-13);
  return std::nan("");
}

// Follows the zero line of G. The growth rate is taken at the nearest point of the box, so that a curve that leaves
// the box ends on its border. The corrector moves on a circle about the last point, by which folds and corners (where
// the leading mode changes) need no care of their own.
class Tracer {
 public:
  Tracer(GrowthRate& growth, double step) : growth_(growth), step_(step) {}

  double at(Point p) {
    p = clamped(p);
    return growth_(p.x, p.y);
  }

  // From `start` with the heading given and the unstable side on the left (side 1) or right (-1), until the border,
  // the start again, or a place where no way on is found.
  enum class End { border, closed, stuck };
  End follow(Point start, double heading, double side, std::vector<Point>& points, int most = 20000) {
    points = {start};
    const double first = heading;  // of two sides of a thin region that pass near each other only one runs this way
    double radius = step_;
    for (int count = 0; count < most;) {
      const Point p = points.back();
      double angle = heading;
      if (!turn(p, radius, side, angle)) {
        radius /= 4;
        if (radius < 1e-5) return End::stuck;
        continue;
      }
      const double bend = std::abs(std::remainder(angle - heading, 2 * M_PI));
      if (bend > 0.5 && radius > step_ / 32) {  // a corner, which a long step would cut
        radius /= 2;
        continue;
      }
      const Point next{p.x + radius * std::cos(angle), p.y + radius * std::sin(angle)};
      ++count;
      if (!inside(next)) {
        points.push_back(clamped(next));
        return End::border;
      }
      points.push_back(next);
      if (count > 3 && std::cos(angle - first) > 0 && distance_to_segment(start, p, next) < 0.5 * radius) {
        points.back() = start;
        return End::closed;
      }
      // fewer steps where the curve runs straight, more where it turns
      radius = std::clamp(bend > 0.4 ? radius / 2 : bend < 0.1 ? radius * 2 : radius, step_ / 64, step_);
      heading = angle + (bend < 0.4 ? std::remainder(angle - heading, 2 * M_PI) : 0);
    }
    return End::stuck;
  }

  // The heading of the curve at a zero, unstable side as above, found on a small circle.
  std::optional<double> heading(Point p, double side, double guess) {
    const double radius = step_ / 8;
    double angle = guess;
    for (int k = 0; k < 2; ++k, angle += M_PI)
      if (turn(p, radius, side, angle)) return angle;
    return std::nullopt;
  }

 private:
  // The angle nearest to the given one at which the curve leaves the circle with its unstable side on `side`.
  bool turn(Point p, double radius, double side, double& angle) {
    const auto g = [&](double a) { return side * at({p.x + radius * std::cos(a), p.y + radius * std::sin(a)}); };
    double a = angle, ga = g(a);
    if (!std::isfinite(ga)) return false;
    if (ga == 0) return true;
    // unstable (g > 0) lies to the left: turn right until it is stable, or left until it is unstable
    const double sense = ga > 0 ? -1 : 1;
    double b = a, gb = ga, increment = 0.1;
    while (std::abs(b - angle) < 2.7) {
      a = b;
      ga = gb;
      b += sense * increment;
      gb = g(b);
      if (!std::isfinite(gb)) return false;
      if (ga * gb <= 0) {
        angle = bracketed_root(g, a, ga, b, gb, 1e-4);
        return std::isfinite(angle);
      }
      increment = std::min(0.35, 2 * increment);
    }
    return false;
  }

  GrowthRate& growth_;
  double step_;
};

}  // namespace

std::vector<Crossing> boundary_curve(GrowthRate& growth, PetscInt points, Samples& samples,
                                     std::vector<std::string>& notes) {
  const Sliding sample = [&] {
    for (const double x : {0.5, 0.3, 0.7, 0.1, 0.9})
      try {
        return Sliding(Scene::from(growth.options_at(x, x), true));
      } catch (const Failure&) {
      }
    throw Failure("no steady sliding anywhere in the box");
  }();
  // signs on a lattice: every edge with a change of sign is a place to start from
  const int cells = sample.exact_waves().empty() ? 12 : 24;
  const double width = 1. / cells;
  Tracer tracer(growth, std::min(0.5 * width, 1. / std::clamp<double>(double(points), 40., 60.)));
  std::vector<double> g(std::size_t((cells + 1) * (cells + 1)));
  const auto value = [&](int i, int j) -> double& { return g[std::size_t(j * (cells + 1) + i)]; };
  // In blocks of 4 x 4 places the modes found at the first are followed through the others.
  growth.search_every(2);
  for (int block_j = 0; block_j <= cells; block_j += 4)
    for (int block_i = 0; block_i <= cells; block_i += 4) {
      growth.search_next();
      for (int j = block_j; j <= std::min(cells, block_j + 3); ++j)
        for (int k = 0; k <= std::min(cells - block_i, 3); ++k) {
          const int i = (j - block_j) % 2 == 0 ? block_i + k : std::min(cells, block_i + 3) - k;
          value(i, j) = growth(i * width, j * width);
        }
    }
  growth.search_every(0.15);
  samples = {cells + 1, g};
  struct Edge {
    Point a, b;
    double ga, gb;
    bool border;
    bool small = false;  // of a closed curve that no edge of the lattice crosses
  };
  std::vector<Edge> edges;
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i)
      for (const auto& [di, dj] : {std::pair<int, int>{1, 0}, {0, 1}}) {
        if (i + di > cells || j + dj > cells) continue;
        const double ga = value(i, j), gb = value(i + di, j + dj);
        if (!(ga * gb < 0) && !(ga == 0 && gb != 0)) continue;
        const bool border = di ? (j == 0 || j == cells) : (i == 0 || i == cells);
        edges.push_back({{i * width, j * width}, {(i + di) * width, (j + dj) * width}, ga, gb, border});
      }
  std::stable_partition(edges.begin(), edges.end(), [](const Edge& e) { return e.border; });
  // Closed curves between the places of the lattice: |G| is made smaller from where it is least among its neighbours.
  std::vector<std::pair<double, Point>> least;
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i) {
      bool minimum = value(i, j) != 0 && std::isfinite(value(i, j)), flat = true;
      for (int dj = -1; dj <= 1 && minimum; ++dj)
        for (int di = -1; di <= 1 && minimum; ++di) {
          if (i + di < 0 || i + di > cells || j + dj < 0 || j + dj > cells || (di == 0 && dj == 0)) continue;
          const double ratio = value(i + di, j + dj) / value(i, j);
          minimum = ratio >= 1;  // neither smaller, nor of the other sign, nor without steady sliding
          flat = flat && ratio < 1 + 1e-9;
        }
      if (minimum && !flat) least.push_back({value(i, j), {i * width, j * width}});
    }
  std::sort(least.begin(), least.end(),
            [](const auto& a, const auto& b) { return std::abs(a.first) < std::abs(b.first); });
  if (least.size() > 8) least.resize(8);
  for (const auto& [start_value, start] : least) {
    Point p = start;
    double now = start_value, reach = width / 2;
    for (int tries = 0; tries < 100 && reach > 1e-4 * width && now * start_value > 0;) {
      Point better = p;
      double best = now;
      for (const auto& [dx, dy] : {std::pair<double, double>{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const Point q = clamped({p.x + reach * dx, p.y + reach * dy});
        const double there = growth(q.x, q.y);
        ++tries;
        if (!(there / start_value < best / start_value)) continue;
        best = there;
        better = q;
      }
      if (best == now) reach /= 2;
      p = better;
      now = best;
    }
    if (now * start_value < 0) edges.push_back({p, start, now, start_value, false, true});
  }

  std::vector<Piece> pieces;
  for (const Edge& e : edges) {
    const auto along = [&](double t) { return growth(e.a.x + t * (e.b.x - e.a.x), e.a.y + t * (e.b.y - e.a.y)); };
    const double t = bracketed_root(along, 0, e.ga, 1, e.gb, 1e-9);
    if (!std::isfinite(t)) continue;
    const Point start{e.a.x + t * (e.b.x - e.a.x), e.a.y + t * (e.b.y - e.a.y)};
    const bool known = std::any_of(pieces.begin(), pieces.end(), [&](const Piece& p) {
      for (std::size_t k = 0; k + 1 < p.points.size(); ++k)
        if (distance_to_segment(start, p.points[k], p.points[k + 1]) < (e.small ? 0.02 : 0.1) * width) return true;
      return false;
    });
    if (known) continue;
    if (e.small) {
      const double angle = std::atan2(e.b.y - e.a.y, e.b.x - e.a.x) + (e.gb > e.ga ? -M_PI / 2 : M_PI / 2);
      Piece piece;
      for (double step = width / 4; step > 1e-4 * width && !piece.closed; step /= 4) {
        Tracer fine(growth, step);
        const auto heading = fine.heading(start, 1, angle);
        if (heading) piece.closed = fine.follow(start, *heading, 1, piece.points, 400) == Tracer::End::closed;
      }
      if (piece.closed) pieces.push_back(std::move(piece));
      else
        notes.push_back("a piece of the curve near " + growth.axes()[0].name + " = " +
                        number_text(growth.axes()[0].value(start.x)) + ", " + growth.axes()[1].name + " = " +
                        number_text(growth.axes()[1].value(start.y)) +
                         " is too small or too near the border to follow");
      continue;
    }
    // the unstable side is known along the edge; the curve crosses it
    const double edge_angle = std::atan2(e.b.y - e.a.y, e.b.x - e.a.x);
    Piece piece;
    std::array<std::vector<Point>, 2> ways;
    std::array<Tracer::End, 2> ends{Tracer::End::border, Tracer::End::border};
    for (int way = 0; way < 2; ++way) {
      // unstable on the left of the way forward, on the right of the way back
      const double side = way == 0 ? 1 : -1;
      const double guess = edge_angle + (e.gb > e.ga ? -M_PI / 2 : M_PI / 2) + (way == 0 ? 0 : M_PI);
      const Point ahead{start.x + 1e-3 * std::cos(guess), start.y + 1e-3 * std::sin(guess)};
      ways[std::size_t(way)] = {start};
      if (e.border && !inside(ahead)) continue;
      const auto heading = tracer.heading(start, side, guess);
      if (!heading) {
        ends[std::size_t(way)] = Tracer::End::stuck;
        continue;
      }
      ends[std::size_t(way)] = tracer.follow(start, *heading, side, ways[std::size_t(way)]);
      if (ends[std::size_t(way)] == Tracer::End::closed) {
        piece.closed = true;
        break;
      }
    }
    if (piece.closed) {
      piece.points = ways[0].size() > 1 && ends[0] == Tracer::End::closed ? ways[0] : ways[1];
    } else {
      piece.points.assign(ways[1].rbegin(), ways[1].rend());
      piece.points.insert(piece.points.end(), ways[0].begin() + 1, ways[0].end());
      for (int way = 0; way < 2; ++way)
        if (ends[std::size_t(way)] == Tracer::End::stuck) {
          const Point p = ways[std::size_t(way)].back();
          notes.push_back("the curve stops inside the box at " + growth.axes()[0].name + " = " +
                          number_text(growth.axes()[0].value(p.x)) + ", " + growth.axes()[1].name + " = " +
                          number_text(growth.axes()[1].value(p.y)) +
                          ": no way on there (a point where modes of several kinds meet, or no steady sliding beyond)");
        }
    }
    if (piece.points.size() > 1) pieces.push_back(std::move(piece));
  }

  // even points along each piece, put back onto the curve along its normal
  const auto length_of = [](const Piece& p) {
    double sum = 0;
    for (std::size_t k = 0; k + 1 < p.points.size(); ++k) sum += distance(p.points[k], p.points[k + 1]);
    return sum;
  };
  double total = 0;
  for (const Piece& p : pieces) total += length_of(p);
  std::vector<Crossing> result;
  int jumps = 0, symmetric = 0;
  for (std::size_t number = 0; number < pieces.size(); ++number) {
    const Piece& p = pieces[number];
    const double length = length_of(p);
    const int count = std::max(p.closed ? 8 : 2, int(std::lround(double(points) * length / total)));
    struct Seed {
      Point at, normal;
      bool border;
    };
    std::vector<Seed> seeds;
    std::size_t k = 0;
    double before = 0;
    for (int i = 0; i < count; ++i) {
      const double target = length * i / (p.closed ? count : count - 1);
      while (k + 2 < p.points.size() && before + distance(p.points[k], p.points[k + 1]) < target)
        before += distance(p.points[k], p.points[k + 1]), ++k;
      const Point a = p.points[k], b = p.points[k + 1];
      const double l = std::max(distance(a, b), 1e-300), t = std::clamp((target - before) / l, 0., 1.);
      const Point q{a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
      // along the normal, or along the border
      Point normal{-(b.y - a.y) / l, (b.x - a.x) / l};
      const bool on_x = q.x <= 0 || q.x >= 1, on_y = q.y <= 0 || q.y >= 1;
      if (on_x) normal = {0, 1};
      if (on_y) normal = {1, 0};
      seeds.push_back({q, normal, on_x || on_y});
    }
    double slope = std::nan("");
    const auto place = [&](std::size_t i) {
      const Seed& seed = seeds[i];
      const auto off = [&](double s) { return Point{seed.at.x + s * seed.normal.x, seed.at.y + s * seed.normal.y}; };
      const double s = zero_near([&](double d) { return tracer.at(off(d)); }, seed.border ? nullptr : &slope);
      const Point q = clamped(std::isfinite(s) ? off(s) : seed.at);
      return growth.crossing(q.x, q.y);
    };
    std::vector<Crossing> placed;
    for (std::size_t i = 0; i < seeds.size(); ++i) {
      bool missed = false;
      placed.push_back(place(i));
      for (int attempt = 0;; ++attempt) {  // again where the count finds a mode that was not followed
        growth.count_growing(placed[i], i, std::size_t(points));
        if (!placed[i].complete || *placed[i].complete || attempt == 2) break;
        growth.forget();
        placed[i] = place(i);
        missed = true;
      }
      // the mode may have led at the points before, too, back to one that was counted
      for (std::size_t j = i; missed && j-- > 0 && !placed[j].complete;) {
        const Crossing old = placed[j];
        placed[j] = place(j);
        if (distance({old.x, old.y}, {placed[j].x, placed[j].y}) < 1e-9) break;
      }
    }
    for (Crossing& c : placed) {
      c.piece = int(number);
      if (!growth.vanishes(c)) {
        ++(Sliding(Scene::from(growth.options_at(c.x, c.y), true)).neutral() ? symmetric : jumps);
        continue;
      }
      if (!result.empty() && result.back().piece == c.piece) {
        const Crossing& last = result.back();
        const double scale = std::max(std::abs(c.frequency), std::abs(last.frequency));
        c.switched = c.kind != last.kind || std::abs(c.frequency - last.frequency) > 0.3 * scale;
      }
      result.push_back(c);
    }
  }
  if (symmetric > 0)
    notes.push_back("the curve ends where model_k0 = 0: the mode that crosses becomes the symmetry of sliding at any "
                    "velocity (lambda = 0)");
  if (jumps > 0)
    notes.push_back(std::to_string(jumps) + " points of the curve are left out: the growth rate jumps through zero "
                    "there, where a mode enters or leaves what the grid resolves");
  return result;
}

}  // namespace stickslip
