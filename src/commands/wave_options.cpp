#include "commands/wave_options.hpp"

#include "commands/continuation.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

TrainRequest train_request(const Options& options) {
  TrainRequest request{options.integer("wave_pulses"), options.real_if_set("wave_length"),
                       options.real_if_set("wave_speed"), true};
  if (bool(request.length) == bool(request.speed))
    throw UsageError(request.length ? "wave_length and wave_speed are both set: exactly one of the two is needed"
                                    : "wave_length or wave_speed is needed: exactly one of the two");
  return request;
}

void check_branch(const Options& options) { check_continuation(options, "wave"); }

TrainFamily train_family(const Options& options, const std::string& name) {
  return {name, [options, name](double value) {
            const Options here = options.with(name, value);
            return TrainCase{Scene::from(here, true), train_request(here)};
          }};
}

}  // namespace stickslip
