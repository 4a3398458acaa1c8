// What a run measures for its summary and needs nothing but its model for.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

// A list of observers, each made from a model, with the keys that it sets: T(const Model&), static T::keys().
template <class... T>
struct ObserverTypes {
  static std::vector<SummaryKey> keys() {
    std::vector<SummaryKey> all;
    for (const auto& own : {T::keys()...}) all.insert(all.end(), own.begin(), own.end());
    return all;
  }
  static std::vector<std::unique_ptr<Observer>> make(const Model& model) {
    std::vector<std::unique_ptr<Observer>> all;
    (all.push_back(std::make_unique<T>(model)), ...);
    return all;
  }
};

const std::vector<OwnObserver>& own_observers();  // that a program of one's own has registered

std::vector<SummaryKey> quantity_keys();
std::vector<std::unique_ptr<Observer>> make_quantities(const Model& model);

}  // namespace stickslip
