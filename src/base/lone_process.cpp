#include "base/lone_process.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>

namespace stickslip {

namespace {

bool begins_with(const std::string& text, const std::string& beginning) {
  return text.compare(0, beginning.size(), beginning) == 0;
}

bool has_launcher() {
  for (char** entry = environ; *entry; ++entry)
    for (const char* of_launcher : {"OMPI_COMM_WORLD_", "PMIX_", "PMI_", "MPI_LOCALRANKID=", "HYDRA_"})
      if (begins_with(*entry, of_launcher)) return true;
  return false;
}

// Whether the user's own file of parameters sets this one.
bool stands_in_file(const std::string& name) {
  const char* home = std::getenv("HOME");
  std::ifstream file(home ? std::string(home) + "/.openmpi/mca-params.conf" : "");
  for (std::string line; std::getline(file, line);)
    if (begins_with(line.substr(std::min(line.size(), line.find_first_not_of(" \t"))), name)) return true;
  return false;
}

}  // namespace

void prepare_lone_process() {
  if (has_launcher()) return;
  const char* const parameters[][2] = {{"ess_singleton_isolated", "1"}, {"pml", "ob1"}, {"btl", "self"}};
  for (const auto& [name, value] : parameters)
    if (!stands_in_file(name)) setenv((std::string("OMPI_MCA_") + name).c_str(), value, 0);
  setenv("HWLOC_COMPONENTS", "-linuxio,-pci", 0);  // no device is asked for
}

}  // namespace stickslip
