#include "fused_step.hpp"

#include <petscdmda.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>

#include "kernel.hpp"
#include "stickslip/error.hpp"

namespace stickslip {

namespace {

constexpr PetscInt tile_nodes = 256;    // a tile with its slopes: some 50 kB
constexpr PetscInt closed_nodes = 512;  // a whole grid of so many nodes or fewer is one tile on every rank
constexpr PetscInt pad = 8;             // room for the nodes beyond an end

using Evaluate = std::function<void(const kernel::Coefficients&, const kernel::Columns&)>;
using Add = std::function<void(const kernel::Terms&)>;
using Copy = std::function<void(const kernel::Interleaved&)>;
using Square = std::function<double(const kernel::Weighted&)>;

template <bool sticking, class F>
Evaluate evaluation_of(const Scene& scene, const F& friction) {
  return kernel::for_half_width(scene.order / 2, [&](auto half_width) -> Evaluate {
    return kernel::compiled_by_dof<Evaluate>(kernel::WholeOfColumns<half_width, F, sticking>{friction});
  });
}

Evaluate evaluation(const Scene& scene, bool sticking) {
  return dispatch_friction(scene.friction, [&](const auto& friction) -> Evaluate {
    if constexpr (std::decay_t<decltype(friction)>::sticks)
      if (sticking) return evaluation_of<true>(scene, friction);
    return evaluation_of<false>(scene, friction);
  });
}

// The terms of a sum that are not zero.
struct Row {
  std::vector<int> stage;
  std::vector<double> weight;
};

Row row_of(const double* weights, int count) {
  Row row;
  for (int j = 0; j < count; ++j) {
    if (weights[j] == 0) continue;
    row.stage.push_back(j);
    row.weight.push_back(weights[j]);
  }
  return row;
}

// Whether every rank takes the whole grid as one tile. Fewer nodes a rank than the overlap would cost more than they
// save, and the closures of an end must lie within one tile. Collective.
bool is_closed(const Model& model, int stages) {
  const PetscInt least = 2 * stages * (model.scene().order / 2);
  int few = model.local() < std::max(least, PetscInt(16)) ? 1 : 0;
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &few, 1, MPI_INT, MPI_MAX, model.comm()));
  return model.scene().n <= closed_nodes || few != 0;
}

}  // namespace

struct FusedStep::Impl {
  const Model& model;
  int stages, dof, half_width;
  std::vector<Row> rows;  // of A
  Row solution, error;
  bool last_is_solution;  // the last stage is taken at the new u
  PetscInt first, local, n;
  bool closed;            // one tile holds the whole grid, also of several ranks
  PetscInt low, high;     // the ends of the grid seen from this rank; none on a ring that is not closed
  PetscInt left_halo = 0, right_halo = 0;
  std::vector<double> amplitude;  // of the nodes -left_halo .. local + right_halo - 1; empty: all are 1
  std::vector<double> direction;  // of the same nodes; empty: friction does not stick
  std::vector<std::vector<std::pair<PetscInt, double>>> left_end, right_end;  // psi beyond an end, by local nodes
  kernel::Coefficients coefficients;
  Evaluate evaluate;
  Add add;
  Square square;
  Copy to_columns, from_columns;
  ScatterHandle scatter;
  VecHandle fetched, going;  // going: the direction in place of psi, to be fetched

  // Columns of one tile: u, y (a stage or the new u), k_i; one each for psi, eta and the state.
  PetscInt stride = 0;
  mutable std::vector<double> work;
  std::vector<double> zeros;

