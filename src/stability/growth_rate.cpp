#include "stickslip/stability/boundary.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "stickslip/base/error.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

double Axis::value(double c) const {
  if (c == 0) return from;
  if (c == 1) return to;
  return logarithmic ? from * std::pow(to / from, c) : from + (to - from) * c;
}

Crossing OnAxes::crossing_at(double x, double y) const {
  Crossing c;
  c.x = x;
  c.y = y;
  c.value = value(0, x);
  c.value2 = value(1, y);
  return c;
}

GrowthRate::GrowthRate(MPI_Comm comm, SceneAt scene_at, std::vector<Axis> axes, bool refine)
    : OnAxes(std::move(scene_at), std::move(axes)), comm_(comm), settings_{refine} {
  for (const double x : {0., 1.})
    for (const double y : {0., 1.}) (void)scene(x, y);
}

std::optional<LinearisedOperator> GrowthRate::linearised(double x, double y) const {
  try {
    return LinearisedOperator(scene(x, y));
  } catch (const Failure&) {
    return std::nullopt;
  }
}

// Friction that is flat over a part of the range differs elsewhere.
bool GrowthRate::enters() const {
  constexpr int places = 32;
  const auto first = linearised(0, 0);
  for (int k = 1; k <= places; ++k)
    if (differ(first, linearised(double(k) / places, 0))) return true;
  return false;
}

bool GrowthRate::differ(const std::optional<LinearisedOperator>& a,
                        const std::optional<LinearisedOperator>& b) {
  if (!a || !b || a->A != b->A || a->K0 != b->K0 || a->K1 != b->K1 || a->N != b->N ||
      a->scene.h() != b->scene.h())
    return true;
  for (std::size_t i = 0; i < a->size(); ++i) {
    const LinearPoint p = a->point(i), q = b->point(i);
    if (!(p == q) || p.beta() != q.beta() || p.A != q.A || p.K0 != q.K0) return true;
  }
  const PetscInt last = a->scene.medium.links_differ() ? a->scene.n : 0;
  for (PetscInt i = 0; i < last; ++i)
    if (a->scene.link(i) != b->scene.link(i)) return true;
  return false;
}

// ---- the leading mode

std::optional<LeadingMode> GrowthRate::leading_from(KnownModes& known, double x, double y, bool counted,
                                                    bool only_sign) {
  count_evaluation();
  const std::optional<LinearisedOperator> s = linearised(x, y);
  LeadSettings settings = settings_;
  settings.only_sign = only_sign;
  return s ? lead(comm_, *s, known, counted, settings) : std::nullopt;
}

std::optional<LeadingMode> GrowthRate::leading(double x, double y) {
  if (recent_.modes.empty()) recent_ = nearest(x, y);
  return leading_from(recent_, x, y, true);
}

// Where the place has no cell, or a mode is lost on the way, it is counted here.
std::optional<LeadingMode> GrowthRate::followed(double x, double y, KnownModes& known) {
  count_evaluation();
  const std::optional<LinearisedOperator> s = linearised(x, y);
  if (!s) return std::nullopt;
  if (!is_followed(*s, settings_.refine)) return lead(comm_, *s, known, false, settings_);
  if (const std::optional<CellKey> key = cell_about(*s, x, y)) {
    known = cell(*key, s->size()).known;
    const auto found = lead(comm_, *s, known, false, settings_);
    if (found && known.sure) return found;
  }
  return lead(comm_, *s, known, true, settings_);
}

double GrowthRate::followed(double x, double y) {
  KnownModes known;
  return growth_of(followed(x, y, known));
}

void GrowthRate::learn(double x, double y) {
  KnownModes known;
  const std::optional<LinearisedOperator> s = linearised(x, y);
  if (!followed(x, y, known) || !is_followed(*s, settings_.refine)) return;
  (void)lead(comm_, *s, known, true, settings_);
  if (const std::optional<CellKey> key = cell_about(*s, x, y)) cell(*key, s->size()).known = std::move(known);
}

// ---- cells

// Counted as often as they cost.
double GrowthRate::side() {
  if (side_ == 0) side_ = axes_.size() > 1 ? std::clamp(3 * count_cost(), 0.08, 0.2) : 1. / 16;
  return side_;
}

