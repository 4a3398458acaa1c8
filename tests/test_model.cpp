// The semi-discrete system: stencils and ends, halo over ranks, Jacobians, spread.
#include <cmath>

#include "catch.hpp"
#include "shared.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/linear_systems.hpp"

using namespace stickslip;

namespace {

// Gives the scene a medium that differs along x, in everything that its form and order allow.
void vary(Scene& s) {
  const auto differ = [&](const char* name, double low, double high) {
    s.medium.profiles[name] = ProfileAlongX({{0.1, low}, {s.length / 3, high}, {s.length / 2, low}},
                                            Between::linear, s.ring() ? s.length : 0);
  };
  if (s.form == Form::continuum) {
    differ("model_delta", 0.1, 0.4);
    if (s.order == 2) differ("model_c", 0.5, 1.7);
    return;
  }
  differ("model_m", 0.6, 2);
  differ("model_k0", 0.1, 0.7);
  differ("model_k1", 0.3, 1.4);
  differ("model_zeta", 0.1, 0.5);
}

// The force of neighbours on a node, by the links to them; `all`: the unknowns of all nodes.
double elastic(const Scene& s, PetscInt node, const double* all, int dof) {
  double sum = 0;
  for (const PetscInt side : {-1, 1}) {
    PetscInt other = node + side;
    if (s.ring()) other = (other + s.n) % s.n;
    if (other < 0 || other >= s.n) {
      if (s.form == Form::chain) continue;
      other = node - side;  // even reflection
    }
    sum += s.link(side < 0 ? node - 1 : node) * (all[other * dof] - all[node * dof]);
  }
  return sum;
}

// Every kind of scene that the loops treat differently.
std::vector<Scene> scenes() {
  std::vector<Scene> all;
  for (int order : {2, 4, 6, 8})
    for (int ends = 0; ends < 4; ++ends) {
      if (order == 8 && ends >= 2) continue;
      Scene s;
      s.order = order;
      s.n = 23;
      s.length = 7;
      s.left = ends == 0 ? End::periodic : ends == 1 ? End::free : End::velocity;
      s.right = ends == 0 ? End::periodic : ends == 3 ? End::velocity : End::free;
      s.left_value = -1.5;
      s.right_value = 0.7;
      s.derived_sign = order != 4;
      s.spread = order == 2 ? 0.3 : 0;
      all.push_back(s);
    }
  for (int ends = 0; ends < 4; ++ends)
    for (StateLaw state : {StateLaw("none"), StateLaw("healing"), StateLaw("contact-age")}) {
      Scene s;
      s.form = Form::chain;
      s.order = 2;
      s.n = 19;
      s.left = ends == 0 ? End::periodic : ends == 1 ? End::free : End::velocity;
      s.right = ends == 0 ? End::periodic : ends == 3 ? End::velocity : End::free;
      s.length = ends == 0 ? 19 : 18;
      s.left_value = 0.4;
      s.right_value = 0.7;  // not 0, where |psi| has a kink
      s.zeta = 0.3;
      s.spread = 0.2;
      s.spread_kind = SpreadKind::lognormal;
      s.friction.law = Law("carlson-langer");
      s.friction.regularised = true;
      s.friction.eps = 0.2;
      s.friction.state = state;
      all.push_back(s);
    }
  for (StateLaw state : {StateLaw("ageing"), StateLaw("slip")}) {
    Scene s;
    s.n = 17;
    s.friction.law = Law("rate-and-state");
    s.friction.state = state;
    s.friction.values["friction_a"] = 0.5;  // so that F bends over velocities of order 1
    all.push_back(s);
  }
  const std::size_t without = all.size();
  for (std::size_t i = 0; i < without; ++i) {
    all.push_back(all[i]);
    all.back().nu = 0.4;
    if (i % 7 == 0) all.back().c = all.back().k1 = 0;
  }
  for (std::size_t i = 0; i < without; ++i) {
    all.push_back(all[i]);
    vary(all.back());
  }
  return all;
}

// A smooth field that no symmetry simplifies; psi of both signs, but for the slip law, whose third derivative
// grows like 1/psi^2 towards rest.
void fill(const Model& model, Vec u) {
  const double middle = model.scene().friction.state == StateLaw("slip") ? 0.95 : 0.31;
  double* a;
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i)
    for (int d = 0; d < model.dof(); ++d)
      a[i * model.dof() + d] = 0.6 * std::sin(1.3 * double(model.first() + i) + d) + middle + 0.1 * d;
  SS_TRY(VecRestoreArray(u, &a));
  model.set_held(u);
}

