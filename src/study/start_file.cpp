#include "study/start_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/broadcast.hpp"
#include "options/columns.hpp"
#include "output/carried_frame.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/numerics/interpolation.hpp"

namespace stickslip {

namespace {

constexpr std::size_t nearest = 4;  // points of which a value between is made

// ---- values at the nodes from values at other points
// ---------------------------------------------------------------

double tolerance(const Scene& s) { return 1e-9 * s.length; }

bool stands_on_nodes(const Scene& s, const std::vector<double>& x) {
  bool stands = PetscInt(x.size()) == s.n;
  for (PetscInt i = 0; i < s.n && stands; ++i) stands = std::abs(x[i] - s.x(i)) <= tolerance(s);
  return stands;
}

// The points ascend and reach over the scene; on a ring the last is not the first again.
void check_reach(const Scene& s, const std::vector<double>& x, const std::string& says) {
  for (std::size_t i = 1; i < x.size(); ++i)
    if (!(x[i] > x[i - 1]))
      throw UsageError(fmt::format("{}its points must ascend (point {} at x = {}, the one before at {})",
                                   says, i, number_text(x[i]), number_text(x[i - 1])));
  if (x.size() < nearest)
    throw UsageError(says + std::to_string(x.size()) +
                     " points that are not this scene's nodes; four are the least");
  double widest = 0;
  for (std::size_t i = 1; i < x.size(); ++i) widest = std::max(widest, x[i] - x[i - 1]);
  const double low = x.front(), high = x.back(), gap = low + s.length - high;
  const bool covers =
      s.ring() ? gap > 0 && gap < 1.5 * widest : low <= tolerance(s) && high >= s.length - tolerance(s);
  if (low < -tolerance(s) || high > s.length + tolerance(s) || !covers)
    throw UsageError(says + "its points reach from x = " + number_text(low) + " to " + number_text(high) +
                     ", this scene" + (s.ring() ? ", a ring," : "") + " from 0 to " + number_text(s.length) +
                     "; they must cover it and not go beyond");
}

// At every node the cubic through the four nearest points.
std::vector<double> at_nodes(const Scene& s, const std::vector<double>& x,
                             const std::vector<double>& values) {
  const auto count = static_cast<long>(x.size());
  std::vector<double> result;
  for (PetscInt i = 0; i < s.n; ++i) {
    const double at = s.x(i);
    long first = std::upper_bound(x.begin(), x.end(), at) - x.begin() - 2;
    if (!s.ring()) first = std::clamp(first, 0l, count - long(nearest));
    std::vector<double> points, near;
    for (long j = first; j < first + long(nearest); ++j) {
      const long turn = j < 0 ? -1 : j >= count ? 1 : 0, k = j - turn * count;
      points.push_back(x[k] + double(turn) * s.length);
      near.push_back(values[k]);
    }
    result.push_back(Lagrange(points).value(near.data(), at));
  }
  return result;
}

void bring_to_nodes(const Scene& s, Frame& frame, const std::string& says) {
  if (stands_on_nodes(s, frame.x)) return;
  if (s.form == Form::chain)
    throw UsageError(says + "its " + std::to_string(frame.x.size()) + " points are not this chain's " +
                     std::to_string(s.n) + " blocks, between which there is nothing to interpolate");
  if (s.ring() && frame.x.size() > 1 &&
      std::abs(frame.x.back() - frame.x.front() - s.length) <= tolerance(s)) {
    frame.x.pop_back();
    for (auto& [name, values] : frame.fields)
      if (values.size() > frame.x.size()) values.pop_back();
  }
  check_reach(s, frame.x, says);
  const std::string state = s.friction.has_state() ? state_name(s.friction.state) : "";
  for (auto& [name, values] : frame.fields) {
    if (name != "psi" && name != "eta" && name != state) continue;
    if (name == state)
      for (double& value : values) value = state_from_output(s.friction.state, value);
    values = at_nodes(s, frame.x, values);
    if (name == state)
      for (double& value : values) value = state_to_output(s.friction.state, value);
  }
  warn(says + "its " + std::to_string(frame.x.size()) + " points are not this scene's " +
       std::to_string(s.n) + " nodes: the start is interpolated by cubics through the four nearest");
}

// The end of the run before this one, where it is asked for by its name.
const Frame* carried(const Options& options) {
  const CarriedFrame* frame = CarriedFrame::innermost();
  return frame && frame->start && options.text("init_file") == CarriedFrame::name ? &*frame->start : nullptr;
}

// What the scene needs is there and finite; a contact's age is positive.
void check_fields(const Scene& s, const Options& options, const Frame& frame, const std::string& says) {
  const std::string state = s.friction.has_state() ? state_name(s.friction.state) : "";
  if (!state.empty() && !options.is_set("init_state") && frame.fields.count(state) == 0)
    throw UsageError(says + "it holds no " + state + " for state_law " + to_string(s.friction.state) +
                     "; give init_state");
  for (const auto& [option, field] :
       {std::pair<std::string, std::string>("init_eta", "eta"), {"init_state", state}}) {
    if (!options.is_set(option) || frame.fields.count(field) == 0 || carried(options)) continue;
    const std::string given = option + " " + options.text(option), line = options.line_in_scene(option);
    if (!line.empty())
      throw UsageError(says + "it holds " + field + ", and so does " + line + ": " + given +
                       "; take one of them out (on the command line -" + option +
                       " replaces what the file holds)");
    warn(says + "-" + given + " replaces the " + field + " that it holds");
  }
  for (const auto& [name, values] : frame.fields) {
    if (name != "psi" && name != "eta" && name != state) continue;
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(name == state ? state_from_output(s.friction.state, values[i]) : values[i]))
        throw UsageError(says + name + " = " + number_text(values[i]) + " at x = " + number_text(frame.x[i]) +
                         (std::isfinite(values[i]) ? " is no contact state" : " is not finite"));
  }
}

// ---- the kinds of files
// --------------------------------------------------------------------------------------------

std::string file_of(const Options& options) {
  if (!options.is_set("init_file"))
    throw UsageError("init_type " + options.text("init_type") + " needs init_file" +
                     (options.text("init_type") == "text"
                          ? ", a file of columns x psi eta, and the state where there is one"
                          : ", an HDF5 or NetCDF-4 file"));
  return options.text("init_file");
}
Frame frame_of_text(const Scene& s, const Options& options) {
  const std::string path = file_of(options);
  if (options.is_set("init_frame")) throw UsageError("init_frame: init_type text has no frames");
  std::vector<double> numbers;
  std::size_t columns = 0;
  on_root(PETSC_COMM_WORLD, [&] {
    const Rows rows = read_columns("init_file", path, options.line_in_scene("init_file"), 3, 4);
    columns = rows.values.front().size();
    for (const std::vector<double>& row : rows.values) numbers.insert(numbers.end(), row.begin(), row.end());
  });
  broadcast(columns);
  broadcast(numbers);
  if (columns == 4 && !s.friction.has_state())
    throw UsageError("init_file " + quoted(path) +
                     ": a fourth column, but this scene has no state (state_law none)");
  Frame frame;
  for (std::size_t i = 0; i < numbers.size(); i += columns) {
    frame.x.push_back(numbers[i]);
    frame.fields["psi"].push_back(numbers[i + 1]);
    frame.fields["eta"].push_back(numbers[i + 2]);
    if (columns == 4) frame.fields[state_name(s.friction.state)].push_back(numbers[i + 3]);
  }
  return frame;
}

Frame frame_of_file(const Scene& s, const Options& options) {
  const std::string path = file_of(options);
  if (const Frame* frame = carried(options)) return *frame;
  Frame frame =
      read_frame("init_file", path, options.is_set("init_frame") ? options.integer("init_frame") : -1);
  const auto form = frame.options.find("model_form");
  if (form != frame.options.end() && form->second != to_string(s.form))
    throw UsageError("init_file " + quoted(path) + ": its model_form is " + form->second +
                     ", that of this scene " + to_string(s.form));
  return frame;
}

// An eigenvector of the file of `spectrum` (its real part, times init_amplitude) added to steady sliding, as
// a frame.
Frame frame_from_eigenvector(const Scene& s, const Options& options) {
  const std::string path = options.text("init_file"), what = "init_file";
  const std::size_t mode = options.is_set("init_mode") ? std::size_t(options.integer("init_mode")) : 0;
  std::vector<std::string> names{"psi", "eta"};
  if (s.friction.has_state()) names.push_back(state_name(s.friction.state));
  Frame frame;
  for (const std::string& name : names) {
    std::vector<double> steady = read_array(what, path, "steady_" + name).values;
    const DataArray vectors = read_array(what, path, name + "_re");
    if (vectors.shape.size() != 2 || vectors.shape[1] != steady.size() || mode >= vectors.shape[0])
      throw UsageError(fmt::format("init_mode {}: '{}' holds {} eigenvectors, from 0", mode, path,
                                   vectors.shape.empty() ? 0 : vectors.shape[0]));
    if (PetscInt(steady.size()) != s.n)
      throw UsageError("init_file '" + path + "': it has " + std::to_string(steady.size()) +
                       " nodes, this scene grid_n " + std::to_string(s.n));
    for (std::size_t i = 0; i < steady.size(); ++i) {
      steady[i] += options.real("init_amplitude") * vectors.values[mode * steady.size() + i];
      const bool is_state = name != "psi" && name != "eta";
      if (!std::isfinite(is_state ? state_from_output(s.friction.state, steady[i]) : steady[i]))
        throw UsageError("init_amplitude: with it the start is not finite, or a contact age is not positive");
    }
    frame.fields[name] = std::move(steady);
  }
  return frame;
}

}  // namespace

bool starts_from_eigenvector(const Options& options) {
  return options.text("init_type") == "file" && options.is_set("init_file") && !carried(options) &&
         kind_of("init_file", options.text("init_file")) == "spectrum";
}

Frame start_frame(const Scene& scene, const Options& options) {
  if (starts_from_eigenvector(options)) return frame_from_eigenvector(scene, options);
  Frame frame =
      options.text("init_type") == "text" ? frame_of_text(scene, options) : frame_of_file(scene, options);
  const std::string says = "init_file " + quoted(options.text("init_file")) + ": ";
  check_fields(scene, options, frame, says);
  bring_to_nodes(scene, frame, says);
  return frame;
}

}  // namespace stickslip
