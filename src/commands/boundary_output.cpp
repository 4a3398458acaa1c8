#include "commands/problems.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

namespace {

constexpr int shown = 10;  // digits of a place, which is found to about 1e-10

std::string unit(const Axis& axis) {
  const OptionSpec* spec = find_option(axis.name);
  return spec ? spec->unit : "";
}

// The option's value and, with two axes, that of the second.
template <class Row, class Value>
Columns<Row> place_columns(const std::vector<Axis>& axes, Value value, Value value2) {
  Columns<Row> columns = {{"value", unit(axes[0]), axes[0].name, value}};
  if (axes.size() > 1)
    columns.push_back({"value2", unit(axes[1]), axes[1].name, value2});
  else
    columns.push_back({"value2", "", "", [](const Row&) { return Json(); }, In::summary});
  return columns;
}

// `growth`: whose scenes have a closed form.
Table<Crossing> point_table(const std::vector<Axis>& axes, const GrowthRate* growth) {
  using C = const Crossing&;
  const bool two = axes.size() > 1;
  const std::string grid = "change of it on a grid of half the spacing";
  const auto closed_form = [growth](C c) {  // null where there is none or no axis is model_v
    const Scene scene = growth->scene(c.x, c.y);
    const std::optional<double> v = closed_form_velocity(scene);
    return v ? Json(*v * (scene.v < 0 ? -1 : 1)) : Json();
  };
  Columns<Crossing> columns = {
      {"of", "1", "sliding, stick-slip, waves (on its uniform motion) or trains: whose end the point is",
       &Crossing::of},
      {"kind", "1",
       "hopf or zero; of stick-slip graze, pass, fold, flip, torus or branch; of waves wave; of trains fold, "
       "hopf or "
       "zero",
       &Crossing::kind},
      {"frequency", "1/time", "frequency of the critical mode", &Crossing::frequency},
      {"wavenumber", "1/length", "wavenumber of the critical mode", &Crossing::wavenumber},
      {"degenerate", "1", "1 where many modes cross at once", &Crossing::degenerate},
      {"residual", "1/time", "|J x - lambda x|/|x|, x in the units in which J is balanced",
       &Crossing::residual},
      {"growth_rate", "1/time", "left over at the point", &Crossing::growth, In::summary},
      {"error", unit(axes[0]), "value: " + grid, &Crossing::error},
      {"error2", two ? unit(axes[1]) : "", "value2: " + grid,
       [two](C c) { return two ? Json(c.error2) : Json(); }, two ? In::both : In::summary},
      {"piece", "1", "piece of the curve", &Crossing::piece},
      {"switched", "1", "1 where another mode leads than before", &Crossing::switched},
      {"complete", "", "no other mode is unstable there", &Crossing::complete, In::summary},
      {"criticality", "1", "supercritical or subcritical; empty where it is not known",
       [](C c) { return c.criticality.word(); }},
      {"closed_form_v", "length/time", "model_v of the boundary in closed form", closed_form, In::file}};
  const Columns<Criticality> of_criticality = {
      {"lyapunov_coefficient", "1/(time velocity^2)", "l of da/dt = growth a + l a^3, a: amplitude of psi",
       &Criticality::coefficient},
      {"lyapunov_of", "1", "the oscillation that it belongs to", &Criticality::of},
      {"lyapunov_travelling", "1/(time velocity^2)", "on a ring, that of the travelling wave",
       &Criticality::travelling, In::summary},
      {"lyapunov_standing", "1/(time velocity^2)", "on a ring, that of the standing wave",
       &Criticality::standing, In::summary},
      {"criticality_unknown", "", "why they are null", &Criticality::why_not, In::summary}};
  return {"points", "", "point",
          place_columns<Crossing>(axes, &Crossing::value, &Crossing::value2) + columns +
              of<Crossing>(&Crossing::criticality, of_criticality),
          "number of the point"};
}

Table<SpecialPlace> special_table(const std::vector<Axis>& axes) {
  const Columns<Crossing> at = {
      {"value", unit(axes.front()), "value", &Crossing::value},
      {"value2", unit(axes.back()), "value2", &Crossing::value2},
      {"frequency", "1/time", "of the mode that crosses", &Crossing::frequency, In::summary},
      {"wavenumber", "1/length", "likewise", &Crossing::wavenumber, In::summary},
      {"piece", "1", "of the curve", &Crossing::piece, In::summary}};
  return {"special", "special/", "special/point",
          Columns<SpecialPlace>{{"kind", "1", "bautin: the criticality changes", &SpecialPlace::kind}} +
              of<SpecialPlace>(&SpecialPlace::at, at)};
}

Table<Verified> check_table(const std::vector<Axis>& axes) {
  return {
      "verified", "verified/", "check",
      place_columns<Verified>(axes, &Verified::value, &Verified::value2) +
          Columns<Verified>{
              {"of", "1", "sliding or stick-slip: beside whose end", &Verified::of},
              {"growth_rate", "1/time", "growth rate", &Verified::growth, In::both, "growth"},
              {"expected", "", "what the point says", &Verified::expected, In::summary},
              {"from_sliding", "", "where slightly perturbed sliding goes", &Verified::from_sliding,
               In::summary},
              {"from_stick_slip", "", "where large oscillations go", &Verified::from_stick_slip, In::summary},
              {"regime", "1", "regime reached in time", &Verified::regime}},
      "number of the check"};
}

// Trains that were looked at.
Table<TrainSample> train_table(const std::vector<Axis>& axes) {
  using Row = const TrainSample&;
  using Value = std::function<Json(Row)>;
  return {
      "", "train/", "train/number",
      place_columns<TrainSample>(axes, Value([axis = axes.front()](Row s) { return axis.value(s.value); }),
                                 Value([axis = axes.back()](Row s) { return axis.value(s.value2); })) +
          Columns<TrainSample>{
              {"stable", "1", "1 where the train is stable on its ring", &TrainSample::stable}}};
}

}  // namespace

