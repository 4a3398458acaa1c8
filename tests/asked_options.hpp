// What PETSc's and SLEPc's objects of every registered type print of themselves under -help: the names of the
// options that they ask for, a second source beside the texts in the libraries' images. Needs nothing of the
// program, so that it can be compiled against other releases of the libraries.
#pragma once

#include <slepceps.h>
#include <slepcpep.h>
#include <petscts.h>

#include <cctype>
#include <cstdarg>
#include <cstdio>
#include <regex>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

class AskedOptions {
 public:
  // In lower case, without the dash. Leaves out three types: patch, which makes the names of its options
  // while it runs; aspin and mpi, which end the process where the scene is not theirs. After SlepcInitialize.
  static std::set<std::string> names() {
    AskedOptions asked;
    const auto print = PetscVFPrintf;
    PetscVFPrintf = keep;
    must(PetscPushErrorHandler(PetscReturnErrorHandler, nullptr));
    must(PetscOptionsSetValue(nullptr, "-help", nullptr));
    for (const auto start :
         {TSInitializePackage, SNESInitializePackage, KSPInitializePackage, PCInitializePackage,
          EPSInitializePackage, PEPInitializePackage, STInitializePackage})
      must(start());
    asked.ask(TSList, TSCreate, TSSetType, TSSetOptionsPrefix, TSSetFromOptions, TSDestroy);
    asked.ask(SNESList, SNESCreate, SNESSetType, SNESSetOptionsPrefix, SNESSetFromOptions, SNESDestroy);
    asked.ask(KSPList, KSPCreate, KSPSetType, KSPSetOptionsPrefix, KSPSetFromOptions, KSPDestroy);
    asked.ask(PCList, PCCreate, PCSetType, PCSetOptionsPrefix, PCSetFromOptions, PCDestroy);
    asked.ask(EPSList, EPSCreate, EPSSetType, EPSSetOptionsPrefix, EPSSetFromOptions, EPSDestroy);
    asked.ask(PEPList, PEPCreate, PEPSetType, PEPSetOptionsPrefix, PEPSetFromOptions, PEPDestroy);
    must(PetscOptionsClearValue(nullptr, "-help"));
    must(PetscPopErrorHandler());
    PetscVFPrintf = print;
    std::set<std::string> found;
    const std::regex option("\n *-(?:asked[0-9]+_)?([A-Za-z0-9_]+)");
    for (std::sregex_iterator it(printed().begin(), printed().end(), option), end; it != end; ++it) {
      std::string name = (*it)[1];
      for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      found.insert(name);
    }
    return found;
  }

 private:
  static std::string& printed() {
    static std::string text;
    return text;
  }
  static PetscErrorCode keep(FILE*, const char format[], va_list arguments) {
    std::vector<char> line(200000);
    std::vsnprintf(line.data(), line.size(), format, arguments);
    printed() += line.data();
    return PetscErrorCode(0);
  }
  static void must(PetscErrorCode code) {
    if (static_cast<int>(code)) throw std::runtime_error("an object of the libraries cannot be asked");
  }

  // Help is printed once for each prefix of a process, whoever asked: each object has one of its own.
  template <class Object, class Set, class Prefix>
  void ask(PetscFunctionList list, PetscErrorCode (*create)(MPI_Comm, Object*), Set set, Prefix prefix,
           PetscErrorCode (*take)(Object), PetscErrorCode (*destroy)(Object*)) {
    const char** registered = nullptr;
    int count = 0;
    must(PetscFunctionListGet(list, &registered, &count));
    const std::vector<const char*> types(registered, registered + count);
    for (const char* type : types) {
      if (!type || std::set<std::string>{"aspin", "mpi", "patch"}.count(type)) continue;
      Object object;
      must(create(PETSC_COMM_SELF, &object));
      if (static_cast<int>(set(object, type)) == 0) {
        must(prefix(object, ("asked" + std::to_string(++objects_) + "_").c_str()));
        (void)take(object);  // some lack what they would work on, and have printed by then
      }
      (void)destroy(&object);
    }
    must(PetscFree(registered));
  }
  int objects_ = 0;
};
