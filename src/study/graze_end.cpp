#include "study/end_line.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <set>

#include "stickslip/base/error.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

constexpr double beside = 1e-4;      // of the box: where it is asked what lives on either side of an end
constexpr double apart = 1e-12;      // places that are nearer to each other than that are one
constexpr double near_graze = 1e-3;  // distance over the scale of a slip of a place near a graze
constexpr double meets = 0.3;        // |1 - multiplier| that is left where a cycle meets another
constexpr double grazes = 1e-6;      // distance from grazing, over the scale of a slip, of an end by grazing
constexpr double near_fold = 1e-6;   // of the box: from where a fold is placed by its multiplier
constexpr double to_follow = 1e-8;   // error of a step while a line is followed, not of its points

// How far it is from x in [0, 1] to the end that lies in this direction.
double to_border(double x, double direction) {
  if (direction == 0) return std::numeric_limits<double>::infinity();
  return std::max(0., direction > 0 ? (1 - x) / direction : x / -direction);
}

}  // namespace

Scene GrazeEnd::scene(double x, double y) const { return one_node_of(scene_of_axes(x, y)); }

std::string GrazeEnd::fate(double x, double y) const {
  return to_string(uniform_stick_fate(scene(x, y)).fate);
}

// Right before its release: the node still rests.
std::vector<double> GrazeEnd::on_cycle(double x, double y) const {
  const StickFate found = uniform_stick_fate(scene(x, y));
  if (found.fate != Fate::repeats) return {};
  std::vector<double> start = found.cycle.start;
  start[1] *= 1 - 1e-6;
  return start;
}

double GrazeEnd::distance(double x, double y, double tolerance) {
  count_evaluation();
  const Scene one = scene(x, y);
  if (one.massless() || !one.friction.sticks() || !(one.K0() > 0)) return std::nan("");
  const Grazing found = distance_from_graze(one, tolerance);
  period_ = found.period;
  passes_ = found.passes;
  return found.distance;
}

// The end at (x, y); (nx, ny): a direction across the line of ends.
Crossing GrazeEnd::crossing(double x, double y, double nx, double ny) {
  Crossing c = crossing_at(x, y);
  double least = std::numeric_limits<double>::infinity();
  for (const double off : {0., 1e-10, -1e-10}) {  // of a fold one side alone has a cycle
    const double there = (*this)(x + off * nx, y + off * ny);
    if (period_ > 0) c.frequency = 2 * M_PI / period_;
    if (!(std::abs(there) < std::abs(least))) continue;
    least = there;
    c.kind = passes_ ? "pass" : "graze";
    if (std::abs(least) < 1e-3 * grazes) break;
  }
  // Without a state there is no fold. Where the slip creeps along the falling branch of friction (large v,
  // soft springs) its least psi passes 0 within the last digit of the option, as in a canard explosion: no
  // place has a small one.
  const Scene here = scene(x, y);
  c.residual = std::abs(least);
  if (!here.friction.has_state() || std::abs(least) < grazes * scales_of(here).slip.psi) return c;
  Crossing fold(c);
  fold.kind = "fold";
  place_fold(fold, nx, ny);
  if (fold.residual < meets) return fold;
  return c;
}

// A place near a graze on it, by secants along `across`; other places stay.
PlanePoint GrazeEnd::last_digits(PlanePoint at, PlanePoint across) {
  const auto off = [&](double t) { return (*this)(at.x + t * across.x, at.y + t * across.y); };
  const double here = off(0);
  if (!(std::abs(here) < near_graze * scales_of(scene(at.x, at.y)).slip.psi)) return at;
  constexpr double step = 1e-9, reach = 1e-6, known = 1e-13;
  const double expected = -here * step / (off(step) - here);
  if (!(std::abs(expected) < reach)) return at;
  const double t = root_near(off, 0, here, expected, known, reach);
  return std::isnan(t) ? at : PlanePoint{at.x + t * across.x, at.y + t * across.y};
}

