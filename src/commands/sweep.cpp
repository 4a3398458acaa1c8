// The command `sweep`: any other command at many values of its options, in one process, on groups of ranks.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <optional>

#include "base/process.hpp"
#include "commands/command.hpp"
#include "commands/sweep_session.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/library_options.hpp"

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

// How often each value of sweep_key is met, unless there are many of them, as of a number.
Json kinds_of(const SweepSession& session) {
  constexpr std::size_t many = 8;
  std::map<std::string, long> counts;
  for (const long point : session.table().points()) ++counts[session.kind_of(point)];
  if (counts.empty() || counts.size() > many) return nullptr;
  Json kinds = Json::array();
  for (const auto& [kind, count] : counts) kinds.push_back(Json::object({{"kind", kind}, {"count", count}}));
  return kinds;
}

// "regime stick-slip from 0.2 to 0.8, sliding from 1 to 1.2 of model_v", along the only option; else how many
// points there are of each kind.
Json result_of(const SweepSession& session, const SweepPlan& plan) {
  const Json kinds = kinds_of(session), changes = changes_of(session, plan);
  if (kinds.is_null()) return nullptr;
  const std::string key = session.key();
  const auto word = [&](const std::string& kind) {
    return key == "stable" && (kind == "0" || kind == "1") ? kind == "0" ? "no" : "yes" : kind;
  };
  std::vector<std::string> parts;
  if (changes.is_null()) {
    for (const Json& k : kinds)
      parts.push_back(word(k["kind"].get<std::string>()) + " at " + k["count"].dump() +
                      (k["count"] == 1 ? " point" : " points"));
    return key + ": " + joined(parts);
  }
  std::vector<long> points = session.table().points();
  std::sort(points.begin(), points.end());
  const std::string name = plan.axes()[0].name();
  const auto value = [&](long point) { return rounded_text(std::stod(plan.values(point)[0]), 6); };
  for (std::size_t first = 0, k = 1; k <= points.size(); ++k) {
    const std::string kind = session.kind_of(points[first]);
    if (k < points.size() && session.kind_of(points[k]) == kind) continue;
    parts.push_back(word(kind) + (k - first == 1
                                      ? " at " + value(points[first])
                                      : " from " + value(points[first]) + " to " + value(points[k - 1])));
    first = k;
  }
  const OptionSpec* spec = find_option(name);
  return key + " over " + called(name) + ": " + in_unit(joined(parts), spec ? spec->unit : "", name);
}

struct SweepResults {
  const SweepSession& session;
  const SweepPlan& plan;
  int signal;

  long done() const { return session.table().size(); }
  // the reason of the first point that failed
  Json first_failure() const {
    const SweepTable& table = session.table();
    long first = std::numeric_limits<long>::max();
    for (const long point : table.points())
      if (table.text(point, "status") == "failed") first = std::min(first, point);
    return session.failed() ? Json(table.text(first, "reason")) : Json();
  }
};

Columns<SweepResults> keys() {
  using S = const SweepResults&;
  return {{"points", "1", "of the sweep",
           [](S s) { return s.plan.is_refined() && !s.signal ? s.done() : s.plan.points(); }},
          {"done", "1", "of them in the table", &SweepResults::done},
          {"failed", "1", "of those, without a result", [](S s) { return s.session.failed(); }},
          {"first_failure", "", "the reason of the first that failed", &SweepResults::first_failure},
          {"groups", "1", "of ranks", [](S s) { return s.session.groups(); }},
          {"full_grid", "1", "with `-sweep_refine`: points of the full grid",
           [](S s) { return s.plan.is_refined() ? Json(s.plan.points()) : Json(); }},
          {"saved", "1", "how many of them were not needed",
           [](S s) { return s.plan.is_refined() ? Json(s.plan.points() - s.done()) : Json(); }},
          {"changes", "",
           "of a grid of one option: between which neighbours, `value` and `next_value`, `sweep_key` "
           "changes, `from` what "
           "`to` what",
           [](S s) { return changes_of(s.session, s.plan); }},
          {"differing", "1",
           "with `-sweep_follow`: values of the options at which `sweep_key` differs between up and down",
           [](S s) { return differing(s.session, s.plan); }},
          {"kinds", "",
           "the values of `sweep_key` that were met, `kind`, each with the `count` of its points, `failed` "
           "among them; null where they are many",
           [](S s) { return kinds_of(s.session); }},
          {"result", "", "what the points say together, in words",
           [](S s) { return result_of(s.session, s.plan); }},
          {"stopped_at", "", "the signal that ended it", [](S s) {
             return s.signal == 0 ? "" : s.signal == SIGINT ? "SIGINT" : "SIGTERM";
           }}};
}

void say_all(Summary& summary, const std::string& path) {
  const auto text = [&](const char* key) { return summary.get<Json>(key).dump(); };
  summary.say(
      fmt::format("{} of {} points{}{}{}", text("done"), text("points"),
                  summary.get<Json>("failed") == 0
                      ? ""
                      : fmt::format(", {} of them failed (variable reason), the first: {}", text("failed"),
                                    summary.get<Json>("first_failure").get<std::string>()),
                  summary.is_null("saved") || !summary.is_null("stopped_at")
                      ? ""
                      : fmt::format("; a full grid has {} more", text("saved")),
                  summary.is_null("differing") ? "" : "; up and down differ at " + text("differing")));
  if (!summary.is_null("result")) summary.say(summary.get<Json>("result").get<std::string>());
  if (summary.get<Json>("status") == "stopped")
    summary.say("to go on: stickslip sweep -restart " + shell_word(path));
}

// Puts the result, which rank 0 has, into every rank's summary.
void report(Summary& summary, const SweepResults& results, const std::string& path) {
  std::string packed;
  if (rank_in(MPI_COMM_WORLD) == 0) packed = json_text(json_of(keys(), results), 0);
  broadcast(packed, MPI_COMM_WORLD);
  const Json found = Json::parse(packed);
  for (const auto& [key, value] : found.items()) summary.set(key, value);
  summary.wrote(path);
  summary.wrote(csv_beside(path));
  if (results.signal) summary.stopped(found["stopped_at"].get<std::string>());
  say_all(summary, path);
  if (!results.signal && found["done"] == found["failed"])
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

std::vector<TableText> tables() { return {keys()}; }

int sweep(const Options& asked) {
  std::optional<SweepHeader> header;
  if (asked.is_set("restart")) header = read_sweep_header(asked.text("restart"));
  const Options sweep = header ? resumed(asked, *header) : asked;
  check_wishes(sweep);
  const Command& command = command_of(sweep);
  const Options base = base_of(sweep);
  const SweepPlan plan(sweep, base);
  const std::string path = sweep.text("out_file");
  check_scenes(plan, base);
  check_csv(path);
  CommandRun run("sweep", sweep, keys_of(keys()));
  Summary& summary = run.summary;
  return run.carry_out([&] {
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
    report(summary, {session, plan, signal}, path);
    return signal ? 128 + signal : 0;
  });
}

}  // namespace

Command sweep_command() {
  return {"sweep", "any command over a grid, list or sample of options, on groups of ranks", sweep, false,
          tables};
}

}  // namespace stickslip
