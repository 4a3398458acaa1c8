#include "time/band.hpp"

#include <algorithm>
#include <cmath>

#include "model/right_hand_side.hpp"
#include "numerics/elementary.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/vectors.hpp"

namespace stickslip {

namespace {
constexpr int most_rounds = 12;  // of Newton's method; three times as many where a step cannot be shorter
}  // namespace

bool BandedImex::takes(const StageProgram& method) {
  for (int i = 1; i < method.stages; ++i)
    if (!(method.At[i * method.stages + i] > 1e-14)) return false;
  return true;
}

BandedImex::BandedImex(const Model& model, StageProgram method, Implicit implicit, bool sticking)
    : model_(model), method_(std::move(method)), implicit_(implicit), layout_(model),
      columns_(layout_, method_, implicit), system_(BandSystem::make(layout_)),
      coefficients_(kernel::coefficients_with(model.scene(), 1)), stencil_(stencil_loop(model.scene())),
      wave_(kernel::compiled<decltype(wave_)>(kernel::WaveRound{})),
      right_sides_(kernel::compiled<decltype(right_sides_)>(kernel::RightSides{})) {
  const Scene& scene = model.scene();
  if (std::abs(method_.At[0]) < 1e-14) method_.At[0] = 0;
  d2_row_ = 0;
  for (int k = 0; k <= scene.order / 2; ++k) d2_row_ += (k == 0 ? 1 : 2) * std::abs(coefficients_.w[k]);
  std::vector<PetscInt> nodes;
  for (const BandTile& t : layout_.tiles())
    for (PetscInt i = 0; i < t.count(); ++i) nodes.push_back(layout_.wrapped(t.begin + i));
  FrictionPlaces places =
      friction_places(scene, PetscInt(nodes.size()), [&](PetscInt i) { return nodes[std::size_t(i)]; });
  if (scene.laws_differ()) places = by_tiles(places);
  if (!scene.unit_amplitude()) {
    for (const PetscInt node : nodes) amplitude_.push_back(friction_amplitude(scene, node, 1)[0]);
    amplitude_ = by_tiles(amplitude_);
  }
  if (sticking) direction_.assign(layout_.size(), 0.);
  pointwise_ = loop_for<PointwiseLoop>(scene.friction, sticking, places);
  if (implicit == Implicit::both) newton_ = loop_for<NewtonLoop>(scene.friction, sticking, places);
  PetscInt longest = 0;
  for (const BandTile& t : layout_.tiles()) {
    longest = std::max(longest, t.count());
    end_rows_.emplace_back();
    for (int i = 0; i < t.rows && t.group < 0 && !scene.ring(); ++i)
      end_rows_.back().push_back(second_difference_row(scene, t.begin + i));
  }
  if (implicit == Implicit::both && !method_.embedded.empty()) slaves_ = SlaveErrors(scene, places);
  for (std::vector<double>* of_tile : {&d_, &b_, &x_, &spare_, &zeros_, &new_[0], &new_[1], &new_[2],
                                       &of_new_[0], &of_new_[1], &of_new_[2]})
    of_tile->assign(longest + 2 * (scene.order / 2) + kernel::lanes, 0.);
}

// Values of the nodes of all tiles, one after the other, in the order of columns.
template <class T>
std::vector<T> BandedImex::by_tiles(const std::vector<T>& of_nodes) const {
  std::vector<T> sorted(layout_.size());
  std::size_t from = 0;
  for (const BandTile& t : layout_.tiles())
    for (PetscInt i = 0; i < t.count(); ++i) sorted[t.at + t.place(i)] = of_nodes[from++];
  return sorted;
}

void BandedImex::set_direction(const std::vector<double>& direction) {
  std::vector<double> going(std::size_t(model_.local() * model_.dof()));
  for (PetscInt i = 0; i < model_.local(); ++i) going[std::size_t(i * model_.dof())] = direction[i];
  layout_.fetch(going.data());
  for (const BandTile& t : layout_.tiles()) layout_.load(t, going.data(), 0, &direction_[t.at]);
}

// ---- a step

StepTaker::Outcome BandedImex::take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                                    const std::vector<VecHandle>& slopes, Vec, double begin) const {
  const Step step{dt, begin, norm, estimate};
  load(u, step);
  bool solved = true, begun = false;
  for (int i = method_.At[0] == 0 ? 1 : 0; i < method_.stages && solved; ++i) {
    if (implicit_ == Implicit::wave) {
      solved = linear_stage(i, begun, step);
      begun = i + 1 < method_.stages && diagonal(i + 1) == diagonal(i);
    } else {
      solved = newton_stage(i, step);
    }
  }
  model_.count_evaluations(2L * method_.stages);
  log_flops(model_, 2L * method_.stages);
  if (!solved) return {true, -1, false};
  StepErrors::Sums sums;
  const Writing b(u_new);
  for (const BandTile& t : layout_.tiles()) finish(t, step, b, sums);
  store_slopes(slopes);
  return StepErrors::over_ranks(model_.comm(), sums, norm, estimate, double(model_.scene().n) * model_.dof());
}