// The largest cell whose middle has steady sliding and coefficients like those here; nothing where even a
// small one has not.
std::optional<GrowthRate::CellKey> GrowthRate::cell_about(const LinearisedOperator& s, double x, double y) {
  constexpr int halvings = 8;
  const Cell here = coefficients_of(s);
  for (int k = 0; k <= halvings; ++k) {
    const double width = std::ldexp(side(), -k);
    const CellKey key{k, std::int64_t(std::floor(x / width)),
                      axes_.size() > 1 ? std::int64_t(std::floor(y / width)) : 0};
    if (near(here, cell(key, s.size()))) return key;
  }
  return std::nullopt;
}

GrowthRate::Cell& GrowthRate::cell(const CellKey& key, std::size_t nodes) {
  const auto found = cells_.find(key);
  if (found != cells_.end()) return found->second;
  const double width = std::ldexp(side(), -int(key[0]));
  const auto middle = [&](std::int64_t at) { return std::min(1., (double(at) + 0.5) * width); };
  const double x = middle(key[1]), y = axes_.size() > 1 ? middle(key[2]) : 0;
  Cell cell;
  if (const auto s = linearised(x, y)) {
    cell = coefficients_of(*s);
    cell.known = nearest(x, y);
    (void)lead(comm_, *s, cell.known, true, settings_);
  }
  cell.x = x;
  cell.y = y;
  if (double(cells_.size() + 1) * double(nodes) > 250000) cells_.clear();
  return cells_[key] = std::move(cell);
}

KnownModes GrowthRate::nearest(double x, double y) const {
  const Cell* best = nullptr;
  const auto away = [&](const Cell& cell) { return std::hypot(cell.x - x, cell.y - y); };
  for (const auto& [key, cell] : cells_)
    if (!cell.known.modes.empty() && (!best || away(cell) < away(*best))) best = &cell;
  return best ? best->known : KnownModes{};
}

GrowthRate::Cell GrowthRate::coefficients_of(const LinearisedOperator& s) {
  const double slow = s.rate_of(s.K0), fast = s.rate_of(s.largest_stiffness());
  const double massless_unit = s.scene.massless() ? slow / s.mean().beta() : 0;
  Cell cell{slow * slow, fast * fast, {}, {}};
  if (s.N > 0) cell.drag.push_back(s.viscous_rate());
  for (std::size_t i = 0; i < s.size(); ++i) {
    const LinearPoint p = s.point(i);
    cell.drag.push_back((s.scene.massless() ? massless_unit : p.A) * p.slow_beta());
    if (s.has_state()) cell.r.push_back(s.point(i).r());
  }
  return cell;
}

// Whether the coefficients of two places differ by less than half the oscillation's frequency.
bool GrowthRate::near(const Cell& a, const Cell& b) {
  if (a.drag.empty() || a.drag.size() != b.drag.size()) return false;
  const auto ratio = [](double p, double q) { return p == q ? 1 : std::max(p, q) / std::min(p, q); };
  if (!(ratio(a.K0, b.K0) < 2) || !(ratio(a.stiffest, b.stiffest) < 2)) return false;
  const double allowed = 0.5 * std::sqrt(std::max(a.K0, 1e-3 * a.stiffest));
  for (std::size_t i = 0; i < a.drag.size(); ++i)
    if (!(std::abs(a.drag[i] - b.drag[i]) <= allowed) || (!a.r.empty() && !(ratio(a.r[i], b.r[i]) < 2)))
      return false;
  return true;
}

double GrowthRate::operator()(double x, double y) { return growth_of(leading(x, y)); }

// ---- a point of the boundary

namespace {

// LinearisedOperator::mode_residual of a sine wave of the continuum where all nodes are alike; NaN at
// infinite wavenumbers.
double relation_residual(const LinearisedOperator& s, const Mode& m) {
  const double k = m.wavenumber;
  if (!std::isfinite(k)) return std::numeric_limits<double>::quiet_NaN();
  const LinearPoint medium = s.mean();
  const NodeVector x = medium.expand(m.value, 1);
  const auto [psi, eta, state] = balance(medium);
  return std::abs(medium.diagonal(m.value) + medium.stiffness(k * k)) / eta /
         std::sqrt(1 + std::norm(x.eta / eta) + std::norm(x.state / state));
}

}  // namespace

