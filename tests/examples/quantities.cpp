#include "commands/quantities.hpp"

#include "fastest.hpp"
#include "output/series.hpp"

namespace stickslip {

using Quantities = ObserverTypes<EndStatistics, LoadedMean, Fastest>;

std::vector<SummaryKey> quantity_keys() { return Quantities::keys(); }
std::vector<std::unique_ptr<Observer>> make_quantities(const Model& model) { return Quantities::make(model); }

}  // namespace stickslip