kernel::Coefficients BandedImex::at_stage(const Step& step, int i) const {
  kernel::Coefficients c = coefficients_;
  c.v = model_.plate_velocity(step.begin + method_.time(i) * step.dt);
  return c;
}

kernel::BandStage BandedImex::stage_of(const Step& step, int i) const {
  const Scene& s = model_.scene();
  return kernel::band_stage(at_stage(step, i), s.K1(), s.N(), d2_row_, step.dt * diagonal(i));
}

// What the change of psi is counted from.
const double* BandedImex::from(const BandTile& t) const {
  return from_start_ ? columns_.u(t, 0) : zeros_.data();
}

kernel::Round BandedImex::round_of(const BandTile& t, const Step& step, int i) const {
  const auto slope = [&](int d) { return columns_.slope(t, ImexColumns::of_implicit, i, d); };
  const bool has_state = model_.dof() == 3;
  kernel::Round r{};
  r.stage = stage_of(step, i);
  r.from = from(t);
  r.d2_from = from_start_ ? columns_.d2(t) : zeros_.data();
  r.z_psi = columns_.known(t, 0);
  r.z_eta = columns_.known(t, 1);
  r.z_state = has_state ? columns_.known(t, 2) : nullptr;
  r.amplitude = of_tile(amplitude_, t);
  r.direction = of_tile(direction_, t);
  r.psi = columns_.stage(t, 0);
  r.change = implicit_ == Implicit::both ? columns_.change(t) : nullptr;
  r.R = columns_.right_side(t);
  r.state = has_state ? columns_.stage(t, 2) : nullptr;
  r.d = d_.data();
  r.b = b_.data();
  r.x = x_.data();
  r.g_psi = slope(0);
  r.g_eta = slope(1);
  r.g_state = has_state ? slope(2) : nullptr;
  // fixed steps have no tolerance: what they err by is all theirs
  r.target = step.estimate ? step.norm.tolerances.solver_target() : Tolerances::least_target;
  r.scales = step.norm.tolerances.scales;
  r.immovable = BandSystem::immovable;
  r.count = t.count();
  r.node = t.at;
  return r;
}

// u into its columns; with an explicit first stage its slopes too.
void BandedImex::load(Vec u, const Step& step) const {
  const Reading own(u);
  layout_.fetch(own);
  for (const BandTile& t : layout_.tiles()) {
    for (int d = 0; d < model_.dof(); ++d) {
      layout_.load(t, own, d, columns_.u(t, d));
      if (d != 1) std::copy(columns_.u(t, d), columns_.u(t, d) + t.count(), columns_.stage(t, d));
    }
    if (implicit_ == Implicit::both) std::fill_n(columns_.change(t), t.count(), 0.);
    second_difference(t, own, columns_.d2(t));
    if (method_.At[0] == 0) take_first(t, step);
  }
}

