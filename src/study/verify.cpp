#include "stickslip/study/verify.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/pulse.hpp"
#include "cycles/cycle_waves.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/output/regime.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/waves/train_limits.hpp"
#include "study/simulate.hpp"
#include "time/tiles.hpp"

namespace stickslip {

namespace {

// A start about steady sliding: psi_i = steady + amplitude (1 + cos(k x))/2 at the nodes solved for, eta and
// state steady.
void start_beside(const Model& model, const SteadySliding& s, double amplitude, double k, Vec u) {
  const Writing x(u);
  for (PetscInt i = 0; i < model.local(); ++i) {
    const PetscInt node = model.first() + i;
    double* at = x + i * model.dof();
    at[0] = s.psi[node] + (model.held(node) ? 0 : amplitude * (0.5 + 0.5 * std::cos(k * s.scene.x(node))));
    at[1] = s.eta[node];
    if (model.dof() == 3) at[2] = s.state[node];
  }
}

// of a motion: stiff friction can ask for a hundred times that
constexpr std::int64_t most_steps = 1000000;

// Where the motion from u goes, as `run` would say it; a run that leaves it open is prolonged to the time
// that would decide, up to four times as long, and undecided where it takes too many steps. The method is the
// program's own choice for the scene, adaptive and accurate: the user's -ts_ options do not reach it, since a
// damping method with long steps would make sliding look stable (docs/methods.md). Collective over the
// model's ranks.
Motion regime_from(const Options& options, const Model& model, const SteadySliding& s, double growth, Vec u,
                   double duration) {
  Integrator integrator(model, MethodSpec::from(options), u, "verify_");
  Regime regime(model, duration, [&s](PetscInt node) { return s.psi[node]; });
  regime.know(growth, growth);
  double t = 0;
  for (double end = duration;;) {
    simulate(integrator, u, {t, end, most_steps}, {&regime});
    if (integrator.report().steps >= most_steps) return Motion::undecided;
    t = end;
    const Measured& found = regime.result(u);
    if (!found.time_to_decide || *found.time_to_decide > 4 * duration || *found.time_to_decide <= t)
      return found.motion;
    end = *found.time_to_decide;
  }
}

// A small grid, which every rank would take as a whole in each step, is followed by every rank on its own:
// its steps are shorter than what ranks tell each other in one, which takes milliseconds where cores are
// shared with other programs.
MPI_Comm followers(const Scene& scene) {
  return scene.n <= closed_nodes ? PETSC_COMM_SELF : PETSC_COMM_WORLD;
}

Verified at_place(const GrowthRate& growth, double x, double y, double rate) {
  const std::vector<Axis>& axes = growth.axes();
  Verified v;
  v.value = axes[0].value(x);
  v.value2 = axes.size() > 1 ? axes[1].value(y) : 0;
  v.growth = rate;
  return v;
}

using StartOf = std::function<void(const Model&, Vec)>;

// Where two motions of the scene with these options go, one from near sliding and one from far away.
void follow_both(Verified& v, const Options& options, const Scene& scene, const SteadySliding& s,
                 double duration, const StartOf& start_near, const StartOf& start_far) {
  const Model model(followers(scene), scene);
  const auto motion = [&](const StartOf& start) {
    VecHandle u = model.create_vector();
    start(model, u);
    Motion found = regime_from(options, model, s, v.growth, u, duration);
    broadcast(found);
    return found;
  };
  const Motion near = motion(start_near), far = motion(start_far);
  v.from_sliding = to_string(near);
  v.from_stick_slip = to_string(far);
  v.regime = near == far                                            ? to_string(near)
             : near == Motion::sliding && far == Motion::stick_slip ? "bistable"
                                                                    : to_string(Motion::undecided);
}

// The direction across the curve, unit length, towards the growing side; empty where nothing changes.
std::optional<std::pair<double, double>> across(GrowthRate& growth, const Crossing& c) {
  const double step = 1e-4;
  const auto difference = [&](double dx, double dy) {
    const auto in = [](double t) { return std::clamp(t, 0., 1.); };
    return growth(in(c.x + dx), in(c.y + dy)) - growth(in(c.x - dx), in(c.y - dy));
  };
  const double nx = difference(step, 0), ny = growth.axes().size() > 1 ? difference(0, step) : 0;
  const double length = std::hypot(nx, ny);
  if (!(length > 0)) return std::nullopt;
  return std::pair(nx / length, ny / length);
}

// Where the growth rate is 1 % of the frequency, so that it shows in a run of reasonable length.
struct Beside {
  double x, y;
  LeadingMode leading;
};

std::optional<Beside> place_beside(GrowthRate& growth, const Crossing& c, double nx, double ny) {
  for (double reach = 0.02; reach <= 0.3; reach *= 1.6) {
    const double x = c.x + reach * nx, y = c.y + reach * ny;
    if (x < 0 || x > 1 || y < 0 || y > 1) break;
    auto at = growth.leading(x, y);
    if (!at) continue;
    const double own = scales_of(growth.scene(x, y)).rate;
    const double frequency = std::isfinite(at->mode.value.imag()) ? at->mode.value.imag() : own;
    if (std::abs(at->mode.value.real()) >= 0.01 * (frequency + 0.1 * own)) return Beside{x, y, *at};
  }
  return std::nullopt;
}

Verified check_beside(const GrowthRate& growth, const Options& options, const Beside& place) {
  const Mode& mode = place.leading.mode;
  const SteadySliding s(growth.scene(place.x, place.y));
  const SceneScales scales = scales_of(s.scene);
  const double own = scales.rate, rate = std::abs(mode.value.real());
  const double duration = std::min(3000 / own, 9 / rate + 60 / own);
  const double velocity = scales.slip.psi;
  const double longest = (s.scene.ring() ? 2 : 1) * M_PI / s.scene.length;
  const double k = mode.wavenumber == 0 ? longest
                   : std::isfinite(mode.wavenumber)
                       ? mode.wavenumber
                       : longest * std::max(1., std::floor(double(s.scene.n) / 8));
  Verified v = at_place(growth, place.x, place.y, mode.value.real());
  v.expected = v.growth > 0 ? "stick-slip" : "sliding";
  const Options there = options_with(options, growth.axes(), v.value, v.value2);
  const auto perturbed = [&](double amplitude) {
    return [&, amplitude](const Model& model, Vec u) { start_beside(model, s, amplitude, k, u); };
  };
  follow_both(v, there, Scene::from(there, false), s, duration, perturbed(0.01 * velocity),
              perturbed(2 * velocity));
  return v;
}

}  // namespace

std::vector<Verified> verify_boundary(GrowthRate& growth, const Options& options,
                                      const std::vector<Crossing>& points, PetscInt count,
                                      const std::function<void(std::size_t, std::size_t)>& before_each) {
  std::vector<Verified> result;
  const std::size_t wanted = std::min(points.size(), std::size_t(count));
  for (std::size_t j = 0; j < wanted; ++j) {
    const Crossing& c = points[wanted == 1 ? points.size() / 2 : j * (points.size() - 1) / (wanted - 1)];
    const auto normal = across(growth, c);
    if (!normal) continue;
    for (const double side : {1., -1.}) {  // unstable, stable
      if (before_each) before_each(2 * j + (side > 0 ? 0 : 1), 2 * wanted);
      if (const auto place = place_beside(growth, c, side * normal->first, side * normal->second))
        result.push_back(check_beside(growth, options, *place));
    }
  }
  return result;
}

namespace {

// On the cycle whose end is checked. Where none was found: one node at rest without force, its state as after
// sliding at v; loaded, it slips from its threshold.
void start_on(const std::vector<double>& cycle, const Model& model, const SteadySliding& s, Vec u) {
  const Writing x(u);
  x[0] = x[1] = 0;
  if (model.dof() == 3) x[2] = s.state[0];
  for (std::size_t k = 0; k < cycle.size(); ++k) x[k] = cycle[k];
}

// What the end says of a motion that starts on the cycle. One that goes on without rests is an oscillation to
// a run as well.
std::string expected_of(StickSlipEnd& end, double x, double y) {
  return end(x, y) < 0 || end.fate(x, y) == to_string(Fate::oscillates) ? "stick-slip" : "sliding";
}

// `cycle`: a place of the one that exists beside the end.
Verified check_end(GrowthRate& growth, StickSlipEnd& end, const Options& options, const Crossing& c,
                   const std::vector<double>& cycle, double x, double y) {
  const Scene one = end.scene(x, y);  // a node
  const SteadySliding s(one);
  Verified v = at_place(growth, x, y, growth(x, y));
  v.of = "stick-slip";
  v.expected = expected_of(end, x, y);
  const Options there = options_with(options, growth.axes(), v.value, v.value2);
  // Long enough to grow or decay, for many slips, and for the loading of a node at rest (which is one step).
  const double load = !one.friction.sticks()
                          ? 0
                          : Friction::of(one.friction)->threshold(s.state.empty() ? 0 : s.state[0]).value /
                                (one.K0() * std::abs(one.v));
  const SceneScales scales = scales_of(one);
  const double own = scales.rate, rate = std::max(1e-3 * own, std::abs(v.growth));
  const double duration = std::min(3000 / own, 9 / rate + 100 / c.frequency) + 8 * load;
  const double small = 0.01 * scales.slip.psi;
  follow_both(
      v, there, one, s, duration, [&](const Model& model, Vec u) { start_beside(model, s, small, 0, u); },
      [&](const Model& model, Vec u) { start_on(cycle, model, s, u); });
  return v;
}

}  // namespace

std::vector<Verified> verify_end(GrowthRate& growth, StickSlipEnd& end, const Options& options,
                                 const std::vector<Crossing>& points, PetscInt count,
                                 const std::function<void(std::size_t, std::size_t)>& before_each) {
  constexpr double step = 1e-5, reach = 0.02;  // of the box
  std::vector<Verified> result;
  const std::size_t wanted = std::min(points.size(), std::size_t(count));
  for (std::size_t j = 0; j < wanted; ++j) {
    const Crossing& c = points[wanted == 1 ? points.size() / 2 : j * (points.size() - 1) / (wanted - 1)];
    const auto difference = [&](double dx, double dy) {
      return end(c.x + dx, c.y + dy) - end(c.x - dx, c.y - dy);
    };
    const bool known = std::hypot(c.nx, c.ny) > 0;
    const double nx = known ? -c.nx : difference(step, 0);
    const double ny = known ? -c.ny : growth.axes().size() > 1 ? difference(0, step) : 0;
    const double length = std::hypot(nx, ny);
    if (!(length > 0)) continue;
    const auto beside = [&](double side) {
      return PlanePoint{c.x + side * reach * nx / length, c.y + side * reach * ny / length};
    };
    const auto inside = [](const PlanePoint& p) { return p.x >= 0 && p.x <= 1 && p.y >= 0 && p.y <= 1; };
    // from another state of contact, healed too little say, the motion may settle elsewhere
    const std::vector<double> cycle =
        inside(beside(-1)) ? end.on_cycle(beside(-1).x, beside(-1).y) : std::vector<double>();
    for (const double side : {-1., 1.}) {  // where it sticks and slips, where it does not
      if (before_each) before_each(2 * j + (side < 0 ? 0 : 1), 2 * wanted);
      const PlanePoint at = beside(side);
      if (inside(at)) result.push_back(check_end(growth, end, options, c, cycle, at.x, at.y));
    }
  }
  return result;
}

Options options_with(const Options& options, const std::vector<Axis>& axes, double value, double value2) {
  Options o = options;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const double here = k == 0 ? value : value2;
    o = o.with(axes[k].name, here);
    for (const std::string& name : axes[k].same) o = o.with(name, here);
  }
  return o;
}

