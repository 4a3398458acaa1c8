#include "model/right_hand_side.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

constexpr PetscInt tile_size = 256, margin = 8;  // margin: keeps psi[0] aligned

}  // namespace

struct RightHandSide::Tile {
  alignas(64) double psi_and_halo[tile_size + 2 * margin], eta[tile_size], state[tile_size];
  alignas(64) double coupling[tile_size], driving[tile_size] = {}, d2[tile_size];
  double* const psi = psi_and_halo + margin;
  PetscInt begin = 0, count = 0;
  double* f = nullptr;  // of its first node
};

// In this order everywhere, so that steps in tiles, of clusters and PETSc's are the same to the last bit.
void ViscousTerms::operator()(const PointwiseLoop& pointwise, const kernel::Coefficients& c,
                              kernel::Columns k, double* coupling, double* d2, double* driving,
                              bool linear) const {
#pragma GCC ivdep
  for (PetscInt i = 0; i < k.count; ++i) {
    d2[i] = coupling[i];
    const double force = !linear && k.direction && k.direction[i] == 0 ? 0 : N * d2[i];
    driving[i] = linear ? k.eta[i] + force : force;
    coupling[i] = 0;
  }
  k.eta = driving;
  k.coupling = coupling;
  pointwise(c, k);
  const PetscInt apart = !k.interleaved ? 1 : k.state ? 3 : 2;
  for (PetscInt i = 0; i < k.count; ++i) k.f_eta[i * apart] += K1 * d2[i];
}

RightHandSide::RightHandSide(const Scene& s, PetscInt first, PetscInt count)
    : dof_(s.friction.has_state() ? 3 : 2), half_width_(s.order / 2), massless_(s.massless()),
      K1_(s.mean_K1()), N_(s.N()), coefficients_(kernel::coefficients_with(s, N_ > 0 ? 1 : K1_)),
      to_columns_(kernel::copy_loop<true>(dof_)), stencil_(stencil_loop(s, links_along(s, first, count))),
      frictionless_(frictionless_loop(dof_, coefficients_along(s, first, count))) {
  const FrictionPlaces places = friction_places(s, first, count);
  sliding_ = loop_for<PointwiseLoop>(s.friction, false, places);
  if (s.friction.sticks()) sticking_ = loop_for<PointwiseLoop>(s.friction, true, places);
  if (massless_) coefficients_.A = 0;
}

// Calls body(tile) for one tile after the other, with its K1 D2 psi (or D2 psi), or 0.
template <class Body>
void RightHandSide::over_tiles(const InterleavedRange& r, bool coupled, const Body& body) const {
  Tile t;
  double* const columns[] = {t.psi, t.eta, t.state};
  if (!coupled) std::fill_n(t.coupling, tile_size, 0.);
  for (t.begin = 0; t.begin < r.count; t.begin += tile_size) {
    t.count = std::min(tile_size, r.count - t.begin);
    t.f = r.f + t.begin * dof_;
    to_columns_({const_cast<double*>(r.u + t.begin * dof_), columns, t.count});
    for (PetscInt j = 0; j < half_width_ && coupled; ++j) {
      const PetscInt left = t.begin - half_width_ + j, right = t.begin + t.count + j;
      t.psi[j - half_width_] = left < 0 ? r.before[left + half_width_] : r.u[left * dof_];
      t.psi[t.count + j] = right < r.count ? r.u[right * dof_] : r.behind[right - r.count];
    }
    if (coupled) stencil_(coefficients_, {t.psi, t.coupling, t.count, r.node + t.begin});
    body(t);
  }
}

