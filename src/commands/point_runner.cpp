#include "commands/point_runner.hpp"

#include <new>
#include <string>
#include <vector>

#include "base/broadcast.hpp"
#include "base/json_values.hpp"
#include "base/pulse.hpp"
#include "output/summary_kept.hpp"
#include "output/sweep_table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/study/size.hpp"

namespace stickslip {

PointRunner::Outcome PointRunner::run(const Options& options) const {
  Json summary;
  std::vector<std::string> warnings;
  Outcome outcome;
  std::string reason;
  bool together = true;
  try {
    const WarningsKept quiet(warnings);
    const SummaryKept kept(summary);
    replace_library_options(base_, options);
    if (command_.has_grid) check_size(options, PETSC_COMM_WORLD);
    outcome.code = command_.body(options);
  } catch (const Interrupted& e) {
    outcome.code = e.exit_code();
  } catch (const Error& e) {
    reason = e.what();
    together = e.collective();
  } catch (const std::bad_alloc&) {
    reason = "out of memory";
    together = false;
  } catch (const std::exception& e) {
    reason = std::string("internal error: ") + e.what();
    together = false;
  }
  if (!reason.empty()) {
    if (!together && ranks_in(PETSC_COMM_WORLD) > 1)
      outcome.alone = std::make_exception_ptr(RankFailure(reason));
    if (!summary.is_object()) summary = Json::object();
    summary["status"] = "failed";
    summary["reason"] = one_line(reason);
  }
  replace_library_options(options, base_);
  summary["warnings"] = warnings;
  outcome.row = flat_row(summary);
  return outcome;
}

}  // namespace stickslip
