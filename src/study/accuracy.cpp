#include "stickslip/study/accuracy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/time/methods.hpp"
#include "study/ladder.hpp"
#include "study/smoothness.hpp"

namespace stickslip {

struct AccuracyPlan::Impl {
  AccuracyRequest request;
  Setting setting;
  LevelRuns runs;
  std::unique_ptr<Ladder> ladder;
  Options chosen;
  std::string what, refusal;
  double seconds = 0;

  Impl(const Options& options, double wanted)
      : request(options, wanted), setting(checked(request)), runs(request, setting), chosen(options) {}

  // Finds what cannot be had before any work, and the start, as every run does.
  static Setting checked(const AccuracyRequest& request) {
    const Setting setting = request.setting();
    check_settings(request.options, {setting});
    return setting;
  }

  std::string out_of_reach(const OutOfReach& e) const {
    return fmt::format("accuracy {:.2g} is out of reach: {}", request.wanted, e.why);
  }

  void choose() {
    const double begin = largest_processor_seconds();
    runs.choose_method();
    ladder =
        request.has_space ? grid_ladder(request, setting, runs) : tolerance_ladder(request, setting, runs);
    try {
      ladder->choose();
    } catch (const OutOfReach& e) {
      refusal = out_of_reach(e);
      if (!ladder->confirm()) throw Failure(refusal);
    }
    seconds += largest_processor_seconds() - begin;
  }

  void finish();
};

AccuracyPlan::AccuracyPlan(const Options& options, double wanted)
    : impl_(std::make_unique<Impl>(options, wanted)) {
  warn_of_pieces(impl_->request.scene);
  impl_->choose();
  impl_->finish();
}
AccuracyPlan::~AccuracyPlan() = default;

const Options& AccuracyPlan::options() const { return impl_->chosen; }
const std::string& AccuracyPlan::what() const { return impl_->what; }
const std::string& AccuracyPlan::refusal() const { return impl_->refusal; }
const Setting& AccuracyPlan::setting() const { return impl_->setting; }
double AccuracyPlan::seconds() const { return impl_->seconds; }
int AccuracyPlan::trials() const { return impl_->runs.count(); }

MeasureMaker AccuracyPlan::measure() const { return impl_->request.of.measure(impl_->request.options); }

std::vector<double> AccuracyPlan::value(const Answer& end) const {
  const AccuracyRequest& request = impl_->request;
  if (request.of.kind != Quantity::Kind::probe) return end.measured;
  const Fields at = at_points(end.fields, Scene::from(impl_->chosen, false), request.probes);
  return {at.psi[0], at.eta[0]};
}

std::optional<JumpAtEnd> AccuracyPlan::jump() {
  const std::optional<Jump>& jump = impl_->runs.jump();
  if (!jump) return std::nullopt;
  const double begin = largest_processor_seconds();
  const Scene grid = Scene::from(impl_->chosen, false);
  const double t = impl_->runs.pilot().t_end();
  const Jump::Extent left_out = jump->extent(grid, t);
  const JumpAtEnd found{jump->x(t), jump->height(impl_->request.options, impl_->setting),
                        std::max(0., left_out.from), std::min(grid.length, left_out.to)};
  impl_->seconds += largest_processor_seconds() - begin;
  return found;
}

double AccuracyPlan::estimate(const Answer& end) {
  if (impl_->request.of.is_measured() && end.measured.empty())
    throw Failure(fmt::format("accuracy_of {}: the motion has no {} to measure",
                              impl_->request.options.text("accuracy_of"), impl_->request.of.name()));
  const double begin = largest_processor_seconds(), error = impl_->ladder->estimate(end);
  impl_->seconds += largest_processor_seconds() - begin;
  return error;
}

void AccuracyPlan::refine() {
  const double begin = largest_processor_seconds();
  try {
    impl_->ladder->refine();
  } catch (const OutOfReach& e) {
    throw Failure(impl_->out_of_reach(e));
  }
  impl_->seconds += largest_processor_seconds() - begin;
  impl_->finish();
}

// The options of the run, and the line that says them.
void AccuracyPlan::Impl::finish() {
  const Options& asked = request.options;
  chosen = request.has_space ? options_for(asked, setting) : asked;
  if (!setting.method.can().splits || setting.method.implicit != "auto")
    chosen = chosen.with("imex_implicit", setting.method.implicit);
  const auto set = [&](const std::string& name, const std::string& value) {
    if (!asked.is_set(name)) chosen = chosen.with(name, value);
  };
  set("ts_type", setting.method.type);
  if (const std::string sub = setting.method.can().subtype_option; !sub.empty())
    set(sub, setting.method.subtype);
  if (const double step = runs.pilot().longest_step(setting); step > 0)
    set("ts_adapt_dt_max", number_text(step));
  set("ts_rtol", number_text(setting.tolerance));
  set("ts_atol", "auto:" + number_text(setting.tolerance));
  what = setting.method.name();
  if (setting.method.can().splits) what += " (implicit: " + setting.method.implicit + ")";
  what += fmt::format(", tolerance {:.2g}", setting.tolerance);
  if (request.has_space) what += fmt::format(", order {}, n = {}", setting.order, setting.n);
  what += fmt::format("{}, after {} short runs", ladder->predicted(), runs.count());
  if (!runs.why().empty()) what += "; " + runs.why();
}

}  // namespace stickslip
