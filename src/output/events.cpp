#include "stickslip/output/events.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <stdexcept>

#include "model/loops.hpp"
#include "model/moved_nodes.hpp"
#include "output/catalogue.hpp"
#include "output/field_watch.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

constexpr std::size_t side_by_side = 128;  // nodes that vector code takes at a time
constexpr std::size_t few = 4;             // for fewer it does not pay
constexpr int most_ids = 1 << 30;          // from here on events under way are numbered anew
constexpr int layout = 3;                  // of what a checkpoint holds of events

using Fields = std::vector<std::vector<double>>;

// The normal load at the beginning, in the middle and at the end of a step, for observers: a step lies in one
// piece of the load, and where one ends and the next begins N may jump.
struct NormalInStep {
  std::array<double, 3> N{1, 1, 1};
  std::array<double, 2> log_rate{0, 0};  // N'/N at the beginning and at the end

  // From t to t + dt, behind a step that ended at t. By how much ln N has jumped at t.
  double begin_step(const Load& normal, double t, double dt) {
    if (!normal.varies()) return 0;
    const int piece = normal.piece_from(t);
    const double before = N[2];
    N = {normal.in_piece(piece, t), normal.in_piece(piece, t + dt / 2), normal.in_piece(piece, t + dt)};
    log_rate = {normal.slope_in_piece(piece, t) / N[0], normal.slope_in_piece(piece, t + dt) / N[2]};
    return N[0] == before ? 0 : std::log(N[0] / before);
  }
  // At the end of a step that ends at t.
  void end_at(const Load& normal, double t) {
    if (normal.varies()) N.fill(normal.before(t));
  }
};

// Of all ranks, in order of place; those that go on across a border between two ranks are one.
std::vector<SlipRegion> of_all_ranks(const std::vector<SlipRegion>& own, MPI_Comm comm, int ranks) {
  if (ranks == 1) return own;
  std::vector<int> counts(ranks), begins(counts.size(), 0);
  const int numbers = 2 * static_cast<int>(own.size());
  MPI_Allgather(&numbers, 1, MPI_INT, counts.data(), 1, MPI_INT, comm);
  for (std::size_t k = 1; k < counts.size(); ++k) begins[k] = begins[k - 1] + counts[k - 1];
  std::vector<SlipRegion> all(static_cast<std::size_t>(begins.back() + counts.back()) / 2), joined;
  if (all.empty()) return all;
  MPI_Allgatherv(own.data(), numbers, MPIU_INT, all.data(), counts.data(), begins.data(), MPIU_INT, comm);
  for (const SlipRegion& s : all) {
    if (!joined.empty() && joined.back().last + 1 == s.first)
      joined.back().last = s.last;
    else
      joined.push_back(s);
  }
  return joined;
}

}  // namespace

struct Events::Impl {
  Scene scene;
  NodeRange nodes;
  PetscInt first;
  std::size_t n;  // nodes of this rank, from `first` on
  int ranks;
  double velocity;
  std::vector<NodeCoefficients> coefficients;  // of the nodes; one where all have the same
  std::vector<double> amplitude;
  Frictions friction;
  ForceLoop forces;  // of nodes side by side
  NodeHalo halo;
  // Where neighbours have viscosity: rows of N D2; N D2 psi at the beginning, in the middle and at the end of
  // a step.
  std::vector<Combination> d2;
  std::array<std::vector<double>, 3> viscous;
  Regions regions;
  bool with_ruptures, started = false;
  double t = 0;
  Fields last, now;
  const double* middle_of_step = nullptr;  // where it is given: the unknowns in the middle
  std::vector<int> owner;            // event under way in whose region a node is; -1: none
  std::vector<double> slip;          // of a node in a region: in this event
  std::vector<double> slipped;       // of any node: in all events so far
  std::vector<double> slipped_then;  // the same at the beginning of the step under way
  std::vector<double> last_force;    // friction at the end of the last step of nodes that moved in it
  std::vector<double> rupture;       // where asked for: when a node in a region first slipped in this event
  std::vector<unsigned char> moving, moved;  // whether a node does in the step under way, and did in the last
  NormalInStep normal;
  std::vector<double> response;  // of the state of each node to it, where there is one
  std::vector<SlipEvent> ended;
  long count = 0;