SceneAt scene_of(const Options& options, const std::vector<Axis>& axes) {
  return [options, axes](double value, double value2) {
    return Scene::from(options_with(options, axes, value, value2), true);
  };
}

namespace {

constexpr double strong_slip = 10;  // friction forces above sliding: of several cycles the outermost
constexpr int cells = 8;            // of the lattice for waves
// c k T of the shortest wave looked at: beyond, the mean damping decides
constexpr double turns_of_shortest = 100;
constexpr int branch_steps = 60, line_steps = 60;
constexpr double same_place = 0.02;      // of the box: between a point of a polygon and its line
constexpr double same_frequency = 0.03;  // of that of the train: there

// Whether a line passes a limit: its height near by, with the same mode.
bool passes(const std::vector<TrainLimit>& line, const TrainLimit& limit) {
  for (std::size_t k = 0; k + 1 < line.size(); ++k) {
    const TrainLimit &a = line[k], &b = line[k + 1];
    const double rise = b.value2 - a.value2, part = rise == 0 ? 0 : (limit.value2 - a.value2) / rise;
    const auto far = [&](double TrainLimit::*of) {
      return std::abs(a.*of + part * (b.*of - a.*of) - limit.*of);
    };
    if (part >= 0 && part <= 1 && far(&TrainLimit::value) < same_place && a.kind == limit.kind &&
        far(&TrainLimit::frequency) < same_frequency * 2 * M_PI / limit.period)
      return true;
  }
  return false;
}

// Of deviations from the uniform oscillation of this frequency the one that grows fastest.
struct FastestDeviation {
  double growth, wavenumber, frequency;
};

FastestDeviation fastest_on_uniform(const Scene& ring) {
  try {
    const SmoothCycle cycle = uniform_cycle(one_node_of(ring), 1e-8, strong_slip);
    FastestDeviation fastest{growth_rate(cycle.cycle), 0, 2 * M_PI / cycle.cycle.period};
    if (fastest.growth > 0) return fastest;
    Deviations deviations(cycle);
    // of ever shorter waves
    if (ring.nu == 0) fastest.growth = std::max(fastest.growth, -deviations.mean_damping() / 2);
    const double period = cycle.cycle.period, unit = 2 * M_PI / ring.length;
    const auto growth_of = [&](std::int64_t m) {
      const double k = double(m) * unit;
      const double growth = std::log(std::abs(deviations.of_wave(k * k).front())) / period;
      if (growth > fastest.growth) fastest = {growth, k, fastest.frequency};
      return growth;
    };
    const double last = turns_of_shortest / (unit * ring.c * period);
    (void)fastest_of(1, std::int64_t(std::min(last, 1e15)), growth_of, false);
    return fastest;
  } catch (const Failure&) {
    return {std::nan(""), std::nan(""), std::nan("")};
  }
}

}  // namespace

