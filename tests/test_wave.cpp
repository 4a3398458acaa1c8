#include <Eigen/LU>
#include <cmath>
#include <ctime>

#include "catch.hpp"
#include "commands/problems.hpp"
#include "numerics/condensed_period.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/waves/train.hpp"
#include "waves/train_field.hpp"

using namespace stickslip;

namespace {

Scene undamped(double v) {
  Scene scene;
  scene.delta = 0;
  scene.v = v;
  return scene;
}

Branch continue_train(const Options& options, const char* name, double to, int steps) {
  return stickslip::continue_train(train_family(options, name), options.real(name), to, steps);
}

// The period at the train's r2 by the integrator, which knows nothing of the collocation.
double integrated_period(const Train& train) { return find_orbit(*train.oscillator, train.r2, 1e-13).period; }

}  // namespace

TEST_CASE("a closed chain of matrices is solved, growing and shrinking", "[wave][serial]") {
  const int d = 2;
  const size_t N = 60;
  std::vector<std::complex<double>> phi, rhs, y(N * d);
  for (size_t i = 0; i < N; ++i) {
    const double grow = i % 20 < 10 ? 8 : .1;
    for (double e : {grow, .3 * std::sin(double(i)), .2, .5 / grow})
      phi.push_back({e, .1 * std::cos(double(i))});
    for (int a = 0; a < d; ++a) y[i * d + size_t(a)] = {std::sin(double(i + size_t(a))), double(i % 3)};
  }
  const std::complex<double> phase = std::polar(1., .7);
  for (size_t i = 0; i < N; ++i)
    for (size_t a = 0; a < d; ++a) {
      std::complex<double> next = i + 1 < N ? y[(i + 1) * d + a] : phase * y[a];
      for (size_t b = 0; b < d; ++b) next -= phi[(i * d + a) * d + b] * y[i * d + b];
      rhs.push_back(next);
    }
  const CyclicChain<std::complex<double>> chain(d, N, phi);
  Matrix<std::complex<double>> y0 = chain.reduce(1, rhs);
  y0 = chain.closure(phase).partialPivLu().solve(y0).eval();
  const std::complex<double> one = 1;
  const auto solution = chain.expand(1, rhs, &one, y0.data(), phase);
  for (size_t i = 0; i < solution.size(); ++i) CHECK(std::abs(solution[i] - y[i]) < 1e-12);
}

TEST_CASE("speeds on a ring of length 100", "[wave]") {
  const double known[][2] = {{2, 5.22294}, {4, 2.68955}, {8, 1.49591}, {11, 1.21281}};
  for (auto& k : known) {
    const Train train = solve_train(undamped(.5), {PetscInt(k[0]), 100., {}});
    CHECK(train.speed == Approx(k[1]).margin(6e-6));
    CHECK(train.period == Approx(integrated_period(train)).epsilon(1e-12));
    CHECK(train.speed * train.period * k[0] == Approx(100).epsilon(1e-13));
    CHECK(train.error_estimate < 1e-10 * train.speed);
    CHECK(train.residual < 1e-11);
  }
}

TEST_CASE("lengths agree with the integrated orbit from fast trains to V = c", "[wave]") {
  Scene scene;
  for (bool derived : {true, false}) {
    scene.derived_sign = derived;
    for (double excess : {1e3, 4., .5, .05, 1e-2, 1e-4, 1e-6}) {
      const Train train = solve_train(scene, {1, {}, -(1 + excess)});
      CHECK(train.length == Approx((1 + excess) * integrated_period(train)).epsilon(1e-11));
      CHECK(train.speed == -(1 + excess));
    }
  }
}

TEST_CASE("length to speed and back", "[wave]") {
  Scene scene;
  scene.c = 2;
  scene.v = -.6;
  const Train from_speed = solve_train(scene, {3, {}, 2.2});
  const Train from_length = solve_train(scene, {3, from_speed.length, {}});
  CHECK(from_length.speed == Approx(2.2).epsilon(1e-11));
  CHECK(from_length.psi_max == Approx(from_speed.psi_max).epsilon(1e-9));
}

