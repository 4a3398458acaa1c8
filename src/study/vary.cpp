#include "stickslip/study/vary.hpp"

namespace stickslip {

Options options_with(const Options& options, const std::vector<Axis>& axes, double value, double value2) {
  Options o = options;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const double here = k == 0 ? value : value2;
    o = o.with(axes[k].name, here);
    for (const std::string& name : axes[k].same) o = o.with(name, here);
  }
  return o;
}

SceneAt scene_of(const Options& options, const std::vector<Axis>& axes) {
  return [options, axes](double value, double value2) {
    return Scene::from(options_with(options, axes, value, value2), true);
  };
}

}  // namespace stickslip
