// Friction as the loops over nodes take it: a law says what it is for a tile of nodes, in columns, and the
// loops (kernel.hpp, implicit_kernel.hpp, loops.hpp) know no law. Who has friction to give is a
// class, the `Source` of a loop: ByColumns of any law, Within of one so cheap that a column on the way costs
// more than the law itself, NoFriction.
#pragma once

#include <petscsys.h>

#include <functional>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "stickslip/model/friction.hpp"

namespace stickslip::kernel {

constexpr PetscInt tile_size = 128;  // nodes whose values stay in the first-level cache

// Nodes side by side.
struct LawTile {
  const double *psi, *state;  // state: not read without one
  const double* direction;    // of motion, of laws that stick: 1, -1, 0 at rest
  PetscInt count;
  PetscInt node = 0;  // number of the first, for friction that varies
};
// What is asked of them: F, the state's rate g, and their slopes. All but F and F_psi: with a state alone.
struct LawValues {
  double *F, *F_psi, *F_state, *g, *g_psi, *g_state;
};
// Friction::newton_psi() of nodes.
struct LawSteps {
  const double *psi, *state, *psi_new, *state_new, *mass;
  double* psi_next;
  PetscInt count, node;
};

struct LawColumns {
  bool has_state = false, steep = false, smoothed = false;  // smoothed: a threshold that is regularised
  using Take = std::function<void(const LawTile&, const LawValues&)>;
  using Step = std::function<void(const LawSteps&)>;
  Take rates, partials;  // rates: F and g alone
  Step newton_psi;       // where it is steep
};
// Of the law with its parameters. `sticking`: with the direction of motion given, for laws that stick.
// `places`: friction_places() of the nodes by their numbers.
LawColumns law_columns(const FrictionParameters& friction, bool sticking, const FrictionPlaces& places);

// ---- the sources
//
// Each has Values, room for a tile, and rates() and partials(), which return what says of the i-th node of a
// tile force(i) and rate(i), or partials(i) and rate_partials(i).

template <bool state, bool is_steep, bool is_sticking>
struct ByColumns {
  static constexpr bool has_state = state, steep = is_steep, sticking = is_sticking, in_tiles = true;
  LawColumns law;

  struct Values {
    alignas(64) double F[tile_size], F_psi[tile_size];
    alignas(64) double F_state[state ? tile_size : 1], g[state ? tile_size : 1];
    alignas(64) double g_psi[state ? tile_size : 1], g_state[state ? tile_size : 1];
  };
  struct Reader : LawValues {
    double force(PetscInt i) const { return F[i]; }
    double rate(PetscInt i) const { return g[i]; }
    Partials partials(PetscInt i) const { return {F[i], F_psi[i], state ? F_state[i] : 0}; }
    RatePartials rate_partials(PetscInt i) const { return {g[i], g_psi[i], g_state[i]}; }
  };
  Reader rates(const LawTile& tile, Values& v) const {
    const Reader reader = reader_of(v);
    law.rates(tile, reader);
    return reader;
  }
  Reader partials(const LawTile& tile, Values& v) const {
    const Reader reader = reader_of(v);
    law.partials(tile, reader);
    return reader;
  }
  void newton_psi(const LawSteps& steps) const { law.newton_psi(steps); }
  bool smoothed() const { return law.smoothed; }

 private:
  static Reader reader_of(Values& v) { return {{v.F, v.F_psi, v.F_state, v.g, v.g_psi, v.g_state}}; }
};

// Of a class F of law.hpp without a state.
template <class F, bool is_sticking, bool is_smoothed>
struct Within {
  static constexpr bool has_state = false, steep = false, sticking = is_sticking, in_tiles = false;
  F law;

  struct Values {};
  struct Reader {
    F law;
    const double *psi, *direction;
    double force(PetscInt i) const { return partials(i).F; }
    Partials partials(PetscInt i) const {
      if constexpr (is_sticking)
        return law.sliding_partials(psi[i], 0, direction[i]);
      else
        return law.partials(psi[i], 0.);
    }
  };
  Reader rates(const LawTile& tile, Values&) const { return {law, tile.psi, tile.direction}; }
  Reader partials(const LawTile& tile, Values& v) const { return rates(tile, v); }
  bool smoothed() const { return is_smoothed; }
};

// For what is linear alone.
template <bool state>
struct NoFriction {
  static constexpr bool has_state = state, steep = false, sticking = false, in_tiles = false;
  struct Values {};
  struct Reader {
    double force(PetscInt) const { return 0; }
    double rate(PetscInt) const { return 0; }
  };
  Reader rates(const LawTile&, Values&) const { return {}; }
};

// ---- the coefficients of nodes
//
// The other thing that a loop is given: all nodes have those of the scene, or each its own.
struct SameMedium {
  static constexpr bool differs = false;
  template <class Coefficients>
  const Coefficients& at(const Coefficients& c, PetscInt) const {
    return c;
  }
};
struct OwnMedium {
  static constexpr bool differs = true;
  std::shared_ptr<const std::vector<NodeCoefficients>> nodes;
  template <class Coefficients>
  Coefficients at(const Coefficients& c, PetscInt node) const {
    const NodeCoefficients& own = (*nodes)[std::size_t(node)];
    return {own.A, c.linear * own.B, c.linear * own.K0, c.v, own.s_delta, {}};
  }
};

}  // namespace stickslip::kernel
