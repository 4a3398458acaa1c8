// The process, the machine it runs on and its files.
#pragma once

#include <petscsys.h>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace stickslip {

// What the process is among others, and what memory it may have.

// The start of MPI, also in a process that no launcher started.

// MPI_Init; false: it failed. Where no launcher (mpirun, srun and whatever speaks PMI or PMIx) started this
// process, Open MPI starts it without a daemon beside it and without a search of the network and of the
// machine's devices, unless the user set these parameters, in the environment or in
// ~/.openmpi/mca-params.conf. It makes no session folder then, since each process that ends removes the one
// that all of a user share, and those that start at that moment die; an Open MPI that makes one nevertheless
// (5, or where the user wants it) does so in a folder of this process alone. Both are gone when this returns:
// nothing needs them later, and nothing is left behind however the process ends. Another MPI may do without.
bool start_mpi(int& argc, char**& argv);

// What memory a process may still take.

// In bytes, on this machine: what Linux says is available, or what a control group leaves where that is less;
// elsewhere all that the machine has. Swap does not count. Infinite where nothing is known.
double memory_of_machine();

// What the limit of addresses (ulimit -v) leaves to this process; infinite where there is none.
double memory_of_process();

// Steps, and starts and stops of nodes, that take no time. A motion that exists has few of them at one time;
// a loop over steps that they keep from getting on would never end, and would hear no signal, since what
// ends a run is asked behind steps. So every such loop tells one of these what it has done: of too many at
// one time it makes a Failure that says which nodes they are, and it hears signals meanwhile.
class Idling {
 public:
  static constexpr int most_changes = 100;  // of one node at one time
  static constexpr int most_steps = 200;    // in which no node changes, at one time

  // On one rank, or on all of those of `comm` together.
  explicit Idling(MPI_Comm comm = MPI_COMM_SELF) : comm_(comm) {}

  // A step has ended at t, or was rejected where it begins there; in it nodes with these numbers (of the
  // whole line, those of this rank) began to slip or stopped. Up to `same` later than the first at one time
  // is that time still, and as much as round-off of t is. True where SIGINT or SIGTERM has come and no Pulse
  // ends the work: the caller then ends it. Throws Failure, and Interrupted where a Pulse lives. Collective.
  bool at(double t, const std::vector<PetscInt>& changed = {}, double same = 0);
  void restart() { steps_ = 0; }  // time is counted anew

 private:
  [[noreturn]] void end(double t, int changes) const;

  MPI_Comm comm_;
  double t_ = 0;
  int steps_ = 0, idle_ = 0;         // at one time, and those in a row in which no node changed
  std::map<PetscInt, int> changes_;  // of each node, then
};

}  // namespace stickslip

// File names and what may be written under them. Rank 0 only.

namespace stickslip::paths {

std::string folder(const std::string& path);  // "." where there is none
std::string file(const std::string& path);    // the last part
std::string hidden_sibling(const std::string& path, const std::string& suffix = ".tmp");  // DIR/.NAME.tmp

// The file behind symbolic links, so that a rename replaces the file and not the link; `path` itself where
// nothing is there yet.
std::string resolved(const std::string& path);

enum class Present { nothing, regular, special };  // special: a pipe or a device

// What stands at `path`, for `option` to write there: throws UsageError where that is a folder, the folder is
// missing or not writable, or the name is empty, too long or otherwise unusable (found by making and removing
// a file).
Present check_writable(const std::string& option, const std::string& path);

// An open file, closed with the scope.
class Descriptor {
 public:
  // flags: those of open(2). Throws Failure, "cannot DOING 'PATH': ...".
  Descriptor(const std::string& path, int flags, const std::string& doing = "open");
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  operator int() const { return number_; }  // NOLINT: it stands for its number

 private:
  int number_;
};

// All the bytes, from position `at` on; at -1: where the file stands, which may be a pipe. Throws Failure:
// the system's word for what is wrong.
void write_all(int descriptor, const void* bytes, std::size_t size, std::int64_t at = -1);
// Up to so many bytes from position `at` on, fewer at the end of the file. Throws Failure likewise.
std::size_t read_some(int descriptor, void* bytes, std::size_t size, std::int64_t at);

// Takes disk space for the first `bytes` of a file, made where it is not there. Throws Failure.
void reserve(const std::string& path, double bytes);

// Throws Failure where a file may not become so long (a limit of the user or of the file system). Empties it.
void check_length(const std::string& path, double bytes);

// Makes a file anew: write(name) writes it under a hidden name in the same folder, then it is brought to disk
// and takes the place of what stands at `path`, in one step, so that whoever reads finds the earlier file or
// the whole new one. Where anything throws, the earlier one stands and nothing is left. `suffix`: of the
// hidden name; not `to_disk`: it is to outlive the program, but not the machine.
void replace_file(const std::string& path, const std::function<void(const std::string& name)>& write,
                  const std::string& suffix = ".tmp", bool to_disk = true);
void replace_file(const std::string& path, const std::string& content, const std::string& suffix = ".tmp",
                  bool to_disk = true);

void sync(const std::string& path);                                   // fsync of a file; throws Failure
void publish(const std::string& temporary, const std::string& path);  // atomic rename; throws Failure

}  // namespace stickslip::paths

namespace stickslip {

// A word as a POSIX shell would need it typed.
std::string shell_word(const std::string& word);

}  // namespace stickslip
