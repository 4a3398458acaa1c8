#include "commands/boundary_output.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "stickslip/base/error.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

namespace {

Json number_or_null(double x) { return std::isnan(x) ? Json() : Json(x); }
Json text_or_null(const std::string& text) { return text.empty() ? Json() : Json(text); }

}  // namespace

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
                                 {"of", c.of},
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

Json special_list(const std::vector<SpecialPlace>& points) {
  Json list = Json::array();
  for (const SpecialPlace& p : points)
    list.push_back(Json::object({{"kind", p.kind},
                                 {"value", p.at.value},
                                 {"value2", p.at.value2},
                                 {"frequency", p.at.frequency},
                                 {"wavenumber", p.at.wavenumber},
                                 {"piece", p.at.piece}}));
  return list;
}

namespace {

// The plate velocity of each point in closed form, NaN where there is none or no axis is model_v.
std::vector<double> closed_forms(GrowthRate& growth, const std::vector<Crossing>& points) {
  std::vector<double> v;
  for (const Crossing& c : points) {
    const Scene scene = growth.scene(c.x, c.y);
    v.push_back(closed_form_velocity(scene).value_or(std::nan("")) * (scene.v < 0 ? -1 : 1));
  }
  return v;
}

}  // namespace

Json verified_list(const std::vector<Verified>& verified, bool two) {
  Json list = Json::array();
  for (const Verified& v : verified)
    list.push_back(Json::object({{"value", v.value},
                                 {"value2", two ? Json(v.value2) : Json()},
                                 {"of", v.of},
                                 {"growth_rate", v.growth},
                                 {"expected", v.expected},
                                 {"from_sliding", v.from_sliding},
                                 {"from_stick_slip", v.from_stick_slip},
                                 {"regime", v.regime}}));
  return list;
}
std::vector<Crossing> FoundBoundary::points() const {
  std::vector<Crossing> all;
  for (const auto* some : {&sliding, &stick_slip, &waves, &trains}) {
    int first = 0;
    for (const Crossing& c : all) first = std::max(first, c.piece + 1);
    for (Crossing c : *some) {
      c.piece += first;
      all.push_back(c);
    }
  }
  return all;
}