// D2 psi of u.
void BandedImex::second_difference(const BandTile& t, const double* own, double* d2) const {
  const PetscInt hw = model_.scene().order / 2, count = t.count(), first = layout_.local(t);
  double *const psi = spare_.data() + hw, *const line = x_.data();
  const auto& rows = end_rows_[&t - layout_.tiles().data()];
  if (rows.empty()) {
    layout_.read(own, 0, first - hw, count + 2 * hw, psi - hw);
    stencil_(coefficients_, {psi, line, count});
  } else {
    const PetscInt low = std::max(t.begin - hw, PetscInt(0)),
                   high = std::min(t.begin + count + hw, model_.scene().n);
    layout_.read(own, 0, low - model_.first(), high - low, spare_.data());
    for (PetscInt i = 0; i < count; ++i) {
      line[i] = 0;
      for (const auto& [node, weight] : rows[i]) line[i] += weight * spare_[node - low];
    }
  }
  for (PetscInt i = 0; i < count; ++i) d2[t.lanes == 1 ? i : t.place(i)] = line[i];
}

// The slopes of a first stage that is explicit, at u.
void BandedImex::take_first(const BandTile& t, const Step& step) const {
  const kernel::Coefficients c = at_stage(step, 0);
  const double K1 = model_.scene().K1(), N = model_.scene().N();
  const double *const psi = columns_.u(t, 0), *const eta = columns_.u(t, 1), *const d2 = columns_.d2(t);
  const auto slope = [&](int d) { return columns_.slope(t, ImexColumns::of_implicit, 0, d); };
  double *const g_psi = slope(0), *const g_eta = slope(1);
  if (implicit_ == Implicit::wave) {
    for (PetscInt i = 0; i < t.count(); ++i) {
      const double driving = eta[i] + N * d2[i];
      g_psi[i] = c.A * (driving - c.B * psi[i]);
      g_eta[i] = c.K0 * (c.v - psi[i]) + K1 * d2[i] - c.s_delta * driving;
    }
  } else {
    std::copy(d2, d2 + t.count(), g_eta);
    ViscousTerms{N, K1}(pointwise_, c,
                        {psi, eta, model_.dof() == 3 ? columns_.u(t, 2) : nullptr, of_tile(amplitude_, t),
                         g_eta, g_psi, g_eta, slope(2), t.count(), of_tile(direction_, t), t.at},
                        g_eta, x_.data(), b_.data());
  }
  for_held(t, [&](PetscInt i, const Combination&) { stickslip::hold(model_.scene(), g_psi[i], g_eta[i]); });
  if (implicit_ == Implicit::wave) take_explicit(t, 0);
}

// The explicit slopes of stage i with the wave implicit: those of friction, -A F, s delta F and g.
void BandedImex::take_explicit(const BandTile& t, int i) const {
  const auto slope = [&](int d) { return columns_.slope(t, ImexColumns::of_explicit, i, d); };
  const kernel::Coefficients friction{coefficients_.A, 0, 0, 0, coefficients_.s_delta, {}};
  double* const f_eta = spare_.data();  // it follows from that of psi
  std::fill(f_eta, f_eta + t.count(), 0.);
  pointwise_(friction,
             {columns_.stage(t, 0), zeros_.data(), model_.dof() == 3 ? columns_.stage(t, 2) : nullptr,
              of_tile(amplitude_, t), f_eta, slope(0), f_eta, slope(2), t.count(), nullptr, t.at});
  for_held(t, [&](PetscInt place, const Combination&) { slope(0)[place] = 0; });
}

template <class Body>
void BandedImex::for_held(const BandTile& t, const Body& body) const {
  if (t.group >= 0) return;
  const auto& rows = end_rows_[&t - layout_.tiles().data()];
  for (PetscInt i = 0; i < t.count() && !rows.empty(); ++i)
    if (model_.held(t.begin + i)) body(i, rows[i]);
}