double growth_on_uniform(const Scene& ring) { return fastest_on_uniform(ring).growth; }

MediumLines::MediumLines(SceneAt scene_at, std::vector<Axis> axes, PetscInt pulses,
                         std::function<void()> each)
    : OnAxes(std::move(scene_at), std::move(axes)), pulses_(pulses) {
  watch(std::move(each));
}

std::string MediumLines::refusal(const Scene& s) {
  if (s.form == Form::chain) return "trains are those of a continuum (model_form continuum)";
  if (!s.ring()) return "trains and the waves counted are those of a ring (bc_left periodic)";
  try {
    check_train_scene(s);
  } catch (const UsageError& e) {
    return e.what();
  }
  return "";
}

Crossing MediumLines::crossing(double x, double y, const char* of) const {
  Crossing c = crossing_at(x, y);
  c.of = of;
  c.growth = c.residual = std::nan("");
  return c;
}

std::vector<Crossing> MediumLines::waves(PetscInt count, std::vector<std::string>& notes) {
  const PlaneFunction f = [&](double x, double y) {
    count_evaluation();
    return growth_on_uniform(scene(x, y));
  };
  Pulse::stage("line of waves on the oscillation");
  const auto at = [&](double x, double y) {
    Crossing c = crossing(x, y, "waves");
    c.kind = "wave";
    const FastestDeviation fastest = fastest_on_uniform(scene(x, y));
    c.frequency = fastest.frequency;
    c.wavenumber = fastest.wavenumber;
    return c;
  };
  Samples samples;
  const LineInBox line{"the line of waves on the oscillation", "is found", cells, 1. / 16};
  std::vector<Crossing> found = zeros_in_box(f, axes_, line, count, at, samples, notes);
  growth_ = std::move(samples.growth);
  return found;
}

