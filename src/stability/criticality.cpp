#include "stickslip/stability/boundary.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include <Eigen/LU>

#include "stickslip/model/model.hpp"

namespace stickslip {

namespace {

using Vector = std::vector<NodeVector>;

// What friction and the state's rate add to the rates of a node at second and third order.
class NodeForms {
 public:
  NodeForms(const LinearPoint& p, double amplitude, const HigherPartials& d)
      : to_psi_(-p.A * amplitude), to_eta_(p.s_delta * amplitude), d_(d) {}

  NodeVector second(const NodeVector& x, const NodeVector& y) const {
    return rates([&](const HigherDerivatives& d) {
      return d.pp * x.psi * y.psi + d.ps * (x.psi * y.state + x.state * y.psi) + d.ss * x.state * y.state;
    });
  }
  NodeVector third(const NodeVector& x, const NodeVector& y, const NodeVector& z) const {
    return rates([&](const HigherDerivatives& d) {
      return d.ppp * x.psi * y.psi * z.psi +
             d.pps * (x.psi * y.psi * z.state + x.psi * y.state * z.psi + x.state * y.psi * z.psi) +
             d.pss * (x.psi * y.state * z.state + x.state * y.psi * z.state + x.state * y.state * z.psi) +
             d.sss * x.state * y.state * z.state;
    });
  }

 private:
  template <class Form>
  NodeVector rates(const Form& form) const {
    const Complex F = form(d_.F);
    return {to_psi_ * F, to_eta_ * F, form(d_.g)};
  }
  double to_psi_, to_eta_;
  HigherPartials d_;
};

Complex dot(const NodeVector& x, const NodeVector& y) {
  return x.psi * y.psi + x.eta * y.eta + x.state * y.state;
}
NodeVector conjugate(const NodeVector& x) { return {std::conj(x.psi), std::conj(x.eta), std::conj(x.state)}; }
NodeVector times(Complex f, const NodeVector& x) { return {f * x.psi, f * x.eta, f * x.state}; }
void add(NodeVector& sum, Complex f, const NodeVector& x) {
  sum.psi += f * x.psi;
  sum.eta += f * x.eta;
  sum.state += f * x.state;
}

// The places at which an oscillation is held, with its vectors and the linear problem between them.
struct Line {
  double omega;
  std::vector<NodeForms> forms;
  Vector q, left;      // right and left vector of i omega
  double largest = 0;  // |psi|^2 of q at the node that moves most
  virtual Vector solve(Complex lambda, const Vector& b) const = 0;  // (lambda - J)^-1 b
  virtual ~Line() = default;
};

// l of the oscillation; NaN where it is 0 to round-off.
double lyapunov(const Line& line) {
  const std::size_t n = line.q.size();
  Vector qq(n), qc(n);
  for (std::size_t i = 0; i < n; ++i) {
    qq[i] = line.forms[i].second(line.q[i], line.q[i]);
    qc[i] = line.forms[i].second(line.q[i], conjugate(line.q[i]));
  }
  const Vector mean = line.solve(0, qc), twice = line.solve({0, 2 * line.omega}, qq);
  Complex c = 0, norm = 0;
  double size = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const NodeVector& q = line.q[i];
    const NodeVector qbar = conjugate(q);
    const Complex terms[] = {dot(line.left[i], line.forms[i].third(q, q, qbar)),
                             2. * dot(line.left[i], line.forms[i].second(q, mean[i])),
                             dot(line.left[i], line.forms[i].second(qbar, twice[i]))};
    for (const Complex& term : terms) {
      c += term;
      size += std::abs(term);
    }
    norm += dot(line.left[i], q);
  }
  constexpr double rounding = 1e-12;  // of the terms, which stem from solutions of linear systems
  if (std::abs((c / norm).real()) <= rounding * size / std::abs(norm)) return Criticality::none;
  return (c / norm).real() / (8 * line.largest);
}

// J of a wave of that kappa^2 in a medium alike everywhere, about lambda.
class WaveBlock {
 public:
  WaveBlock(const LinearPoint& medium, double kappa2, Complex lambda)
      : J_(medium.block(Part::full, kappa2)), lambda_(lambda), state_(medium.has_state) {}

