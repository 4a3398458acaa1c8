#include "study/quantity.hpp"

#include "output/measures.hpp"
#include "stickslip/base/error.hpp"
#include "options/values.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

Quantity Quantity::from(const Options& options) {
  const std::string text = options.text("accuracy_of");
  const UsageError wrong("accuracy_of " + quoted(text) +
                         ": it is fields, speed, period, amplitude, or probe:x with a place x of the scene");
  if (text.rfind("probe:", 0) == 0) {
    const auto x = parse_number(text.substr(6));
    const bool inside = x && *x >= 0 && *x <= Scene::from(options, false).length;
    if (!inside) throw UsageError(wrong);
    return {Kind::probe, *x};
  }
  if (text == "fields") return {};
  if (text == "speed") return {Kind::speed};
  if (text == "amplitude") return {Kind::amplitude};
  if (text != "period") throw UsageError(wrong);
  return {Kind::period};
}

namespace {

// Of out_probes, if given; else the middle of the scene, in a chain the block there that is not held.
std::vector<double> places_of_period(const Options& options) {
  if (options.is_set("out_probes")) return options.reals("out_probes");
  const Scene scene = Scene::from(options, false);
  if (scene.form == Form::continuum) return {scene.length / 2};
  const PetscInt middle = scene.n / 2;
  return {scene.x(scene.held(middle) && middle > 0 ? middle - 1 : middle)};
}

}  // namespace

std::vector<double> Quantity::places(const Options& options) const {
  if (kind == Kind::probe) return {x};
  return kind == Kind::fields ? options.reals("out_probes") : std::vector<double>();
}

MeasureMaker Quantity::measure(const Options& options) const {
  const double t_end = options.real("ts_max_time");
  switch (kind) {
    case Kind::speed:
      return [t_end](const Model& model, const Scene&) { return std::make_unique<WaveSpeed>(model, t_end); };
    case Kind::amplitude:
      return [t_end](const Model& model, const Scene&) { return std::make_unique<Amplitude>(model, t_end); };
    case Kind::period:
      return [t_end, x = places_of_period(options)](const Model& model, const Scene& whole) {
        return std::make_unique<Period>(model, whole, x, t_end, true);
      };
    case Kind::fields:
    case Kind::probe: break;
  }
  return nullptr;
}

std::string Quantity::name() const {
  switch (kind) {
    case Kind::speed: return "wave_speed";
    case Kind::amplitude: return "amplitude";
    case Kind::period: return "period";
    case Kind::probe: return "probe";
    case Kind::fields: break;
  }
  return "fields";
}

}  // namespace stickslip
