// The step of arkimex that takes friction implicitly tile by tile, against the equations it is to solve.
#include <algorithm>
#include <cmath>
#include <random>

#include "catch.hpp"
#include "model/dispatch.hpp"
#include "model/implicit_kernel.hpp"
#include "numerics/tableau.hpp"
#include "shared.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/stick.hpp"
#include "stickslip/time/time.hpp"
#include "time/band.hpp"
#include "time/methods.hpp"
#include "time/tiles.hpp"

using namespace stickslip;

namespace {

ErrorNorm norm_of(double atol, double rtol, NormType type) {
  return {Tolerances::as_set({}, rtol, atol), type};
}

std::vector<Scene> imex_scenes() {
  std::vector<Scene> all;
  for (const PetscInt n : {PetscInt(70), PetscInt(1100)}) {  // one tile; several
    Scene ring;
    ring.n = n;
    ring.gamma = 50;
    ring.delta = 0.3;
    const auto add = [&](Scene s, Law law, StateLaw state, bool regularised) {
      s.friction.law = law;
      s.friction.state = state;
      s.friction.regularised = regularised;
      s.friction.eps = 0.1;
      all.push_back(s);
      s.left = End::velocity;
      s.right = End::free;
      s.left_value = 0.7;
      s.spread = 0.2;
      all.push_back(s);
    };
    for (const int order : {2, 6}) {
      ring.order = order;
      add(ring, "cubic", "none", false);
    }
    ring.order = 4;
    add(ring, "carlson-langer", "healing", true);
    add(ring, "cubic", "contact-age", false);
    add(ring, "carlson-langer", "none", true);
    add(ring, "coulomb", "healing", true);
    add(ring, "coulomb", "none", false);
    add(ring, "carlson-langer", "healing", false);
    add(ring, "rate-and-state", "ageing", false);
    add(ring, "rate-and-state", "slip", false);
    Scene chain;
    chain.form = Form::chain;
    chain.n = n;
    chain.order = 2;
    chain.delta = 0;
    chain.length = double(n - 1);
    chain.left = End::velocity;
    chain.left_value = 0.7;
    chain.right = End::free;
    chain.zeta = 0.3;
    all.push_back(chain);
    for (const Law law : {Law("cubic"), Law("coulomb")}) {  // viscosity is explicit there
      ring.nu = chain.nu = 0.05;
      add(ring, law, law == Law("cubic") ? "contact-age" : "none", false);
      chain.friction.law = law;
      all.push_back(chain);
    }
  }
  return all;
}

void start(const Model& model, Vec u) {
  double* a;
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double x = double(model.first() + i);
    a[i * model.dof()] = 0.9 + 0.6 * std::sin(0.05 * x);
    a[i * model.dof() + 1] = 0.3 * std::cos(0.04 * x);
    if (model.dof() == 3) a[i * model.dof() + 2] = 1.3 + 0.2 * std::sin(0.9 * x);
  }
  SS_TRY(VecRestoreArray(u, &a));
  model.set_held(u);
}

// Who rests and who slides, with friction that sticks; psi of those at rest is 0.
std::vector<double> give_direction(const Model& model, StepTaker& step, Vec u) {
  std::vector<double> direction;
  if (!Stick::applies_to(model.scene())) return direction;
  double* a;
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    const PetscInt node = model.first() + i;
    direction.push_back(node % 7 < 3 && !model.held(node) ? 0. : 1.);
    if (direction.back() == 0) a[i * model.dof()] = 0;
  }
  SS_TRY(VecRestoreArray(u, &a));
  model.set_direction(direction.data());
  step.set_direction(direction);
  return direction;
}

double norm(Vec v) {
  double value;
  SS_TRY(VecNorm(v, NORM_INFINITY, &value));
  return value;
}


std::unique_ptr<StepTaker> step_of(const Model& model, const StageProgram& t, Implicit implicit) {
  const bool sticks = Stick::applies_to(model.scene());
  if (implicit == Implicit::friction) return std::make_unique<TiledStep>(model, t, sticks);
  return std::make_unique<BandedImex>(model, t, implicit, sticks);
}

// What is explicit and what implicit; friction that sticks is never taken apart.
struct Split {
  Implicit implicit;
  Part of_explicit, of_implicit;
};
std::vector<Split> splits_of(const Scene& scene) {
  std::vector<Split> all = {{Implicit::friction, Part::stencil, Part::pointwise},
                            {Implicit::both, Part::full, Part::full}};
  if (!Stick::applies_to(scene)) all.push_back({Implicit::wave, Part::reaction, Part::wave});
  return all;
}

}  // namespace