// What stage i means at held nodes, where psi stands.
void BandedImex::hold(const BandTile& t, int i, const Step& step) const {
  for_held(t, [&](PetscInt place, const Combination& row) {
    double *const psi = columns_.stage(t, 0), *const g_eta =
                                                  columns_.slope(t, ImexColumns::of_implicit, i, 1);
    psi[place] = from(t)[place] + columns_.known(t, 0)[place];
    columns_.slope(t, ImexColumns::of_implicit, i, 0)[place] = 0;
    g_eta[place] = 0;
    if (model_.scene().form == Form::continuum) return;
    const kernel::Coefficients c = at_stage(step, i);
    double d2 = 0;
    for (const auto& [node, weight] : row) d2 += weight * psi[node - t.begin];
    g_eta[place] = c.K0 * (c.v - psi[place]) + model_.scene().K1() * d2;
  });
}

// ---- the wave implicit

void BandedImex::forward(std::size_t tile, int i, const Step& step) const {
  const BandTile& t = layout_.tiles()[tile];
  double* const R = columns_.right_side(t);
  columns_.sum_known(t, i, step.dt);
  right_sides_(round_of(t, step, i), R);
  for_held(t, [&](PetscInt place, const Combination&) { R[place] = columns_.known(t, 0)[place]; });
  system_->forward(tile, nullptr, R);
}

// `begun`: it has its right-hand sides, and what they mean to the separators.
bool BandedImex::linear_stage(int i, bool begun, const Step& step) const {
  const kernel::Coefficients c = at_stage(step, i);
  const kernel::BandStage stage = stage_of(step, i);
  const auto& tiles = layout_.tiles();
  bool positive = system_->choose(stage.a, stage.p, false);
  for (std::size_t k = 0; k < tiles.size() && !begun; ++k) forward(k, i, step);
  positive = system_->couple() && positive;
  const bool goes_on = i + 1 < method_.stages && diagonal(i + 1) == diagonal(i);
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    const BandTile& t = tiles[k];
    const kernel::Round round = round_of(t, step, i);
    system_->backward(k, nullptr, round.R, columns_.stage(t, 0));
    wave_(c, round);
    if (model_.dof() == 3) std::copy(round.z_state, round.z_state + t.count(), columns_.stage(t, 2));
    hold(t, i, step);
    take_explicit(t, i);
    if (goes_on) forward(k, i + 1, step);
  }
  return positive;
}

// ---- everything implicit

// psi goes on as the stage before did, unless that leads far.
void BandedImex::guess(const BandTile& t, int i, const Step& step) const {
  if (i == 0) return;
  double *const psi = columns_.stage(t, 0), *const change = columns_.change(t);
  const double *const z = columns_.known(t, 0), *const slope =
                                                    columns_.slope(t, ImexColumns::of_implicit, i - 1, 0);
  const double *const u = columns_.u(t, 0), h = step.dt * diagonal(i);
  for (PetscInt k = 0; k < t.count(); ++k) {
    const double next = z[k] + h * slope[k];
    const bool near = std::abs(u[k] + next - psi[k]) < 0.25 * std::abs(psi[k]);
    change[k] = near ? next : psi[k] - u[k];
    psi[k] = near ? u[k] + next : psi[k];
  }
  for_held(t, [&](PetscInt place, const Combination&) {
    change[place] = z[place];
    psi[place] = u[place] + z[place];
  });
}

void BandedImex::linearise(const BandTile& t, const kernel::Round& round) const {
  (void)newton_(coefficients_, round, false);
  for_held(t, [&](PetscInt place, const Combination&) { b_[place] = round.z_psi[place]; });
}

bool BandedImex::newton_stage(int i, const Step& step) const {
  from_start_ = true;
  for (const BandTile& t : layout_.tiles()) {
    columns_.sum_known(t, i, step.dt);
    guess(t, i, step);
  }
  if (const Newton found = newton(i, step); found != Newton::lost_digits) return found == Newton::solved;
  // once more, for psi itself
  from_start_ = false;
  for (const BandTile& t : layout_.tiles()) {
    double* const z = columns_.known(t, 0);
    const double *const u = columns_.u(t, 0), *const psi = columns_.stage(t, 0);
    for (PetscInt k = 0; k < t.count(); ++k) z[k] += u[k];
    std::copy(psi, psi + t.count(), columns_.change(t));
  }
  return newton(i, step) == Newton::solved;
}