const Part parts[] = {Part::full, Part::pointwise, Part::stencil, Part::wave, Part::reaction};

double norm(Vec v) {
  double value;
  SS_TRY(VecNorm(v, NORM_INFINITY, &value));
  return value;
}

}  // namespace

TEST_CASE("the right-hand side is the equations, node by node") {
  // Independent of the loops: rows of D2 as combinations of nodes, the equations of the model written out.
  for (const Scene& s : scenes()) {
    Model model(PETSC_COMM_WORLD, s);
    VecHandle u = model.create_vector(), f = model.create_vector();
    fill(model, u);
    model.rhs(Part::full, u, f);
    VecHandle everything;
    VecScatter to_all;
    SS_TRY(VecScatterCreateToAll(u, &to_all, everything.out()));
    SS_TRY(VecScatterBegin(to_all, u, everything, INSERT_VALUES, SCATTER_FORWARD));
    SS_TRY(VecScatterEnd(to_all, u, everything, INSERT_VALUES, SCATTER_FORWARD));
    SS_TRY(VecScatterDestroy(&to_all));
    const double *all, *mine;
    SS_TRY(VecGetArrayRead(everything, &all));
    SS_TRY(VecGetArrayRead(f, &mine));
    const int dof = model.dof();
    for (PetscInt i = 0; i < model.local(); ++i) {
      const PetscInt node = model.first() + i;
      const double *at = all + node * dof, psi = at[0], eta = at[1], state = dof == 3 ? at[2] : 0;
      const double F = model.friction(i, psi, state).F;
      double d2 = 0, size = 0;
      for (const auto& [j, weight] : second_difference_row(s, node)) {
        d2 += weight * all[j * dof];
        size += std::abs(weight * all[j * dof]);
      }
      const NodeCoefficients c = s.coefficients(node);
      const double e = eta + s.N() * d2;
      double psi_t = c.A * (e - c.B * psi - F);
      const double pull = s.medium.links_differ() ? elastic(s, node, all, dof) : s.K1() * d2;
      double eta_t = c.K0 * (s.v - psi) + pull - c.s_delta * (e - F);
      if (model.held(node)) {
        psi_t = 0;
        if (s.form == Form::continuum) eta_t = 0;
      }
      CHECK(mine[i * dof] == Approx(psi_t).margin(1e-14 * (1 + c.A * (1 + s.N() * size))));
      CHECK(mine[i * dof + 1] ==
            Approx(eta_t).margin(1e-14 * (1 + (2 * s.mean_K1() + std::abs(c.s_delta) * s.N()) * size)));
      if (dof == 3) CHECK(mine[i * dof + 2] == Approx(model.state_rate(psi, state).g).margin(1e-14));
    }
    SS_TRY(VecRestoreArrayRead(f, &mine));
    SS_TRY(VecRestoreArrayRead(everything, &all));
  }
}

TEST_CASE("the parts add up to the whole") {
  for (const Scene& s : scenes()) {
    Model model(PETSC_COMM_WORLD, s);
    VecHandle u = model.create_vector(), full = model.create_vector(), a = model.create_vector(),
              b = model.create_vector();
    fill(model, u);
    model.rhs(Part::full, u, full);
    const double tolerance = 1e-13 * (1 + norm(full));
    for (auto [first, second] :
         {std::pair(Part::pointwise, Part::stencil), std::pair(Part::wave, Part::reaction)}) {
      model.rhs(first, u, a);
      model.rhs(second, u, b);
      SS_TRY(VecAXPY(a, 1, b));
      CHECK(distance(a, full) < tolerance);
    }
  }
}