TEST_CASE("tableaus of arkimex are read off the library's own steps", "[imex]") {
  for (const Method& m : methods()) {
    if (m.type != std::string(TSARKIMEX)) continue;
    const ImexMethod method(m.subtype);
    const StageProgram& t = method.tableau();
    INFO(m.name());
    const auto s = std::size_t(t.stages);
    CHECK((m.adaptivity == Adaptivity::never) == t.embedded.empty());
    for (const std::vector<double>* b : {&t.b, &t.bt}) {
      double sum = 0, first = 0, cross = 0;
      for (std::size_t i = 0; i < s; ++i) {
        double c = 0, ct = 0;
        for (std::size_t j = 0; j < s; ++j) {
          c += t.A[i * s + j];
          ct += t.At[i * s + j];
          if (j >= i) CHECK(t.A[i * s + j] == 0);
          if (j > i) CHECK(std::abs(t.At[i * s + j]) < 1e-15);
        }
        sum += (*b)[i];
        first += (*b)[i] * c;
        cross += (*b)[i] * ct;
      }
      CHECK(sum == Approx(1).epsilon(1e-12));
      if (m.order >= 2) CHECK(first == Approx(0.5).epsilon(1e-12));
      if (m.order >= 2) CHECK(cross == Approx(0.5).epsilon(1e-12));
    }
  }
  // Kennedy and Carpenter's pair of orders 3 and 2
  const ImexMethod third("3");
  CHECK(third.tableau().stages == 4);
  CHECK(third.tableau().order == 3);
  CHECK(third.tableau().At[5] == Approx(1767732205903. / 4055673282236.).epsilon(1e-15));
  CHECK(third.tableau().A[4] == Approx(1767732205903. / 2027836641118.).epsilon(1e-15));
}

namespace {

// (1 - h J) x = e for psi and the state of a node, with the error of eta as it is; a held psi errs by
// nothing.
std::vector<double> error_of_slaves(const Model& model, PetscInt i, const double* u, double h,
                                    std::vector<double> e) {
  const LinearPoint p = model.linear_point(i, u[0], u[2]);
  const double a = 1 + h * p.A * (p.B + p.F_psi), b = h * p.A * p.F_state;
  const double c = -h * p.g_psi, d = 1 - h * p.g_state;
  const double psi = e[0] + h * p.A * e[1], state = e[2], determinant = a * d - b * c;
  if (determinant > 0) {
    e[0] = (psi * d - b * state) / determinant;
    e[2] = (a * state - c * psi) / determinant;
  }
  if (model.held(model.first() + i)) e[0] = 0;
  return e;
}

}  // namespace

TEST_CASE("stages of arkimex solve the model's own equations, whatever is implicit", "[imex]") {
  const ErrorNorm tight = norm_of(1e-10, 1e-10, NORM_2);  // residuals of 1e-13
  int checked = 0, ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  for (const Scene& scene : imex_scenes())
    for (const Split& split : splits_of(scene))
      for (const char* subtype : {"3", "4", "1bee", "prssp2"}) {
        if (!in_turn(++checked, ranks)) continue;
        const ImexMethod method(subtype);
        const StageProgram& t = method.tableau();
        const Model model(PETSC_COMM_WORLD, scene);
        const auto step = step_of(model, t, split.implicit);
        VecHandle u = model.create_vector(), found = model.create_vector(), y = model.create_vector(),
                  rhs = model.create_vector();
        start(model, u);
        const std::vector<double> direction = give_direction(model, *step, u);
        std::vector<VecHandle> slopes;
        for (int i = 0; i < 2 * t.stages; ++i) slopes.push_back(model.create_vector());
        // beside nodes at rest the start is so rough that a longer step turns slip back
        const double dt = Stick::applies_to(scene) ? 0.001 : 0.01;
        const TiledStep::Outcome outcome = step->take(u, dt, tight, !t.embedded.empty(), found, slopes);
        INFO("implicit " << to_string(split.implicit) << ": " << to_string(scene.friction.law) << " "
                         << to_string(scene.friction.state) << " n " << scene.n << " order " << scene.order
                         << " left " << int(scene.left) << " arkimex " << subtype);
        CHECK(outcome.finite);
        CHECK(outcome.solved);
        const auto s = std::size_t(t.stages);
        const auto combine = [&](const double* of_explicit, const double* of_implicit) {
          SS_TRY(VecCopy(u, y));
          for (std::size_t j = 0; j < s; ++j) {
            SS_TRY(VecAXPY(y, dt * of_implicit[j], slopes[2 * j]));
            SS_TRY(VecAXPY(y, dt * of_explicit[j], slopes[2 * j + 1]));
          }
        };
        for (std::size_t i = 0; i < s; ++i) {
          combine(&t.A[i * s], &t.At[i * s]);
          const double h = dt * std::max(t.At[i * s + i], 0.1);
          // the residual, and what the slope of friction and the wave make of round-off
          const double waves = 1e-12 * (1 + dt * model.wave_frequency() * model.wave_frequency());
          const double allowed = 1e-11 * (1 + h * model.friction_rate(y));
          if (split.implicit != Implicit::both)
            model.rhs(split.of_explicit, y, rhs);
          else
            SS_TRY(VecZeroEntries(rhs));
          SS_TRY(VecAXPY(rhs, -1, slopes[2 * i + 1]));
          CHECK(dt * norm(rhs) < (split.implicit == Implicit::friction ? waves : allowed));
          model.rhs(split.of_implicit, y, rhs);
          SS_TRY(VecAXPY(rhs, -1, slopes[2 * i]));
          CHECK(h * norm(rhs) < (split.implicit == Implicit::friction ? allowed : allowed + waves));
        }
        combine(t.b.data(), t.bt.data());
        CHECK(distance(found, y) < 1e-12);
        if (t.embedded.empty()) continue;
        combine(t.embedded.data(), t.embedded_t.data());
        const double *a, *b;
        double sum = 0;
        SS_TRY(VecGetArrayRead(found, &a));
        SS_TRY(VecGetArrayRead(y, &b));
        const int dof = model.dof();
        for (PetscInt i = 0; i < model.local(); ++i) {
          const double *const now = a + i * dof, *const other = b + i * dof;
          std::vector<double> error(dof);
          for (int d = 0; d < dof; ++d) error[d] = now[d] - other[d];
          // where friction goes by ln psi: what the node's own equations make of it
          if (model.friction_law(i).steep && split.implicit != Implicit::wave)
            error = error_of_slaves(model, i, now, dt * t.At[s * s - 1], error);
          for (int d = 0; d < dof; ++d) {
            const double size = std::max(std::abs(now[d]), std::abs(now[d] - error[d]));
            sum += std::pow(error[d] / (1e-10 + 1e-10 * size), 2);
          }
        }
        SS_TRY(VecRestoreArrayRead(y, &b));
        SS_TRY(VecRestoreArrayRead(found, &a));
        SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPI_DOUBLE, MPI_SUM, model.comm()));
        CHECK(outcome.error ==
              Approx(std::sqrt(sum / double(scene.n * model.dof()))).epsilon(1e-6).margin(0.01));
        model.set_direction(nullptr);
      }
}

