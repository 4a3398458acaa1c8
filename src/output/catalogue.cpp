#include "output/catalogue.hpp"

#include <mpi.h>

#include <utility>

namespace stickslip {

void Catalogue::plan(ObservationPlan& plan) {
  begin_ = MPI_Wtime();
  plan.layout.events = Events::columns();
}

void Catalogue::restore(const Checkpoint& checkpoint) {
  if (checkpoint.arrays.count("events.last")) events_.restore(checkpoint.arrays);
}

void Catalogue::start(RunFile* file) { file_ = file; }

void Catalogue::step(const ObservedStep& step) {
  const auto& fields = gather_.components(step.u);
  if (fields[0].empty()) return;  // rank 0 has the nodes
  events_.step(step.t, fields);
  for (const SlipEvent& event : events_.ended())
    if (file_) file_->event(event.end, events_.row(event));
}

void Catalogue::save(Checkpoint& checkpoint) {
  for (auto& [name, values] : events_.save()) checkpoint.arrays[name] = std::move(values);
}

void Catalogue::summarise(Summary& summary, Vec) {
  summary.set("events", events_.count());
  summary.set("events_per_s", double(events_.count()) / (MPI_Wtime() - begin_));
}

}  // namespace stickslip
