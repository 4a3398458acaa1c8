#include "time/tiles.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/frictions.hpp"

namespace stickslip {

StepErrors::StepErrors()
    : square_(kernel::compiled<std::function<double(const kernel::Weighted&)>>(kernel::SumOfSquares{})) {}

void StepErrors::add(int unknown, const double* u, const double* errors, PetscInt count,
                     const ErrorNorm& norm, bool estimate, Sums& sums) const {
  const double atol = norm.tolerances.absolute[unknown], rtol = norm.tolerances.relative[unknown];
  if (estimate && norm.type != NORM_INFINITY) {
    sums.squares += square_({u, errors, atol, rtol, count});
    return;
  }
  double not_finite = sums.not_finite, largest = sums.largest;
  for (PetscInt i = 0; i < count; ++i) not_finite += u[i] - u[i];
  for (PetscInt i = 0; i < count && estimate; ++i) {
    const double size = std::max(std::abs(u[i]), std::abs(u[i] - errors[i]));
    largest = std::max(largest, std::abs(errors[i]) / (atol + rtol * size));
  }
  sums.not_finite = not_finite;
  sums.largest = largest;
}

StepTaker::Outcome StepErrors::over_ranks(MPI_Comm comm, const Sums& sums, const ErrorNorm& norm,
                                          bool estimate, double unknowns) {
  double total[3] = {sums.squares, sums.not_finite, sums.unsolved};
  sum_over(comm, total, 3);
  const double error = !estimate                    ? -1
                       : norm.type == NORM_INFINITY ? largest_over(comm, sums.largest)
                                                    : std::sqrt(total[0] / unknowns);
  return {std::isfinite(total[0]) && std::isfinite(total[1]), error, total[2] == 0};
}

SlaveErrors::SlaveErrors(const Scene& scene, const FrictionPlaces& places) {
  if (!scene.massless() && Frictions(scene, 0, 1)[0].steep)
    law_ = kernel::law_columns(scene.friction, false, places);
}

void SlaveErrors::operator()(const Columns& c,
                             const std::function<NodeCoefficients(PetscInt)>& coefficients) const {
  for (std::vector<double>& column : columns_) column.resize(std::size_t(c.count));
  const auto at = [&](int j) { return columns_[j].data(); };
  const kernel::LawValues law{at(0), at(1), at(2), at(3), at(4), at(5)};
  law_.partials({c.psi, c.state, nullptr, c.count, c.number}, law);
  for (PetscInt i = 0; i < c.count; ++i) {
    const NodeCoefficients own = coefficients(i);
    const double amplitude = c.amplitude ? c.amplitude[i] : 1, hA = c.h * own.A;
    const double a = 1 + hA * (own.B + amplitude * law.F_psi[i]), b = hA * (amplitude * law.F_state[i]);
    const double of_psi_from_state = c.h * law.g_psi[i], d = 1 - c.h * law.g_state[i];
    const double determinant = a * d + b * of_psi_from_state;
    if (!(determinant > 0)) continue;  // no slave: friction falls
    const double known = c.of_psi[i] + hA * c.of_eta[i], of_state = c.of_state[i];
    c.of_psi[i] = (known * d - b * of_state) / determinant;
    c.of_state[i] = (a * of_state + of_psi_from_state * known) / determinant;
  }
}

namespace {

constexpr PetscInt tile_nodes = 256;  // a tile with its slopes: some 50 kB

// Whether every rank takes the whole grid as one tile. Fewer nodes a rank than the overlap would cost more
// than they save, and the closures of an end must lie within one tile. Collective.
bool is_closed(const Model& model, int stages) {
  const PetscInt least = 2 * stages * (model.scene().order / 2);
  const bool few = on_any_rank(model.comm(), model.local() < std::max(least, PetscInt(16)));
  return model.scene().n <= closed_nodes || few;
}

}  // namespace

Tiles::Tiles(const Model& model, int stages, int columns, bool sticking)
    : model_(model), dof_(model.dof()), half_width_(model.scene().order / 2), first_(model.first()),
      local_(model.local()), n_(model.scene().n), closed_(is_closed(model, stages)),
      to_columns_(kernel::copy_loop<true>(dof_)), from_columns_(kernel::copy_loop<false>(dof_)) {
  const bool open_ring = model.scene().ring() && !closed_;
  constexpr PetscInt none = std::numeric_limits<PetscInt>::max() / 2;
  low_ = open_ring ? -none : -first_;
  high_ = open_ring ? none : n_ - first_;
  const PetscInt reach = closed_ ? n_ : stages * half_width_;
  left_halo_ = std::min(reach, -low_);
  right_halo_ = std::min(reach, high_ - local_);
  for (int j = 1; j <= half_width_ && !open_ring; ++j) {
    left_end_.push_back(beyond(-j));
    right_end_.push_back(beyond(n_ - 1 + j));
  }
  set_amplitude();
  stride_ = ((closed_ ? n_ : std::min(tile_nodes, local_) + 2 * reach) + 2 * pad_ + 7) / 8 * 8;
  work_.assign(stride_ * dof_ * (columns + 2), 0.);
  zeros_.assign(stride_, 0.);
  if (left_halo_ + right_halo_ > 0) set_up_fetch();
  if (sticking) direction_.assign(left_halo_ + local_ + right_halo_, 0.);
}

void Tiles::set_amplitude() {
  if (model_.scene().unit_amplitude()) return;
  // the nodes of a ring go on at its beginning
  for (PetscInt i = -left_halo_; i < local_ + right_halo_;) {
    const PetscInt node = wrapped(first_ + i), count = std::min(local_ + right_halo_ - i, n_ - node);
    const auto part = friction_amplitude(model_.scene(), node, count);
    amplitude_.insert(amplitude_.end(), part.begin(), part.end());
    i += count;
  }
}

FrictionPlaces Tiles::places() const {
  return friction_places(model_.scene(), left_halo_ + local_ + right_halo_,
                         [this](PetscInt i) { return wrapped(first_ + i - left_halo_); });
}

std::vector<double> Tiles::links() const {
  std::vector<double> all;
  if (!model_.scene().medium.links_differ()) return all;
  for (PetscInt i = -left_halo_ - 1; i < local_ + right_halo_; ++i)
    all.push_back(model_.scene().link(model_.scene().ring() ? wrapped(first_ + i) : first_ + i));
  return all;
}

void Tiles::set_direction(const std::vector<double>& own) {
  std::copy(own.begin(), own.end(), direction_.begin() + left_halo_);
  if (!fetch_) return;
  going_.resize(std::size_t(local_ * dof_));
  for (PetscInt i = 0; i < local_; ++i) going_[std::size_t(i * dof_)] = own[i];
  fetch_->take(going_.data());
  const double* const halo = fetch_->values();
  for (PetscInt i = 0; i < left_halo_; ++i) direction_[i] = halo[i * dof_];
  for (PetscInt i = 0; i < right_halo_; ++i)
    direction_[left_halo_ + local_ + i] = halo[(left_halo_ + i) * dof_];
}

std::vector<std::pair<PetscInt, double>> Tiles::beyond(PetscInt node) const {
  std::vector<std::pair<PetscInt, double>> value;
  for (const auto& [inside, weight] : halo_node(model_.scene(), node))
    value.emplace_back(inside - first_, weight);
  return value;
}

void Tiles::set_up_fetch() {
  std::vector<PetscInt> nodes;
  for (PetscInt i = 0; i < left_halo_; ++i) nodes.push_back(wrapped(first_ - left_halo_ + i));
  for (PetscInt i = 0; i < right_halo_; ++i) nodes.push_back(wrapped(first_ + local_ + i));
  fetch_.emplace(NodeFetch::Layout{model_.comm(), local_, n_, dof_}, dof_, nodes);
}

// The columns of index `index` at node i.
std::array<double*, 3> Tiles::columns(const Tile& t, int index, PetscInt i) const {
  std::array<double*, 3> all{};
  for (int d = 0; d < dof_; ++d) all[d] = column(index, d) + (i - t.from);
  return all;
}

// u and halo are only read
void Tiles::load(const Tile& t, const double* u, const double* halo) const {
  const auto part = [&](PetscInt begin, PetscInt end, const double* from, PetscInt node) {
    if (begin < end)
      to_columns_({const_cast<double*>(from + node * dof_), columns(t, 0, begin).data(), end - begin});
  };
  const PetscInt inside = std::max(t.from, PetscInt(0)), behind = std::max(t.from, local_);
  part(t.from, std::min(t.to, PetscInt(0)), halo, t.from + left_halo_);
  part(inside, std::min(t.to, local_), u, inside);
  part(behind, t.to, halo, left_halo_ + behind - local_);
}

void Tiles::store(const Tile& t, int index, double* u) const {
  from_columns_({u + t.own_begin * dof_, columns(t, index, t.own_begin).data(), t.own_end - t.own_begin});
}

void Tiles::sum(const Tile& t, int d, const double* base, const SlopeSum& row, double dt, PetscInt begin,
                PetscInt end, double* into) const {
  const PetscInt at = begin - t.from;
  add_(base + at, row, dt, end - begin, into + at, [&](int index) { return column(index, d) + at; });
}

void Tiles::close_ends(double* psi, PetscInt begin, PetscInt end) const {
  for (PetscInt j = 1; j <= half_width_ && begin - half_width_ < low_; ++j) {
    psi[low_ - j] = 0;
    for (const auto& [node, weight] : left_end_[j - 1]) psi[low_ - j] += weight * psi[node];
  }
  for (PetscInt j = 1; j <= half_width_ && end + half_width_ > high_; ++j) {
    double value = 0;
    for (const auto& [node, weight] : right_end_[j - 1]) value += weight * psi[node];
    psi[high_ - 1 + j] = value;
  }
}

PetscInt Tiles::count() const { return closed_ ? 1 : (local_ + tile_nodes - 1) / tile_nodes; }

Tile Tiles::tile(PetscInt number, PetscInt reach) const {
  if (closed_) return {low_, high_, 0, local_, low_, high_};
  const auto split_at = [&](PetscInt part) { return PetscInt(std::int64_t(part) * local_ / count()); };
  const PetscInt begin = split_at(number), end = split_at(number + 1);
  return {begin, end, begin, end, std::max(begin - reach, low_), std::min(end + reach, high_)};
}

void Tiles::measure(const Tile& t, const SlopeSum& error, double dt, const ErrorNorm& norm, bool estimate,
                    StepErrors::Sums& sums, const std::function<void()>& refine) const {
  const PetscInt at = t.own_begin - t.from, count = t.own_end - t.own_begin;
  for (int d = 0; d < dof_ && estimate; ++d)  // u itself is not needed any more
    sum(t, d, zeros(), error, dt, t.own_begin, t.own_end, column(0, d));
  if (estimate) refine();
  for (int d = 0; d < dof_; ++d)
    errors_.add(d, column(1, d) + at, column(0, d) + at, count, norm, estimate, sums);
}

}  // namespace stickslip