TEST_CASE("the stability matrix of a method is that of its stages", "[imex][leapfrog]") {
  const std::vector<double> F = {0, 0, -0.7, 0}, G = {0.4, -0.5, 0.9, -1.3};
  // the classical method: exp(z) up to z^4
  const double z = 0.6;
  StageProgram classical{4, {0, 0, 0, 0, .5, 0, 0, 0, 0, .5, 0, 0, 0, 0, 1, 0}, {}, {}};
  classical.b = {1. / 6, 1. / 3, 1. / 3, 1. / 6};
  CHECK(propagator(classical, 1, {2 * z}, {0}, 0.5)[0] ==
        Approx(1 + z + z * z / 2 + z * z * z / 6 + z * z * z * z / 24).epsilon(1e-14));
  // half a kick, the midpoint rule, half a kick
  const double a = 0.7, b = -1.9, dt = 0.4;
  CHECK(propagator(leapfrog(), 1, {a}, {b}, dt)[0] ==
        Approx(std::pow(1 + dt * a / 2, 2) * (1 + dt * b / 2) / (1 - dt * b / 2)).epsilon(1e-14));
  CHECK(leapfrog().diagonal() == 0.5);
  // Two parts that do not commute, F a kick, F^2 = 0: one step and two of half the length differ by
  // C dt^(order + 1), and by the next power, which counts dt |F + G| = 0.1 times as much, 0.05 at half dt;
  // that moves the measured order by log2(1.1/1.05) at equal coefficients, and by 0.3 at four times as large
  const auto difference = [&](const StageProgram& method, double step) {
    const auto whole = propagator(method, 2, F, G, step), half = propagator(method, 2, F, G, step / 2);
    double largest = 0;
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j)
        largest = std::max(
            largest, std::abs(whole[2 * i + j] - half[2 * i] * half[j] - half[2 * i + 1] * half[2 + j]));
    return largest;
  };
  const ImexMethod third("3"), fourth("4"), fifth("5");
  for (const StageProgram* method : {&leapfrog(), &third.tableau(), &fourth.tableau(), &fifth.tableau()})
    CHECK(std::log2(difference(*method, 0.05) / difference(*method, 0.025)) ==
          Approx(method->order + 1).margin(0.3));
}

