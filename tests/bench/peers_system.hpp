// The scenes of bench_peers and their systems on arrays.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "bench.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/options/options.hpp"

namespace peers {

using namespace stickslip;

struct Case {
  std::string name;
  Scene scene;
  double t_end;
};

inline Case case_of(const char* name, double t_end,
                    const std::vector<std::pair<const char*, const char*>>& set) {
  std::vector<Given> given = {{"grid_n", "512", ""}, {"bc_left", "free", ""}, {"bc_right", "free", ""}};
  for (const auto& [option, value] : set) {
    const auto same = [name = option](const Given& g) { return g.name == name; };
    given.erase(std::remove_if(given.begin(), given.end(), same), given.end());
    given.push_back({option, value, ""});
  }
  return {name, Scene::from(Options::from("run", given), false), t_end};
}

// As in peers.py.
inline std::vector<Case> cases() {
  return {
      case_of("smooth ring", 10, {{"grid_n", "2048"}, {"bc_left", "periodic"}, {"bc_right", "periodic"}}),
      case_of("stiff friction, gamma 300", 60, {{"model_gamma", "300"}}),
      case_of("stiff friction, gamma 10000", 5, {{"model_gamma", "10000"}}),
      case_of("stiff coupling", 10, {{"model_c", "100"}}),
      case_of("pacemaker", 20, {{"bc_left", "velocity"}, {"bc_left_value", "-1.5"}, {"grid_length", "24"}}),
      case_of("rate-and-state", 20,
              {{"friction_law", "rate-and-state"},
               {"state_law", "ageing"},
               {"friction_b", "0.07"},
               {"model_gamma", "5"},
               {"model_delta", "0"},
               {"model_v", "1"}})};
}

// One scene's system.
class System {
 public:
  explicit System(const Scene& s)
      : scene(s), model(PETSC_COMM_SELF, s), size(model.dof() * s.n), u_(model.create_vector()),
        f_(model.create_vector()) {
    const bool has_state = model.dof() == 3, held = s.left == End::velocity;
    for (PetscInt i = 0; i < s.n; ++i) {
      const double angle = 2 * M_PI * s.x(i) / s.length, wave = s.ring() ? std::sin(angle) : std::cos(angle);
      double psi = has_state ? s.v * (1 + 0.5 * wave) : 0.1 + 0.5 * wave;
      if (held) psi = 0.1 + (s.left_value - 0.1) * std::exp(-std::pow(s.x(i) / 2, 2));
      const double state = has_state ? model.steady_state(psi) : 0;
      start.push_back(psi);
      start.push_back(held ? model.friction(i, psi, 0).F : has_state ? 0.6 : 0.1);
      if (has_state) start.push_back(state);
    }
  }
  void rhs(Part part, const double* u, double* f) {
    ++evaluations;
    SS_TRY(VecPlaceArray(u_, u));
    SS_TRY(VecPlaceArray(f_, f));
    model.rhs(part, u_, f_);
    SS_TRY(VecResetArray(f_));
    SS_TRY(VecResetArray(u_));
  }

  Scene scene;
  Model model;
  PetscInt size;
  std::vector<double> start;
  long evaluations = 0;
  double deadline = HUGE_VAL;  // in processor time of this process, after which a run is given up
  bool is_late() const { return evaluations % 64 == 0 && bench::now(true) > deadline; }

 private:
  VecHandle u_, f_;
};

// (I - h J) x = b, J the Jacobian of a part of the right-hand side, whose structure is known: eta and the
// state are eliminated node by node, and what is left is a band in psi alone, half_width wide, or nothing but
// its diagonal. Only the slopes of friction differ from node to node; factors without exchanges.
class Reduced {
 public:
  Reduced(const System& system, Part part)
      : system_(system), s_(system.scene), dof_(system.model.dof()), n_(s_.n), wave_(part != Part::reaction),
        friction_(part != Part::wave), width_(part == Part::full || part == Part::wave ? s_.order / 2 : 0),
        slopes_(std::size_t(n_)), band_(std::size_t(n_ * (2 * width_ + 1))), matrix_(std::size_t(n_)) {
    rows_.assign(std::size_t(n_ * (2 * width_ + 1)), 0.);
    for (PetscInt i = 0; i < n_ && width_ > 0; ++i) {
      if (system.model.held(i)) continue;
      for (const auto& [node, weight] : second_difference_row(s_, i))
        row(rows_, i)[node - i] += s_.K1() * weight;
    }
  }

  void set_slopes(const double* u) {
    for (PetscInt i = 0; i < n_ && friction_; ++i) {
      const double psi = u[dof_ * i];
      Node& m = slopes_[std::size_t(i)];
      if (s_.friction.law == Law("cubic")) {
        m.F.F_psi = psi * psi - 1;
        continue;
      }
      m.F = system_.model.friction(i, psi, dof_ == 3 ? u[dof_ * i + 2] : 0);
      if (dof_ == 3) m.g = system_.model.state_rate(i, psi, u[dof_ * i + 2]);
    }
  }