TEST_CASE("viscosity is a force of its own; at a held end of the continuum eta is what balances it") {
  for (const Scene& s : scenes()) {
    Model model(PETSC_COMM_WORLD, s);
    CHECK(model.viscous() == (s.nu > 0));
    if (!model.viscous()) continue;
    VecHandle u = model.create_vector(), force = model.create_vector(), moved = model.create_vector();
    fill(model, u);
    model.viscous_force(u, force);
    // the rate of psi is that without viscosity, had eta what viscosity adds
    Scene plain = s;
    plain.nu = 0;
    const Model other(PETSC_COMM_WORLD, plain);
    VecHandle f = model.create_vector(), g = model.create_vector();
    model.rhs(Part::full, u, f);
    SS_TRY(VecWAXPY(moved, 1, force, u));
    other.rhs(Part::full, moved, g);
    const double scale = 1e-13 * (1 + norm(f));
    const double *a, *b, *at, *v;
    SS_TRY(VecGetArrayRead(f, &a));
    SS_TRY(VecGetArrayRead(g, &b));
    SS_TRY(VecGetArrayRead(u, &at));
    SS_TRY(VecGetArrayRead(force, &v));
    for (PetscInt i = 0; i < model.local(); ++i) {
      const PetscInt k = i * model.dof();
      CHECK(v[k] == 0);
      for (int d = 0; d < model.dof(); ++d) CHECK(a[k + d] == Approx(b[k + d]).margin(scale));
      if (!model.held(model.first() + i) || s.form == Form::chain) continue;
      const double F = model.friction(i, at[k], model.dof() == 3 ? at[k + 2] : 0).F;
      CHECK(at[k + 1] + v[k + 1] == Approx(s.B() * at[k] + F).margin(scale));
    }
    SS_TRY(VecRestoreArrayRead(force, &v));
    SS_TRY(VecRestoreArrayRead(u, &at));
    SS_TRY(VecRestoreArrayRead(g, &b));
    SS_TRY(VecRestoreArrayRead(f, &a));
  }
}

TEST_CASE("Jacobians agree with differences of the right-hand side") {
  // Central differences of step e: error e^2 |f'''|/6 + round-off |f| 1e-16/e; with e = 1e-5 and |f'''| up to
  // about 1e3 (regularised law over 0.2) below 1e-7 of the largest entry.
  const double e = 1e-5;
  for (const Scene& s : scenes()) {
    Model model(PETSC_COMM_WORLD, s);
    VecHandle u = model.create_vector(), w = model.create_vector(), plus = model.create_vector(),
              minus = model.create_vector(), moved = model.create_vector(), product = model.create_vector();
    fill(model, u);
    double* direction;
    SS_TRY(VecGetArray(w, &direction));
    for (PetscInt i = 0; i < model.local() * model.dof(); ++i)
      direction[i] = std::cos(2.7 * double(model.first() * model.dof() + i));
    SS_TRY(VecRestoreArray(w, &direction));
    for (Part part : parts) {
      MatHandle J = model.create_jacobian(part);
      model.jacobian(part, u, 0.7, -1.3, J);
      SS_TRY(MatMult(J, w, product));
      SS_TRY(VecWAXPY(moved, e, w, u));
      model.rhs(part, moved, plus);
      SS_TRY(VecWAXPY(moved, -e, w, u));
      model.rhs(part, moved, minus);
      SS_TRY(VecAXPY(plus, -1, minus));
      SS_TRY(VecScale(plus, -1.3 / (2 * e)));
      SS_TRY(VecAXPY(plus, 0.7, w));
      INFO("law " << to_string(s.friction.law) << " state " << to_string(s.friction.state) << " order "
                  << s.order << " form " << int(s.form) << " part " << int(part));
      CHECK(distance(plus, product) < 1e-7 * (1 + norm(product)));
    }
  }
}

