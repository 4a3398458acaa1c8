#include "stickslip/base/provenance.hpp"

#include <unistd.h>

#include <algorithm>
#include <ctime>

#include "base/process.hpp"
#include "revision.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

std::string noted_command_line;

}  // namespace

void note_command_line(int argc, char** argv) {
  noted_command_line.clear();
  for (int k = 0; k < argc; ++k) noted_command_line += (k ? " " : "") + shell_word(argv[k]);
}

std::string script_call(const std::string& name) {
  char program[4096];
  const ssize_t length = readlink("/proc/self/exe", program, sizeof program);
  const std::string path(program, length > 0 ? length : 0), installed = "stickslip-" + name;
  const bool there = access((path.substr(0, path.rfind('/') + 1) + installed).c_str(), X_OK) == 0;
  return there && !path.empty() ? installed : "postprocess/" + name + ".py";
}

const char* version() { return STICKSLIP_VERSION; }
const char* git_revision() { return STICKSLIP_GIT; }

Provenance Provenance::of(const std::string& command, const std::map<std::string, std::string>& options) {
  Provenance p;
  p.command = command;
  p.options = options;
  p.command_line = noted_command_line;
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char buffer[32];
  std::strftime(buffer, sizeof buffer, "%Y-%m-%dT%H:%M:%SZ", &utc);
  p.date = buffer;
  MPI_Comm_size(PETSC_COMM_WORLD, &p.ranks);
  return p;
}

std::string Provenance::option(const std::string& name) const {
  const auto found = options.find(name);
  return found == options.end() ? "" : found->second;
}

static std::vector<std::string> kept_readings;

void note_reading(const std::string& line) {
  if (std::find(kept_readings.begin(), kept_readings.end(), line) == kept_readings.end())
    kept_readings.push_back(line);
}

const std::vector<std::string>& readings() { return kept_readings; }

}  // namespace stickslip