namespace {

// Where sliding is stable along the first axis, and what crosses.
void describe_sliding(Summary& summary, GrowthRate& growth, const std::vector<Crossing>& points) {
  const Axis& axis = growth.axes()[0];
  std::string text = "along " + axis.name + " sliding is";
  double begin = 0;
  for (std::size_t k = 0; k <= points.size(); ++k) {
    const double end = k < points.size() ? points[k].x : 1, rate = growth((begin + end) / 2);
    text += std::string(k == 0 ? "" : ",") +
            (std::isnan(rate) ? " not there"
             : rate > 0       ? " unstable"
                              : " stable") +
            " from " + number_text(axis.value(begin)) + " to " + number_text(axis.value(end));
    begin = end;
  }
  summary.say(text);
}

// Where uniform motion sticks and slips along the first axis. Where the samples change without a point of
// stick-slip between them, its cycle shrinks to nothing at a Hopf point of sliding.
void describe_stick_slip(Summary& summary, const Axis& axis, const FoundBoundary& found) {
  const double cells = double(found.distances.size() - 1);
  std::vector<double> ends;
  const auto between = [&](const std::vector<Crossing>& points, double low, double high) {
    for (const Crossing& c : points)
      if (c.x >= low && c.x <= high) ends.push_back(c.x);
  };
  for (std::size_t k = 0; k + 1 < found.distances.size(); ++k) {
    const double low = double(k) / cells, high = double(k + 1) / cells;
    const std::size_t before = ends.size();
    between(found.stick_slip, low, high);
    const bool changes = found.distances[k] * found.distances[k + 1] < 0;
    if (changes && ends.size() == before) between(found.sliding, low, high);
    if (changes && ends.size() == before) ends.push_back((low + high) / 2);
  }
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  ends.push_back(1);
  std::string text = "along " + axis.name + " uniform motion";
  double begin = 0;
  for (const double end : ends) {
    const double here = found.distances[std::lround((begin + end) / 2 * cells)];
    text += std::string(begin == 0 ? "" : ",") +
            (std::isnan(here) ? " rests for ever"
             : here < 0       ? " can stick and slip"
                              : " cannot stick and slip") +
            " from " + number_text(axis.value(begin)) + " to " + number_text(axis.value(end));
    begin = end;
  }
  summary.say(text);
}

void describe_curve(Summary& summary, const GrowthRate& growth, const std::vector<Crossing>& points,
                    const std::string& of) {
  std::string text = of + ": curve of " + std::to_string(points.size()) + " points in " +
                     std::to_string(1 + std::max_element(points.begin(), points.end(),
                                                         [](auto& a, auto& b) { return a.piece < b.piece; })
                                            ->piece) +
                     " pieces";
  const auto range = [&](const Axis& axis, double Crossing::*value) {
    const auto [low, high] = std::minmax_element(points.begin(), points.end(),
                                                 [=](auto& a, auto& b) { return a.*value < b.*value; });
    text +=
        ", " + axis.name + " " + rounded_text((*low).*value, 6) + " to " + rounded_text((*high).*value, 6);
  };
  range(growth.axes()[0], &Crossing::value);
  range(growth.axes()[1], &Crossing::value2);
  summary.say(text);
}

void describe_checks(Summary& summary, const std::vector<Axis>& axes, const std::vector<Verified>& verified) {
  for (const Verified& v : verified)
    summary.say("integrated at " + axes[0].name + " " + rounded_text(v.value, 6) +
                (axes.size() > 1 ? ", " + axes[1].name + " " + rounded_text(v.value2, 6) : "") +
                ": from sliding to " + v.from_sliding + ", from stick-slip to " + v.from_stick_slip +
                (v.of == "sliding" ? "; the growth rate " + rounded_text(v.growth) + " says " + v.expected
                                   : "; the end of stick-slip says " + v.expected));
}

// What the criticality of the points says, and where it changes.
void describe_criticality(Summary& summary, const std::vector<Axis>& axes,
                          const std::vector<Crossing>& points, const std::vector<SpecialPlace>& special) {
  const auto count = [&](const std::string& word) {
    return std::count_if(points.begin(), points.end(), [&](auto& c) { return c.criticality.word() == word; });
  };
  const auto all = long(points.size()), up = count("supercritical"), down = count("subcritical");
  const auto share = [&](long n) {
    return n == all ? std::string() : "at " + std::to_string(n) + " of " + std::to_string(all) + " points ";
  };
  if (up > 0) summary.say(share(up) + "stick-slip grows out of sliding (supercritical)");
  if (down > 0)
    summary.say(share(down) +
                "sliding loses to stick-slip by a jump (subcritical): both live beside the boundary");
  if (std::any_of(points.begin(), points.end(),
                  [](auto& c) { return c.degenerate && c.criticality.known(); }))
    summary.say("many modes cross at once; the criticality is that of the longest, taken alone");
  for (const SpecialPlace& p : special)
    summary.say("the criticality changes (" + p.kind + " point) at " + axes[0].name + " " +
                rounded_text(p.at.value, 10) + ", " + axes[1].name + " " + rounded_text(p.at.value2, 10));
}
}  // namespace

void describe(Summary& summary, GrowthRate& growth, const FoundBoundary& found) {
  const bool two = growth.axes().size() > 1;
  if (!found.sliding.empty()) {
    describe_criticality(summary, growth.axes(), found.sliding, found.findings.special);
    if (two)
      describe_curve(summary, growth, found.sliding, "sliding");
    else
      describe_sliding(summary, growth, found.sliding);
  }
  if (!found.stick_slip.empty()) {
    if (two)
      describe_curve(summary, growth, found.stick_slip, "stick-slip");
    else if (!found.cell)
      describe_stick_slip(summary, growth.axes()[0], found);
  }
  if (!found.waves.empty()) describe_curve(summary, growth, found.waves, "waves on uniform stick-slip");
  if (!found.trains.empty()) describe_curve(summary, growth, found.trains, "limits of stable trains");
  describe_checks(summary, growth.axes(), found.verified);
}