  Impl(const Scene& s, double v, const NodeRange& range, bool ruptures)
      : scene(s), nodes(range), first(static_cast<PetscInt>(range.first)),
        n(static_cast<std::size_t>(range.count)), ranks(ranks_in(range.comm)), velocity(v),
        coefficients(coefficients_along(s, first, PetscInt(n))),
        amplitude(friction_amplitude(s, first, PetscInt(n))), friction(s, first, PetscInt(n)),
        forces(force_loop(s.friction, friction_places(s, first, PetscInt(n)))), halo(s, range),
        regions(s.n, s.ring()), with_ruptures(ruptures), owner(n, -1), slip(n), slipped(n), slipped_then(n),
        last_force(n), rupture(ruptures ? n : 0, NAN), moving(n, 0), moved(n, 0),
        response(state_responses(s, first, PetscInt(n))) {
    if (coefficients.empty()) coefficients.push_back(s.coefficients(0));
    for (std::size_t i = 0; i < n && s.N() > 0; ++i) {
      d2.push_back(second_difference_row(s, first + PetscInt(i)));
      for (auto& term : d2.back()) term.second *= s.N();
    }
  }

  const NodeCoefficients& own(std::size_t i) const { return coefficients[coefficients.size() == 1 ? 0 : i]; }
  // What takes power beside friction, over psi^2.
  double damping(std::size_t i) const { return own(i).B + own(i).s_delta / own(i).A; }
  double weight(std::size_t i) const { return node_weight(scene, first + PetscInt(i)); }
  bool moves(std::size_t i, const Fields& fields) const { return std::abs(fields[0][i]) > velocity; }

  // Friction of a node; at psi = 0 it is that of the motion in `direction` which begins or ends there.
  double force(std::size_t i, double psi, double state, double direction, double load) const {
    return load * amplitude[i] *
           friction[PetscInt(i)].force(psi == 0 ? direction * std::numeric_limits<double>::min() : psi,
                                       state);
  }

  // The state in the middle of a step, on the cubic through values and slopes at its ends.
  double middle_state(std::size_t i, double dt) const {
    if (middle_of_step) return middle_of_step[3 * i + 2];
    const double p0 = last[0][i], p1 = now[0][i], s0 = last[2][i], s1 = now[2][i];
    const double direction = p0 + p1 < 0 ? -1 : 1;
    const auto rate = [&](double psi, double s) {
      const double at_rest = direction * std::numeric_limits<double>::min();
      return friction[PetscInt(i)].rate(psi == 0 ? at_rest : psi, s);
    };
    const double middle = (s0 + s1) / 2 + dt / 8 * (rate(p0, s0) - rate(p1, s1));
    if (response.empty()) return middle;
    return middle - dt / 8 * response[i] * (normal.log_rate[0] - normal.log_rate[1]);
  }

  // psi in the middle of a step, on the cubic through values and slopes at its ends, where neighbours have
  // viscosity.
  double middle(std::size_t i, double dt) const {
    const double p0 = last[0][i], p1 = now[0][i], direction = p0 + p1 < 0 ? -1 : 1;
    const bool has_state = last.size() > 2;
    const double A = own(i).A, B = own(i).B;
    double m0 = A * (last[1][i] - B * p0 - force(i, p0, has_state ? last[2][i] : 0, direction, normal.N[0]));
    double m1 = A * (now[1][i] - B * p1 - force(i, p1, has_state ? now[2][i] : 0, direction, normal.N[2]));
    m0 += A * viscous[0][i];
    m1 += A * viscous[2][i];
    return (p0 + p1) / 2 + dt / 8 * (m0 - m1);
  }

  // Within the step, of a node that moves in it.
  double begins_to_move(std::size_t i, double dt) const {
    const double before = std::abs(last[0][i]), behind = std::abs(now[0][i]);
    return before >= velocity || behind <= velocity ? t : t + dt * (velocity - before) / (behind - before);
  }

  void find_viscous_forces(double dt) {
    const auto find = [&](const std::vector<double>& psi, std::vector<double>& into) {
      const std::vector<double> beside = halo.fetch(psi);
      into.assign(n, 0.);
      for (std::size_t i = 0; i < n; ++i)
        for (const auto& [j, factor] : d2[i]) into[i] += factor * halo.at(j, psi, beside);
    };
    find(last[0], viscous[0]);
    find(now[0], viscous[2]);
    std::vector<double> psi(n);
    for (std::size_t i = 0; i < n; ++i)
      psi[i] = moves(i, last) || moves(i, now) ? middle(i, dt) : (last[0][i] + now[0][i]) / 2;
    find(psi, viscous[1]);
  }

