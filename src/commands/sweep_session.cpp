#include "commands/sweep_session.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <new>
#include <string>
#include <vector>

#include "base/json_values.hpp"
#include "base/process.hpp"
#include "base/pulse.hpp"
#include "output/table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/reader.hpp"
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
    const LibraryOptionsHeld held(base_, options);
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
  summary["warnings"] = warnings;
  outcome.row = flat_row(summary);
  return outcome;
}

namespace {

// NAME-000123.h5 for point 123 of NAME.h5.
std::string file_of(const std::string& path, long point) {
  const std::size_t dot = path.rfind('.'), slash = path.rfind('/');
  const bool has_end = dot != std::string::npos && (slash == std::string::npos || dot > slash + 1) && dot > 0;
  return fmt::format("{}-{:06}{}", path.substr(0, has_end ? dot : path.size()), point,
                     has_end ? path.substr(dot) : "");
}

// Where the ends of a followed line stand for a sweep that is killed, the latest and the one being computed
// in turn.
std::string end_of_line(const std::string& path, long unit, std::size_t turn) {
  return paths::hidden_sibling(path, fmt::format(".line-{}-{}", unit, turn % 2 ? "b" : "a"));
}

// What one rank meets alone, the others do not know.
template <class Body>
void by_myself(Body&& body) {
  try {
    body();
  } catch (const Failure& e) {
    throw RankFailure(e.what());
  }
}

Provenance provenance_of(const Options& sweep, const Options& base) {
  std::map<std::string, std::string> options = base.all();
  for (const auto& [name, text] : sweep.all()) options[name] = text;
  return Provenance::of("sweep", options);
}

}  // namespace

SweepSession::SweepSession(const Options& sweep, const Options& base, const SweepPlan& plan,
                           const Command& command)
    : sweep_(sweep), base_(base), plan_(plan), path_(sweep.text("out_file")),
      files_(sweep.boolean("sweep_files")), runner_(command, base), provenance_(provenance_of(sweep, base)),
      progress_(sweep.text("progress"), "sweep: "), rank_(rank_in(MPI_COMM_WORLD)) {}

std::string SweepSession::key() const {
  return sweep_.is_set("sweep_key") ? sweep_.text("sweep_key")
         : base_.command() == "run" ? "regime"
                                    : "stable";
}

std::string SweepSession::kind_of(long point) const {
  return table_.text(point, "status") == "failed" ? "failed" : table_.text(point, key());
}

long SweepSession::failed() const {
  return std::count_if(table_.points().begin(), table_.points().end(),
                       [this](long point) { return table_.text(point, "status") == "failed"; });
}

// ---- rows and the table

void SweepSession::read_rows() {
  std::vector<Known> rows;
  on_root(MPI_COMM_WORLD, [&] {
    read_journals(path_, table_);
    std::map<std::string, int> kinds;
    for (const long point : table_.points()) {
      const int kind = kinds.emplace(kind_of(point), int(kinds.size())).first->second;
      rows.push_back({point, kind, table_.text(point, "status") == "done"});
    }
  });
  broadcast(rows, MPI_COMM_WORLD);
  known_.clear();
  for (const Known& row : rows) known_.emplace(row.point, row);
}

void SweepSession::write_table(bool complete) {
  SweepLayout layout{
      plan_.is_grid(), plan_.follows(), {}, [this](long point) { return plan_.values(point); }};
  std::vector<long> points = table_.points();
  std::sort(points.begin(), points.end());
  for (std::size_t k = 0; k < plan_.axes().size(); ++k) {
    const SweepAxis& axis = plan_.axes()[k];
    layout.axes.push_back({axis.name(), axis.is_numeric(), {}});
    std::vector<std::string>& values = layout.axes.back().values;
    if (plan_.is_grid())
      for (long value = 0; value < axis.values(); ++value) values.push_back(axis.value(value));
    else
      for (const long point : points) values.push_back(plan_.values(point)[k]);
  }
  table_.write(
      path_, provenance_, layout,
      {{"given", text_of_map(sweep_.with("restart", "").given())}, {"key", key()}, {"of", base_.command()}},
      {{"points", double(plan_.is_refined() && complete ? table_.size() : plan_.points())},
       {"done", double(table_.size())},
       {"failed", double(failed())},
       {"complete", complete ? 1. : 0.}});
}

void SweepSession::note(long point, const Json& row) {
  if (journal_) by_myself([&] { journal_->note(point, row); });
}