namespace {

// Criticality of every point, and the special points of a curve.
void add_criticality(ResultFile& file, const std::vector<Crossing>& points,
                     const std::vector<SpecialPlace>& special, const std::string& unit,
                     const std::string& unit2) {
  std::vector<std::string> words, of;
  std::vector<double> coefficient, value, value2;
  for (const Crossing& c : points) {
    words.push_back(c.criticality.word());
    of.push_back(c.criticality.of);
    coefficient.push_back(c.criticality.coefficient);
  }
  file.add_text({"criticality", "1", "supercritical or subcritical; empty where it is not known"}, {"point"},
                words);
  file.add(
      {"lyapunov_coefficient", "1/(time velocity^2)", "l of da/dt = growth a + l a^3, a: amplitude of psi"},
      {"point"}, coefficient);
  file.add_text({"lyapunov_of", "1", "the oscillation that it belongs to"}, {"point"}, of);
  if (special.empty()) return;
  std::vector<std::string> kinds;
  for (const SpecialPlace& p : special) {
    kinds.push_back(p.kind);
    value.push_back(p.at.value);
    value2.push_back(p.at.value2);
  }
  file.add({"special/value", unit, "value"}, {"special/point"}, value);
  file.add({"special/value2", unit2, "value2"}, {"special/point"}, value2);
  file.add_text({"special/kind", "1", "bautin: the criticality changes"}, {"special/point"}, kinds);
}

std::string unit(const Axis& axis) { return find_option(axis.name)->unit; }

void add_checks(ResultFile& file, const std::vector<Axis>& axes, const std::vector<Verified>& verified) {
  if (verified.empty()) return;
  std::vector<double> count(verified.size());
  std::vector<std::string> regimes, of;
  for (std::size_t k = 0; k < count.size(); ++k) count[k] = double(k);
  file.scale({"check", "1", "number of the check"}, count);
  const auto add = [&](const Field& field, double Verified::*member) {
    std::vector<double> values;
    for (const Verified& v : verified) values.push_back(v.*member);
    file.add(field, {"check"}, values);
  };
  add({"verified/value", unit(axes[0]), axes[0].name}, &Verified::value);
  if (axes.size() > 1) add({"verified/value2", unit(axes[1]), axes[1].name}, &Verified::value2);
  add({"verified/growth", "1/time", "growth rate"}, &Verified::growth);
  for (const Verified& v : verified) {
    regimes.push_back(v.regime);
    of.push_back(v.of);
  }
  file.add_text({"verified/regime", "1", "regime reached in time"}, {"check"}, regimes);
  file.add_text({"verified/of", "1", "sliding or stick-slip: beside whose end"}, {"check"}, of);
}

// Values at even places of the axes, the first axis fastest.
void add_lattice(ResultFile& file, const std::vector<Axis>& axes, const std::string& dimension,
                 const Field& field, const std::vector<double>& values) {
  if (values.empty()) return;
  const bool two = axes.size() > 1;
  const int side = two ? int(std::lround(std::sqrt(double(values.size())))) : int(values.size());
  const auto places = [&](const Axis& axis) {
    std::vector<double> at;
    for (int i = 0; i < side; ++i) at.push_back(axis.value(double(i) / (side - 1)));
    return at;
  };
  file.scale({dimension, unit(axes[0]), axes[0].name}, places(axes[0]));
  if (two) file.scale({dimension + "2", unit(axes[1]), axes[1].name}, places(axes[1]));
  file.add(field,
           two ? std::vector<std::string>{dimension + "2", dimension} : std::vector<std::string>{dimension},
           values);
}

// Trains that were looked at, and whether each is stable.
void add_trains(ResultFile& file, const std::vector<Axis>& axes, const std::vector<TrainSample>& samples) {
  if (samples.empty()) return;
  std::vector<double> value, value2, stable;
  for (const TrainSample& s : samples) {
    value.push_back(axes[0].value(s.value));
    value2.push_back(axes[1].value(s.value2));
    stable.push_back(s.stable);
  }
  file.add({"train/value", unit(axes[0]), axes[0].name}, {"train/number"}, value);
  file.add({"train/value2", unit(axes[1]), axes[1].name}, {"train/number"}, value2);
  file.add({"train/stable", "1", "1 where the train is stable on its ring"}, {"train/number"}, stable);
}

}  // namespace

