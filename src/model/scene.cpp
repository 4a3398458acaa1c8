#include "stickslip/scene.hpp"

#include <array>
#include <cmath>
#include <initializer_list>
#include <string>
#include <utility>

#include "stickslip/error.hpp"

namespace stickslip {

namespace {

template <class Enum, std::size_t N>
using Names = std::array<std::pair<Enum, const char*>, N>;

constexpr Names<Form, 2> form_names{{{Form::continuum, "continuum"}, {Form::chain, "chain"}}};
constexpr Names<Law, 4> law_names{{{Law::cubic, "cubic"},
                                   {Law::carlson_langer, "carlson-langer"},
                                   {Law::coulomb, "coulomb"},
                                   {Law::rate_and_state, "rate-and-state"}}};
constexpr Names<StateLaw, 5> state_names{{{StateLaw::none, "none"},
                                          {StateLaw::healing, "healing"},
                                          {StateLaw::contact_age, "contact-age"},
                                          {StateLaw::ageing, "ageing"},
                                          {StateLaw::slip, "slip"}}};
constexpr Names<End, 3> end_names{{{End::periodic, "periodic"}, {End::velocity, "velocity"}, {End::free, "free"}}};

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

// The option with the value the user gave, as it stands in messages.
std::string shown(const Options& options, const std::string& name) {
  return "-" + name + " " + quoted(options.text(name));
}

// The user gave one of `names`, although `reason` says that it has no meaning in this scene.
void refuse(const Options& options, std::initializer_list<const char*> names, const std::string& reason) {
  for (const char* name : names)
    if (options.is_set(name)) throw ForeignOption(shown(options, name) + ": " + reason);
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
  using Coefficient = std::pair<double, const char*>;
  for (const auto& [value, what] : {Coefficient{s.A(), "A"}, {s.B(), "B"}, {s.K0(), "K0"}, {s.K1(), "K1"}})
    if (!std::isfinite(value))
      throw UsageError(std::string("the model's parameters make its coefficient ") + what +
                       (s.form == Form::continuum ? " (A = gamma, K0 = 1/gamma, K1 = c^2/gamma)"
                                                  : " (A = f0/m, B = zeta/f0, K0 = k0/f0, K1 = k1/f0)") +
                       " overflow: choose gentler units");
}

void read_friction(const Options& o, Scene& s) {
  FrictionParameters& f = s.friction;
  f.law = value_of(law_names, o.text("friction_law"));
  f.regularised = has_threshold(f.law) && o.text("friction_stick") == "regularised";

  const std::string other_law = "a parameter of another law, but friction_law is " + to_string(f.law);
  if (!has_threshold(f.law)) refuse(o, {"friction_eps", "friction_back_slip"}, other_law + ", which has no threshold");
  for (const char* name : friction_options_of_other_laws(f.law)) refuse(o, {name}, other_law);
  if (!f.regularised)
    refuse(o, {"friction_eps", "friction_slip_velocity"},
           "it belongs to -friction_stick regularised, not to exact stick");

  f.eps = o.real("friction_eps");
  f.back_slip = o.boolean("friction_back_slip");
  if (f.regularised && !f.back_slip)
    throw UsageError("-friction_back_slip false: smoothed friction cannot hold an unlimited force; it needs "
                     "-friction_stick exact");
  f.fs = o.real("friction_fs");
  f.fd = o.real("friction_fd");
  if (f.fd > f.fs)
    throw UsageError("-friction_fd " + number_text(f.fd) + ": dynamic friction must not exceed the static threshold " +
                     "friction_fs " + number_text(f.fs));
  f.weakening = o.real("friction_slip_velocity");
  f.sigma = o.real("friction_sigma");
  if (f.sigma >= 1)
    throw UsageError("-friction_sigma " + number_text(f.sigma) + ": below 1, or nothing is left of friction");
  f.alpha = o.real("friction_alpha");
  f.a = o.real("friction_a");
  f.b = o.real("friction_b");
  f.D = o.real("friction_D");
  f.mu0 = o.real("friction_mu0");
  f.psi0 = o.real("friction_psi0");

  s.spread = o.real("friction_spread");
  s.spread_kind = o.text("friction_spread_kind") == "uniform" ? SpreadKind::uniform : SpreadKind::lognormal;
  if (s.spread_kind == SpreadKind::uniform && s.spread > 1)
    throw UsageError("-friction_spread " + number_text(s.spread) +
                     ": at most 1 for the uniform kind, beyond it friction would be negative somewhere");
  if (s.form == Form::chain)
    refuse(o, {"friction_spread_length"}, "the chain has one draw a block; only the continuum has this length");
  s.spread_length = o.real("friction_spread_length");
  s.friction_seed = o.integer("friction_seed");
}

void read_state(const Options& o, Scene& s) {
  FrictionParameters& f = s.friction;
  f.state = value_of(state_names, o.text("state_law"));
  if (!belong_together(f.law, f.state)) {
    if (f.law == Law::rate_and_state)
      throw UsageError(shown(o, "state_law") + ": rate-and-state friction needs ageing or slip");
    if (f.state == StateLaw::ageing || f.state == StateLaw::slip)
      throw UsageError(shown(o, "state_law") + ": it belongs to rate-and-state, but friction_law is " +
                       to_string(f.law));
    throw UsageError("-state_law healing: it lets static friction grow, and the cubic law has none (phi(0) = 0); use "
                     "carlson-langer or coulomb");
  }

  const std::string other_law = "a parameter of another state law, but state_law is " + to_string(f.state);
  if (f.state != StateLaw::healing) refuse(o, {"state_t_h", "state_tau_inf"}, other_law);
  if (f.state != StateLaw::contact_age) refuse(o, {"state_b", "state_theta0"}, other_law);
  if (f.state == StateLaw::none) refuse(o, {"state_D"}, other_law);
  if (f.law == Law::rate_and_state && o.is_set("state_D") && o.real("state_D") != o.real("friction_D"))
    throw UsageError(shown(o, "state_D") + ": rate-and-state has one slip distance, and friction_D is " +
                     o.text("friction_D"));
  f.t_h = o.real("state_t_h");
  f.tau_inf = o.real("state_tau_inf");
  f.state_D = o.real("state_D");
  f.state_b = o.real("state_b");
  f.theta0 = o.real("state_theta0");
}

void read_ends(const Options& o, Scene& s) {
  s.left = value_of(end_names, o.text("bc_left"));
  s.right = value_of(end_names, o.text("bc_right"));
  if ((s.left == End::periodic) != (s.right == End::periodic))
    throw UsageError("-bc_left " + to_string(s.left) + " and -bc_right " + to_string(s.right) +
                     ": periodic holds at both ends or at neither");
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
      throw UsageError(shown(o, "grid_length") + ": the chain has spacing 1 and so, with grid_n " +
                       std::to_string(s.n) + ", length " + number_text(length));
    if (s.order != 2)
      throw UsageError(shown(o, "grid_order") + ": the chain's second difference is the model itself, of order 2");
    if (s.n <= held)
      throw UsageError(n + ": a chain with " + std::to_string(held) + " held end" + (held > 1 ? "s" : "") +
                       " needs at least " + std::to_string(held + 1) + " blocks");
    return;
  }
  if (s.n < s.order + 1)
    throw UsageError(n + ": order " + std::to_string(s.order) + " needs at least " + std::to_string(s.order + 1) +
                     " nodes; take more nodes or a lower grid_order");
  if (s.order == 8 && held > 0)
    throw UsageError("-grid_order 8: order 8 with a held end has growing modes of its own; orders 2, 4 and 6 are "
                     "stable there");
  if (!(s.h() > 0) || !std::isfinite(1 / (s.h() * s.h())))
    throw UsageError(shown(o, "grid_length") + ": too short for " + std::to_string(s.n) + " nodes");
}

}  // namespace