// Towards a fold the multiplier mu goes to 1 like the square root of the distance: the place is extrapolated
// to (1 - mu)^2 = 0 from the last three of a row of cycles on the side where they live, each 4 times nearer
// to where it was expected last.
void GrazeEnd::place_fold(Crossing& c, double nx, double ny) {
  constexpr double first = 1e-4, nearer = 4, close = 1e-10;
  constexpr int most = 20;
  const double side = (*this)(c.x + first * nx, c.y + first * ny) < 0 ? 1 : -1;
  const auto beyond = [&](double off) { return scene(c.x + side * off * nx, c.y + side * off * ny); };
  StickFate fate = uniform_stick_fate(beyond(first));
  if (fate.fate != Fate::repeats) return;
  std::vector<double> squares, places;
  double off = first, end = 0;
  for (int k = 0; k < most && std::abs(off - end) > close; ++k) {
    try {
      const Scene one = beyond(off);
      fate.cycle = polish(one, fate.cycle);
      squares.insert(squares.begin(), std::pow(1 - uniform_multiplier(one, fate.cycle), 2));
    } catch (const Failure&) {  // beyond the fold
      if (places.empty()) return;
      off = (off + places[0]) / 2;
      continue;
    }
    places.insert(places.begin(), off);
    squares.resize(std::min<std::size_t>(3, squares.size()));
    std::vector<double> weights(squares.size());
    Lagrange(squares).weights(0, weights.data());
    end = std::inner_product(weights.begin(), weights.end(), places.begin(), 0.);
    const double expected = std::clamp(end, -near_fold, near_fold);  // the place is known to that
    off = expected + (off - expected) / nearer;
    c.residual = std::sqrt(squares[0]);
    c.frequency = 2 * M_PI / fate.cycle.period;
  }
  if (!(std::abs(end) < first)) return;
  c.x += side * end * nx;
  c.y += side * end * ny;
  c.value = axes_[0].value(c.x);
  if (axes_.size() > 1) c.value2 = axes_[1].value(c.y);
}

// Whether stick-slip lives at a place, whatever its slips look like.
bool GrazeEnd::lives(double x, double y) {
  const Fate fate = uniform_stick_fate(scene(x, y)).fate;
  return fate == Fate::repeats || fate == Fate::wanders;
}

// Whether it lives on one side of a place alone; empty for a place on the border of the box.
std::optional<bool> GrazeEnd::ends_at(const Crossing& c, double nx, double ny) {
  std::string found[2];
  bool lives[2] = {false, false};
  for (const int side : {0, 1}) {
    const double turn = side == 0 ? -1 : 1,
                 away = std::min({beside, to_border(c.x, turn * nx), to_border(c.y, turn * ny)});
    if (!(away > apart)) return std::nullopt;
    const double off = turn * away, x = c.x + off * nx, y = c.y + off * ny;
    const StickFate fate = uniform_stick_fate(scene(x, y));
    found[side] = to_string(fate.fate);
    lives[side] = fate.fate == Fate::repeats || fate.fate == Fate::wanders;
    if (fate.fate == Fate::oscillates)
      remark(std::string("where a slip ") +
                 (c.kind == "pass" ? "that swings back only just stops" : "only grazes rest") +
                 ", the oscillation goes on without rest on the other side: whether and where that ends is "
                 "not looked for",
             c);
  }
  if (lives[0] == lives[1])
    remark(std::string("where the longest slip ") +
               (c.kind == "pass" ? "only just stops" : "only grazes rest") + ", on either side the motion " +
               (found[0] == found[1] ? found[0] : found[0] + " or " + found[1]) +
               ": stick-slip does not end there, and this is no point of it",
           c);
  return lives[0] != lives[1];
}

void GrazeEnd::remark(const std::string& what, const Crossing& at) {
  const auto same =
      std::find_if(remarks_.begin(), remarks_.end(), [&](const Remark& r) { return r.what == what; });
  if (same == remarks_.end())
    remarks_.push_back({what, {at}});
  else if (same->at.back().x != at.x || same->at.back().y != at.y)
    same->at.push_back(at);
}

// What is said of several places is one note, of the range they lie in.
void GrazeEnd::tell_remarks(std::vector<std::string>& notes) {
  for (const Remark& r : remarks_) {
    std::string where = place_text(r.at[0].x, r.at[0].y);
    if (r.at.size() > 1) {
      where = std::to_string(r.at.size()) + " places that were asked";
      for (std::size_t k = 0; k < axes_.size(); ++k) {
        const auto of = [&](const Crossing& c) { return axes_[k].value(k == 0 ? c.x : c.y); };
        const auto ends = std::minmax_element(
            r.at.begin(), r.at.end(), [&](const Crossing& a, const Crossing& b) { return of(a) < of(b); });
        where += fmt::format(", {} = {} to {}", axes_[k].name, number_text(of(*ends.first)),
                             number_text(of(*ends.second)));
      }
    }
    notes.push_back("beside " + where + ", " + r.what);
  }
  remarks_.clear();
}