  Impl(const Model& m, const RungeKutta& method, bool sticking)
      : model(m), stages(method.stages), dof(m.dof()), half_width(m.scene().order / 2), first(m.first()),
        local(m.local()), n(m.scene().n), coefficients(kernel::coefficients_of(m.scene())),
        evaluate(evaluation(m.scene(), sticking)), add(kernel::compiled<Add>(kernel::AddTerms{})),
        square(kernel::compiled<Square>(kernel::SumOfSquares{})),
        to_columns(dof == 3 ? kernel::compiled<Copy>(kernel::ToColumns<3>{})
                            : kernel::compiled<Copy>(kernel::ToColumns<2>{})),
        from_columns(dof == 3 ? kernel::compiled<Copy>(kernel::FromColumns<3>{})
                              : kernel::compiled<Copy>(kernel::FromColumns<2>{})) {
    const Scene& scene = m.scene();
    for (int i = 0; i < stages; ++i) rows.push_back(row_of(&method.A[static_cast<std::size_t>(i * stages)], i));
    solution = row_of(method.b.data(), stages);
    last_is_solution = rows.back().stage == solution.stage && rows.back().weight == solution.weight;
    if (!method.embedded.empty()) {
      std::vector<double> difference = method.b;
      for (std::size_t i = 0; i < difference.size(); ++i) difference[i] -= method.embedded[i];
      error = row_of(difference.data(), stages);
    }

    closed = is_closed(m, stages);
    const bool open_ring = scene.ring() && !closed;
    constexpr PetscInt none = std::numeric_limits<PetscInt>::max() / 2;
    low = open_ring ? -none : -first;
    high = open_ring ? none : n - first;
    const PetscInt reach = closed ? n : stages * half_width;
    left_halo = std::min(reach, -low);
    right_halo = std::min(reach, high - local);
    for (int j = 1; j <= half_width && !open_ring; ++j) {
      left_end.push_back(beyond(-j));
      right_end.push_back(beyond(n - 1 + j));
    }
    if (scene.spread != 0) {
      // the nodes of a ring go on at its beginning
      for (PetscInt i = -left_halo; i < local + right_halo;) {
        const PetscInt node = wrapped(first + i), count = std::min(local + right_halo - i, n - node);
        const auto part = friction_amplitude(scene, node, count);
        amplitude.insert(amplitude.end(), part.begin(), part.end());
        i += count;
      }
    }
    stride = ((closed ? n : std::min(tile_nodes, local) + 2 * reach) + 2 * pad + 7) / 8 * 8;
    work.assign(static_cast<std::size_t>(stride * dof * (stages + 2)), 0.);
    zeros.assign(static_cast<std::size_t>(stride), 0.);
    if (left_halo + right_halo > 0) set_up_scatter();
    if (sticking) direction.assign(static_cast<std::size_t>(left_halo + local + right_halo), 0.);
  }

  void set_direction(const std::vector<double>& own) {
    std::copy(own.begin(), own.end(), direction.begin() + left_halo);
    if (!scatter) return;
    if (!going) going = model.create_vector();
    double* a;
    SS_TRY(VecGetArray(going, &a));
    for (PetscInt i = 0; i < local; ++i) a[i * dof] = own[static_cast<std::size_t>(i)];
    SS_TRY(VecRestoreArray(going, &a));
    fetch(going);
    const double* halo;
    SS_TRY(VecGetArrayRead(fetched, &halo));
    for (PetscInt i = 0; i < left_halo; ++i) direction[static_cast<std::size_t>(i)] = halo[i * dof];
    for (PetscInt i = 0; i < right_halo; ++i)
      direction[static_cast<std::size_t>(left_halo + local + i)] = halo[(left_halo + i) * dof];
    SS_TRY(VecRestoreArrayRead(fetched, &halo));
  }

  void fetch(Vec from) const {
    SS_TRY(VecScatterBegin(scatter, from, fetched, INSERT_VALUES, SCATTER_FORWARD));
    SS_TRY(VecScatterEnd(scatter, from, fetched, INSERT_VALUES, SCATTER_FORWARD));
  }

  PetscInt wrapped(PetscInt node) const { return ((node % n) + n) % n; }

  std::vector<std::pair<PetscInt, double>> beyond(PetscInt node) const {
    std::vector<std::pair<PetscInt, double>> value;
    for (const auto& [inside, weight] : halo_node(model.scene(), node)) value.emplace_back(inside - first, weight);
    return value;
  }

  void set_up_scatter() {
    std::vector<PetscInt> nodes;
    for (PetscInt i = 0; i < left_halo; ++i) nodes.push_back(wrapped(first - left_halo + i));
    for (PetscInt i = 0; i < right_halo; ++i) nodes.push_back(wrapped(first + local + i));
    const auto count = static_cast<PetscInt>(nodes.size());
    VecHandle pattern;
    SS_TRY(DMCreateGlobalVector(model.dm(), pattern.out()));
    SS_TRY(VecCreateSeq(PETSC_COMM_SELF, count * dof, fetched.out()));
    IsHandle from;
    SS_TRY(ISCreateBlock(model.comm(), dof, count, nodes.data(), PETSC_COPY_VALUES, from.out()));
    SS_TRY(VecScatterCreate(pattern, from, fetched, nullptr, scatter.out()));
  }

  // Node i of column `index` (0: u, 1: y, 2 + j: k_j) for unknown d is column(...)[i - begin].
  double* column(int index, int d) const { return &work[static_cast<std::size_t>((index * dof + d) * stride + pad)]; }

  // ---- one tile ----
  struct Tile {
    PetscInt begin, end;          // the nodes whose new values are wanted,
    PetscInt own_begin, own_end;  // those of them that are this rank's,
    PetscInt from, to;            // the nodes that are loaded
  };

