#include "stickslip/time/stick.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "model/stick_rule.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

using namespace stick_rule;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

double side_of(double psi) { return psi < 0 ? -1 : 1; }

// The force on a node, eta + N D2 psi: of unknowns u the eta, or that of `total`, see Stick::total_force; of
// rates its rate.
class Forces {
 public:
  Forces(const double* u, Vec total, int dof) : total_(total), dof_(dof), values_(total ? +total_ : u) {}
  double operator[](PetscInt i) const { return values_[i * dof_ + 1]; }

 private:
  Reading total_;
  int dof_;
  const double* values_;
};

}  // namespace

bool Stick::applies_to(const Scene& scene) { return scene.friction.sticks() && !scene.massless(); }

Stick::Stick(const Model& model)
    : model_(model), loaded_(model.scene().forced() && !halts(model.scene())), dof_(model.dof()),
      free_end_(model.local()), both_sides_(model.scene().friction.back_slip), direction_(model.local(), 0.),
      slope_(model.create_vector()), next_slope_(model.create_vector()),
      candidates_(std::make_unique<Candidates>()), unseen_(unseen_slip(model.wave_frequency())) {
  while (free_begin_ < free_end_ && model.held(model.first() + free_begin_)) ++free_begin_;
  const std::vector<double>& amplitude = model.amplitude();
  frictionless_ = on_any_rank(model.comm(), std::count(amplitude.begin(), amplitude.end(), 0.) > 0);
  while (free_end_ > free_begin_ && model.held(model.first() + free_end_ - 1)) --free_end_;
  if (dof_ == 3) {
    limit_.resize(std::size_t(model.local()));
    next_limit_.resize(limit_.size());
    return;
  }
  for (PetscInt i = 0; i < model.local(); ++i)
    fixed_threshold_.push_back(model.friction_law(i).threshold(0).value);
}
Stick::~Stick() { model_.set_direction(nullptr); }

// Of node i; u: its unknowns. The same product as on the right-hand side, so that a node at its threshold is
// there to the last bit when it begins to slip.
double Stick::threshold(PetscInt i, const double* u, const NormalLoad& normal) const {
  const double law = dof_ == 2 ? fixed_threshold_[i] : model_.friction_law(i).threshold(u[2]).value;
  return normal.N * model_.amplitude()[i] * law;
}
// And its rate, while the node rests.
WithSlope Stick::moving_threshold(PetscInt i, const double* u, const NormalLoad& normal) const {
  WithSlope law{dof_ == 2 ? fixed_threshold_[i] : 0, 0};
  if (dof_ == 3) {
    const Friction& friction = model_.friction_law(i);
    law = friction.threshold(u[2]);
    law.slope *= friction.sliding_rate(0, u[2], 0).g;
  }
  const double amplitude = model_.amplitude()[i], by_load = normal.rate * amplitude * law.value;
  return {normal.N * amplitude * law.value, normal.N * amplitude * law.slope + by_load};
}
// At a part of the step under way.
NormalLoad Stick::normal_at(double part) const { return model_.normal_load(begin_ + part * candidates_->dt); }

Vec Stick::viscous_force(Vec u, std::size_t number) {
  if (!forces_[number]) forces_[number] = model_.create_vector();
  model_.viscous_force(u, forces_[number]);
  return forces_[number];
}

Vec Stick::total_force(Vec u, std::size_t number) {
  if (!model_.viscous()) return nullptr;
  const Vec total = viscous_force(u, number);
  SS_TRY(VecAXPY(total, 1, u));
  return total;
}

bool Stick::never_rests(PetscInt i) const {
  return frictionless_ && i >= free_begin_ && i < free_end_ && model_.amplitude()[i] == 0;
}

template <class Body>
void Stick::for_each_side(const Body& body) const {
  body(1.);
  if (both_sides_) body(-1.);
}

