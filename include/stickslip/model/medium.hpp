// What of a scene's coefficients differs along x: unequal blocks and springs of a chain (model_m_profile,
// model_k0_profile, model_k1_profile, model_zeta_profile), layers of the continuum (model_c_profile,
// model_delta_profile).
//
// At node i the equations have A_i, B_i, K0_i, (s delta)_i of their own, and in the place of K1 D2 psi
//     L_{i+1/2} (psi_{i+1} - psi_i) - L_{i-1/2} (psi_i - psi_{i-1}),    L = K1, over h^2 in the continuum,
// of order 2 and conservative: what one node loses its neighbour gains. A spring of the chain lies at i + 1/2
// and has the k1 of that place; in the continuum c is that of the place half-way between two nodes, and where
// c jumps between them c^2 is its harmonic mean, with which flux and psi stay continuous there. A node on the
// jump itself has either c on its own side.
//
// Nothing here communicates.
#pragma once

#include <map>
#include <string>

#include "stickslip/model/profile.hpp"

namespace stickslip {

struct NodeCoefficients {
  double A, B, K0, s_delta;
};

struct Medium {
  std::map<std::string, ProfileAlongX> profiles;  // by the option that each stands for: model_m, ...

  bool varies() const { return !profiles.empty(); }
  // nullptr where the quantity is the same everywhere
  const ProfileAlongX* profile(const char* name) const;
  bool links_differ() const { return profile("model_k1") || profile("model_c"); }
  bool nodes_differ() const { return profiles.size() > (links_differ() ? 1 : 0); }
  // Throws std::logic_error where the quantity differs along x, so that there is no one number to be had.
  void ask_same(const char* name) const {
    if (varies()) refuse_varying(name);
  }

 private:
  void refuse_varying(const char* name) const;
};

}  // namespace stickslip