Scene Scene::from(const Options& options, bool) {
  Scene scene;
  read_model(options, scene);
  read_friction(options, scene);
  read_state(options, scene);
  read_ends(options, scene);
  read_grid(options, scene);
  return scene;
}

const std::vector<Law>& all_laws() {
  static const std::vector<Law> laws = [] {
    std::vector<Law> list;
    for (const auto& entry : law_names) list.push_back(entry.first);
    return list;
  }();
  return laws;
}

bool has_threshold(Law law) { return law == Law::carlson_langer || law == Law::coulomb; }

std::vector<const char*> friction_options_of_other_laws(Law law) {
  std::vector<const char*> names;
  const auto add = [&names](std::initializer_list<const char*> more) {
    for (const char* name : more) names.push_back(name);
  };
  if (!has_threshold(law)) add({"friction_eps", "friction_back_slip"});
  if (law != Law::coulomb) add({"friction_fs", "friction_fd", "friction_slip_velocity"});
  if (law != Law::carlson_langer) add({"friction_sigma", "friction_alpha"});
  if (law != Law::rate_and_state) add({"friction_a", "friction_b", "friction_D", "friction_mu0", "friction_psi0"});
  return names;
}

std::vector<StateLaw> all_state_laws() {
  std::vector<StateLaw> all;
  for (const auto& [law, name] : state_names) all.push_back(law);
  return all;
}

bool belong_together(Law law, StateLaw state) {
  const bool kinetics_of_rate_and_state = state == StateLaw::ageing || state == StateLaw::slip;
  if ((law == Law::rate_and_state) != kinetics_of_rate_and_state) return false;
  return !(law == Law::cubic && state == StateLaw::healing);
}

std::string to_string(Form form) { return name_of(form_names, form); }
std::string to_string(Law law) { return name_of(law_names, law); }
std::string to_string(StateLaw law) { return name_of(state_names, law); }
std::string to_string(End end) { return name_of(end_names, end); }

}  // namespace stickslip