TEST_CASE("limits of a train", "[wave]") {
  SECTION("V to c: the length of a pulse falls to its bound like mu^(-4/3)") {
    const Scene scene = undamped(.5);
    const double l = shortest_pulse(scene);
    CHECK(l == Approx(3 * (3 - .75 * std::log(3.75 / .75))).epsilon(1e-14));
    double last = 0;
    for (double excess : {1e-5, 1e-7}) {
      const double gap = solve_train(scene, {1, {}, 1 + excess}).length / l - 1;
      CHECK(gap > 0);
      if (last > 0) CHECK(std::log(last / gap) / std::log(100.) == Approx(2. / 3).margin(.03));
      last = gap;
    }
  }
  SECTION("V much larger than c: the uniform oscillation") {
    const Scene scene = undamped(.5);
    CHECK(solve_train(scene, {1, {}, 1e6}).period == Approx(uniform_orbit(scene).period).epsilon(1e-10));
  }
  SECTION("no coupling: any speed, one period") {
    Scene scene = undamped(.5);
    const double T = uniform_orbit(scene).period;
    scene.c = 0;
    CHECK(solve_train(scene, {4, 20., {}}).speed == Approx(20 / (4 * T)).epsilon(1e-11));
  }
  SECTION("near the threshold the frequency is that of the linear wave") {
    const Train train = solve_train(undamped(1 - 1e-7), {1, 5., {}});
    // omega = k V with r2 omega^2 = 1
    CHECK(train.speed == Approx(std::hypot(1, 5 / (2 * M_PI))).epsilon(5e-6));
  }
}

TEST_CASE("damping scales out of a train", "[wave]") {
  for (bool derived : {true, false}) {
    Scene damped;
    damped.derived_sign = derived;
    const double a2 = 1 - damped.s_delta() / damped.gamma;
    Scene plain = damped;
    plain.delta = 0;
    plain.gamma *= a2;
    plain.v /= std::sqrt(a2);
    const Train one = solve_train(damped, {4, 50., {}}), other = solve_train(plain, {4, 50., {}});
    CHECK(one.speed == Approx(other.speed).epsilon(1e-12));
    CHECK(one.psi_min == Approx(std::sqrt(a2) * other.psi_min).epsilon(1e-9));
  }
}

TEST_CASE("the error estimate of a train holds, and is not idle", "[wave][serial]") {
  int meaningful = 0;
  for (double gamma : {1., 3., 20.})
    for (double speed : {1.0001, 1.02, 1.5, 5.}) {
      Scene scene;
      scene.gamma = gamma;
      scene.v = .5;
      const double truth = speed * integrated_period(solve_train(scene, {1, {}, speed}));
      for (double tolerance : {1e-4, 1e-5, 1e-6, 1e-8, 1e-10}) {
        const Train train = solve_train(scene, {1, {}, speed}, tolerance);
        const double error = std::abs(train.length - truth);
        CHECK(train.error_estimate <= tolerance * train.length);
        CHECK(error <= train.error_estimate);
        if (error > 1e-13 * truth) {
          ++meaningful;
          CHECK(train.error_estimate < 1e4 * error);
        }
      }
    }
  CHECK(meaningful >= 20);
}

TEST_CASE("the profile obeys the differential equation between the points", "[wave][serial]") {
  const Train train = solve_train(Scene(), {1, {}, 1.1});
  const Oscillator& o = *train.oscillator;
  const double h = 1e-5;
  for (double phase = .0123; phase < 1; phase += .0371) {
    double y[3], dy[3], before[3], after[3];
    train.at(phase, y);
    train.at(phase - h, before);
    train.at(phase + h, after);
    o.rhs(train.r2, y, dy, nullptr);
    for (int a = 0; a < 2; ++a)
      CHECK((after[a] - before[a]) / (2 * h * train.period) ==
            Approx(dy[a]).margin(1e-5 * (1 + std::abs(dy[0]))));
    // psi_t = A (eta - B psi - F)
    CHECK(o.A() * (train.eta_at(phase) - o.partials(y[0], 0).F) ==
          Approx(dy[0]).margin(1e-9 * (1 + std::abs(dy[0]))));
  }
}

TEST_CASE("other laws carry trains too", "[wave]") {
  Scene scene;
  double accuracy = 1e-11;
  SECTION("regularised carlson-langer") {
    scene.friction.law = Law("carlson-langer");
    scene.friction.regularised = true;
    scene.friction.eps = .01;
  }
  SECTION("a state law, whose |psi| has a kink") {
    accuracy = 1e-9;
    scene.friction.state = StateLaw("contact-age");
    scene.friction.values["state_b"] = 0.3;
  }
  const Train train = solve_train(scene, {2, 60., {}});
  CHECK(train.period == Approx(integrated_period(train)).epsilon(accuracy));
  CHECK(train.error_estimate < 1e-8);
}

