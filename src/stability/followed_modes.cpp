#include "stability/followed_modes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stability/modes.hpp"
#include "stickslip/stability/continuum.hpp"
#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

double count_margin(const LinearisedOperator& s, double frequency, double part) {
  return part * (spring_frequency(s) + frequency);
}

double same_growth(const LinearisedOperator& s) { return same_growth(s.mean()); }

// ---- one mode
// -----------------------------------------------------------------------------------------------------

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

}  // namespace

// ---- several
// ------------------------------------------------------------------------------------------------------

double FollowedModes::count_height(const LinearisedOperator& s) const {
  const double bound = 1.01 * s.imaginary_bound();
  return refine_ ? std::min(bound, resolved_frequency(s)) : bound;
}

double FollowedModes::reach(const LinearisedOperator& s) const {
  return (refine_ ? resolved_frequency(s) : 1.01 * s.imaginary_bound()) * (1 + 1e-12);
}

double FollowedModes::line_behind(const LinearisedOperator& s, const Mode& m) const {
  return m.value.real() + count_margin(s, m.value.imag(), slack_);
}

// Adds a mode that counts and is not there yet.
bool FollowedModes::add(const LinearisedOperator& s, Mode&& m, std::vector<FollowedMode>& all) const {
  if (m.psi.size() != s.size() || m.value.imag() > reach(s) || is_neutral(s, m)) return false;
  const double near = nearness(s, m.value);
  for (const FollowedMode& o : all)
    if (std::abs(o.mode.value - m.value) < near) return false;
  all.push_back({std::move(m), {}});
  return true;
}

// Those that may lead here or nearby are kept: of several modes with nearly the same growth rate two.
void FollowedModes::keep_rightmost(const LinearisedOperator& s, std::vector<FollowedMode> all) {
  std::sort(all.begin(), all.end(), [](const FollowedMode& a, const FollowedMode& b) {
    return a.mode.value.real() > b.mode.value.real();
  });
  const double alike = 1e-4 * s.rate;
  modes_.clear();
  leader_ = 0;
  for (FollowedMode& f : all) {
    if (modes_.size() == 5) break;
    const double value = f.mode.value.real();
    if (std::count_if(modes_.begin(), modes_.end(),
                      [&](const FollowedMode& o) { return o.mode.value.real() - value <= alike; }) >= 2)
      continue;
    if (f.left.empty()) f.left = left_vector(s, f.mode);
    modes_.push_back(std::move(f));
  }
}

void FollowedModes::search(const LinearisedOperator& s, bool thorough) {
  SpectrumSettings settings;
  settings.count = 6;
  settings.compare = false;
  settings.refine = refine_;
  settings.quick = !thorough;
  settings.whole_list = false;
  settings.effort = count_effort(s);
  std::vector<FollowedMode> all;
  for (FollowedMode& f : modes_)
    if (f.mode.psi.size() == s.size() && polish(s, f.mode)) add(s, std::move(f.mode), all);
  for (Mode& m : compute_spectrum(comm_, s, settings).modes) add(s, std::move(m), all);
  keep_rightmost(s, std::move(all));
}

void FollowedModes::recover(const LinearisedOperator& s) {
  std::vector<FollowedMode> all;
  for (FollowedMode& f : modes_)
    if (f.mode.psi.size() == s.size() && polish(s, f.mode, 12)) add(s, std::move(f.mode), all);
  keep_rightmost(s, std::move(all));
  if (modes_.empty()) search(s, false);
  doubtful_ = true;
}

void FollowedModes::take_up(const LinearisedOperator& s, const std::vector<FollowedMode>& more) {
  std::vector<FollowedMode> all;
  for (const std::vector<FollowedMode>* list : {const_cast<const std::vector<FollowedMode>*>(&modes_), &more})
    for (FollowedMode f : *list) {
      if (f.mode.psi.size() != s.size() || !follow_one(s, f)) continue;
      std::vector<Complex> left = std::move(f.left);
      if (add(s, std::move(f.mode), all)) all.back().left = std::move(left);
    }
  keep_rightmost(s, std::move(all));
}

