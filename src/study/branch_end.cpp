
#include "study/end_line.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/stick_slip_end.hpp"

namespace stickslip {

namespace {

// cells; of a square every third line is asked first
constexpr int samples_of_line = 32, side = 24, coarse = 3;
constexpr int places_of_cell = 8, lines_of_square = 4;
constexpr int most_steps = 400;     // of a branch
constexpr int most_passes = 3;      // over the samples of a square
constexpr double strong_slip = 10;  // friction forces above sliding, as strong_slips_last has them
constexpr double past_hopf = 0.02;  // of the way between two samples
constexpr double vanished = 1e-3;  // amplitude, over that at the beginning of a branch

// A and B on different sides of the line through c and d, and these of that through a and b.
bool cross(PlanePoint a, PlanePoint b, PlanePoint c, PlanePoint d) {
  const auto turn = [](PlanePoint p, PlanePoint q, PlanePoint r) {
    return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
  };
  return turn(a, b, c) * turn(a, b, d) <= 0 && turn(c, d, a) * turn(c, d, b) <= 0;
}
bool crosses(const EndLine& line, PlanePoint a, PlanePoint b) {
  for (std::size_t k = 0; k + 1 < line.piece.points.size(); ++k)
    if (cross(a, b, line.piece.points[k], line.piece.points[k + 1])) return true;
  return false;
}

void sort_from(PlanePoint a, std::vector<EndPlace>& places) {
  const auto before = [&](const EndPlace& p, const EndPlace& q) {
    return distance(p.at, a) < distance(q.at, a);
  };
  std::sort(places.begin(), places.end(), before);
}

// Its second half is its first once more, to `alike` of its range.
bool goes_round_twice(const Cycle& c) {
  constexpr double alike = 2e-3;
  std::size_t after = 0;
  for (std::size_t k = 0; k < c.times.size() && c.times[k] <= c.period / 2; ++k) {
    const double then = c.times[k] + c.period / 2;
    while (after + 2 < c.times.size() && c.times[after + 1] < then) ++after;
    const double part = (then - c.times[after]) / (c.times[after + 1] - c.times[after]);
    for (PetscInt node = 0; node < c.nodes; ++node) {
      const double other = c.psi(after, node) + part * (c.psi(after + 1, node) - c.psi(after, node));
      if (std::abs(other - c.psi(k, node)) > alike * (c.psi_max - c.psi_min)) return false;
    }
  }
  return true;
}

}  // namespace

Scene BranchEnd::scene(double x, double y) const {
  if (uniform()) return one_node_of(scene_of_axes(x, y));
  return cell_.cell(axes_[0].value(x), axes_.size() > 1 ? axes_[1].value(y) : 0);
}

PlaneScene BranchEnd::plane() const {
  return [this](double x, double y) { return scene(x, y); };
}

std::string BranchEnd::fate(double x, double y) const {
  try {
    find_orbit(Oscillator(scene(x, y)), 1, 1e-5, strong_slip);
    return "oscillates periodically";
  } catch (const Failure& e) {
    return std::string("has no cycle (") + e.what() + ")";
  }
}

std::vector<double> BranchEnd::on_cycle(double x, double y) const {
  try {
    const Cycle cycle = uniform_cycle(scene(x, y), 1e-8, strong_slip).cycle;
    return {cycle.at(0, 0), cycle.at(0, 0) + cycle.dof};
  } catch (const Failure&) {
    return {};
  }
}

double BranchEnd::operator()(double x, double y) {
  count_evaluation();
  const Scene one = scene(x, y);
  if (one.massless() || !(one.K0() > 0) || one.v == 0) return std::nan("");
  return strong_slips_last(Oscillator(one)) ? -std::abs(one.v) : std::abs(one.v);
}

// The cycle shrinks to nothing where sliding begins to attract: the Hopf point is supercritical, and no
// stick-slip is left a little beyond.
bool BranchEnd::ends_at_hopf(PlanePoint alive, PlanePoint dead) {
  const auto repels = [&](double part) {
    const PlanePoint at = between(alive, dead, part);
    return Oscillator(scene(at.x, at.y)).sliding_unstable(1);
  };
  if (!repels(0) || repels(1)) return false;
  const double hopf = last_place(repels, 0, 1, 1e-12);
  const auto on_line = [&](double part, double) {
    const PlanePoint at = between(alive, dead, part);
    return scene(at.x, at.y);
  };
  GrowthRate growth(PETSC_COMM_SELF, on_line, {Axis{"the line"}});
  const Criticality criticality = growth.criticality(growth.crossing(hopf));
  if (!criticality.known() || criticality.coefficient > 0) return false;
  const PlanePoint beyond = between(alive, dead, std::min(1., hopf + past_hopf));
  if ((*this)(beyond.x, beyond.y) > 0) return true;
  try {  // slow to die out, or a cycle
    find_orbit(Oscillator(scene(beyond.x, beyond.y)), 1, 1e-5, strong_slip);
    return false;
  } catch (const Failure&) {
    return true;
  }
}

// The branch of the cycle on the line between two places, from the first.
BranchEnd::Branch BranchEnd::follow(PlanePoint from, PlanePoint to) {
  count_evaluation();
  Branch found;
  const double range = distance(from, to);
  const PlanePoint along{(to.x - from.x) / range, (to.y - from.y) / range};
  const std::function<Scene(double)> line = scenes_across(plane(), from, along);
  std::unique_ptr<CycleFamily> path;
  Cycle first;
  try {
    const Scene here = line(0);
    if (here.friction.sticks()) {
      const StickFate fate = stick_fate(
          here, cell_.start(axes_[0].value(from.x), axes_.size() > 1 ? axes_[1].value(from.y) : 0));
      if (fate.fate != Fate::repeats) throw Failure("the motion " + to_string(fate.fate));
      path = stick_family(line, 0, range, fate.cycle);
      first = path->cycle();
    } else {
      const SmoothCycle cycle =
          uniform()
              ? uniform_cycle(here, 1e-10, strong_slip)
              : settled_cycle(
                    here, cell_.start(axes_[0].value(from.x), axes_.size() > 1 ? axes_[1].value(from.y) : 0),
                    turns_to_settle);
      path = smooth_family(line, 0, range, cycle);
      first = cycle.cycle;
    }
    found.lives = growth_rate(first) < 0;
    if (!found.lives) throw Failure("a cycle that repels");
    // Where a period has doubled, the doubled cycle's branch would pass on to the one it comes from, gone
    // round twice; that one's flip is found from where it lives.
    const auto watch = [&](double, const Cycle& c) {
      if (goes_round_twice(c)) {
        found.halves = true;
        throw Failure("its period halves");
      }
      const double growth = growth_rate(c);
      return Watched{growth < 0, growth, 0, {}};
    };
    const CycleBranch branch =
        continue_cycle(*path, {"the line", 0, range, most_steps}, watch, Follow::while_stable);
    beat("branches");  // one that a signal ended is no answer
    found.until = branch.points.back().value;
    found.arrives = branch.special.empty() && std::abs(found.until - range) < 1e-9 * range;
    found.at_hopf = !branch.special.empty() && branch.special.back().kind == "hopf";
    found.why = "it cannot be followed beyond " +
                place_text(from.x + found.until * along.x, from.y + found.until * along.y) + ": " +
                branch.end.substr(branch.end.find(": ") == std::string::npos ? 0 : branch.end.find(": ") + 2);
    // a cycle that has all but shrunk to nothing ends there, whatever its multipliers, all nearly 1 then,
    // seem to do
    found.at_hopf =
        found.at_hopf || (!branch.special.empty() && path->cycle().amplitude < vanished * first.amplitude);
    if (branch.special.empty() || found.at_hopf) return found;
    const SpecialPoint& special = branch.special.back();
    found.until = special.value;
    found.end =
        end_place(std::move(path), special.kind,
                  {from.x + special.value * along.x, from.y + special.value * along.y}, {-along.x, -along.y});
    found.end->strong = first.amplitude;
  } catch (const Failure& e) {
    found.why = e.what();
  }
  return found;
}

// Where no cycle is found at the living place, its slips are but slow to die out: `lives` becomes false.
std::optional<EndPlace> BranchEnd::end_between(PlanePoint alive, PlanePoint dead, bool& lives,
                                               std::vector<std::string>& notes) {
  lives = true;
  if (ends_at_hopf(alive, dead)) return std::nullopt;
  Branch branch = follow(alive, dead);
  lives = branch.lives;
  if (!branch.end && !branch.lives && Oscillator(scene(alive.x, alive.y)).sliding_unstable(1))
    notes.push_back("near " + place_text(alive.x, alive.y) +
                    " no cycle of stick-slip is found: " + branch.why);
  else if (!branch.lives)
    return std::nullopt;
  else if (!branch.end && !branch.at_hopf)
    notes.push_back("between " + place_text(alive.x, alive.y) + " and " + place_text(dead.x, dead.y) +
                    " stick-slip ends at a place that could not be located: " + branch.why);
  return branch.end;
}

void BranchEnd::ends_of_uniform(PlanePoint a, PlanePoint b, std::vector<EndPlace>& found,
                                std::vector<std::string>& notes) {
  std::vector<double> f;
  for (int k = 0; k <= samples_of_line; ++k) {
    const PlanePoint at = between(a, b, double(k) / samples_of_line);
    f.push_back((*this)(at.x, at.y));
  }
  for (int k = 0; k < samples_of_line; ++k) {
    const std::size_t low = std::size_t(k), high = low + 1;
    if (!(f[low] * f[high] < 0)) continue;
    const PlanePoint p = between(a, b, double(k) / samples_of_line),
                     q = between(a, b, double(k + 1) / samples_of_line);
    bool lives = true;
    if (auto end = f[low] < 0 ? end_between(p, q, lives, notes) : end_between(q, p, lives, notes))
      found.push_back(*end);
    if (lives) continue;
    double& wrong = f[low] < 0 ? f[low] : f[high];
    wrong = -wrong;
    if (&wrong == &f[low]) k = std::max(-1, k - 2);  // the end lies before: that one again
  }
  samples_ = f;
  sort_from(a, found);
}

// Each branch from a sample that no branch before has passed.
void BranchEnd::ends_of_cell(PlanePoint a, PlanePoint b, std::vector<EndPlace>& found,
                             std::vector<std::string>& notes) {
  std::vector<std::pair<double, double>> passed;
  std::vector<std::string> without;  // a cycle that attracts
  const double range = distance(a, b);
  const auto look = [&](int k) {
    const double part = double(k) / places_of_cell;
    if (std::any_of(passed.begin(), passed.end(),
                    [&](const auto& p) { return part >= p.first && part <= p.second; }))
      return;
    const PlanePoint at = between(a, b, part);
    std::pair<double, double> reach{part, part};
    for (const bool forward : {false, true}) {
      const PlanePoint to = forward ? b : a;
      if (distance(at, to) == 0) continue;
      const Branch branch = follow(at, to);
      if (!branch.lives) {
        without.push_back("at " + place_text(at.x, at.y) + ": " + branch.why);
        break;
      }
      (forward ? reach.second : reach.first) += (forward ? 1 : -1) * branch.until / range;
      if (branch.end)
        found.push_back(*branch.end);
      else if (!branch.arrives && !branch.at_hopf && !branch.halves)
        notes.push_back("from " + place_text(at.x, at.y) + ": " + branch.why);
    }
    passed.push_back(reach);
  };
  within_budget(notes, [&] {
    for (int k = 0; k <= places_of_cell; ++k) look(k);
  });
  if (without.size() > 1)
    without[0] +=
        fmt::format(" (no cycle that attracts there, nor at {} more of the {} places between {} and {})",
                    without.size() - 1, places_of_cell + 1, place_text(a.x, a.y), place_text(b.x, b.y));
  if (!without.empty()) notes.push_back(without[0]);
  sort_from(a, found);
  const auto same = [](const EndPlace& p, const EndPlace& q) {
    return p.kind == q.kind && distance(p.at, q.at) < 1e-8;
  };
  found.erase(std::unique(found.begin(), found.end(), same), found.end());
}

Crossing BranchEnd::crossing(const EndPlace& place, int piece) const {
  Crossing c = crossing_at(place.at.x, place.at.y);
  c.kind = place.kind;
  c.frequency = 2 * M_PI / place.period;
  c.residual = place.residual;
  c.nx = place.to_life.x;
  c.ny = place.to_life.y;
  c.piece = piece;
  return c;
}

std::vector<Crossing> BranchEnd::points(std::vector<std::string>& notes) {
  std::vector<EndPlace> ends;
  const PlanePoint a{0, 0}, b{1, 0};
  const Budget budget(most_work_);
  if (uniform())
    within_budget(notes, [&] { ends_of_uniform(a, b, ends, notes); });
  else
    ends_of_cell(a, b, ends, notes);
  std::vector<Crossing> found;
  for (const EndPlace& place : ends) found.push_back(crossing(place, 0));
  return found;
}

void BranchEnd::within_budget(std::vector<std::string>& notes, const std::function<void()>& search) {
  try {
    search();
  } catch (const Spent&) {
    if (!unfinished_.empty()) return;
    unfinished_ = fmt::format(
        "the search for ends of stick-slip was ended by its budget of {:.0e} evaluations of a node: there "
        "may be more of them",
        most_work_);
    notes.push_back(unfinished_);
  }
}

// Every third line first; the places between, where the corners about them differ.
void BranchEnd::sample_square() {
  const std::size_t row = side + 1;
  samples_.assign(row * row, std::nan(""));
  std::vector<char> asked(row * row, 0);
  const auto ask = [&](int i, int j) {
    const std::size_t k = std::size_t(j) * row + std::size_t(i);
    if (!asked[k]) samples_[k] = (*this)(double(i) / side, double(j) / side);
    asked[k] = 1;
    return samples_[k];
  };
  for (int j = 0; j <= side; j += coarse)
    for (int i = 0; i <= side; i += coarse) ask(i, j);
  for (int j = 0; j < side; j += coarse)
    for (int i = 0; i < side; i += coarse) {
      const double corner = ask(i, j);
      const auto like = [&](double value) {
        return std::isnan(value) == std::isnan(corner) && (value < 0) == (corner < 0);
      };
      const bool alike =
          like(ask(i + coarse, j)) && like(ask(i, j + coarse)) && like(ask(i + coarse, j + coarse));
      for (int q = j; q <= j + coarse; ++q)
        for (int p = i; p <= i + coarse; ++p) {
          const std::size_t k = std::size_t(q) * row + std::size_t(p);
          if (!alike)
            ask(p, q);
          else if (!asked[k])
            samples_[k] = corner;
        }
    }
}

void BranchEnd::lines_of_uniform(double step, std::vector<EndLine>& lines, std::vector<std::string>& notes) {
  sample_square();
  const auto value = [&](int i, int j) { return samples_[j * (side + 1) + i]; };
  bool again = true;  // a sample has changed
  const auto look = [&](int i, int j, int p, int q) {
    if (!(value(i, j) * value(p, q) < 0)) return;
    PlanePoint alive{double(i) / side, double(j) / side}, dead{double(p) / side, double(q) / side};
    if (value(i, j) > 0) std::swap(alive, dead);
    for (const EndLine& line : lines)
      if (crosses(line, alive, dead)) return;
    bool lives = true;
    if (const auto end = end_between(alive, dead, lives, notes))
      lines.push_back(follow_ends(plane(), *end, step));
    if (lives) return;
    double& wrong =
        samples_[value(i, j) < 0 ? std::size_t(j * (side + 1) + i) : std::size_t(q * (side + 1) + p)];
    wrong = -wrong;
    again = true;
  };
  // from the middle outwards: on borders cycles may be extreme, which a line reaches from where they are not
  std::vector<std::array<int, 4>> edges;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) {
      if (i < side) edges.push_back({i, j, i + 1, j});
      if (j < side) edges.push_back({i, j, i, j + 1});
    }
  const auto from_middle = [](const std::array<int, 4>& e) {
    return std::max(std::abs(e[0] + e[2] - side), std::abs(e[1] + e[3] - side));
  };
  std::stable_sort(edges.begin(), edges.end(),
                   [&](const auto& a, const auto& b) { return from_middle(a) < from_middle(b); });
  for (int pass = 0; again && pass < most_passes; ++pass) {
    again = false;
    for (const auto& [i, j, p, q] : edges) look(i, j, p, q);
  }
}

