// A cycle that the motion from a start settles on or comes near to: the guess for collocation.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <optional>

#include "base/pulse.hpp"
#include "cycles/cell_field.hpp"
#include "cycles/settle.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

namespace {

using std::size_t;

constexpr double tolerance_of_run = 1e-8;
constexpr double most_turns = 1000, most_loads = 20;  // without a passage of the section
constexpr double evaluations_of_step = 7;  // of a run, about
constexpr double most_steps = 2e6;     // of a motion of few unknowns, over 1 + unknowns/30 of one of many
constexpr double most_memory = 5e8;    // bytes of the samples that are kept, those of the last twelve turns
constexpr double near_enough = 1e-3;   // see SettleLimits
// Return, beside which a collocation that fails has too few intervals; and that of a motion which repeats to
// the last digits that its steps have.
constexpr double surely = 1e-5, exactly = 1e-9;
// A motion is beside sliding, where the linear answer holds and steps may err as much, while psi stays this
// near to the plate's velocity and the rest with it.
constexpr double beside = 1e-5;

// Ends the search, whatever the steps are.
struct NoCycle : Failure {
  explicit NoCycle(const std::string& why) : Failure("no cycle: the motion from the start " + why) {}
};

struct Sample {
  double t;
  std::vector<double> y, f;
};

// Cubic between two samples.
double hermite(const Sample& a, const Sample& b, double t, size_t k) {
  const double h = b.t - a.t;
  return HermiteCubic(a.y[k], b.y[k], h * a.f[k], h * b.f[k])((t - a.t) / h);
}

// The motion of a cell as `run` takes its steps.
class Motion {
 public:
  // `start`: of every node, as in Model.
  Motion(const CellField& field, const std::vector<double>& start)
      : field_(field), model_(PETSC_COMM_SELF, field.scene()), u_(model_.create_vector()),
        escape_(escape_velocity(field.scene())) {
    {
      const Writing into(u_);
      for (size_t k = 0; k < start.size(); ++k) into[PetscInt(k)] = start[k];
    }
    MethodSpec spec;
    spec.tolerance = tolerance_of_run;
    const Rates rates = rates_of(model_, u_);
    if (!rates.stiff_friction && !rates.stiff_wave && !field.scene().massless()) {
      spec.type = TSRK;  // short steps beside what happens in them: cubics between them tell the motion
      spec.subtype = TSRK5DP;
    }
    steps_.emplace(model_, spec, u_, "settle_");
  }

  // Step by step, until `takes` says so. Its first sample is where the motion stands.
  template <class Takes>
  void follow(const Takes& takes) {
    const auto observer = [&](const Integrator::Step& step) {
      beat("steps");
      work(evaluations_of_step * double(field_.nodes()));
      t_ = step.t;
      Sample now{t_, unknowns(step.u), std::vector<double>(size_t(field_.dim()))};
      for (size_t k = 0; k < field_.nodes() && std::isfinite(escape_); ++k)
        if (std::abs(field_.psi(now.y.data(), k)) > escape_)
          throw NoCycle("grows without bound");
      field_.rates_at(t_ / field_.period(0).T, now.y.data(), now.f.data());
      return takes(std::move(now)) ? Integrator::Verdict::go_on : Integrator::Verdict::stop;
    };
    try {
      steps_->advance(u_, t_, 1e300, observer);
    } catch (const NoCycle&) {
      throw;
    } catch (const Failure& e) {
      throw NoCycle(std::string("cannot be followed: ") + e.what());
    }
  }
  // Goes on from y, of the unknowns.
  void set(const std::vector<double>& y) {
    {
      const size_t dof = size_t(field_.dof()), width = size_t(field_.width());
      const Writing into(u_);
      for (size_t k = 0; k < field_.nodes(); ++k)
        std::copy_n(&y[k * width], width, &into[field_.node(k) * PetscInt(dof)] + (dof - width));
    }
    model_.solve_velocities(u_);
  }

 private:
  std::vector<double> unknowns(Vec u) const {
    const size_t dof = size_t(field_.dof()), width = size_t(field_.width());
    const Reading all(u);
    std::vector<double> y(size_t(field_.dim()));
    for (size_t k = 0; k < field_.nodes(); ++k)
      std::copy_n(&all[field_.node(k) * PetscInt(dof)] + (dof - width), width, &y[k * width]);
    return y;
  }

