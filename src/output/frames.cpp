#include "output/frames.hpp"

#include <algorithm>

#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

std::vector<double> frame_times(const Options& options) {
  const double t_end = options.real("ts_max_time");
  std::vector<double> times;
  if (options.is_set("out_times")) {
    times = options.reals("out_times");
    for (const double t : times)
      if (t < 0 || t > t_end)
        throw UsageError("out_times " + options.text("out_times") + ": " + number_text(t) +
                         " lies outside 0 to ts_max_time " + number_text(t_end));
  } else if (options.is_set("out_every")) {
    const double every = options.real("out_every");
    for (PetscInt i = 0; double(i) * every <= t_end * (1 + 1e-12); ++i)
      times.push_back(std::min(double(i) * every, t_end));
  } else {
    const PetscInt frames = options.integer("out_frames");
    for (PetscInt i = 0; i < frames; ++i)
      times.push_back(i == frames - 1 ? t_end : t_end * double(i) / double(frames - 1));
  }
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

}  // namespace

Frames::Frames(const Model& model, const Scene& whole, const Options& options, Gather& gather,
               const Displacement* displacement)
    : model_(model), state_(whole.friction.state), nodes_(static_cast<std::size_t>(whole.n)), gather_(gather),
      displacement_(displacement), work_(model.create_vector()), times_(frame_times(options)) {
  if (!displacement_) return;
  chi_ = displacement_->create_vector();
  gather_chi_ = std::make_unique<Gather>(chi_, 1);
}

void Frames::plan(ObservationPlan& plan) {
  times_.erase(std::remove_if(times_.begin(), times_.end(), [&](double t) { return t <= plan.after; }), times_.end());
  plan.times.insert(plan.times.end(), times_.begin(), times_.end());
  plan.layout.frames = static_cast<std::int64_t>(times_.size());
  if (displacement_) plan.layout.fields.push_back(standard_field("chi"));
}

void Frames::step(const ObservedStep& step) {
  for (; next_ < times_.size() && times_[next_] <= step.t; ++next_) {
    step.interpolate(times_[next_], work_);
    write(times_[next_]);
  }
}

void Frames::write(double t) {
  model_.set_held(work_);
  std::vector<std::vector<double>> fields = gather_.components(work_);
  if (fields.size() == 3)
    std::transform(fields[2].begin(), fields[2].end(), fields[2].begin(),
                   [&](double s) { return state_to_output(state_, s); });
  if (displacement_) {
    displacement_->solve(work_, t, chi_);
    fields.push_back(gather_chi_->components(chi_)[0]);
  }
  std::vector<const double*> rows;
  for (std::vector<double>& field : fields) {
    const std::size_t cell = field.size();  // one of several equal ones; nothing on the other ranks
    if (cell == 0) continue;
    field.resize(nodes_);
    for (std::size_t i = cell; i < field.size(); ++i) field[i] = field[i - cell];
    rows.push_back(field.data());
  }
  file_->frame(t, rows);
}

}  // namespace stickslip
