// What -accuracy is wanted of (-accuracy_of).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/output/measure.hpp"

namespace stickslip {

struct Quantity {
  enum class Kind { fields, probe, speed, period, amplitude };
  Kind kind = Kind::fields;
  double x = 0;  // of the probe

  // Throws UsageError where it is none of these.
  static Quantity from(const Options& options);

  // Numbers, of which errors may pass through zero from one level of a ladder to the next; not the largest
  // over a field.
  bool is_number() const { return kind != Kind::fields; }
  // Seen on the way, not read from the end.
  bool is_measured() const { return kind != Kind::fields && kind != Kind::probe; }
  // Where fields are interpolated at the end.
  std::vector<double> places(const Options& options) const;
  // Makes what measures it; nullptr where it is read from the end.
  MeasureMaker measure(const Options& options) const;
  std::string name() const;  // for messages
};

}  // namespace stickslip
