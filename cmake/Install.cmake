# Installs the headers, the libraries as krot::<folder>, and krot::krot, which
# stands for all of them; find_package(krot) finds them.
include(CMakePackageConfigHelpers)

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
install(EXPORT krotTargets NAMESPACE krot:: DESTINATION ${package_dir})

# What the installed targets link to, directly or not.
set(KROT_INSTALL_NEEDS_CERES OFF)
set(KROT_INSTALL_NEEDS_JSON OFF)
set(KROT_INSTALL_NEEDS_OPENSSL OFF)
foreach(library IN LISTS krot_libraries)
  get_target_property(linked ${library} INTERFACE_LINK_LIBRARIES)
  if(linked MATCHES "Ceres::")
    set(KROT_INSTALL_NEEDS_CERES ON)
  endif()
  if(linked MATCHES "nlohmann_json::")
    set(KROT_INSTALL_NEEDS_JSON ON)
  endif()
  if(linked MATCHES "OpenSSL::")
    set(KROT_INSTALL_NEEDS_OPENSSL ON)
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

add_custom_target(uninstall
  COMMAND ${CMAKE_COMMAND}
    -DMANIFEST=${PROJECT_BINARY_DIR}/install_manifest.txt
    -P ${PROJECT_SOURCE_DIR}/cmake/Uninstall.cmake
  COMMENT "Removing the installed files")
