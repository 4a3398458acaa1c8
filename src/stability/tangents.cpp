#include "stickslip/stability/tangents.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

#include "base/failure.hpp"
#include "model/stick_rule.hpp"
#include "stability/tangent_parts.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
// times the fastest rate: a wave then grows falsely by 7e-7 of its frequency
constexpr double longest_part = 0.3;
constexpr double most_parts = 1e6;  // of one step
// orthonormalisations: vectors come closer by exp(-0.3 * 16) at most or so
constexpr int parts_between = 16;
// Friction is stiff where it asks for so many parts, and for so many times as many as neighbours do.
constexpr double most_stiff_parts = 1e5;  // of one step that asks for more than most_parts
constexpr double stiff_parts = 50;
constexpr double stiff_ratio = 4;
constexpr double part_error = 1e-7;     // of a vector, in one part of stiff friction
constexpr double shortest_left = 1e-3;  // of a vector behind such a part
constexpr double vanished = 1e-11;      // of the length before a jump: what is left is round-off
// squared part of a vector that is its own: Cholesky's loses 1e-10 at most
constexpr double well_apart = 1e-6;

// The integral of dg/ds along what a state does at rest over the time t, in panels each as long as all before
// it: the rate may fall like 1/t.
double rest_contraction(const Friction& law, double s, double t) {
  static const Tableau points = Tableau::gauss(6);
  double sum = 0, from = 0, to = std::min(t, law.time_at_rest(s));
  while (from < t) {
    for (int i = 0; i < points.s; ++i) {
      const double at = from + (to - from) * points.c[i];
      sum += (to - from) * points.b[i] * law.sliding_rate(0, law.state_at_rest(s, at), 0).g_state;
    }
    from = to;
    to = std::min(t, 2 * to);
  }
  return sum;
}

double dot(Vec a, Vec b) {
  PetscInt n;
  SS_TRY(VecGetLocalSize(a, &n));
  const Reading x(a), y(b);
  double sum = 0;
  for (PetscInt i = 0; i < n; ++i) sum += x[i] * y[i];
  return sum;
}

}  // namespace

Tangents::Tangents(const Model& model, int count)
    : model_(model), dof_(model.dof()), rank_deficient_(count, false), growth_(count, 0.),
      u_(model.create_vector()), was_(model.create_vector()), parts_(std::make_unique<TangentParts>(model)),
      stiff_part_(1e-3 / scales_of(model.scene()).rate) {
  for (int k = 0; k < count; ++k) {
    y_.push_back(model.create_vector());
    draw(k);
  }
}
Tangents::~Tangents() = default;

// By the number of the unknown, so that it is the same on any number of ranks.
void Tangents::draw(std::size_t k) {
  const Writing y(y_[k]);
  const PetscInt first = model_.first() * dof_;
  ++draws_;
  for (PetscInt i = 0; i < model_.local() * dof_; ++i) y[i] = counter_normal(draws_, first + i);
  parts_->clear_held(y);
}

void Tangents::renew() {
  most_resting_ = 0;
  for (std::size_t k = 0; k < y_.size(); ++k) {
    if (rank_deficient_[k]) draw(k);
    rank_deficient_[k] = false;
  }
  begun_ = start_known_ = false;
}

// ---- starts and stops

// A node that rests has no deviation in psi.
void Tangents::begin(Vec u) {
  begun_ = true;
  const double* const now = model_.direction();
  {
    const Writing was(was_);
    for (PetscInt i = 0; i < model_.local() * dof_; ++i) was[i] = now && i % dof_ == 0 ? now[i / dof_] : 0;
  }
  for (const VecHandle& vector : y_) {
    const Writing y(vector);
    for (PetscInt i = 0; i < model_.local() && now; ++i)
      if (now[i] == 0) y[i * dof_] = 0;
  }
  count_resting();
  parts_->begin(u);
  start_known_ = true;
}

bool Tangents::directions_changed() const {
  const double* const now = model_.direction();
  if (!now) return false;
  bool changed = false;
  const Reading was(was_);
  for (PetscInt i = 0; i < model_.local() && !changed; ++i) changed = was[i * dof_] != now[i];
  return on_any_rank(model_.comm(), changed);
}