// All are estimated, and those that might lead are taken along.
std::optional<LeadingMode> FollowedModes::follow(const LinearisedOperator& s) {
  struct Guess {
    std::size_t index;
    double value, shift;
  };
  const double level = same_growth(s), height = reach(s);
  std::vector<Guess> guesses;
  std::vector<char> lost(modes_.size(), 0);
  for (std::size_t k = 0; k < modes_.size(); ++k) {
    if (modes_[k].mode.psi.size() != s.size()) return std::nullopt;
    const auto value = stationary_value(s, modes_[k].mode, modes_[k].left);
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
    const double scale = std::abs(f.mode.value) + s.rate;
    // the estimate is better than this by far, unless the mode has moved a long way
    if (best && g.shift < 0.05 * scale && g.value + 0.5 * g.shift + level < best->mode.value.real()) continue;
    if (!follow_one(s, f) || f.mode.value.imag() > height || is_neutral(s, f.mode)) {
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
  if (!best || (lost[leader_] && !(only_sign_ && best->mode.value.real() > level))) return std::nullopt;
  const LeadingMode result{best->mode, degenerate};
  leader_ = best - modes_.data();
  for (std::size_t k = modes_.size(); k-- > 0;)
    if (lost[k]) {
      if (leader_ > k) --leader_;
      modes_.erase(modes_.begin() + k);
    }
  return result;
}

LeadingMode FollowedModes::leading(const LinearisedOperator& s) const {
  LeadingMode best{modes_[leader_].mode, false};
  const double level = same_growth(s);
  for (const FollowedMode& f : modes_)
    if (best.mode.value.real() - f.mode.value.real() <= level &&
        std::abs(f.mode.value - best.mode.value) > 1e3 * level)
      best.degenerate = true;
  return best;
}

// ---- those that are missing
// ---------------------------------------------------------------------------------------

std::optional<long> FollowedModes::count(const LinearisedOperator& s, double a,
                                         std::vector<Complex>* where) const {
  std::optional<long> count = count_right(comm_, s, a, count_height(s), count_effort(s), where);
  if (count && s.neutral() && a < 0) --*count;
  return count;
}

// Further right where an eigenvalue stands too near the line.
std::optional<long> FollowedModes::count_firmly(const LinearisedOperator& s, double a,
                                                std::vector<Complex>& where) const {
  for (const double aside : {0., 1e-7, 1e-6, 1e-5}) {
    where.clear();
    if (const auto n = count(s, a + aside * s.rate, &where)) return n;
  }
  return std::nullopt;
}

// Polishes zeros that a count has seen, the rightmost four; whether one is new.
bool FollowedModes::add_near(const LinearisedOperator& s, std::vector<Complex> where, double line,
                             std::vector<FollowedMode>& all) const {
  bool found = false;
  std::sort(where.begin(), where.end(), [](Complex a, Complex b) { return a.real() > b.real(); });
  for (std::size_t k = 0; k < std::min<std::size_t>(where.size(), 4); ++k) {
    Mode m = mode_near(s, where[k]);
    if (polish(s, m, 12) && m.value.real() > line && add(s, std::move(m), all)) found = true;
  }
  return found;
}

// The frequency of a mode right of a line, by counting below lower and lower frequencies.
double FollowedModes::frequency_by_halving(const LinearisedOperator& s, double line) const {
  double below = 0, above = count_height(s);
  for (int k = 0; k < 14; ++k) {
    const double middle = (below + above) / 2;
    const auto lower = count_right(comm_, s, line, middle, count_effort(s));
    if (!lower) break;
    (*lower > (s.neutral() && line < 0 ? 1 : 0) ? above : below) = middle;
  }
  return (below + above) / 2;
}

// Adds one at least of the modes that a count has found right of the line: the zeros that it names; where it
// names none, it is counted further right, by ever larger steps and then halving, until a zero stands near
// the line.
bool FollowedModes::add_missing(const LinearisedOperator& s, long first_count, std::vector<Complex> where,
                                double line, std::vector<FollowedMode>& all) const {
  const double unit = s.rate;
  std::optional<long> count = first_count;
  // few, or all of them listed: else the rightmost may not be among them
  const auto listed = [&] { return *count > 0 && (*count <= 4 || 2 * long(where.size()) >= *count - 2); };
  if (listed() && add_near(s, where, line, all)) return true;
  double low = line, high = std::numeric_limits<double>::infinity();
  bool close = !where.empty();  // to some of them
  for (int k = 0; k < 24 && high - low > (close ? 1e-9 : 1e-4) * unit; ++k) {
    const double a = std::isfinite(high) ? (low + high) / 2 : low + std::ldexp(1e-4 * unit, 2 * k);
    count = count_firmly(s, a, where);
    if (!count) break;
    (*count > 0 ? low : high) = a;
    if (*count > 0) close = !where.empty();
    if (listed() && add_near(s, where, line, all)) return true;
  }
  const Complex guess(std::isfinite(high) ? (low + high) / 2 : low, frequency_by_halving(s, low));
  return add_near(s, {guess}, line, all);
}

bool FollowedModes::complete(const LinearisedOperator& s) {
  std::vector<FollowedMode> all = modes_;
  const Mode& leader = all[leader_].mode;
  double line = line_behind(s, leader);
  const double bound =
      s.symmetric() && !s.has_state() ? s.real_bound() : std::numeric_limits<double>::infinity();
  if (bound <= line || (only_sign_ && bound <= 0)) return true;
  if (only_sign_) {
    if (line > 2 * count_margin(s, leader.value.imag(), slack_)) return true;
    line = std::max(line, count_margin(s, 0, slack_));
  }
  for (int round = 0; round < 6; ++round) {
    std::vector<Complex> where;
    const std::optional<long> count = count_firmly(s, line, where);
    if (!count) doubtful_ = true;  // a search would know no more
    if (!count || *count == 0) {
      keep_rightmost(s, std::move(all));
      return true;
    }
    if (!add_missing(s, *count, std::move(where), line, all)) return false;
    for (const FollowedMode& f : all) line = std::max(line, line_behind(s, f.mode));
  }
  return false;
}

}  // namespace stickslip
