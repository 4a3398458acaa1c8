// A scene: the physical problem with its grid, ends and start, as plain checked values, alike on every rank.
// Nothing here communicates.
//
// Every form of the model is one semi-discrete system (per node; B and delta are never both non-zero)
//     psi_t = A [eta + N D2 psi - B psi - F(psi, state) - c3 psi |psi|]
//     eta_t = K0 (v - psi) + K1 D2 psi - s delta [eta + N D2 psi - F(psi, state) - c3 psi |psi|]
//     state_t = g(psi, state)                       only with a state law
// continuum: A = gamma, B = 0, K0 = 1/gamma, K1 = c^2/gamma, N = nu/gamma;  chain: A = f0/m, B = zeta/f0, K0
// = k0/f0, K1 = k1/f0, N = nu/f0, delta = 0. psi: sliding velocity, eta: force over the friction amplitude.
// nu is the viscosity between neighbours, 0 by default: then N D2 psi is not computed at all. In the massless
// chain (m = 0) the first equation is B psi + F(psi, state) = eta. The drag c3 psi
// |psi| stands beside F wherever F does, also where only F is written (node_terms.hpp). With unequal
// blocks or layers (medium.hpp) A, B, K0 and s delta are those of the node, and K1 D2 psi has a K1 of its own
// between any two neighbours.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/load.hpp"
#include "stickslip/model/medium.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

enum class Form { continuum, chain };
enum class End { periodic, velocity, free };
enum class SpreadKind { uniform, lognormal };

struct Scene {
  Form form = Form::continuum;
  double gamma = 3, delta = 0.2, c = 1, v = 0.2;
  bool derived_sign = true;  // s = +1 (derived) or -1 (printed)
  double m = 1, k0 = 0.2, k1 = 0.2, f0 = 1, zeta = 0;
  double nu = 0;  // viscosity between neighbours

  FrictionParameters friction;
  double spread = 0;  // F_i = a_i F, mean of a_i is 1
  SpreadKind spread_kind = SpreadKind::uniform;
  double spread_length = 1;  // continuum: distance between independent draws
  PetscInt friction_seed = 1;
  ProfileAlongX amplitude;  // factor of a_i along x; without points: 1

  PetscInt n = 512;
  double length = 60;  // chain: n for a ring, n - 1 otherwise
  int order = 4;       // chain: 2
  End left = End::periodic, right = End::periodic;
  double left_value = 0, right_value = 0;  // psi_e of a held end
  Load load;                               // v(t), where v is not constant
  Sine force{0, 1};                        // p sin(2 pi t/T) on every node, which `load` has too: see push()
  Load normal;                             // N(t), where it is not 1: friction is N(t) F
  double linker_dieterich = 0;             // alpha: theta_t gains -alpha theta N_t/(b N)
  PetscInt copies = 1;                     // equal cells that this one stands for (reduce.hpp)
  // What of m, k0, k1, zeta, c, delta differs along x; these hold its mean over the nodes then.
  Medium medium;

  // coefficients of the one system; std::logic_error where one differs along x
  double A() const {
    medium.ask_same("model_m");
    return form == Form::continuum ? gamma : f0 / m;
  }
  double B() const {
    medium.ask_same("model_zeta");
    return form == Form::continuum ? 0 : zeta / f0;
  }
  double K0() const {
    medium.ask_same("model_k0");
    return form == Form::continuum ? 1 / gamma : k0 / f0;
  }
  double K1() const {
    medium.ask_same(form == Form::continuum ? "model_c" : "model_k1");
    return mean_K1();
  }
  double N() const { return form == Form::continuum ? nu / gamma : nu / f0; }
  double s_delta() const {
    medium.ask_same("model_delta");
    return form == Form::continuum ? (derived_sign ? delta : -delta) : 0;
  }
  // The same with the mean m, k0, k1, ... everywhere: for estimates.
  Scene averaged() const;
  double mean_K1() const { return form == Form::continuum ? c * c / gamma : k1 / f0; }
  // Those of a node; and L between node i and the next one (medium.hpp), K1 or K1/h^2. Beyond an end of a
  // line the link is that of the end, as even reflection has it.
  NodeCoefficients coefficients(PetscInt i) const;
  double link(PetscInt i) const;
  // The equations depend on time, with the corners of both loads, and with sines that have no more than one
  // extremum in smooth_time().
  bool forced() const { return load.varies() || normal.varies(); }
  double next_corner(double t) const { return std::min(load.next_corner(t), normal.next_corner(t)); }
  double smooth_time() const { return std::min(load.smooth_time(), normal.smooth_time()); }
  // The shortest time in which all sines repeat; 0 where there is none, or all have the amplitude 0. Whether
  // there is one.
  double forcing_period() const;
  bool commensurate() const;
  // How far the plate has come, and the harmonic force. This force is in `load` the velocity, over K0, of a
  // plate that exerts it, so that eta everywhere in the program is the force of springs and plate and the
  // harmonic one together; results give eta without it.
  double way(double t) const { return load.varies() ? load.integral(t) : v * t; }
  double push(double t) const { return force.amplitude == 0 ? 0 : force.at(t); }
  double push_velocity(double t) const;  // of that plate
  // N(t) in the piece that begins at t; how much the state, ln theta, of a node falls with ln N: alpha/b.
  double normal_load(double t) const { return normal.varies() ? normal(t) : 1; }
  double state_response(PetscInt i) const;
  // m = 0: A is infinite, eta = B psi + F(psi, state) holds at every moment, and psi is no unknown.
  bool massless() const { return form == Form::chain && m == 0; }
  bool ring() const { return left == End::periodic; }
  // Whether psi of a node is given at an end of the line; and whether that of any is.
  bool held(PetscInt node) const {
    return (node == 0 && left == End::velocity) || (node == n - 1 && right == End::velocity);
  }
  bool any_held() const { return left == End::velocity || right == End::velocity; }
  double h() const { return ring() ? length / double(n) : (n > 1 ? length / double(n - 1) : 1); }
  double x(PetscInt i) const { return double(i) * h(); }
  double spacing() const { return form == Form::chain ? 1 : h(); }  // that D2 is divided by the square of
  // Whether the amplitude of friction is 1 at every node; and whether friction and medium are the same
  // everywhere.
  bool unit_amplitude() const { return spread == 0 && amplitude.points().empty(); }
  bool nodes_alike() const { return unit_amplitude() && !friction.varies() && !medium.varies(); }
  // Whether friction, with what stands beside it, differs from node to node by more than a factor.
  bool laws_differ() const { return friction.varies() || (!friction.terms.none() && !unit_amplitude()); }
  bool has_profile() const { return friction.varies() || !amplitude.points().empty() || medium.varies(); }
  // The shortest length over which friction or the medium changes: of the spread and of profiles; infinite
  // where they are the same everywhere.
  double friction_length() const;

