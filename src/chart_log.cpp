#include "chart_log.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <utility>

#include "share.hpp"
#include "stickslip/error.hpp"
#include "stickslip/json.hpp"

namespace stickslip {

namespace {

std::string log_path(const std::string& out_file) {
  if (out_file.empty()) return "";
  const auto dot = out_file.rfind('.');
  const bool has_ending = dot != std::string::npos && dot > 0 && out_file.find('/', dot) == std::string::npos;
  return out_file.substr(0, has_ending ? dot : std::string::npos) + ".rows.jsonl";
}

}  // namespace

ChartLog::ChartLog(const Options& options, const Provenance& provenance) : path_(log_path(options.text("out_file"))) {
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank_);
  if (path_.empty()) return;
  Texts identity = options.given();
  for (const char* name : {"out_file", "summary", "progress"}) identity.erase(name);
  identity["git"] = git_revision();
  identity["ranks"] = std::to_string(provenance.ranks);
  std::string differs;
  if (rank_ == 0) read(identity, differs);
  share(differs);
  if (!differs.empty())
    warn("'" + path_ + "' holds the rows of another chart (" + differs + "); this one begins anew");
  std::int64_t count = std::int64_t(lines_.size());
  share(count);
  lines_.resize(std::size_t(count));
  for (Texts& line : lines_) share(line);
  if (rank_ != 0) return;
  // written anew, so that nothing follows a torn line
  file_ = std::fopen(path_.c_str(), "w");
  write(identity);
  for (const Texts& line : lines_) write(line);
}

ChartLog::~ChartLog() {
  if (file_) std::fclose(file_);
}

void ChartLog::add(const Texts& line) {
  if (!path_.empty() && rank_ == 0) write(line);
  int failed = failed_;
  share(failed);
  if (failed) throw Failure("cannot write '" + path_ + "', the rows of the chart so far");
}

void ChartLog::remove() {
  if (file_) std::fclose(std::exchange(file_, nullptr));
  if (!path_.empty() && rank_ == 0) unlink(path_.c_str());
}

void ChartLog::read(const Texts& identity, std::string& differs) {
  std::ifstream in(path_);
  std::string text;
  if (!std::getline(in, text)) return;
  try {
    differs = chart_difference(parse_text_map(text), identity);
  } catch (const std::exception&) {
    differs = "its first line is not readable";
  }
  if (!differs.empty()) return;
  while (std::getline(in, text)) {
    try {
      lines_.push_back(parse_text_map(text));
    } catch (const std::exception&) {
      return;
    }
  }
}

void ChartLog::write(const Texts& line) {
  const std::string text = Json(line).text(0) + "\n";
  if (!file_ || std::fputs(text.c_str(), file_) < 0 || std::fflush(file_) != 0) failed_ = 1;
}

std::string chart_difference(const Texts& stored, const Texts& now) {
  const auto shown = [](const Texts& texts, const std::string& name) {
    const auto it = texts.find(name);
    return it == texts.end() ? std::string("unset") : quoted(it->second);
  };
  for (const Texts* one : {&stored, &now})
    for (const auto& [name, text] : *one)
      if (shown(stored, name) != shown(now, name))
        return name + " is " + shown(stored, name) + " there, " + shown(now, name) + " here";
  return "";
}

std::string numbers_text(const std::vector<double>& values) {
  std::string text;
  for (const double v : values) text += (text.empty() ? "" : " ") + number_text(v);
  return text;
}

double number_of(const std::string& text) {
  return text.empty() ? NAN : std::strtod(text.c_str(), nullptr);
}

std::vector<double> numbers_of(const std::string& text) {
  std::vector<double> values;
  const char* at = text.c_str();
  for (char* end = nullptr;; at = end) {
    const double value = std::strtod(at, &end);
    if (end == at) return values;
    values.push_back(value);
  }
}

std::string optional_text(const std::optional<double>& value) { return value ? number_text(*value) : ""; }
std::optional<double> optional_of(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional<double>(number_of(text));
}

}  // namespace stickslip
