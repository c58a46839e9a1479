# Installs, as component libkrot-dev, the headers of src/krot itself and libkrot.a
# as krot::krot; find_package(krot) and pkg-config find them. Component krot is the
# command with its manual pages and what shells complete.
include(CMakePackageConfigHelpers)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME libkrot-dev)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/krot)
install(TARGETS krot_public EXPORT krotTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
file(GLOB public_headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/krot/*.h)
install(FILES ${public_headers} ${PROJECT_BINARY_DIR}/src/krot/version.h
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/krot)
if(KROT_INSTALL_FOLDERS)  # for third_party_patches
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/krot
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
endif()
install(EXPORT krotTargets NAMESPACE krot:: DESTINATION ${package_dir})

# What programs link besides.
set(KROT_INSTALL_NEEDS_CERES ON)
set(KROT_PC_LIBS "-lceres -lglog -lsqlite3")
if(KROT_MINIMAL)
  set(KROT_INSTALL_NEEDS_CERES OFF)
  set(KROT_PC_LIBS "")
endif()
configure_package_config_file(
  ${PROJECT_SOURCE_DIR}/cmake/krotConfig.cmake.in
  ${PROJECT_BINARY_DIR}/krotConfig.cmake
  INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(
  ${PROJECT_BINARY_DIR}/krotConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES
  ${PROJECT_BINARY_DIR}/krotConfig.cmake
  ${PROJECT_BINARY_DIR}/krotConfigVersion.cmake
  DESTINATION ${package_dir})

set(pkgconfig_dir ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
file(RELATIVE_PATH KROT_PC_PREFIX /${pkgconfig_dir} /)
configure_file(${PROJECT_SOURCE_DIR}/cmake/krot.pc.in
  ${PROJECT_BINARY_DIR}/krot.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/krot.pc DESTINATION ${pkgconfig_dir})

# The command's pages, all from its own tables of options.
set(pages ${PROJECT_BINARY_DIR}/pages)
add_custom_command(OUTPUT ${pages}/done
  COMMAND ${PROJECT_SOURCE_DIR}/tools/docs/help_pages.sh $<TARGET_FILE:krot> ${pages}
  COMMAND ${CMAKE_COMMAND} -E touch ${pages}/done
  DEPENDS krot ${PROJECT_SOURCE_DIR}/tools/docs/help_pages.sh VERBATIM)
add_custom_target(krot_pages ALL DEPENDS ${pages}/done)
install(DIRECTORY ${pages}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR}
  COMPONENT krot)
install(FILES ${pages}/krot.bash RENAME krot COMPONENT krot
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${pages}/_krot COMPONENT krot
  DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions)

add_custom_target(uninstall
  COMMAND ${CMAKE_COMMAND}
    -DMANIFEST=${PROJECT_BINARY_DIR}/install_manifest.txt
    -P ${PROJECT_SOURCE_DIR}/cmake/Uninstall.cmake
  COMMENT "Removing the installed files")