TEST_CASE("a step of leapfrog is half a kick, the midpoint rule, half a kick", "[imex][leapfrog]") {
  for (const Scene& scene : imex_scenes()) {
    if (scene.nu > 0) continue;  // refused
    const Model model(PETSC_COMM_WORLD, scene);
    TiledStep step(model, leapfrog(), Stick::applies_to(scene));
    VecHandle u = model.create_vector(), found = model.create_vector(), z = model.create_vector(),
              w = model.create_vector(), rhs = model.create_vector();
    start(model, u);
    const std::vector<double> direction = give_direction(model, step, u);
    const double dt = Stick::applies_to(scene) ? 0.002 : 0.01;
    const TiledStep::Outcome outcome = step.take(u, dt, norm_of(1e-6, 1e-6, NORM_2), false, found, {});
    INFO(to_string(scene.friction.law) << " " << to_string(scene.friction.state) << " n " << scene.n
                                       << " order " << scene.order << " left " << int(scene.left));
    CHECK(outcome.finite);
    CHECK(outcome.solved);
    const auto kicked = [&](Vec from, double h, Vec into) {
      SS_TRY(VecCopy(from, into));
      model.rhs(Part::stencil, from, rhs);
      SS_TRY(VecAXPY(into, h, rhs));
    };
    kicked(u, dt / 2, z);
    kicked(found, -dt / 2, w);  // undoes the second half
    SS_TRY(VecAXPBY(w, 0.5, 0.5, z));
    model.rhs(Part::pointwise, w, rhs);
    SS_TRY(VecAXPY(w, -1, z));
    SS_TRY(VecAXPY(w, -dt / 2, rhs));
    // Newton's method ends at 1e-13, to which round-off adds; of eta that of a kick
    const double round_off = 1e-15 * (1 + dt * model.wave_frequency() * model.wave_frequency());
    CHECK(norm(w) < 1e-11 + 100 * round_off);
    model.set_direction(nullptr);
  }
}

TEST_CASE("steps tile by tile do not depend on the ranks, to the last bit: arkimex, leapfrog",
          "[imex][leapfrog]") {
  const ImexMethod method("4");
  int drawn = 0, ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  for (const Scene& scene : imex_scenes()) {
    if (!in_turn(++drawn, ranks, numbers_of_ranks)) continue;
    const Model model(PETSC_COMM_WORLD, scene), alone(PETSC_COMM_SELF, scene);
    VecHandle u = model.create_vector(), found = model.create_vector();
    VecHandle all = alone.create_vector(), expected = alone.create_vector();
    start(model, u);
    start(alone, all);
    std::vector<std::unique_ptr<StepTaker>> steps, steps_alone;
    std::vector<double> direction, direction_alone;  // of the model, which keeps no copy
    for (const Split& split : splits_of(scene)) {
      steps.push_back(step_of(model, method.tableau(), split.implicit));
      steps_alone.push_back(step_of(alone, method.tableau(), split.implicit));
      direction = give_direction(model, *steps.back(), u);
      direction_alone = give_direction(alone, *steps_alone.back(), all);
    }
    INFO(to_string(scene.friction.law) << " n " << scene.n);
    const auto check_step = [&](const StepTaker& shared, const StepTaker& single, bool estimate) {
      shared.take(u, 0.02, norm_of(1e-4, 1e-3, NORM_2), estimate, found, {});
      single.take(all, 0.02, norm_of(1e-4, 1e-3, NORM_2), estimate, expected, {});
      CHECK(same_bits(model, found, expected));
    };
    for (std::size_t k = 0; k < steps.size(); ++k) check_step(*steps[k], *steps_alone[k], true);
    if (scene.nu > 0) continue;
    const bool sticks = Stick::applies_to(scene);
    TiledStep leap(model, leapfrog(), sticks), leap_alone(alone, leapfrog(), sticks);
    if (!direction.empty()) leap.set_direction(direction);
    if (!direction_alone.empty()) leap_alone.set_direction(direction_alone);
    check_step(leap, leap_alone, false);
  }
}