void RightHandSide::take(Part part, double v, const InterleavedRange& r) const {
  const bool coupled = has_stencil(part), linear = has_linear(part), viscous = coupled && N_ > 0;
  const bool friction = has_friction(part) && !(massless_ && dof_ == 2);  // whose psi says it all
  const double* const direction = part == Part::wave || part == Part::reaction ? nullptr : r.direction;
  const PointwiseLoop& pointwise = !friction ? frictionless_ : direction ? sticking_ : sliding_;
  kernel::Coefficients c = coefficients_;
  c.v = v;
  if (!linear) c.B = c.K0 = c.linear = 0;
  over_tiles(r, coupled, [&](Tile& t) {
    const auto at = [&](const double* of_nodes) { return of_nodes ? of_nodes + t.begin : nullptr; };
    const double* const going = at(direction);
    const kernel::Columns columns{
        t.psi, linear ? t.eta : t.driving, dof_ == 3 ? t.state : nullptr, at(r.amplitude), t.coupling,
        t.f,   t.f + 1,                    t.f + 2, t.count, going, r.node + t.begin, true};
    if (viscous)
      ViscousTerms{N_, K1_}(pointwise, c, columns, t.coupling, t.d2, t.driving, linear);
    else
      pointwise(c, columns);
  });
}

void RightHandSide::viscous_force(const InterleavedRange& r) const {
  over_tiles(r, true, [&](Tile& t) {
    std::fill_n(t.f, t.count * dof_, 0.);
    for (PetscInt i = 0; i < t.count; ++i) t.f[i * dof_ + 1] = N_ * t.coupling[i];
  });
}

PsiHalo::PsiHalo(const Scene& scene, const NodeFetch::Layout& layout, PetscInt first)
    : dof_(layout.dof), half_width_(scene.order / 2), local_(layout.local) {
  std::vector<PetscInt> fetched;  // each once; they feed 2 half_width values
  const auto index_of = [&](PetscInt node) {
    const auto found = std::find(fetched.begin(), fetched.end(), node);
    if (found != fetched.end()) return static_cast<std::size_t>(found - fetched.begin());
    fetched.push_back(node);
    return fetched.size() - 1;
  };
  const auto add = [&](PetscInt node) {
    Value value;
    if (node >= 0 && node < scene.n) {
      value.emplace_back(index_of(node), 1.);
    } else {
      for (const auto& [inside, weight] : halo_node(scene, node))
        value.emplace_back(index_of(inside), weight);
    }
    halo_.push_back(value);
  };
  for (int j = -half_width_; j < 0; ++j) add(first + j);
  for (int j = 0; j < half_width_; ++j) add(first + local_ + j);
  fetch_.emplace(layout, 1, fetched);
}

namespace {

constexpr double lost = std::numeric_limits<double>::quiet_NaN();
constexpr double round_off = 8 * std::numeric_limits<double>::epsilon();  // what a law's formula may err by

}  // namespace

Partials MasslessNode::force(double psi, double state, double direction) const {
  const Partials p = direction != 0 ? law.sliding_partials(psi, state, direction) : law.partials(psi, state);
  return {amplitude * p.F, amplitude * p.F_psi, amplitude * p.F_state};
}

double MasslessNode::velocity(double eta, double state, double guess) const {
  if (amplitude == 0) return eta / B;
  if (law.steep) return steep_zero(eta, state, guess);
  if (!law.sticks) return zero(eta, state, guess, 0);
  const double limit = amplitude * law.threshold(state).value;
  if (eta <= limit && (eta >= -limit || !back_slip)) return 0;
  const double direction = eta > 0 ? 1 : -1;
  return zero(eta, state, direction * guess > 0 ? guess : 0, direction);
}

// Newton's method, inside a bracket once there is one. Beyond `good`, the last place where r rises, no other
// branch is taken: a step that leaves the branch is halved.
double MasslessNode::zero(double eta, double state, double guess, double direction) const {
  double good = guess, psi = guess, low = -HUGE_VAL, high = HUGE_VAL;
  for (int round = 0; round < 200; ++round) {
    const Partials p = force(psi, state, direction);
    const double own = B * psi, r = own + p.F - eta, slope = B + p.F_psi;
    if (!(slope > 0) || !std::isfinite(r)) {
      if (psi == good || std::abs(psi - good) <= round_off * std::abs(good)) return lost;
      psi = good + (psi - good) / 2;
      continue;
    }
    good = psi;
    (r < 0 ? low : high) = psi;
    double next = psi - r / slope;
    if (!(next > low && next < high))
      next = low > -HUGE_VAL && high < HUGE_VAL ? low + (high - low) / 2 : next;
    const bool done = std::abs(r) <= round_off * (std::abs(own) + std::abs(p.F) + std::abs(eta)) ||
                      std::abs(next - psi) <= round_off * std::abs(psi);
    if (done) return rises_between(guess, psi, state, direction) ? psi : lost;
    psi = next;
  }
  return lost;
}

