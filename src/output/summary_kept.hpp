// The summary of a command that is one of many.
#pragma once

#include "base/json.hpp"

namespace stickslip {

// While it lives, the summary of a command that ends goes to `into`, on every rank, and nothing is written or
// told. `into` is left alone where a command is refused (UsageError). Not collective.
class SummaryKept {
 public:
  explicit SummaryKept(Json& into);
  ~SummaryKept();
  SummaryKept(const SummaryKept&) = delete;
  SummaryKept& operator=(const SummaryKept&) = delete;

 private:
  Json* before_;
};

}  // namespace stickslip
