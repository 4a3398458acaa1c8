#include "study/forced_boundary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "cycles/cycle_waves.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

namespace {

// Those of its grid; in the continuum the longest of these, without what the grid makes of them.
Waves waves_of(const Scene& scene) {
  const Waves grid = Waves::of(scene);
  return scene.form == Form::chain ? grid : Waves::of_continuum(scene, grid.resolved(scene).count);
}

// What has the slide: one node stands for all where they are alike.
bool stands_for_all(const Scene& scene) { return scene.nodes_alike() && !scene.any_held(); }
Scene cell_of(const Scene& scene) { return stands_for_all(scene) ? one_node_of(scene) : scene; }

}  // namespace

SlideStability stability_of_slide(const Scene& scene, const SmoothCycle& slide) {
  constexpr double round_off = 1e-12;  // of a multiplier
  SlideStability out;
  out.least = least_along(slide.cycle, scene.v);
  out.period = slide.cycle.period;
  out.residual = slide.cycle.residual;
  out.multiplier = slide.cycle.multipliers.front();
  if (stands_for_all(scene) && scene.n > 1 && scene.K1() > 0) {
    const Waves waves = waves_of(scene);
    Deviations deviations(slide);
    const auto size = [&](std::int64_t j) {
      if (waves.k(j) == 0) return 0.;
      const std::complex<double> mu = deviations.of_wave(waves.kappa2(j)).front();
      if (std::abs(mu) > std::abs(out.multiplier)) {
        out.multiplier = mu;
        out.wavenumber = waves.k(j);
      }
      return std::abs(mu);
    };
    (void)fastest_of(0, waves.count - 1, size, false);
  }
  const double turns = std::log(std::abs(out.multiplier));
  out.growth = std::abs(turns) <= round_off + slide.cycle.error_estimate ? 0 : turns / out.period;
  return out;
}

const ForcedBoundary::Found* ForcedBoundary::nearest(double x, double y) const {
  const auto away = [&](const Found& found) { return std::hypot(found.x - x, found.y - y); };
  const auto found = std::min_element(slides_.begin(), slides_.end(),
                                      [&](const Found& a, const Found& b) { return away(a) < away(b); });
  return found == slides_.end() ? nullptr : &*found;
}

// In steps along the straight line from another place.
SmoothCycle ForcedBoundary::led_to(double x, double y, const Found& from) const {
  constexpr double least_step = 1. / 8;
  SmoothCycle slide = from.slide;
  for (double passed = 0, step = 1; passed < 1;) {
    const double part = std::min(1., passed + step);
    try {
      const Scene there = scene(from.x + part * (x - from.x), from.y + part * (y - from.y));
      slide = forced_slide_near(slide, cell_of(there));
    } catch (const Failure&) {
      if ((step /= 2) < least_step) throw;
      continue;
    }
    passed = part;
  }
  return slide;
}

// The stable one that the motion settles on from another.
SmoothCycle ForcedBoundary::settled_from(double x, double y, const Found& from) const {
  const Cycle& near = from.slide.cycle;
  const Scene cell = cell_of(scene(x, y));
  if (cell.friction.sticks() || near.nodes != cell.n) throw Failure("the motion is not followed");
  const double* begin = near.at(0, 0);
  const SmoothCycle found =
      settled_cycle(cell, {begin, begin + std::size_t(near.nodes * near.dof)}, turns_to_settle);
  if (found.cycle.forcing_periods != 1 || !(growth_rate(found.cycle) < 0))
    throw Failure("the motion settles on no slide of the load's period");
  return found;
}

// By making the load grow, or from the nearest slide that was found before: first the way by which that one
// was found. Where a slide changes so fast that neither gets there, the motion may settle on it.
SmoothCycle ForcedBoundary::slide_at(double x, double y) {
  constexpr std::size_t kept = 100;
  const Found* const other = nearest(x, y);
  Found found{x, y, {}, other && other->led};
  const auto find = [&] { return found.led ? led_to(x, y, *other) : forced_slide(cell_of(scene(x, y))); };
  try {
    found.slide = find();
  } catch (const Failure&) {
    if (!other) throw;
    found.led = !found.led;
    try {
      found.slide = find();
    } catch (const Failure& failure) {
      try {
        found.slide = settled_from(x, y, *other);
      } catch (const Failure&) {
        throw failure;
      }
    }
  }
  if (slides_.size() < kept) slides_.push_back(found);
  return std::move(found.slide);
}

bool ForcedBoundary::look(double x, double y) {
  count_evaluation();
  const Scene here = scene(x, y);
  sticks_ = here.friction.sticks();
  try {
    seen_ = stability_of_slide(here, slide_at(x, y));
  } catch (const Error& failure) {
    why_not_ = failure.what();
    return false;
  }
  why_not_ = sticks_ && !(seen_.least > 0) ? "it comes to a stop" : "";
  return true;
}

