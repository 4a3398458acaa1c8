// Time-stepping methods: order, interpolation, error control, restart and limits of every one that is
// offered, measured; refusals and warnings for those that would give a wrong answer in silence.
//
// The measurements write the table of docs/methods.md:
//     STICKSLIP_WRITE_TABLES=1 build/tests/unit "the table of methods is what is measured"
// and without the variable they are compared with it.
#include <petsclog.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <sstream>

#include "catch.hpp"
#include "shared.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/time.hpp"
#include "study/step_audit.hpp"
#include "time/methods.hpp"

using namespace stickslip;

namespace {

// A smooth ring that friction and wave shape alike.
Scene smooth_ring() {
  Scene s;
  s.n = 16;
  s.length = 6;
  return s;
}

void smooth_start(const Model& model, Vec u) {
  const Scene& s = model.scene();
  double* a;
  SS_TRY(VecGetArray(u, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double phase = 2 * M_PI * s.x(model.first() + i) / s.length;
    a[i * model.dof()] = 0.3 + 0.5 * std::sin(phase);
    a[i * model.dof() + 1] = 0.2 * std::cos(phase);
    if (model.dof() == 3) a[i * model.dof() + 2] = 1.2 + 0.3 * std::cos(phase);
  }
  SS_TRY(VecRestoreArray(u, &a));
  model.set_held(u);
}

constexpr double duration = 2;
constexpr int samples = 40;  // of the dense output, all over the steps
double sample_time(int i) { return duration * (0.0237 + 0.02411 * i); }

struct Solution {
  VecHandle end;
  std::vector<VecHandle> dense;
  TimeReport report;
};

Solution solve(const Scene& scene, const Settings& settings, double until = duration) {
  const InDatabase given(settings);
  Model model(PETSC_COMM_WORLD, scene);
  Solution s;
  s.end = model.create_vector();
  smooth_start(model, s.end);
  Integrator integrator(model, MethodSpec::from(given.options), s.end);
  std::vector<double> times;
  for (int i = 0; i < samples; ++i) {
    times.push_back(sample_time(i));
    s.dense.push_back(model.create_vector());
  }
  integrator.set_output_times([&times](double t) {
    const auto next = std::upper_bound(times.begin(), times.end(), t);
    return next == times.end() ? std::numeric_limits<double>::infinity() : *next;
  });
  std::size_t next = 0;
  warn_of_steps(model, integrator, s.end, until);
  s.report = integrator.advance(s.end, 0, until, [&](const Integrator::Step& step) {
    for (; next < times.size() && times[next] <= step.t; ++next) step.interpolate(times[next], s.dense[next]);
    return Integrator::Verdict::go_on;
  });
  return s;
}

// By the pair of order 8 with short fixed steps: error of the order of 1e-13.
const Solution& reference() {
  static std::unique_ptr<Solution> found;
  if (!found) {
    found = std::make_unique<Solution>(
        solve(smooth_ring(),
              {{"ts_type", "rk"}, {"ts_rk_type", "8vr"}, {"ts_adapt_type", "none"}, {"ts_dt", "0.004"}}));
    SS_TRY(PetscRegisterFinalize([]() -> PetscErrorCode {  // its vectors must go before MPI does
      found.reset();
      return 0;
    }));
  }
  return *found;
}

struct Errors {
  double end = 0, dense = 0;
};
Errors errors(const Solution& s) {
  Errors e;
  e.end = distance(s.end, reference().end);
  for (std::size_t i = 0; i < s.dense.size(); ++i)
    e.dense = std::max(e.dense, distance(s.dense[i], reference().dense[i]));
  return e;
}

Settings settings_of(const Method& m) {
  Settings s = {{"ts_type", m.type}};
  if (*m.subtype) s.push_back({capabilities(m).subtype_option, m.subtype});
  return s;
}

Settings with(Settings s, std::initializer_list<std::pair<std::string, std::string>> more) {
  for (const auto& pair : more) {
    s.erase(std::remove_if(s.begin(), s.end(), [&](const auto& p) { return p.first == pair.first; }),
            s.end());
    s.push_back(pair);
  }
  return s;
}

std::string step(double dt) { return number_text(dt); }

// The order at the end and between steps from two fixed steps, n and 2 n of them, in the range where the
// higher one leaves an error well above round-off.
struct Orders {
  double end, dense;
};
Orders measured_orders(const Method& m, const std::string& implicit) {
  const int n = m.order >= 7 ? 20 : m.order == 6 ? 32 : m.order == 5 ? 40 : 80;
  const Settings s = with(settings_of(m), {{"ts_adapt_type", "none"}, {"imex_implicit", implicit}});
  const Errors coarse = errors(solve(smooth_ring(), with(s, {{"ts_dt", step(duration / n)}})));
  const Errors fine = errors(solve(smooth_ring(), with(s, {{"ts_dt", step(duration / (2 * n))}})));
  return {std::log2(coarse.end / fine.end), std::log2(coarse.dense / fine.dense)};
}

std::vector<std::string> splits(const Method& m) {
  const std::vector<std::string> all = capabilities(m).parts;
  return all.empty() ? std::vector<std::string>{"auto"} : all;
}

// Steps per tolerance: does the step follow the tolerance?
bool follows_tolerance(const Settings& s) {
  const auto steps = [&](const char* tolerance) {
    return solve(smooth_ring(), with(s, {{"ts_rtol", tolerance}, {"ts_atol", tolerance}, {"ts_dt", "0.02"}}),
                 0.5)
        .report.steps;
  };
  return steps("1e-3") != steps("1e-6");
}

// Does a run that goes on from (u, t, dt, step number) go on bitwise alike, though the number passes 2^31,
// where a PetscInt ends, and the TS begins to count anew? `told`: the run that is not interrupted restarts
// the method there too.
bool restarts(const Settings& s, bool told) {
  const InDatabase given(with(s, {{"ts_rtol", "1e-4"}, {"ts_atol", "1e-4"}, {"ts_dt", "0.05"}}));
  Model model(PETSC_COMM_WORLD, smooth_ring());
  VecHandle u = model.create_vector(), kept = model.create_vector();
  smooth_start(model, u);
  double t = 0, dt = 0;
  const std::int64_t at = 5, many = (std::int64_t(1) << 31) - 8;
  Integrator whole(model, MethodSpec::from(given.options), u);
  whole.advance(u, 0, 8, [&](const Integrator::Step& now) {
    if (now.index != at) return Integrator::Verdict::go_on;
    SS_TRY(VecCopy(now.u, kept));
    t = now.t;
    dt = now.next_dt;
    return told ? Integrator::Verdict::restart : Integrator::Verdict::go_on;
  });
  REQUIRE((t > 0 && t < 7));
  Integrator rest(model, MethodSpec::from(given.options), kept);
  rest.continue_from(many + at, dt);
  rest.advance(kept, t, 8, nullptr);
  return distance(u, kept) == 0 && rest.report().steps == many + whole.report().steps;
}

std::string shown(double order) {
  char text[16];
  std::snprintf(text, sizeof text, "%.1f", order);
  return text;
}

bool quiet(const std::string& text) {
  const auto& all = warnings();
  return std::none_of(all.begin(), all.end(),
                      [&](const std::string& w) { return w.find(text) != std::string::npos; });
}

std::string refusal(const Settings& s) {
  try {
    solve(smooth_ring(), s, 0.01);
  } catch (const UsageError& e) {
    return e.what();
  }
  return "";
}

const std::string begin_mark = "<!-- table: methods -->\n", end_mark = "<!-- end of table -->\n";

}  // namespace

TEST_CASE("the table of methods is what is measured", "[serial]") {
  std::ostringstream table;
  table << begin_mark
        << "| method | order | split | order measured | between steps | error control | restart | use |\n"
        << "|---|---|---|---|---|---|---|---|\n";
  for (const Method& m : methods()) {
    std::string at_end, between, split;
    for (const std::string& implicit : splits(m)) {
      const Orders o = measured_orders(m, implicit);
      INFO(m.name() << " " << implicit << ": " << o.end << ", between steps " << o.dense);
      // The asymptotic order shows to 0.35 at these steps; high orders come out higher, since their leading
      // errors nearly cancel here.
      CHECK(o.end > m.order - 0.35);
      if (m.order < 5) CHECK(o.end < m.order + 1.35);
      CHECK(o.dense > m.order - 0.45);
      at_end += (at_end.empty() ? "" : ", ") + shown(o.end);
      between += (between.empty() ? "" : ", ") + shown(o.dense);
      split +=
          (split.empty() ? "" : ", ") +
          (implicit == "auto" ? m.kind == MethodKind::explicit_ ? std::string("none") : "both" : implicit);
    }
    const Settings s = settings_of(m);
    INFO(m.name());
    CHECK(follows_tolerance(s) == (m.adaptivity == Adaptivity::yes));
    if (m.adaptivity == Adaptivity::on_request)
      CHECK(follows_tolerance(with(s, {{"ts_adapt_type", "basic"}})));
    if (m.adaptivity == Adaptivity::never)
      CHECK_THROWS_AS(follows_tolerance(with(s, {{"ts_adapt_type", "basic"}})), UsageError);
    const bool plain = restarts(s, false), told = restarts(s, true);
    table << "| " << m.name() << " | " << m.order << " | " << split << " | " << at_end << " | " << between
          << " | "
          << (m.adaptivity == Adaptivity::yes     ? "yes"
              : m.adaptivity == Adaptivity::never ? "no"
                                                  : "with ts_adapt_type basic")
          << " | "
          << (plain  ? "bitwise"
              : told ? "bitwise, restarted at checkpoints"
                     : "to its accuracy")
          << " | " << m.use << " |\n";
  }
  table << end_mark;

  const char* source = std::getenv("STICKSLIP_SOURCE");
  const std::string path = std::string(source ? source : ".") + "/docs/methods.md";
  std::ifstream in(path);
  std::stringstream read;
  read << in.rdbuf();
  std::string page = read.str();
  const std::size_t from = page.find(begin_mark), to = page.find(end_mark);
  REQUIRE(from != std::string::npos);
  REQUIRE(to != std::string::npos);
  const std::string committed = page.substr(from, to + end_mark.size() - from);
  if (std::getenv("STICKSLIP_WRITE_TABLES")) {
    std::ofstream(path) << page.replace(from, committed.size(), table.str());
    return;
  }
  // Measured orders move in the first decimal with the compiler; everything else stands.
  std::istringstream now(table.str()), then(committed);
  std::string a, b;
  while (std::getline(now, a) && std::getline(then, b)) {
    std::istringstream cells_a(a), cells_b(b);
    for (std::string x, y; std::getline(cells_a, x, '|') && std::getline(cells_b, y, '|');) {
      double p, q;
      std::istringstream numbers_a(x), numbers_b(y);
      if (numbers_a >> p && numbers_b >> q) {
        CHECK(p == Approx(q).margin(0.25));
      } else {
        CHECK(x == y);
      }
    }
  }
  CHECK(std::count(committed.begin(), committed.end(), '\n') == static_cast<long>(methods().size()) + 4);
}

TEST_CASE("methods that would give a wrong answer are refused", "[serial]") {
  for (const char* type : {"glee", "eimex", "irk", "mimex", "glle", "pseudo", "mprk", "alpha2", "discgrad"}) {
    const std::string text = refusal({{"ts_type", type}});
    INFO(type);
    CHECK(text.find(std::string("-ts_type ") + type) == 0);
    CHECK(text.find("use one of rk, euler, ssp, arkimex") != std::string::npos);
  }
  CHECK(refusal({{"ts_type", "arkimex"}, {"ts_arkimex_type", "bpr3"}}).find("order falls to 1") !=
        std::string::npos);
  for (const char* subtype : {"lassp3p4s2c", "llssp3p4s2c", "ark3"})
    CHECK(refusal({{"ts_type", "rosw"}, {"ts_rosw_type", subtype}}).find("NaN") != std::string::npos);
  CHECK(refusal({{"ts_type", "rk"}, {"imex_implicit", "wave"}}).find("explicit") != std::string::npos);
  CHECK(refusal({{"ts_type", "cn"}, {"imex_implicit", "wave"}}).find("does not split") != std::string::npos);
  // order 2 and less with a part of the Jacobian
  for (const char* part : {"wave", "friction"})
    CHECK(refusal({{"ts_type", "rosw"}, {"imex_implicit", part}}).find("does not split") !=
          std::string::npos);
  CHECK(refusal({{"ts_adapt_type", "cfl"}}).find("ts_adapt_type cfl") == 0);
}

TEST_CASE("a fixed step is told of where somebody relies on error control", "[serial]") {
  const Settings classical = {{"ts_type", "rk"}, {"ts_rk_type", "4"}};
  solve(smooth_ring(), with(classical, {{"ts_dt", "0.0625"}}), 0.125);
  CHECK(quiet("every step is 0.0625"));  // the user knows
  solve(smooth_ring(), with(classical, {{"ts_dt", "0.0625"}, {"ts_rtol", "1e-9"}}), 0.125);
  CHECK_FALSE(
      quiet("ts_rtol has no effect: rk:4 has no error estimate and a fixed step; every step is 0.0625"));
  solve(smooth_ring(), {{"ts_type", "cn"}, {"ts_dt", "0.0625"}, {"ts_atol", "1e-9"}}, 0.125);
  CHECK_FALSE(quiet("ts_atol has no effect: cn has a fixed step unless ts_adapt_type is basic"));
  solve(smooth_ring(), {{"ts_type", "ssp"}}, 0.125);
  CHECK_FALSE(quiet("ssp:rks2 has no error estimate and a fixed step: every step is"));
  solve(smooth_ring(),
        {{"ts_type", "bdf"}, {"ts_bdf_order", "4"}, {"ts_adapt_type", "none"}, {"ts_dt", "0.0625"}}, 0.125);
  CHECK_FALSE(quiet("ts_bdf_order 4: with fixed steps the order is 2"));
}

TEST_CASE("a step beyond the stability limit is told before it explodes") {
  // Undamped waves: sliding at v = 1, where phi' = 0, without delta. The limits on the imaginary axis are
  // those of the stability polynomials: |R(iy)| = 1 at sqrt(8) for the classical method of order 4 and at
  // sqrt(3) for order 3.
  Scene s = smooth_ring();
  s.delta = 0;
  s.v = 1;
  s.n = 64;
  Model model(PETSC_COMM_WORLD, s);
  const double frequency = model.wave_frequency();
  const auto limit_told = [&](const Settings& settings, double dt) {
    const InDatabase given(with(settings, {{"ts_dt", step(dt)}}));
    VecHandle u = model.create_vector();
    SS_TRY(VecSet(u, 1));
    double* a;
    SS_TRY(VecGetArray(u, &a));
    for (PetscInt i = 0; i < model.local(); ++i) a[2 * i + 1] = -2. / 3;
    SS_TRY(VecRestoreArray(u, &a));
    const std::size_t before = warnings().size();
    const Integrator integrator(model, MethodSpec::from(given.options), u);
    warn_of_steps(model, integrator, u, 400);
    const std::string mark = "which is about ";
    for (std::size_t i = before; i < warnings().size(); ++i)
      if (const std::size_t at = warnings()[i].find(mark); at != std::string::npos)
        return std::stod(warnings()[i].substr(at + mark.size()));
    return 0.;
  };
  for (const auto& [subtype, y] : {std::pair("4", std::sqrt(8.)), std::pair("3", std::sqrt(3.))}) {
    const Settings m = {{"ts_type", "rk"}, {"ts_rk_type", subtype}};
    CHECK(limit_told(m, 0.98 * y / frequency) == 0);
    // ln 1e6 over 400 units of time; the limit is told in three digits
    CHECK(limit_told(m, 1.05 * y / frequency) == Approx(y / frequency).epsilon(0.01));
  }
  // Euler's method has no stable step for undamped waves: |R|^2 = 1 + y^2, growth dt omega^2/2 a unit of
  // time.
  const double euler = 2 * std::log(1e6) / (400 * frequency * frequency);
  CHECK(limit_told({{"ts_type", "euler"}}, 3 * euler) == Approx(euler).epsilon(0.01));
  // Adaptive and implicit methods are not at risk.
  CHECK(limit_told({{"ts_type", "rk"}, {"ts_rk_type", "5dp"}}, 1) == 0);
  CHECK(limit_told({{"ts_type", "theta"}}, 1) == 0);
  CHECK(limit_told({{"ts_type", "arkimex"}, {"imex_implicit", "wave"}, {"ts_adapt_type", "none"}}, 1) == 0);
  // Friction implicit leaves the waves explicit, with a limit of its own.
  CHECK(limit_told({{"ts_type", "arkimex"}, {"imex_implicit", "friction"}, {"ts_adapt_type", "none"}}, 1) >
        0);
}

TEST_CASE("the foreseen limit is where the run explodes", "[serial]") {
  // Friction at the turning points, psi = 2, sets the limit of a uniform motion: A (B + phi') = 9 at gamma =
  // 3.
  Scene s = smooth_ring();
  s.c = 0;
  const auto end = [&](double dt) {
    return solve(s, {{"ts_type", "rk"}, {"ts_rk_type", "4"}, {"ts_dt", step(dt)}}, 60);
  };
  CHECK_NOTHROW(end(0.2));
  CHECK(quiet("ts_dt 0.2 is beyond"));
  CHECK_THROWS_AS(end(1.5), Failure);
  CHECK_FALSE(quiet("ts_dt 1.5 is beyond the stability limit of rk:4"));
}

TEST_CASE("a second integrator on a model hears nothing of the first") {
  Model model(PETSC_COMM_WORLD, smooth_ring());
  VecHandle u = model.create_vector();
  const auto advance = [&](const Settings& s) {
    smooth_start(model, u);
    const InDatabase given(s);
    Integrator integrator(model, MethodSpec::from(given.options), u);
    integrator.advance(u, 0, duration, nullptr);
  };
  advance({{"ts_type", "rk"}});
  const Settings implicit = {{"ts_type", "cn"}, {"ts_dt", "0.1"}};
  advance(implicit);
  CHECK(distance(u, solve(smooth_ring(), implicit).end) == 0);
}

TEST_CASE("a run that explodes fails and keeps the time it reached", "[serial]") {
  Model model(PETSC_COMM_WORLD, smooth_ring());
  VecHandle u = model.create_vector();
  smooth_start(model, u);
  const InDatabase given({{"ts_type", "rk"}, {"ts_rk_type", "4"}, {"ts_dt", "2"}});
  Integrator integrator(model, MethodSpec::from(given.options), u);
  std::string what;
  try {
    integrator.advance(u, 0, 200, nullptr);
  } catch (const Failure& e) {
    what = e.what();
  }
  CHECK(what.find("the solution is not finite after step") == 0);
  CHECK(integrator.report().t < 200);
}

TEST_CASE("an adaptive run recovers from a start far too large") {
  for (const Settings& s :
       {Settings{{"ts_type", "rk"}}, Settings{{"ts_type", "rk"}, {"ts_rk_type", "8vr"}},
        Settings{{"ts_type", "arkimex"}, {"imex_implicit", "friction"}},
        Settings{{"ts_type", "arkimex"}, {"imex_implicit", "wave"}}, Settings{{"ts_type", "rosw"}}}) {
    INFO(s[0].second << " " << s.back().second);
    const Solution found =
        solve(smooth_ring(), with(s, {{"ts_dt", "1e30"}, {"ts_rtol", "1e-6"}, {"ts_atol", "1e-6"}}));
    CHECK(errors(found).end < 1e-4);
    CHECK(found.report.rejections > 0);
  }
}

TEST_CASE("the library factors a constant wave part once while the step stands", "[serial]") {
  SS_TRY(PetscLogDefaultBegin());
  SS_TRY(MatInitializePackage());  // from where on PETSc knows the event
  const auto factorizations = [&](const char* implicit, const char* lag = "") {
    PetscLogEvent event;
    PetscEventPerfInfo before, after;
    SS_TRY(PetscLogEventGetId("MatLUFactorNum", &event));
    SS_TRY(PetscLogEventGetPerfInfo(PETSC_DETERMINE, event, &before));
    Settings settings = {
        {"ts_type", "arkimex"},
        {"imex_implicit", implicit},
        {"ts_adapt_type", "none"},
        {"ts_dt", "0.125"},
        {"ksp_type", "preonly"}};  // without an option of its own the program's band is taken
    if (*lag) settings.push_back({"snes_lag_jacobian", lag});
    const InDatabase given(settings);
    Model model(PETSC_COMM_WORLD, smooth_ring());
    VecHandle u = model.create_vector();
    smooth_start(model, u);
    Integrator(model, MethodSpec::from(given.options), u).advance(u, 0, duration, nullptr);
    SS_TRY(PetscLogEventGetPerfInfo(PETSC_DETERMINE, event, &after));
    return after.count - before.count;
  };
  CHECK(factorizations("wave") == 1);
  const auto shared = factorizations("both");
  CHECK(shared >= 16);                           // at least once a step,
  CHECK(shared <= 48);                           // not at every one of its five implicit stages,
  CHECK(factorizations("both", "1") >= 16 * 5);  // where Newton's own method takes one a stage or more
}

TEST_CASE("stages that share a Jacobian are solved as well as by Newton's own method", "[serial]") {
  Scene stiff = smooth_ring();
  stiff.gamma = 100;
  const double tolerance = 1e-7;
  for (const char* implicit : {"friction", "both"}) {
    Settings settings = {{"ts_type", "arkimex"},
                         {"imex_implicit", implicit},
                         {"ts_adapt_type", "none"},
                         {"ts_dt", "0.01"},
                         {"snes_atol", number_text(1e-3 * tolerance)}};
    const Solution shared = solve(stiff, settings);
    settings.push_back({"snes_lag_jacobian", "1"});
    const Solution own = solve(stiff, settings);
    INFO(implicit);
    // each of 200 steps' six stages leaves a residual below 1e-3 of the tolerance, in rates times dt
    CHECK(distance(shared.end, own.end) < tolerance);
    CHECK(distance(shared.end, own.end) > 0);
  }
}

TEST_CASE("implicit friction is solved exactly by blocks, and tight tolerances are reached") {
  int ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  const double tolerance = ranks == 1 ? 1e-12 : 1e-7;
  for (const char* implicit : {"friction", "wave", "both"}) {
    INFO(implicit);
    const Solution tight = solve(smooth_ring(), {{"ts_type", "arkimex"},
                                                 {"ts_arkimex_type", "5"},
                                                 {"imex_implicit", implicit},
                                                 {"ts_rtol", step(tolerance)},
                                                 {"ts_atol", step(tolerance)}});
    // the error stays in proportion to the tolerance (some hundred times): Newton's method leaves nothing
    // behind
    CHECK(errors(tight).end < 1000 * tolerance);
  }
}

TEST_CASE("rk tile by tile takes the steps of PETSc's own", "[fused]") {
  Scene s = smooth_ring();
  s.n = 640;
  s.length = 600;  // steps bound by accuracy: at the limit of stability round-off grows from step to step
  for (const std::string pair : {"3bs", "5f", "5dp", "5bs", "8vr"}) {
    const Settings fused = {{"ts_type", "rk"}, {"ts_rk_type", pair}};
    const Settings own = with(fused, {{"rk_fused", "false"}});
    const Solution a = solve(s, own), b = solve(s, fused);
    INFO(pair);
    CHECK(a.report.steps == b.report.steps);
    CHECK(a.report.rejections == b.report.rejections);
    // Round-off enters the next step's size through the estimate, a difference of nearly equal values: it
    // loses up to 1e-16/1e-6 of itself, and the solution, with an error of 1e-6, follows by 1e-16 times a
    // few.
    CHECK(distance(a.end, b.end) < 1e-12);
    for (int i = 0; i < samples; ++i)
      CHECK(distance(a.dense[static_cast<std::size_t>(i)], b.dense[static_cast<std::size_t>(i)]) < 1e-12);
  }
}

TEST_CASE("the fused steps are a TS type that can be named and seen", "[fused]") {
  const auto type_of = [](const Settings& s) {
    const InDatabase given(s);
    Model model(PETSC_COMM_WORLD, smooth_ring());
    VecHandle u = model.create_vector();
    smooth_start(model, u);
    const Integrator integrator(model, MethodSpec::from(given.options), u);
    TSType type;
    SS_TRY(TSGetType(integrator.ts(), &type));
    return std::string(type) + " " + integrator.report().method;
  };
  CHECK(type_of({{"ts_type", "rk"}}) == "fusedrk rk:5dp");
  CHECK(type_of({{"ts_type", "rk"}, {"rk_fused", "false"}}) == "rk rk:5dp");
  CHECK(type_of({{"ts_type", "fusedrk"}, {"ts_rk_type", "3bs"}, {"rk_fused", "false"}}) == "fusedrk rk:3bs");
  CHECK(type_of({{"ts_type", "rk"}, {"ts_adapt_max_ignore", "0"}}) == "rk rk:5dp");
  CHECK_THROWS_AS(type_of({{"ts_type", "fusedrk"}, {"ts_adapt_max_ignore", "0"}}), UsageError);
  const Settings imex = {{"ts_type", "arkimex"}, {"imex_implicit", "friction"}};
  CHECK(type_of(imex) == "fusedarkimex arkimex:4");
  CHECK(type_of({{"ts_type", "fusedarkimex"}, {"ts_arkimex_type", "3"}}) == "fusedarkimex arkimex:3");
  CHECK(type_of(with(imex, {{"rk_fused", "false"}})) == "arkimex arkimex:4");
  // the library's own solvers where the user tunes them, and what the tiles do not take
  CHECK(type_of(with(imex, {{"snes_rtol", "1e-9"}})) == "arkimex arkimex:4");
  CHECK(type_of(with(imex, {{"imex_implicit", "both"}})) == "fusedarkimex arkimex:4");
  CHECK(type_of(with(imex, {{"imex_implicit", "both"}, {"ksp_type", "gmres"}})) == "arkimex arkimex:4");
  CHECK(type_of({{"ts_type", "fusedarkimex"}, {"imex_implicit", "wave"}}) == "fusedarkimex arkimex:4");
  CHECK(type_of(with(imex, {{"imex_implicit", "none"}})) == "arkimex arkimex:4");
  CHECK_THROWS_AS(type_of({{"ts_type", "fusedarkimex"}, {"pc_type", "lu"}}), UsageError);
  CHECK(type_of({{"ts_type", "rosw"}}) == "rosw rosw:ra34pw2");
  const Settings rk = {{"ts_type", "rk"}, {"ts_rk_type", "3bs"}}, fused = with(rk, {{"ts_type", "fusedrk"}});
  CHECK(distance(solve(smooth_ring(), rk).end, solve(smooth_ring(), fused).end) == 0);
}

TEST_CASE("what a method can do follows from its row of the table", "[methods][serial]") {
  for (const Method& m : methods()) {
    INFO(m.name());
    const Capabilities can = capabilities(m);
    CHECK(can.is_explicit == (m.kind == MethodKind::explicit_));
    CHECK(can.splits == !can.parts.empty());
    CHECK(can.subtype_option.empty() == (*m.subtype == '\0'));
    CHECK((!can.multistep || can.remembers));
    CHECK((!can.falls_short || can.degree == 0));
    // each of the parts is a way to name the method, and no other
    for (const char* part : {"friction", "wave", "both"}) {
      const std::string text = m.name() + (*m.subtype ? ":" : "::") + part;
      const bool takes = can.splits ? std::count(can.parts.begin(), can.parts.end(), part) > 0
                                    : !can.is_explicit && part == std::string("both");
      if (takes)
        CHECK_NOTHROW(MethodSpec::parse("m", text));
      else
        CHECK_THROWS_AS(MethodSpec::parse("m", text), UsageError);
    }
    if (can.fused_type.empty()) continue;
    CHECK(library_type(can.fused_type) == m.type);
    const FusedMethod steps(m.type, m.subtype);
    CHECK(steps.subtype() == m.subtype);
    CHECK((steps.program().embedded.empty() == (m.adaptivity == Adaptivity::never)));
    CHECK(steps.program().additive() == can.splits);
    // a method without a polynomial of its own keeps no slopes for one, or has one that is not good enough
    if (can.degree == 0) CHECK(steps.slopes() > 0);
  }
}
