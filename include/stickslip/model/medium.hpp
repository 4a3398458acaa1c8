// What of a scene differs along x: profiles, and the medium that is made of some.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace stickslip {

// A quantity that is given at some places along x, and what holds between them.
//
//     linear   straight from one place to the next
//     smooth   from value to value like 10 s^3 - 15 s^4 + 6 s^5: two continuous derivatives, flat at every
//              place given
//     step     a value holds from its place to the next one
// Between two places no value lies beyond theirs. Two values at one place make a jump: the second holds from
// there on. Before the first place and behind the last their values hold; on a ring the last place goes on to
// the first.
//
// Nothing here communicates. x is a length; a value has the unit of the quantity.

enum class Between { linear, smooth, step };

class ProfileAlongX {
 public:
  ProfileAlongX() = default;
  // Places ascend, each at most twice. `period`: of a ring, 0 where there is none.
  ProfileAlongX(std::vector<std::pair<double, double>> points, Between between, double period = 0);

  double at(double x) const;
  const std::vector<std::pair<double, double>>& points() const { return points_; }
  bool is_constant() const;
  // Where the value jumps, in the order of x; on a ring a jump from the last place to the first is one, too.
  std::vector<double> jumps() const;
  // The smallest and the largest value.
  std::pair<double, double> range() const;
  // The shortest distance over which the value changes from one place to another, a jump aside; infinite
  // where none does. What a grid has to resolve.
  double shortest() const;

 private:
  std::vector<std::pair<double, double>> points_;
  Between between_ = Between::linear;
  double period_ = 0, snap_ = 0;  // snap_: a place that x misses by so little is met
};

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
