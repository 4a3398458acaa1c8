#include "output/catalogue.hpp"

#include <mpi.h>

#include "base/local_values.hpp"

namespace stickslip {

void Catalogue::plan(ObservationPlan& plan) {
  begin_ = MPI_Wtime();
  plan.layout.events = Events::columns();
}

void Catalogue::start(RunFile* file) { file_ = file; }

void Catalogue::step(const ObservedStep& step) {
  events_.step(step.t, Reading(step.u), model_.dof());
  for (const SlipEvent& event : events_.ended())
    if (file_) file_->row("events", event.end, events_.row(event));
}

void Catalogue::archive(Archive& a) {
  if (a.has("events.last")) events_.archive(a);
}

void Catalogue::summarise(Summary& summary, Vec) {
  summary.set("events", events_.count());
  summary.set("events_per_s", double(events_.count()) / (MPI_Wtime() - begin_));
}

}  // namespace stickslip