Columns<FoundBoundary> boundary_keys() {
  using F = const FoundBoundary&;
  const auto of_curve = [](F f, const Json& list) { return f.axes.size() > 1 ? list : Json(); };
  return {{"points", "",
           "one entry a crossing, or a point of the curve: those of sliding first, then those of stick-slip, "
           "of waves and of trains",
           [](F f) { return list_of(point_table(f.axes, nullptr), f.points()); }},
          {"meetings", "",
           "where another mode takes the lead along a curve, and the frequency jumps; as `points`",
           [=](F f) { return of_curve(f, list_of(point_table(f.axes, nullptr), f.findings.meetings)); }},
          {"special", "", "points of the curve at which something changes",
           [=](F f) { return of_curve(f, list_of(special_table(f.axes), f.findings.special)); }},
          {"verified", "",
           "with `-boundary_verify`: what runs on both sides did, from sliding and from stick-slip",
           [](F f) { return f.checked ? list_of(check_table(f.axes), f.verified) : Json(); }},
          {"notes", "", "what a reader of the points should know", [](F f) { return f.findings.notes; }},
          {"evaluations", "1", "growth rates and stick-slip motions computed", &FoundBoundary::evaluations}};
}

std::vector<TableText> boundary_tables() {
  const std::vector<Axis> axes = {{"the option's value", 0, 1}, {"that of the second option", 0, 1}};
  return {boundary_keys(), point_table(axes, nullptr), special_table(axes), check_table(axes),
          train_table(axes)};
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

// What holds where along an axis, between places on it.
template <class Word>
void say_along(Summary& summary, const Axis& axis, const std::string& what, const std::vector<double>& ends,
               const Word& word) {
  std::string text;
  double begin = 0;
  for (const double end : ends) {
    text += fmt::format("{}{} from {} to {}", text.empty() ? " " : ", ", word((begin + end) / 2),
                        rounded_text(axis.value(begin), shown),
                        in_unit(axis.value(end), shown, unit(axis), axis.name));
    begin = end;
  }
  summary.say("along " + called(axis.name) + " " + what + text);
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
  say_along(summary, axis, "uniform motion", ends, [&](double middle) {
    const double here = found.distances[std::lround(middle * cells)];
    return std::isnan(here) ? "rests permanently" : here < 0 ? "can stick and slip" : "cannot stick and slip";
  });
}

void describe_curve(Summary& summary, const GrowthRate& growth, const std::vector<Crossing>& points,
                    const std::string& of) {
  int pieces = 0;
  for (const Crossing& c : points) pieces = std::max(pieces, c.piece + 1);
  std::string text = fmt::format("{}: curve of {} points in {} pieces", of, points.size(), pieces);
  const auto range = [&](const Axis& axis, double Crossing::*value) {
    const auto [low, high] = std::minmax_element(points.begin(), points.end(),
                                                 [=](auto& a, auto& b) { return a.*value < b.*value; });
    text += fmt::format(", {} {:.6g} to {}", called(axis.name), (*low).*value,
                        in_unit((*high).*value, 6, unit(axis), axis.name));
  };
  range(growth.axes()[0], &Crossing::value);
  range(growth.axes()[1], &Crossing::value2);
  summary.say(text);
}

void describe_checks(Summary& summary, const std::vector<Axis>& axes, const std::vector<Verified>& verified) {
  for (const Verified& v : verified)
    summary.say(fmt::format(
        "integrated at {} {:.6g}{}: from sliding to {}, from stick-slip to {}; {} says {}", axes[0].name,
        v.value, axes.size() > 1 ? fmt::format(", {} {:.6g}", axes[1].name, v.value2) : "", v.from_sliding,
        v.from_stick_slip,
        v.of == "sliding" ? fmt::format("the growth rate {:.3g}", v.growth) : "the end of stick-slip",
        v.expected));
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
    summary.say(share(down) + "sliding jumps to stick-slip (subcritical): the two coexist near the boundary");
  if (std::any_of(points.begin(), points.end(),
                  [](auto& c) { return c.degenerate && c.criticality.known(); }))
    summary.say("many modes cross at once; the criticality is that of the longest, taken alone");
  for (const SpecialPlace& p : special)
    summary.say(fmt::format("the criticality changes ({} point) at {} {:.10g}, {} {:.10g}", p.kind,
                            axes[0].name, p.at.value, axes[1].name, p.at.value2));
}

}  // namespace