// The trains at the height y of the box, and the lines that bound the stable ones among them.
void MediumLines::follow_trains(double y, std::vector<TrainLimitLine>& lines,
                                std::vector<std::string>& notes) {
  const TrainFamily2 family{axes_[0].name, axes_[1].name, [&](double x, double y2) {
                              const Scene here = scene(x, y2);
                              return TrainCase{here, {pulses_, here.length, {}}};
                            }};
  const TrainFamily slice{axes_[0].name, [&](double x) { return family.at(x, y); }};
  const auto known = [&](const TrainLimit& limit) {
    return std::any_of(lines.begin(), lines.end(), [&](auto& line) { return passes(line.limits, limit); });
  };
  std::vector<std::pair<double, double>> passed;
  for (const double x : {0., 1., 0.5, 0.25, 0.75}) {
    if (std::any_of(passed.begin(), passed.end(), [&](auto& p) { return x >= p.first && x <= p.second; }))
      continue;
    for (const double to : {1., 0.}) {
      if (to == x) continue;
      count_evaluation();
      Branch branch;
      try {
        branch = continue_train(slice, x, to, branch_steps);
      } catch (const Failure&) {  // no train there
        break;
      }
      beat("branches");  // one that a signal ended is no answer
      std::pair<double, double> reach{x, x};
      for (const BranchPoint& p : branch.points)
        reach = {std::min(reach.first, p.value), std::max(reach.second, p.value)};
      passed.push_back(reach);
      const StableTrains found = stable_trains(family, branch, y, line_steps, known);
      lines.insert(lines.end(), found.lines.begin(), found.lines.end());
      samples_.insert(samples_.end(), found.samples.begin(), found.samples.end());
      const std::string where = "trains at " + axes_[1].name + " " + number_text(axes_[1].value(y)) + ": ";
      if (found.lost > 0)
        notes.push_back(fmt::format("{}{}{} of their stability seen and not located", where, found.lost,
                                    found.lost == 1 ? " end" : " ends"));
      if (int(branch.points.size()) > branch_steps)
        notes.push_back(fmt::format("{}followed for {} steps only, to {} {:.6g}", where, branch_steps,
                                    axes_[0].name, axes_[0].value(branch.points.back().value)));
    }
  }
}