void Tangents::count_resting() {
  const double* const now = model_.direction();
  long counts[2] = {0, now ? 0 : 1};  // nodes at rest; moving, or with a state that does
  for (PetscInt i = 0; i < model_.local() && now; ++i) {
    if (!model_.held(model_.first() + i))
      ++counts[now[i] == 0 ? 0 : 1];
    else if (dof_ == 3 && now[i] != 0)
      ++counts[1];
  }
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPI_LONG, MPI_SUM, model_.comm()));
  any_moves_ = counts[1] > 0;
  most_resting_ = std::max(most_resting_, counts[0]);
  const long left = model_.unknowns() - most_resting_;
  for (std::size_t k = std::max(0L, left); k < y_.size(); ++k) {
    if (!rank_deficient_[k]) SS_TRY(VecZeroEntries(y_[k]));
    rank_deficient_[k] = true;
  }
}

// Of node i, where the rates change from f to g; false where it comes there at speed 0.
bool Tangents::jump_at(PetscInt i, const double* u, const double* f, const double* g, double from,
                       double to) {
  const auto neighbour_force_of = [&](std::size_t k) {
    return neighbour_forces_.empty() || from != 0 ? 0 : neighbour_forces_[k][i];
  };
  // A state that is renewed stands in the rates on both sides of the stop: their difference is 0 in what
  // matters, eta, all the same, and no deviation of it is left.
  const bool starts = from == 0, renewed = !starts && model_.friction_law(i).renewed_at_stops;
  const NormalLoad normal = model_.normal_load(model_.time());
  const auto threshold = model_.friction_law(i).threshold(dof_ == 3 ? u[2] : 0);
  const double a = model_.amplitude()[i], slope = starts && dof_ == 3 ? normal.N * a * threshold.slope : 0;
  const JumpMatrix jump =
      starts ? JumpMatrix::at_start(dof_, to, slope, f, g,
                                    neighbour_force_of(y_.size()) - to * normal.rate * a * threshold.value)
             : JumpMatrix::at_stop(dof_, f, g, renewed);
  if (std::equal(f, f + dof_, g) && !renewed) return true;
  if (jump.event_rate() == 0) return false;
  for (std::size_t k = 0; k < y_.size(); ++k) {
    const Writing y(y_[k]);
    jump.apply(y + i * dof_, neighbour_force_of(k));
    if (to == 0) y[i * dof_] = 0;  // exactly
  }
  return true;
}

// N D2 psi of this rank's nodes: of every vector as it is, and last of psi_t before the change. Empty without
// viscosity.
void Tangents::find_neighbour_forces(Vec f) {
  if (!model_.viscous()) return;
  neighbour_forces_.clear();
  for (std::size_t k = 0; k <= y_.size(); ++k) {
    const Vec into = parts_->scratch(2);
    model_.viscous_force(k < y_.size() ? y_[k].get() : f, into);
    const Reading force(into);
    neighbour_forces_.emplace_back();
    for (PetscInt i = 0; i < model_.local(); ++i) neighbour_forces_.back().push_back(force[i * dof_ + 1]);
  }
}

// With viscosity nodes that start at once with a jump in psi_t would do so in an order of their own for every
// deviation.
void Tangents::check_order(const std::vector<double>& was, const double* f, const double* g) const {
  if (!model_.viscous()) return;
  long counts[2] = {0, 0};  // changes; starts with a jump
  for (PetscInt i = 0; i < model_.local(); ++i) {
    if (model_.held(model_.first() + i) || was[i] == model_.direction()[i]) continue;
    ++counts[0];
    if (was[i] == 0 && f[i * dof_] != g[i * dof_]) ++counts[1];
  }
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, counts, 2, MPI_LONG, MPI_SUM, model_.comm()));
  if (counts[0] > 1 && counts[1] > 0)
    throw Failure(
        "lyapunov_count: with viscosity between neighbours several nodes begin to slip at once, with a jump "
        "in "
        "their "
        "acceleration: nearby motions do it one by one, and no tangent exists; give friction_spread or "
        "init_noise");
}

void Tangents::jump(Vec u) {
  orthonormalise(false);
  const std::vector<double> is(model_.direction(), model_.direction() + model_.local());
  std::vector<double> was(is.size());
  {
    const Writing kept(was_);
    for (std::size_t i = 0; i < is.size(); ++i) was[i] = std::exchange(kept[i * dof_], is[i]);
  }
  const double* const theirs = model_.direction();
  const Vec f_was = parts_->scratch(0), f_is = parts_->scratch(1);
  model_.set_direction(was.data());
  model_.rhs(Part::full, u, f_was);
  model_.set_direction(theirs);
  model_.rhs(Part::full, u, f_is);
  model_.count_evaluations(-2);
  find_neighbour_forces(f_was);
  bool grazes = false;
  {
    const Reading at(u), before(f_was), after(f_is);
    check_order(was, before, after);
    for (PetscInt i = 0; i < model_.local(); ++i)
      if (was[i] != is[i] && !model_.held(model_.first() + i) &&
          !jump_at(i, at + i * dof_, before + i * dof_, after + i * dof_, was[i], is[i]))
        grazes = true;
  }
  if (on_any_rank(model_.comm(), grazes))
    throw Failure(
        "lyapunov_count: a node comes to rest or begins to slip at speed 0, where no tangent exists");
  count_resting();
  orthonormalise(true);
  start_known_ = false;
}