void BranchEnd::lines_of_cell(double step, std::vector<EndLine>& lines, std::vector<std::string>& notes) {
  for (int j = 0; j <= lines_of_square; ++j) {
    const double y = double(j) / lines_of_square;
    std::vector<EndPlace> ends;
    ends_of_cell({0, y}, {1, y}, ends, notes);
    for (const EndPlace& end : ends) {
      const auto near = [&](const EndLine& line) {
        if (line.places.front().kind != end.kind) return false;
        const PlanePoint n{1e-3, 0};
        return crosses(line, {end.at.x - n.x, end.at.y}, {end.at.x + n.x, end.at.y});
      };
      if (std::none_of(lines.begin(), lines.end(), near)) lines.push_back(follow_ends(plane(), end, step));
    }
  }
}

std::vector<Crossing> BranchEnd::curve(PetscInt count, std::vector<std::string>& notes) {
  const double step = 1. / std::clamp<double>(double(count), 30., 40.);
  std::vector<EndLine> lines;
  {  // even places, whose number is asked for, are found whatever they take
    const Budget budget(most_work_);
    within_budget(notes, [&] {
      uniform() ? lines_of_uniform(step, lines, notes) : lines_of_cell(step, lines, notes);
    });
  }
  std::vector<Crossing> result;
  for (const NumberedEnd& end : even_ends(plane(), lines, count))
    result.push_back(crossing(end.place, int(end.line)));
  for (const EndLine& line : lines) note_stuck_ends({line.piece}, notes);
  return result;
}

