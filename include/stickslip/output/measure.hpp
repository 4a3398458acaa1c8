// An observer whose result is numbers: what -accuracy_of asks for.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class Measure : public Observer {
 public:
  // What was measured so far, the same on every rank; empty where the motion has none. Collective.
  virtual std::vector<double> values() const = 0;
};

// Makes one for a model, which may be one of several equal cells of the scene `whole`; it lives no longer
// than the model.
using MeasureMaker = std::function<std::unique_ptr<Measure>(const Model& model, const Scene& whole)>;

}  // namespace stickslip
