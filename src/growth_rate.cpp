#include "stickslip/growth_rate.hpp"

#include <algorithm>
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

namespace {

// A frequency of the scene: that of uniform oscillation, or of the shortest wave where nothing holds the line.
double unit_frequency(const Sliding& s) { return std::sqrt(s.A * (s.K0 > 0 ? s.K0 : s.K1)) + 1e-300; }

}  // namespace

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
  if (each_) each_();
  std::optional<Sliding> sliding;
  try {
    sliding.emplace(Scene::from(options_at(x, y), true));
  } catch (const Failure&) {
    return std::nullopt;
  }
  const Sliding& s = *sliding;
  const double height = resolved_frequency(s) * (1 + 1e-12);
  // equal, to round-off
  const double level = 1e-9 * (unit_frequency(s) + std::abs(s.A * s.mean_beta()));

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

  if (s.size() * s.dof() <= 64) {  // every eigenvalue is had for less than following some
    pool_.clear();
    search(s, height);
    if (pool_.empty()) return std::nullopt;
  } else {
    Place here = place_of(s, x, y);
    const bool due = std::exchange(due_, false), moved = due || (reach_ > 0 && !(pool_at_ && near(here, *pool_at_)));
    bool count = moved || pool_.empty();
    if (moved) {
      const Place* other = nullptr;
      const auto away = [&](const Place& p) { return std::hypot(p.x - x, p.y - y); };
      for (const Place& p : places_)
        if (!other || away(p) < away(*other)) other = &p;
      if (other) {
        take_up(s, other->found, height);
        if (!due && near(here, *other)) {
          count = false;
          pool_at_ = *other;
          pool_at_->found.clear();
        }
      }
    }
    auto best = leading_followed(s, height, level);
    if (!best) {  // from where they were, whatever they become
      std::vector<Followed> all;
      for (Followed& f : pool_)
        if (f.mode.psi.size() == s.size() && polish(s, f.mode, 12)) add_followed(s, height, std::move(f.mode), all);
      keep_rightmost(s, std::move(all));
      if (pool_.empty()) search(s, height);
      count = doubtful_ = true;
    }
    if (pool_.empty()) return std::nullopt;
    if (!count) return best;
    if (reach_ > 0 && !complete(s, height)) search(s, height, true);
    pool_at_ = here;
    if ((places_.size() + 1) * s.size() < 250000) {
      here.found = pool_;
      places_.push_back(std::move(here));
    }
  }
  Leading best{pool_[leader_].mode, false};
  for (const Followed& f : pool_)
    if (best.mode.value.real() - f.mode.value.real() <= level && std::abs(f.mode.value - best.mode.value) > 1e3 * level)
      best.degenerate = true;
  return best;
}

// Adds a mode that is within reach and not there yet.
bool GrowthRate::add_followed(const Sliding& s, double height, Mode&& m, std::vector<Followed>& all) {
  if (m.psi.size() != s.size() || m.value.imag() > height || is_neutral(s, m)) return false;
  for (const Followed& o : all)
    if (std::abs(o.mode.value - m.value) < 1e-7 * (1 + std::abs(m.value))) return false;
  all.push_back({std::move(m), {}});
  return true;
}

namespace {
double count_effort(const Sliding& s) { return 2e6 + 400 * double(s.size()) * std::log2(double(s.size())); }
}  // namespace

// What the shifts of `spectrum` find, or all its means where a count has failed, beside the modes followed so far.
void GrowthRate::search(const Sliding& s, double height, bool thorough) {
  SpectrumSettings settings;
  settings.count = 6;
  settings.compare = false;
  settings.quick = !thorough;
  settings.effort = count_effort(s);
  std::vector<Followed> all;
  for (Followed& f : pool_)
    if (f.mode.psi.size() == s.size() && polish(s, f.mode)) add_followed(s, height, std::move(f.mode), all);
  for (Mode& m : compute_spectrum(comm_, s, settings).modes) add_followed(s, height, std::move(m), all);
  keep_rightmost(s, std::move(all));
}

