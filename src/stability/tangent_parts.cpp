#include "stability/tangent_parts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "numerics/tableau.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

// The six stages of the step of order 5: Dormand and Prince 1980.
const StageProgram& dormand_prince() {
  // clang-format off
  static const StageProgram method = {6,
      {0, 0, 0, 0, 0, 0,
       1. / 5, 0, 0, 0, 0, 0,
       3. / 40, 9. / 40, 0, 0, 0, 0,
       44. / 45, -56. / 15, 32. / 9, 0, 0, 0,
       19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729, 0, 0,
       9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656, 0},
      {35. / 384, 0, 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84}, {}};
  // clang-format on
  return method;
}

const StageProgram& kennedy_carpenter() {
  static const StageProgram method = ImexMethod("4").tableau();
  return method;
}

// Where stage i lies in the step.
double place(const StageProgram& m, int i) {
  const double* const row = &m.A[i * m.stages];
  return std::accumulate(row, row + i, 0.);
}

// A component that is so much smaller in one vector than in others is round-off of these.
constexpr double round_off = 1e-6;

}  // namespace

Vec TangentParts::scratch(std::size_t i) {
  make_room(dormand_prince(), 1);
  return slopes_[0].f[i];
}

void TangentParts::make_room(const StageProgram& method, std::size_t vectors) {
  if (!u_) {
    u_ = model_.create_vector();
    stage_ = model_.create_vector();
  }
  slopes_.resize(std::max(slopes_.size(), vectors));
  for (std::size_t k = 0; k < vectors; ++k) {
    while (slopes_[k].f.size() < std::size_t(method.stages)) slopes_[k].f.push_back(model_.create_vector());
    while (method.additive() && slopes_[k].g.size() < std::size_t(method.stages))
      slopes_[k].g.push_back(model_.create_vector());
  }
}

void TangentParts::clear_held(double* y) const {
  for (PetscInt i = 0; i < model_.local(); ++i)
    if (model_.held(model_.first() + i)) y[i * dof_] = y[i * dof_ + 1] = 0;
}

// ---- J

// What a node's own psi does to its rate by viscosity between neighbours, which is not in its block.
double TangentParts::own_viscous_slope(PetscInt i) const {
  const Scene& s = model_.scene();
  for (const auto& [node, entry] : second_difference_row(s, model_.first() + i))
    if (node == model_.first() + i) return s.A() * s.N() * entry;
  return 0;
}

void TangentParts::linearise(Vec u, Linearisation& at) const {
  const Reading a(u);
  at.blocks.resize(model_.local());
  at.trace = at.rate = 0;
  for (PetscInt i = 0; i < model_.local(); ++i) {
    const bool held = model_.held(model_.first() + i);
    const bool moves = !held && !(model_.direction() && model_.direction()[i] == 0);
    if (model_.viscous() && moves) at.trace += own_viscous_slope(i);
    NodeBlock& b = at.blocks[i];
    b = model_.node_block(Part::full, i, a + i * dof_);
    at.trace += b.psi_psi + b.eta_eta + b.state_state;
    at.rate = std::max({at.rate, std::abs(b.psi_psi) + std::abs(b.eta_eta), std::abs(b.state_state),
                        std::sqrt(std::abs(b.psi_state * b.state_psi))});
    if (held) b = {0, 0, 0, 0, 0, 0, 0, b.state_state};
  }
}

double TangentParts::rate_until(Vec u) {
  linearise(u, inside_);
  return largest_over(model_.comm(), std::max(start_.rate, inside_.rate));
}

// into += B y
void TangentParts::add_blocks(const Linearisation& at, Vec y, Vec into) const {
  const Reading a(y);
  const Writing f(into);
  for (PetscInt i = 0; i < model_.local(); ++i) {
    const NodeBlock& b = at.blocks[i];
    const double* in = a + i * dof_;
    double* const out = f + i * dof_;
    out[0] += b.psi_psi * in[0] + b.psi_eta * in[1];
    out[1] += b.eta_psi * in[0] + b.eta_eta * in[1];
    if (dof_ == 2) continue;
    out[0] += b.psi_state * in[2];
    out[1] += b.eta_state * in[2];
    out[2] += b.state_psi * in[0] + b.state_state * in[2];
  }
}

void TangentParts::factor(const Linearisation& at, double theta) {
  factors_.resize(at.blocks.size());
  for (std::size_t i = 0; i < at.blocks.size(); ++i) {
    const NodeBlock& b = at.blocks[i];
    Eigen::Matrix3d B;
    B << b.psi_psi, b.psi_eta, b.psi_state, b.eta_psi, b.eta_eta, b.eta_state, b.state_psi, 0, b.state_state;
    factors_[i].compute(Eigen::Matrix3d::Identity() - theta * B);
  }
}

// y becomes (1 - theta B)^-1 y.
void TangentParts::solve(Vec y) const {
  const Writing a(y);
  for (std::size_t i = 0; i < factors_.size(); ++i) {
    Eigen::Vector3d node = Eigen::Vector3d::Zero();
    std::copy_n(a + i * dof_, dof_, node.data());
    node = factors_[i].solve(node).eval();
    std::copy_n(node.data(), dof_, a + i * dof_);
  }
}

// ---- stages