TEST_CASE("blocks by themselves are solved by the values that they have, not by those they had") {
  // Each block is inverted: the residual is round-off times its condition, below 1e3 beside these shifts.
  for (const Scene& s : scenes()) {
    Model model(PETSC_COMM_WORLD, s);
    VecHandle u = model.create_vector(), right = model.create_vector(), solution = model.create_vector(),
              product = model.create_vector();
    fill(model, u);
    MatHandle J = model.create_jacobian(Part::pointwise);
    KspHandle ksp;
    SS_TRY(KSPCreate(PETSC_COMM_WORLD, ksp.out()));
    solve_by_blocks(ksp);
    for (const double shift : {40., 10., 160.}) {
      model.jacobian(Part::pointwise, u, shift, -0.5, J);
      SS_TRY(VecCopy(u, right));
      SS_TRY(VecScale(u, 0.9));
      SS_TRY(KSPSetOperators(ksp, J, J));
      SS_TRY(KSPSolve(ksp, right, solution));
      SS_TRY(MatMult(J, solution, product));
      INFO("law " << to_string(s.friction.law) << " state " << to_string(s.friction.state) << " shift "
                  << shift);
      CHECK(distance(product, right) < 1e3 * 2.3e-16 * norm(right));
    }
  }
}

TEST_CASE("links of a medium: springs half-way, c^2 half-way or its harmonic mean where c jumps",
          "[serial]") {
  Scene s;
  s.left = s.right = End::free;
  s.order = 2;
  s.n = 5;
  s.length = 8;  // h = 2
  s.gamma = 2;
  s.medium.profiles["model_c"] = ProfileAlongX({{0, 1}, {3, 1}, {3, 2}, {8, 2}}, Between::linear);
  CHECK(s.medium.links_differ());
  CHECK_FALSE(s.medium.nodes_differ());
  CHECK(s.link(0) == Approx(1. / 2 / 4));
  CHECK(s.link(1) == Approx(1 / (0.5 / 1 + 0.5 / 4) / 2 / 4));  // the jump stands in the middle
  CHECK(s.link(2) == Approx(4. / 2 / 4));
  s.medium.profiles["model_c"] = ProfileAlongX({{0, 1}, {2.5, 1}, {2.5, 2}, {8, 2}}, Between::linear);
  CHECK(s.link(1) == Approx(1 / (0.25 / 1 + 0.75 / 4) / 2 / 4));
  s.medium.profiles["model_c"] = ProfileAlongX({{0, 1}, {2, 1}, {2, 2}, {8, 2}}, Between::linear);
  CHECK(s.link(0) == Approx(1. / 2 / 4));  // on a node: each side its own
  CHECK(s.link(1) == Approx(4. / 2 / 4));
  s.medium.profiles["model_c"] = ProfileAlongX({{0, 1}, {8, 3}}, Between::linear);
  CHECK(s.link(1) == Approx(1.75 * 1.75 / 2 / 4));
  CHECK_THROWS_AS(s.K1(), std::logic_error);
  CHECK(s.A() == 2);
  CHECK_NOTHROW(s.averaged().K1());
  // a ring, with the jump where it closes
  s.left = s.right = End::periodic;
  s.length = 10;
  s.medium.profiles["model_c"] = ProfileAlongX({{0.5, 1}, {9.5, 3}}, Between::step, 10);
  CHECK(s.link(4) == Approx(1 / (0.75 / 1 + 0.25 / 9) / 2 / 4));
  CHECK(s.link(0) == Approx(1 / (0.25 / 9 + 0.75 / 1) / 2 / 4));
  CHECK(s.link(-1) == s.link(4));

  Scene chain;
  chain.form = Form::chain;
  chain.left = chain.right = End::free;
  chain.order = 2;
  chain.n = 3;
  chain.length = 2;
  chain.f0 = 2;
  chain.medium.profiles["model_k1"] = ProfileAlongX({{0.5, 1}, {1.5, 3}}, Between::linear);
  chain.medium.profiles["model_m"] = ProfileAlongX({{0, 1}, {2, 5}}, Between::linear);
  CHECK(chain.link(0) == Approx(0.5));
  CHECK(chain.link(1) == Approx(1.5));
  CHECK(chain.coefficients(1).A == Approx(2. / 3));
  CHECK_THROWS_AS(chain.A(), std::logic_error);
  CHECK(chain.K0() == Approx(0.1));
}