void Stick::decide(Vec u, double t) {
  engage();
  const NormalLoad normal = model_.normal_load(t);
  was_ = direction_;
  const Reading a(u);
  for (PetscInt i = 0; i < model_.local(); ++i)
    direction_[i] = never_rests(i) ? side_of(a[i * dof_]) : sign_of(a[i * dof_]);
  model_.rhs(Part::full, u, slope_);

  const Vec total = total_force(u, 0), total_rate = total_force(slope_, 1);
  const Reading f(slope_);
  const Forces force(a, total, dof_), rate(f, total_rate, dof_);
  changed_.clear();
  long counts[3] = {0, 0, 0};  // moving, begins to slip now, changed
  const auto free = [&](PetscInt i) { return i >= free_begin_ && i < free_end_; };
  for (PetscInt i = 0; i < model_.local(); ++i)
    // its state moves
    if (!free(i) && dof_ == 3 && direction_[i] != 0) ++counts[0];
  for (PetscInt i = free_begin_; i < free_end_; ++i) {
    double& going = direction_[i];
    if (going == 0) {
      const WithSlope limit = moving_threshold(i, a + i * dof_, normal);
      if (dof_ == 3) limit_[i] = limit;
      for_each_side([&](double side) {
        if (begins(side * force[i] - limit.value, limit.value, side * rate[i] - limit.slope)) going = side;
      });
      if (going != 0) ++counts[1];
    }
    if (going != 0) ++counts[0];
    if (going != was_[i]) changed_.push_back(model_.first() + i);
  }
  counts[2] = long(changed_.size());
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, counts, 3, MPI_LONG, MPI_SUM, model_.comm()));
  all_rest_ = counts[0] == 0;
  changes_ += counts[2];
  if (counts[1] > 0) model_.rhs(Part::full, u, slope_);
}

// Such a node slides through psi = 0 like a node of smooth friction: only what its state sees of psi, the
// magnitude, turns there.
bool Stick::follow_frictionless(Vec u) {
  if (!frictionless_) return false;
  int turned = 0;
  {
    const Reading a(u);
    for (PetscInt i = free_begin_; i < free_end_; ++i) {
      if (!never_rests(i) || direction_[i] == side_of(a[i * dof_])) continue;
      direction_[i] = -direction_[i];
      turned = 1;
    }
  }
  return on_any_rank(model_.comm(), turned != 0);
}

void Stick::renew_slope(Vec u) { model_.rhs(Part::full, u, slope_); }

// Fills candidates_ with the changes between `before` and `after`, those of all ranks for the times.
void Stick::find_candidates(Vec before, Vec after, double dt) {
  *candidates_ = {dt};
  const NormalLoad normal0 = normal_at(0), normal1 = normal_at(1);
  const LoadsFrom loads = loads_from(begin_);
  const LoadBounds bounds(model_.scene(), loads, dt);
  const Vec total[4] = {total_force(before, 0), total_force(after, 1), total_force(slope_, 2),
                        total_force(next_slope_, 3)};
  const Reading a(before), b(after), fa(slope_), fb(next_slope_);
  const Forces force0(a, total[0], dof_), force1(b, total[1], dof_), force_rate0(fa, total[2], dof_),
      force_rate1(fb, total[3], dof_);
  for (PetscInt i = free_begin_; i < free_end_; ++i) {
    if (never_rests(i)) continue;
    const double *at0 = a + i * dof_, *at1 = b + i * dof_;
    if (direction_[i] != 0) {
      candidates_->slides(i, direction_[i], at0[0], at1[0], fa[i * dof_], fb[i * dof_]);
      continue;
    }
    const WithSlope limit0 = dof_ == 3 ? limit_[i] : moving_threshold(i, at0, normal0),
                    limit1 = moving_threshold(i, at1, normal1);
    if (dof_ == 3) next_limit_[i] = limit1;
    for_each_side([&](double side) {
      const ValueAndSlope begin{0, side * force0[i] - limit0.value, side * force_rate0[i] - limit0.slope},
          end{dt, side * force1[i] - limit1.value, side * force_rate1[i] - limit1.slope};
      if (bounds.plain(begin, end)) return candidates_->rests(i, side, begin, end, limit1.value);
      RestingNode node = resting(i, side, force0[i], force_rate0[i], at0, loads);
      node.moves(loads, dt, force1[i], force_rate1[i]);
      if (!bounds.out_of_reach(node, std::min(limit0.value, limit1.value)))
        candidates_->rests(i, side, begin, end, limit1.value, release(node, loads, dt));
    });
  }
  double both[2] = {candidates_->estimate, candidates_->reached};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, both, 2, MPI_DOUBLE, MPI_MIN, model_.comm()));
  candidates_->estimate = both[0];
  candidates_->reached = both[1];
}

