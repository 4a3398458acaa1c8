#include "stability/modes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

ModeSearch::ModeSearch(MPI_Comm comm, const LinearisedOperator& s, const SpectrumSettings& settings,
                       double height)
    : comm_(comm), s_(s), settings_(settings), height_(height), exact_(s),
      many_(s.size() > settings.long_from), tolerance_(s), own_(own_rate(s)),
      wanted_(settings.count / 2 + 2) {
  resolved_sought_ = settings.refine || !many_ || settings.quick || s.scene.form == Form::chain;
}

const Mode* ModeSearch::rightmost() const {
  const Mode* best = nullptr;
  for (const Mode& m : modes_)
    if (leads(m) && (!best || m.value.real() > best->value.real())) best = &m;
  return best;
}

// ---- guesses

// The modes of every task, on every rank.
std::vector<std::vector<Mode>> ModeSearch::distribute(std::size_t tasks, const Task& task) const {
  const int ranks = ranks_in(comm_), rank = rank_in(comm_);
  std::vector<std::vector<Mode>> found(tasks);
  for (std::size_t k = 0; k < tasks; ++k)
    if (int(k) % ranks == rank) found[k] = task(k);
  if (ranks == 1) return found;
  for (std::size_t k = 0; k < tasks; ++k) {
    const int owner = int(k) % ranks;
    long size = found[k].size();
    MPI_Bcast(&size, 1, MPI_LONG, owner, comm_);
    found[k].resize(size);
    for (Mode& m : found[k]) {
      double numbers[5] = {m.value.real(), m.value.imag(), m.residual, m.wavenumber, double(m.psi.size())};
      MPI_Bcast(numbers, 5, MPI_DOUBLE, owner, comm_);
      m.value = {numbers[0], numbers[1]};
      m.residual = numbers[2];
      m.wavenumber = numbers[3];
      m.psi.resize(numbers[4]);
      MPI_Bcast(m.psi.data(), int(2 * m.psi.size()), MPI_DOUBLE, owner, comm_);
    }
  }
  return found;
}

// The rightmost guesses within reach stay, and some beyond it.
void ModeSearch::select(std::vector<Mode>& guesses) const {
  std::size_t inside = 0, outside = 0;
  sort_modes(guesses, 1e-9 * (own_ + height_));
  guesses.erase(std::remove_if(guesses.begin(), guesses.end(),
                               [&](const Mode& m) {
                                 const std::size_t most = many_ ? (leads(m) ? wanted_ + 1 : 1) : wanted_ + 4;
                                 return ++(leads(m) ? inside : outside) > most;
                               }),
                guesses.end());
}

// Polishes guesses, the same on every rank.
void ModeSearch::take(std::vector<Mode> guesses) {
  std::vector<Mode> apart;
  add_guesses(s_, apart, std::move(guesses));
  select(apart);
  auto polished = distribute(apart.size(), [&](std::size_t k) {
    std::vector<Mode> one;
    if (polish(s_, apart[k])) one.push_back(std::move(apart[k]));
    return one;
  });
  for (std::vector<Mode>& one : polished) add_new(s_, modes_, std::move(one));
  add_mirror_images(s_, modes_);
}

void ModeSearch::try_shifts(const std::vector<Complex>& shifts, PetscInt count) {
  auto found = distribute(shifts.size(), [&](std::size_t k) {
    std::vector<Mode> modes = krylov_modes(s_, shifts[k], count);
    select(modes);
    return modes;
  });
  std::vector<Mode> all;
  for (std::vector<Mode>& modes : found) add_guesses(s_, all, std::move(modes));
  take(std::move(all));
}

// Modes near places where the count has seen them.
void ModeSearch::try_places(const std::vector<Complex>& places) {
  auto found =
      distribute(places.size(), [&](std::size_t k) { return std::vector<Mode>{mode_near(s_, places[k])}; });
  std::vector<Mode> all;
  for (std::vector<Mode>& modes : found) all.push_back(std::move(modes[0]));
  take(std::move(all));
}