// The pool is what may lead here or nearby: of several modes with nearly the same growth rate two.
void GrowthRate::keep_rightmost(const Sliding& s, std::vector<Followed> all) {
  std::sort(all.begin(), all.end(),
            [](const Followed& a, const Followed& b) { return a.mode.value.real() > b.mode.value.real(); });
  const double alike = 1e-4 * unit_frequency(s);
  pool_.clear();
  leader_ = 0;
  for (Followed& f : all) {
    if (pool_.size() == 5) break;
    const double value = f.mode.value.real();
    if (std::count_if(pool_.begin(), pool_.end(),
                      [&](const Followed& o) { return o.mode.value.real() - value <= alike; }) >= 2)
      continue;
    if (f.left.empty()) f.left = left_vector(s, f.mode);
    pool_.push_back(std::move(f));
  }
}

namespace {

// As far right of a mode as it and the count may be wrong.
double count_margin(const Sliding& s, const Complex& value, double part = 1e-7) {
  return part * (std::sqrt(s.A * (s.K0 + s.K1)) + value.imag());
}

double count_height(const Sliding& s) { return std::min(1.01 * s.imaginary_bound(), resolved_frequency(s)); }

}  // namespace

// Counts the modes right of the rightmost one in the pool and adds those that it has not: the zeros of which the count
// says where they are, polished. Where it names none, it is counted further right, by ever larger steps and then
// halving, until a zero stands near the line. False where that fails.
bool GrowthRate::complete(const Sliding& s, double height) {
  const double effort = count_effort(s), unit = unit_frequency(s);
  std::vector<Followed> all = pool_;
  double line = all[leader_].mode.value.real() + count_margin(s, all[leader_].mode.value, slack_);
  const double bound = s.symmetric && !s.has_state() ? s.real_bound() : std::numeric_limits<double>::infinity();
  if (bound <= line || (only_sign_ && bound <= 0)) return true;
  if (only_sign_) {
    if (line > 2 * count_margin(s, all[leader_].mode.value, slack_)) return true;
    line = std::max(line, count_margin(s, 0, slack_));
  }
  for (int round = 0; round < 6; ++round) {
    std::vector<Complex> where;
    const auto right_of = [&](double a) {
      std::optional<long> count;
      for (const double aside : {0., 1e-7, 1e-6, 1e-5}) {
        if (count) break;  // else an eigenvalue stands too near the line
        where.clear();
        count = count_right(comm_, s, a + aside * unit, count_height(s), effort, &where);
      }
      if (count && s.neutral() && a < 0) --*count;
      return count;
    };
    const auto add = [&] {
      bool found = false;
      std::sort(where.begin(), where.end(), [](Complex a, Complex b) { return a.real() > b.real(); });
      for (std::size_t k = 0; k < std::min<std::size_t>(where.size(), 4); ++k) {
        Mode m;
        m.value = where[k];
        m.psi.resize(s.size());
        for (std::size_t i = 0; i < m.psi.size(); ++i)  // favours no wave
          m.psi[i] = {std::cos(double(i * i % 997)), std::sin(double(i * i % 991))};
        if (polish(s, m, 12) && m.value.real() > line && add_followed(s, height, std::move(m), all)) found = true;
      }
      return found;
    };
    std::optional<long> count = right_of(line);
    if (!count) {  // a search would know no more
      doubtful_ = true;
      keep_rightmost(s, std::move(all));
      return true;
    }
    if (*count == 0) {
      keep_rightmost(s, std::move(all));
      return true;
    }
    // few, or all of them listed: else the rightmost may not be among them
    const auto listed = [&] { return *count > 0 && (*count <= 4 || 2 * long(where.size()) >= *count - 2); };
    bool found = listed() && add();
    double low = line, high = std::numeric_limits<double>::infinity();
    bool close = !where.empty();  // to some of them
    for (int k = 0; !found && k < 24 && high - low > (close ? 1e-9 : 1e-4) * unit; ++k) {
      const double a = std::isfinite(high) ? (low + high) / 2 : low + std::ldexp(1e-4 * unit, 2 * k);
      count = right_of(a);
      if (!count) break;
      (*count > 0 ? low : high) = a;
      if (*count > 0) close = !where.empty();
      found = listed() && add();
    }
    if (!found) {  // its frequency by halving, too
      double below = 0, above = count_height(s);
      for (int k = 0; k < 14; ++k) {
        const double middle = (below + above) / 2;
        const auto lower = count_right(comm_, s, low, middle, effort);
        if (!lower) break;
        (*lower > (s.neutral() && low < 0 ? 1 : 0) ? above : below) = middle;
      }
      where = {Complex(std::isfinite(high) ? (low + high) / 2 : low, (below + above) / 2)};
      found = add();
    }
    if (!found) return false;
    for (const Followed& f : all)
      line = std::max(line, f.mode.value.real() + count_margin(s, f.mode.value, slack_));
  }
  return false;
}