  // Builds and checks a scene; `sliding_branch`: the command looks at sliding only, so that a law is taken on
  // its exact sliding branch unless the user set friction_stick to `regularised`. Throws UsageError.
  static Scene from(const Options& options, bool sliding_branch = false);
};

// The coefficients of the nodes first .. first + count - 1, empty where all nodes have the same; and the
// links before each of them and behind the last, count + 1, empty where K1 is the same everywhere.
std::vector<NodeCoefficients> coefficients_along(const Scene& scene, PetscInt first, PetscInt count);
std::vector<double> links_along(const Scene& scene, PetscInt first, PetscInt count);

// x of the nodes first .. first + count - 1.
std::vector<double> positions(const Scene& scene, PetscInt first, PetscInt count);

// The options of family friction_ that mean nothing to this law.
std::vector<std::string> friction_options_of_other_laws(Law law);

std::string to_string(Form form);
std::string to_string(End end);

// What ties the nodes of a scene to the plate, and what friction holds them. Local, not collective.

// A harmonic force is in `Scene::load` the velocity, over K0, of a plate that exerts it. Of a chain without
// springs to the plate (k0 = 0) it acts through springs of this K0, in 1/length, whose force no motion
// changes by a digit.
inline constexpr double no_spring = 0x1p-200;

// Whether no force says where the chain is, but for held ends.
inline bool springless(const Scene& s) {
  return s.form == Form::chain && (s.medium.varies() ? s.averaged().K0() : s.K0()) <= no_spring;
}

// Of the velocity `v` of the plate in Scene::load what is the plate's own, without the harmonic force.
inline double velocity_of_plate_alone(const Scene& s, double v, double t) {
  return springless(s) ? s.v : v - s.push_velocity(t);
}

// Whether a point of the profile of the friction amplitude is 0: nodes there have no friction.
inline bool frictionless_somewhere(const Scene& s) {
  const auto& points = s.amplitude.points();
  return std::any_of(points.begin(), points.end(), [](const auto& point) { return point.second == 0; });
}

// How far a scene's springs carry what is done to one node.

// By so many nodes the springs have forgotten a force, (K0 - K1 D2) w = f: what it does there is exp(-45),
// below round-off, of what it does at its own node. Infinite without springs to the plate, 0 without those
// between neighbours.
double nodes_to_forget(const Scene& scene);

// Where friction or the medium is not smooth along x: at the places that their profiles name
// (friction_*_profile, state_*_profile, model_*_profile). A random spread is smooth to its second derivative
// everywhere and has no corners here.
//
// A solution inherits them. With what of either jumps at a corner, its value, its first or its third
// derivative, differences of any order converge like h, h^2 or h^4: a node stands for the cell around it, and
// takes its friction from one place.
//
// Nothing here communicates. Places are lengths from the scene's left end.
struct Corner {
  double x;
  int order;  // at which differences converge: 1, 2 or 4
};

// In the order of x, each place once with its lowest order; none where nothing changes, beyond a ring's seam
// or at an end.
std::vector<Corner> corners_of(const Scene& scene);

// The neighbours of a place between which no corner lies, the one behind not included where friction jumps
// there. Without a corner on that side infinite; on a ring they may lie beyond its seam. A place at a corner
// belongs to what follows it.
struct SmoothStretch {
  double from, to;
  bool jumps;  // at `to`
};
SmoothStretch stretch_around(const std::vector<Corner>& corners, const Scene& scene, double x);

// The least number of cells, up to `most`, of which a grid has a node at every corner of at most that order;
// 0 where there is none, 1 where there are no such corners.
PetscInt cells_between_corners(const std::vector<Corner>& corners, const Scene& scene, int order,
                               PetscInt most);

}  // namespace stickslip