// Where a slip grazed rest and stick-slip went on, with slips of another shape, the distance from grazing
// does not say where it lives: the motion is asked at the ends and in the middle of each stretch of samples
// of one sign, and at all of them where these disagree. The signs of the samples then say so.
void GrazeEnd::ask_motion(const std::vector<Crossing>& found, std::vector<std::string>& notes) {
  const double pieces = double(samples_.size() - 1);
  const auto alive = [&](std::size_t k) { return lives(double(k) / pieces, 0); };
  for (std::size_t first = 0, last; first < samples_.size(); first = last + 1) {
    last = first;
    if (std::isnan(samples_[first])) continue;
    for (; last + 1 < samples_.size() && samples_[last] * samples_[last + 1] > 0;) ++last;
    const bool begin = alive(first);
    const bool alike = first == last || (begin == alive((first + last) / 2) && begin == alive(last));
    for (std::size_t k = first; k <= last; ++k)
      samples_[k] = std::copysign(samples_[k], (alike || k == first ? begin : alive(k)) ? -1 : 1);
  }
  for (std::size_t k = 0; k + 1 < samples_.size(); ++k) {
    const double low = double(k) / pieces, high = double(k + 1) / pieces;
    const bool known =
        std::any_of(found.begin(), found.end(), [&](const Crossing& c) { return c.x >= low && c.x <= high; });
    if (samples_[k] * samples_[k + 1] < 0 && !known)
      notes.push_back("between " + place_text(low, 0) + " and " + number_text(axes_[0].value(high)) +
                      " stick-slip ends with slips of another shape, at a place that is not located");
  }
}

std::vector<Crossing> GrazeEnd::points(std::vector<std::string>& notes) {
  std::vector<Sample> samples = samples_of_unit(*this, 32);
  samples_.clear();
  for (const Sample& sample : samples) samples_.push_back(sample.f);
  mend_ends(*this, samples);  // v = 0
  std::vector<Crossing> found;
  bool other_shapes = false;
  for (const Bracket& bracket : brackets_of(samples)) {
    const double root = find_root(*this, bracket, 1e-14);
    if (std::isnan(root)) {
      notes.push_back(fmt::format("between {} {} and {} stick-slip ends at a place that could not be located",
                                  axes_[0].name, number_text(axes_[0].value(bracket.a)),
                                  number_text(axes_[0].value(bracket.b))));
      continue;
    }
    Crossing end = crossing(root, 0, 1, 0);
    if (ends_at(end, 1, 0).value_or(end.residual <= grazes * scales_of(scene(end.x, 0)).slip.psi))
      found.push_back(std::move(end));
    else
      other_shapes = true;
  }
  tell_remarks(notes);
  if (other_shapes) ask_motion(found, notes);
  return found;
}

std::vector<Crossing> GrazeEnd::curve(PetscInt count, std::vector<std::string>& notes) {
  const PlaneFunction f = [&](double x, double y) { return (*this)(x, y); };
  const PlaneFunction rough = [&](double x, double y) { return distance(x, y, to_follow); };
  const Lattice lattice = sampled(rough, 24);
  samples_ = lattice.values;
  LevelCurveSettings settings;
  settings.step = 1. / std::clamp<double>(double(count), 40., 60.);
  const double jump = scene(0.5, 0.5).friction.has_state() ? near_fold : 0;
  settings.start = std::max(settings.start, jump);
  const LevelCurve line = level_curve(rough, lattice, settings);
  struct Asked {
    Crossing end;
    PlanePoint across;
    std::optional<bool> ends;  // asked of the motion at some points; the line is one of the same kind between
  };
  std::vector<Asked> places;
  place_evenly(
      rough, line.pieces, count,
      [&](std::size_t piece, std::size_t k, std::size_t of_piece, const CurvePlace& place, const Placed& on) {
        const auto end_near = [&](PlanePoint at) {
          at = last_digits(at, place.across);
          return crossing(at.x, at.y, place.across.x, place.across.y);
        };
        places.push_back({end_near(on.at), place.across, {}});
        const Crossing& c = places.back().end;
        if (jump > 0 && c.kind != "fold" && c.residual > grazes * scales_of(scene(c.x, c.y)).slip.psi) {
          double slope = std::nan("");  // it changes so fast that what is near a fold is not near enough
          places.back().end = end_near(put_on_curve(f, place.at, place.across, slope).at);
        }
        places.back().end.piece = int(piece);
        if (k % std::max<std::size_t>(1, of_piece / 8) == 0)
          places.back().ends = ends_at(places.back().end, place.across.x, place.across.y);
      },
      jump);
  std::set<int> doubtful;  // pieces: every point is asked
  for (const Asked& p : places)
    if (!p.ends.value_or(true)) doubtful.insert(p.end.piece);
  std::vector<Crossing> result;
  for (Asked& p : places) {
    const bool doubted = doubtful.count(p.end.piece) > 0;
    if (!p.ends && doubted) p.ends = ends_at(p.end, p.across.x, p.across.y);
    if (p.ends.value_or(!doubted)) result.push_back(std::move(p.end));
  }
  tell_remarks(notes);
  note_stuck_ends(line.pieces, notes);
  return result;
}

}  // namespace stickslip