  // The columns of index `index` at node i.
  std::array<double*, 3> columns(const Tile& t, int index, PetscInt i) const {
    std::array<double*, 3> all{};
    for (int d = 0; d < dof; ++d) all[static_cast<std::size_t>(d)] = column(index, d) + (i - t.from);
    return all;
  }

  // u and halo are only read
  void load(const Tile& t, const double* u, const double* halo) const {
    const auto part = [&](PetscInt begin, PetscInt end, const double* from, PetscInt node) {
      if (begin < end) to_columns({const_cast<double*>(from + node * dof), columns(t, 0, begin).data(), end - begin});
    };
    const PetscInt inside = std::max(t.from, PetscInt(0)), behind = std::max(t.from, local);
    part(t.from, std::min(t.to, PetscInt(0)), halo, t.from + left_halo);
    part(inside, std::min(t.to, local), u, inside);
    part(behind, t.to, halo, left_halo + behind - local);
  }

  void store(const Tile& t, int index, double* u) const {
    from_columns({u + t.own_begin * dof, columns(t, index, t.own_begin).data(), t.own_end - t.own_begin});
  }

  void sum(const Tile& t, int d, const double* base, const Row& row, double dt, PetscInt begin, PetscInt end,
           double* into) const {
    const double* terms[most_stages];
    double weights[most_stages];
    const auto count = row.stage.size();
    for (std::size_t j = 0; j < count; ++j) {
      terms[j] = column(2 + row.stage[j], d) + (begin - t.from);
      weights[j] = dt * row.weight[j];
    }
    add({base + (begin - t.from), terms, weights, static_cast<int>(count), into + (begin - t.from), end - begin});
  }

  // k_i on [begin, end) of the values in column `index`, psi of which holds half_width more nodes at either side.
  void slope(const Tile& t, int index, int i, PetscInt begin, PetscInt end) const {
    double* const psi = column(index, 0) - t.from;
    for (PetscInt j = 1; j <= half_width && begin - half_width < low; ++j) {
      psi[low - j] = 0;
      for (const auto& [node, weight] : left_end[static_cast<std::size_t>(j - 1)]) psi[low - j] += weight * psi[node];
    }
    for (PetscInt j = 1; j <= half_width && end + half_width > high; ++j) {
      double value = 0;
      for (const auto& [node, weight] : right_end[static_cast<std::size_t>(j - 1)]) value += weight * psi[node];
      psi[high - 1 + j] = value;
    }
    const PetscInt at = begin - t.from;
    double* const k_psi = column(2 + i, 0) - t.from;
    double* const k_eta = column(2 + i, 1) - t.from;
    const auto from = [&](const std::vector<double>& list) {
      return list.empty() ? nullptr : &list[static_cast<std::size_t>(begin + left_halo)];
    };
    evaluate(coefficients,
             {psi + begin, column(index, 1) + at, dof == 3 ? column(index, 2) + at : nullptr, from(amplitude),
              k_psi + begin, k_eta + begin, dof == 3 ? column(2 + i, 2) + at : nullptr, end - begin, from(direction)});
    for (const PetscInt node : {PetscInt(0), n - 1}) {
      const PetscInt own = node - first;
      if (!model.held(node) || own < begin || own >= end) continue;
      k_psi[own] = 0;
      if (model.scene().form == Form::continuum) k_eta[own] = 0;
    }
  }

  PetscInt share(PetscInt part, PetscInt parts) const {
    return static_cast<PetscInt>(static_cast<std::int64_t>(part) * local / parts);
  }

  struct Sums {
    double squares = 0, largest = 0, not_finite = 0;
  };

  // Through all stages, of which the first `taken` need their slope; the new values end in column 1.
  void through(const Tile& t, double dt, int taken) const {
    for (int i = 0; i < stages; ++i) {
      const bool is_taken = i < taken;
      if (!is_taken && !last_is_solution) break;
      const PetscInt margin = is_taken ? (taken - 1 - i) * half_width : 0;
      const PetscInt begin = std::max(t.begin - margin, low), end = std::min(t.end + margin, high);
      if (i > 0) {
        const PetscInt beyond_it = is_taken ? half_width : 0;
        const Row& row = rows[static_cast<std::size_t>(i)];
        const PetscInt psi_begin = std::max(begin - beyond_it, low), psi_end = std::min(end + beyond_it, high);
        sum(t, 0, column(0, 0), row, dt, psi_begin, psi_end, column(1, 0));
        for (int d = 1; d < dof; ++d) sum(t, d, column(0, d), row, dt, begin, end, column(1, d));
      }
      if (is_taken) slope(t, i > 0 ? 1 : 0, i, begin, end);
    }
    if (!last_is_solution)
      for (int d = 0; d < dof; ++d) sum(t, d, column(0, d), solution, dt, t.begin, t.end, column(1, d));
  }

