#include "commands/wave_options.hpp"

#include "commands/command_run.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

TrainRequest train_request(const Options& options) {
  TrainRequest request{options.integer("wave_pulses"), options.real_if_set("wave_length"),
                       options.real_if_set("wave_speed")};
  if (bool(request.length) == bool(request.speed))
    throw UsageError(request.length
                         ? "wave_length and wave_speed are both set: exactly one of the two is needed"
                         : "wave_length or wave_speed is needed: exactly one of the two");
  return request;
}

void check_branch(const Options& options) {
  check_continuation(options, "wave");
  check_continuation(options, "wave", "2");
  for (const char* asked : {"wave_continue", "wave_continue2"})
    if (options.is_set(asked) && options.text(asked) == "model_nu")
      throw UsageError(std::string(asked) +
                       " model_nu: trains are solved for without viscosity between neighbours");
  if (!options.is_set("wave_continue2")) return;
  const std::string name = options.text("wave_continue"), name2 = options.text("wave_continue2");
  if (!options.is_set("wave_continue"))
    throw UsageError("wave_continue2 " + name2 + ": needs wave_continue: limits are found on a branch first");
  if (name == name2) throw UsageError("wave_continue2 " + name2 + ": is wave_continue already");
}

TrainFamily train_family(const Options& options, const std::string& name) {
  return {name, [options, name](double value) {
            const Options here = options.with(name, value);
            return TrainCase{Scene::from(here, true), train_request(here)};
          }};
}

TrainFamily2 train_family(const Options& options, const std::string& name, const std::string& name2) {
  return {name, name2, [options, name, name2](double value, double value2) {
            const Options here =
                name == name2 ? options.with(name, value) : options.with(name, value).with(name2, value2);
            return TrainCase{Scene::from(here, true), train_request(here)};
          }};
}

}  // namespace stickslip
