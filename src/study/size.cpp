#include "stickslip/study/size.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "base/process.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/time/stick.hpp"
#include "time/integrator_impl.hpp"
#include "time/methods.hpp"

namespace stickslip {

namespace {

constexpr double of_rank = 55e6;         // the libraries
constexpr double too_small = 1e8;        // what any machine has
constexpr double most_of_a_node = 4000;  // bytes, so that small scenes are not looked at

// ---- bytes of a node (size.hpp)

// A method as a run takes it.
struct Way {
  std::string type = TSRK, subtype = TSRK5DP;
  Implicit implicit = Implicit::none;
  bool fused = true;
  bool fixed = false;  // steps

  std::string name() const { return subtype.empty() ? type : type + ":" + subtype; }
  const Method& method() const {
    return subtype.empty() ? offered_type(type) : offered_method(type, subtype);
  }
  bool is_explicit() const { return capabilities(method()).is_explicit; }
  // Slopes that it keeps of a step: of every stage, of an implicit-explicit one two.
  int slopes() const { return type == TSRK || type == TSARKIMEX ? FusedMethod(type, subtype).slopes() : 0; }
};

double of_unknowns(const Scene& scene) { return scene.friction.has_state() ? 24 : 16; }

double bytes_of_run(const Options& options, const Scene& scene, const Way& way) {
  const bool sticks = Stick::applies_to(scene), file = options.is_set("out_file");
  const double exponents = double(options.integer("lyapunov_count")), dof = of_unknowns(scene) / 8;
  double vectors = 4, entries = 0;  // entries: of a matrix and its factors, in parts of a block
  if (way.fixed) vectors += 5.5;
  if (file || exponents > 0 || sticks) vectors += way.slopes() + 5;
  if (file && options.is_set("out_checkpoint_every")) vectors += 3;
  if (file && options.boolean("out_displacement")) vectors += 6 + 3 * scene.order;
  const bool smoothed = scene.friction.regularised;
  if (smoothed) vectors += 1;
  if (options.boolean("out_events")) vectors += smoothed || dof > 2 ? 15 : 8;
  if (exponents > 0) vectors += 11 + 7 * exponents;
  if (sticks) vectors += 5;
  const bool wave = way.implicit == Implicit::wave || way.implicit == Implicit::both;
  if (way.fused) {
    vectors += wave ? 13 : 0;
  } else if (way.is_explicit()) {
    vectors += std::max(3, 2 * way.slopes() + 2);
  } else {
    vectors += way.type == TSARKIMEX ? 18 : 12;
    entries = wave ? 94 + 12 * scene.order * (scene.ring() ? 2 : 1) : 30;
  }
  return vectors * of_unknowns(scene) + entries * dof * dof + (scene.unit_amplitude() ? 0 : 8);
}

double bytes_of_spectrum(const Options& options, const Scene& scene) {
  if (scene.form == Form::chain) return 500;
  return 736 + 145. * scene.order + 18 * double(options.integer("spectrum_count"));
}

double bytes_of_boundary(const Options& options, const Scene& scene) {
  if (options.text("boundary_of") == "stick-slip") return 16;
  const bool held = scene.left == End::velocity || scene.right == End::velocity;
  return held ? 640 + 69. * scene.order : 300 + 45. * scene.order;
}

// What the start takes where symmetry may leave fewer nodes.
double bytes_of_start(const Scene& scene) { return of_unknowns(scene) + 76; }

bool may_reduce(const Options& options, const Scene& scene) {
  const bool whole = options.boolean("out_events") || options.integer("lyapunov_count") > 0;
  return !whole && options.text("scene_reduce") != "off" && promised_cells(scene, options) > 1;
}

// As far as the options tell.
double bytes_of(const Options& options, const Scene& scene) {
  if (options.command() == "spectrum") return bytes_of_spectrum(options, scene);
  if (options.command() == "boundary") return bytes_of_boundary(options, scene);
  if (options.command() == "chart") return 183;
  if (may_reduce(options, scene)) return bytes_of_start(scene);
  Way least;  // nothing takes less, of methods that keep no slopes
  least.type = TSEULER;
  least.subtype = "";
  return bytes_of_run(options, scene, least);
}

// ---- what is there

struct Need {
  double bytes, there;
  double part() const { return bytes > 0 ? bytes / std::max(there, 1.) : 0; }
};

// `own`: bytes of this rank.
Need on_machine(double own, MPI_Comm comm) {
  MPI_Comm machine;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
  const Need need{sum_over(machine, own), memory_of_machine()};
  MPI_Comm_free(&machine);
  return need;
}

// The same on every rank: where least is left.
Need tightest(const Need& own, MPI_Comm comm) {
  struct {
    double part;
    int rank;
  } worst{own.part(), rank_in(comm)};
  MPI_Allreduce(MPI_IN_PLACE, &worst, 1, MPI_DOUBLE_INT, MPI_MAXLOC, comm);
  Need need = own;
  MPI_Bcast(&need, int(sizeof need), MPI_BYTE, worst.rank, comm);
  return need;
}

std::string gigabytes(double bytes) { return fmt::format("{:.3g} GB", bytes / 1e9); }

// `what`: of which method the bytes of a node are; "": of any.
void refuse_what_does_not_fit(double n, double bytes, const std::string& what, MPI_Comm comm) {
  const int ranks = ranks_in(comm);
  const double fields = n * bytes, own = fields / ranks;
  if (fields < too_small) return;
  constexpr double sure = 1 / 1.3;  // the bound is no further above what is taken
  const std::string says = fmt::format("-grid_n {:.0f}: needs {}", n, what.empty() ? "at least " : "");
  const std::string node =
      fmt::format(" of memory ({:.4g} bytes a node{})", bytes, what.empty() ? "" : ", " + what);
  const Need machine = tightest(on_machine(own, comm), comm);
  if (sure * machine.part() > 1)
    throw UsageError(says + gigabytes(machine.bytes + of_rank * ranks) + node + "; there are " +
                     gigabytes(machine.there) + " available");
  const Need process = tightest({own, memory_of_process()}, comm);
  if (sure * process.part() > 1)
    throw UsageError(says + gigabytes(process.bytes) + node + (ranks > 1 ? " on each rank" : "") +
                     "; ulimit -v leaves " + gigabytes(process.there));
}

// As Integrator chooses it.
Way way_of(const Options& options, const Model& model, Vec u) {
  const Choice choice = choose_method(model, rates_of(model, u), MethodSpec::from(options), "");
  Way way{choice.type, choice.subtype, choice.implicit, choice.fused, false};
  const std::string option = capabilities(offered_type(choice.type)).subtype_option;
  if (!option.empty() && options.is_set(option)) way.subtype = options.text(option);
  const Method& method = way.method();
  if (!way.subtype.empty() || way.type != TSBDF) way.subtype = method.subtype;
  const std::string adapt = options.is_set("ts_adapt_type") ? options.text("ts_adapt_type") : "";
  way.fixed = method.adaptivity == Adaptivity::never || adapt == TSADAPTNONE ||
              (method.adaptivity == Adaptivity::on_request && adapt.empty());
  return way;
}

}  // namespace

void check_size(const Options& options, MPI_Comm comm) {
  const PetscInt n = options.integer("grid_n");
  if (double(n) * most_of_a_node < too_small) return;
  const bool sliding = options.command() == "spectrum" || options.command() == "boundary";
  refuse_what_does_not_fit(double(n), bytes_of(options, Scene::from(options, sliding)), "", comm);
}

void check_size_of_run(const Options& options, const Model& model, Vec u) {
  const double n = double(model.scene().n);
  if (n * most_of_a_node < too_small) return;
  const Way way = way_of(options, model, u);
  refuse_what_does_not_fit(n, bytes_of_run(options, model.scene(), way), way.name(), model.comm());
}

double bytes_a_node(const Options& options, const Model& model, Vec u) {
  return bytes_of_run(options, model.scene(), way_of(options, model, u));
}

namespace {

// Velocities for the table of friction: every hundredth up to 4, and both signs of 1e-12 ... 1e3, twelve a
// decade, for laws that live on a logarithmic axis.
std::vector<double> table_velocities() {
  std::vector<double> psi;
  for (int k = -400; k <= 400; ++k) psi.push_back(k / 100.0);
  for (int k = -144; k <= 36; ++k)
    for (const double sign : {-1.0, 1.0}) psi.push_back(sign * std::pow(10.0, k / 12.0));
  std::sort(psi.begin(), psi.end());
  psi.erase(std::unique(psi.begin(), psi.end()), psi.end());
  return psi;
}

// What differs along x, at the nodes.
void add_profiles(const Scene& scene, RunLayout& layout) {
  if (!scene.unit_amplitude())
    layout.profiles.push_back(
        {{"friction_amplitude", "1", "amplitude of friction"}, [scene](std::int64_t node) {
           return friction_amplitude(scene, static_cast<PetscInt>(node), 1).front();
         }});
  for (const auto& [name, profile] : scene.medium.profiles) {
    const bool springs = name == "model_k1";
    const std::string unit = find_option(name)->unit;
    const Field field{name, unit.empty() ? "1" : unit, name + (springs ? " behind the block" : " along x")};
    layout.profiles.push_back({field, [scene, springs, here = profile](std::int64_t node) {
                                 return here.at(scene.x(static_cast<PetscInt>(node)) + (springs ? 0.5 : 0));
                               }});
  }
  for (const auto& [name, profile] : scene.friction.profiles) {
    const std::string unit = find_option(name)->unit;
    const Field field{name, unit.empty() ? "1" : unit, name + " along x"};
    layout.profiles.push_back({field, [scene, here = profile](std::int64_t node) {
                                 return here.at(scene.x(static_cast<PetscInt>(node)));
                               }});
  }
}

// From which, and the options of its sine, v(t) and the plate's displacement follow exactly.
void add_load(const Scene& scene, RunLayout& layout) {
  const Load& load = scene.load;
  if (!load.varies() || halts(scene)) return;
  constexpr double before_all = -std::numeric_limits<double>::infinity();
  FixedTable corners{{"load/t", "time", "corner of the load"},
                     {},
                     {{{"load/before", "length/time", "velocity of the driving plate right before it"}, {}},
                      {{"load/behind", "length/time", "velocity of the driving plate right behind it"}, {}}}};
  for (double t = load.next_corner(before_all); std::isfinite(t); t = load.next_corner(t)) {
    const int behind = load.piece_from(t);
    corners.at.push_back(t);
    corners.columns[0].second.push_back(velocity_of_plate_alone(scene, load.in_piece(behind - 1, t), t));
    corners.columns[1].second.push_back(velocity_of_plate_alone(scene, load.in_piece(behind, t), t));
  }
  if (!corners.at.empty()) layout.tables.push_back(corners);
}

}  // namespace

RunLayout run_layout(const Scene& scene) {
  RunLayout layout;
  layout.x = [scene](std::int64_t node) { return scene.x(static_cast<PetscInt>(node)); };
  layout.fields = {standard_field("psi"), standard_field("eta")};
  if (scene.friction.has_state()) layout.fields.push_back(standard_field(state_name(scene.friction.state)));
  layout.numbers = {{"v", scene.v}};
  const NodeCoefficients c = scene.coefficients(0);
  const auto add = [&](const char* name, std::initializer_list<const char*> of, double value) {
    for (const char* option : of)
      if (scene.medium.profile(option)) return;  // there is no one number
    layout.numbers[name] = value;
  };
  add("A", {"model_m"}, c.A);
  add("B", {"model_zeta"}, c.B);
  add("K0", {"model_k0"}, c.K0);
  add("K1", {"model_k1", "model_c"}, scene.mean_K1());
  add("s_delta", {"model_delta"}, c.s_delta);
  add_profiles(scene, layout);
  add_load(scene, layout);
  if (scene.friction.varies()) return layout;  // no one law for all
  const auto friction = Friction::of(scene.friction);
  FixedTable curve{{"friction/psi", "length/time", "sliding velocity"},
                   {},
                   {{{"friction/F", "1", "steady friction over its amplitude"}, {}}}};
  for (const double psi : table_velocities()) {
    const double F = friction->force(psi, friction->steady_state(psi));
    if (!std::isfinite(F)) continue;  // theta at rest has no steady value
    curve.at.push_back(psi);
    curve.columns[0].second.push_back(F);
  }
  if (!curve.at.empty()) layout.tables.insert(layout.tables.begin(), curve);
  if (!slides_uniformly(scene)) return layout;
  if (const auto medium = sliding_medium(scene)) {
    const auto fastest = fastest_wave(*medium, Waves::of(scene), same_growth(*medium));
    layout.numbers["steady_eta"] =
        scene.B() * scene.v + friction->force(scene.v, friction->steady_state(scene.v));
    layout.numbers["steady_stable"] = !fastest || fastest->value.real() < 0;
  }
  return layout;
}

void add_scene(ResultFile& file, const Scene& scene) {
  const RunLayout layout = run_layout(scene);
  for (const auto& [name, value] : layout.numbers) file.attribute(name, value);
  if (layout.tables.empty() || layout.tables[0].axis.name != "friction/psi") return;
  const FixedTable& curve = layout.tables[0];
  file.scale(curve.axis, curve.at);
  for (const auto& [field, values] : curve.columns) file.add(field, {curve.axis.name}, values);
}

}  // namespace stickslip
