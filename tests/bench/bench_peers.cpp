// Time to accuracy beside SUNDIALS: CVODE (Adams, BDF) and ARKODE (explicit, implicit and IMEX Runge-Kutta)
// advance the same semi-discrete systems, with this program's own loops as their right-hand side, so that
// integrators are compared and nothing else.
//
//     cmake --build build --target bench_peers && build/tests/bench_peers
//     python3 tests/bench/peers.py build/tests/bench_peers      # the same and SciPy, as one table
//
// Six scenes (peers_system.hpp): a smooth ring; stiff friction (gamma 300 and 10000), stiff coupling (c 100)
// between free ends; a held velocity that sends fronts into the medium; rate-and-state friction. SUNDIALS
// gets the tableaus that its newer releases default to, vectors compiled as this program is, and linear
// solvers that know the structure (peers_sundials.hpp). On the ring implicit methods have nothing to win.
// Errors are the largest over all unknowns at the end, against a solution of order 8 with tolerance 1e-13,
// whose own error is taken as its distance from ARKODE's pair of Fehlberg at the same tolerance. Every method
// goes down in tolerance by factors of sqrt(10) until it has each accuracy; that run counts, everything
// (set-up, factors) included: the median of the processor times of several where it comes near the best of
// its library. A run of four times the best of its library at an accuracy, or of `longest` seconds, ends what
// is asked of a method. Relative and absolute tolerance are equal. Options: -peers_repeat [5], -peers_scene
// NUMBER, -peers_only PART (of a library or method), -peers_out DIR (for peers.py: start, end and rows in
// files).
#include <slepcsys.h>

#include <cstdio>
#include <fstream>
#include <map>

#include "bench.hpp"
#include "peers_sundials.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/time/methods.hpp"

using namespace peers;