// More shapes of the values of the first so many modes, and of the next two. Whether anything new was found.
bool ModeSearch::try_twins(std::size_t members) {
  const std::size_t before = modes_.size();
  auto found = distribute(std::min(before, members + 2), [&](std::size_t k) {
    std::vector<Mode> one;
    if (auto other = twin(s_, modes_, modes_[k])) one.push_back(std::move(*other));
    return one;
  });
  for (std::vector<Mode>& one : found) add_new(s_, modes_, std::move(one));
  return modes_.size() > before;
}

// What segments of the line would do alone: the rightmost of all their modes are nearly modes of the whole.
void ModeSearch::try_segments(bool quick, bool inside) {
  const std::vector<Segment> segments = promising_segments(s_, quick);
  auto found = distribute(segments.size(),
                          [&](std::size_t k) { return segment_modes(s_, segments[k], height_, inside); });
  struct Trapped {
    const Mode* mode;
    std::size_t first;
  };
  std::vector<Trapped> all;
  for (std::size_t k = 0; k < segments.size(); ++k)
    for (const Mode& m : found[k]) all.push_back({&m, segments[k].first});
  std::stable_sort(all.begin(), all.end(), [](const Trapped& a, const Trapped& b) {
    return a.mode->value.real() > b.mode->value.real();
  });
  if (all.size() > wanted_) all.resize(wanted_);
  std::vector<Mode> guesses;
  for (const Trapped& t : all) {
    Mode m;
    m.value = t.mode->value;
    m.psi.assign(s_.size(), Complex(0));
    std::copy(t.mode->psi.begin(), t.mode->psi.end(), m.psi.begin() + t.first);
    guesses.push_back(std::move(m));
  }
  take(std::move(guesses));
}

// Guesses from a grid of four times the spacing.
void ModeSearch::try_coarse_grid() {
  SpectrumSettings settings = settings_;
  settings.compare = settings.whole_list = false;
  settings.method = SpectrumMethod::krylov;
  settings.quick = many_;
  Scene scene = s_.scene;
  scene.n = scene.ring() ? scene.n / 4 : (scene.n - 1) / 4 + 1;
  const LinearisedOperator coarse(scene);
  std::vector<Mode> modes = compute_spectrum(comm_, coarse, settings).modes;
  std::vector<std::vector<Complex>*> shapes;
  for (Mode& m : modes) shapes.push_back(&m.psi);
  interpolate(coarse, s_, shapes);
  take(std::move(modes));
}

// Where all modes of a long grid count and the search has not closed: those that the grid resolves, whose own
// search is not led astray by crowds at the grid scale. Once; false where that is nothing new.
bool ModeSearch::try_resolved() {
  if (std::exchange(resolved_sought_, true)) return false;
  SpectrumSettings settings = settings_;
  settings.refine = true;
  settings.compare = settings.whole_list = false;
  take(compute_spectrum(comm_, s_, settings).modes);
  return true;
}

void ModeSearch::first_guesses() {
  const PetscInt unknowns = s_.unknowns();
  if (s_.neutral()) {
    Mode m;
    m.value = 0;
    m.psi.assign(s_.size(), Complex(1));
    m.residual = s_.mode_residual(0, m.psi);
    modes_.push_back(std::move(m));
  }
  if (exact_.apply()) take(exact_.rightmost(height_, many_ ? wanted_ + 2 : settings_.count + 2));
  if (exact_.apply() && many_) return;
  std::vector<Complex> shifts = first_shifts(s_, height_, settings_.count);
  if (!many_) {
    try_shifts(shifts, std::min<PetscInt>(unknowns, 2 * wanted_));
    if (!s_.uniform) try_segments(settings_.quick, false);
    if (settings_.refine && s_.scene.form == Form::continuum && s_.scene.n >= 2000 && !settings_.quick)
      try_coarse_grid();
    return;
  }
  const bool grid_scale = !settings_.refine || s_.scene.form == Form::chain;  // its modes count as well
  if (grid_scale && !settings_.quick)  // they crowd where they are trapped
    try_shifts({*std::max_element(shifts.begin(), shifts.end(),
                                  [](Complex a, Complex b) { return a.imag() < b.imag(); })},
               wanted_);
  if (shifts.size() > 2) shifts.resize(2);
  try_places(shifts);
  if (!s_.uniform && !settings_.quick) {
    try_segments(!grid_scale, false);
    if (grid_scale) try_segments(true, true);
  }
  if (s_.scene.form == Form::continuum && s_.scene.n > 200) try_coarse_grid();
}