// How far it is; and now and then the table as it stands, as long as that takes little of the time.
void SweepSession::look_at_clock(long taken, long units) {
  if (rank_ != 0) return;
  if (progress_.due()) {
    const double part = double(taken) / double(units);
    progress_.show(fmt::format("{} of {} {} ({:.0f} %){}", taken, units, plan_.follows() ? "lines" : "points",
                               100 * part, progress_.left(part)));
  }
  const double begin = MPI_Wtime();
  if (begin < next_table_) return;
  by_myself([this] {
    read_journals(path_, table_);
    write_table(false);
  });
  const double end = MPI_Wtime();
  next_table_ = end + std::max(20., 50 * (end - begin));
}

// ---- points

// `wholes`: the points of the same line before this one that have come to their end.
Options SweepSession::options_at(long point, const std::vector<long>& wholes) const {
  Options options = plan_.at(point);
  if (files_) options = options.with("out_file", file_of(path_, point));
  if (!plan_.follows()) return options;
  if (!files_)
    for (const char* output : {"out_every", "out_frames", "out_probes", "out_displacement"})
      options = options.with(output, "");
  if (wholes.empty()) return options;
  for (const char* start : {"init_frame", "init_eta", "init_state"}) options = options.with(start, "");
  return options.with("init_type", "file")
      .with("init_file", files_ ? file_of(path_, wholes.back()) : CarriedFrame::name);
}

void SweepSession::compute_unit(RankGroups& groups, long unit) {
  const bool carries = plan_.follows() && !files_;
  std::vector<long> wholes;
  std::optional<Frame> end;  // of the last of them
  for (const long point : plan_.unit(unit)) {
    if (const auto found = known_.find(point); found != known_.end()) {
      if (found->second.whole) wholes.push_back(point);
      continue;
    }
    if (plan_.follows() && groups.any(watch_.caught() != 0)) return;
    if (carries && !end && !wholes.empty()) end = load_frame(end_of_line(path_, unit, wholes.size() - 1));
    std::optional<CarriedFrame> carried;
    if (carries) carried.emplace(end);
    const PointRunner::Outcome outcome = runner_.run(options_at(point, wholes));
    if (outcome.code > 128) {
      stopped_by_ = outcome.code - 128;
      return;
    }
    const bool whole = outcome.row["status"] == "done";
    if (carries && whole && carried->end) {
      end = std::move(carried->end);
      save_frame(end_of_line(path_, unit, wholes.size()), *end);
    }
    note(point, outcome.row);
    if (outcome.alone) std::rethrow_exception(outcome.alone);
    if (whole) wholes.push_back(point);
  }
  if (carries && groups.leads())
    for (const std::size_t turn : {0, 1}) unlink(end_of_line(path_, unit, turn).c_str());
}

void SweepSession::compute(RankGroups& groups, const std::vector<long>& units) {
  groups.from_zero();
  const auto last = long(units.size());
  for (;;) {
    const long number = groups.take(watch_.caught() != 0);
    if (number < 0 || number >= last) break;
    look_at_clock(number, last);
    compute_unit(groups, units[number]);
  }
  stopped_by_ = std::max(stopped_by_, watch_.caught());
  MPI_Allreduce(MPI_IN_PLACE, &stopped_by_, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
}

void SweepSession::refine(RankGroups& groups) {
  ChangeSearch search = plan_.search();
  for (;;) {
    std::unordered_map<long, int> kinds;
    for (const auto& [point, row] : known_) kinds.emplace(point, row.kind);
    const std::vector<long> next = search.next(kinds);
    if (next.empty() || stopped_by_) return;
    std::vector<long> missing;
    for (const long point : next)
      if (!known_.count(point)) missing.push_back(point);
    compute(groups, missing);
    if (stopped_by_) return;
    read_rows();
  }
}

int SweepSession::run() {
  read_rows();
  on_root(MPI_COMM_WORLD, [this] { write_table(false); });
  next_table_ = MPI_Wtime() + 20;
  {
    RankGroups groups(sweep_.integer("sweep_group_ranks"));
    groups_ = groups.count();
    if (groups.leads()) by_myself([&] { journal_ = std::make_unique<SweepJournal>(path_, groups.index()); });
    if (plan_.is_refined()) {
      refine(groups);
    } else {
      std::vector<long> units;
      for (long unit = 0; unit < plan_.units(); ++unit) {
        const std::vector<long> points = plan_.unit(unit);
        const auto open = [this](long point) { return known_.count(point) == 0; };
        if (std::any_of(points.begin(), points.end(), open)) units.push_back(unit);
      }
      compute(groups, units);
    }
  }
  journal_.reset();
  MPI_Barrier(MPI_COMM_WORLD);
  read_rows();
  on_root(MPI_COMM_WORLD, [this] {
    write_table(stopped_by_ == 0);
    if (stopped_by_ == 0) remove_journals(path_);
  });
  return stopped_by_;
}

}  // namespace stickslip
