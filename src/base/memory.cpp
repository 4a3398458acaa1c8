#include "base/memory.hpp"

#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <fstream>
#include <limits>
#include <string>

namespace stickslip {

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
