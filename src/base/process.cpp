#include "base/process.hpp"

#include <fcntl.h>
#include <petscsys.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <string>

#include "base/failure.hpp"
#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"

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

namespace {

constexpr int few = 8;  // that any motion may have at one time: nobody is asked
constexpr double round_off = 256 * std::numeric_limits<double>::epsilon();  // of a time

// In the order of ranks.
std::vector<PetscInt> of_all_ranks(const std::vector<PetscInt>& own, MPI_Comm comm) {
  const int count = int(own.size());
  std::vector<int> counts(std::size_t(ranks_in(comm))), begins(counts.size());
  SS_TRY(MPI_Allgather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, comm));
  std::partial_sum(counts.begin(), counts.end() - 1, begins.begin() + 1);
  std::vector<PetscInt> all(std::size_t(begins.back() + counts.back()));
  SS_TRY(
      MPI_Allgatherv(own.data(), count, MPIU_INT, all.data(), counts.data(), begins.data(), MPIU_INT, comm));
  return all;
}

}  // namespace

bool Idling::at(double t, const std::vector<PetscInt>& changed, double same) {
  const bool later = !(std::abs(t - t_) <= std::max(same, round_off * std::abs(t)));
  if (later || steps_ == 0) {
    t_ = t;
    steps_ = idle_ = 0;
    changes_.clear();
  }
  ++steps_;
  if (steps_ <= few) return false;
  int most = 0;
  for (const PetscInt node : changed) most = std::max(most, ++changes_[node]);
  std::array<int, 3> flags{most, changed.empty() ? 0 : 1, SignalWatch::caught()};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, flags.data(), 3, MPI_INT, MPI_MAX, comm_));
  idle_ = flags[1] ? 0 : idle_ + 1;
  if (flags[0] > most_changes || idle_ > most_steps) end(t, flags[0]);
  if (flags[2]) beat("steps", 0);  // a search ends here
  return flags[2] != 0;
}

void Idling::end(double t, int changes) const {
  if (changes <= most_changes)
    throw Failure("time stands still: " + std::to_string(idle_) +
                  " steps have come no further than t = " + number_text(t) +
                  ", and no node starts or stops in them");
  std::vector<PetscInt> own;
  for (const auto& [node, times] : changes_)
    if (times > most_changes / 2) own.push_back(node);
  const std::vector<PetscInt> nodes = of_all_ranks(own, comm_);
  constexpr std::size_t shown = 5;
  std::string text;
  for (std::size_t k = 0; k < std::min(shown, nodes.size()); ++k)
    text += (k ? ", " : "") + std::to_string(nodes[k]);
  if (nodes.size() > shown) text += ", ... (" + std::to_string(nodes.size()) + " in all)";
  throw Failure("nodes begin to slip and rest again without end at t = " + number_text(t) + ": " +
                (nodes.size() == 1 ? "node " : "nodes ") + text + ", " + std::to_string(changes) +
                " times without time");
}

}  // namespace stickslip

