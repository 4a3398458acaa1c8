// The columns of a law (kernel.hpp), compiled for its class.
#pragma once

#include <cstdint>

#include "model/dispatch.hpp"
#include "model/kernel.hpp"

namespace stickslip {

namespace kernel {

// Friction of its own at every node. friction_of() hands a law that is the same for all on as it is.
template <class Own>
struct Varying {
  static constexpr bool has_state = Own::has_state, sticks = Own::sticks, steep = Own::steep,
                        gives_velocity = Own::gives_velocity, looks_up = false;
  std::shared_ptr<const std::vector<Own>> nodes;
};
template <class F>
const F& friction_of(const F& friction, PetscInt) {
  return friction;
}
template <class F>
const F& friction_of(const Varying<F>& friction, PetscInt node) {
  return (*friction.nodes)[std::size_t(node)];
}

// Behind its virtual functions: terms stand beside it. One for all nodes, or one each.
template <bool state, bool is_steep>
struct AnyFriction {
  static constexpr bool has_state = state, sticks = true, steep = is_steep, gives_velocity = false,
                        looks_up = false;
  std::shared_ptr<const std::vector<std::shared_ptr<const Friction>>> nodes;
};
template <bool state, bool steep>
const Friction& friction_of(const AnyFriction<state, steep>& friction, PetscInt node) {
  return *(*friction.nodes)[friction.nodes->size() == 1 ? 0 : std::size_t(node)];
}

// The direction of node i, 0 at rest; without `sticking` nobody asks for it.
template <bool sticking>
double direction_at(const double* direction, PetscInt i) {
  if constexpr (sticking)
    return direction[i];
  else
    return 0;
}
// F, the state's rate and their slopes. `sticking`: of the direction given.
template <bool sticking, class F>
Partials partials_at(const F& friction, double psi, double s, double direction) {
  if constexpr (sticking)
    return friction.sliding_partials(psi, s, direction);
  else
    return friction.partials(psi, s);
}
template <bool sticking, class F>
RatePartials rate_at(const F& friction, double psi, double s, double direction) {
  if constexpr (sticking)
    return friction.sliding_rate(psi, s, direction);
  else
    return friction.rate_partials(psi, s);
}

// F of a law that is looked up: between two loops of vector code one that is none, since a node's entry, one
// line of memory, is sooner read than gathered number by number.
template <bool sticking, class F>
void looked_up_force(const F& friction, const LawTile& t, double* force) {
  alignas(64) double sign[tile_size], speed[tile_size];
  alignas(64) std::int64_t bucket[tile_size];
  for (PetscInt i = 0; i < t.count; ++i) {
    const auto place = friction.template with_sign<sticking>(
        direction_at<sticking>(t.direction, i), [&](auto s) { return friction.law.place(t.psi[i], s); });
    sign[i] = place.sign;
    speed[i] = place.speed;
    bucket[i] = place.bucket;
  }
  for (PetscInt i = 0; i < t.count; ++i) {
    std::int64_t number = bucket[i];
    asm("" : "+r"(number));  // no gather
    force[i] = friction.law.looked_up(speed[i], number);
  }
  for (PetscInt i = 0; i < t.count; ++i) {
    force[i] *= sign[i];
    if constexpr (F::has_state) force[i] *= friction.template factor<double>(t.state[i]).value;
  }
}

template <class F, bool sticking>
struct LawRates {
  F friction;

  void operator()(const LawTile& tile, const LawValues& values) const {
    const LawTile t = tile;
    const LawValues v = values;
    const F law = friction;  // copies, which no store can change
    if constexpr (F::looks_up) {
      looked_up_force<sticking>(law, t, v.F);
    } else {
#pragma GCC ivdep
      for (PetscInt i = 0; i < t.count; ++i)
        v.F[i] = partials_at<sticking>(friction_of(law, t.node + i), t.psi[i], F::has_state ? t.state[i] : 0,
                                       direction_at<sticking>(t.direction, i))
                     .F;
    }
    if constexpr (F::has_state)
#pragma GCC ivdep
      for (PetscInt i = 0; i < t.count; ++i)
        v.g[i] = rate_at<sticking>(friction_of(law, t.node + i), t.psi[i], t.state[i],
                                   direction_at<sticking>(t.direction, i))
                     .g;
  }
};

template <class F, bool sticking>
struct LawPartials {
  F friction;

