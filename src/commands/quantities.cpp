#include "commands/quantities.hpp"

#include "output/series.hpp"

namespace stickslip {

// A new quantity is included above and named here.
using Quantities = ObserverTypes<EndStatistics, LoadedMean>;

std::vector<SummaryKey> quantity_keys() { return Quantities::keys(); }
std::vector<std::unique_ptr<Observer>> make_quantities(const Model& model) { return Quantities::make(model); }

}  // namespace stickslip
