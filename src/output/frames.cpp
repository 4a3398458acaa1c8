#include "output/frames.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {
constexpr double largest_count = 9e15;  // below 2^53: the number of a frame is exact in a double
}  // namespace

FrameTimes::FrameTimes(const Options& options) : last_(options.real("ts_max_time")) {
  const char* name = options.is_set("out_times")   ? "out_times"
                     : options.is_set("out_every") ? "out_every"
                                                   : "out_frames";
  option_ = std::string(name) + " " + options.text(name);
  const double t_end = last_;
  if (options.is_set("out_times")) {
    list_ = options.reals("out_times");
    for (const double t : list_)
      if (t < 0 || t > t_end)
        throw UsageError(option_ + ": " + number_text(t) + " lies outside 0 to ts_max_time " +
                         number_text(t_end));
    std::sort(list_.begin(), list_.end());
    list_.erase(std::unique(list_.begin(), list_.end()), list_.end());
  } else if (options.is_set("out_every")) {
    every_ = options.real("out_every");
    count_ = std::floor(t_end * (1 + 1e-12) / every_) + 1;
    last_ = std::min((count_ - 1) * every_, t_end);
  } else {
    count_ = t_end > 0 ? double(options.integer("out_frames")) : 1;
  }
  if (!(count_ < largest_count)) throw UsageError(option_ + ": more frames than can be counted");
}

double FrameTimes::at(double i) const {
  return i >= count_ - 1 ? last_ : every_ > 0 ? i * every_ : last_ * i / (count_ - 1);
}

double FrameTimes::index_after(double t) const {
  const double apart = every_ > 0 ? every_ : last_ / std::max(1., count_ - 1);
  // one before what the division says, which may be rounded up
  double i = apart > 0 ? std::clamp(std::floor(t / apart) - 1, 0., count_) : 0;
  while (i < count_ && at(i) <= t) ++i;
  return i;
}

double FrameTimes::after(double t) const {
  const double none = std::numeric_limits<double>::infinity();
  if (!list_.empty()) {
    const auto next = std::upper_bound(list_.begin(), list_.end(), t);
    return next == list_.end() ? none : *next;
  }
  const double i = index_after(t);
  return i < count_ ? at(i) : none;
}

double FrameTimes::count_after(double t) const {
  return list_.empty() ? count_ - index_after(t)
                       : double(list_.end() - std::upper_bound(list_.begin(), list_.end(), t));
}

Frames::Frames(const Model& model, const Scene& whole, const Options& options,
               const Displacement* displacement, const Plate& plate)
    : model_(model), state_(whole.friction.state), most_bytes_(1e9 * options.real("out_limit")),
      nodes_(whole.n), displacement_(displacement), plate_(plate), work_(model.create_vector()),
      slab_(model, whole.n), times_(options) {
  if (displacement_) chi_ = displacement_->create_vector();
}

void Frames::plan(ObservationPlan& plan) {
  next_ = times_.after(plan.after);
  plan.next_times.push_back([this](double t) { return times_.after(t); });
  const double count = times_.count_after(plan.after);
  plan.layout.frames = static_cast<std::int64_t>(count);
  plan.layout.slab = slab_;
  if (displacement_) plan.layout.fields.push_back(standard_field("chi"));
  const double each = 8. * (1 + double(plan.layout.fields.size() * nodes_));
  if (count * each > most_bytes_)
    throw UsageError(times_.option() + ": " + number_text(count) + " frames of " + rounded_text(each) +
                     " bytes need " + rounded_text(count * each / 1e9) + " GB, more than out_limit, " +
                     rounded_text(most_bytes_ / 1e9) + " GB");
}

void Frames::step(const ObservedStep& step) {
  for (; next_ <= step.t; next_ = times_.after(next_)) {
    step.interpolate(next_, work_);
    write(next_);
  }
  if (halts(model_.scene()) && plate_.at(step.t) >= plate_.end && file_->last_time() < step.t) {
    SS_TRY(VecCopy(step.u, work_));
    write(step.t);
  }
}

void Frames::write(double t) {
  model_.set_time(t);
  model_.set_held(work_);
  const auto dof = std::size_t(model_.dof());
  rows_.resize(dof + (displacement_ ? 1 : 0));
  for (std::vector<double>& row : rows_) row.clear();
  {
    const Reading u(work_);
    for (std::size_t d = 0; d < dof; ++d) slab_.take(u + d, int(dof), rows_[d]);
  }
  if (dof == 3)
    std::transform(rows_[2].begin(), rows_[2].end(), rows_[2].begin(),
                   [&](double s) { return state_to_output(state_, s); });
  if (const double push = model_.scene().push(t); push != 0)
    for (double& eta : rows_[1]) eta -= push;
  if (displacement_) {
    displacement_->solve(work_, t, chi_);
    slab_.take(Reading(chi_), 1, rows_[dof]);
  }
  std::vector<const double*> fields;
  for (const std::vector<double>& row : rows_) fields.push_back(row.data());
  file_->frame(t, fields);
}

}  // namespace stickslip