  // Nodes that move at either end of the step; those that begin to join the event beside them, or begin one.
  void find_moving(double dt) {
    event_loops::mark_moving({last[0].data(), now[0].data(), velocity, moving.data(), n});
    std::vector<SlipRegion> own;
    for (std::size_t i = 0; i < n; ++i) {
      if (!moving[i] || owner[i] >= 0) continue;
      slip[i] = 0;
      if (with_ruptures) rupture[i] = begins_to_move(i, dt);
      const PetscInt node = first + PetscInt(i);
      if (!own.empty() && own.back().last + 1 == node)
        own.back().last = node;
      else
        own.push_back({node, node});
    }
    std::shared_ptr<const Before> before;  // at the beginning of this step
    const auto remember = [&] {
      if (!before)
        before = std::make_shared<const Before>(Before{settled_force(), slipped, halo.fetch(slipped)});
      return before;
    };
    if (regions.next_id() > most_ids) renumber();
    std::set<int> changed;
    for (const SlipRegion& s : of_all_ranks(own, nodes.comm, ranks))
      changed.insert(regions.claim(s, t, remember));
    for (const int id : changed)
      if (regions.live().count(id) > 0) own_nodes_of(id, [&](PetscInt i) { owner[i] = id; });
  }
  // eta at the beginning of a step; where nodes move with what damping will have given back when they come to
  // rest.
  std::vector<double> settled_force() const {
    std::vector<double> eta = last[1];
    if (const double push = scene.push(t); push != 0)
      for (double& one : eta) one -= push;
    if (scene.form == Form::chain) return eta;
    for (std::size_t i = 0; i < n; ++i)
      if (own(i).s_delta != 0 && moves(i, last)) eta[i] += own(i).s_delta / own(i).A * last[0][i];
    return eta;
  }
  void renumber() {
    regions.renumber();
    for (const auto& numbered : regions.live())
      own_nodes_of(numbered.first, [&](PetscInt i) { owner[i] = numbered.first; });
  }
  template <class Body>
  void own_nodes_of(int id, const Body& body) const {
    regions.for_nodes(id, first, PetscInt(n), body);
  }

  // One node. What friction was at the end of the last step, if the node moved in it, is known, unless it
  // went by the direction.
  void accumulate(std::size_t i, LiveEvent& live, double dt) {
    const double p0 = last[0][i], p1 = now[0][i];
    const bool has_state = last.size() > 2;
    const double s0 = has_state ? last[2][i] : 0, s1 = has_state ? now[2][i] : 0;
    const double direction = p0 + p1 < 0 ? -1 : 1;
    const double F0 = p0 != 0 && moved[i] ? last_force[i] : force(i, p0, s0, direction, normal.N[0]),
                 F1 = force(i, p1, s1, direction, normal.N[2]);
    last_force[i] = F1;
    const double A = own(i).A, B = own(i).B;
    const double m0 = A * (last[1][i] - B * p0 - F0), m1 = A * (now[1][i] - B * p1 - F1);
    const double p = middle_of_step ? middle_of_step[last.size() * i]
                     : d2.empty()   ? (p0 + p1) / 2 + dt / 8 * (m0 - m1)
                                    : middle(i, dt);
    const double F = force(i, p, has_state ? middle_state(i, dt) : 0, direction, normal.N[1]);
    const double step = dt / 6 * (p0 + 4 * p + p1);
    live.moves = true;
    slip[i] += step;
    slipped[i] += step;
    live.event.friction_work += weight(i) * dt / 6 * (p0 * F0 + 4 * p * F + p1 * F1);
    live.event.radiated += weight(i) * damping(i) * dt / 6 * (p0 * p0 + 4 * p * p + p1 * p1);
    if (!d2.empty())
      live.event.radiated -=
          weight(i) * dt / 6 * (p0 * viscous[0][i] + 4 * p * viscous[1][i] + p1 * viscous[2][i]);
    live.kinetic_now += weight(i) * p1 * p1 / (2 * A);
  }

