# Debian packages, one for each component of Install.cmake; made by
# tools/make_packages.sh.
set(KROT_PACKAGE_CONTACT "KROT contributors <contributors@krot.invalid>" CACHE
    STRING "Maintainer of the Debian packages: who distributes them")

foreach(package krot libkrot-dev)
  set(folder ${CMAKE_INSTALL_DATADIR}/doc/${package})
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE RENAME copyright
    DESTINATION ${folder} COMPONENT ${package})
  install(FILES ${PROJECT_BINARY_DIR}/pages/changelog.gz
    DESTINATION ${folder} COMPONENT ${package})
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_COMPONENTS_ALL krot libkrot-dev)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_CONTACT "${KROT_PACKAGE_CONTACT}")
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)

set(CPACK_DEBIAN_KROT_PACKAGE_NAME krot)
set(CPACK_DEBIAN_KROT_DESCRIPTION
  "The command line. Reads a COLMAP sparse model, keeps its rotations, and re-estimates camera
translations and 3D points so that the largest reprojection error is as low
as it can be, with a certificate. Removes outliers with proof, compares,
adjusts below a cap, and writes what COLMAP reads.")
set(CPACK_DEBIAN_KROT_PACKAGE_SECTION science)
set(CPACK_DEBIAN_KROT_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_KROT_PACKAGE_RECOMMENDS colmap)

set(CPACK_DEBIAN_LIBKROT-DEV_PACKAGE_NAME libkrot-dev)
set(CPACK_DEBIAN_LIBKROT-DEV_DESCRIPTION
  "The C++ library behind krot: a static library, headers, and what CMake's
find_package and pkg-config need.")
set(CPACK_DEBIAN_LIBKROT-DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_LIBKROT-DEV_PACKAGE_DEPENDS
  "libceres-dev, libeigen3-dev, libsqlite3-dev")
include(CPack)
