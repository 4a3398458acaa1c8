// The command `sweep`: any other command at many values of its options, in one process, on groups of ranks.
#include <algorithm>
#include <limits>
#include <optional>

#include "base/broadcast.hpp"
#include "commands/sweep_session.hpp"
#include "commands/table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/commands/commands.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

namespace {

const Command& command_of(const Options& sweep) {
  const std::string name = sweep.text("sweep_command");
  std::vector<std::string> names;
  for (const std::string& one : command_names())
    if (one != "sweep") names.push_back(one);
  if (std::find(names.begin(), names.end(), name) == names.end())
    throw UsageError("-sweep_command " + quoted(name) + ": must be one of " + joined(names) +
                     suggestion(name, names));
  return command_named(name);
}

// The options of the command at every point: what it would write is the sweep's own affair.
Options base_of(const Options& sweep) {
  Options base = sweep.for_command(sweep.text("sweep_command"));
  const bool files = sweep.boolean("sweep_files");
  for (const char* name : {"summary", "out_file", "restart", "check"}) base = base.with(name, "");
  if (!files) base = base.with("out_checkpoint_every", "");  // checkpoints stand beside files
  return base.with("progress", "off");
}

void check_wishes(const Options& sweep) {
  if (!sweep.is_set("out_file")) throw UsageError("sweep: needs out_file, the HDF5 file of its table");
  RankGroups::check(sweep.integer("sweep_group_ranks"));
  if (sweep.boolean("check")) throw UsageError("check: not of a sweep");
  const bool run = sweep.text("sweep_command") == "run", follow = sweep.boolean("sweep_follow");
  if (follow && !run)
    throw UsageError("sweep_follow: of `run` only; " + sweep.text("sweep_command") +
                     " has no end to start from");
  if (follow && sweep.boolean("sweep_files") && (sweep.is_set("out_every") || sweep.is_set("out_times")))
    throw UsageError("sweep_follow with sweep_files: the last frame must be the end, so give out_frames");
}

// Refuses the sweep where no point could be computed, and lets it be where some can.
void check_scenes(const SweepPlan& plan, const Options& base) {
  constexpr long most = 1000;  // there may be more points than anyone could build
  if (base.command() == "laws") return;
  const bool slides = base.command() != "run" && base.command() != "chart";
  std::optional<UsageError> first;
  for (long point = 0; point < std::min(most, plan.points()); ++point) {
    try {
      (void)Scene::from(plan.at(point), slides);
      return;
    } catch (const UsageError& e) {
      if (!first) first = e;
    }
  }
  throw UsageError(*first);
}

// Where sweep_key changes along the only option.
Json changes_of(const SweepSession& session, const SweepPlan& plan) {
  if (plan.axes().size() != 1 || plan.follows() || !(plan.is_grid() || plan.is_refined()) ||
      !plan.axes()[0].is_numeric())
    return nullptr;
  std::vector<long> points = session.table().points();
  std::sort(points.begin(), points.end());
  Json changes = Json::array();
  for (std::size_t k = 1; k < points.size(); ++k) {
    const std::string before = session.kind_of(points[k - 1]), after = session.kind_of(points[k]);
    if (before == after) continue;
    changes.push_back(Json::object({{"value", std::stod(plan.values(points[k - 1])[0])},
                                    {"next_value", std::stod(plan.values(points[k])[0])},
                                    {"from", before},
                                    {"to", after}}));
  }
  return changes;
}

// At how many values of the options the two directions end in different kinds of motion.
Json differing(const SweepSession& session, const SweepPlan& plan) {
  if (!plan.follows()) return nullptr;
  long count = 0;
  for (const long point : session.table().points())
    if (point % 2 == 0 && session.table().has(point + 1))
      count += session.kind_of(point) != session.kind_of(point + 1);
  return count;
}

void say_all(Summary& summary, const std::string& path) {
  const Json &differ = summary.get("differing"), &saved = summary.get("saved");
  std::string text = summary.get("done").dump() + " of " + summary.get("points").dump() + " points";
  if (summary.get("failed") != 0)
    text += ", " + summary.get("failed").dump() + " of them failed (variable reason), the first: " +
            summary.get("first_failure").get<std::string>();
  if (!saved.is_null() && summary.is_null("stopped_at"))
    text += "; a full grid has " + saved.dump() + " more";
  if (!differ.is_null()) text += "; up and down differ at " + differ.dump();
  summary.say(text);
  if (summary.get("status") == "stopped") summary.say("to go on: stickslip sweep -restart " + path);
}

// What all ranks are told of the result.
void report(Summary& summary, const SweepSession& session, const SweepPlan& plan, const std::string& path,
            int signal) {
  std::string packed;
  if (rank_in(MPI_COMM_WORLD) == 0) {
    const SweepTable& table = session.table();
    const long failed = session.failed();
    long first = std::numeric_limits<long>::max();
    for (const long point : table.points())
      if (table.text(point, "status") == "failed") first = std::min(first, point);
    Json found = Json::object();
    found["points"] = plan.is_refined() && !signal ? table.size() : plan.points();
    found["done"] = table.size();
    found["failed"] = failed;
    found["first_failure"] = failed ? Json(table.text(first, "reason")) : Json();
    found["full_grid"] = plan.is_refined() ? Json(plan.points()) : Json();
    found["saved"] = plan.is_refined() ? Json(plan.points() - table.size()) : Json();
    found["changes"] = changes_of(session, plan);
    found["differing"] = differing(session, plan);
    packed = json_text(found, 0);
  }
  broadcast(packed, MPI_COMM_WORLD);
  const Json found = Json::parse(packed);
  for (const auto& [key, value] : found.items()) summary.set(key, value);
  summary.set("groups", session.groups());
  summary.wrote(path);
  summary.wrote(csv_beside(path));
  if (signal) {
    const std::string why = signal == SIGINT ? "SIGINT" : "SIGTERM";
    summary.stopped(why);
    summary.set("stopped_at", why);
  }
  say_all(summary, path);
  if (!signal && found["done"] == found["failed"])
    throw Failure("sweep: no point could be computed; the first: " +
                  found["first_failure"].get<std::string>());
}

// The options to go on with, which the table of `restart` holds.
Options resumed(const Options& asked, const SweepHeader& header) {
  const std::string path = asked.text("restart");
  if (asked.is_set("out_file") && asked.text("out_file") != path)
    throw UsageError("out_file '" + asked.text("out_file") + "': a sweep goes on in its own table, '" + path +
                     "'");
  if (header.git != git_revision())
    warn("restart '" + path + "': was written by revision " + header.git + " of this program, and this is " +
         git_revision() + "; the last digits of further points may differ");
  const Options options = asked.resumed_from(header.given).with("out_file", path);
  insert_library_options(options);
  return options;
}

// The rows that the table spoke of must be there, or their points would be computed again.
void check_journals(const std::string& path, const SweepHeader& header) {
  on_root(MPI_COMM_WORLD, [&] {
    SweepTable rows;
    read_journals(path, rows);
    if (rows.size() < header.done)
      throw UsageError("restart '" + path + "': the rows of " + std::to_string(header.done - rows.size()) +
                       " points are missing; its files .points-0, ... must stand beside it");
  });
}

}  // namespace

