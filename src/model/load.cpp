#include "stickslip/model/load.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "base/failure.hpp"
#include "model/scene_reading.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

double common_period(double a, double b) {
  constexpr int most = 100;
  constexpr double same = 1e-9;
  if (a == 0 || b == 0) return std::max(a, b);
  if (!std::isfinite(a) || !std::isfinite(b)) return std::numeric_limits<double>::infinity();
  for (int k = 1; k <= most; ++k) {
    const double ratio = k * a / b, whole = std::round(ratio);
    if (whole >= 1 && whole <= most && std::abs(ratio - whole) < same * whole) return k * a;
  }
  return std::numeric_limits<double>::infinity();
}

double Sine::at(double t) const { return amplitude * std::sin(2 * M_PI * t / period + phase); }

Load::Load(double v, const std::vector<std::pair<double, double>>& points, const std::vector<Sine>& sines) {
  double shortest = std::numeric_limits<double>::infinity();
  for (const Sine& sine : sines) {
    period_ = common_period(period_, sine.period);
    if (sine.amplitude == 0) continue;
    sines_.push_back(sine);
    shortest = std::min(shortest, sine.period);
    smooth_time_ = shortest / (2 * double(sines_.size()));
  }
  if (points.empty() && sines_.empty()) return;
  pieces_.push_back(
      {-std::numeric_limits<double>::infinity(), points.empty() ? v : points.front().second, 0, 0});
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& [t, value] = points[i];
    const bool last = i + 1 == points.size();
    const double length = last ? 0 : points[i + 1].first - t;
    if (!last && length == 0) continue;  // a jump: the second value begins
    pieces_.push_back({t, value, last ? 0 : (points[i + 1].second - value) / length, 0});
  }
  // How far the plate has come at the beginning of each, counted from t = 0 at the first, constant piece.
  for (std::size_t i = 1; i < pieces_.size(); ++i) {
    const Interval& before = pieces_[i - 1];
    const double from = i == 1 ? 0 : before.begin, t = pieces_[i].begin - from;
    pieces_[i].travel = before.travel + t * (before.v + before.slope * t / 2);
  }
}

int Load::piece_from(double t) const {
  int piece = 0;
  while (std::size_t(piece) + 1 < pieces_.size() && pieces_[std::size_t(piece) + 1].begin <= t) ++piece;
  return piece;
}

double Load::in_piece(int piece, double t) const {
  const Interval& p = pieces_[piece];
  double v = p.slope == 0 ? p.v : p.v + p.slope * (t - p.begin);
  for (const Sine& sine : sines_) v += sine.at(t);
  return v;
}

double Load::before(double t) const { return in_piece(piece_from(std::nextafter(t, -1.)), t); }

double Load::slope_in_piece(int piece, double t) const {
  double slope = pieces_[std::size_t(piece)].slope;
  for (const Sine& sine : sines_) {
    const double turn = 2 * M_PI / sine.period;
    slope += sine.amplitude * turn * std::cos(turn * t + sine.phase);
  }
  return slope;
}

double Load::integral(double t) const {
  const int piece = piece_from(t);
  const Interval& p = pieces_[piece];
  const double since = t - (piece == 0 ? 0 : p.begin);
  double way = p.travel + since * (p.v + p.slope * since / 2);
  for (const Sine& sine : sines_) {
    const double half = M_PI * t / sine.period;
    way += sine.amplitude * sine.period / M_PI * std::sin(half) * std::sin(half + sine.phase);
  }
  return way;
}

double Load::next_corner(double t) const {
  for (const Interval& p : pieces_)
    if (p.begin > t) return p.begin;
  return std::numeric_limits<double>::infinity();
}

Load Load::scaled(double factor) const {
  Load other(*this);
  for (Sine& sine : other.sines_) sine.amplitude *= factor;
  return other;
}

namespace {

// w at both ends of every piece.
template <class Pieces>
std::vector<double> values_at_ends(const Pieces& pieces) {
  std::vector<double> values;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const auto& p = pieces[i];
    values.push_back(p.v);
    if (i > 0 && i + 1 < pieces.size()) values.push_back(p.v + p.slope * (pieces[i + 1].begin - p.begin));
  }
  return values;
}

}  // namespace

double Load::largest() const {
  double largest = 0;
  for (const double w : values_at_ends(pieces_)) largest = std::max(largest, std::abs(w));
  for (const Sine& sine : sines_) largest += std::abs(sine.amplitude);
  return largest;
}

double Load::smallest() const {
  double smallest = std::numeric_limits<double>::infinity();
  for (const double w : values_at_ends(pieces_)) smallest = std::min(smallest, w);
  for (const Sine& sine : sines_) smallest -= std::abs(sine.amplitude);
  return smallest;
}