std::string StickSlipEnd::refusal(const Scene& s) {
  if (s.massless())
    return "without mass (model_m 0) a block rests and slides without a jump, and no slip is thrown";
  if (s.spread != 0) return "friction_spread makes nodes move differently";
  if (s.has_profile()) return "a profile of friction makes nodes move differently";
  if (s.left == End::velocity || s.right == End::velocity) return "a held end makes nodes move differently";
  if (!(s.K0() > 0)) return "nothing loads the blocks (model_k0 0)";
  return "";
}

std::unique_ptr<StickSlipEnd> StickSlipEnd::of(SceneAt scene_at, std::vector<Axis> axes,
                                               const CellMotion& cell) {
  const Scene middle = scene_at(axes[0].value(.5), axes.size() > 1 ? axes[1].value(.5) : 0);
  if (!cell.cell && middle.friction.sticks())
    return std::make_unique<GrazeEnd>(std::move(scene_at), std::move(axes));
  return std::make_unique<BranchEnd>(std::move(scene_at), std::move(axes), cell);
}

Crossing StickSlipEnd::crossing_at(double x, double y) const {
  Crossing c = OnAxes::crossing_at(x, y);
  c.of = "stick-slip";
  c.growth = c.residual = std::nan("");
  return c;
}

std::string StickSlipEnd::place_text(double x, double y) const { return stickslip::place_text(axes_, x, y); }

void StickSlipEnd::note_stuck_ends(const std::vector<CurvePiece>& pieces,
                                   std::vector<std::string>& notes) const {
  note_stuck("the line of ends of stick-slip", "is found", axes_, pieces, notes);
}

bool StickSlipEnd::lives_nowhere() const {
  return !samples_.empty() && std::none_of(samples_.begin(), samples_.end(), [](double f) { return f <= 0; });
}

}  // namespace stickslip