// In y = ln |psi| the law is a line, or convex where it bends at rest, and B psi convex; in psi itself B psi
// is a line and the law concave. So Newton's step in y ends at or above the zero and that in psi at or below
// it; of what lies between them the next place is the one where B psi weighs as much as the law, since
// either step is good on its own side of it.
double MasslessNode::steep_zero(double eta, double state, double guess) const {
  constexpr double least = std::numeric_limits<double>::min(), most = 1e300;
  const auto excess = [&](double psi) { return B * psi + force(psi, state, 0).F - eta; };
  if (!std::isfinite(eta) || !std::isfinite(state)) return lost;
  const bool forwards = excess(least) < 0, backwards = excess(-least) > 0;
  // a law for psi > 0 alone is no number at -least, and never comes to rest
  if (!forwards && !backwards) return std::isnan(excess(-least)) ? least : 0;
  const double side = forwards ? 1 : -1;
  double low = least, high = HUGE_VAL, psi = std::clamp(side * guess, least, most);
  for (int round = 0; round < 200; ++round) {
    const Partials p = force(side * psi, state, 0);
    const double own = B * psi, F = side * p.F, r = own + F - side * eta, slope = B + p.F_psi;
    if (std::isnan(r)) return lost;
    if (std::abs(r) <= round_off * (own + std::abs(F) + std::abs(eta))) return side * psi;
    (r < 0 ? low : high) = psi;
    const double below = psi - r / slope, above = psi * std::exp(std::min(-r / (slope * psi), 700.));
    const double balance = psi * p.F_psi / B;  // infinite without B: then all is the law's
    double next = std::min(std::max(below, balance), above);
    if (!(next > low && next < high)) next = std::sqrt(low) * std::sqrt(std::min(high, most));
    if (std::abs(next - psi) <= round_off * psi || high <= low * (1 + round_off)) return side * psi;
    if (low >= most / 2) return lost;
    psi = next;
  }
  return lost;
}

bool MasslessNode::rises_between(double from, double to, double state, double direction) const {
  const double low = std::min(from, to), high = std::max(from, to);
  if (high - low <= 0.25 * std::min(std::abs(low), std::abs(high))) return true;
  const auto rises = [&](double psi) { return B + force(psi, state, direction).F_psi > 0; };
  if (low < 0 && high > 0 && !rises(0)) return false;
  // outwards on either side of 0, from where psi is small against the whole
  const double least = 1e-12 * (high - low);
  for (const double side : {-1., 1.}) {
    const double inner = std::max({side > 0 ? low : -high, 0., least}), outer = side > 0 ? high : -low;
    for (double psi = inner; psi < outer; psi *= 1.25)
      if (!rises(side * psi)) return false;
  }
  return true;
}

MasslessNode::Slopes MasslessNode::slopes(double psi, double state) const {
  if (amplitude == 0) return {1 / B, 0};
  if (law.sticks && psi == 0) return {0, 0};
  const Partials p = force(psi, state, law.sticks ? (psi > 0 ? 1 : -1) : 0);
  const double slope = B + p.F_psi;
  return {1 / slope, -p.F_state / slope};
}