TEST_CASE("a run of arkimex is that of the library's own steps, whatever is implicit", "[imex]") {
  int drawn = 0, ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  for (const Scene& scene : imex_scenes()) {
    if (scene.n > 100 || !in_turn(++drawn, ranks, numbers_of_ranks)) continue;
    std::vector<std::pair<std::string, Implicit>> methods_and_splits;
    for (const char* method : {"arkimex:3", "arkimex:5", "arkimex:l2"})
      methods_and_splits.emplace_back(method, Implicit::friction);
    for (const Split& split : splits_of(scene))  // on several ranks the library's solvers take too long
      if (split.implicit != Implicit::friction && ranks == 1)
        methods_and_splits.emplace_back("arkimex:4", split.implicit);
    for (const auto& [name, implicit] : methods_and_splits) {
      const auto run = [&, name = name, implicit = implicit](bool fused) {
        MethodSpec spec = MethodSpec::parse("test", name + ":" + to_string(implicit));
        // a longer one carries nodes far through rest, where round-off grows a thousandfold a step without
        // Newton's method
        spec.step = Stick::applies_to(scene) ? 0.001 : 0.01;
        spec.tolerance = 1e-12;
        spec.fused = fused;
        const Model model(PETSC_COMM_WORLD, scene);
        VecHandle u = model.create_vector();
        start(model, u);
        std::vector<std::string> ignored;
        const WarningsKept kept(ignored);
        Integrator integrator(model, spec, u);
        TSType type;
        SS_TRY(TSGetType(integrator.ts(), &type));
        CHECK(std::string(type) == (fused ? "fused" : "") + spec.type);
        CHECK(integrator.report().method == name);
        integrator.advance(u, 0, 10 * spec.step, nullptr);
        return u;
      };
      INFO(to_string(scene.friction.law) << " " << to_string(scene.friction.state) << " left "
                                         << int(scene.left) << " " << name << " " << to_string(implicit));
      const VecHandle fused = run(true), library = run(false);
      // what Newton's method leaves of a stage, and the search for where a node starts or stops
      CHECK(distance(fused, library) < 1e-9 * (1 + norm(library)));
    }
  }
}

// r of the cubic: a psi + q (psi^3/3 - psi) = R, with a = 1.
TEST_CASE("of several solutions of a stage none is taken that the step does not lead to", "[imex]") {
  const Cubic cubic;
  const auto phi = [&](double psi) { return cubic.phi(psi, SignExact()).value; };
  const Product<Cubic, SignExact, NoState> friction{cubic, {}, {}};
  using Source = kernel::Within<Product<Cubic, SignExact, NoState>, false, false>;
  kernel::Coefficients c{};
  c.A = 1;
  int refused = 0, taken = 0;
  for (const double h : {0.5, 2., 20., 2000.})
    for (double psi0 = -2.5; psi0 <= 2.5; psi0 += 0.01)
      for (const double shift : {-1., -0.1, 0., 0.1, 1.}) {
        const double z_psi = psi0, z_eta = phi(psi0) + shift;
        double psi = psi0, eta = 0, g_psi, g_eta;
        kernel::Stage stage{};
        stage.z_psi = &z_psi;
        stage.z_eta = &z_eta;
        stage.start = &psi0;
        stage.psi = &psi;
        stage.eta = &eta;
        stage.g_psi = &g_psi;
        stage.g_eta = &g_eta;
        stage.h = h;
        stage.target = 1e-12;
        stage.strict = true;
        stage.count = 1;
        const long unsolved = kernel::SolveStage<Source>{{friction}}(c, stage);
        const double R = z_psi + h * z_eta;
        const auto residual = [&](double p) { return p + h * phi(p) - R; };
        const auto slope = [&](double p) { return 1 + h * (p * p - 1); };
        // the root at h, followed from h = 0 in small steps of Newton's method; lost where the slope is not
        // positive
        double followed = psi0;
        bool lost = false;
        for (int k = 1; k <= 400 && !lost; ++k) {
          const double part = h * std::pow(k / 400., 3);
          for (int round = 0; round < 30; ++round) {
            const double s = 1 + part * (followed * followed - 1);
            if (s <= 0) {
              lost = true;
              break;
            }
            const double change = (followed + part * phi(followed) - psi0 - part * z_eta) / s;
            followed -= change;
            if (std::abs(change) < 1e-13) break;
          }
        }
        INFO("h " << h << ", from " << psi0 << ", shift " << shift << ": " << psi << ", followed "
                  << followed);
        if (unsolved != 0) {
          ++refused;
          continue;
        }
        ++taken;
        CHECK(std::abs(residual(psi)) < 1e-9 * (1 + h));
        CHECK(slope(psi) > 0);
        if (!lost) CHECK(psi == Approx(followed).margin(1e-8));
      }
  CHECK(refused > 100);
  CHECK(taken > 1000);
}

TEST_CASE("what is implicit follows from the rate of friction, a smoothed threshold included", "[imex]") {
  const auto chosen = [](double gamma, const Law& law) {
    Scene scene;
    scene.n = 64;
    scene.gamma = gamma;
    scene.friction.law = law;
    scene.friction.regularised = law->jumps_at_rest;
    const Model model(PETSC_COMM_WORLD, scene);
    VecHandle u = model.create_vector();
    start(model, u);
    const Integrator integrator(model, MethodSpec(), u);
    return integrator.report().method + " " + to_string(integrator.report().implicit);
  };
  CHECK(chosen(100, "cubic") == "rk:7vr none");
  // fast waves: the looser the tolerance, the sooner; alone where they live, with friction where it damps
  // them
  const auto beside_waves = [](double v, double tolerance) {
    Scene scene;
    scene.n = 128;
    scene.length = 20;
    scene.c = 100;
    scene.v = v;
    const Model model(PETSC_COMM_WORLD, scene);
    VecHandle u = model.create_vector();
    start(model, u);
    MethodSpec spec;
    spec.tolerance = tolerance;
    const Integrator integrator(model, spec, u);
    return integrator.report().method + " " + to_string(integrator.report().implicit);
  };
  CHECK(beside_waves(1.5, 1e-6) == "rk:7vr none");
  CHECK(beside_waves(1.5, 1e-4) == "arkimex:4 both");
  CHECK(beside_waves(0.2, 1e-4) == "arkimex:4 wave");
  CHECK(chosen(300, "cubic") == "arkimex:4 friction");
  CHECK(chosen(3, "carlson-langer") == "arkimex:4 friction");
}