  const CellField& field_;
  Model model_;
  VecHandle u_;
  double escape_, t_ = 0;  // the first: see escape_velocity()
  std::optional<Integrator> steps_;
};

// A passage of the section: psi of one node passes the plate's velocity, its mean, upwards (downwards where v
// < 0, so that the cycle of a mirror image is the mirror image of the cycle). Under a load the begin of one
// of its periods.
struct Passage {
  double t;
  std::vector<double> y;
};

class Settling {
 public:
  using Cycle = SmoothCycle;
  Settling(const Scene& cell, const std::vector<double>& start, double tolerance)
      : cell_(cell), field_(cell, cell.forced() ? 1 : 0), motion_(field_, start), tolerance_(tolerance),
        stiffness_(cell.averaged().K0()) {
    choose_section();
  }
  double turn() const { return 2 * M_PI / scales_of(cell_).rate; }
  // Without a passage: turns, and times in which the plate loads a block by a force of friction.
  double patience() const {
    const double load = stiffness_ * std::abs(cell_.v);
    return most_turns * turn() + (load > 0 ? most_loads / load : 0);
  }

  bool pass();
  double returned(int back) const;
  std::optional<SmoothCycle> close(int back);
  double growth(const SmoothCycle& found) const { return growth_rate(found.cycle) * found.cycle.period; }

  // Why there is none.
  [[noreturn]] void refuse(double nearest, int turns) const;

 private:
  void choose_section();
  double above(double psi) const { return cell_.v < 0 ? level_ - psi : psi - level_; }
  bool forced() const { return field_.periods() > 0; }
  double last_begin(double t) const { return std::floor(t / field_.period(0).T) * field_.period(0).T; }
  bool passes(const Sample& a, const Sample& b, size_t node) const {
    if (forced()) return last_begin(b.t) > a.t;
    return above(psi(a, node)) < 0 && above(psi(b, node)) >= 0;
  }
  double psi(const Sample& s, size_t node) const { return field_.psi(s.y.data(), node); }
  double psi_between(const Sample& a, const Sample& b, double t) const;
  Passage passage(const Sample& a, const Sample& b) const;
  void remember_passage();
  bool stands(const Sample& now);
  bool ends_beside(const Sample& now, bool certain);
  CycleGuess guess_since(const Passage& begin, const Passage& end) const;
  SmoothCycle shortest(SmoothCycle found) const;
  void check_steps();
  bool oscillates() const;
  bool dies_out() const;