Crossing GrowthRate::crossing(double x, double y) { return crossing(x, y, leading(x, y)); }

Crossing GrowthRate::crossing(double x, double y, const std::optional<LeadingMode>& at) const {
  if (!at) throw Failure("no steady sliding on the boundary");
  const LinearisedOperator s(scene(x, y));
  Mode m = at->mode;
  const bool wave = m.psi.empty();  // of a relation
  if (lead_without_grid(s, settings_.refine)) {
    m.residual = relation_residual(s, m);
  } else {
    if (wave) m.psi = s.wave(m.wavenumber);
    if (wave && s.neutral())
      m.residual = s.mode_residual(m.value, m.psi);  // near a double zero
    else
      polish(s, m);
  }
  Crossing c = crossing_at(x, y);
  c.growth = m.value.real();
  c.frequency = m.value.imag();
  c.wavenumber = m.wavenumber;
  c.residual = m.residual;
  c.degenerate = at->degenerate;
  const double k = std::isfinite(m.wavenumber) ? m.wavenumber : 0;
  c.kind = c.frequency <= 1e-6 * (s.rate_of(s.K0 + s.K1 * k * k) + std::abs(c.growth)) ? "zero" : "hopf";
  return c;
}

Criticality GrowthRate::criticality(const Crossing& c) {
  return criticality(c, c.kind == "hopf" ? leading(c.x, c.y) : std::nullopt);
}

Criticality GrowthRate::criticality(const Crossing& c, const std::optional<LeadingMode>& at) const {
  Criticality found;
  if (c.kind != "hopf" || !at) {
    found.why_not = "the mode does not oscillate";
    return found;
  }
  const SteadySliding steady(scene(c.x, c.y));
  const LinearisedOperator s(steady);
  return stickslip::criticality(steady, s, at->mode, bool(lead_without_grid(s, settings_.refine)));
}

bool GrowthRate::vanishes(const Crossing& c) const {
  const double frequency = std::isfinite(c.frequency) ? c.frequency : 0;
  return std::abs(c.growth) <= 1e-6 * (scales_of(scene(c.x, c.y)).rate + frequency);
}

bool GrowthRate::near_shortest(const Crossing& c) const {
  const LinearisedOperator s(scene(c.x, c.y));
  return s.scene.form == Form::continuum && !lead_without_grid(s, settings_.refine) &&
         c.frequency > 0.9 * resolved_frequency(s);
}

void GrowthRate::count_growing(Crossing& c) const {
  const LinearisedOperator s(scene(c.x, c.y));
  if (all_known(s, settings_.refine)) {  // the growth rate is the largest of all there
    c.complete = true;
    return;
  }
  const double margin = count_margin(s, c.frequency) + std::max(0., 2 * c.growth);
  auto count = count_leading(comm_, s, margin, settings_.refine);
  if (!count) count = count_leading(comm_, s, 10 * margin, settings_.refine);
  c.complete.reset();
  if (count) c.complete = *count == 0;
}

double GrowthRate::count_cost() const {
  for (const double x : {0.5, 0.3, 0.7, 0.1, 0.9}) {
    const auto s = linearised(x, x);
    if (!s) continue;
    if (all_known(*s, settings_.refine)) return 0;
    static constexpr double microseconds[] = {0.6, 2.2, 2.8, 3};  // by order, of the tree
    const double n = double(s->size()),
                 each = s->scene.form == Form::chain ? 2 : microseconds[s->scene.order / 2 - 1];
    return 1e-6 * each * n * std::log2(n) + 1e-3;
  }
  std::string reason;
  try {
    (void)LinearisedOperator(scene(0.5, 0.5));
  } catch (const Failure& e) {
    reason = e.what();
  }
  throw Failure("sliding cannot be looked at anywhere in the box; in its middle: " + reason);
}

// ---- other grids

std::optional<GrowthRate> GrowthRate::finer() const {
  if (scene(0.5, 0.5).form == Form::chain) return std::nullopt;
  const auto halved = [at = scene_at_](double value, double value2) {
    Scene scene = at(value, value2);
    scene.n = scene.ring() ? 2 * scene.n : 2 * scene.n - 1;
    return scene;
  };
  return GrowthRate(comm_, halved, axes_, settings_.refine);
}

