#include "base/process.hpp"

#include <petscsys.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <optional>
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

// What keeps a single process from asking for more than it needs.
void set_parameters() {
  const char* const parameters[][2] = {
      {"ess_singleton_isolated", "1"}, {"orte_create_session_dirs", "0"}, {"pml", "ob1"}, {"btl", "self"}};
  for (const auto& [name, value] : parameters)
    if (!stands_in_file(name)) setenv((std::string("OMPI_MCA_") + name).c_str(), value, 0);
  setenv("HWLOC_COMPONENTS", "-linuxio,-pci", 0);  // no device is asked for
}

bool is_set(const char* name, const std::string& value) {
  const char* set = std::getenv(name);
  return set && set == value;
}

// Open MPI 4 makes none where it is told so; later ones do not ask.
bool makes_folders() {
  char version[MPI_MAX_LIBRARY_VERSION_STRING];
  int length = 0;
  MPI_Get_library_version(version, &length);
  return !begins_with(version, "Open MPI v4.") || !is_set("OMPI_MCA_orte_create_session_dirs", "0");
}

// While this lives, Open MPI's folders for temporary files lie in one that no other process knows. Where none
// can be made, MPI finds its own or says why not.
class OwnTemporaryFolder {
 public:
  OwnTemporaryFolder() {
    std::error_code none;
    const char* asked = std::getenv(names[0]);
    const std::filesystem::path base = asked ? asked : std::filesystem::temp_directory_path(none);
    std::string name = (base / "stickslip-XXXXXX").string();
    if (none || !mkdtemp(name.data())) return;
    folder_ = name;
    for (std::size_t i = 0; i < std::size(names); ++i) {
      if (const char* set = std::getenv(names[i])) before_[i] = set;
      setenv(names[i], folder_.c_str(), 1);
    }
  }
  ~OwnTemporaryFolder() {
    if (folder_.empty()) return;
    for (std::size_t i = 0; i < std::size(names); ++i)
      before_[i] ? setenv(names[i], before_[i]->c_str(), 1) : unsetenv(names[i]);
    std::error_code none;
    std::filesystem::remove_all(folder_, none);
  }
  OwnTemporaryFolder(const OwnTemporaryFolder&) = delete;
  OwnTemporaryFolder& operator=(const OwnTemporaryFolder&) = delete;

 private:
  // What Open MPI 4 reads, then what 5 and later do.
  static constexpr const char* names[] = {"OMPI_MCA_orte_tmpdir_base", "TMPDIR"};
  std::string folder_;
  std::optional<std::string> before_[std::size(names)];
};

bool init(int& argc, char**& argv) {
  int provided = 0;
  return MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided) == MPI_SUCCESS;
}

}  // namespace

bool start_mpi(int& argc, char**& argv) {
  if (has_launcher()) return init(argc, argv);
  set_parameters();
  // beside a daemon, which needs the folder
  if (!is_set("OMPI_MCA_ess_singleton_isolated", "1") || !makes_folders()) return init(argc, argv);
  const OwnTemporaryFolder folder;
  return init(argc, argv);
}

namespace {

constexpr double unknown = std::numeric_limits<double>::infinity();

// The number behind a word at the head of a line; infinite where there is none.
double number_after(const std::string& path, const std::string& word) {
  std::ifstream lines(path);
  for (std::string line; std::getline(lines, line);)
    if (line.rfind(word, 0) == 0) try {
        return std::stod(line.substr(word.size()));
      } catch (const std::exception&) {
        return unknown;
      }
  return unknown;
}

// What the control group at this folder leaves: its limit less what is taken, of which files in its cache can
// be dropped.
double left_in(const std::string& folder, const std::string& limit, const std::string& taken,
               const std::string& files) {
  const double most = number_after(folder + "/" + limit, ""), now = number_after(folder + "/" + taken, "");
  if (most == unknown || now == unknown) return unknown;
  double cache = 0;
  for (const char* list : {"inactive_file ", "active_file "})
    if (const double part = number_after(folder + "/memory.stat", files + list); part != unknown)
      cache += part;
  return std::max(0., most - now + cache);
}

// A group and those that it lies in, up to the root.
double left_in_groups() {
  double least = unknown;
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const auto kind = line.find(':'), path = line.find(':', kind + 1);
    if (path == std::string::npos) continue;
    const std::string controllers = line.substr(kind + 1, path - kind - 1);
    const bool second = controllers.empty();  // version 2 has one tree for all
    if (!second && controllers != "memory") continue;
    const std::string root = second ? "/sys/fs/cgroup" : "/sys/fs/cgroup/memory";
    for (std::string group = line.substr(path + 1);; group.erase(group.rfind('/'))) {
      while (!group.empty() && group.back() == '/') group.pop_back();
      least = std::min(
          least, second ? left_in(root + group, "memory.max", "memory.current", "")
                        : left_in(root + group, "memory.limit_in_bytes", "memory.usage_in_bytes", "total_"));
      if (group.rfind('/') == std::string::npos) break;
    }
  }
  return least;
}

}  // namespace

double memory_of_machine() {
  double here = 1024 * number_after("/proc/meminfo", "MemAvailable:");
  const double all = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGE_SIZE));
  if (here == unknown && all > 0) here = all;
  return std::min(here, left_in_groups());
}

double memory_of_process() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return unknown;
  // the largest range of addresses that is given, to 1 MiB
  double given = 0, refused = double(limit.rlim_cur);
  while (refused - given > 0x1p20) {
    const double half = (given + refused) / 2;
    void* range =
        mmap(nullptr, std::size_t(half), PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    (range == MAP_FAILED ? refused : given) = half;
    if (range != MAP_FAILED) munmap(range, std::size_t(half));
  }
  return given;
}

}  // namespace stickslip