  NodeVector right() const {  // J q = lambda q with q.psi = 1
    NodeVector q{1};
    if (state_) q.state = J_.state_psi / (lambda_ - J_.state_state);
    q.eta = (lambda_ - J_.psi_psi - J_.psi_state * q.state) / J_.psi_eta;
    return q;
  }
  NodeVector left() const {  // p J = lambda p with p.eta = 1
    NodeVector p{(lambda_ - J_.eta_eta) / J_.psi_eta, 1};
    if (state_) p.state = (p.psi * J_.psi_state + J_.eta_state) / (lambda_ - J_.state_state);
    return p;
  }
  NodeVector solve(const NodeVector& b) const {  // (lambda - J) y = b
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> J;
    J_.write(3, J.data());
    Eigen::Matrix3cd shifted = -J.cast<Complex>();
    shifted.diagonal().array() += lambda_;
    const Eigen::Vector3cd y = shifted.partialPivLu().solve(Eigen::Vector3cd(b.psi, b.eta, b.state));
    return {y[0], y[1], y[2]};
  }

 private:
  NodeBlock J_;
  Complex lambda_;
  bool state_;
};

// A wave in a medium alike everywhere, at points even over one wavelength: enough of them that no product of
// three waves is mistaken for another, or, where the wavelength is a few nodes, the nodes.
class WaveLine : public Line {
 public:
  // The shape at a point is wave(2 pi (point + shift)/points).
  WaveLine(const LinearisedOperator& J, const NodeForms& form, double frequency, double k, bool continuum,
           int points, double shift, bool travelling)
      : J_(J), k_(k), continuum_(continuum) {
    omega = frequency;
    const WaveBlock block(J.point(0), symbol(k), Complex(0, omega));
    const NodeVector right = block.right(), adjoint = block.left();
    for (int i = 0; i < points; ++i) {
      const double phase = 2 * M_PI * (i + shift) / points;
      const Complex shape = travelling ? std::polar(1., phase) : Complex(std::cos(phase));
      forms.push_back(form);
      q.push_back(times(shape, right));
      left.push_back(times(std::conj(shape), adjoint));
      largest = std::max(largest, std::norm(shape));
    }
    if (J.scene.form == Form::chain && !J.scene.ring()) {  // the blocks may miss the crests
      largest = 0;
      for (const Complex& p : J.wave(k)) largest = std::max(largest, std::norm(p));
    }
  }

  Vector solve(Complex lambda, const Vector& b) const override {
    // Nothing pulls back the uniform part where K0 = 0: its solution is the limit lambda -> 0, at which eta
    // stays.
    if (lambda == 0.) lambda = 1e-100;
    const int n = int(b.size());
    Vector y(b.size());
    for (int m = 0; m < n; ++m) {
      const int harmonic = 2 * m > n ? m - n : m;
      NodeVector part;
      for (int i = 0; i < n; ++i) add(part, std::polar(1. / n, -2 * M_PI * m * i / n), b[i]);
      const NodeVector found = WaveBlock(J_.point(0), symbol(harmonic * k_), lambda).solve(part);
      for (int i = 0; i < n; ++i) add(y[i], std::polar(1., 2 * M_PI * m * i / n), found);
    }
    return y;
  }

 private:
  double symbol(double k) const { return continuum_ ? k * k : J_.symbol(k); }

  const LinearisedOperator& J_;
  double k_;
  bool continuum_;
};

// A mode of a medium that differs along the line, at all its nodes.
class WholeLine : public Line {
 public:
  WholeLine(const LinearisedOperator& J, std::vector<NodeForms> all, const Mode& m) : J_(J) {
    omega = m.value.imag();
    forms = std::move(all);
    const std::vector<Complex> w = left_vector(J, m);
    q = nodes(J.expand(m.value, m.psi));
    for (std::size_t i = 0; i < J.size(); ++i) {
      left.push_back(J.point(i).expand_transposed(m.value, w[i], {}));
      largest = std::max(largest, std::norm(m.psi[i]));
    }
  }

  Vector solve(Complex lambda, const Vector& b) const override {
    BandLU lu;
    J_.factor(lambda, lu);
    std::vector<Complex> right_side;
    for (const NodeVector& at : b) {
      right_side.insert(right_side.end(), {-at.psi, -at.eta});
      if (J_.has_state()) right_side.push_back(-at.state);
    }
    return nodes(J_.resolvent(lambda, lu, right_side));
  }

 private:
  // Of vectors of J.
  Vector nodes(const std::vector<Complex>& x) const {
    const std::size_t d = J_.dof();
    Vector all;
    for (std::size_t i = 0; i < x.size(); i += d) all.push_back({x[i], x[i + 1], d == 3 ? x[i + 2] : 0.});
    return all;
  }