TEST_CASE("a step of arkimex that was rejected is followed by one no longer", "[imex]") {
  Scene scene;
  scene.form = Form::chain;  // at a smoothed threshold
  scene.n = 40;
  scene.order = 2;
  scene.friction.law = Law("carlson-langer");
  scene.friction.regularised = true;
  const Model model(PETSC_COMM_WORLD, scene);
  VecHandle u = model.create_vector();
  start(model, u);
  Integrator integrator(model, MethodSpec(), u);
  PetscReal low, high;
  TSAdapt adapt;
  PetscInt rejections = 0;
  int rejected = 0, grown = 0;
  integrator.advance(u, 0, 20, [&](const Integrator::Step& step) {
    if (step.index > 0) {
      const bool was_rejected = integrator.report().rejections > rejections;
      rejections = integrator.report().rejections;
      const bool longer = step.next_dt > (step.t - step.t_before) * (1 + 1e-12);
      rejected += was_rejected ? 1 : 0;
      grown += longer ? 1 : 0;
      if (step.t < 18) CHECK_FALSE((was_rejected && longer));  // later the end shapes the steps
    }
    return Integrator::Verdict::go_on;
  });
  CHECK(rejected > 10);
  CHECK(grown > 10);
  SS_TRY(TSGetAdapt(integrator.ts(), &adapt));
  SS_TRY(TSAdaptGetClip(adapt, &low, &high));
  CHECK(high == 10);  // as PETSc has it, for the steps that follow
}

namespace {

// (diag(d) - p D2) x, x and d of the nodes of this rank.
std::vector<double> times_matrix(const Model& model, const std::vector<double>& all_x,
                                 const std::vector<double>& d, double p) {
  std::vector<double> b;
  for (PetscInt i = 0; i < model.local(); ++i) {
    const PetscInt node = model.first() + i;
    double sum = d[std::size_t(node)] * all_x[std::size_t(node)];
    for (const auto& [column, weight] : second_difference_row(model.scene(), node))
      sum -= p * weight * all_x[std::size_t(column)];
    b.push_back(model.held(node) ? all_x[std::size_t(node)] : sum);
  }
  return b;
}

// A Vec's psi from values of all nodes.
VecHandle vector_of(const Model& model, const std::vector<double>& own) {
  VecHandle v = model.create_vector();
  double* a;
  SS_TRY(VecGetArray(v, &a));
  for (PetscInt i = 0; i < model.local(); ++i) a[i * model.dof()] = own[std::size_t(i)];
  SS_TRY(VecRestoreArray(v, &a));
  return v;
}

std::vector<Scene> band_scenes() {
  PetscMPIInt ranks;
  SS_TRY(MPI_Comm_size(PETSC_COMM_WORLD, &ranks));
  std::vector<Scene> all;
  for (const PetscInt n : {1, 2, 3, 7, 40, 88, 173, 611, 1999, 5003})
    for (const int order : {2, 4, 6, 8})
      for (const int ends : {0, 1, 2}) {
        Scene s;
        s.n = n;
        s.order = order;
        if (ends > 0) s.left = s.right = End::free;
        if (ends == 2) s.left = End::velocity;
        if (n < order + 1 || n < ranks || (order == 8 && ends == 2)) continue;
        if (n > 700 && order + ends != 4 + n % 3) continue;
        all.push_back(s);
      }
  return all;
}

}  // namespace

