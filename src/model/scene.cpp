#include "stickslip/model/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "base/failure.hpp"
#include "model/scene_reading.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

std::string shown(const Options& options, const std::string& name) {
  return "-" + name + " " + quoted(options.text(name));
}

void refuse(const Options& options, const std::vector<std::string>& names, const std::string& reason) {
  for (const std::string& name : names)
    if (options.is_set(name)) throw ForeignOption(shown(options, name) + ": " + reason);
}

namespace {

template <class Enum, std::size_t N>
using Names = std::array<std::pair<Enum, const char*>, N>;

constexpr Names<Form, 2> form_names{{{Form::continuum, "continuum"}, {Form::chain, "chain"}}};
constexpr Names<End, 3> end_names{
    {{End::periodic, "periodic"}, {End::velocity, "velocity"}, {End::free, "free"}}};

template <class Enum, std::size_t N>
std::string name_of(const Names<Enum, N>& names, Enum value) {
  for (const auto& [key, name] : names)
    if (key == value) return name;
  return "?";
}

template <class Enum, std::size_t N>
Enum value_of(const Names<Enum, N>& names, const std::string& text) {
  for (const auto& [key, name] : names)
    if (text == name) return key;
  throw std::logic_error("no such word: " + text);
}

void read_model(const Options& o, Scene& s) {
  s.form = value_of(form_names, o.text("model_form"));
  s.v = o.real("model_v");
  if (s.form == Form::continuum) {
    refuse(o, {"model_m", "model_k0", "model_k1", "model_f0", "model_zeta"},
           "a parameter of the chain, but model_form is continuum");
    s.gamma = o.real("model_gamma");
    s.delta = o.real("model_delta");
    s.c = o.real("model_c");
    s.derived_sign = o.text("model_delta_sign") == "derived";
  } else {
    refuse(o, {"model_gamma", "model_delta", "model_c", "model_delta_sign"},
           "a parameter of the continuum, but model_form is chain");
    s.delta = 0;
    s.m = o.real("model_m");
    s.k0 = o.real("model_k0");
    s.k1 = o.real("model_k1");
    s.f0 = o.real("model_f0");
    s.zeta = o.text("model_zeta") == "paper" ? std::sqrt(0.1 * s.m * s.k1) : o.real("model_zeta");
  }
  s.nu = o.real("model_nu");
  s.friction.terms = NodeTerms::from(o);
  if (s.massless() && s.nu > 0)
    throw UsageError(shown(o, "model_nu") +
                     ": with model_m 0 every block's psi follows from its own force, which viscosity "
                     "between neighbours would tie to theirs; take a small model_m, or no model_nu");
  using Coefficient = std::pair<double, const char*>;
  for (const auto& [value, what] :
       {Coefficient{s.A(), "A"}, {s.B(), "B"}, {s.K0(), "K0"}, {s.K1(), "K1"}, {s.N(), "N"}})
    if (!std::isfinite(value) && !(s.massless() && *what == 'A'))
      throw usage_error(
          "the model's parameters make its coefficient {}{} overflow: choose gentler units", what,
          s.form == Form::continuum ? " (A = gamma, K0 = 1/gamma, K1 = c^2/gamma, N = nu/gamma)"
                                    : " (A = f0/m, B = zeta/f0, K0 = k0/f0, K1 = k1/f0, N = nu/f0)");
}

// The option names of a law's parameters.
std::vector<std::string> names_of(const std::string& family, const std::vector<Parameter>& parameters) {
  std::vector<std::string> names;
  for (const Parameter& p : parameters) names.push_back(family + p.name);
  return names;
}

// The same, with the options that say how they differ along x.
std::vector<std::string> with_profiles(const std::vector<std::string>& names) {
  std::vector<std::string> all = names;
  for (const std::string& name : names)
    for (const char* suffix : {"_profile", "_factor"}) all.push_back(name + suffix);
  return all;
}

// For each law of a list, by its name: the options of its family that mean nothing to it, profiles last.
// Scenes are made by the thousand along a curve, all of one law: what belongs to it is gone through once.
using NamesByLaw = std::map<std::string, std::vector<std::string>>;
template <class List>
NamesByLaw options_of_others(const std::string& family, const List& laws) {
  NamesByLaw result;
  for (const auto& law : laws) {
    const std::vector<std::string> own = names_of(family, law->parameters);
    std::vector<std::string> names;
    for (const auto& other : laws)
      for (const std::string& name : names_of(family, other->parameters))
        if (std::find(own.begin(), own.end(), name) == own.end() &&
            std::find(names.begin(), names.end(), name) == names.end())
          names.push_back(name);
    std::vector<std::string>& all = result[law->name] = names;
    for (const std::string& name : with_profiles(names))
      if (find_option(name) && std::find(all.begin(), all.end(), name) == all.end()) all.push_back(name);
  }
  return result;
}

const std::vector<std::string>& options_of_others(Law law) {
  static const NamesByLaw names = options_of_others("friction_", all_laws());
  return names.at(law->name);
}
const std::vector<std::string>& options_of_others(StateLaw law) {
  static const NamesByLaw names = options_of_others("state_", all_state_laws());
  return names.at(law->name);
}

template <class List>
std::string joined(const List& laws) {
  std::string text;
  for (const auto& law : laws) text += (text.empty() ? "" : " or ") + law->name;
  return text;
}

void read_parameter(const Options& o, const std::string& name, const Parameter& p, FrictionParameters& f) {
  if (p.range == Parameter::Range::curve) {
    f.curve = o.pairs(name);
  } else if (p.range == Parameter::Range::word) {
    const std::vector<std::string>& words = find_option(name)->words;
    f.values[name] = double(std::find(words.begin(), words.end(), o.text(name)) - words.begin());
  } else {
    f.values[name] = o.real(name);
  }
}

void read_law(const Options& o, FrictionParameters& f) {
  f.law = Law(o.text("friction_law"));
  for (const Parameter& p : f.law->parameters) read_parameter(o, "friction_" + std::string(p.name), p, f);
  f.regularised = f.jumps_at_rest() && o.text("friction_stick") == "regularised";

  const std::string other_law = "a parameter of another law, but friction_law is " + f.law->name;
  if (!f.jumps_at_rest())
    refuse(o, {"friction_eps", "friction_back_slip"}, other_law + ", which has no threshold");
  refuse(o, options_of_others(f.law), other_law);
  std::vector<std::string> of_regularised = {"friction_eps"};
  for (const Parameter& p : f.law->parameters)
    if (p.regularised)
      for (const std::string& name : with_profiles({"friction_" + std::string(p.name)}))
        of_regularised.push_back(name);
  for (const Parameter& p : f.law->parameters)
    if (!has_meaning(p, o))
      refuse(o, with_profiles({"friction_" + std::string(p.name)}),
             "it has no meaning with " + shown(o, p.only_with.option));
  if (!f.regularised)
    refuse(o, of_regularised, "it belongs to -friction_stick regularised, not to exact stick");

  f.eps = o.real("friction_eps");
  f.back_slip = o.boolean("friction_back_slip");
  if (f.regularised && !f.back_slip)
    throw UsageError(
        "-friction_back_slip false: smoothed friction cannot hold an unlimited force; it needs "
        "-friction_stick exact");
}

void read_spread(const Options& o, Scene& s) {
  s.spread = o.real("friction_spread");
  s.spread_kind = o.text("friction_spread_kind") == "uniform" ? SpreadKind::uniform : SpreadKind::lognormal;
  if (s.spread_kind == SpreadKind::uniform && s.spread > 1)
    throw UsageError("-friction_spread " + number_text(s.spread) +
                     ": at most 1 for the uniform kind, beyond it friction would be negative somewhere");
  if (s.form == Form::chain)
    refuse(o, {"friction_spread_length"},
           "the chain has one draw a block; only the continuum has this length");
  s.spread_length = o.real("friction_spread_length");
  s.friction_seed = o.integer("friction_seed");
}

// The state law cannot accompany the law: says which could.
[[noreturn]] void refuse_state(const Options& o, Law law, StateLaw state) {
  std::vector<Law> others;
  for (const Law other : all_laws())
    if (belong_together(other, state)) others.push_back(other);
  const std::string state_law = shown(o, "state_law");
  if (!belong_together(law, "none"))
    throw usage_error("{}: {} friction needs {}", state_law, law->name, joined(law->states));
  if (std::none_of(others.begin(), others.end(), [](Law other) { return belong_together(other, "none"); }))
    throw usage_error("{}: it belongs to {}, but friction_law is {}", state_law, joined(others), law->name);
  throw usage_error("{}: it lets static friction grow, and the {} law has none (phi(0) = 0); use {}",
                    state_law, law->name, joined(others));
}

void read_state(const Options& o, Scene& s) {
  FrictionParameters& f = s.friction;
  f.state = StateLaw(o.text("state_law"));
  if (!belong_together(f.law, f.state)) refuse_state(o, f.law, f.state);
  if (f.state->needs_stops && f.regularised)
    throw usage_error("{}: it begins anew at stops, and regularised friction has none; it needs "
                      "-friction_stick exact", shown(o, "state_law"));

  refuse(o, options_of_others(f.state),
         "a parameter of another state law, but state_law is " + f.state->name);
  for (const std::string& name : names_of("state_", f.state->parameters)) f.values[name] = o.real(name);
  for (const Parameter& p : f.law->parameters) {
    const std::string name = "friction_" + std::string(p.name);
    if (*p.same_as && o.is_set(p.same_as) && o.real(p.same_as) != o.real(name))
      throw usage_error("{}: {} has one slip distance, and {} is {}", shown(o, p.same_as), f.law->name, name,
                        o.text(name));
  }
}

// The profile of `name`, if the scene has one: x within the scene, its values times the factor.
std::optional<ProfileAlongX> read_profile(const Options& o, const Scene& s, const std::string& name) {
  const std::string option = name + "_profile", factor = name + "_factor";
  if (!o.is_set(option)) {
    if (o.is_set(factor))
      throw UsageError(shown(o, factor) + ": it multiplies " + option + ", which is not set");
    return std::nullopt;
  }
  if (find_option(name) && o.is_set(name))
    throw UsageError(shown(o, name) + " and -" + option + ": one value or a profile, not both");
  std::vector<std::pair<double, double>> points = o.pairs(option);
  for (auto& [x, value] : points) {
    if (x < 0 || x > s.length * (1 + 1e-12))
      throw usage_error("{}: x = {} lies outside the scene, which reaches from 0 to {}", shown(o, option),
                        number_text(x), number_text(s.length));
    value *= o.real(factor);
  }
  const std::string kind = o.text("profile_kind");
  const Between between = kind == "linear"   ? Between::linear
                          : kind == "smooth" ? Between::smooth
                                             : Between::step;
  return ProfileAlongX(std::move(points), between, s.ring() ? s.length : 0);
}

// Where this medium, which differs along x, cannot be had.
void refuse_medium(const Options& o, const Scene& s) {
  const std::string profile = "-" + s.medium.profiles.begin()->first + "_profile";
  const auto refuse_it = [&](bool wrong, const std::string& reason) {
    if (wrong) throw UsageError(profile + ": " + reason);
  };
  refuse_it(s.massless(), "it needs blocks with mass (model_m > 0)");
  refuse_it(s.nu > 0, "viscosity between neighbours (model_nu) is there for equal nodes alone");
  refuse_it(
      s.medium.profile("model_c") && s.order != 2,
      "differences across a c that varies are of order 2, but grid_order is " + std::to_string(s.order));
  refuse_it(s.form == Form::chain && o.text("model_zeta") == "paper" &&
                (s.medium.profile("model_m") || s.medium.profile("model_k1")),
            "-model_zeta paper is sqrt(0.1 m k1) of one m and one k1; give model_zeta or model_zeta_profile");
  const std::string train = "a train has the same profile f(t - x/V) at every x";
  refuse_it(o.command() == "wave", train);
  refuse_it(o.command() == "chart" && o.text("chart_kind") == "limits",
            "chart_kind limits looks at waves on one medium");
  if (o.command() != "laws" && o.command() != "spectrum" && o.command() != "boundary")
    refuse_it(o.text("init_type") == "wave" || o.text("init_type") == "pulses", train);
}

void read_medium(const Options& o, Scene& s) {
  const bool chain = s.form == Form::chain;
  const std::vector<std::pair<const char*, double*>> of_chain = {
      {"model_m", &s.m}, {"model_k0", &s.k0}, {"model_k1", &s.k1}, {"model_zeta", &s.zeta}};
  const std::vector<std::pair<const char*, double*>> of_continuum = {{"model_c", &s.c},
                                                                     {"model_delta", &s.delta}};
  for (const auto& [name, value] : chain ? of_continuum : of_chain)
    refuse(o, {std::string(name) + "_profile", std::string(name) + "_factor"},
           std::string("a parameter of the ") + (chain ? "continuum" : "chain") + ", but model_form is " +
               to_string(s.form));
  for (const auto& [name, value] : chain ? of_chain : of_continuum)
    if (const auto profile = read_profile(o, s, name)) s.medium.profiles[name] = *profile;
  if (!s.medium.varies()) return;
  refuse_medium(o, s);
  // the mean over the nodes, of c^2 in the place of c
  for (const auto& [name, value] : chain ? of_chain : of_continuum) {
    const ProfileAlongX* const profile = s.medium.profile(name);
    if (!profile) continue;
    const bool between = std::string(name) == "model_k1", squared = std::string(name) == "model_c";
    double sum = 0;
    for (PetscInt i = 0; i < s.n; ++i) {
      const double at = profile->at(s.x(i) + (between ? 0.5 : 0));
      sum += squared ? at * at : at;
    }
    *value = squared ? std::sqrt(sum / double(s.n)) : sum / double(s.n);
  }
  for (PetscInt i = 0; i < s.n; ++i) {
    const NodeCoefficients c = s.coefficients(i);
    if (!std::isfinite(c.A + c.B + c.K0 + c.s_delta + s.link(i)))
      throw usage_error("the medium's coefficients overflow at x = {:.6g}: choose gentler units", s.x(i));
  }
}

void read_profiles(const Options& o, Scene& s) {
  FrictionParameters& f = s.friction;
  const auto read = [&](const std::string& name, const std::string& as) {
    const std::optional<ProfileAlongX> profile = read_profile(o, s, name);
    if (!profile) return;
    if (f.profiles.count(as))
      throw usage_error("-{}_profile: it is the same quantity as {}_profile", name, as);
    f.profiles[as] = *profile;
  };
  for (const Parameter& p : f.law->parameters) {
    const std::string name = "friction_" + std::string(p.name);
    read(name, name);
    if (*p.same_as) read(p.same_as, name);  // and is asked for by the law's name
  }
  for (const Parameter& p : f.state->parameters) {
    const std::string name = "state_" + std::string(p.name);
    const auto is_same = [&](const Parameter& other) { return other.same_as == name; };
    if (std::none_of(f.law->parameters.begin(), f.law->parameters.end(), is_same)) read(name, name);
  }
  if (const auto amplitude = read_profile(o, s, "friction_amplitude")) s.amplitude = *amplitude;
  if (o.command() != "laws" && o.is_set("profile_kind") && !s.has_profile())
    throw UsageError(shown(o, "profile_kind") + ": there is no profile");
  // throws where the values contradict each other
  if (!f.varies()) return void(Friction::of(f));
  FrictionPlaces places;
  for (const auto& [name, profile] : f.profiles)
    for (const auto& point : profile.points()) places.push_back({point.first});
  (void)Friction::along(f, places);
}

// Nodes of amplitude 0 have no friction: F is 0 there, and they never rest. That takes a law with a force at
// every velocity, as these nodes go through psi = 0 at will.
void check_nodes_without_friction(const Options& o, const Scene& s) {
  if (!frictionless_somewhere(s)) return;
  const auto& points = s.amplitude.points();
  const auto refuse_0 = [&](const std::string& why) {
    throw UsageError(shown(o, "friction_amplitude_profile") + ": with an amplitude of 0 " + why);
  };
  if (std::all_of(points.begin(), points.end(), [](const auto& point) { return point.second == 0; }))
    refuse_0("everywhere there is no friction at all; it may be 0 at some places");
  if (!s.friction.terms.none())
    refuse_0("a node has no friction beside which drag (model_drag) could stand; take a small amplitude");
  if (s.massless() && !(s.B() > 0))
    refuse_0("and without mass (model_m 0) nothing but model_zeta says how fast a block goes; set it > 0");
  if (to_string(s.friction.law) == "dieterich")
    refuse_0("a node goes backwards too, where friction_law dieterich says nothing; take rate-and-state");
}

void read_ends(const Options& o, Scene& s) {
  s.left = value_of(end_names, o.text("bc_left"));
  s.right = value_of(end_names, o.text("bc_right"));
  if ((s.left == End::periodic) != (s.right == End::periodic))
    throw usage_error("-bc_left {} and -bc_right {}: periodic holds at both ends or at neither",
                      to_string(s.left), to_string(s.right));
  s.left_value = o.real("bc_left_value");
  s.right_value = o.real("bc_right_value");
  // a layer starts from bc_left_value, whatever the end is
  if (s.left != End::velocity && o.text("init_type") != "layer")
    refuse(o, {"bc_left_value"}, "it needs -bc_left velocity, but bc_left is " + to_string(s.left));
  if (s.right != End::velocity)
    refuse(o, {"bc_right_value"}, "it needs -bc_right velocity, but bc_right is " + to_string(s.right));
}

void read_grid(const Options& o, Scene& s) {
  s.n = o.integer("grid_n");
  s.length = o.real("grid_length");
  s.order = int(o.integer("grid_order"));
  const int held = (s.left == End::velocity) + (s.right == End::velocity);
  const std::string n = "-grid_n " + std::to_string(s.n);

  if (s.form == Form::chain) {
    const double length = s.ring() ? double(s.n) : double(s.n > 1 ? s.n - 1 : 1);
    if (s.length != length)
      throw usage_error("{}: the chain has spacing 1 and so, with grid_n {}, length {}",
                        shown(o, "grid_length"), s.n, number_text(length));
    if (s.order != 2)
      throw UsageError(shown(o, "grid_order") +
                       ": the chain's second difference is the model itself, of order 2");
    if (s.n <= held)
      throw usage_error("{}: a chain with {} held end{} needs at least {} blocks", n, held,
                        held > 1 ? "s" : "", held + 1);
    return;
  }
  if (s.n < s.order + 1)
    throw usage_error("{}: order {} needs at least {} nodes; take more nodes or a lower grid_order", n,
                      s.order, s.order + 1);
  if (s.order == 8 && held > 0)
    throw UsageError(
        "-grid_order 8: order 8 with a held end has growing modes of its own; orders 2, 4 and 6 are "
        "stable there");
  if (!(s.h() > 0) || !std::isfinite(1 / (s.h() * s.h())))
    throw UsageError(shown(o, "grid_length") + ": too short for " + std::to_string(s.n) + " nodes");
}

// A coefficient of friction is nowhere above 10: such a table is of forces, and belongs to an amplitude of 1.
void warn_of_table_of_forces(const Scene& s) {
  const bool chain = s.form == Form::chain;
  const double amplitude = chain ? s.f0 : s.gamma;
  const auto larger = [](const auto& a, const auto& b) { return std::abs(a.second) < std::abs(b.second); };
  const auto& curve = s.friction.curve;
  const auto largest = std::max_element(curve.begin(), curve.end(), larger);
  if (largest == curve.end() || std::abs(largest->second) <= 10 || amplitude == 1) return;
  const std::string name = chain ? "model_f0" : "model_gamma";
  warn("friction_table is multiplied by " + name + " " + number_text(amplitude) + ": friction at " +
       (largest->first == 0 ? "rest" : "psi = " + number_text(largest->first)) + " is " +
       number_text(amplitude * largest->second) + "; a table of forces goes with " + name + " 1");
}

}  // namespace

bool has_meaning(const Parameter& p, const Options& o) {
  if (!*p.only_with.option) return true;
  const std::vector<std::string> words = split(p.only_with.words, ' ');
  return std::find(words.begin(), words.end(), o.text(p.only_with.option)) != words.end();
}

Scene Scene::from(const Options& options, bool) {
  Scene scene;
  read_model(options, scene);
  read_law(options, scene.friction);
  warn_of_table_of_forces(scene);
  read_spread(options, scene);
  read_state(options, scene);
  read_ends(options, scene);
  read_grid(options, scene);
  read_medium(options, scene);
  read_profiles(options, scene);
  check_nodes_without_friction(options, scene);
  read_loads(options, scene);
  return scene;
}

std::vector<std::string> friction_options_of_other_laws(Law law) {
  std::vector<std::string> all = options_of_others(law);
  if (!law->jumps_at_rest) all.insert(all.begin(), {"friction_eps", "friction_back_slip"});
  return all;
}

std::string to_string(Form form) { return name_of(form_names, form); }
std::string to_string(End end) { return name_of(end_names, end); }

}  // namespace stickslip