TEST_CASE("trains with a state law that another integration knows", "[wave][state]") {
  struct Known {
    double gamma, delta, v;
    StateLaw law;
    double b, D, speed, period;
  };
  for (const Known& k : {Known{2.57, .05, 1.02, "slip", .2, .5, 1.71, 5.85493331},
                         Known{2.19, 0, .87, "ageing", .25, .3, 3.23, 8.452164571},
                         Known{2.18, 0, .72, "slip", .25, .3, 3.55, 7.401315636}}) {
    Scene scene;
    scene.gamma = k.gamma;
    scene.delta = k.delta;
    scene.v = k.v;
    scene.friction.law = "rate-and-state";
    scene.friction.state = k.law;
    scene.friction.values["friction_a"] = .1;
    scene.friction.values["friction_b"] = k.b;
    scene.friction.values["friction_D"] = k.D;
    const Train train = solve_train(scene, {1, {}, k.speed});
    CHECK(train.period == Approx(k.period).epsilon(2e-9));
  }
}

TEST_CASE("trains that cannot be are refused with the reason", "[wave]") {
  const Scene scene = undamped(.5);
  CHECK_THROWS_WITH(solve_train(scene, {1, {}, .9}), Contains("|V| > model_c"));
  CHECK_THROWS_AS(solve_train(scene, {1, {}, -1.}), UsageError);
  CHECK_THROWS_AS(solve_train(scene, {0, 100., {}}), UsageError);
  CHECK_THROWS_AS(solve_train(scene, {1, 100., 2.}), UsageError);
  CHECK_THROWS_AS(solve_train(scene, {1, {}, {}}), UsageError);
  CHECK_THROWS_AS(solve_train(undamped(1), {1, 100., {}}), Failure);
  // ceil(100/5.3788) - 1 = 18 fit
  CHECK_THROWS_WITH(solve_train(scene, {19, 100., {}}), Contains("at most 18 fit"));
  CHECK(solve_train(scene, {18, 100., {}}).speed > 1);
  Scene chain;
  chain.form = Form::chain;
  CHECK_THROWS_WITH(solve_train(chain, {1, 100., {}}), Contains("continuum only"));
  Scene spread;
  spread.spread = .1;
  CHECK_THROWS_AS(solve_train(spread, {1, 100., {}}), UsageError);
}

TEST_CASE("the cost of a train is linear in its mesh", "[wave][serial]") {
  // seconds a point between two meshes eight times apart, each the best of three
  auto best = [](double tolerance, size_t& points) {
    double seconds = 1e9;
    for (int i = 0; i < 3; ++i) {
      const clock_t begin = clock();
      points = solve_train(Scene(), {1, {}, 1.05}, tolerance).intervals();
      seconds = std::min(seconds, double(clock() - begin) / CLOCKS_PER_SEC);
    }
    return seconds;
  };
  size_t few, many;
  const double fast = best(1e-8, few), slow = best(1e-12, many);
  CHECK(fast < 1);
  CHECK(slow < 2. * fast * double(many) / double(few) + .02);
}

TEST_CASE("a branch through the canard explosion to the Hopf point", "[wave][branch][serial]") {
  // options as a user gives them, without a database
  const Options options = Options().with("model_delta", 0.).with("wave_length", 50.).with("wave_pulses", "2");
  const Branch branch = continue_train(options, "model_v", 1.1, 100);
  REQUIRE(branch.points.size() > 10);
  CHECK_THAT(branch.end, Contains("amplitude vanishes at model_v = 1,"));
  int folds = 0;
  double largest_step = 0;
  for (size_t i = 0; i < branch.points.size(); ++i) {
    const Train& train = branch.points[i].train;
    CHECK(train.speed * train.period * 2 == Approx(50).epsilon(1e-12));
    folds += branch.points[i].fold;
    if (i > 0)
      largest_step = std::max(largest_step, std::abs(train.psi_min - branch.points[i - 1].train.psi_min));
  }
  // the speed is no function of v near the explosion: one fold each way
  CHECK(folds == 2);
  CHECK(largest_step < .3);
  // points of the branch are trains: the integrator agrees, on the branch that attracts it
  for (size_t i : {branch.points.size() / 4, branch.points.size() - 3}) {
    const Train& train = branch.points[i].train;
    CHECK(train.period == Approx(integrated_period(train)).epsilon(1e-7));
  }
}