TEST_CASE("banded systems in pieces have the solution that they were made from", "[imex]") {
  std::mt19937 random(19);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const Scene& scene : band_scenes()) {
    const Model model(PETSC_COMM_WORLD, scene);
    const BandLayout layout(model);
    const auto system = BandSystem::make(layout);
    const auto n = std::size_t(scene.n);
    for (const double stiffness : {0., 0.3, 300.})
      for (const bool varies : {false, true}) {
        const double a = 1.3, p = stiffness * scene.h() * scene.h();
        std::vector<double> x(n), d(n, a);
        for (std::size_t i = 0; i < n; ++i) x[i] = uniform(random);
        for (std::size_t i = 0; i < n && varies; ++i) d[i] = 2 + uniform(random);
        const VecHandle b = vector_of(model, times_matrix(model, x, d, p));
        const VecHandle diagonal =
            vector_of(model, {d.begin() + model.first(), d.begin() + model.first() + model.local()});
        INFO("n " << n << " order " << scene.order << " left " << int(scene.left) << " p/h2 " << stiffness
                  << " varies " << varies);
        CHECK(system->choose(a, p, varies));
        std::vector<double> columns[2];
        for (auto& column : columns) column.assign(std::size_t(layout.size()), 0.);
        for (int k = 0; k < 2; ++k) {
          const Vec v = k == 0 ? diagonal : b;
          const double* own;
          SS_TRY(VecGetArrayRead(v, &own));
          layout.fetch(own);
          for (const BandTile& t : layout.tiles()) layout.load(t, own, 0, &columns[k][std::size_t(t.at)]);
          SS_TRY(VecRestoreArrayRead(v, &own));
        }
        for (std::size_t k = 0; k < layout.tiles().size(); ++k) {
          const auto at = std::size_t(layout.tiles()[k].at);
          system->forward(k, &columns[0][at], &columns[1][at]);
        }
        CHECK(system->couple());
        double largest = 0;
        std::vector<double> found(std::size_t(layout.size()));
        for (std::size_t k = 0; k < layout.tiles().size(); ++k) {
          const BandTile& t = layout.tiles()[k];
          const auto at = std::size_t(t.at);
          system->backward(k, &columns[0][at], &columns[1][at], &found[at]);
          for (PetscInt i = 0; i < t.count(); ++i)
            largest = std::max(largest, std::abs(found[at + std::size_t(t.place(i))] -
                                                 x[std::size_t(layout.wrapped(t.begin + i))]));
        }
        CHECK(largest < 1e-15 * 20 * (1 + 8 * stiffness));  // round-off of b over the least eigenvalue, 1
      }
  }
}

namespace {

// psi after a step h of backward Euler from u on a ring, with h grown from 0 in small parts and Newton's
// method in dense matrices; `lost` where the matrix ceases to be positive definite on the way.
std::vector<double> followed_euler(const Scene& scene, const std::vector<double>& psi0,
                                   const std::vector<double>& eta0, double h, bool& lost) {
  const auto n = std::size_t(scene.n);
  const Cubic cubic;
  std::vector<double> psi = psi0;
  constexpr int parts = 30;
  lost = false;
  for (int k = 1; k <= parts; ++k) {
    const double own = h * std::pow(double(k) / parts, 2), q = own * scene.A(), p = q * own * scene.K1();
    const double a = 1 + q * own * scene.K0();
    for (int round = 0; round < 5; ++round) {
      std::vector<double> M(n * n, 0.), r(n);
      for (std::size_t i = 0; i < n; ++i) {
        const WithSlope phi = cubic.phi(psi[i], SignExact());
        r[i] = a * psi[i] + q * phi.value - psi0[i] - q * (eta0[i] + own * scene.K0() * scene.v);
        M[i * n + i] = a + q * phi.slope;
        for (const auto& [j, weight] : second_difference_row(scene, PetscInt(i))) {
          M[i * n + std::size_t(j)] -= p * weight;
          r[i] -= p * weight * psi[std::size_t(j)];
        }
      }
      std::vector<double> band(n * n, 0.);  // the upper half, as LAPACK's Cholesky factors have it
      for (std::size_t j = 0; j < n; ++j)
        for (std::size_t i = 0; i <= j; ++i) band[j * n + n - 1 - (j - i)] = M[i * n + j];
      if (!positive_definite(band, n, n - 1)) {
        lost = true;
        return psi;
      }
      (void)solve_dense(int(n), M.data(), 1, r.data());
      for (std::size_t i = 0; i < n; ++i) psi[i] -= r[i];
    }
  }
  return psi;
}

}  // namespace