TEST_CASE("second differences are exact on polynomials and reach their order", "[serial]") {
  for (int order : {2, 4, 6, 8}) {
    // exact on even polynomials up to degree p + 1 in the interior
    const auto w = second_difference(order);
    for (int degree = 0; degree <= order + 1; degree += 2) {
      double sum = degree == 0 ? w[0] : 0;
      for (int j = 1; j <= order / 2; ++j) sum += 2 * w[static_cast<std::size_t>(j)] * std::pow(j, degree);
      CHECK(sum == Approx(degree == 2 ? 2. : 0.).margin(1e-12));
    }
    CHECK(symbol(order, 0.1, 1.) == Approx(1).epsilon(2 * std::pow(0.1, order)));
  }
}

TEST_CASE("the spread is the same medium on every grid and has mean 1", "[serial]") {
  for (const SpreadKind kind : {SpreadKind::uniform, SpreadKind::lognormal}) {
    Scene s;
    s.spread = 0.4;
    s.spread_kind = kind;
    s.length = 50;
    s.n = 400;
    const auto coarse = friction_amplitude(s, 0, s.n);
    s.n = 800;
    const auto fine = friction_amplitude(s, 0, s.n);
    for (std::size_t i = 0; i < coarse.size(); ++i) CHECK(coarse[i] == Approx(fine[2 * i]).margin(1e-13));
    s.form = Form::chain;
    s.n = 100000;
    const auto blocks = friction_amplitude(s, 0, s.n);
    double mean = 0, square = 0;
    for (const double a : blocks) {
      mean += a / 1e5;
      square += a * a / 1e5;
    }
    // five standard errors; variance 0.4^2/3 (uniform), exp(0.4^2) - 1 (lognormal)
    const double variance = kind == SpreadKind::uniform ? 0.16 / 3 : std::exp(0.16) - 1;
    CHECK(std::abs(mean - 1) < 5 * std::sqrt(variance / 1e5));
    CHECK(square - mean * mean == Approx(variance).epsilon(0.05));
  }
}

TEST_CASE("more ranks than nodes is refused") {
  int ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  Scene s;
  s.form = Form::chain;
  s.order = 2;
  s.n = 1;
  s.length = 1;
  if (ranks > 1) {
    CHECK_THROWS_AS(Model(PETSC_COMM_WORLD, s), UsageError);
  } else {
    CHECK_NOTHROW(Model(PETSC_COMM_WORLD, s));
  }
}

TEST_CASE("numbers of any nodes come from the ranks that have them", "[model]") {
  const MPI_Comm comm = PETSC_COMM_WORLD;
  const PetscInt local = 3 + rank_in(comm), dof = 3;
  PetscInt all = 0, first = 0;
  SS_TRY(MPI_Allreduce(&local, &all, 1, MPIU_INT, MPI_SUM, comm));
  SS_TRY(MPI_Exscan(&local, &first, 1, MPIU_INT, MPI_SUM, comm));
  if (rank_in(comm) == 0) first = 0;
  // of every second rank none; out of order, and one twice
  std::vector<PetscInt> nodes;
  if (rank_in(comm) % 2 == 0) nodes = {all - 1, 0, (first + local) % all, 0, all / 2};
  for (const int kept : {1, 2, 3}) {
    const NodeFetch fetch({comm, local, all, int(dof)}, kept, nodes);
    CHECK(fetch.is_local() == (ranks_in(comm) == 1));
    for (const double factor : {1., -7.}) {
      std::vector<double> own;
      for (PetscInt i = 0; i < local * dof; ++i) own.push_back(factor * double(first * dof + i));
      fetch.take(own.data());
      const double* value = fetch.values();
      for (const PetscInt node : nodes)
        for (int d = 0; d < kept; ++d) CHECK(*value++ == factor * double(node * dof + d));
    }
  }
}