void TangentParts::add_slopes(Vec to, const Slopes& slopes, int count, double h, const double* f,
                              const double* g) const {
  std::vector<double> weights;
  std::vector<Vec> terms;
  for (int j = 0; j < count; ++j) {
    weights.push_back(h * f[j]);
    terms.push_back(slopes.f[j]);
    if (!g) continue;
    weights.push_back(h * g[j]);
    terms.push_back(slopes.g[j]);
  }
  SS_TRY(VecMAXPY(to, PetscInt(terms.size()), weights.data(), terms.data()));
}

// The slopes of stage i of one vector. Of an implicit stage the slope g is what its equation says, so that a
// stiff block does not magnify round-off.
void TangentParts::take_stage(const StageProgram& m, int i, double h, const Linearisation& at, Vec y,
                              Slopes& k) {
  const int row = i * m.stages;
  SS_TRY(VecCopy(y, stage_));
  if (i > 0) add_slopes(stage_, k, i, h, &m.A[row], m.additive() ? &m.At[row] : nullptr);
  if (m.additive()) {
    const double theta = h * m.At[row + i];
    if (theta == 0) {
      SS_TRY(VecZeroEntries(k.g[i]));
      add_blocks(at, stage_, k.g[i]);
    } else {
      SS_TRY(VecCopy(stage_, k.g[i]));
      solve(stage_);
      SS_TRY(VecAXPBY(k.g[i], 1 / theta, -1 / theta, stage_));
    }
  }
  model_.rhs(Part::stencil, stage_, k.f[i]);
  model_.count_evaluations(-1);
  if (!m.additive()) add_blocks(at, stage_, k.f[i]);
  clear_held(Writing(k.f[i]));
}

// The slopes of all vectors; behind it inside_ is at the end of the part. Returns the integral of the trace.
double TangentParts::take_stages(const StageProgram& m, const StepPart& part, const Inside& inside,
                                 const std::vector<Vec>& y) {
  make_room(m, y.size());
  const double h = part.length * part.dt;
  double trace = 0;
  for (int i = 0; i < m.stages; ++i) {
    if (i > 0) {
      inside(
          i == m.stages - 1 ? std::min(1., part.begin + part.length) : part.begin + place(m, i) * part.length,
          u_);
      linearise(u_, inside_);
    }
    const Linearisation& at = i == 0 ? start_ : inside_;
    trace += h * m.b[i] * at.trace;
    if (m.additive() && m.At[i * (m.stages + 1)] != 0) factor(at, h * m.At[i * (m.stages + 1)]);
    for (std::size_t k = 0; k < y.size(); ++k)
      if (y[k]) take_stage(m, i, h, at, y[k], slopes_[k]);
  }
  return trace;
}

double TangentParts::explicit_part(const StepPart& part, const Inside& inside, const std::vector<Vec>& y) {
  const StageProgram& m = dormand_prince();
  const double trace = take_stages(m, part, inside, y);
  for (std::size_t k = 0; k < y.size(); ++k)
    if (y[k]) add_slopes(y[k], slopes_[k], m.stages, part.length * part.dt, m.b.data(), nullptr);
  keep();
  return trace;
}

TangentParts::Tried TangentParts::implicit_part(const StepPart& part, const Inside& inside,
                                                const std::vector<Vec>& y, const std::vector<Vec>& next) {
  const StageProgram& m = kennedy_carpenter();
  const double h = part.length * part.dt, trace = take_stages(m, part, inside, y);
  std::vector<double> f(m.stages), g(m.stages);  // weights of the error
  for (int j = 0; j < m.stages; ++j) {
    f[j] = m.b[j] - m.embedded[j];
    g[j] = m.bt[j] - m.embedded_t[j];
  }
  std::vector<double> squares(std::size_t(3) * dof_ * y.size(), 0.);  // of the error, before, after
  for (std::size_t k = 0; k < y.size(); ++k) {
    if (!y[k]) continue;
    SS_TRY(VecCopy(y[k], next[k]));
    add_slopes(next[k], slopes_[k], m.stages, h, m.b.data(), m.bt.data());
    SS_TRY(VecZeroEntries(stage_));
    add_slopes(stage_, slopes_[k], m.stages, h, f.data(), g.data());
    solve(stage_);
    const Reading error(stage_), before(y[k]), after(next[k]);
    double* const sums = &squares[std::size_t(3) * dof_ * k];
    for (PetscInt i = 0; i < model_.local() * dof_; ++i) {
      double* const sum = sums + 3 * (i % dof_);
      sum[0] += error[i] * error[i];
      sum[1] += before[i] * before[i];
      sum[2] += after[i] * after[i];
    }
  }
  sum_over(model_.comm(), squares.data(), int(squares.size()));
  double worst = 0;
  for (int d = 0; d < dof_; ++d) {
    double largest = 0;
    for (std::size_t j = d; j < dof_ * y.size(); j += dof_)
      largest = std::max({largest, squares[3 * j + 1], squares[3 * j + 2]});
    for (std::size_t j = d; j < dof_ * y.size(); j += dof_) {
      const double scale =
          std::max({squares[3 * j + 1], squares[3 * j + 2], round_off * round_off * largest});
      if (squares[3 * j] > 0) worst = std::max(worst, std::sqrt(squares[3 * j] / scale));
      if (!std::isfinite(squares[3 * j])) worst = std::numeric_limits<double>::infinity();
    }
  }
  return {worst, trace};
}

}  // namespace stickslip