  // Friction at psi of nodes side by side that go from last to now.
  void forces_at(std::size_t from, std::size_t size, const double* psi, const double* state, double load,
                 double* F) const {
    double aimed[side_by_side];
    event_loops::aim({psi, &last[0][from], &now[0][from], aimed, size});
    forces(PetscInt(from), PetscInt(size), aimed, state, F);
    for (std::size_t k = 0; k < size && load != 1; ++k) F[k] *= load;
    if (scene.unit_amplitude()) return;
    const double* const a = &amplitude[from];
    for (std::size_t k = 0; k < size; ++k) F[k] *= a[k];
  }

  // The same of nodes side by side of one weight, without viscosity between neighbours, in vector code.
  void accumulate_side_by_side(std::size_t from, std::size_t size, LiveEvent& live, double dt) {
    const bool has_state = last.size() > 2;
    double p[side_by_side], F0[side_by_side], F[side_by_side], state[side_by_side] = {};
    const double *const p0 = &last[0][from], *const p1 = &now[0][from];
    const double *const s0 = has_state ? &last[2][from] : nullptr, *const s1 =
                                                                       has_state ? &now[2][from] : nullptr;
    double* const F1 = &last_force[from];
    const unsigned char* const knows = &moved[from];
    std::copy(F1, F1 + size, F0);
    for (std::size_t k = 0, unknown = event_loops::count_unknown({p0, knows, size}); k < size && unknown > 0;
         ++k)
      if (p0[k] == 0 || !knows[k])
        F0[k] = force(from + k, p0[k], has_state ? s0[k] : 0, p0[k] + p1[k] < 0 ? -1 : 1, normal.N[0]);
    forces_at(from, size, p1, s1, normal.N[2], F1);
    const double A = own(0).A, B = own(0).B;  // of all
    event_loops::find_middle({p0, p1, &last[1][from], &now[1][from], F0, F1, A, B, dt, p, size});
    for (std::size_t k = 0; k < size && has_state; ++k) state[k] = middle_state(from + k, dt);
    for (std::size_t k = 0; k < size && middle_of_step; ++k) p[k] = middle_of_step[last.size() * (from + k)];
    forces_at(from, size, p, state, normal.N[1], F);
    const auto [work, squares, ends] =
        event_loops::add_step({p0, p, p1, F0, F, F1, dt, &slip[from], &slipped[from], size});
    live.moves = true;
    const double all = weight(from);
    live.event.friction_work += all * dt / 6 * work;
    live.event.radiated += all * damping(0) * dt / 6 * squares;
    live.kinetic_now += all / (2 * A) * ends;
  }

  // Neighbours mostly belong to one event.
  void accumulate_moving(double dt) {
    int whose = -1;
    LiveEvent* event = nullptr;
    for (std::size_t i = 0, end; i < n; i = end) {
      const void* const found = std::memchr(&moving[i], 1, n - i);
      if (!found) break;
      i = std::size_t(static_cast<const unsigned char*>(found) - moving.data());
      if (!event || owner[i] != whose) event = &regions.live().at(whose = owner[i]);
      end = i + 1;
      while (!counts_half(scene, first + PetscInt(end) - 1) && end < std::min(n, i + side_by_side) &&
             moving[end] && owner[end] == whose && !counts_half(scene, first + PetscInt(end)))
        ++end;
      if (end - i >= few && d2.empty() && coefficients.size() == 1)
        accumulate_side_by_side(i, end - i, *event, dt);
      else
        for (std::size_t k = i; k < end; ++k) accumulate(k, *event, dt);
    }
  }

  // Events in which no node has moved in the step: they ended at its beginning.
  std::vector<int> find_over() {
    std::vector<double> sums;  // kinetic energy, and on how many ranks a node moves
    for (const auto& [id, live] : regions.live()) {
      sums.push_back(live.kinetic_now);
      sums.push_back(live.moves ? 1 : 0);
    }
    if (ranks > 1 && !sums.empty()) sum_over(nodes.comm, sums.data(), int(sums.size()));
    std::vector<int> over;
    const double* at = sums.data();
    for (auto& [id, live] : regions.live()) {
      live.event.kinetic = std::max(live.event.kinetic, at[0]);
      if (at[1] == 0) over.push_back(id);
      at += 2;
    }
    return over;
  }

