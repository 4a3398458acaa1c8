# What the library stands on, found in one way by its own build and by find_package(stickslip). The targets:
#   stickslip::petsc   SLEPc, PETSc, and LAPACK as PETSc links it
#   stickslip::hdf5    HDF5 with dimension scales (its high-level library)
#   PkgConfig::STICKSLIP_YAML, fmt::fmt, MPI::MPI_C
# PETSc and SLEPc are those of PETSC_DIR, PETSC_ARCH and SLEPC_DIR (-D..., else the environment) where these are given, in
# their build folders or installed under a prefix; else those that pkg-config finds. Their settings are read from their
# own files, so that what does not fit is said here and not by the compiler.
find_package(PkgConfig REQUIRED)

foreach(variable PETSC_DIR PETSC_ARCH SLEPC_DIR)
  if(NOT DEFINED ${variable} AND DEFINED ENV{${variable}})
    set(${variable} "$ENV{${variable}}" CACHE STRING "as every program on PETSc takes it")
  endif()
endforeach()
if(PETSC_DIR AND NOT SLEPC_DIR)
  set(SLEPC_DIR "${PETSC_DIR}")  # under one prefix, as PETSc's --download-slepc puts it
endif()
set(stickslip_path "$ENV{PKG_CONFIG_PATH}")
foreach(folder "${PETSC_DIR}" "${SLEPC_DIR}")
  if(folder)
    foreach(inside "${folder}/lib" "${folder}/${PETSC_ARCH}/lib")  # the latter comes first
      set(ENV{PKG_CONFIG_PATH} "${inside}/pkgconfig:$ENV{PKG_CONFIG_PATH}")
    endforeach()
  endif()
endforeach()
pkg_search_module(STICKSLIP_PETSC QUIET IMPORTED_TARGET PETSc petsc)
pkg_search_module(STICKSLIP_SLEPC QUIET IMPORTED_TARGET SLEPc slepc)
pkg_get_variable(stickslip_petsc_prefix "${STICKSLIP_PETSC_MODULE_NAME}" prefix)
pkg_get_variable(stickslip_compiler "${STICKSLIP_PETSC_MODULE_NAME}" ccompiler)
set(ENV{PKG_CONFIG_PATH} "${stickslip_path}")

get_filename_component(stickslip_asked "${PETSC_DIR}" REALPATH)
get_filename_component(stickslip_found "${stickslip_petsc_prefix}" REALPATH)
if(NOT STICKSLIP_PETSC_FOUND OR (PETSC_DIR AND NOT "${stickslip_found}/" MATCHES "^${stickslip_asked}/"))
  message(FATAL_ERROR "stickslip: there is no PETSc in PETSC_DIR='${PETSC_DIR}' with PETSC_ARCH='${PETSC_ARCH}' "
                      "(where these are empty: none that pkg-config knows)")
endif()
set(stickslip_petsc "PETSc ${STICKSLIP_PETSC_VERSION} in ${stickslip_petsc_prefix}")
if(STICKSLIP_PETSC_VERSION VERSION_LESS 3.18)
  message(FATAL_ERROR "stickslip: ${stickslip_petsc} is too old: from 3.18 on")
endif()
string(REGEX MATCH "^[0-9]+[.][0-9]+" stickslip_petsc_release "${STICKSLIP_PETSC_VERSION}")
string(REGEX MATCH "^[0-9]+[.][0-9]+" stickslip_slepc_release "${STICKSLIP_SLEPC_VERSION}")
if(NOT stickslip_petsc_release STREQUAL stickslip_slepc_release)
  message(FATAL_ERROR "stickslip: there is no SLEPc of the release of ${stickslip_petsc} (SLEPC_DIR; "
                      "found: ${STICKSLIP_SLEPC_VERSION})")
endif()
set(stickslip_settings "")
find_file(stickslip_petscconf petscconf.h PATHS ${STICKSLIP_PETSC_INCLUDE_DIRS} NO_DEFAULT_PATH NO_CACHE)
if(stickslip_petscconf)
  file(STRINGS "${stickslip_petscconf}" stickslip_settings REGEX "#define PETSC_(USE_|HAVE_(MPIUNI|64BIT_BLAS))")
endif()
foreach(refused "USE_COMPLEX;complex scalars;--with-scalar-type=real" "HAVE_MPIUNI;no MPI;--with-mpi"
                "HAVE_64BIT_BLAS_INDICES;a BLAS of 64-bit integers;with one of 32 bits"
                "USE_REAL_(SINGLE|__FLOAT128|__FP16);another precision;--with-precision=double")
  list(GET refused 0 stickslip_setting)
  list(GET refused 1 stickslip_has)
  list(GET refused 2 stickslip_instead)
  if("${stickslip_settings}" MATCHES "#define PETSC_${stickslip_setting} ")
    message(FATAL_ERROR "stickslip: ${stickslip_petsc} has ${stickslip_has}; one configured ${stickslip_instead} is needed "
                        "(PETSC_DIR and PETSC_ARCH choose it)")
  endif()
endforeach()

set(stickslip_lapack lapack blas)
if(EXISTS "${stickslip_petsc_prefix}/lib/petsc/conf/petscvariables")
  file(STRINGS "${stickslip_petsc_prefix}/lib/petsc/conf/petscvariables" stickslip_line REGEX "^BLASLAPACK_LIB = .")
  if(stickslip_line)
    string(REGEX REPLACE "^BLASLAPACK_LIB = *" "" stickslip_line "${stickslip_line}")
    separate_arguments(stickslip_lapack UNIX_COMMAND "${stickslip_line}")
  endif()
endif()
if(NOT TARGET stickslip::petsc)
  add_library(stickslip::petsc INTERFACE IMPORTED)
  target_link_libraries(stickslip::petsc INTERFACE PkgConfig::STICKSLIP_SLEPC PkgConfig::STICKSLIP_PETSC ${stickslip_lapack})
endif()

enable_language(C)  # whose bindings of MPI and HDF5 are enough
if(IS_ABSOLUTE "${stickslip_compiler}" AND NOT DEFINED MPI_C_COMPILER)
  set(MPI_C_COMPILER "${stickslip_compiler}")  # the MPI that PETSc was built with
endif()
find_package(MPI REQUIRED COMPONENTS C)

# The one that PETSc may be linked with, so that not two of a kind are in one process.
set(HDF5_PREFER_PARALLEL TRUE)
find_package(HDF5 REQUIRED COMPONENTS C HL)  # a release asked for is taken for the only one by packages of HDF5 2
if(NOT TARGET stickslip::hdf5)
  add_library(stickslip::hdf5 INTERFACE IMPORTED)
  target_link_libraries(stickslip::hdf5 INTERFACE ${HDF5_HL_LIBRARIES} ${HDF5_C_LIBRARIES})
  target_include_directories(stickslip::hdf5 INTERFACE ${HDF5_INCLUDE_DIRS})
endif()

pkg_check_modules(STICKSLIP_YAML REQUIRED IMPORTED_TARGET yaml-0.1)
find_package(fmt 9 REQUIRED)