// Looks where the count points, and ever more densely along the line.
void ModeSearch::scan(std::vector<Complex> places, double line, int round) {
  const double spacing = height_ / double(s_.size()), free = s_.real_bound() - line;
  const double near = std::max(1e-3 * (own_ + std::abs(line)), 0.5 * spacing);
  const double aside = near + std::max(0., free) * 0.25 * (round % 4);
  std::vector<Complex> shifts;
  for (std::size_t k = 0; k < std::min<std::size_t>(places.size(), 8); ++k) {
    shifts.push_back(places[k] + near);
    if (round > 0) shifts.push_back(places[k] + aside);
  }
  if (places.empty() || round > 1) {
    const int doublings = std::max(0, places.empty() ? round : round - 2);
    const int dense = int(std::min<long>(4L << doublings, 4 + s_.size() / 4));
    const std::vector<double> knots = mean_frequencies(s_);
    for (int k = 0; k < dense; ++k) {
      const double w =
          knots.empty() ? height_ * k / dense : knots[double(knots.size() - 1) * (k + 0.5) / dense];
      if (w <= height_) shifts.emplace_back(line + aside, w);
    }
    for (int k = 0; k < dense; ++k)  // real modes may stand far to the right
      shifts.emplace_back(line + aside + free * k / dense, 0);
  }
  try_shifts(shifts, std::min<PetscInt>(s_.unknowns(), 8));
}

// ---- counting

std::optional<ModeSearch::Count> ModeSearch::count(double line, std::vector<Complex>* where) const {
  const std::optional<long> all = exact_.apply()
                                      ? exact_.count(line, height_)
                                      : count_right(comm_, s_, line, height_, settings_.effort, where);
  if (!all) return std::nullopt;
  long known = 0;
  for (const Mode& m : modes_)
    if (m.value.real() > line && in_reach(m)) known += eigenvalues_of(m.value);
  return Count{*all, known};
}

std::optional<ModeSearch::Count> ModeSearch::count(const Line& line, std::vector<Complex>* where) const {
  std::optional<Count> found;
  for (const double part : {0., 0.5, -0.5, 1., -1.})  // an eigenvalue not known may stand on the line
    if (!found) found = count(line.at + part * line.slack, where);
  return found;
}

std::string ModeSearch::counted_text(const Count& c, double line) const {
  return fmt::format("{}: {} eigenvalues with real part above {:.6g} and |Im| below {:.6g}, {} expected",
                     exact_.apply() ? "exact dispersion relation" : "argument principle", c.all, line,
                     height_, c.known);
}

// Zeros that are no mode known, and would be among the wanted ones.
std::vector<Complex> ModeSearch::unknown(std::vector<Complex> zeros) const {
  std::vector<double> growth;
  for (const Mode& m : modes_)
    if (leads(m)) growth.push_back(m.value.real());
  std::sort(growth.rbegin(), growth.rend());
  const double least = growth.size() < wanted_ ? -std::numeric_limits<double>::infinity()
                                               : growth[wanted_ - 1] + 1e-9 * (own_ + height_);
  zeros.erase(std::remove_if(zeros.begin(), zeros.end(),
                             [&](Complex z) {
                               return z.real() < least ||
                                      std::any_of(modes_.begin(), modes_.end(), [&](const Mode& m) {
                                        return std::abs(m.value - z) <= nearness(s_, z);
                                      });
                             }),
              zeros.end());
  if (zeros.size() > wanted_) zeros.resize(wanted_);
  return zeros;
}

