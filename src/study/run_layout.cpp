#include "stickslip/study/run_layout.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

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