namespace {

constexpr double parts[] = {0, 0.25, 0.5, 0.75, 1};  // of each axis, where the box is looked at as a whole

// The growth rate and frequency that a medium with the mean coefficients has on this grid.
Complex mean_growth(const LinearisedOperator& s) {
  const double height = resolved_frequency(s);
  const LinearPoint medium = s.mean();
  Complex best(-std::numeric_limits<double>::infinity(), 0);
  for (int j = 0; j <= 2000; ++j) {
    const double k = M_PI / s.scene.h() * std::pow(j / 2000., 2);
    for (const Complex& z : dispersion(medium, s.symbol(k)))
      if (z.imag() >= 0 && z.imag() <= height && z.real() > best.real()) best = z;
  }
  return best;
}

// Intervals that a scene needs to show what its layers and its draws of friction do.
double intervals_needed(const Scene& s) {
  constexpr double nodes = 8, blocks = 1024;
  if (s.form == Form::chain) return std::max(blocks, 32 * std::sqrt(s.k1 / std::max(s.k0, 1e-300)));
  if (s.c == 0) return std::numeric_limits<double>::infinity();
  return nodes * s.length / std::min(s.c, s.friction_length());
}

}  // namespace

// Whether a coarser grid favours what this one does, as far as a medium with the mean coefficients tells;
// false, too, where no place of the box needs a grid at all.
bool GrowthRate::grid_suffices(const GrowthRate& coarse) const {
  bool needed = false;
  for (const double x : parts)
    for (const double y : parts) {
      const auto a = linearised(x, y), b = coarse.linearised(x, y);
      if (!a || !b || all_known(*a, settings_.refine)) continue;
      needed = true;
      if (a->scene.form == Form::chain) continue;
      const Complex fine = mean_growth(*a), rough = mean_growth(*b);
      if (std::abs(fine.real() - rough.real()) > 0.01 * (std::abs(rough) + a->rate)) return false;
    }
  return needed;
}

std::optional<GrowthRate> GrowthRate::reduced() const {
  if (!settings_.refine) return std::nullopt;  // another grid has other modes of its own
  double intervals = 0;
  PetscInt n = 0;
  for (const double x : parts)
    for (const double y : parts) {
      const Scene s = scene(x, y);
      n = s.n;
      intervals = std::max(intervals, intervals_needed(s));
    }
  if (!(intervals + 1 < double(n) / 2)) return std::nullopt;
  const PetscInt fewer = std::max(64., std::ceil(intervals) + 1);
  const auto coarser = [at = scene_at_, fewer](double value, double value2) {
    Scene scene = at(value, value2);
    if (scene.form == Form::chain) scene.length = double(scene.ring() ? fewer : fewer - 1);
    scene.n = fewer;
    scene.order = 2;
    return scene;
  };
  GrowthRate coarse(comm_, coarser, axes_, settings_.refine);
  if (!grid_suffices(coarse)) return std::nullopt;
  coarse.settings_.slack = 1e-4;
  return coarse;
}

namespace {

// Modes of another grid as guesses: between its nodes; of a shorter chain, trapped at either end.
void take_to_grid(const LinearisedOperator& from, const LinearisedOperator& to,
                  const std::vector<std::vector<Complex>*>& shapes) {
  if (to.scene.form == Form::continuum) return interpolate(from, to, shapes);
  for (std::vector<Complex>* p : shapes)
    p->insert(p->begin() + p->size() / 2, to.size() - from.size(), Complex(0));
}

}  // namespace

void GrowthRate::take_hints(KnownModes& known, const GrowthRate& other, const KnownModes& modes, double x,
                            double y) const {
  const auto here = linearised(x, y), there = other.linearised(x, y);
  if (!here || !there || !is_followed(*here, settings_.refine)) return;
  std::vector<FollowedMode> hints;
  for (const FollowedMode& f : modes.modes)
    if (f.mode.psi.size() == there->size()) hints.push_back(f);
  std::vector<std::vector<Complex>*> shapes;
  for (FollowedMode& f : hints) shapes.insert(shapes.end(), {&f.mode.psi, &f.left});
  take_to_grid(*there, *here, shapes);
  take_up(*here, known, hints, settings_);
}

}  // namespace stickslip