std::string jump_at_rest(const MasslessNode& node) {
  if (!node.law.sticks || node.amplitude == 0) return "";
  const double state = 1;  // a factor of both forces
  const Partials p = node.law.sliding_partials(0, state, 1);
  const double threshold = node.law.threshold(state).value;
  if (threshold - p.F > 1e-12 * threshold)
    return "friction falls from its threshold to " + rounded_text(p.F / threshold, 6) +
           " of it as a block begins to slip, and its velocity would jump";
  // with a state it shows when the motion comes there
  if (!node.law.has_state && !(node.B + node.amplitude * p.F_psi > 0))
    return fmt::format(
        "as a block begins to slip friction falls with velocity at least as fast as the resistance zeta/f0 = "
        "{:.6g} can balance (slope {:.6g}), and its velocity would jump",
        node.B, node.amplitude * p.F_psi);
  return "";
}

MasslessChain::MasslessChain(MPI_Comm comm, const Scene& scene, const Frictions& law,
                             const std::vector<double>& amplitude, PetscInt first)
    : comm_(comm), scene_(scene), law_(law), amplitude_(amplitude), first_(first),
      local_(PetscInt(amplitude.size())), dof_(scene.friction.has_state() ? 3 : 2),
      velocity_(scales_of(scene).velocity) {
  check();
}

bool MasslessChain::held(PetscInt i) const { return scene_.held(first_ + i); }

void MasslessChain::check() const {
  std::string why;
  for (PetscInt i = 0; i < local_ && why.empty(); ++i)
    if (!held(i)) why = jump_at_rest(node(i));
  int jumps = why.empty() ? 0 : 1;
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &jumps, 1, MPI_INT, MPI_MAX, comm_));
  if (!jumps) return;
  if (why.empty()) why = "the velocity of a block would jump as it begins to slip";  // of another rank
  throw UsageError("-model_m 0: " + why + ", which takes no time without mass; take model_m > 0");
}

void MasslessChain::solve_velocities(Vec u) const {
  const Writing a(u);
  lost_at_ = -1;
  for (PetscInt i = 0; i < local_; ++i) {
    if (held(i)) continue;
    double* const at = a + i * dof_;
    const double psi = node(i).velocity(at[1], dof_ == 3 ? at[2] : 0, at[0]);
    if (std::isnan(psi) && lost_at_ < 0) {
      lost_at_ = scene_.x(first_ + i);
      lost_from_ = at[0];
      lost_is_overflow_ = node(i).law.steep;
    }
    at[0] = psi;
  }
}

// At the end of a branch psi moves like the square root of the force that is left, and steps shrink to
// nothing.
void MasslessChain::find_edge(Vec u) const {
  constexpr double close = 1e-3;  // of the slopes that cancel
  const Reading a(u);
  for (PetscInt i = 0; i < local_ && lost_at_ < 0; ++i) {
    const double* const at = a + i * dof_;
    if (held(i) || !std::isfinite(at[0])) continue;
    const double slope = 1 / node(i).slopes(at[0], dof_ == 3 ? at[2] : 0).by_eta, B = scene_.B();
    if (!(slope < close * (B + std::abs(slope - B)))) continue;
    lost_at_ = scene_.x(first_ + i);
    lost_from_ = at[0];
    lost_is_overflow_ = false;
  }
}

std::string MasslessChain::velocity_jump(Vec u) const {
  if (lost_at_ < 0) find_edge(u);
  struct {
    double at;
    int rank;
  } largest{lost_at_, 0};
  double lost[3] = {lost_at_, lost_from_, double(lost_is_overflow_)};
  SS_TRY(MPI_Comm_rank(comm_, &largest.rank));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE_INT, MPI_MAXLOC, comm_));
  SS_TRY(MPI_Bcast(lost, 3, MPI_DOUBLE, largest.rank, comm_));
  if (lost[0] < 0) return runaway(u);
  if (lost[2] != 0)  // friction that is steep at rest rises with psi, so that there is a velocity
    return fmt::format(
        "the block at x = {:.6g} runs away from psi = {:.6g}: the velocity that goes with its force is "
        "beyond all numbers, and without mass or viscosity nothing holds it back; take model_zeta > 0, or "
        "model_m > 0",
        lost[0], lost[1]);
  return fmt::format(
      "the force on the block at x = {:.6g} does not say what psi is: from psi = {:.6g} on friction falls "
      "faster than zeta psi rises (zeta/f0 + F_psi <= 0), and without mass psi would jump; take model_m > 0",
      lost[0], lost[1]);
}

