# `cmake --install build --prefix P`: the program, the library with its headers and a package for find_package(stickslip),
# the scenes, the scripts that draw, man page and completion. `cpack` in the build folder makes a Debian package of it.
include(CMakePackageConfigHelpers)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/stickslip)
set(share ${CMAKE_INSTALL_DATADIR}/stickslip)

install(TARGETS stickslip stickslip_core stickslip_laws EXPORT stickslip)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/stickslip DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
# What laws are made of, and what is compiled for each: commands/register_law.hpp and all that it includes.
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/model ${PROJECT_SOURCE_DIR}/src/numerics ${PROJECT_SOURCE_DIR}/src/commands
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/stickslip/source FILES_MATCHING
        PATTERN "laws/*.hpp" PATTERN "state_laws.hpp" PATTERN "*_family.hpp" PATTERN "friction_*.hpp" PATTERN "law*.hpp"
        PATTERN "dispatch.hpp" PATTERN "model/kernel.hpp" PATTERN "elementary.hpp"
        PATTERN "jet.hpp" PATTERN "register_law.hpp")
install(EXPORT stickslip NAMESPACE stickslip:: DESTINATION ${package} FILE stickslipTargets.cmake)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/stickslipConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/generated/stickslipConfig.cmake INSTALL_DESTINATION ${package})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/generated/stickslipConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/generated/stickslipConfig.cmake
              ${PROJECT_BINARY_DIR}/generated/stickslipConfigVersion.cmake
              ${CMAKE_CURRENT_LIST_DIR}/stickslipLibraries.cmake DESTINATION ${package})

install(DIRECTORY ${PROJECT_SOURCE_DIR}/runs DESTINATION ${share})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/postprocess DESTINATION ${share} USE_SOURCE_PERMISSIONS
        FILES_MATCHING PATTERN "*.py")
# A script finds its modules where it really lies.
foreach(script plot events report xdmf)
  file(CREATE_LINK ../${share}/postprocess/${script}.py ${PROJECT_BINARY_DIR}/generated/stickslip-${script} SYMBOLIC)
  install(FILES ${PROJECT_BINARY_DIR}/generated/stickslip-${script} DESTINATION ${CMAKE_INSTALL_BINDIR})
endforeach()
install(FILES ${PROJECT_SOURCE_DIR}/docs/stickslip.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
install(FILES ${PROJECT_SOURCE_DIR}/scripts/completion.bash RENAME stickslip
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${PROJECT_SOURCE_DIR}/scripts/completion.zsh RENAME _stickslip
        DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md
              ${PROJECT_SOURCE_DIR}/CONTRIBUTING.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${CMAKE_INSTALL_DOCDIR} FILES_MATCHING PATTERN "*.md" PATTERN "*.png")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "The stickslip authors")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Stick-slip friction along a line: time stepping, spectra, boundaries, travelling pulses")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)  # asks dpkg-shlibdeps, of the package dpkg-dev
set(CPACK_DEBIAN_PACKAGE_DEPENDS "openmpi-bin, python3-h5py, python3-matplotlib")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "libslepc-real-dev, libhdf5-openmpi-dev, libyaml-dev, libfmt-dev, python3-xarray")
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
include(CPack)