  // eta of an own node as the event found it, with what the slip of others has done to it until the event
  // ended, at the beginning of this step (0 up to round-off for most). Beside the own nodes: how far those
  // there had slipped then, in all and in events under way.
  double eta_before(PetscInt i, int id, const Before& before,
                    const std::array<std::vector<double>, 2>& beside) const {
    const PetscInt node = first + i;
    const auto others = [&](PetscInt j) {
      const double own = regions.holds(id, j) ? halo.at(j, slip, beside[1]) : 0;
      return halo.at(j, slipped_then, beside[0]) - halo.at(j, before.slipped, before.slipped_beside) - own;
    };
    double eta = before.eta[i];
    if (scene.held(node) && scene.form == Form::continuum) return eta;  // it follows from psi there
    eta -= own(std::size_t(i)).K0 * others(node);
    for (const auto& [j, factor] : coupling_row(scene, node)) eta += factor * others(j);
    return eta;
  }

  // On every rank.
  std::vector<double> ruptures_of(int id) const {
    const SlipEvent& e = regions.live().at(id).event;
    std::vector<double> times(std::size_t(e.count), 0.);
    own_nodes_of(id, [&](PetscInt i) { times[(first + i - e.left + scene.n) % scene.n] = rupture[i]; });
    if (ranks > 1) sum_over(nodes.comm, times.data(), int(times.size()));
    return times;
  }

  // What ended at t.
  void finish(const std::vector<int>& over) {
    if (over.empty()) return;
    const std::array<std::vector<double>, 2> beside = {halo.fetch(slipped_then), halo.fetch(slip)};
    std::vector<double> sums, largest;
    for (const int id : over) {
      const LiveEvent& live = regions.live().at(id);
      EventSums own;
      own_nodes_of(id, [&](PetscInt k) {
        const auto i = static_cast<std::size_t>(k);
        own.add(weight(i), slip[i], eta_before(k, id, *live.before, beside), last[1][i] - scene.push(t));
      });
      for (const double part :
           {own.moment, own.drop, own.strain, live.event.friction_work, live.event.radiated})
        sums.push_back(part);
      for (const double part : {own.right, own.left}) largest.push_back(part);
    }
    if (ranks > 1) {
      sum_over(nodes.comm, sums.data(), int(sums.size()));
      largest_over(nodes.comm, largest.data(), int(largest.size()));
    }
    for (std::size_t k = 0; k < over.size(); ++k) {
      SlipEvent e = regions.live().at(over[k]).event;
      const double* const sum = &sums[5 * k];
      conclude(e, t, {sum[0], sum[1], sum[2], largest[2 * k], largest[2 * k + 1]});
      e.friction_work = sum[3];
      e.radiated = sum[4];
      if (with_ruptures) e.rupture = ruptures_of(over[k]);
      ended.push_back(e);
      ++count;
      own_nodes_of(over[k], [&](PetscInt i) { owner[i] = -1; });
      regions.end(over[k]);
    }
  }

  // Where the normal load jumps, friction and state are not what they were at the end of the last step.
  void pass_jump_of_load(double of_log) {
    if (of_log == 0) return;
    std::fill(moved.begin(), moved.end(), 0);
    for (std::size_t i = 0; i < response.size(); ++i) last[2][i] -= response[i] * of_log;
  }

  // From last to now.
  void advance(double to, const std::function<Vec()>& middle = nullptr) {
    if (started) {
      const double dt = to - t;
      pass_jump_of_load(normal.begin_step(scene.normal, t, dt));
      for (auto& [id, live] : regions.live()) {
        live.moves = false;
        live.kinetic_now = 0;
      }
      if (scene.N() > 0) find_viscous_forces(dt);
      find_moving(dt);
      slipped_then = slipped;
      const Reading of_middle(middle && dt > 0 && !regions.live().empty() ? middle() : nullptr);
      middle_of_step = of_middle;
      accumulate_moving(dt);
      middle_of_step = nullptr;
      moved.swap(moving);
      finish(find_over());
    }
    if (!started) normal.N.fill(scene.normal_load(to));
    last.swap(now);
    t = to;
    started = true;
  }
};

