#include "stickslip/output/summary.hpp"

#include <fcntl.h>
#include <petscsys.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <set>
#include <stdexcept>
#include <utility>

#include "base/json_values.hpp"
#include "base/process.hpp"
#include "base/pulse.hpp"
#include "output/table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

namespace {
Json* kept = nullptr;  // of the innermost SummaryKept
}  // namespace

struct Summary::Object {
  Json json;
  double begin = MPI_Wtime();

  double seconds() const { return MPI_Wtime() - begin; }
  Json now() const {  // with warnings and seconds up to now
    Json now = json;
    now["warnings"] = warnings();
    now["wall_s"] = seconds();
    Json options = now["options"];  // longer than all else: results stand before them
    now.erase("options");
    now["options"] = std::move(options);
    return now;
  }
};

SummaryKept::SummaryKept(Json& into) : before_(std::exchange(kept, &into)) {}
SummaryKept::~SummaryKept() { kept = before_; }

std::vector<SummaryKey> common_quantities() {
  return {
      {"command", "", "the command"},
      {"status", "", "`done`; `stopped`: by `ts_max_steps`, `ts_max_wall` or a signal; `failed`"},
      {"reason", "", "why it stopped or failed"},
      {"warnings", "", "the lines of warning, in order"},
      {"version", "", "of the program"},
      {"git", "", "revision of the program"},
      {"options", "", "every option that counts, as text, defaults included; a number with all its digits"},
      {"model_form", "", "`continuum` or `chain`"},
      {"delta_sign", "",
       "`derived` or `printed` ([Theory](theory.md)); null for the chain, which has no delta"},
      {"units", "",
       "what the options `units_length`, `units_time`, `units_force` say: `length`, `time`, `force`"},
      {"labels", "", "what the option `labels` says: of options their names in words"},
      {"ranks", "1", "processes"},
      {"wall_s", "s", "seconds on the wall clock"},
      {"files", "", "what was written"}};
}

Summary::Summary(const Provenance& provenance, const std::vector<SummaryKey>& keys, std::string path)
    : object_(std::make_unique<Object>()), path_(std::move(path)), out_file_(provenance.option("out_file")),
      silent_(provenance.option("progress") == "off") {
  if (!path_.empty()) check_summary_path(path_);
  const std::string form = provenance.option("model_form"), sign = provenance.option("model_delta_sign");
  Json& object = object_->json;
  for (const SummaryKey& common : common_quantities()) object[common.name] = nullptr;
  object["command"] = provenance.command;
  object["version"] = version();
  object["git"] = git_revision();
  object["options"] = provenance.options;
  if (!form.empty()) object["model_form"] = form;
  // the chain has no delta, so no sign of it either
  if (!sign.empty() && form != "chain") object["delta_sign"] = sign;
  for (const auto& [what, unit] : {std::pair("length", names().length), std::pair("time", names().time),
                                   std::pair("force", names().force)})
    if (!unit.empty()) object["units"][what] = unit;
  if (!names().labels.empty()) object["labels"] = names().labels;
  object["ranks"] = provenance.ranks;
  object["files"] = Json::array();
  for (const SummaryKey& key : keys) object[key.name] = nullptr;
}

Summary::~Summary() = default;

template <class T>
void Summary::set(const std::string& key, const T& value) {
  Json& object = object_->json;
  if (!object.contains(key)) throw std::logic_error("summary: no key '" + key + "' for this command");
  object[key] = value;
}
void Summary::set(const std::string& key, const char* text) { set(key, Json(text)); }

template void Summary::set(const std::string& key, const Json& value);
template void Summary::set(const std::string& key, const bool& value);
template void Summary::set(const std::string& key, const int& value);
template void Summary::set(const std::string& key, const long& value);
template void Summary::set(const std::string& key, const std::size_t& value);
template void Summary::set(const std::string& key, const double& value);
template void Summary::set(const std::string& key, const std::string& value);
template void Summary::set(const std::string& key, const std::vector<double>& value);
template void Summary::set(const std::string& key, const std::vector<std::string>& value);
template void Summary::set(const std::string& key, const std::optional<bool>& value);
template void Summary::set(const std::string& key, const std::optional<int>& value);
template void Summary::set(const std::string& key, const std::optional<double>& value);
template void Summary::set(const std::string& key, const std::optional<std::string>& value);

template <class Value>
const Value& Summary::get(const std::string& key) const {
  const auto found = object_->json.find(key);
  if (found == object_->json.end()) throw std::logic_error("summary: no key '" + key + "' for this command");
  return *found;
}
template const Json& Summary::get(const std::string& key) const;

bool Summary::is_null(const std::string& key) const { return get<Json>(key).is_null(); }

void Summary::done() {
  set("status", "done");
  wrote(out_file_);
}

void Summary::failed(const std::string& reason) {
  set("status", "failed");
  set("reason", reason);
}

void Summary::stopped(const std::string& reason) {
  set("status", "stopped");
  set("reason", reason);
}

void Summary::wrote(const std::string& path) {
  Json& files = object_->json["files"];
  if (!path.empty() && std::find(files.begin(), files.end(), path) == files.end()) files.push_back(path);
}

void Summary::say(const std::string& line) { lines_.push_back(line); }