// ---- between them

// Nothing moves: psi and eta do not deviate more, and each state comes closer by itself, in as many turns as
// keep what is left of a vector above round-off.
void Tangents::rest(double dt, Vec u) {
  start_known_ = false;
  if (dof_ == 2) return;
  std::vector<double> logs(model_.local());
  double most = 0;
  {
    const Reading a(u);
    for (std::size_t i = 0; i < logs.size(); ++i) {
      logs[i] = rest_contraction(model_.friction_law(i), a[i * 3 + 2], dt);
      divergence_ += logs[i];
      most = std::max(most, std::abs(logs[i]));
    }
  }
  most = largest_over(model_.comm(), most);
  if (most / 5 > most_parts)
    throw failure("lyapunov_count: a rest of {} is too long for it", number_text(dt));
  const int turns = std::max(1, int(std::ceil(most / 5)));
  for (int turn = 0; turn < turns; ++turn) {
    for (const VecHandle& vector : y_) {
      const Writing y(vector);
      for (std::size_t i = 0; i < logs.size(); ++i) y[i * 3 + 2] *= std::exp(logs[i] / turns);
    }
    if (turns > 1) orthonormalise(false);
  }
}

void Tangents::advance(double dt, const Inside& inside) {
  divergence_ = 0;
  const bool jumps = begun_ && directions_changed();
  if (jumps || !start_known_) inside(0, u_);
  if (!begun_) begin(u_);
  if (jumps) jump(u_);
  if (any_moves_)
    move(dt, inside);
  else
    rest(dt, u_);
  divergence_ = sum_over(model_.comm(), divergence_);
}

std::vector<Vec> Tangents::living(const std::vector<VecHandle>& vectors) const {
  std::vector<Vec> living;
  for (std::size_t k = 0; k < vectors.size(); ++k)
    living.push_back(rank_deficient_[k] ? nullptr : vectors[k].get());
  return living;
}

void Tangents::move(double dt, const Inside& inside) {
  if (!start_known_) parts_->begin(u_);
  inside(1, u_);
  const auto parts_of = [dt](double rate) { return std::max(1., std::ceil(dt * rate / longest_part)); };
  const double of_neighbours = parts_of(stencil_rate(model_.scene()));
  const double parts = std::max(of_neighbours, parts_of(parts_->rate_until(u_)));
  const bool stiff = parts > stiff_parts && parts > stiff_ratio * of_neighbours;
  const double most = parts > most_parts ? most_stiff_parts : parts / 2;  // that are worth it
  double done = 0;
  if (stiff && (parts > most_parts || stiff_part_ * most >= dt))
    done = move_stiff(dt, inside, most);
  else
    stiff_part_ = std::max(stiff_part_, std::min(2 * stiff_part_, dt));
  if (done < 1) move_explicitly(done, dt, inside, std::ceil((1 - done) * parts));
  start_known_ = true;
}

void Tangents::move_explicitly(double from, double dt, const Inside& inside, double parts) {
  if (!(parts <= most_parts))
    throw failure(
        "lyapunov_count {}: one step of {} would take more than a million parts; ask for fewer exponents, if "
        "friction damps the others at once",
        y_.size(), number_text(dt));
  for (int i = 0; i < int(parts); ++i) {
    divergence_ +=
        parts_->explicit_part({from + i * (1 - from) / parts, (1 - from) / parts, dt}, inside, living(y_));
    if ((i + 1) % parts_between == 0) orthonormalise(false);
  }
}

