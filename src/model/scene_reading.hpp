// What the parts of Scene::from() share.
#pragma once

#include <string>
#include <vector>

#include "stickslip/model/scene.hpp"

namespace stickslip {

// The option with the value the user gave, as it stands in messages.
std::string shown(const Options& options, const std::string& name);

// The user gave one of `names`, although `reason` says that it has no meaning in this scene.
void refuse(const Options& options, const std::vector<std::string>& names, const std::string& reason);

// Whether the law's parameter has a meaning beside the words that others have (Parameter::only_with).
bool has_meaning(const Parameter& parameter, const Options& options);

// The loads, of a scene of which all else has been read. Throws UsageError.
void read_loads(const Options& options, Scene& scene);

}  // namespace stickslip