std::vector<Crossing> MediumLines::trains(PetscInt count, std::vector<std::string>& notes) {
  std::vector<TrainLimitLine> lines;
  for (const double y : {0., 0.5, 1.}) {
    Pulse::stage(
        fmt::format("trains at {} {:.6g}, {} lines so far", axes_[1].name, axes_[1].value(y), lines.size()));
    follow_trains(y, lines, notes);
  }
  std::vector<CurvePiece> pieces;
  for (const TrainLimitLine& line : lines) pieces.push_back(line.piece);
  const std::vector<std::vector<CurvePlace>> places = even_places(pieces, count);
  std::vector<Crossing> result;
  for (std::size_t number = 0; number < lines.size(); ++number) {
    for (const CurvePlace& place : places[number]) {
      count_evaluation();
      const std::optional<TrainLimit> limit = lines[number].at(place);
      // where others have taken the lead trains are unstable on both sides
      if (!limit || !limit->leads.value_or(false)) continue;
      Crossing c = crossing(limit->value, limit->value2, "trains");
      c.kind = limit->kind;
      c.frequency = limit->frequency;
      c.wavenumber = limit->wavenumber;
      c.piece = int(number);
      result.push_back(c);
    }
  }
  note_stuck("the line of trains' limits", "is found", axes_, pieces, notes);
  return result;
}

}  // namespace stickslip