// Parts of stiff friction, until so many have been tried: the part of the step that is done. A part counts
// where its estimated error allows it and no vector is left with its last digits alone: those that lie along
// what friction damps at once are followed.
double Tangents::move_stiff(double dt, const Inside& inside, double most) {
  while (next_.size() < y_.size()) next_.push_back(model_.create_vector());
  orthonormalise(false);
  double at = 0, length = stiff_part_;
  for (double tried = 0; at < dt && tried < most; ++tried) {
    const bool last = at + length >= dt * (1 - 1e-12);
    const double h = last ? dt - at : length;
    const auto [error, trace] =
        parts_->implicit_part({at / dt, h / dt, dt}, inside, living(y_), living(next_));
    std::swap(y_, next_);
    std::vector<double> lengths(y_.size(), 1.);
    const bool exact = error <= part_error, good = exact && by_cholesky(lengths, shortest_left);
    const double factor =
        exact && !good ? 0.2 : std::clamp(0.9 * std::pow(part_error / error, 0.25), 0.2, 4.);
    if (!good) {
      std::swap(y_, next_);
      length = h * factor;
      continue;
    }
    parts_->keep();
    count_growth(lengths);
    divergence_ += trace;
    at = last ? dt : at + h;
    length = last && h < length ? std::max(length, h * factor) : h * factor;
  }
  stiff_part_ = length;
  return at / dt;
}

// ---- orthonormal vectors

std::vector<double> Tangents::growth() {
  orthonormalise(false);
  std::vector<double> all(growth_.size(), 0.);
  std::swap(all, growth_);
  for (std::size_t k = 0; k < all.size(); ++k)
    if (rank_deficient_[k]) all[k] = -infinity;
  return all;
}

void Tangents::orthonormalise(bool after_jump) {
  std::vector<double> lengths(y_.size(), 1.);
  if (!by_cholesky(lengths)) one_by_one(lengths, after_jump);
  count_growth(lengths);
}

void Tangents::count_growth(const std::vector<double>& lengths) {
  for (std::size_t k = 0; k < y_.size(); ++k)
    if (!rank_deficient_[k]) growth_[k] += std::log(lengths[k]);
}

// Y = Q R with R^T R = Y^T Y: one reduction. False, and nothing done, where the vectors are too much alike
// for it, or one is left with less than `shortest`.
bool Tangents::by_cholesky(std::vector<double>& lengths, double shortest) {
  std::vector<std::size_t> live;
  for (std::size_t k = 0; k < y_.size(); ++k)
    if (!rank_deficient_[k]) live.push_back(k);
  const std::size_t n = live.size();
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(n, n);  // Y^T Y, its upper triangle
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i; j < n; ++j) products(i, j) = dot(y_[live[i]], y_[live[j]]);
  sum_over(model_.comm(), products.data(), int(products.size()));
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Upper> factors(products);
  const Eigen::MatrixXd R = factors.matrixU();
  if (factors.info() != Eigen::Success ||
      !(R.diagonal().array().square() > well_apart * products.diagonal().array()).all() ||
      !(R.diagonal().array() > shortest).all())
    return false;
  for (std::size_t k = 0; k < n; ++k) {
    lengths[live[k]] = R(k, k);
    for (std::size_t i = 0; i < k; ++i) SS_TRY(VecAXPY(y_[live[k]], -R(i, k), y_[live[i]]));
    SS_TRY(VecScale(y_[live[k]], 1 / R(k, k)));
  }
  return true;
}

// Modified Gram and Schmidt, twice over for what loses digits: a reduction for each vector.
void Tangents::one_by_one(std::vector<double>& lengths, bool after_jump) {
  std::vector<double> whole(y_.size());
  for (std::size_t k = 0; k < y_.size(); ++k) whole[k] = dot(y_[k], y_[k]);
  sum_over(model_.comm(), whole.data(), int(whole.size()));
  for (std::size_t k = 0; k < y_.size(); ++k) {
    if (rank_deficient_[k]) continue;
    for (int round = 0; round < 2; ++round) {
      std::vector<double> part(k, 0.);
      for (std::size_t i = 0; i < k; ++i)
        if (!rank_deficient_[i]) part[i] = dot(y_[i], y_[k]);
      sum_over(model_.comm(), part.data(), int(k));
      for (std::size_t i = 0; i < k; ++i)
        if (!rank_deficient_[i]) SS_TRY(VecAXPY(y_[k], -part[i], y_[i]));
    }
    lengths[k] = std::sqrt(sum_over(model_.comm(), dot(y_[k], y_[k])));
    rank_deficient_[k] = lengths[k] == 0 || (after_jump && lengths[k] <= vanished * std::sqrt(whole[k]));
    if (rank_deficient_[k])
      SS_TRY(VecZeroEntries(y_[k]));
    else
      SS_TRY(VecScale(y_[k], 1 / lengths[k]));
  }
}

}  // namespace stickslip
