#include "study/simulate.hpp"

#include "base/log_stage.hpp"
#include "base/pulse.hpp"
#include "stickslip/study/trial.hpp"

namespace stickslip {

void simulate(Integrator& integrator, Vec u, const TimeSpan& span, const std::vector<Observer*>& observers,
              const Integrator::Observer& asked) {
  const LogStage stepping("time stepping");
  const auto after = [&](const Integrator::Step& step) {
    beat("steps");
    const double begin = span.watching ? processor_seconds() : 0;
    const ObservedStep seen{
        step.index,      step.t_before, step.t, step.u, span.rejections + integrator.report().rejections,
        step.interpolate};
    // what goes on here saw it as its end, and of a step that took no time nobody is to be told but `asked`
    const bool takes_no_time = step.t == step.t_before && step.index > 0;
    if (!takes_no_time)
      for (Observer* observer : observers) observer->step(seen);
    const auto verdict = asked ? asked(step) : Integrator::Verdict::go_on;
    if (span.watching) *span.watching += processor_seconds() - begin;
    return verdict;
  };
  integrator.advance(u, span.begin, span.end, after, span.most_steps);
}

}  // namespace stickslip
