// How many names of options stand in the read-only data of PETSc and SLEPc, and which of those that their
// objects print under -help do not. Of another release than the program's: compile this file with
// src/options/library_names.cpp and src/base/text.cpp against it, -DFMT_HEADER_ONLY.
#include "../asked_options.hpp"
#include "stickslip/options/library_options.hpp"

int main(int argc, char** argv) {
  const auto found = stickslip::library_names().size();  // before they are started
  if (SlepcInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  const std::set<std::string> asked = AskedOptions::names();
  std::printf("%d.%d.%d: %zu names found, %zu asked for; not among those found:", PETSC_VERSION_MAJOR,
              PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR, found, asked.size());
  int missing = 0;
  for (const std::string& name : asked)
    if (!stickslip::library_reads(name) && ++missing) std::printf(" %s", name.c_str());
  std::printf("%s\n", missing ? "" : " none");
  std::fflush(stdout);
  return SlepcFinalize() || missing ? 1 : 0;
}