// The units of length, time and velocity that stand in brackets in `text`, "km/h" of "Speed (km/h)", and are
// none of the scene's; nothing where the scene says none.
static std::vector<std::string> foreign_units(const std::string& text) {
  static const std::set<std::string> lengths = {"nm", "um", "mm", "cm", "m", "km", "in", "ft", "mi"},
                                     times = {"ns", "us", "ms", "s", "min", "h", "d", "yr"};
  std::vector<std::string> found;
  if (names().length.empty() || names().time.empty()) return found;
  for (std::size_t at = 0; (at = text.find_first_of("([", at)) != std::string::npos; ++at) {
    const std::size_t end = std::min(text.size(), text.find_first_of(")]", at));
    std::string unit = text.substr(at + 1, end - at - 1);
    for (const char* micro : {"\xc2\xb5", "\xce\xbc"})  // the sign and the letter
      if (unit.compare(0, 2, micro) == 0) unit.replace(0, 2, "u");
    const std::vector<std::string> parts = split(unit, '/');
    const bool is_length = lengths.count(parts[0]) > 0, is_time = times.count(parts[0]) > 0;
    const std::string own = parts.size() == 1 && is_length ? names().length
                            : parts.size() == 1 && is_time ? names().time
                            : parts.size() == 2 && is_length && times.count(parts[1]) > 0
                                ? unit_of("velocity")
                                : unit;
    if (unit != own) found.push_back(unit);
  }
  return found;
}

void Summary::tell() const {
  int rank = 0;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  if (silent_ || kept || rank != 0) return;
  std::string last = rounded_text(object_->seconds()) + " s";
  const Json &sign = get<Json>("delta_sign"), &options = get<Json>("options");
  if (sign == "printed" && options.value("model_delta", "") != "0") last += "; sign of delta: printed";
  bool drawn = false;
  const char* before = "; wrote ";
  for (const Json& file : get<Json>("files")) {
    last += std::exchange(before, ", ") + file.get<std::string>();
    drawn = drawn || file == out_file_;
  }
  if (!path_.empty() && path_ != "-") last += "; summary " + path_;
  if (drawn)
    last += "; to see it: " + script_call("plot") + " " + out_file_;
  else if (path_.empty() && out_file_.empty())
    last += "; nothing is kept without -out_file FILE.h5 or -summary FILE.json";
  std::string text;
  for (const std::vector<std::string>* const lines : {&readings(), &lines_})
    for (const std::string& line : *lines) text += "stickslip: " + one_line(line) + "\n";
  for (const std::string& line : readings())
    if (const std::vector<std::string> units = foreign_units(line); !units.empty())
      text += "stickslip: " + joined(units) + " of the header is no unit of the scene (" +
              joined({names().length, names().time, unit_of("velocity")}) +
              "): numbers are taken as they are\n";
  std::fputs((text + "stickslip: " + one_line(last) + "\n").c_str(), stderr);
}

std::string Summary::text() const { return json_text(object_->now()) + "\n"; }

void Summary::write() const {
  if (kept) *kept = object_->now();
  if (kept || path_.empty()) return;
  on_root(PETSC_COMM_WORLD, [&] { write_from_here(); });
}

void Summary::write_alone() const noexcept {
  try {
    if (kept) *kept = object_->now();
    if (kept) return;
    int rank = 0;
    MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
    // standard output carries one summary at most, that of rank 0
    if (!path_.empty() && (rank == 0 || path_ != "-")) write_from_here();
  } catch (...) {
    // the failure that brought us here is the one to report
  }
}

void Summary::write_from_here() const {
  const std::string json = text();
  try {
    if (path_ == "-") return paths::write_all(STDOUT_FILENO, json.data(), json.size());
    struct stat at {};
    if (stat(path_.c_str(), &at) == 0 && !S_ISREG(at.st_mode))
      return paths::write_all(paths::Descriptor(path_, O_WRONLY), json.data(), json.size());
  } catch (const Failure& e) {
    throw Failure("cannot write the summary to '" + (path_ == "-" ? "standard output" : path_) +
                  "': " + e.what());
  }
  try {
    paths::replace_file(paths::resolved(path_), json, "." + std::to_string(getpid()) + ".tmp");
  } catch (const Failure& e) {
    throw Failure("cannot write the summary to '" + path_ + "': " + e.what());
  }
}

void check_summary_path(const std::string& path) {
  on_root(PETSC_COMM_WORLD, [&] {
    if (path == "-") return;
    if (paths::check_writable("summary", path) != paths::Present::regular) return;
    std::ifstream old(path);
    char first = 0;
    if (old >> first && first != '{')
      throw UsageError("summary '" + path +
                       "': exists and is not a JSON summary; it will not be overwritten");
  });
}

int detail::summarise_exception(Summary& summary) noexcept {
  bool together = false;
  try {
    try {
      throw;
    } catch (const Interrupted& e) {
      summary.stopped(e.what());
      summary.say(std::string("stopped by ") + e.what() +
                  (ended_during().empty() ? "" : ": " + ended_during()) +
                  "; the summary has what was found until then");
      int ranks = 1;
      MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
      if (ranks > 1) {  // which are elsewhere: the first speaks, and all are ended
        summary.write_alone();
        summary.tell();
        return 0;
      }
      summary.write();
      summary.tell();
      return e.exit_code();
    } catch (const Error& e) {
      if (e.exit_code() == 2) return 0;  // wrong use: nothing was computed, nothing is summarised
      summary.failed(e.what());
      together = e.collective();
    } catch (const std::exception& e) {
      summary.failed(e.what());
    } catch (...) {
      summary.failed("unknown error");
    }
    if (together)
      summary.write();
    else
      summary.write_alone();
  } catch (...) {
    // main() reports the first error, not that of its summary
  }
  return 0;
}

}  // namespace stickslip