// ---- the list is whole

// Modes listed: as many as make `count` eigenvalues. modes_ is sorted, and what is out of reach is not
// listed.
std::size_t ModeSearch::listed() const { return shown_modes(s_, modes_, height_, settings_.count); }

// A line right of which the first so many modes stand and no other known one: in the gap before the next, or,
// where that has the same real part, just right of all that are equal.
ModeSearch::Line ModeSearch::list_line(std::size_t listed) const {
  std::vector<double> re;
  double tolerance_of_all = 0;
  for (const Mode& m : modes_)
    if (in_reach(m)) {
      re.push_back(m.value.real());
      if (re.size() <= listed) tolerance_of_all = std::max(tolerance_of_all, tolerance_(m));
    }
  const double apart = 8 * tolerance_of_all;
  if (listed < re.size() && re[listed - 1] - re[listed] > apart)
    return {(re[listed - 1] + re[listed]) / 2, (re[listed - 1] - re[listed]) / 4};
  if (listed == re.size() && (listed < 2 || re[listed - 2] - re[listed - 1] > apart)) {
    const double behind = std::max(apart, 1e-3 * (re[0] - re[listed - 1]));
    return {re[listed - 1] - behind, behind / 2};
  }
  std::size_t first = listed - 1;  // of those with this real part
  while (first > 0 && re[first - 1] - re[first] <= apart) --first;
  return {re[first] + 2 * apart, apart / 2};  // no further: what is not known may stand there
}

// The list has a hole: it is narrowed down to a gap between known real parts, and then in frequency. Whether
// anything new was found.
bool ModeSearch::look_between(std::size_t members) {
  std::size_t good = 0, bad = members;
  while (bad - good > 1) {
    const std::size_t middle = (good + bad) / 2;
    const auto c = count(list_line(middle));
    if (!c) break;
    (c->all == c->known ? good : bad) = middle;
  }
  const Line line = list_line(bad);
  std::vector<Complex> where;
  if (!count(line, &where)) return false;
  const std::size_t before = modes_.size();
  try_places(unknown(std::move(where)));
  if (modes_.size() > before || s_.size() > 4 * settings_.long_from) return modes_.size() > before;
  double low = 0, high = height_;
  for (int k = 0; k < 16; ++k) {
    std::optional<long> all;
    double middle = (low + high) / 2;
    for (const double part : {0.5, 0.45, 0.57, 0.4})  // off the eigenvalues
      if (!all) all = count_right(comm_, s_, line.at, middle = low + part * (high - low), settings_.effort);
    if (!all) break;
    long known = 0;
    for (const Mode& m : modes_)
      if (m.value.real() > line.at && m.value.imag() < middle) known += eigenvalues_of(m.value);
    (*all > known ? high : low) = middle;
  }
  const double aside = std::max(high - low, 0.1 * height_ / double(s_.size()));
  const PetscInt each = std::min<PetscInt>(s_.unknowns(), 8);
  try_shifts({Complex(line.at + aside, (low + high) / 2), Complex(line.at + 4 * aside, (low + high) / 2)},
             each);
  return modes_.size() > before;
}

