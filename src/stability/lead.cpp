#include "stickslip/stability/boundary.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "stability/modes.hpp"
#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

double count_margin(const LinearisedOperator& s, double frequency, double part) {
  return part * (spring_frequency(s) + frequency);
}

double same_growth(const LinearisedOperator& s) { return same_growth(s.mean()); }

std::optional<ContinuumLead> lead_without_grid(const LinearisedOperator& s, bool refine) {
  return refine ? continuum_lead(s) : std::nullopt;
}

bool all_known(const LinearisedOperator& s, bool refine) {
  return s.has_exact_waves() || lead_without_grid(s, refine);
}

// ---- one mode

namespace {

// Rayleigh's quotient iteration on both eigenvectors.
bool follow_one(const LinearisedOperator& s, FollowedMode& f) {
  BandLU lu;
  for (int k = 0; k < 5; ++k) {
    const auto start = stationary_value(s, f.mode, f.left);
    if (!start) return false;
    const double scale = std::abs(*start) + s.rate;
    f.mode.value = *start;
    s.factor(*start, lu);
    f.mode.psi = s.apply_slope(*start, f.mode.psi);
    s.solve(lu, f.mode.psi);
    normalise(f.mode.psi);
    if (s.symmetric()) {
      f.left = left_vector(s, f.mode);
    } else {
      f.left = s.apply_slope(*start, f.left);  // S' is diagonal
      s.solve_transposed(lu, f.left);
      normalise(f.left);
    }
    const auto value = stationary_value(s, f.mode, f.left);
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

// What a count may cost, in node evaluations.
double count_effort(const LinearisedOperator& s) {
  return 2e6 + 400 * double(s.size()) * std::log2(double(s.size()));
}

// ---- several

// The modes known, on their way to an operator.
class Following {
 public:
  Following(const LinearisedOperator& s, KnownModes& known, const LeadSettings& settings)
      : s_(s), known_(known), modes_(known.modes), settings_(settings) {}

  std::optional<LeadingMode> lead(MPI_Comm comm, bool counted) {
    std::optional<LeadingMode> found = follow();
    known_.sure = found.has_value();
    if (!found) recover(comm);
    if (modes_.empty()) return std::nullopt;
    if (found && !counted) return found;
    if (counted && !complete(comm)) search(comm, true);
    return leading();
  }
  // Every eigenvalue is had for less than following some.
  std::optional<LeadingMode> lead_of_all(MPI_Comm comm) {
    modes_.clear();
    search(comm, false);
    if (modes_.empty()) return std::nullopt;
    return leading();
  }
  void take_up(const std::vector<FollowedMode>& more);

 private:
  bool add(Mode&& mode, std::vector<FollowedMode>& all) const;
  bool add_near(std::vector<Complex> where, double line, std::vector<FollowedMode>& all) const;
  bool add_missing(MPI_Comm comm, long count, std::vector<Complex> where, double line,
                   std::vector<FollowedMode>& all) const;
  std::optional<long> count_firmly(MPI_Comm comm, double line, std::vector<Complex>& where) const;
  void keep_rightmost(std::vector<FollowedMode> all);
  std::vector<Mode> sought(MPI_Comm comm, bool thorough) const;
  void search(MPI_Comm comm, bool thorough);
  void recover(MPI_Comm comm);
  std::optional<LeadingMode> follow();
  LeadingMode leading() const;
  bool complete(MPI_Comm comm);
  double reach() const {  // frequency up to which modes count
    return (settings_.refine ? resolved_frequency(s_) : 1.01 * s_.imaginary_bound()) * (1 + 1e-12);
  }
  double line_behind(const Mode& m) const {
    return m.value.real() + count_margin(s_, m.value.imag(), settings_.slack);
  }

  const LinearisedOperator& s_;
  KnownModes& known_;
  std::vector<FollowedMode>& modes_;
  const LeadSettings& settings_;
};

// Adds a mode that counts and is not there yet.
bool Following::add(Mode&& m, std::vector<FollowedMode>& all) const {
  if (m.psi.size() != s_.size() || m.value.imag() > reach() || is_neutral(s_, m)) return false;
  const double near = nearness(s_, m.value);
  for (const FollowedMode& o : all)
    if (std::abs(o.mode.value - m.value) < near) return false;
  all.push_back({std::move(m), {}});
  return true;
}

// Those that may lead here or nearby are kept: of several modes with nearly the same growth rate two.
void Following::keep_rightmost(std::vector<FollowedMode> all) {
  std::sort(all.begin(), all.end(), [](const FollowedMode& a, const FollowedMode& b) {
    return a.mode.value.real() > b.mode.value.real();
  });
  const double alike = 1e-4 * s_.rate;
  modes_.clear();
  for (FollowedMode& f : all) {
    if (modes_.size() == 5) break;
    const double value = f.mode.value.real();
    if (std::count_if(modes_.begin(), modes_.end(),
                      [&](const FollowedMode& o) { return o.mode.value.real() - value <= alike; }) >= 2)
      continue;
    if (f.left.empty()) f.left = left_vector(s_, f.mode);
    modes_.push_back(std::move(f));
  }
}

// What the shifts of compute_spectrum() find, or (thorough) all its means.
std::vector<Mode> Following::sought(MPI_Comm comm, bool thorough) const {
  SpectrumSettings settings;
  settings.count = 6;
  settings.compare = false;
  settings.refine = settings_.refine;
  settings.quick = !thorough;
  settings.whole_list = false;
  settings.effort = count_effort(s_);
  return compute_spectrum(comm, s_, settings).modes;
}

// These, beside the modes followed so far.
void Following::search(MPI_Comm comm, bool thorough) {
  std::vector<FollowedMode> all;
  for (FollowedMode& f : modes_)
    if (f.mode.psi.size() == s_.size() && polish(s_, f.mode)) add(std::move(f.mode), all);
  for (Mode& m : sought(comm, thorough)) add(std::move(m), all);
  keep_rightmost(std::move(all));
}

// Polishes them from where they were, whatever they become; searches where none is left.
void Following::recover(MPI_Comm comm) {
  std::vector<FollowedMode> all;
  for (FollowedMode& f : modes_)
    if (f.mode.psi.size() == s_.size() && polish(s_, f.mode, 12)) add(std::move(f.mode), all);
  keep_rightmost(std::move(all));
  if (modes_.empty()) search(comm, false);
}

void Following::take_up(const std::vector<FollowedMode>& more) {
  std::vector<FollowedMode> all;
  for (const auto* list : {&std::as_const(modes_), &more})
    for (FollowedMode f : *list) {
      if (f.mode.psi.size() != s_.size() || !follow_one(s_, f)) continue;
      std::vector<Complex> left = std::move(f.left);
      if (add(std::move(f.mode), all)) all.back().left = std::move(left);
    }
  keep_rightmost(std::move(all));
}

// The leading one of the modes followed to this operator; nothing where the last one was lost, or too few are
// left. All are estimated, and those that might lead are taken along.
std::optional<LeadingMode> Following::follow() {
  struct Guess {
    std::size_t index;
    double value, shift;
  };
  const double level = same_growth(s_), height = reach();
  std::vector<Guess> guesses;
  std::vector<char> lost(modes_.size(), 0);
  for (std::size_t k = 0; k < modes_.size(); ++k) {
    if (modes_[k].mode.psi.size() != s_.size()) return std::nullopt;
    const auto value = stationary_value(s_, modes_[k].mode, modes_[k].left);
    if (value)
      guesses.push_back({k, value->real(), std::abs(*value - modes_[k].mode.value)});
    else
      lost[k] = 1;
  }
  std::sort(guesses.begin(), guesses.end(), [](const Guess& a, const Guess& b) { return a.value > b.value; });
  const FollowedMode* best = nullptr;
  bool degenerate = false;
  for (const Guess& g : guesses) {
    FollowedMode& f = modes_[g.index];
    const double scale = std::abs(f.mode.value) + s_.rate;
    // the estimate is better than this by far, unless the mode has moved a long way
    if (best && g.shift < 0.05 * scale && g.value + 0.5 * g.shift + level < best->mode.value.real()) continue;
    if (!follow_one(s_, f) || f.mode.value.imag() > height || is_neutral(s_, f.mode)) {
      lost[g.index] = 1;
      continue;
    }
    if (best) {
      const double apart = std::abs(f.mode.value - best->mode.value);
      const double ahead = f.mode.value.real() - best->mode.value.real();
      if (std::abs(ahead) <= level && apart > 1e3 * level)
        degenerate = true;
      else if (ahead > level)
        degenerate = false;
      if (ahead <= 0) continue;
    }
    best = &f;
  }
  if (!best || (lost[0] && !(settings_.only_sign && best->mode.value.real() > level))) return std::nullopt;
  const LeadingMode result{best->mode, degenerate};
  std::size_t leader = std::size_t(best - modes_.data());
  for (std::size_t k = modes_.size(); k-- > 0;)
    if (lost[k]) {
      if (leader > k) --leader;
      modes_.erase(modes_.begin() + long(k));
    }
  std::swap(modes_[0], modes_[leader]);
  return result;
}

// As known, with no step taken; there must be one.
LeadingMode Following::leading() const {
  LeadingMode best{modes_[0].mode, false};
  const double level = same_growth(s_);
  for (const FollowedMode& f : modes_)
    if (best.mode.value.real() - f.mode.value.real() <= level &&
        std::abs(f.mode.value - best.mode.value) > 1e3 * level)
      best.degenerate = true;
  return best;
}

// ---- those that are missing

// Polishes zeros that a count has seen, the rightmost four; whether one is new.
bool Following::add_near(std::vector<Complex> where, double line, std::vector<FollowedMode>& all) const {
  bool found = false;
  std::sort(where.begin(), where.end(), [](Complex a, Complex b) { return a.real() > b.real(); });
  for (std::size_t k = 0; k < std::min<std::size_t>(where.size(), 4); ++k) {
    Mode m = mode_near(s_, where[k]);
    if (polish(s_, m, 12) && m.value.real() > line && add(std::move(m), all)) found = true;
  }
  return found;
}

// Further right where an eigenvalue stands too near the line.
std::optional<long> Following::count_firmly(MPI_Comm comm, double line, std::vector<Complex>& where) const {
  for (const double aside : {0., 1e-7, 1e-6, 1e-5}) {
    where.clear();
    if (const auto n = count_leading(comm, s_, line + aside * s_.rate, settings_.refine, &where)) return n;
  }
  return std::nullopt;
}

// Adds one at least of the modes that a count has found right of the line: the zeros that it names; where it
// names none, it is counted further right, by ever larger steps and then halving, until a zero stands near
// the line.
bool Following::add_missing(MPI_Comm comm, long first_count, std::vector<Complex> where, double line,
                            std::vector<FollowedMode>& all) const {
  std::optional<long> count = first_count;
  // few, or all of them listed: else the rightmost may not be among them
  const auto listed = [&] { return *count > 0 && (*count <= 4 || 2 * long(where.size()) >= *count - 2); };
  if (listed() && add_near(where, line, all)) return true;
  double low = line, high = std::numeric_limits<double>::infinity();
  bool close = !where.empty();  // to some of them
  // Counts that cost what a search does: little where few unknowns give every eigenvalue at once.
  const int fruitless = s_.unknowns() <= 128 ? 3 : int(std::clamp(4500. / double(s_.size()), 3., 24.));
  for (int k = 0; k < 24 && high - low > (close ? 1e-9 : 1e-4) * s_.rate; ++k) {
    if (k == fruitless) {
      bool found = false;
      for (Mode& m : sought(comm, false)) found = (m.value.real() > line && add(std::move(m), all)) || found;
      if (found) return true;
    }
    const double a = std::isfinite(high) ? (low + high) / 2 : low + std::ldexp(1e-4 * s_.rate, 2 * k);
    count = count_firmly(comm, a, where);
    if (!count) break;
    (*count > 0 ? low : high) = a;
    if (*count > 0) close = !where.empty();
    if (listed() && add_near(where, line, all)) return true;
  }
  return false;
}

// Counts the modes right of the rightmost one here and adds those that the count sees. False where it counts
// some that it does not see.
bool Following::complete(MPI_Comm comm) {
  std::vector<FollowedMode> all = modes_;
  const Mode& leader = all[0].mode;
  double line = line_behind(leader);
  const double bound =
      s_.symmetric() && !s_.has_state() ? s_.real_bound() : std::numeric_limits<double>::infinity();
  known_.sure = true;
  if (bound <= line || (settings_.only_sign && bound <= 0)) return true;
  if (settings_.only_sign) {
    if (line > 2 * count_margin(s_, leader.value.imag(), settings_.slack)) return true;
    line = std::max(line, count_margin(s_, 0, settings_.slack));
  }
  for (int round = 0; round < 6; ++round) {
    std::vector<Complex> where;
    const std::optional<long> count = count_firmly(comm, line, where);
    if (!count || *count == 0) {  // where it gives no answer a search would know no more
      known_.sure = count.has_value();
      keep_rightmost(std::move(all));
      return true;
    }
    if (!add_missing(comm, *count, std::move(where), line, all)) break;
    for (const FollowedMode& f : all) line = std::max(line, line_behind(f.mode));
  }
  keep_rightmost(std::move(all));
  return false;
}

// The leading one of all waves of the discrete dispersion relation; of equal ones the longest.
std::optional<LeadingMode> leading_wave(const LinearisedOperator& s) {
  const auto found = fastest_wave(s.mean(), Waves::of(s.scene), same_growth(s));
  if (!found) return std::nullopt;
  LeadingMode best{{}, found->degenerate};
  best.mode.value = found->value;
  best.mode.wavenumber = found->wavenumber;
  return best;
}

}  // namespace

std::optional<long> count_leading(MPI_Comm comm, const LinearisedOperator& s, double a, bool refine,
                                  std::vector<Complex>* where) {
  const double bound = 1.01 * s.imaginary_bound(),
               height = refine ? std::min(bound, resolved_frequency(s)) : bound;
  std::optional<long> count = count_right(comm, s, a, height, count_effort(s), where);
  if (count && s.neutral() && a < 0) --*count;
  return count;
}

void take_up(const LinearisedOperator& s, KnownModes& known, const std::vector<FollowedMode>& more,
             const LeadSettings& settings) {
  Following(s, known, settings).take_up(more);
}

bool is_followed(const LinearisedOperator& s, bool refine) {
  constexpr std::size_t small = 64;  // unknowns
  return s.unknowns() > small && !all_known(s, refine);
}

std::optional<LeadingMode> lead(MPI_Comm comm, const LinearisedOperator& s, KnownModes& known, bool counted,
                                const LeadSettings& settings) {
  if (const auto found = lead_without_grid(s, settings.refine)) {
    LeadingMode best{{}, found->degenerate};
    best.mode.value = {found->growth, found->frequency};
    best.mode.wavenumber = found->wavenumber;
    return best;
  }
  if (s.has_exact_waves()) return leading_wave(s);
  Following modes(s, known, settings);
  return is_followed(s, settings.refine) ? modes.lead(comm, counted) : modes.lead_of_all(comm);
}

}  // namespace stickslip