  void factor(double h) {
    h_ = h;
    const double A = s_.A(), on = wave_ ? 1 : 0;
    for (PetscInt i = 0; i < n_; ++i) {
      const Node& m = slopes_[std::size_t(i)];
      Eliminated& e = matrix_[std::size_t(i)];
      const bool held = system_.model.held(i);
      // state = (b_s + h g_psi psi)/(1 - h g_s); slope: dF/dpsi along it
      e.own = 1 - h * m.g.g_state;
      const double slope = m.F.F_psi + m.F.F_state * h * m.g.g_psi / e.own;
      e.eta = 1 + on * h * s_.s_delta();
      e.coupling = on * h * A / e.eta;  // of b_eta in psi's equation
      double* const a = row(band_, i);
      for (int j = -width_; j <= width_; ++j) a[j] = held ? 0 : -e.coupling * h * row(rows_, i)[j];
      a[0] +=
          held ? 1
               : 1 + h * A * (on * s_.B() + slope) + e.coupling * h * (on * s_.K0() - s_.s_delta() * slope);
    }
    for (PetscInt i = 0; i < n_; ++i) {
      const double pivot = 1 / row(band_, i)[0];
      row(band_, i)[0] = pivot;
      for (PetscInt k = i + 1; k <= std::min(i + width_, n_ - 1); ++k) {
        const double l = row(band_, k)[i - k] * pivot;
        row(band_, k)[i - k] = l;
        for (PetscInt j = i + 1; j <= std::min(i + width_, n_ - 1); ++j)
          row(band_, k)[j - k] -= l * row(band_, i)[j - i];
      }
    }
  }

  // b becomes x.
  void solve(double* b) {
    const double A = s_.A(), on = wave_ ? 1 : 0;
    std::vector<double>& psi = work_;
    psi.resize(std::size_t(n_));
    for (PetscInt i = 0; i < n_; ++i) {
      const Node& m = slopes_[std::size_t(i)];
      const Eliminated& e = matrix_[std::size_t(i)];
      const bool held = system_.model.held(i);
      const double state = dof_ == 3 ? b[dof_ * i + 2] / e.own : 0, force = m.F.F_state * state;
      const double eta = b[dof_ * i + 1] + h_ * s_.s_delta() * force;
      psi[std::size_t(i)] = held ? b[dof_ * i] : b[dof_ * i] - h_ * A * force + e.coupling * eta;
      for (PetscInt k = std::max(i - width_, PetscInt(0)); k < i; ++k)
        psi[std::size_t(i)] -= row(band_, i)[k - i] * psi[std::size_t(k)];
    }
    for (PetscInt i = n_ - 1; i >= 0; --i) {
      for (PetscInt k = i + 1; k <= std::min(i + width_, n_ - 1); ++k)
        psi[std::size_t(i)] -= row(band_, i)[k - i] * psi[std::size_t(k)];
      psi[std::size_t(i)] *= row(band_, i)[0];
    }
    for (PetscInt i = 0; i < n_; ++i) {
      const Node& m = slopes_[std::size_t(i)];
      const Eliminated& e = matrix_[std::size_t(i)];
      const double x = psi[std::size_t(i)];
      b[dof_ * i] = x;
      double state = 0;
      if (dof_ == 3) state = b[dof_ * i + 2] = (b[dof_ * i + 2] + h_ * m.g.g_psi * x) / e.own;
      if (system_.model.held(i) && s_.form == Form::continuum) continue;
      double pull = 0;
      for (PetscInt k = std::max(i - width_, PetscInt(0)); k <= std::min(i + width_, n_ - 1); ++k)
        pull += row(rows_, i)[k - i] * psi[std::size_t(k)];
      const double force = m.F.F_psi * x + m.F.F_state * state;
      b[dof_ * i + 1] = (b[dof_ * i + 1] + h_ * (pull - on * s_.K0() * x + s_.s_delta() * force)) / e.eta;
    }
  }

 private:
  struct Node {
    Partials F{};
    RatePartials g{};
  };
  struct Eliminated {
    double own, eta, coupling;
  };
  // Entry j of row i stands at row(...)[j - i].
  double* row(std::vector<double>& a, PetscInt i) const {
    return &a[std::size_t(i * (2 * width_ + 1) + width_)];
  }

  const System& system_;
  const Scene& s_;
  int dof_;
  PetscInt n_;
  bool wave_, friction_;
  PetscInt width_;
  double h_ = 0;
  std::vector<Node> slopes_;
  std::vector<double> rows_, band_, work_;
  std::vector<Eliminated> matrix_;
};

}  // namespace peers