namespace {

constexpr double longest = 2;

struct Entry {
  std::string library, name;
  bool implicit;  // not on the ring
  std::function<Outcome(System&, double t_end, double tolerance)> run;
};

Outcome ours(System& system, double t_end, double tolerance, const std::string& name) {
  Outcome out;
  MethodSpec spec = MethodSpec::parse("peers", name);
  spec.tolerance = tolerance;
  VecHandle u = system.model.create_vector();
  double* a;
  SS_TRY(VecGetArray(u, &a));
  std::copy(system.start.begin(), system.start.end(), a);
  SS_TRY(VecRestoreArray(u, &a));
  try {
    Integrator integrator(system.model, spec, u, "peer_");
    const TimeReport r = integrator.advance(u, 0, t_end, [&](const Integrator::Step& step) {
      const bool late = step.index % 8 == 0 && bench::now(true) > system.deadline;
      return late ? Integrator::Verdict::stop : Integrator::Verdict::go_on;
    });
    SS_TRY(VecGetArray(u, &a));
    out = {r.t == t_end, std::vector<double>(a, a + system.size), long(r.steps + r.rejections),
           r.rhs_evaluations};
    SS_TRY(VecRestoreArray(u, &a));
  } catch (const Error&) {  // diverged, or not finite
  }
  return out;
}

void add_ours(std::vector<Entry>& all) {
  for (const std::string name :
       {"rk:7vr", "rk:3bs", "rk:5dp", "rk:8vr", "arkimex:4:friction", "arkimex:3:friction",
        "arkimex:5:friction", "arkimex:4:wave", "arkimex:3:wave", "arkimex:5:wave", "arkimex:4:both",
        "arkimex:3:both", "arkimex:5:both", "rosw:ra34pw2"})
    all.push_back({"stickslip", name, name[0] != 'r' || name[1] == 'o',
                   [name](System& s, double t, double tol) { return ours(s, t, tol, name); }});
}

void add_explicit(std::vector<Entry>& all) {
  const std::vector<std::pair<std::string, Tableau>> all_tableaus = {
      {"7 Verner", of_library("7vr", 7)},
      {"5 Cash-Karp", tableau_of(ARKODE_CASH_KARP_6_4_5)},
      {"5 Tsitouras", tsitouras5()},
      {"6 Verner", of_library("6vr", 6)},
      {"8 Verner", of_library("8vr", 8)},
      {"9 Verner", verner9()},
      {"3 Bogacki-Shampine", tableau_of(ARKODE_BOGACKI_SHAMPINE_4_2_3)},
      {"5 Dormand-Prince", tableau_of(ARKODE_DORMAND_PRINCE_7_4_5)}};
  for (const auto& [name, tableau] : all_tableaus) {
    ARKodeButcherTable_Free(table_of(tableau, true));
    std::printf("# ERK %s: %d stages, to %.2f along the imaginary axis\n", name.c_str(), tableau.stages,
                reach(tableau));
    for (const bool held : {true, false})
      all.push_back({"SUNDIALS", "ERK " + name + (held ? ", held" : ""), false,
                     [tableau = tableau, held](System& s, double t, double tol) {
                       return arkode_explicit(s, t, tol, tableau, held);
                     }});
  }
}

void add_implicit(std::vector<Entry>& all) {
  const std::vector<std::pair<std::string, ImexTables>> imex = {
      {"4 ARK437L2SA", {ARKODE_ARK437L2SA_DIRK_7_3_4, ARKODE_ARK437L2SA_ERK_7_3_4}},
      {"3 ARK324L2SA", {ARKODE_ARK324L2SA_DIRK_4_2_3, ARKODE_ARK324L2SA_ERK_4_2_3}},
      {"5 ARK548L2SAb", {ARKODE_ARK548L2SAb_DIRK_8_4_5, ARKODE_ARK548L2SAb_ERK_8_4_5}}};
  for (const auto& [name, tables] : imex)
    for (const Implicit implicit : {Implicit::friction, Implicit::wave})
      all.push_back({"SUNDIALS", "ARK " + name + " " + to_string(implicit), true,
                     [tables = tables, implicit](System& s, double t, double tol) {
                       return arkode_implicit(s, t, tol, tables, implicit);
                     }});
  for (const auto& [name, table] : {std::pair("4 ESDIRK437L2SA", ARKODE_ESDIRK437L2SA_7_3_4),
                                    std::pair("3 ESDIRK325L2SA", ARKODE_ESDIRK325L2SA_5_2_3),
                                    std::pair("5 ESDIRK547L2SA2", ARKODE_ESDIRK547L2SA2_7_4_5)})
    all.push_back(
        {"SUNDIALS", std::string("DIRK ") + name, true, [table = table](System& s, double t, double tol) {
           return arkode_implicit(s, t, tol, {table, ARKODE_ERK_NONE}, Implicit::both);
         }});
  for (const int family : {CV_BDF, CV_ADAMS})
    all.push_back({"SUNDIALS", family == CV_BDF ? "BDF" : "Adams", family == CV_BDF,
                   [=](System& s, double t, double tol) { return cvode(s, t, tol, family); }});
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(a[i])) return HUGE_VAL;
    largest = std::max(largest, std::abs(a[i] - b[i]));
  }
  return largest;
}

void write_doubles(const std::string& path, const std::vector<double>& values) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(values.data()), std::streamsize(values.size() * sizeof(double)));
}

class Race {
 public:
  Race(int number, const Case& c, PetscInt repeat, std::ofstream& rows)
      : number_(number), case_(c), system_(c.scene), repeat_(repeat), rows_(rows) {}

  const System& system() const { return system_; }
  const std::vector<double>& end() const { return reference_.u; }

  void find_reference() {
    reference_ = ours(system_, case_.t_end, 1e-13, "rk:8vr");
    const Outcome other = arkode_explicit(system_, case_.t_end, 1e-13, tableau_of(ARKODE_FEHLBERG_13_7_8));
    if (!reference_.done || !other.done) throw Failure(case_.name + ": no reference");
    std::printf("\n%s: n %d, t %g; reference to %.0e\n", case_.name.c_str(), int(case_.scene.n), case_.t_end,
                distance(reference_.u, other.u));
    std::printf("%-10s %-30s %8s %9s %10s %8s %8s %8s\n", "library", "method", "target", "tol", "error",
                "steps", "ms", "us/step");
  }