// Without zeta nothing bounds psi: where friction falls for good a block goes ever faster within a finite
// time.
std::string MasslessChain::runaway(Vec u) const {
  if (scene_.B() > 0) return "";
  constexpr double far = 1e6;
  const Reading a(u);
  double fastest = 0;
  for (PetscInt i = 0; i < local_; ++i) fastest = std::max(fastest, std::abs(a[i * dof_]));
  fastest = largest_over(comm_, fastest);
  if (!(fastest > far * velocity_)) return "";
  return fmt::format(
      "a block runs away, at psi = {:.3g} by now: without mass or viscosity nothing holds it back; take "
      "model_zeta > 0, or model_m > 0",
      fastest);
}

// psi_j acts on eta of its neighbours, and follows from its own eta and state: what it does stands in their
// columns, times dpsi/deta and dpsi/dstate.
void MasslessChain::jacobian(Vec u, double alpha, double beta, Mat J) const {
  VecHandle columns;
  SS_TRY(VecDuplicate(u, columns.out()));
  const Reading a(u);
  {
    const Writing c(columns);
    for (PetscInt i = 0; i < local_; ++i) {
      const double* const at = a + i * dof_;
      MasslessNode::Slopes s{0, 0};
      if (!held(i)) s = node(i).slopes(at[0], dof_ == 3 ? at[2] : 0);
      double* const factor = c + i * dof_;
      factor[0] = 0;
      factor[1] = s.by_eta;
      if (dof_ == 3) factor[2] = s.by_state;
    }
  }
  SS_TRY(MatZeroEntries(J));
  if (beta != 0) add_coupling(beta, columns, J);
  add_own(a, Reading(columns), alpha, beta, J);
}

// factor (K1 D2 - K0) in the columns of eta and of the state alike, times the slopes.
void MasslessChain::add_coupling(double factor, Vec slopes, Mat J) const {
  std::vector<double> block(dof_ * dof_);
  for (PetscInt i = 0; i < local_; ++i) {
    const PetscInt row = first_ + i;
    Combination terms = second_difference_row(scene_, row);
    for (auto& term : terms) term.second *= scene_.K1();
    terms.emplace_back(row, -scene_.K0());
    for (const auto& [column, value] : terms) {
      for (int d = 1; d < dof_; ++d) block[dof_ + d] = factor * value;
      SS_TRY(MatSetValuesBlocked(J, 1, &row, 1, &column, block.data(), ADD_VALUES));
    }
  }
  SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatDiagonalScale(J, nullptr, slopes));
}

// alpha I, and beta d(rate of the state) by eta and the state.
void MasslessChain::add_own(const double* u, const double* slopes, double alpha, double beta, Mat J) const {
  std::vector<double> block(dof_ * dof_);
  for (PetscInt i = 0; i < local_; ++i) {
    const PetscInt row = first_ + i;
    for (int d = 0; d < dof_; ++d) block[d * dof_ + d] = alpha;
    if (dof_ == 3) {
      const double *at = u + i * dof_, *by = slopes + i * dof_;
      const RatePartials g = law_[i].rate_partials(at[0], at[2]);
      block[7] = beta * g.g_psi * by[1];
      block[8] = alpha + beta * (g.g_state + g.g_psi * by[2]);
    }
    SS_TRY(MatSetValuesBlocked(J, 1, &row, 1, &row, block.data(), ADD_VALUES));
  }
  SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
}

void log_flops(const Model& model, long evaluations) {
  const double stencil = 1.5 * model.scene().order + 1;
  const double node = stencil + (model.viscous() ? stencil + 1 : 0) + 9 + 10 + (model.dof() == 3 ? 10 : 0);
  (void)PetscLogFlops(double(evaluations) * double(model.local()) * node);
}

}  // namespace stickslip