TEST_CASE("everything implicit: a step leads to the solution that grows out of its start, or is refused",
          "[imex][serial]") {
  const ImexMethod method("1bee");  // its first stage is backward Euler
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int refused = 0, taken = 0, lost_and_refused = 0;
  Scene scene;
  scene.n = 24;
  scene.order = 2;
  scene.length = 12;
  scene.delta = 0;
  scene.gamma = 30;
  const Model model(PETSC_COMM_SELF, scene);
  const BandedImex step(model, method.tableau(), Implicit::both, false);
  VecHandle u = model.create_vector(), found = model.create_vector();
  std::vector<VecHandle> slopes;
  for (int i = 0; i < 2 * method.tableau().stages; ++i) slopes.push_back(model.create_vector());
  for (const double h : {0.02, 0.05, 0.1, 0.3, 1.})
    for (int draw = 0; draw < 20; ++draw) {
      std::vector<double> psi(24), eta(24);
      double* a;
      SS_TRY(VecGetArray(u, &a));
      for (std::size_t i = 0; i < 24; ++i) {
        a[2 * i] = psi[i] = 1 + 0.1 * draw * uniform(random);
        a[2 * i + 1] = eta[i] = 0.5 * uniform(random);
      }
      SS_TRY(VecRestoreArray(u, &a));
      bool lost;
      const std::vector<double> expected = followed_euler(scene, psi, eta, h, lost);
      const bool solved = step.take(u, h, norm_of(1e-9, 1e-9, NORM_2), true, found, slopes).solved;
      if (!solved) {
        ++refused;
        lost_and_refused += lost ? 1 : 0;
        continue;
      }
      ++taken;
      if (lost) continue;  // the end may be reached all the same
      const double* g;
      double off = 0;
      SS_TRY(VecGetArrayRead(slopes[0], &g));
      for (std::size_t i = 0; i < 24; ++i) off = std::max(off, std::abs(psi[i] + h * g[2 * i] - expected[i]));
      SS_TRY(VecRestoreArrayRead(slopes[0], &g));
      INFO("h " << h << " draw " << draw);
      CHECK(off < 1e-8);
    }
  CHECK(refused > 20);
  CHECK(lost_and_refused > 10);
  CHECK(taken > 20);
}

TEST_CASE("everything implicit at fixed steps, however long: what is told as solved is a solution",
          "[imex][serial]") {
  const ImexMethod method("3");
  const StageProgram& t = method.tableau();
  const auto s = std::size_t(t.stages);
  std::mt19937 random(19);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution<>(a, b)(random); };
  int solved = 0, refused = 0;
  for (int draw = 0; draw < 120; ++draw) {
    Scene scene;
    scene.n = PetscInt(between(14, 160));
    scene.order = 2 * int(between(1, 4.99));
    scene.length = double(scene.n) * std::exp(between(-3, 0));
    scene.gamma = std::exp(between(0, 7));
    scene.delta = between(0, 0.5);
    scene.nu = draw % 5 == 0 ? 0.1 : 0;
    if (draw % 2 == 0) {
      scene.left = scene.right = End::free;
      if (draw % 4 == 0) scene.left = End::velocity;
    }
    scene.friction.law = draw % 3 == 2 ? Law("carlson-langer") : Law("cubic");
    scene.friction.regularised = draw % 3 == 2;
    scene.friction.eps = 0.1;
    if (draw % 7 == 6) {
      scene.friction.law = Law("rate-and-state");
      scene.friction.state = StateLaw("ageing");
      scene.friction.regularised = false;
    }
    const Model model(PETSC_COMM_SELF, scene);
    const BandedImex step(model, t, Implicit::both, false);
    VecHandle u = model.create_vector(), found = model.create_vector(), y = model.create_vector(),
              rhs = model.create_vector();
    double* a;
    SS_TRY(VecGetArray(u, &a));
    for (PetscInt i = 0; i < model.local() * model.dof(); ++i)
      a[i] = (i % model.dof() == 0 ? 0.4 : 0.) + between(-0.5, 0.5);
    SS_TRY(VecRestoreArray(u, &a));
    model.set_held(u);
    std::vector<VecHandle> slopes;
    for (std::size_t i = 0; i < 2 * s; ++i) slopes.push_back(model.create_vector());
    const double dt = std::exp(between(-6, 2));
    const StepTaker::Outcome outcome = step.take(u, dt, norm_of(1e-6, 1e-6, NORM_2), false, found, slopes);
    if (!outcome.solved || !outcome.finite) {
      ++refused;
      continue;
    }
    ++solved;
    for (std::size_t i = 1; i < s; ++i) {
      SS_TRY(VecCopy(u, y));
      for (std::size_t j = 0; j < s; ++j) SS_TRY(VecAXPY(y, dt * t.At[i * s + j], slopes[2 * j]));
      const double h = dt * t.At[i * s + i], rate = model.friction_rate(y), wave = model.wave_frequency();
      model.rhs(Part::full, y, rhs);
      SS_TRY(VecAXPY(rhs, -1, slopes[2 * i]));
      INFO("draw " << draw << " dt " << dt << " stage " << i << " law " << to_string(scene.friction.law)
                   << " n " << scene.n << " order " << scene.order << " gamma " << scene.gamma << " off "
                   << h * norm(rhs));
      // 1e-13 against 1 + |psi|, and what stiff terms make of the round-off of y
      const double size = 1 + norm(y) + norm(u);
      CHECK(h * norm(rhs) < 1e-12 * size * (1 + h * rate) * (1 + h * wave * (1 + h * wave)));
    }
  }
  CHECK(solved > 50);
  CHECK(refused > 20);
}