  void enter(const Entry& m) {
    if (m.implicit && case_.scene.ring()) return;
    double tolerance = 1e-2;
    for (const double target : {1e-4, 1e-6, 1e-9}) {
      double error = HUGE_VAL, first = 0;
      double& best = best_.emplace(std::pair(m.library, target), HUGE_VAL).first->second;
      const double most = std::min(longest, 4 * best);
      Outcome out;
      for (; tolerance > 3e-15 && first < most; tolerance /= std::sqrt(10.)) {
        first = timed(m, tolerance, out, most);
        error = out.done ? distance(out.u, reference_.u) : HUGE_VAL;
        if (error <= target) break;
      }
      if (!(error <= target)) return;
      std::vector<double> seconds{first};
      for (PetscInt k = 1; k < repeat_ && first < 1.5 * best; ++k)
        seconds.push_back(timed(m, tolerance, out, most));
      std::sort(seconds.begin(), seconds.end());
      const double median = seconds[seconds.size() / 2];
      best = std::min(best, median);
      std::printf("%-10s %-30s %8.0e %9.1e %10.1e %8ld %8.2f %8.2f\n", m.library.c_str(), m.name.c_str(),
                  target, tolerance, error, out.steps, 1e3 * median, 1e6 * median / double(out.steps));
      std::fflush(stdout);
      if (rows_.is_open())
        rows_ << number_ << '\t' << m.library << '\t' << m.name << '\t' << target << '\t' << error << '\t'
              << median << '\t' << out.steps << std::endl;
      if (median > 4 * best) return;
    }
  }

 private:
  double timed(const Entry& m, double tolerance, Outcome& out, double most) {
    const double begin = bench::now(true);
    system_.deadline = begin + most;
    out = m.run(system_, case_.t_end, tolerance);
    system_.deadline = HUGE_VAL;
    return bench::now(true) - begin;
  }

  int number_;
  const Case& case_;
  System system_;
  PetscInt repeat_;
  std::ofstream& rows_;
  Outcome reference_;
  std::map<std::pair<std::string, double>, double> best_;
};

void run() {
  PetscInt repeat = 5, scene = -1;
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-peers_repeat", &repeat, nullptr));
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-peers_scene", &scene, nullptr));
  char folder[512] = "", only[128] = "";
  SS_TRY(PetscOptionsGetString(nullptr, nullptr, "-peers_only", only, sizeof only, nullptr));
  SS_TRY(PetscOptionsGetString(nullptr, nullptr, "-peers_out", folder, sizeof folder, nullptr));
  std::ofstream rows;
  if (*folder) rows.open(std::string(folder) + "/rows.tsv");
  SS_TRY(PetscPrintf(PETSC_COMM_WORLD, "# %d repeats, processor time; flags: %s\n", int(repeat),
                     STICKSLIP_FLAGS));
  std::vector<Entry> all;
  add_ours(all);
  add_explicit(all);
  add_implicit(all);
  const std::vector<Case> every = cases();
  for (int number = 0; number < int(every.size()); ++number) {
    if (scene >= 0 && scene != number) continue;
    Race race(number, every[std::size_t(number)], repeat, rows);
    race.find_reference();
    if (*folder) {
      const std::string stem = std::string(folder) + "/" + std::to_string(number);
      write_doubles(stem + ".start", race.system().start);
      write_doubles(stem + ".end", race.end());
    }
    for (const Entry& m : all)
      if ((m.library + " " + m.name).find(only) != std::string::npos) race.enter(m);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (SlepcInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  install_error_handler();
  register_time_steppers();
  try {
    run();
  } catch (const std::exception& e) {
    (void)PetscPrintf(PETSC_COMM_WORLD, "bench_peers: %s\n", e.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
  return SlepcFinalize() ? 1 : 0;
}