void GrowthRate::seek(double x, double y) {
  const Sliding s(Scene::from(options_at(x, y), true));
  if (!pool_.empty() && complete(s, resolved_frequency(s) * (1 + 1e-12))) return;
  search(s, resolved_frequency(s) * (1 + 1e-12), true);
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
  const std::size_t n = p.size();
  Complex lambda = f.mode.value;
  const double scale = std::abs(lambda) + unit_frequency(s);
  // w S p = m lambda^2/A + lambda (sum w (beta + q/(lambda + r)) p) + K
  const std::vector<Complex> d = s.minus_d2(p);
  std::vector<Complex> wp(n);
  Complex m = 0, drag = 0, K = 0;
  double weight = 0, drags = 0;
  for (std::size_t i = 0; i < n; ++i) {
    wp[i] = w[i] * p[i];
    m += wp[i];
    drag += wp[i] * s.beta[i];
    K += w[i] * d[i];
    weight += std::abs(wp[i]);
    drags += std::abs(wp[i]) * std::abs(s.beta[i]);
  }
  K = s.K0 * m + s.K1 * K;
  for (int k = 0; k < 8; ++k) {
    Complex above = lambda * (lambda / s.A * m + drag) + K, below = 2. * lambda / s.A * m + drag;
    double size = 2 * std::abs(lambda) / s.A * weight + drags;
    for (std::size_t i = 0; i < s.r.size(); ++i) {
      const Complex over = 1. / (lambda + s.r[i]), q = wp[i] * s.F_state[i] * s.g_psi[i] * over;
      above += lambda * q;
      below += q * s.r[i] * over;
      size += std::abs(q * s.r[i] * over);
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
    const double scale = std::abs(*start) + unit_frequency(s);
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
      if (f.mode.psi.size() != s.size() || !follow(s, f)) continue;
      std::vector<Complex> left = std::move(f.left);
      if (add_followed(s, height, std::move(f.mode), all)) all.back().left = std::move(left);
    }
  keep_rightmost(s, std::move(all));
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
  if (guesses.empty()) return std::nullopt;
  const Followed* best = nullptr;
  bool degenerate = false;
  for (const Guess& g : guesses) {
    Followed& f = pool_[g.index];
    const double scale = std::abs(f.mode.value) + unit_frequency(s);
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
  if (!best || (lost[leader_] && !(only_sign_ && best->mode.value.real() > level))) return std::nullopt;
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
  if (s.neutral() && at->mode.psi.empty()) m.residual = s.mode_residual(m.value, m.psi);  // near a double zero
  else polish(s, m);
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
  return std::abs(c.growth) <= 1e-6 * (unit_frequency(s) + std::abs(c.frequency));
}

void GrowthRate::count_growing(Crossing& c) {
  const Sliding s(Scene::from(options_at(c.x, c.y), true));
  if (!s.exact_waves().empty()) {  // the growth rate is the largest of all there
    c.complete = true;
    return;
  }
  const double margin = count_margin(s, {0, c.frequency}) + std::max(0., 2 * c.growth);
  auto count = count_right(comm_, s, margin, count_height(s), count_effort(s));
  if (!count) count = count_right(comm_, s, 10 * margin, count_height(s), count_effort(s));
  c.complete.reset();
  if (count) c.complete = *count == 0;
}

double GrowthRate::count_cost(double x, double y) const {
  const Sliding s(Scene::from(options_at(x, y), true));
  if (!s.exact_waves().empty()) return 0;
  static constexpr double microseconds[] = {0.6, 2.2, 2.8, 3};  // by order, of the tree
  const double n = double(s.size()), each = s.scene.form == Form::chain ? 2 : microseconds[s.scene.order / 2 - 1];
  return 1e-6 * each * n * std::log2(n) + 1e-3;
}

namespace {

// The growth rate and frequency that a medium with the mean coefficients has on this grid.
Complex mean_growth(const Sliding& s) {
  const double b = s.mean_beta(), q = s.mean_q(), r = s.mean_r(), height = resolved_frequency(s);
  Complex best(-std::numeric_limits<double>::infinity(), 0);
  for (int j = 0; j <= 2000; ++j) {
    const double k = M_PI / s.scene.h() * std::pow(j / 2000., 2);
    for (const Complex& z : s.dispersion(s.K0 + s.K1 * symbol(s.scene.order, s.scene.h(), k), b, q, r))
      if (z.imag() >= 0 && z.imag() <= height && z.real() > best.real()) best = z;
  }
  return best;
}

}  // namespace

std::optional<GrowthRate> GrowthRate::reduced() const {
  constexpr double nodes = 8, blocks = 1024, places[] = {0, 0.25, 0.5, 0.75, 1};
  double intervals = 0;
  PetscInt n = 0;
  bool chain = false;
  for (const double x : places)
    for (const double y : places) {
      const Scene scene = Scene::from(options_at(x, y), true);
      n = scene.n;
      chain = scene.form == Form::chain;
      if (chain) {
        intervals = std::max({intervals, blocks, 32 * std::sqrt(scene.k1 / std::max(scene.k0, 1e-300))});
        continue;
      }
      if (scene.c == 0) return std::nullopt;
      const double length = scene.spread == 0 ? scene.c : std::min(scene.c, scene.spread_length);
      intervals = std::max(intervals, nodes * scene.length / length);
    }
  if (!(intervals + 1 < double(n) / 2)) return std::nullopt;
  Options options = options_.with("grid_n", std::max(64., std::ceil(intervals) + 1));
  if (!chain) options = options.with("grid_order", 2.);
  try {
    bool needed = false;
    GrowthRate coarse(comm_, options, axes_);
    for (const double x : places)
      for (const double y : places) {
        std::optional<Sliding> a, b;
        try {
          a.emplace(Scene::from(options_at(x, y), true));
          b.emplace(Scene::from(coarse.options_at(x, y), true));
        } catch (const Failure&) {
          continue;
        }
        if (!a->exact_waves().empty()) continue;
        needed = true;
        if (chain) continue;
        const Complex fine = mean_growth(*a), rough = mean_growth(*b);
        const double scale = std::abs(rough) + unit_frequency(*a);
        if (std::abs(fine.real() - rough.real()) > 0.01 * scale) return std::nullopt;
      }
    coarse.slack_ = 1e-4;
    if (needed) return coarse;
  } catch (const UsageError&) {
  }
  return std::nullopt;
}

namespace {

// A mode of the reduced scene as a guess: between the nodes of a coarse grid; trapped at either end of a short chain.
std::vector<Complex> on_whole(const Sliding& reduced, const Sliding& whole, const std::vector<Complex>& p) {
  if (whole.scene.form == Form::continuum) return interpolate(reduced, whole, p);
  std::vector<Complex> q(whole.size(), Complex(0));
  const auto middle = std::ptrdiff_t(p.size() / 2);
  std::copy(p.begin(), p.begin() + middle, q.begin());
  std::copy(p.begin() + middle, p.end(), q.end() - (std::ptrdiff_t(p.size()) - middle));
  return q;
}

}  // namespace

void GrowthRate::take_hints(GrowthRate& reduced, double x, double y) {
  std::optional<Sliding> fine, rough;
  if (!reduced.leading(x, y)) return;
  try {
    fine.emplace(Scene::from(options_at(x, y), true));
    rough.emplace(Scene::from(reduced.options_at(x, y), true));
  } catch (const Failure&) {
    return;
  }
  std::vector<Followed> hints;
  for (const Followed& f : reduced.pool_)
    if (f.mode.psi.size() == rough->size()) {
      Followed hint = f;
      for (std::vector<Complex>* v : {&hint.mode.psi, &hint.left}) *v = on_whole(*rough, *fine, *v);
      hints.push_back(std::move(hint));
    }
  const double height = resolved_frequency(*fine) * (1 + 1e-12);
  take_up(*fine, hints, height);
  if (!hinted_ && (pool_.empty() || !complete(*fine, height))) search(*fine, height);  // what the reduced has not
  hinted_ = true;
}

}  // namespace stickslip