TEST_CASE("branches in length and speed agree with trains solved for alone", "[wave][branch][serial]") {
  const Options options = Options().with("wave_length", 30.);
  const Branch branch = continue_train(options, "wave_length", 6, 40);
  CHECK(branch.points.back().value == 6);
  CHECK_THAT(branch.end, Contains("reached"));
  CHECK(branch.points.back().train.speed == Approx(solve_train(Scene(), {1, 6., {}}).speed).epsilon(1e-9));
  const Branch down = continue_train(Options().with("wave_speed", 2.), "wave_speed", 1.01, 40);
  CHECK(down.points.back().train.length == Approx(solve_train(Scene(), {1, {}, 1.01}).length).epsilon(1e-9));
}

TEST_CASE("a branch of canards that differ by less than round-off in the parameter",
          "[wave][branch][serial]") {
  const Options options =
      Options().with("model_delta", 0.).with("model_gamma", 10.).with("model_v", .99).with("wave_speed", 2.);
  const Branch branch = continue_train(options, "model_v", 1.1, 200);
  CHECK_THAT(branch.end, Contains("amplitude vanishes at model_v = 1,"));
  int on_the_spot = 0;  // within 1e-9 of the explosion, though psi_min runs from -1.9 to 0.7
  for (const BranchPoint& point : branch.points) on_the_spot += std::abs(point.value - .99905715378) < 1e-9;
  CHECK(on_the_spot > 20);
}

// Beside a solution, at the distance e, a step of Newton's method leads back to it but for e^2: half the
// distance leaves a quarter. A derivative that is wrong would leave a half.
TEST_CASE("the linearised equations of a train are those of its residual", "[wave][branch][serial]") {
  for (const char* given : {"wave_length", "wave_speed"}) {
    const Options options = Options().with(given, given[5] == 'l' ? "12" : "2");
    const TrainFamily family = train_family(options, "model_v");
    const TrainCase asked = family.at(.3);
    const Train train = solve_train(asked.scene, asked.request, 1e-6);
    PeriodicEquations problem(train.mesh, fields_of(family.at), .3, 1);
    std::vector<double> x = problem.fill(profile_of(train), TrainField(asked).number_of(train));
    const auto conditions = [&](double right) {
      return train_conditions(problem.dim(), {.5, 2, 3}, right);
    };
    const double right = .5 * x[1] + 2 * x[x.size() - 2] + 3 * x.back();
    REQUIRE(problem.newton(x, conditions(right)).converged);
    const auto left = [&](double distance) {
      std::vector<double> moved = x;
      for (size_t k = 0; k < x.size(); ++k) moved[k] += distance * std::sin(1. + 3. * double(k));
      const PeriodicEquations::Step step = problem.step(moved, conditions(right));
      double most = 0;
      for (size_t k = 0; k < x.size(); ++k) most = std::max(most, std::abs(moved[k] + step.dx[k] - x[k]));
      return most;
    };
    const double far = left(2e-5), near = left(1e-5);
    CHECK(near < 1e-6);
    CHECK(far / near == Approx(4).epsilon(.1));
  }
}

TEST_CASE("branches that cannot be", "[wave][branch][serial]") {
  const Options options = Options().with("wave_length", 50.);
  CHECK_THROWS_AS(continue_train(options, "grid_length", 80, 5), Failure);
  auto asked = [&](const char* name, const char* to) {
    return options.with("wave_continue", name).with("wave_to", to);
  };
  CHECK_THROWS_WITH(check_branch(asked("model_w", "1")), Contains("did you mean model_"));
  CHECK_THROWS_AS(check_branch(asked("model_gamma", "-1")), UsageError);
  CHECK_THROWS_AS(check_branch(asked("wave_speed", "2")), UsageError);
  CHECK_THROWS_AS(check_branch(asked("grid_n", "2")), UsageError);
  CHECK_THROWS_AS(check_branch(options.with("wave_continue", "model_v")), UsageError);
}
