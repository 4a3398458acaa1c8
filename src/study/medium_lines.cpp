#include "stickslip/study/medium_lines.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "cycles/cycle_waves.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/waves/train_limits.hpp"

namespace stickslip {

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