bool ModeSearch::close_list(Spectrum& result) {
  int scans = 1;
  for (int round = 0; round < (many_ ? 5 : 20); ++round) {
    sort_modes(modes_, tolerance_(*rightmost()));
    const std::size_t members = listed();
    const Line line = list_line(members);
    std::vector<Complex> where;
    const auto c = count(line, &where);
    result.missing.reset();
    if (!c || c->all < c->known) return false;
    result.missing = c->all - c->known;
    result.completeness_check = counted_text(*c, line.at);
    if (c->all == c->known) return result.list_complete = result.complete = true;
    const std::size_t before = modes_.size();
    try_places(unknown(std::move(where)));
    if (modes_.size() > before) continue;
    if (exact_.apply()) return false;
    if (try_twins(members) || look_between(members)) continue;
    for (; modes_.size() == before && !many_ && scans < 5; ++scans) scan({}, line.at, scans);
    if (modes_.size() == before) return false;
  }
  return false;
}

// ---- the rightmost is certain

void ModeSearch::close_rightmost(Spectrum& result) {
  for (int round = 0;; ++round) {
    const Mode& best = *rightmost();
    const double growth = best.value.real(), line = growth + tolerance_(best);
    if (s_.symmetric() && !s_.has_state() && s_.real_bound() <= line) {
      result.complete = true;
      result.completeness_check =
          "no mode can exceed -1/2 of the least damping, which the rightmost one attains";
      return;
    }
    std::vector<Complex> where;
    double counted = line;
    auto c = count(line, &where);
    if (!c && many_) {
      // Beside strongly trapped modes round-off hides the phase: from further right it is seen, at the price
      // of a wider margin.
      double high = line + 2e-5 * (own_ + std::abs(growth));
      for (std::size_t i = 0; i < s_.size(); ++i) high = std::max(high, local_growth(s_, i, false));
      for (double aside = 1e-7 * (own_ + std::abs(growth)); !c && line + aside < high; aside *= 10)
        c = count(counted = line + aside, &where);
    }
    if (!c) {
      if (try_resolved()) continue;
      result.completeness_check = fmt::format(
          "not checked: counting the eigenvalues right of the line failed or would take too long at {} nodes",
          s_.size());
      return;
    }
    const auto judge = [&] {
      result.complete = c->all == c->known;
      margin_ = counted - line;
      result.completeness_check = counted_text(*c, counted);
    };
    judge();
    if (exact_.apply()) return;
    if (many_) {
      const std::size_t before = modes_.size();
      try_places(unknown(std::move(where)));
      if (modes_.size() > before && round < 5 && (!result.complete || rightmost()->value.real() > line))
        continue;
      // Trapped modes are ill-conditioned: to the count the rightmost itself may stand right of the line.
      for (double aside = 1e-6; !result.complete && aside < 1e-3; aside *= 10)
        if (const auto again = count(line + aside * (own_ + std::abs(growth)))) {
          c = again;
          counted = line + aside * (own_ + std::abs(growth));
          judge();
        }
      if (!result.complete && try_resolved()) continue;
      return;
    }
    if (result.complete || round >= 12) return;
    where.erase(std::remove_if(where.begin(), where.end(), [line](Complex z) { return z.real() < line; }),
                where.end());
    scan(std::move(where), line, round);
  }
}

std::vector<Mode> ModeSearch::run(Spectrum& result) {
  first_guesses();
  // Heavily damped media with a state have a crowd of real modes beside -r, in which no Krylov space settles.
  const PetscInt unknowns = s_.unknowns();
  if (!rightmost() && unknowns <= 2000) take(dense_modes(s_, unknowns));
  if (!rightmost()) try_places(first_shifts(s_, height_, settings_.count));
  if (!rightmost()) throw Failure("the eigenvalue solver found nothing");
  if (settings_.quick) {
    result.completeness_check = "not checked";
  } else if (!(settings_.whole_list && close_list(result))) {
    const std::string list = result.completeness_check;
    const bool whole = settings_.whole_list && result.missing;
    close_rightmost(result);
    if (whole) result.completeness_check += "; of the list: " + list;
  }
  sort_modes(modes_, tolerance_(*rightmost()));
  return std::move(modes_);
}

}  // namespace stickslip
