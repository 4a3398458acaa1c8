// A stage with friction implicit against an explicit one, both tile by tile: processor time of a step of arkimex:3 and
// arkimex:4 and of rk:5dp from the same u, over their stages.
//     bench_imex [-bench_n 10000] [-bench_trials 15] [-bench_repeat 20] [-bench_clock cpu]
#include <slepceps.h>

#include <cmath>

#include "bench.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/time/time.hpp"
#include "time/fused_imex.hpp"
#include "time/fused_methods.hpp"

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
      {"rate-and-state", {{"friction_law", "rate-and-state", ""}, {"state_law", "ageing", ""}, {"model_v", "0.3", ""}}}};
  return all;
}

void run() {
  PetscInt n = 10000, trials = 15, repeat = 20;
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_n", &n, nullptr));
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_trials", &trials, nullptr));
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_repeat", &repeat, nullptr));
  for (const Case& c : cases()) {
    std::vector<Given> given = c.given;
    for (const auto& [name, text] : {std::pair("grid_n", std::to_string(n)), std::pair("bc_left", std::string("free")),
                                     std::pair("bc_right", std::string("free"))})
      given.push_back({name, text, ""});
    const Model model(PETSC_COMM_WORLD, Scene::from(Options::from("run", given), false));
    VecHandle u = model.create_vector(), found = model.create_vector();
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
    const ErrorNorm norm{1e-6, 1e-6, NORM_2};
    // into the motion, and to the step that its error asks for
    MethodSpec spec = MethodSpec::parse("bench", "arkimex:4:friction");
    Integrator integrator(model, spec, u);
    double dt = 0;
    integrator.advance(u, 0, 50, [&](const Integrator::Step& step) {
      dt = step.next_dt;
      return Integrator::Verdict::go_on;
    }, 40);
    const auto explicit_method = FusedMethod::of(TSRK), third = FusedMethod::of(TSARKIMEX), fourth = FusedMethod::of(TSARKIMEX);
    explicit_method->set_subtype(TSRK5DP);
    third->set_subtype(TSARKIMEX3);
    fourth->set_subtype(TSARKIMEX4);
    std::vector<std::unique_ptr<TiledStep>> steps;
    for (const auto* m : {explicit_method.get(), third.get(), fourth.get()}) steps.push_back(m->make(model, false));
    const double short_dt = std::min(dt, 0.1 / std::max(model.wave_frequency(), model.friction_rate(u)));
    bool solved = true;
    const auto seconds = bench::interleaved(
        PETSC_COMM_WORLD, int(trials), repeat,
        {[&] { steps[0]->take(u, short_dt, norm, true, found, {}); },
         [&] { solved = steps[1]->take(u, dt, norm, true, found, {}).solved && solved; },
         [&] { solved = steps[2]->take(u, dt, norm, true, found, {}).solved && solved; }});
    double ns[3];
    for (std::size_t k = 0; k < 3; ++k) ns[k] = 1e9 * seconds[k].median / double(n) / steps[k]->stages();
    SS_TRY(PetscPrintf(PETSC_COMM_WORLD,
                       "%-20s dt %.3g (times the rate of friction %.3g), %s: ns a node and stage: rk:5dp %.2f, "
                       "arkimex:3 %.2f (%.1f), arkimex:4 %.2f (%.1f)\n",
                       c.name, dt, dt * model.friction_rate(u), solved ? "solved" : "NOT SOLVED", ns[0], ns[1],
                       ns[1] / ns[0], ns[2], ns[2] / ns[0]));
  }
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