Events::Events(const Scene& scene, double velocity, const NodeRange& nodes, bool ruptures)
    : impl_(std::make_unique<Impl>(scene, velocity, nodes, ruptures)) {}
Events::Events(const Scene& scene, double velocity)
    : Events(scene, velocity, {PETSC_COMM_SELF, 0, scene.n, scene.n}) {}
Events::Events(Events&&) noexcept = default;
Events::~Events() = default;

void Events::step(double t, const Fields& fields) {
  impl_->now.assign(fields.begin(), fields.end());
  impl_->advance(t);
}

void Events::step(double t, Vec u, int dof, const std::function<Vec()>& middle) {
  impl_->now.resize(dof);
  for (std::vector<double>& field : impl_->now) field.resize(impl_->n);
  Fields& now = impl_->now;
  event_loops::separate(
      {Reading(u), now[0].data(), now[1].data(), dof == 3 ? now[2].data() : nullptr, dof, impl_->n});
  impl_->advance(t, middle);
}

std::vector<SlipEvent> Events::ended() {
  std::vector<SlipEvent> result;
  result.swap(impl_->ended);
  return result;
}

long Events::count() const { return impl_->count; }

void Events::archive(Archive& a) {
  Impl& m = *impl_;
  struct Kept {
    int id = 0;
    std::size_t before = 0;  // among the beginnings
    LiveEvent live = {};
  };
  std::vector<Kept> events;
  std::vector<std::shared_ptr<const Before>> beginnings;  // those that events share stand once
  for (const auto& [id, live] : m.regions.live()) {
    const auto at = std::find(beginnings.begin(), beginnings.end(), live.before);
    events.push_back({id, std::size_t(at - beginnings.begin()), live});
    if (at == beginnings.end()) beginnings.push_back(live.before);
  }
  std::size_t fields = m.last.size(), begun = beginnings.size();
  int next_id = m.regions.next_id();
  std::vector<double> written{layout};
  a.list("events.last", [&](NumberList& x) {
    x(m.t, next_id, m.count, fields, begun);
    x.rest(written);
  });
  if (written != std::vector<double>{layout})
    throw std::runtime_error(
        "its events were written by another revision of this program; go on with that one");
  m.regions.number_from(next_id);
  m.normal.end_at(m.scene.normal, m.t);
  a.list("events.live", [&](NumberList& x) {
    x.rest(events, [&](Kept& kept) {
      SlipEvent& e = kept.live.event;
      x(kept.id, e.begin, e.first, e.left, e.count, e.kinetic, kept.before);
    });
  });
  if (fields > 3 || begun > events.size()) throw std::runtime_error("its events under way are not whole");
  // The parts of all ranks and not their sum: as many ranks go on each with its own, and round as without a
  // restart.
  std::vector<double> energies;
  for (const Kept& kept : events)
    energies.insert(energies.end(), {kept.live.event.friction_work, kept.live.event.radiated});
  a.by_rank("events.parts", energies);
  m.last.resize(fields);
  std::vector<std::vector<double>*> last;
  for (std::vector<double>& field : m.last) last.push_back(&field);
  a.nodes("events.last_fields", last);
  a.nodes("events.slips", {&m.slip, &m.slipped});
  // of a run that did not ask for ruptures those of events under way are not known
  if (std::vector<double> known{1}; m.with_ruptures && a.has("events.ruptures_known")) {
    a("events.ruptures_known", known);
    a.nodes("events.ruptures", {&m.rupture});
  }
  beginnings.resize(begun);
  for (std::size_t k = 0; k < begun; ++k) {
    Before before = beginnings[k] ? *beginnings[k] : Before();
    a.nodes("events.before" + std::to_string(k), {&before.eta, &before.slipped});
    before.slipped_beside = m.halo.fetch(before.slipped);
    beginnings[k] = std::make_shared<const Before>(std::move(before));
  }
  for (std::size_t k = 0; k < events.size() && a.restores(); ++k) {
    auto& [id, before, live] = events[k];
    live.event.friction_work = energies[2 * k];
    live.event.radiated = energies[2 * k + 1];
    live.before = beginnings.at(before);
    m.regions.put(id, live);
    m.own_nodes_of(id, [&m, whose = id](PetscInt i) { m.owner[i] = whose; });
  }
  m.started = true;
}

}  // namespace stickslip