// The loads of a scene: velocity of the plate, harmonic force, normal load.

namespace {

// Whether friction drops as a node begins to slip, everywhere.
bool drops_at_release(const Scene& s) {
  const auto drops = [](const Friction& law) {
    const double state = 1, limit = law.threshold(state).value;
    return limit - law.sliding_partials(0, state, 1).F > 1e-9 * limit;
  };
  if (!s.friction.varies()) return drops(*Friction::of(s.friction));
  FrictionPlaces places;
  for (PetscInt i = 0; i < s.n; ++i) places.push_back({s.x(i)});
  const auto laws = Friction::along(s.friction, places);
  return std::all_of(laws.begin(), laws.end(), [&](const auto& law) { return drops(*law); });
}

// A plate that halts, see Plate.
Load read_halt(const Options& o, const Scene& s) {
  const auto refuse_halt = [](const std::string& why) {
    throw UsageError("-load_halt true: the plate stops while a node slips, and " + why);
  };
  if (o.command() == "fit") refuse_halt("a measurement comes from a plate that does not stop");
  if (s.load.varies())
    refuse_halt(
        "only its displacement from one slip to the next counts; leave load_v, load_sine_* and "
        "load_force_sine_* out, which would change nothing but its clock");
  if (!s.friction.sticks())
    refuse_halt(
        (s.friction.jumps_at_rest() ? "regularised" : o.text("friction_law")) +
        " friction never lets a node rest, so the plate would never move; take a law with a threshold and "
        "-friction_stick exact");
  if (frictionless_somewhere(s))
    refuse_halt(
        "a node without friction never rests, so the plate would never move; leave "
        "friction_amplitude_profile above 0");
  if (s.massless()) refuse_halt("nothing sticks exactly in a chain without mass (model_m 0)");
  for (const auto& [end, value] : {std::pair{s.left, s.left_value}, {s.right, s.right_value}})
    if (end == End::velocity && value != 0)
      refuse_halt("an end that is held at the velocity " + number_text(value) +
                  " always does; hold it at 0, or leave it free");
  if (!drops_at_release(s))
    refuse_halt(
        "friction that does not drop as slip begins lets no node go that is pulled no further than its "
        "threshold; take friction_law coulomb with friction_fd below friction_fs, or carlson-langer with "
        "friction_sigma above 0");
  return halting_load(s.v);
}

// The sine of that name; of amplitude 0 where the user gave none.
Sine read_sine(const Options& o, const std::string& name) {
  const std::string amplitude = name + "_amplitude", period = name + "_period";
  if (o.is_set(period) != o.is_set(amplitude))
    throw UsageError("-" + (o.is_set(period) ? period : amplitude) + ": a sine needs " + amplitude + " and " +
                     period);
  return {o.real(amplitude), o.real(period)};
}

std::vector<std::pair<double, double>> read_points(const Options& o, const std::string& name) {
  const std::vector<std::pair<double, double>> points = o.pairs(name);
  if (!points.empty() && points.front().first < 0)
    throw UsageError(shown(o, name) + ": times from 0 on, where a run begins");
  return points;
}

const std::string plate_sine = "load_sine", force_sine = "load_force_sine", normal_sine = "load_normal_sine";

bool has(const Options& o, const std::string& sine) { return o.is_set(sine + "_amplitude"); }

// The velocity of a plate that exerts the force through springs K0.
Sine velocity_of(const Sine& force, double K0) {
  return {force.amplitude * 2 * M_PI / force.period / K0, force.period, M_PI / 2};
}

// The force on every node, as the motion of the plate that exerts it.
Sine plate_for_force(const Options& o, const Scene& s) {
  const auto refuse_force = [&](const std::string& why) {
    throw UsageError(shown(o, force_sine + "_amplitude") + ": " + why);
  };
  if (s.medium.profile("model_k0"))
    refuse_force(
        "it acts as a motion of the plate would, through springs that are alike; leave "
        "model_k0_profile out");
  return velocity_of(s.force, s.K0());
}

void read_plate(const Options& o, Scene& s) {
  std::vector<Sine> sines;
  const Sine sine = read_sine(o, plate_sine);
  if (has(o, plate_sine)) sines.push_back(sine);
  s.force = read_sine(o, force_sine);
  if (has(o, force_sine) && s.form == Form::chain && s.k0 == 0) {
    refuse(o, {"load_v", "load_sine_amplitude"},
           "with model_k0 0 no spring ties the blocks to the plate, and its motion does nothing beside "
           "load_force_sine_amplitude");
    s.k0 = no_spring * s.f0;
  }
  if (has(o, force_sine)) sines.push_back(plate_for_force(o, s));
  s.load = Load(s.v, read_points(o, "load_v"), sines);
  if (o.boolean("load_halt")) s.load = read_halt(o, s);
}

// Where a normal load cannot be had.
void check_normal_load(const Options& o, const Scene& s) {
  const std::string name = o.is_set("load_normal") ? "load_normal" : normal_sine + "_amplitude";
  const auto refuse_it = [&](bool wrong, const std::string& reason) {
    if (wrong) throw UsageError(shown(o, name) + ": " + reason);
  };
  refuse_it(!(s.normal.smallest() > 0), "N(t) comes down to " + rounded_text(s.normal.smallest(), 6) +
                                            "; a normal load stays > 0, less the amplitude of its sine too");
  refuse_it(s.massless(), "it needs blocks with mass (model_m > 0)");
  refuse_it(!s.friction.terms.none(),
            "the drag (model_drag) does not grow with the normal load, and the two are not combined");
  refuse_it(o.boolean("load_halt"), "with load_halt a resting node is released by the plate alone");
  const std::vector<std::pair<double, double>> points = o.pairs("load_normal");
  const bool steps = std::adjacent_find(points.begin(), points.end(), [](const auto& a, const auto& b) {
                       return a.first == b.first && a.second != b.second;
                     }) != points.end();
  refuse_it(steps && s.friction.sticks() && o.command() == "run" && o.integer("lyapunov_count") > 0,
            "exponents (lyapunov_count) do not pass a step of it at which nodes that rest begin to slip; "
            "make it a steep ramp");
}

void read_response(const Options& o, Scene& s) {
  const std::string name = "state_linker_dieterich";
  s.linker_dieterich = o.real(name);
  if (s.linker_dieterich == 0) return;
  if (!o.is_set("load_normal") && !has(o, normal_sine))
    throw UsageError(shown(o, name) +
                     ": it is what a normal load that varies does to the state; give load_normal or "
                     "load_normal_sine_amplitude");
  const std::string state = to_string(s.friction.state);
  if (state != "ageing" && state != "slip")
    throw UsageError(shown(o, name) +
                     ": the response of the state to the normal load is that of ageing and slip, but "
                     "state_law is " +
                     state);
  for (PetscInt i = 0; i < s.n; ++i)
    if (!std::isfinite(s.state_response(i)))
      throw UsageError(shown(o, name) +
                       ": the state falls by alpha/b of what ln N rises by, and friction_b is 0");
}

void read_normal(const Options& o, Scene& s) {
  std::vector<Sine> sines;
  const Sine sine = read_sine(o, normal_sine);
  if (has(o, normal_sine)) sines.push_back(sine);
  s.normal = Load(1, read_points(o, "load_normal"), sines);
  if (s.normal.varies()) check_normal_load(o, s);
  read_response(o, s);
}

// Tables of times are for runs; what repeats, for runs and for commands that look at one period.
void refuse_loads(const Options& o) {
  const std::string& command = o.command();
  if (command.empty() || command == "run" || command == "sweep" || command == "fit") return;
  const bool periodic = command == "cycle" || command == "boundary";
  refuse(o, {"load_v", "load_halt", "load_normal"},
         "the command " + command + " takes a constant velocity of the plate and a constant normal load" +
             (periodic ? ", with or without sines on them" : "") + "; `run` takes loads, and halts");
  if (periodic) return;
  for (const std::string& sine : {plate_sine, force_sine, normal_sine})
    refuse(o, {sine + "_amplitude", sine + "_period"},
           "the command " + command +
               " takes a constant velocity of the plate and a constant normal load; run, cycle and boundary "
               "take sines");
}

void check_period(const Options& o, const Scene& s) {
  if ((o.command() != "cycle" && o.command() != "boundary") || s.commensurate()) return;
  std::string text;
  for (const std::string& sine : {plate_sine, force_sine, normal_sine})
    if (has(o, sine)) text += (text.empty() ? "" : ", ") + shown(o, sine + "_period");
  throw UsageError(text +
                   ": nothing repeats under these periods together, whose ratios are to be those of "
                   "whole numbers up to 100");
}

}  // namespace

double Scene::forcing_period() const {
  const double period = common_period(load.period(), normal.period());
  return forced() && std::isfinite(period) ? period : 0;
}
bool Scene::commensurate() const { return std::isfinite(common_period(load.period(), normal.period())); }

double Scene::push_velocity(double t) const {
  return force.amplitude == 0 ? 0 : velocity_of(force, K0()).at(t);
}

double Scene::state_response(PetscInt i) const {
  const ProfileAlongX* const b = friction.profile("friction_b");
  return linker_dieterich / (b ? b->at(x(i)) : friction.value("friction_b"));
}

void read_loads(const Options& options, Scene& scene) {
  refuse_loads(options);
  read_plate(options, scene);
  read_normal(options, scene);
  check_period(options, scene);
}

}  // namespace stickslip