double Stick::beyond(const Candidate& c, const double* u, double force, double part) const {
  const double* at = u + c.node * dof_;
  return c.rests ? c.beyond(force, threshold(c.node, at, normal_at(part)), part) : c.beyond(at[0], 0, part);
}

// At u, over all candidates of all ranks.
stick_rule::Furthest Stick::furthest(Vec u, double part) {
  const Vec total = total_force(u, 0);
  const Reading a(u);
  const Forces force(a, total, dof_);
  Furthest most;
  for (const Candidate& c : candidates_->list) most.take(c, beyond(c, a, force[c.node], part));
  double both[2] = {most.all, most.fresh};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, both, 2, MPI_DOUBLE, MPI_MAX, model_.comm()));
  return {both[0], both[1]};
}

Stick::Cut Stick::first_change(Vec before, Vec after, double t, double dt,
                               const std::function<void(double part, Vec into)>& at, Vec landed,
                               bool slope_known) {
  engage();
  begin_ = t;
  if (!slope_known) model_.rhs(Part::full, after, next_slope_);
  find_candidates(before, after, dt);
  Place place{Found::none, 1};
  if (candidates_->reached < infinity) {
    const auto furthest_at = [&](double part) {
      if (part > 1 - close)
        SS_TRY(VecCopy(after, landed));  // which the polynomial misses by its error
      else
        at(part, landed);
      return furthest(landed, part);
    };
    place = locate(candidates_->estimate, candidates_->reached, unseen_ / dt, furthest_at);
  }
  if (place.found == Found::too_coarse) return {Cut::Kind::too_coarse, 0};
  if (place.found == Found::none) {
    std::swap(slope_, next_slope_);
    limit_.swap(next_limit_);
    return {Cut::Kind::none, 1};
  }
  snap(before, landed, place.part);
  return {Cut::Kind::at, place.part};
}

// Nodes whose change has come, to round-off, get its psi or their force exactly: first every psi, which
// others may feel.
void Stick::snap(Vec before, Vec landed, double part) {
  const NormalLoad normal0 = normal_at(0), normal = normal_at(part);
  std::vector<Limit> limits;
  const Vec total = total_force(before, 0), total_landed = total_force(landed, 1);
  {
    const Reading a(before);
    const Writing b(landed);
    const Forces was(a, total, dof_), force(b, total_landed, dof_);
    for (const Candidate& c : candidates_->list) {
      const double* const at = b + c.node * dof_;
      const double limit = c.rests ? threshold(c.node, at, normal) : 0;
      if (c.beyond(c.rests ? force[c.node] : at[0], limit, 1) < -close) continue;
      if (c.rests)
        limits.push_back({c.node, c.side});
      else
        b[c.node * dof_] = 0;
    }
    for (PetscInt i = free_begin_; i < free_end_; ++i) {
      if (never_rests(i)) continue;
      const double going = direction_[i], *at0 = a + i * dof_;
      double* at = b + i * dof_;
      if (going != 0) {
        if (stops(going, at0[0], at[0])) at[0] = 0;
        continue;
      }
      at[0] = 0;
      const double limit = threshold(i, at, normal);
      for_each_side([&](double side) {
        const double excess = side * force[i] - limit;
        if (arrives(excess, side * was[i] - threshold(i, at0, normal0), limit)) limits.push_back({i, side});
      });
    }
  }
  put_at_threshold(landed, limits, normal);
}