  const Scene& cell_;
  CellField field_;
  Motion motion_;
  double tolerance_, stiffness_;  // the second: of a spring to the plate, in the mean
  size_t section_ = 0;  // the node whose psi it is
  double level_ = 0;
  std::vector<double> range_;
  std::deque<Sample> samples_;
  std::deque<Passage> passages_;
  double steps_ = 0, stands_since_ = std::numeric_limits<double>::infinity();
  double end_ = 0;  // no passage is waited for any longer
  bool pushed_ = false, ended_ = false;
  std::string why_;  // no cycle was found where the motion came nearest to itself
  double repeats_ = 0;  // period of a motion that comes back exactly
};

// The node that moves most, in the first turns, and in so many that one passes its section again: where
// friction is stiff the motion creeps for any number of turns between its slips.
void Settling::choose_section() {
  const size_t d = size_t(field_.dim()), nodes = field_.nodes();
  std::vector<double> low(d, 1e300), high(d, -1e300), slowest(nodes, 1e300), fastest(nodes, -1e300),
      sum(nodes);
  std::vector<int> passed(nodes);
  const bool known_mean = !forced() && !cell_.any_held();
  level_ = cell_.v;
  std::optional<Sample> last;
  double from = 0, until = 0;
  motion_.follow([&](Sample next) {
    if (!last) {
      from = next.t + 2 * turn();
      until = next.t + patience();
      last = std::move(next);
      return true;
    }
    check_steps();
    bool again = !known_mean;
    for (size_t k = 0; k < nodes && next.t > from; ++k) {
      const double before = psi(*last, k), now = psi(next, k);
      slowest[k] = std::min(slowest[k], now);
      fastest[k] = std::max(fastest[k], now);
      sum[k] += (next.t - last->t) * (now + before) / 2;
      if (!forced() && passes(*last, next, k)) ++passed[k];
      again = again || passed[k] > 2;
    }
    for (size_t k = 0; k < d && next.t > from; ++k) {
      low[k] = std::min(low[k], next.y[k]);
      high[k] = std::max(high[k], next.y[k]);
    }
    const bool ends = stands(next) || next.t > (again ? from + 6 * turn() : until);
    last = std::move(next);
    return !ends;
  });
  for (size_t k = 0; k < nodes; ++k)
    if (fastest[k] - slowest[k] > fastest[section_] - slowest[section_]) section_ = k;
  if (!known_mean) level_ = sum[section_] / (last->t - from);
  range_.clear();
  for (size_t k = 0; k < d; ++k) range_.push_back(std::max(high[k] - low[k], 1e-9 * field_.unit(int(k))));
  samples_ = {*last};
  passages_.clear();
  // without a passage it slides or rests; a load's come without fail, in any number to a turn of the motion
  end_ = forced() ? std::numeric_limits<double>::infinity() : last->t + patience();
}

double Settling::psi_between(const Sample& a, const Sample& b, double t) const {
  const size_t width = size_t(field_.width()), from = section_ * width;
  if (width == size_t(field_.dof())) return hermite(a, b, t, from);
  std::vector<double> y(a.y);
  for (size_t k = from; k < from + width; ++k) y[k] = hermite(a, b, t, k);
  return field_.psi(y.data(), section_);
}

Passage Settling::passage(const Sample& a, const Sample& b) const {
  const auto excess = [&](double t) { return above(psi_between(a, b, t)); };
  const double t = forced() ? last_begin(b.t)
                            : find_root(excess, {a.t, above(psi(a, section_)), b.t, above(psi(b, section_))},
                                        1e-14 * b.t);
  Passage p{t, {}};
  for (size_t k = 0; k < a.y.size(); ++k) p.y.push_back(hermite(a, b, p.t, k));
  return p;
}

// Whether the springs' forces and the states stay, for a turn.
bool Settling::stands(const Sample& now) {
  const size_t width = size_t(field_.width()), eta = field_.width() == field_.dof() ? 1 : 0;
  const double slide = std::max(std::abs(cell_.v), 1e-9 * field_.unit_of_psi());
  bool still = !forced();
  for (size_t k = 0; k < now.f.size() && still; ++k) {
    const size_t kind = k % width;
    if (kind < eta) continue;  // psi follows
    still = kind == eta ? std::abs(now.f[k]) <= beside * stiffness_ * slide
                        : std::abs(now.f[k]) * turn() <= beside * field_.unit(int(k));
  }
  if (!still)
    stands_since_ = std::numeric_limits<double>::infinity();
  else
    stands_since_ = std::min(stands_since_, now.t);
  return now.t > stands_since_ + turn();
}

// Whether the motion ends here, beside sliding or rest; `certain`: it does not oscillate any more. Where
// sliding is unstable it is pushed off, once, along the deviation that grows most.
bool Settling::ends_beside(const Sample& now, bool certain) {
  const size_t d = size_t(field_.dim()), width = size_t(field_.width());
  std::vector<double> J(d * d);
  field_.jacobian(now.y.data(), J.data());
  const Eigenpair lead = leading_deviation(int(d), J);
  const double growth = lead.value.real() * turn();
  stands_since_ = std::numeric_limits<double>::infinity();  // looked at again after another turn
  if (growth < no_growth || pushed_) return certain || growth < -no_growth;
  double most = 0;
  for (size_t k = 0; k < d; ++k) {
    const bool velocity = width == size_t(field_.dof()) && k % width == 0;
    const double size = velocity && cell_.v != 0 ? std::abs(cell_.v) : field_.unit(int(k));
    most = std::max(most, std::abs(lead.vector[k].real()) / size);
  }
  std::vector<double> y = now.y;
  for (size_t k = 0; k < d; ++k) y[k] += push_off * lead.vector[k].real() / most;
  motion_.set(y);
  pushed_ = true;
  choose_section();
  return false;
}

bool Settling::pass() {
  for (;;) {
    bool first = true, passed = false, stood = false;
    motion_.follow([&](Sample next) {
      if (first) return first = false, true;  // the last one once more
      check_steps();
      samples_.push_back(std::move(next));
      while (samples_.size() > 2 && !passages_.empty() && samples_[1].t < passages_.front().t)
        samples_.pop_front();
      const Sample &a = samples_[samples_.size() - 2], &b = samples_.back();
      passed = passes(a, b, section_);
      stood = stands(b);
      return !passed && !stood && b.t <= end_;
    });
    if (passed) remember_passage();
    const bool over = samples_.back().t > end_, still = !forced() && passages_.size() > 1 && !oscillates();
    ended_ = over || ((stood || still) && ends_beside(samples_.back(), still));
    if (ended_) return false;
    if (passed) return true;
  }
}

void Settling::remember_passage() {
  passages_.push_back(passage(samples_[samples_.size() - 2], samples_.back()));
  const size_t count = passages_.size();
  const double now = passages_.back().t, before = count < 2 ? now : passages_[count - 2].t;
  if (!forced()) end_ = now + std::max(patience(), 20 * (now - before));
  if (count > most_returns + 1) passages_.pop_front();
}

double Settling::returned(int back) const {
  if (size_t(back) >= passages_.size()) return std::numeric_limits<double>::infinity();
  const Passage &a = passages_.back(), &b = passages_[passages_.size() - 1 - size_t(back)];
  double largest = 0;
  for (size_t k = 0; k < a.y.size(); ++k) largest = std::max(largest, std::abs(a.y[k] - b.y[k]) / range_[k]);
  return largest;
}

CycleGuess Settling::guess_since(const Passage& begin, const Passage& end) const {
  const double period = end.t - begin.t;
  return {period,
          [this, begin, period](double phase, double* natural) {
            const double t = begin.t + phase * period;
            const auto after = std::lower_bound(samples_.begin() + 1, samples_.end() - 1, t,
                                                [](const Sample& s, double at) { return s.t < at; });
            std::vector<double> y(range_.size());
            for (size_t k = 0; k < y.size(); ++k) y[k] = hermite(*(after - 1), *after, t, k);
            unfold(field_, y.data(), natural);
          },
          {},
          forced() ? int(std::lround(period / field_.period(0).T)) : 0};
}

// Collocation from the motion since then, on ever more of its steps where it surely repeats.
std::optional<SmoothCycle> Settling::close(int back) {
  constexpr double most_numbers = 2e6;  // of unknowns^2 over the intervals
  const Passage &end = passages_.back(), &begin = passages_[passages_.size() - 1 - size_t(back)];
  const double nearness = returned(back), d = field_.dim();
  std::vector<double> times;
  for (const Sample& s : samples_)
    if (s.t > begin.t && s.t < end.t) times.push_back(s.t);
  CycleGuess guess = guess_since(begin, end);
  for (size_t most = d > 30 ? 40 : 80;; most *= 2) {
    const size_t intervals = std::min(times.size(), most);
    guess.mesh = {0};
    for (size_t i = 1; i < intervals; ++i)
      guess.mesh.push_back((times[i * times.size() / intervals] - begin.t) / guess.period);
    guess.mesh.push_back(1);
    try {
      const SmoothCycle whole = solve_cycle(cell_, guess, tolerance_);
      // near the motion that it was sought from, and no rest
      if (!forced() && !(whole.cycle.amplitude > 1e-6 * field_.unit_of_psi() &&
                         std::abs(whole.cycle.period / guess.period - 1) < .1))
        return std::nullopt;
      return shortest(whole);
    } catch (const Failure& e) {
      why_ = e.what();
    }
    if (nearness > surely || most >= times.size() || 2 * double(most) * d * d > most_numbers) break;
  }
  if (nearness < exactly) repeats_ = guess.period;
  return std::nullopt;
}

// By how much a profile misses itself a part of the period later, over its ranges; beyond `enough` no more
// than that.
double misses(const SmoothCycle& c, const std::vector<double>& range, int parts, double enough) {
  constexpr int places = 64;
  const int d = c.field->dim();
  std::vector<double> here(range), there(range);
  double apart = 0;
  for (int place = 0; place < places && apart <= enough; ++place) {
    const double phase = double(place) / places;
    evaluate(Collocation::gauss5(), c.mesh, c.values.data(), d, phase, here.data());
    evaluate(Collocation::gauss5(), c.mesh, c.values.data(), d, phase + 1. / parts, there.data());
    for (size_t k = 0; k < range.size(); ++k)
      apart = std::max(apart,
                       std::abs(there[k] - here[k]) / std::max(range[k], 1e-9 * c.field->unit(int(k))));
  }
  return apart;
}

// What goes round several times in a period, under a load in several of its periods, as it seems to beside a
// doubling, is the shorter cycle.
SmoothCycle Settling::shortest(SmoothCycle found) const {
  constexpr double same = 1e-6;
  const auto range_of = [&] { return ranges(found.values.data(), points_on(found.mesh), field_.dim()); };
  const auto most = [&] { return forced() ? found.cycle.forcing_periods : int(found.mesh.size()) / 4; };
  std::vector<double> range = range_of();
  for (int parts = 2; parts <= most();) {
    if ((forced() && found.cycle.forcing_periods % parts != 0) ||
        misses(found, range, parts, same) > same) {
      ++parts;
      continue;
    }
    CycleGuess guess{found.cycle.period / parts,
                     [&](double phase, double* natural) {
                       std::vector<double> y(size_t(field_.dim()));
                       evaluate(Collocation::gauss5(), found.mesh, found.values.data(), field_.dim(),
                                phase / parts, y.data());
                       unfold(field_, y.data(), natural);
                     },
                     {0},
                     forced() ? found.cycle.forcing_periods / parts : 0};
    for (const double phase : found.mesh)
      if (phase > 0 && phase * parts < 1 - 1e-9) guess.mesh.push_back(phase * parts);
    guess.mesh.push_back(1);
    found = solve_cycle(cell_, guess, tolerance_);
    range = range_of();
  }
  return found;
}

// Steps so short that a dozen turns do not fit into memory, or into anybody's patience.
void Settling::check_steps() {
  const size_t bytes = sizeof(Sample) + 2 * (size_t(field_.dim()) * sizeof(double) + 16),
               most = size_t(most_memory) / bytes;
  if (samples_.size() > most)
    throw NoCycle("is too stiff to be followed: " + std::to_string(most) + " steps, which take " +
                  std::to_string(size_t(most_memory) / 1000000) + " MB, are less than " +
                  std::to_string(most_returns) + " turns");
  if (++steps_ > most_steps / (1 + field_.dim() / 30.))
    throw NoCycle(fmt::format("has not settled in {:.0f} steps", steps_));
}

bool Settling::oscillates() const {
  double low = 1e300, high = -1e300;
  for (const Sample& s : samples_) {
    low = std::min(low, psi(s, section_));
    high = std::max(high, psi(s, section_));
  }
  return high - low >= 1e-7 * field_.unit_of_psi();
}

// Whether the motion, which still oscillates, has shrunk towards sliding that is stable.
bool Settling::dies_out() const {
  constexpr double small = 0.05;  // of its range in the first turns
  const size_t d = range_.size();
  for (size_t k = 0; k < d; ++k) {
    const auto [low, high] = std::minmax_element(
        samples_.begin(), samples_.end(), [k](const Sample& a, const Sample& b) { return a.y[k] < b.y[k]; });
    if (high->y[k] - low->y[k] > small * range_[k]) return false;
  }
  std::vector<double> J(d * d);
  field_.jacobian(samples_.back().y.data(), J.data());
  return leading_deviation(int(d), J).value.real() < 0;
}

void Settling::refuse(double nearest, int turns) const {
  const double last = psi(samples_.back(), section_);
  if (samples_.back().t > end_)
    throw NoCycle("does not pass the plate's velocity again within a time of " + rounded_text(patience()));
  if (ended_ || (!forced() && dies_out())) {
    const bool slides = std::abs(last) > 1e-2 * std::abs(cell_.v);
    throw NoCycle(slides ? "settles on steady sliding" : "comes to rest, psi " + rounded_text(last, 2));
  }
  if (repeats_ > 0)
    throw NoCycle("repeats after a time of " + rounded_text(repeats_, 10) +
                  ", but no cycle can be made of it: " + why_);
  throw Failure(
      fmt::format("no cycle: in {} {} the motion from the start never repeats; its nearest return "
                  "within {} of them misses by {:.3g} of its range (chaos, or a slow transient: another "
                  "start may settle)",
                  turns, forced() ? "periods of the load" : "turns", most_returns, nearest));
}

}  // namespace

SmoothCycle settled_cycle(const Scene& cell, const std::vector<double>& start, int turns, double tolerance) {
  check_smooth_cell(cell);
  Settling motion(cell, start, tolerance);
  if (cell.forced()) turns = int(std::ceil(turns * std::max(1., motion.turn() / cell.forcing_period())));
  const Settled<SmoothCycle> settled = settle(motion, {double(turns), near_enough, true});
  if (settled.cycle) return *settled.cycle;
  motion.refuse(settled.nearest, turns);
}

}  // namespace stickslip