namespace stickslip::paths {

std::string folder(const std::string& path) {
  const std::string parent = std::filesystem::path(path).parent_path();
  return parent.empty() ? "." : parent;
}

std::string file(const std::string& path) { return std::filesystem::path(path).filename(); }

std::string hidden_sibling(const std::string& path, const std::string& suffix) {
  return std::filesystem::path(path).replace_filename("." + file(path) + suffix);
}

std::string resolved(const std::string& path) {
  std::error_code missing;
  const std::filesystem::path real = std::filesystem::canonical(path, missing);
  return missing ? path : real.string();
}

Present check_writable(const std::string& option, const std::string& path) {
  const auto refuse = [&](const std::string& why) { throw usage_error("{} '{}': {}", option, path, why); };
  if (path.empty()) refuse("the name of a file is needed");
  struct stat at {};
  const bool present = stat(path.c_str(), &at) == 0;
  if (!present && errno != ENOENT) refuse(std::strerror(errno));
  if (present && S_ISDIR(at.st_mode)) refuse("is a folder, give the name of a file");
  if (!present && path.back() == '/') refuse("is not the name of a file");
  if (present && !S_ISREG(at.st_mode)) {
    if (access(path.c_str(), W_OK) != 0) refuse(std::strerror(errno));
    return Present::special;
  }
  struct stat link {};
  if (!present && lstat(path.c_str(), &link) == 0) refuse("is a symbolic link to nothing");
  struct stat in {};
  if (stat(folder(path).c_str(), &in) != 0)
    refuse("the folder '" + folder(path) + "' does not exist (make it first)");

  // Whether a file can be made there is best learnt by making one; permissions alone do not tell (read-only
  // mounts).
  const std::string probe = hidden_sibling(resolved(path), ".probe");  // not what another program writes now
  unlink(probe.c_str());
  const int fd = open(probe.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0666);
  if (fd < 0) refuse(fmt::format("cannot be written in '{}' ({})", folder(path), std::strerror(errno)));
  close(fd);
  unlink(probe.c_str());
  return present ? Present::regular : Present::nothing;
}

Descriptor::Descriptor(const std::string& path, int flags, const std::string& doing)
    : number_(open(path.c_str(), flags | O_CLOEXEC, 0666)) {
  if (number_ < 0) throw failure("cannot {} '{}': {}", doing, path, std::strerror(errno));
}

Descriptor::~Descriptor() { close(number_); }

void write_all(int descriptor, const void* bytes, std::size_t size, std::int64_t at) {
  for (std::size_t done = 0; done < size;) {
    const char* from = static_cast<const char*>(bytes) + done;
    const ssize_t count = at < 0
                              ? write(descriptor, from, size - done)
                              : pwrite(descriptor, from, size - done, static_cast<off_t>(at) + off_t(done));
    if (count < 0 && errno != EINTR) throw Failure(std::strerror(errno));
    if (count > 0) done += count;
  }
}

std::size_t read_some(int descriptor, void* bytes, std::size_t size, std::int64_t at) {
  for (;;) {
    const ssize_t count = pread(descriptor, bytes, size, static_cast<off_t>(at));
    if (count >= 0) return count;
    if (errno != EINTR) throw Failure(std::strerror(errno));
  }
}

void reserve(const std::string& path, double bytes) {
  const Descriptor file(path, O_RDWR | O_CREAT, "create");
  if (const int why = posix_fallocate(file, 0, static_cast<off_t>(bytes)); why != 0)
    throw Failure("cannot write '" + path + "': " + std::strerror(why));
}

void check_length(const std::string& path, double bytes) {
  const bool fits = truncate(path.c_str(), static_cast<off_t>(bytes)) == 0;
  const int why = errno;
  if (!fits || truncate(path.c_str(), 0) != 0)
    throw Failure("cannot write '" + path + "': " + std::strerror(fits ? errno : why));
}

void sync(const std::string& path) {
  const Descriptor file(path, O_RDONLY);
  if (fsync(file) != 0) throw Failure("cannot write '" + path + "': " + std::strerror(errno));
}

void publish(const std::string& temporary, const std::string& path) {
  if (std::rename(temporary.c_str(), path.c_str()) != 0)
    throw Failure("cannot write '" + path + "': " + std::strerror(errno));
}

void replace_file(const std::string& path, const std::function<void(const std::string& name)>& write,
                  const std::string& suffix, bool to_disk) {
  const std::string name = hidden_sibling(path, suffix);
  unlink(name.c_str());
  try {
    write(name);
    if (to_disk) sync(name);
    publish(name, path);
  } catch (...) {
    unlink(name.c_str());
    throw;
  }
}

void replace_file(const std::string& path, const std::string& content, const std::string& suffix,
                  bool to_disk) {
  const auto write = [&](const std::string& name) {
    write_all(Descriptor(name, O_WRONLY | O_CREAT | O_TRUNC, "write"), content.data(), content.size());
  };
  replace_file(path, write, suffix, to_disk);
}

}  // namespace stickslip::paths

namespace stickslip {

std::string shell_word(const std::string& word) {
  const char* safe = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=.,:/@%";
  if (!word.empty() && word.find_first_not_of(safe) == std::string::npos) return word;
  std::string out = "'";
  for (const char c : word) {
    if (c == '\'')
      out += "'\\''";
    else
      out += c;
  }
  return out + "'";
}

}  // namespace stickslip