void describe_sliding(Summary& summary, const std::string& what, const std::function<double(double)>& growth,
                      const FoundBoundary& found) {
  std::vector<double> ends;
  for (const Crossing& c : found.sliding) ends.push_back(c.x);
  for (const double turn : found.findings.turns)
    if (turn > 1e-8 && turn < 1 - 1e-8) ends.push_back(turn);  // ends are looked at from inside
  ends.push_back(1);
  std::sort(ends.begin(), ends.end());
  say_along(summary, found.axes[0], what, ends,
            [&](double middle) { return stability_word(growth(middle)); });
}

void describe(Summary& summary, GrowthRate& growth, const FoundBoundary& found) {
  const bool two = growth.axes().size() > 1;
  if (!found.sliding.empty()) {
    describe_criticality(summary, growth.axes(), found.sliding, found.findings.special);
    if (two)
      describe_curve(summary, growth, found.sliding, "sliding");
    else
      describe_sliding(summary, "sliding is", [&](double x) { return growth(x); }, found);
  }
  if (two && !found.stick_slip.empty()) describe_curve(summary, growth, found.stick_slip, "stick-slip");
  if (!two && !found.cell && !found.distances.empty())
    describe_stick_slip(summary, growth.axes()[0], found);
  if (!found.waves.empty()) describe_curve(summary, growth, found.waves, "waves on uniform stick-slip");
  if (!found.trains.empty()) describe_curve(summary, growth, found.trains, "limits of stable trains");
  describe_checks(summary, growth.axes(), found.verified);
}

namespace {

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

}  // namespace

void write_file(const CommandRun& run, const GrowthRate& growth, const FoundBoundary& found) {
  if (!run.has_file()) return;
  ResultFile file = run.file();
  const std::vector<Axis>& axes = growth.axes();
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const std::string suffix = k == 0 ? "" : "2";
    file.attribute("parameter" + suffix, axes[k].name);
    file.attribute("log" + suffix, axes[k].logarithmic ? 1. : 0.);
  }
  add_rows(file, point_table(axes, &growth), found.points());
  add_rows(file, special_table(axes), found.findings.special);
  add_rows(file, check_table(axes), found.verified);
  // Lattices: the growth rate of sliding, and how far stick-slip is from its end.
  add_lattice(file, axes, "sample", {"growth", "1/time", "growth rate"}, found.findings.samples.growth);
  add_lattice(
      file, axes, "stick_slip_sample",
      {"stick_slip_distance", "velocity", "of uniform stick-slip from its end, negative where it exists"},
      found.distances);
  add_lattice(file, axes, "wave_sample",
              {"wave_growth", "1/time", "largest growth rate of waves on the uniform oscillation"},
              found.wave_growth);
  add_rows(file, train_table(axes), found.train_samples);
  file.write();
}

void print_points(const std::vector<Axis>& axes, const std::vector<Crossing>& points) {
  static const std::map<std::string, std::string> whose = {{"sliding", ""},
                                                           {"stick-slip", "end of stick-slip, "},
                                                           {"waves", "waves on uniform stick-slip, "},
                                                           {"trains", "end of stable trains, "}};
  const auto place = [&](std::size_t k, double value) {
    return called(axes[k].name) + " " + in_unit(value, shown, unit(axes[k]), axes[k].name);
  };
  for (const Crossing& c : points) {
    const std::string frequency = "frequency " + frequency_text(c.frequency, shown);
    const std::string mode = c.of != "sliding" ? frequency
                             : std::isfinite(c.wavenumber)
                                 ? frequency + ", wavenumber " + rounded_text(c.wavenumber, shown)
                                 : "the limit of short waves";
    const std::string line =
        fmt::format("{}{}  {}{}, {}{}\n", place(0, c.value), axes.size() > 1 ? "  " + place(1, c.value2) : "",
                    whose.at(c.of), c.kind, c.criticality.known() ? c.criticality.word() + ", " : "", mode);
    SS_TRY(PetscPrintf(PETSC_COMM_WORLD, "%s", line.c_str()));
  }
}

}  // namespace stickslip