BandedImex::Newton BandedImex::newton(int i, const Step& step) const {
  const kernel::Coefficients c = at_stage(step, i);
  const auto& tiles = layout_.tiles();
  const kernel::BandStage stage = stage_of(step, i);
  const int rounds = step.estimate ? most_rounds : 3 * most_rounds;
  for (const BandTile& t : tiles) right_sides_(round_of(t, step, i), columns_.right_side(t));
  for (int round = 0; round < rounds; ++round) {
    system_->choose(stage.a, stage.p, true);
    for (std::size_t k = 0; k < tiles.size(); ++k) {
      linearise(tiles[k], round_of(tiles[k], step, i));
      system_->forward(k, d_.data(), b_.data());
    }
    const bool positive = system_->couple();
    if (step.estimate && !positive) return Newton::failed;
    int left = 0;
    for (std::size_t k = 0; k < tiles.size(); ++k) {
      const kernel::Round own = round_of(tiles[k], step, i);
      linearise(tiles[k], own);
      system_->backward(k, d_.data(), b_.data(), x_.data());
      left |= int(newton_(c, own, true));
      hold(tiles[k], i, step);
    }
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &left, 1, MPI_INT, MPI_BOR, model_.comm()));
    if (left & 2) return Newton::failed;
    if (left & 4) return Newton::lost_digits;
    if (left == 0) return Newton::solved;
  }
  return Newton::failed;
}

// ---- its end

void BandedImex::finish(const BandTile& t, const Step& step, double* u_new, StepErrors::Sums& sums) const {
  const int dof = model_.dof();
  for (int d = 0; d < dof; ++d) {
    columns_.sum_solution(t, d, step.dt, new_[d].data());
    layout_.store(t, new_[d].data(), d, u_new);
    if (step.estimate) columns_.sum_error(t, d, step.dt, of_new_[d].data());
  }
  if (step.estimate && slaves_.any()) {
    const NodeCoefficients same{coefficients_.A, coefficients_.B, coefficients_.K0, coefficients_.s_delta};
    slaves_({new_[0].data(), new_[2].data(), of_tile(amplitude_, t), of_new_[0].data(),
             of_new_[1].data(), of_new_[2].data(), step.dt * diagonal(method_.stages - 1), t.count(), t.at},
            [&](PetscInt) { return same; });
    for_held(t, [&](PetscInt place, const Combination&) { of_new_[0][place] = 0; });
  }
  for (int d = 0; d < dof; ++d) measure(t, d, step, sums);
}

// Of the new values of an unknown and their errors those that this rank owns.
void BandedImex::measure(const BandTile& t, int unknown, const Step& step, StepErrors::Sums& sums) const {
  PetscInt begin, end;
  layout_.own_range(t, begin, end);
  const PetscInt count = end - begin;
  const double *u = new_[unknown].data(), *e = of_new_[unknown].data();
  if (count < t.count()) {
    for (PetscInt i = 0; i < count; ++i) {
      const PetscInt place = t.lanes == 1 ? begin + i : t.place(begin + i);
      d_[i] = u[place];
      spare_[i] = e[place];
    }
    u = d_.data();
    e = spare_.data();
  }
  errors_.add(unknown, u, e, count, step.norm, step.estimate, sums);
}

void BandedImex::store_slopes(const std::vector<VecHandle>& slopes) const {
  for (std::size_t k = 0; k < slopes.size(); ++k) {
    const Writing a(slopes[k]);
    for (const BandTile& t : layout_.tiles())
      for (int d = 0; d < model_.dof(); ++d) {
        const auto kind = k % 2 == 0 ? ImexColumns::of_implicit : ImexColumns::of_explicit;
        const double* from = columns_.slope(t, kind, int(k / 2), d);
        if (kind == ImexColumns::of_explicit && d == 1 && implicit_ == Implicit::wave) {
          const double* const of_psi = columns_.slope(t, kind, int(k / 2), 0);
          for (PetscInt i = 0; i < t.count(); ++i) x_[i] = columns_.explicit_eta() * of_psi[i];
          from = x_.data();
        }
        layout_.store(t, from ? from : zeros_.data(), d, a);
      }
  }
}

}  // namespace stickslip