int sweep_command(const Options& asked) {
  std::optional<SweepHeader> header;
  if (asked.is_set("restart")) header = read_sweep_header(asked.text("restart"));
  const Options sweep = header ? resumed(asked, *header) : asked;
  check_wishes(sweep);
  const Command& command = command_of(sweep);
  const Options base = base_of(sweep);
  const SweepPlan plan(sweep, base);
  const std::string path = sweep.text("out_file");
  check_scenes(plan, base);
  const OutputLock lock = check_outputs(path, sweep.text("summary"));
  check_csv(path);
  Summary summary(Provenance::of("sweep", sweep.all()),
                  {"points", "done", "failed", "first_failure", "groups", "full_grid", "saved", "changes",
                   "differing", "stopped_at"},
                  sweep.text("summary"));
  return with_summary(summary, [&] {
    if (header && header->complete) {
      warn("restart '" + path + "': this sweep is whole; nothing is left to do");
      on_root(MPI_COMM_WORLD, [&path] { remove_journals(path); });  // it may have been killed before it did
      summary.set("points", header->points);
      summary.set("done", header->done);
      summary.set("failed", header->failed);
      return 0;
    }
    if (header)
      check_journals(path, *header);
    else
      on_root(MPI_COMM_WORLD, [&path] { remove_journals(path); });
    SweepSession session(sweep, base, plan, command);
    const int signal = session.run();
    report(summary, session, plan, path, signal);
    return signal ? 128 + signal : 0;
  });
}

}  // namespace stickslip