double ForcedBoundary::operator()(double x, double y) {
  return look(x, y) && why_not_.empty() ? seen_.growth : std::nan("");
}

double ForcedBoundary::least(double x) { return look(x, 0) ? seen_.least : std::nan(""); }

Crossing ForcedBoundary::crossing(double x, double y) {
  Crossing c = crossing_at(x, y);
  c.growth = (*this)(x, y);
  c.residual = seen_.residual;
  c.wavenumber = seen_.wavenumber;
  const std::complex<double> mu = seen_.multiplier;
  c.frequency = std::abs(std::arg(mu)) / seen_.period;
  const Passing way = passing(mu);
  c.kind = way == Passing::as_pair ? "torus" : way == Passing::at_minus_one ? "flip" : "fold";
  return c;
}

// Parts of the first axis where no slide is found, each from where one was seen last to where one is again.
void ForcedBoundary::note_lost(const std::vector<Sample>& samples, BoundaryFindings& findings) {
  constexpr double near = 1. / 64;  // what looks for a slide in vain is slow
  std::string why;
  const auto there = [&](double x) {
    const bool lost = std::isnan((*this)(x));
    if (lost) why = why_not_;
    return !lost;
  };
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (!std::isnan(samples[k].f)) continue;
    const std::size_t first = k;
    while (k + 1 < samples.size() && std::isnan(samples[k + 1].f)) ++k;
    why.clear();
    if (there(samples[first].x)) continue;  // from what was found since
    const double begin = first == 0 ? 0 : last_place(there, samples[first - 1].x, samples[first].x, near);
    const double end = k + 1 == samples.size() ? 1 : last_place(there, samples[k + 1].x, samples[k].x, near);
    findings.notes.push_back(fmt::format("no slide under the load from {} {} to {}: {}", axes_[0].name,
                                         number_text(axes_[0].value(begin)),
                                         number_text(axes_[0].value(end)), why));
    findings.turns.insert(findings.turns.end(), {begin, end});
  }
}

// Where psi comes to 0 while nothing grows.
void ForcedBoundary::add_stops(const std::vector<Sample>& least_at, std::vector<Crossing>& found) {
  for (const Bracket& bracket : brackets_of(least_at)) {
    const double at = find_root([&](double x) { return least(x); }, bracket, 1e-12);
    if (std::isnan(at)) continue;
    Crossing c = crossing(at, 0);
    if (seen_.growth > 0) continue;
    c.kind = "stop";
    c.growth = seen_.growth;
    c.frequency = 2 * M_PI / seen_.period;
    c.wavenumber = 0;
    found.push_back(c);
  }
}

std::vector<Crossing> ForcedBoundary::points(BoundaryFindings& findings) {
  constexpr int pieces = 32;
  std::map<double, double> least_seen;
  const auto growth = [&](double x) {
    const double found = (*this)(x);
    least_seen[x] = sticks_ && (why_not_.empty() || !(seen_.least > 0)) ? seen_.least : std::nan("");
    return found;
  };
  std::vector<Sample> samples = samples_of_unit(growth, pieces);
  mend_ends(growth, samples);  // an end without a sine
  for (std::size_t k = samples.size() - 1; k-- > 0;)  // from the slide behind it
    if (std::isnan(samples[k].f) && !std::isnan(samples[k + 1].f)) samples[k].f = growth(samples[k].x);
  std::vector<Sample> least_at;
  findings.samples.side = pieces + 1;
  for (const Sample& sample : samples) {
    findings.samples.growth.push_back(sample.f);
    least_at.push_back({sample.x, least_seen[sample.x]});
  }
  const std::vector<Bracket> zeros =
      zeros_shown([&](double x) { return (*this)(x); }, axes_[0], samples, findings);
  note_lost(samples, findings);
  std::vector<Crossing> found;
  for (const Bracket& bracket : zeros) {
    const double at = find_root(*this, bracket, 1e-13);
    if (std::isnan(at))
      findings.notes.push_back("the slide under the load is lost near " + place_text(axes_, bracket.a, 0) +
                               ": " + why_not_);
    else
      found.push_back(crossing(at, 0));
  }
  add_stops(least_at, found);
  std::sort(found.begin(), found.end(), [](const Crossing& a, const Crossing& b) { return a.x < b.x; });
  return found;
}

std::vector<Crossing> ForcedBoundary::curve(PetscInt count, BoundaryFindings& findings) {
  const LineInBox line{"the curve", "there (nothing slides without a stop beyond)", 16, 1. / 40, 1e-7};
  const auto at = [&](double x, double y) { return crossing(x, y); };
  return zeros_in_box([&](double x, double y) { return (*this)(x, y); }, axes_, line, count, at,
                      findings.samples, findings.notes);
}

}  // namespace stickslip