// Makes the force on each of these nodes its threshold, from which decide() lets it go; not less by
// round-off.
void Stick::put_at_threshold(Vec u, const std::vector<Limit>& limits, const NormalLoad& normal) {
  const Vec viscous = model_.viscous() ? viscous_force(u, 0) : nullptr;
  const Reading more(viscous);
  const Writing b(u);
  const auto force = [&](PetscInt i) {
    return more ? b[i * dof_ + 1] + more[i * dof_ + 1] : b[i * dof_ + 1];
  };
  for (const auto& [node, side] : limits) {
    double* at = b + node * dof_;
    const double limit = threshold(node, at, normal), rest = more ? force(node) - at[1] : 0;
    at[1] = side * limit - rest;
    for (double step = 1e-16 * limit; side * force(node) < limit; step *= 2) at[1] += side * step;
  }
}

LoadsFrom Stick::loads_from(double t) const { return loaded_ ? LoadsFrom(model_.scene(), t) : LoadsFrom(); }

// A node at rest where the loads begin, to that side: `rate` of its force there, of which the plate's part
// may vary.
RestingNode Stick::resting(PetscInt i, double side, double force, double rate, const double* u,
                           const LoadsFrom& loads) const {
  RestingNode node{model_.friction_law(i), model_.amplitude()[i], side, force, dof_ == 3 ? u[2] : 0, rate};
  if (!model_.scene().load.varies() || !loads.vary()) return node;
  node.K0 = model_.coefficients(i).K0;
  node.rate -= node.K0 * loads.velocity(0);
  return node;
}

double Stick::release_after(Vec u, double t, double longest) {
  const LoadsFrom loads = loads_from(t);
  const Vec total = total_force(u, 0), total_rate = total_force(slope_, 1);
  const Reading a(u), f(slope_);
  const Forces forces(a, total, dof_), rates(f, total_rate, dof_);
  double first = infinity;
  for (PetscInt i = free_begin_; i < free_end_; ++i)
    for_each_side([&](double side) {
      const double latest = loads.vary() ? std::min(first, longest) : first;
      const RestingNode node = resting(i, side, forces[i], rates[i], a + i * dof_, loads);
      first = std::min(first, release(node, loads, latest).wait);
    });
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_DOUBLE, MPI_MIN, model_.comm()));
  return first;
}

double Stick::longest_rest(const Scene& scene) { return 16 * scene.smooth_time(); }

void Stick::rest(Vec u, double t, double wait, Vec into) {
  const Load& load = model_.scene().load;
  const bool loaded = loaded_ && load.varies();
  const NormalLoad normal = model_.normal_load(t + wait);
  const double v = model_.plate_velocity(t);
  const auto K0 = [&](PetscInt i) { return loaded ? model_.coefficients(i).K0 : 0; };
  const double way = loaded ? load.integral(t + wait) - load.integral(t) - v * wait : 0;
  const double gain = loaded ? model_.plate_velocity(t + wait) - v : 0;
  SS_TRY(VecWAXPY(into, wait, slope_, u));
  std::vector<Limit> limits;
  {
    const Reading a(u);
    const Writing b(into);
    if (dof_ == 3)
      for (PetscInt i = 0; i < model_.local(); ++i)
        b[i * 3 + 2] = model_.friction_law(i).state_at_rest(a[i * 3 + 2], wait);
    for (PetscInt i = 0; loaded && i < model_.local(); ++i)
      if (model_.scene().form == Form::chain || !model_.held(model_.first() + i))
        b[i * dof_ + 1] += K0(i) * way;
  }
  const Vec total = total_force(into, 0), total_rate = total_force(slope_, 1);
  {
    const Reading f(slope_), b(into);
    const Forces force(b, total, dof_), rate(f, total_rate, dof_);
    for (PetscInt i = free_begin_; i < free_end_; ++i) {
      const WithSlope limit = moving_threshold(i, b + i * dof_, normal);
      const double faster = K0(i) * gain;
      for_each_side([&](double side) {
        if (std::abs(side * force[i] - limit.value) <= close * limit.value &&
            side * (rate[i] + faster) > limit.slope)
          limits.push_back({i, side});
      });
    }
  }
  put_at_threshold(into, limits, normal);
}

}  // namespace stickslip
