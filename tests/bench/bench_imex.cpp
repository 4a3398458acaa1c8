// A stage with friction, the wave or everything implicit against an explicit one: processor time of a step of
// arkimex:3 and arkimex:4 and of rk:5dp from the same u, over their stages.
//     bench_imex [-bench_n 10000] [-bench_trials 15] [-bench_repeat 20] [-bench_clock cpu] [-bench_order 4]
//                [-bench_implicit friction,wave,both] [-bench_laws 1]
// -bench_laws 1: the cubic law with gamma = 300 alone, 5: all. The length of a step is what a tolerance of
// 1e-6 asks of arkimex:4 from a smooth start, or -bench_dt; with -bench_factor 1 each step is of another
// length, so that it makes the factors of the linear system anew.
#include <slepceps.h>

#include <cmath>

#include "bench.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/time/time.hpp"
#include "time/methods.hpp"

using namespace stickslip;

namespace {

struct Case {
  const char* name;
  std::vector<Given> given;
};

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"cubic", {{"model_gamma", "300", ""}}},
      {"cubic, gamma 10000", {{"model_gamma", "10000", ""}}},
      {"carlson-langer", {{"friction_law", "carlson-langer", ""}, {"friction_stick", "regularised", ""}}},
      {"coulomb", {{"friction_law", "coulomb", ""}, {"friction_stick", "regularised", ""}}},
      {"rate-and-state",
       {{"friction_law", "rate-and-state", ""}, {"state_law", "ageing", ""}, {"model_v", "0.3", ""}}}};
  return all;
}

PetscInt number(const char* option, PetscInt value) {
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, option, &value, nullptr));
  return value;
}

void start(const Model& model, Vec u) {
  double* a;
  const Scene& s = model.scene();
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double x = s.x(model.first() + i) / s.length;
    a[i * model.dof()] = s.v + 0.3 * s.v * std::sin(6 * x);
    a[i * model.dof() + 1] = model.friction(i, s.v, model.dof() == 3 ? model.steady_state(s.v) : 0).F;
    if (model.dof() == 3) a[i * model.dof() + 2] = model.steady_state(s.v);
  }
  SS_TRY(VecRestoreArray(u, &a));
}

// Advances u into the motion, and returns the step that its error asks for.
double usual_step(const Model& model, const std::string& implicit, Vec u) {
  const MethodSpec spec = MethodSpec::parse("bench", "arkimex:4:" + implicit);
  Integrator integrator(model, spec, u);
  double dt = 0;
  integrator.advance(
      u, 0, 50,
      [&](const Integrator::Step& step) {
        dt = step.next_dt;
        return Integrator::Verdict::go_on;
      },
      40);
  SS_TRY(PetscOptionsGetReal(nullptr, nullptr, "-bench_dt", &dt, nullptr));
  return dt;
}

void compare(const Case& c, const std::string& implicit) {
  const PetscInt n = number("-bench_n", 10000);
  std::vector<Given> given = c.given;
  for (const auto& [name, text] :
       {std::pair("grid_n", std::to_string(n)), std::pair("bc_left", std::string("free")),
        std::pair("bc_right", std::string("free")),
        std::pair("grid_order", std::to_string(number("-bench_order", 4)))})
    given.push_back({name, text, ""});
  const Model model(PETSC_COMM_WORLD, Scene::from(Options::from("run", given), false));
  const VecHandle u = model.create_vector(), found = model.create_vector();
  start(model, u);
  const ErrorNorm norm{Tolerances(), NORM_2};
  const double dt = usual_step(model, implicit, u);
  const Implicit what = implicit == "friction" ? Implicit::friction
                        : implicit == "wave"   ? Implicit::wave
                                               : Implicit::both;
  std::vector<std::unique_ptr<StepTaker>> steps;
  for (const auto& [type, subtype] :
       {std::pair(TSRK, TSRK5DP), std::pair(TSARKIMEX, TSARKIMEX3), std::pair(TSARKIMEX, TSARKIMEX4)}) {
    steps.push_back(FusedMethod(type, subtype).make(model, what, false));
  }
  const double short_dt = std::min(dt, 0.1 / std::max(model.wave_frequency(), model.friction_rate(u)));
  const bool anew = number("-bench_factor", 0) != 0;
  bool solved = true;
  double factor = 1;
  const auto step = [&](std::size_t k) {
    return [&, k] {
      if (anew) factor = factor > 1.01 ? 1 : factor * (1 + 1e-6);
      solved = steps[k]->take(u, dt * factor, norm, true, found, {}).solved && solved;
    };
  };
  const auto seconds =
      bench::interleaved(PETSC_COMM_WORLD, int(number("-bench_trials", 15)), number("-bench_repeat", 20),
                         {[&] { steps[0]->take(u, short_dt, norm, true, found, {}); }, step(1), step(2)});
  double ns[3];
  for (std::size_t k = 0; k < 3; ++k) ns[k] = 1e9 * seconds[k].median / double(n) / steps[k]->stages();
  SS_TRY(PetscPrintf(PETSC_COMM_WORLD,
                     "%-18s %-8s dt %.3g (times the rate of friction %.3g, of the wave %.3g), %s: ns a node "
                     "and stage: rk:5dp "
                     "%.2f, arkimex:3 %.2f (%.1f), arkimex:4 %.2f (%.1f)\n",
                     c.name, implicit.c_str(), dt, dt * model.friction_rate(u), dt * model.wave_frequency(),
                     solved ? "solved" : "NOT SOLVED", ns[0], ns[1], ns[1] / ns[0], ns[2], ns[2] / ns[0]));
}

void run() {
  char text[64] = "friction,wave,both";
  SS_TRY(PetscOptionsGetString(nullptr, nullptr, "-bench_implicit", text, sizeof text, nullptr));
  const auto laws = std::size_t(number("-bench_laws", 5));
  for (std::size_t k = 0; k < std::min(laws, cases().size()); ++k)
    for (const std::string& implicit : split(text, ',')) compare(cases()[k], implicit);
}

}  // namespace

int main(int argc, char** argv) {
  if (SlepcInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  try {
    run();
  } catch (const std::exception& e) {
    (void)PetscPrintf(PETSC_COMM_WORLD, "bench_imex: %s\n", e.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
  return SlepcFinalize() ? 1 : 0;
}