void write_file(const Options& options, GrowthRate& growth, const FoundBoundary& found,
                const Provenance& provenance) {
  const std::vector<Crossing> points = found.points();
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
  add({"value", unit(growth.axes()[0]), growth.axes()[0].name}, [](const Crossing& c) { return c.value; });
  if (two)
    add({"value2", unit(growth.axes()[1]), growth.axes()[1].name},
        [](const Crossing& c) { return c.value2; });
  add({"frequency", "1/time", "frequency of the critical mode"},
      [](const Crossing& c) { return c.frequency; });
  add({"wavenumber", "1/length", "wavenumber of the critical mode"},
      [](const Crossing& c) { return c.wavenumber; });
  add({"degenerate", "1", "1 where many modes cross at once"},
      [](const Crossing& c) { return double(c.degenerate); });
  add({"residual", "1/time", "|J x - lambda x|/|x|"}, [](const Crossing& c) { return c.residual; });
  const std::string grid = "change of it on a grid of half the spacing";
  add({"error", unit(growth.axes()[0]), "value: " + grid}, [](const Crossing& c) { return c.error; });
  if (two)
    add({"error2", unit(growth.axes()[1]), "value2: " + grid}, [](const Crossing& c) { return c.error2; });
  add({"piece", "1", "piece of the curve"}, [](const Crossing& c) { return double(c.piece); });
  add({"switched", "1", "1 where another mode leads than before"},
      [](const Crossing& c) { return double(c.switched); });
  std::vector<std::string> kinds, of;
  for (const Crossing& c : points) {
    kinds.push_back(c.kind);
    of.push_back(c.of);
  }
  file.add_text({"kind", "1",
                 "hopf or zero; of stick-slip graze, pass, fold, flip, torus or branch; of waves wave; of "
                 "trains fold, hopf or zero"},
                {"point"}, kinds);
  file.add_text(
      {"of", "1", "sliding, stick-slip, waves (on its uniform motion) or trains: whose end the point is"},
      {"point"}, of);
  add_criticality(file, points, found.findings.special, unit(growth.axes()[0]),
                  two ? unit(growth.axes()[1]) : "");
  file.add({"closed_form_v", "length/time", "model_v of the boundary in closed form"}, {"point"},
           closed_forms(growth, points));

  add_checks(file, growth.axes(), found.verified);
  // Lattices: the growth rate of sliding, and how far stick-slip is from its end.
  add_lattice(file, growth.axes(), "sample", {"growth", "1/time", "growth rate"},
              found.findings.samples.growth);
  add_lattice(
      file, growth.axes(), "stick_slip_sample",
      {"stick_slip_distance", "velocity", "of uniform stick-slip from its end, negative where it lives"},
      found.distances);
  add_lattice(file, growth.axes(), "wave_sample",
              {"wave_growth", "1/time", "largest growth rate of waves on the uniform oscillation"},
              found.wave_growth);
  add_trains(file, growth.axes(), found.train_samples);
  file.write();
}

void print_points(const std::vector<Axis>& axes, const std::vector<Crossing>& points) {
  for (const Crossing& c : points) {
    std::string line = axes[0].name + " " + number_text(c.value);
    if (axes.size() > 1) line += "  " + axes[1].name + " " + number_text(c.value2);
    static const std::map<std::string, std::string> whose = {{"sliding", "  "},
                                                             {"stick-slip", "  end of stick-slip, "},
                                                             {"waves", "  waves on uniform stick-slip, "},
                                                             {"trains", "  end of stable trains, "}};
    line += whose.at(c.of) + c.kind + ", " + (c.criticality.known() ? c.criticality.word() + ", " : "");
    if (c.of != "sliding")
      line += "frequency " + number_text(c.frequency);
    else if (std::isfinite(c.wavenumber))
      line += "frequency " + number_text(c.frequency) + ", wavenumber " + number_text(c.wavenumber);
    else
      line += "the limit of short waves";
    SS_TRY(PetscPrintf(PETSC_COMM_WORLD, "%s\n", line.c_str()));
  }
}

}  // namespace stickslip
