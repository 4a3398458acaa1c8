#include "output/carried_frame.hpp"

#include <cstdint>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

#include "base/broadcast.hpp"
#include "base/json_values.hpp"
#include "base/paths.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/output/slab.hpp"

namespace stickslip {

namespace {
CarriedFrame* newest = nullptr;
}  // namespace

CarriedFrame::CarriedFrame(std::optional<Frame> from)
    : start(std::move(from)), before_(std::exchange(newest, this)) {}
CarriedFrame::~CarriedFrame() { newest = before_; }
CarriedFrame* CarriedFrame::innermost() { return newest; }

void CarriedFrame::keep(const Model& model, const Scene& whole, Vec u, double t) {
  const StateLaw law = whole.friction.state;
  std::vector<std::string> names{"psi", "eta"};
  if (model.dof() == 3) names.push_back(state_name(law));
  Frame frame;
  frame.t = t;
  frame.count = 1;
  frame.options["model_form"] = to_string(whole.form);
  for (PetscInt i = 0; i < whole.n; ++i) frame.x.push_back(whole.x(i));
  Gather gather(u, model.dof());
  const std::vector<std::vector<double>>& own = gather.components(u);
  for (std::size_t d = 0; d < names.size(); ++d) {
    std::vector<double> values;
    for (PetscInt i = 0; i < whole.n && !own[d].empty(); ++i) {
      const double value = own[d][i % model.scene().n] - (d == 1 ? whole.push(t) : 0);
      values.push_back(d == 2 ? state_to_output(law, value) : value);
    }
    broadcast(values);
    frame.fields[names[d]] = std::move(values);
  }
  end = std::move(frame);
}

void save_frame(const std::string& path, const Frame& frame) {
  on_root(PETSC_COMM_WORLD, [&] {
    Json fields = Json::object();
    for (const auto& [name, values] : frame.fields) fields[name] = values;
    const std::vector<std::uint8_t> bytes = Json::to_cbor(Json::object(
        {{"t", frame.t}, {"form", frame.options.at("model_form")}, {"x", frame.x}, {"fields", fields}}));
    paths::replace_file(path, std::string(bytes.begin(), bytes.end()), ".tmp", false);
  });
}

Frame load_frame(const std::string& path) {
  Frame frame;
  std::string form;
  on_root(PETSC_COMM_WORLD, [&] {
    std::ifstream file(path, std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    try {
      const Json all = Json::from_cbor(bytes);
      frame.t = all.at("t").get<double>();
      form = all.at("form").get<std::string>();
      frame.x = all.at("x").get<std::vector<double>>();
      for (const auto& [name, values] : all.at("fields").items())
        frame.fields[name] = values.get<std::vector<double>>();
    } catch (const std::exception&) {
      throw Failure("cannot read '" + path + "', in which a line that is followed stands");
    }
  });
  broadcast_all(frame.t, form, frame.x, frame.fields);
  frame.count = 1;
  frame.options["model_form"] = form;
  return frame;
}

}  // namespace stickslip
