// The command `boundary`: where steady sliding loses stability, in one option or two.
#include <algorithm>
#include <cmath>

#include "base/progress.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/vary.hpp"
#include "stickslip/study/verify.hpp"
#include "stickslip/commands/commands.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

namespace {

// An axis from the options boundary_parameter, _from, _to, _log (suffix "" or "2").
Axis axis_from(const Options& options, const std::string& suffix) {
  const std::string parameter = "boundary_parameter" + suffix;
  Axis axis;
  axis.name = lower_case(options.text(parameter));
  const OptionSpec* spec = find_option(axis.name);
  if (!spec) {
    std::vector<std::string> names;
    for (const OptionSpec& s : option_table())
      if (s.type == OptionType::real || s.type == OptionType::real_or_word) names.push_back(s.name);
    const std::string near = nearest_name(axis.name, names);
    throw UsageError("-" + parameter + " " + stickslip::quoted(axis.name) + ": no such option" +
                     (near.empty() ? "; give a real one, such as model_v" : "; did you mean " + near + "?"));
  }
  axis.name = spec->name;
  if (spec->type != OptionType::real && spec->type != OptionType::real_or_word)
    throw UsageError("-" + parameter + " " + axis.name + ": takes " + requirement(*spec) +
                     "; the boundary is sought in a real option, such as model_v");
  for (const char* end : {"boundary_from", "boundary_to"})
    if (!options.is_set(end + suffix))
      throw UsageError("-" + std::string(end) + suffix + " is needed: the range of " + axis.name);
  axis.from = options.real("boundary_from" + suffix);
  axis.to = options.real("boundary_to" + suffix);
  axis.logarithmic = options.boolean("boundary_log" + suffix);
  if (axis.from == axis.to) throw UsageError("-boundary_to" + suffix + " " + options.text("boundary_to" + suffix) +
                                             ": the range of " + axis.name + " is empty");
  if (axis.logarithmic && !(axis.from > 0 && axis.to > 0))
    throw UsageError("-boundary_log" + suffix + " true: needs positive ends of the range of " + axis.name);
  return axis;
}

std::vector<Axis> axes_from(const Options& options) {
  if (!options.is_set("boundary_parameter"))
    throw UsageError("-boundary_parameter is needed: a real option to vary, such as model_v");
  std::vector<Axis> axes{axis_from(options, "")};
  for (const std::string& name : options.words("boundary_same")) {
    const OptionSpec* spec = find_option(name);
    if (!spec || (spec->type != OptionType::real && spec->type != OptionType::real_or_word))
      throw UsageError("-boundary_same " + stickslip::quoted(name) + ": no such real option; give e.g. model_k0");
    axes[0].same.push_back(spec->name);
  }
  if (options.is_set("boundary_parameter2")) {
    axes.push_back(axis_from(options, "2"));
    if (axes[0].name == axes[1].name)
      throw UsageError("-boundary_parameter2 " + axes[1].name + ": is boundary_parameter already");
  } else {
    for (const char* name : {"boundary_from2", "boundary_to2"})
      if (options.is_set(name)) throw UsageError("-" + std::string(name) + ": without boundary_parameter2");
  }
  return axes;
}

// Where sliding is stable along the first axis, and what crosses.
void describe(Summary& summary, GrowthRate& growth, const std::vector<Crossing>& points) {
  const Axis& axis = growth.axes()[0];
  std::string text = "along " + axis.name + " sliding is";
  double begin = 0;
  for (std::size_t k = 0; k <= points.size(); ++k) {
    const double end = k < points.size() ? points[k].x : 1, rate = growth((begin + end) / 2);
    text += std::string(k == 0 ? "" : ",") + (std::isnan(rate) ? " not there" : rate > 0 ? " unstable" : " stable") +
            " from " + number_text(axis.value(begin)) + " to " + number_text(axis.value(end));
    begin = end;
  }
  summary.say(text);
}

void describe_curve(Summary& summary, const GrowthRate& growth, const std::vector<Crossing>& points) {
  std::string text = "curve of " + std::to_string(points.size()) + " points in " +
                     std::to_string(1 + std::max_element(points.begin(), points.end(), [](auto& a, auto& b) {
                                          return a.piece < b.piece;
                                        })->piece) + " pieces";
  const auto range = [&](const Axis& axis, double Crossing::*value) {
    const auto [low, high] = std::minmax_element(points.begin(), points.end(), [=](auto& a, auto& b) {
      return a.*value < b.*value;
    });
    text += ", " + axis.name + " " + rounded_text((*low).*value, 6) + " to " + rounded_text((*high).*value, 6);
  };
  range(growth.axes()[0], &Crossing::value);
  range(growth.axes()[1], &Crossing::value2);
  summary.say(text);
}

void describe(Summary& summary, const std::vector<Axis>& axes, const std::vector<Verified>& verified) {
  for (const Verified& v : verified)
    summary.say("integrated at " + axes[0].name + " " + rounded_text(v.value, 6) +
                (axes.size() > 1 ? ", " + axes[1].name + " " + rounded_text(v.value2, 6) : "") + ": from sliding to " +
                v.from_sliding + ", from stick-slip to " + v.from_stick_slip + "; the growth rate " +
                rounded_text(v.growth) + " says " + v.expected);
}

// What the criticality of the points says, and where it changes.
void describe_criticality(Summary& summary, const std::vector<Axis>& axes, const std::vector<Crossing>& points,
                          const std::vector<SpecialPoint>& special) {
  const auto count = [&](const std::string& word) {
    return std::count_if(points.begin(), points.end(), [&](auto& c) { return c.criticality.word() == word; });
  };
  const auto all = long(points.size()), up = count("supercritical"), down = count("subcritical");
  const auto share = [&](long n) { return n == all ? std::string() : "at " + std::to_string(n) + " of " +
                                                                         std::to_string(all) + " points "; };
  if (up > 0) summary.say(share(up) + "stick-slip grows out of sliding (supercritical)");
  if (down > 0) summary.say(share(down) + "sliding loses to stick-slip by a jump (subcritical): both live beside the boundary");
  if (std::any_of(points.begin(), points.end(), [](auto& c) { return c.degenerate && c.criticality.known(); }))
    summary.say("many modes cross at once; the criticality is that of the longest, taken alone");
  for (const SpecialPoint& p : special)
    summary.say("the criticality changes (" + p.kind + " point) at " + axes[0].name + " " +
                rounded_text(p.at.value, 10) + ", " + axes[1].name + " " + rounded_text(p.at.value2, 10));
}

std::string at_ends(GrowthRate& growth) {
  const Axis& axis = growth.axes()[0];
  return "growth rate " + number_text(growth(0)) + " at " + axis.name + " " + number_text(axis.from) + ", " +
         number_text(growth(1)) + " at " + number_text(axis.to);
}

Json number_or_null(double x) { return std::isnan(x) ? Json() : Json(x); }
Json text_or_null(const std::string& text) { return text.empty() ? Json() : Json(text); }

Json point_list(const std::vector<Crossing>& points, bool two) {
  Json list = Json::array();
  for (const Crossing& c : points)
    list.push_back(Json::object({{"value", c.value},
                                 {"value2", two ? Json(c.value2) : Json()},
                                 {"frequency", c.frequency},
                                 {"wavenumber", c.wavenumber},
                                 {"degenerate", c.degenerate},
                                 {"residual", c.residual},
                                 {"error", c.error},
                                 {"error2", two ? Json(c.error2) : Json()},
                                 {"kind", c.kind},
                                 {"criticality", text_or_null(c.criticality.word())},
                                 {"lyapunov_coefficient", number_or_null(c.criticality.coefficient)},
                                 {"lyapunov_of", text_or_null(c.criticality.of)},
                                 {"lyapunov_travelling", number_or_null(c.criticality.travelling)},
                                 {"lyapunov_standing", number_or_null(c.criticality.standing)},
                                 {"criticality_unknown", text_or_null(c.criticality.why_not)},
                                 {"growth_rate", c.growth},
                                 {"piece", c.piece},
                                 {"switched", c.switched},
                                 {"complete", c.complete ? Json(*c.complete) : Json()}}));
  return list;
}

Json special_list(const std::vector<SpecialPoint>& points) {
  Json list = Json::array();
  for (const SpecialPoint& p : points)
    list.push_back(Json::object({{"kind", p.kind},
                                 {"value", p.at.value},
                                 {"value2", p.at.value2},
                                 {"frequency", p.at.frequency},
                                 {"wavenumber", p.at.wavenumber},
                                 {"piece", p.at.piece}}));
  return list;
}

// The plate velocity of each point in closed form, NaN where there is none or no axis is model_v.
std::vector<double> closed_forms(GrowthRate& growth, const std::vector<Crossing>& points) {
  std::vector<double> v;
  for (const Crossing& c : points) {
    const Scene scene = growth.scene(c.x, c.y);
    v.push_back(closed_form_velocity(scene).value_or(std::nan("")) * (scene.v < 0 ? -1 : 1));
  }
  return v;
}

Json verified_list(const std::vector<Verified>& verified, bool two) {
  Json list = Json::array();
  for (const Verified& v : verified)
    list.push_back(Json::object({{"value", v.value},
                                 {"value2", two ? Json(v.value2) : Json()},
                                 {"growth_rate", v.growth},
                                 {"expected", v.expected},
                                 {"from_sliding", v.from_sliding},
                                 {"from_stick_slip", v.from_stick_slip},
                                 {"regime", v.regime}}));
  return list;
}

// A method that damps, with steps so long that it makes a growing mode decay: backward Euler does when
// dt > 2 Re(lambda)/|lambda|^2. The checks use a method of their own; the user's runs would not.
void warn_of_damping(const Options& options, const std::vector<Verified>& verified,
                     const std::vector<Crossing>& points) {
  const auto given = [&](const char* name) { return options.is_set(name) ? options.text(name) : std::string(); };
  const std::string type = given("ts_type"), dt_text = given("ts_dt");
  const bool damps = type == "beuler" || type == "bdf" || (type == "theta" && given("ts_theta_theta") != "0.5");
  if (!damps || dt_text.empty() || points.empty()) return;
  const double dt = std::strtod(dt_text.c_str(), nullptr);
  const double frequency = points.front().frequency;
  for (const Verified& v : verified) {
    const double limit = 2 * v.growth / (v.growth * v.growth + frequency * frequency);
    if (v.growth > 0 && dt > limit) {
      warn("-ts_type " + type + " with -ts_dt " + dt_text + " would hide the instability at " + number_text(v.value) +
           ": it damps a mode that grows when the step is above " + number_text(limit) +
           "; the checks here use a method of their own");
      return;
    }
  }
}

// Criticality of every point, and the special points of a curve.
void add_criticality(ResultFile& file, const std::vector<Crossing>& points, const std::vector<SpecialPoint>& special,
                     const std::string& unit, const std::string& unit2) {
  std::vector<std::string> words, of;
  std::vector<double> coefficient, value, value2;
  for (const Crossing& c : points) {
    words.push_back(c.criticality.word());
    of.push_back(c.criticality.of);
    coefficient.push_back(c.criticality.coefficient);
  }
  file.add_text({"criticality", "1", "supercritical or subcritical; empty where it is not known"}, {"point"}, words);
  file.add({"lyapunov_coefficient", "1/(time velocity^2)", "l of da/dt = growth a + l a^3, a: amplitude of psi"},
           {"point"}, coefficient);
  file.add_text({"lyapunov_of", "1", "the oscillation that it belongs to"}, {"point"}, of);
  if (special.empty()) return;
  std::vector<std::string> kinds;
  for (const SpecialPoint& p : special) {
    kinds.push_back(p.kind);
    value.push_back(p.at.value);
    value2.push_back(p.at.value2);
  }
  file.add({"special/value", unit, "value"}, {"special/point"}, value);
  file.add({"special/value2", unit2, "value2"}, {"special/point"}, value2);
  file.add_text({"special/kind", "1", "bautin: the criticality changes"}, {"special/point"}, kinds);
}

void write_file(const Options& options, GrowthRate& growth, const std::vector<Crossing>& points,
                const std::vector<Verified>& verified, const BoundaryFindings& findings, const Provenance& provenance) {
  const Samples& samples = findings.samples;
  ResultFile file(PETSC_COMM_WORLD, options.text("out_file"), provenance);
  if (options.text("out_file").empty()) return;
  const bool two = growth.axes().size() > 1;
  std::vector<double> number(points.size());
  for (std::size_t k = 0; k < number.size(); ++k) number[k] = double(k);
  file.attribute("parameter", growth.axes()[0].name);
  file.attribute("log", growth.axes()[0].logarithmic ? 1. : 0.);
  if (two) {
    file.attribute("parameter2", growth.axes()[1].name);
    file.attribute("log2", growth.axes()[1].logarithmic ? 1. : 0.);
  }
  file.scale({"point", "1", "number of the point"}, number);
  const auto add = [&](const Field& field, const auto& value) {
    std::vector<double> values;
    for (const Crossing& c : points) values.push_back(value(c));
    file.add(field, {"point"}, values);
  };
  const auto unit = [](const Axis& axis) { return find_option(axis.name)->unit; };
  add({"value", unit(growth.axes()[0]), growth.axes()[0].name}, [](const Crossing& c) { return c.value; });
  if (two) add({"value2", unit(growth.axes()[1]), growth.axes()[1].name}, [](const Crossing& c) { return c.value2; });
  add({"frequency", "1/time", "frequency of the critical mode"}, [](const Crossing& c) { return c.frequency; });
  add({"wavenumber", "1/length", "wavenumber of the critical mode"}, [](const Crossing& c) { return c.wavenumber; });
  add({"degenerate", "1", "1 where many modes cross at once"}, [](const Crossing& c) { return double(c.degenerate); });
  add({"residual", "1/time", "|J x - lambda x|/|x|"}, [](const Crossing& c) { return c.residual; });
  const std::string grid = "change of it on a grid of half the spacing";
  add({"error", unit(growth.axes()[0]), "value: " + grid}, [](const Crossing& c) { return c.error; });
  if (two) add({"error2", unit(growth.axes()[1]), "value2: " + grid}, [](const Crossing& c) { return c.error2; });
  add({"piece", "1", "piece of the curve"}, [](const Crossing& c) { return double(c.piece); });
  add({"switched", "1", "1 where another mode leads than before"},
      [](const Crossing& c) { return double(c.switched); });
  std::vector<std::string> kinds;
  for (const Crossing& c : points) kinds.push_back(c.kind);
  file.add_text({"kind", "1", "hopf or zero"}, {"point"}, kinds);
  add_criticality(file, points, findings.special, unit(growth.axes()[0]), two ? unit(growth.axes()[1]) : "");
  file.add({"closed_form_v", "length/time", "model_v of the boundary in closed form"}, {"point"},
           closed_forms(growth, points));

  if (!verified.empty()) {
    std::vector<double> count(verified.size());
    std::vector<std::string> regimes;
    for (std::size_t k = 0; k < count.size(); ++k) count[k] = double(k);
    file.scale({"check", "1", "number of the check"}, count);
    const auto of_checks = [&](const Field& field, double Verified::*member) {
      std::vector<double> values;
      for (const Verified& v : verified) values.push_back(v.*member);
      file.add(field, {"check"}, values);
    };
    of_checks({"verified/value", unit(growth.axes()[0]), growth.axes()[0].name}, &Verified::value);
    if (two) of_checks({"verified/value2", unit(growth.axes()[1]), growth.axes()[1].name}, &Verified::value2);
    of_checks({"verified/growth", "1/time", "growth rate"}, &Verified::growth);
    for (const Verified& v : verified) regimes.push_back(v.regime);
    file.add_text({"verified/regime", "1", "regime reached in time"}, {"check"}, regimes);
  }

  const auto sample_axis = [&](const Axis& axis) {
    std::vector<double> values;
    for (int i = 0; i < samples.side; ++i) values.push_back(axis.value(double(i) / (samples.side - 1)));
    return values;
  };
  file.scale({"sample", unit(growth.axes()[0]), growth.axes()[0].name}, sample_axis(growth.axes()[0]));
  if (two) file.scale({"sample2", unit(growth.axes()[1]), growth.axes()[1].name}, sample_axis(growth.axes()[1]));
  file.add({"growth", "1/time", "growth rate"},
           two ? std::vector<std::string>{"sample2", "sample"} : std::vector<std::string>{"sample"}, samples.growth);
  file.write();
}

// Checks of some points by time integration, and what they say that the linear answer does not.
std::vector<Verified> verify(GrowthRate& growth, const Options& options, const std::vector<Crossing>& points,
                             Progress& progress) {
  const PetscInt checks = options.integer("boundary_verify");
  if (checks == 0) return {};
  growth.watch(nullptr);
  progress.restart_clock();
  const auto verified = verify_boundary(growth, options, points, checks, [&](std::size_t number, std::size_t all) {
    if (progress.due())
      progress.show("check " + std::to_string(number + 1) + " of " + std::to_string(all) + " in time" +
                    progress.left(double(number) / double(all)));
  });
  warn_of_damping(options, verified, points);
  for (const Verified& v : verified)
    if (v.from_sliding != v.expected)
      warn("time integration from slightly perturbed sliding at " + growth.axes()[0].name + " " + number_text(v.value) +
           " ends in " + v.from_sliding + " where the growth rate " + number_text(v.growth) + " says " + v.expected);
  return verified;
}

void print_points(const std::vector<Axis>& axes, const std::vector<Crossing>& points) {
  for (const Crossing& c : points) {
    std::string line = axes[0].name + " " + number_text(c.value);
    if (axes.size() > 1) line += "  " + axes[1].name + " " + number_text(c.value2);
    line += "  " + c.kind + ", " + (c.criticality.known() ? c.criticality.word() + ", " : "");
    if (std::isfinite(c.wavenumber))
      line += "frequency " + number_text(c.frequency) + ", wavenumber " + number_text(c.wavenumber);
    else
      line += "the limit of short waves";
    SS_TRY(PetscPrintf(PETSC_COMM_WORLD, "%s\n", line.c_str()));
  }
}

[[noreturn]] void fail_without_points(GrowthRate& growth, const Samples& samples) {
  const Axis& axis = growth.axes()[0];
  if (growth.axes().size() == 1) {
    const double first = growth(0), last = growth(1);
    const bool changes = first * last < 0;
    std::string why = ": " + at_ends(growth);
    if (first * last > 0 && first != last) {
      const bool below = std::abs(first) < std::abs(last);
      why = std::string(": sliding is ") + (first < 0 ? "stable" : "unstable") + " throughout" + why +
            "; it changes, if anywhere, " + ((axis.from < axis.to) == below ? "below " : "above ") +
            number_text(below ? axis.from : axis.to);
    }
    throw Failure("no boundary " + std::string(changes ? "that the grid resolves (grid_n) " : "") + "between " +
                  axis.name + " " + number_text(axis.from) + " and " + number_text(axis.to) + why);
  }
  const auto [low, high] = std::minmax_element(samples.growth.begin(), samples.growth.end());
  throw Failure("no boundary in the box: the growth rate stays between " + number_text(*low) + " and " +
                number_text(*high));
}

int find_boundary(const Options& options, GrowthRate& growth, Summary& summary, const Provenance& provenance) {
  const bool two = growth.axes().size() > 1;
  Progress progress(options.text("progress"), "boundary: ");
  growth.watch([&] {
    if (progress.due()) progress.show(std::to_string(growth.evaluations()) + " growth rates");
  });
  if (!two && !growth.enters())
    throw Failure("-boundary_parameter " + growth.axes()[0].name + ": does not enter this scene: " + at_ends(growth));
  BoundaryFindings findings;
  const std::vector<Crossing> points = two ? boundary_curve(growth, options.integer("boundary_points"), findings)
                                           : boundary_points(growth, findings);
  check_unused_after_setup(options, "eps st ksp pc bv ds pep snes dm ts");
  summary.set("points", point_list(points, two));
  if (two) summary.set("meetings", point_list(findings.meetings, two));
  if (two) summary.set("special", special_list(findings.special));
  summary.set("notes", findings.notes);
  summary.set("evaluations", growth.evaluations());
  for (const std::string& note : findings.notes) warn(note);
  if (std::any_of(points.begin(), points.end(), [](const Crossing& c) { return c.complete && !*c.complete; }))
    warn("modes that were not followed grow already on the boundary found (points with `complete` false): "
         "it lies further on the stable side there");
  if (points.empty()) fail_without_points(growth, findings.samples);
  const std::vector<Verified> verified = verify(growth, options, points, progress);
  if (options.integer("boundary_verify") > 0) summary.set("verified", verified_list(verified, two));
  write_file(options, growth, points, verified, findings, provenance);
  if (options.text("summary") != "-") print_points(growth.axes(), points);
  describe_criticality(summary, growth.axes(), points, findings.special);
  if (two) describe_curve(summary, growth, points);
  else describe(summary, growth, points);
  describe(summary, growth.axes(), verified);
  return 0;
}

}  // namespace

int boundary_command(const Options& options) {
  const Provenance provenance = Provenance::of("boundary", options.all());
  check_outputs(options.text("out_file"), options.text("summary"));
  Summary summary(provenance, {"points", "meetings", "special", "verified", "notes", "evaluations"}, options.text("summary"));
  const std::vector<Axis> axes = axes_from(options);
  const auto varied = [&](const std::vector<Axis>& along) {
    return GrowthRate(PETSC_COMM_WORLD, scene_of(options, along), along, options.text("spectrum_refine") != "off");
  };
  std::optional<GrowthRate> growth;
  std::string foreign;
  try {
    growth.emplace(varied(axes));
  } catch (const ForeignOption& error) {  // unless the scene itself is at fault
    foreign = error.what();
    growth.emplace(varied({}));
  }
  return with_summary(summary, [&] {
    if (!foreign.empty())
      throw Failure("-boundary_parameter " + axes[0].name + ": does not enter this scene (" + foreign +
                    "): growth rate " + number_text((*growth)(0)) + " at both ends");
    return find_boundary(options, *growth, summary, provenance);
  });
}

}  // namespace stickslip
