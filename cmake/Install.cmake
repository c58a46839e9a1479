# Installs, as component libkrot-dev, the headers, the libraries as
# krot::<folder>, and krot::krot, which stands for all of them; find_package(krot)
# and pkg-config find them. Component krot is the command with its manual pages
# and what shells complete.
include(CMakePackageConfigHelpers)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME libkrot-dev)

get_property(krot_libraries GLOBAL PROPERTY KROT_LIBRARIES)
add_library(krot_all INTERFACE)
add_library(krot::krot ALIAS krot_all)
set_target_properties(krot_all PROPERTIES EXPORT_NAME krot)
target_link_libraries(krot_all INTERFACE ${krot_libraries})

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/krot)
install(TARGETS ${krot_libraries} krot_all EXPORT krotTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/krot
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  FILES_MATCHING PATTERN "*.h")
install(FILES ${PROJECT_BINARY_DIR}/src/krot/version.h
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/krot)
install(EXPORT krotTargets NAMESPACE krot:: DESTINATION ${package_dir})

# What the installed targets link to, directly or not.
set(KROT_INSTALL_NEEDS_CERES OFF)
set(KROT_INSTALL_NEEDS_JSON OFF)
set(KROT_INSTALL_NEEDS_SQLITE OFF)
foreach(library IN LISTS krot_libraries)
  get_target_property(linked ${library} INTERFACE_LINK_LIBRARIES)
  if(linked MATCHES "Ceres::")
    set(KROT_INSTALL_NEEDS_CERES ON)
  endif()
  if(linked MATCHES "nlohmann_json::")
    set(KROT_INSTALL_NEEDS_JSON ON)
  endif()
  if(linked MATCHES "SQLite::")
    set(KROT_INSTALL_NEEDS_SQLITE ON)
  endif()
endforeach()
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

# For the linker, who looks from left to right: the highest folders first.
set(KROT_PC_LIBRARIES)
foreach(library IN LISTS krot_libraries)
  get_target_property(type ${library} TYPE)
  if(NOT type STREQUAL INTERFACE_LIBRARY)
    string(PREPEND KROT_PC_LIBRARIES "-l${library} ")
  endif()
endforeach()
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