  const LinearisedOperator& J_;
};

// Nodes after which a wave of the grid repeats itself, if that is so few that products of three are one
// another's like; else more points than any such product needs.
int points_of(const LinearisedOperator& J, double k, bool continuum) {
  constexpr int enough = 8;
  if (k == 0) return 1;
  if (continuum) return enough;
  const double turns = k * J.spacing() / (2 * M_PI);
  for (int points = 2; points <= 4; ++points)
    if (std::abs(points * turns - std::round(points * turns)) < 1e-9) return points;
  return enough;
}

Criticality of_wave(const LinearisedOperator& J, const NodeForms& form, const Mode& m, bool continuum) {
  const double k = m.wavenumber, frequency = m.value.imag();
  const int points = points_of(J, k, continuum);
  const auto of = [&](bool travelling, double shift) {
    return lyapunov(WaveLine(J, form, frequency, k, continuum, points, shift, travelling));
  };
  Criticality c;
  if (points <= 2) {  // alike at every node, or alternating
    c.coefficient = of(false, 0);
    c.of = k == 0 ? "uniform" : "standing";
    return c;
  }
  // crests between nodes: a chain ends half a spacing beyond its last block
  const bool ring = J.scene.ring(), between = J.scene.form == Form::chain;
  c.standing = of(false, between && !ring ? 0.5 : 0);
  if (!ring) {
    c.coefficient = std::exchange(c.standing, Criticality::none);
    c.of = "standing";
    return c;
  }
  if (points == 4) c.standing = std::max(c.standing, of(false, 0.5));  // crests on nodes and between differ
  c.travelling = of(true, 0);
  // sum |z|^2 is a^2 of a travelling wave and a^2/2 of a standing one
  const bool standing = 2 * c.standing > c.travelling;
  c.coefficient = standing ? c.standing : c.travelling;
  c.of = standing ? "standing" : "travelling";
  return c;
}

// Friction or the state's rate has a kink at psi = 0, and the nodes lie on both sides of it.
bool passes_kink(const SteadySliding& steady) {
  const FrictionParameters& friction = steady.scene.friction;
  if (!friction.sticks() && !friction.has_state() && friction.terms.none()) return false;
  const auto [low, high] = std::minmax_element(steady.psi.begin(), steady.psi.end());
  return *low <= 0 && *high >= 0;
}

std::vector<NodeForms> forms_of(const SteadySliding& steady, const LinearisedOperator& J, std::size_t count) {
  const Frictions friction(steady.scene, 0, steady.scene.n);
  const std::vector<double> amplitude = friction_amplitude(steady.scene, 0, steady.scene.n);
  std::vector<NodeForms> forms;
  for (std::size_t i = 0; i < count; ++i) {
    const PetscInt node = J.coupling.node[i];
    const double state = steady.state.empty() ? 0 : steady.state[node];
    forms.emplace_back(J.point(i), amplitude[node], friction[node].higher_partials(steady.psi[node], state));
  }
  return forms;
}

}  // namespace

Criticality criticality(const SteadySliding& steady, const LinearisedOperator& J, const Mode& mode,
                        bool continuum) {
  Criticality c;
  if (!(mode.value.imag() > 0)) {
    c.why_not = "the mode does not oscillate";
  } else if (!std::isfinite(mode.wavenumber)) {
    c.why_not = "the limit of short waves crosses, and no single one";
  } else if (J.scene.massless()) {
    c.why_not = "without mass (model_m 0) it is not computed";
  } else if (steady.scene.friction.piecewise()) {
    c.why_not = "friction_law " + to_string(steady.scene.friction.law) +
                " has no third derivative that means something: it jumps from piece to piece";
  } else if (passes_kink(steady)) {
    c.why_not = "friction has a kink at psi = 0, which is where some of the line slides";
  } else if (J.scene.any_held() || steady.scene.has_profile() ||
             (!continuum && J.exact_waves().empty())) {  // nodes alike in slope may differ in curvature
    if (J.neutral()) {
      c.why_not = "nothing holds the line (model_k0 = 0): the velocity is free";
      return c;
    }
    Mode m = mode;
    if (m.psi.empty()) m.psi = J.wave(m.wavenumber);
    if (m.psi.size() != J.size() || !polish(J, m)) {
      c.why_not = "the mode was lost";
      return c;
    }
    c.coefficient = lyapunov(WholeLine(J, forms_of(steady, J, J.size()), m));
    c.of = "mode";
  } else {
    c = of_wave(J, forms_of(steady, J, 1).front(), mode, continuum);
  }
  if (c.why_not.empty() && !c.known()) c.why_not = "the coefficient is zero to round-off";
  return c;
}

}  // namespace stickslip