  void operator()(const LawTile& tile, const LawValues& values) const {
    const LawTile t = tile;
    const LawValues v = values;
    const F law = friction;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i) {
      const Partials p = partials_at<sticking>(friction_of(law, t.node + i), t.psi[i],
                                               F::has_state ? t.state[i] : 0,
                                               direction_at<sticking>(t.direction, i));
      v.F[i] = p.F;
      v.F_psi[i] = p.F_psi;
      if constexpr (F::has_state) v.F_state[i] = p.F_state;
    }
    if constexpr (F::has_state)
#pragma GCC ivdep
      for (PetscInt i = 0; i < t.count; ++i) {
        const RatePartials g = rate_at<sticking>(friction_of(law, t.node + i), t.psi[i], t.state[i],
                                                 direction_at<sticking>(t.direction, i));
        v.g[i] = g.g;
        v.g_psi[i] = g.g_psi;
        v.g_state[i] = g.g_state;
      }
  }
};

template <class F>
struct LawNewton {
  F friction;

  void operator()(const LawSteps& steps) const {
    const LawSteps t = steps;
    const F law = friction;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i)
      t.psi_next[i] = friction_of(law, t.node + i)
                          .newton_psi(t.psi[i], t.state[i], t.psi_new[i], t.state_new[i], t.mass[i]);
  }
};

template <class F>
struct LawVelocityLoop {
  F friction;

  void operator()(const LawTile& tile, const LawVelocities& values) const {
    const LawTile t = tile;
    const LawVelocities v = values;
    const F law = friction;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i) {
      const auto& own = friction_of(law, t.node + i);
      const VelocityOfForce of = own.velocity(t.psi[i], t.state[i]);
      v.psi[i] = of.psi;
      v.psi_y[i] = of.by_y;
      v.psi_state[i] = of.by_state;
      v.a[i] = own.law.a;
    }
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i)
      v.g[i] = friction_of(law, t.node + i).rate_partials(v.psi[i], t.state[i]).g;
  }
};

template <class F>
struct LawForceOverA {
  F friction;

  void operator()(const LawTile& tile, double* const& y) const {
    const LawTile t = tile;
    double* const into = y;
    const F law = friction;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i) {
      const auto& own = friction_of(law, t.node + i);
      into[i] = own.partials(t.psi[i], t.state[i]).F / own.law.a;
    }
  }
};

// `versions`: for every set of instructions.
template <bool versions, class Function, class Loop>
Function chosen(const Loop& loop) {
  if constexpr (versions)
    return compiled<Function>(loop);
  else
    return Baseline<Loop>{loop};
}
// Laws without a state, and those that live by exp and log, come in all versions; the others, and friction
// that differs from node to node, would gain little by them, and each takes a second to compile.
template <class F>
constexpr bool worth_versions = !F::has_state || F::steep;
template <class F>
constexpr bool worth_versions<Varying<F>> = false;
template <bool... flags>
constexpr bool worth_versions<AnyFriction<flags...>> = false;
template <bool sticking, class F>
LawColumns columns_of(const F& friction, bool smoothed) {
  constexpr bool versions = worth_versions<F>;
  LawColumns columns;
  columns.has_state = F::has_state;
  columns.steep = F::steep;
  columns.smoothed = smoothed;
  columns.rates = chosen<versions, LawColumns::Take>(LawRates<F, sticking>{friction});
  columns.partials = chosen<versions, LawColumns::Take>(LawPartials<F, sticking>{friction});
  if constexpr (F::steep && !sticking)
    columns.newton_psi = chosen<versions, LawColumns::Step>(LawNewton<F>{friction});
  if constexpr (F::gives_velocity && !sticking) {
    columns.velocities = chosen<versions, LawColumns::Velocities>(LawVelocityLoop<F>{friction});
    columns.force_over_a = chosen<versions, LawColumns::Ratios>(LawForceOverA<F>{friction});
  }
  return columns;
}

}  // namespace kernel

struct LawFamily {
  using Make = kernel::LawColumns (*)(const FrictionParameters&, bool sticking, const FrictionPlaces&);
  static LawTable<Make>& table();

  template <class L, class S>
  static kernel::LawColumns make(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
    return with_friction<L, S>(p, [&](const auto& friction) {
      using F = std::decay_t<decltype(friction)>;
      return with_flags(
          [&](auto sticks) -> kernel::LawColumns {
            const bool smoothed = jumps_at_rest<L>() && p.regularised;
            if constexpr (sticks && !F::sticks) {
              throw std::logic_error("law " + p.law->name + " does not stick");
            } else {
              if (places.empty()) return kernel::columns_of<sticks>(friction, smoothed);
              auto nodes = std::make_shared<const std::vector<F>>(frictions_along(friction, p, places));
              return kernel::columns_of<sticks>(kernel::Varying<F>{std::move(nodes)}, smoothed);
            }
          },
          sticking);
    });
  }
};

}  // namespace stickslip