  void measure(const Tile& t, double dt, double atol, double rtol, NormType norm, bool estimate, Sums& sums) const {
    const PetscInt at = t.own_begin - t.from, count = t.own_end - t.own_begin;
    for (int d = 0; d < dof; ++d) {
      const double* const u = column(1, d) + at;
      if (estimate) {
        double* const e = column(0, d);  // u itself is not needed any more
        sum(t, d, zeros.data(), error, dt, t.own_begin, t.own_end, e);
        if (norm == NORM_INFINITY) {
          for (PetscInt i = 0; i < count; ++i) {
            const double size = std::max(std::abs(u[i]), std::abs(u[i] - e[at + i]));
            sums.largest = std::max(sums.largest, std::abs(e[at + i]) / (atol + rtol * size));
          }
        } else {
          sums.squares += square({u, e + at, atol, rtol, count});
        }
      }
      if (!estimate || norm == NORM_INFINITY)
        for (PetscInt i = 0; i < count; ++i) sums.not_finite += u[i] - u[i];
    }
  }

  Outcome take(Vec u, double dt, double atol, double rtol, NormType norm, bool estimate, Vec u_new,
               const std::vector<VecHandle>& slopes, Vec last_slope) const {
    const bool last_wanted = !last_is_solution || estimate || !slopes.empty() || last_slope;
    const int taken = last_wanted ? stages : stages - 1;
    const double *a, *halo = nullptr;
    double *b, *last = nullptr;
    std::vector<double*> k(slopes.size());
    if (scatter) {
      fetch(u);
      SS_TRY(VecGetArrayRead(fetched, &halo));
    }
    SS_TRY(VecGetArrayRead(u, &a));
    SS_TRY(VecGetArrayWrite(u_new, &b));
    for (std::size_t i = 0; i < k.size(); ++i) SS_TRY(VecGetArrayWrite(slopes[i], &k[i]));
    if (last_slope) SS_TRY(VecGetArrayWrite(last_slope, &last));
    Sums sums;
    const PetscInt reach = taken * half_width, tiles = closed ? 1 : (local + tile_nodes - 1) / tile_nodes;
    for (PetscInt j = 0; j < tiles; ++j) {
      const PetscInt begin = share(j, tiles), end = share(j + 1, tiles);
      const Tile tile = closed ? Tile{low, high, 0, local, low, high}
                               : Tile{begin, end, begin, end, std::max(begin - reach, low), std::min(end + reach, high)};
      load(tile, a, halo);
      through(tile, dt, taken);
      store(tile, 1, b);
      for (std::size_t i = 0; i < k.size(); ++i) store(tile, 2 + static_cast<int>(i), k[i]);
      if (last) store(tile, 1 + stages, last);
      measure(tile, dt, atol, rtol, norm, estimate, sums);
    }
    if (last_slope) SS_TRY(VecRestoreArrayWrite(last_slope, &last));
    for (std::size_t i = 0; i < k.size(); ++i) SS_TRY(VecRestoreArrayWrite(slopes[i], &k[i]));
    SS_TRY(VecRestoreArrayWrite(u_new, &b));
    SS_TRY(VecRestoreArrayRead(u, &a));
    if (scatter) SS_TRY(VecRestoreArrayRead(fetched, &halo));
    model.count_evaluations(taken);
    return outcome(sums, norm, estimate);
  }

  Outcome outcome(const Sums& sums, NormType norm, bool estimate) const {
    double total[2] = {sums.squares, sums.not_finite}, largest = sums.largest;
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, total, 2, MPI_DOUBLE, MPI_SUM, model.comm()));
    if (norm == NORM_INFINITY) SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, model.comm()));
    Outcome result{std::isfinite(total[0]) && std::isfinite(total[1]), -1};
    if (estimate) result.error = norm == NORM_INFINITY ? largest : std::sqrt(total[0] / double(n * dof));
    return result;
  }
};

FusedStep::FusedStep(const Model& model, const RungeKutta& method, bool sticking)
    : impl_(std::make_unique<Impl>(model, method, sticking)) {}
FusedStep::~FusedStep() = default;
FusedStep::FusedStep(FusedStep&&) noexcept = default;

FusedStep::Outcome FusedStep::take(Vec u, double dt, double atol, double rtol, NormType norm, bool estimate, Vec u_new,
                                   const std::vector<VecHandle>& slopes, Vec last_slope) const {
  return impl_->take(u, dt, atol, rtol, norm, estimate, u_new, slopes, last_slope);
}
void FusedStep::set_direction(const std::vector<double>& direction) { impl_->set_direction(direction); }
bool FusedStep::last_is_solution() const { return impl_->last_is_solution; }

}  // namespace stickslip
