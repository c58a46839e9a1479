# krot_library(<folder> [COLD] [SOURCES file...] [DEPENDS target...])
#
# One library per folder of src/krot: krot_<folder>, alias krot::<folder>.
# Without sources it is header-only. COLD: see krot_cold.
function(krot_library folder)
  cmake_parse_arguments(ARG "COLD" "" "SOURCES;DEPENDS" ${ARGN})
  set(target krot_${folder})
  if(ARG_SOURCES)
    add_library(${target} ${ARG_SOURCES})
    set(scope PUBLIC)
    krot_warnings(${target})
    if(ARG_COLD)
      krot_cold(${target})
      krot_precompiled_headers(${target} COLD)
    else()
      krot_precompiled_headers(${target} HOT)
    endif()
  else()
    add_library(${target} INTERFACE)
    set(scope INTERFACE)
  endif()
  add_library(krot::${folder} ALIAS ${target})
  target_include_directories(${target} ${scope}
    ${PROJECT_SOURCE_DIR}/src ${PROJECT_BINARY_DIR}/src)
  target_compile_features(${target} ${scope} cxx_std_17)
  target_link_libraries(${target} ${scope} ${ARG_DEPENDS})
  set_property(GLOBAL APPEND PROPERTY KROT_LIBRARIES ${target})
endfunction()

function(krot_warnings target)
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")  # pages; GoogleTest's macros
    target_compile_options(${target} PRIVATE
      -Wno-overlength-strings -Wno-gnu-zero-variadic-macro-arguments)
  endif()
  if(EMSCRIPTEN)  # Indices have 64 bits, memory 32.
    target_compile_options(${target} PRIVATE -Wno-shorten-64-to-32)
  endif()
  if(MINGW)  # A unit has more sections than the older format can number.
    target_compile_options(${target}
      PRIVATE -Wa,-mbig-obj -Wno-maybe-uninitialized)
  endif()
  if(KROT_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

# krot_cold(<target>)
#
# What runs once in a command is compiled in half of the time: no bit of a result
# differs.
function(krot_cold target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
endfunction()

# krot_precompiled_headers(<target> HOT|COLD|TEST)
#
# What nearly every source includes, parsed once by the first target of its
# kind: GCC's precompiled headers bring their level of optimisation with them.
# Not where the compiler is launched by a cache, which would not hold what is
# compiled so.
function(krot_precompiled_headers target kind)
  if(CMAKE_CXX_COMPILER_LAUNCHER OR NOT KROT_UNITY
     OR target STREQUAL krot_base)
    return()
  endif()
  get_target_property(type ${target} TYPE)
  if(CMAKE_POSITION_INDEPENDENT_CODE AND type STREQUAL EXECUTABLE
     AND NOT kind STREQUAL TEST)
    # The libraries' headers are compiled for a module, with -fPIC.
    set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
    target_compile_options(${target} PRIVATE -fPIC)
  endif()
  get_property(first GLOBAL PROPERTY KROT_PRECOMPILED_${kind})
  if(first)
    target_precompile_headers(${target} REUSE_FROM ${first})
    return()
  endif()
  set_property(GLOBAL PROPERTY KROT_PRECOMPILED_${kind} ${target})
  set(frameworks)
  if(kind STREQUAL TEST)
    set(frameworks <gmock/gmock.h> <gtest/gtest.h>)
  endif()
  target_precompile_headers(${target} PRIVATE
    <algorithm> <cmath> <cstdint> <functional> <limits> <map> <memory>
    <optional> <sstream> <string> <unordered_map> <utility> <vector>
    <Eigen/Core> <Eigen/Geometry> <Eigen/LU> <Eigen/SVD>
    ${frameworks})
endfunction()

# krot_native_kernel(<target> <file>...)
#
# Adds source files that are compiled for other vector units than the rest: for
# the machine's at hand with KROT_NATIVE, else on x86 once for each of
# krot/base/system.h, which chooses. They must have no Eigen type in their
# interface: vector flags would change their alignment and so the ABI. Nor may
# functions of one name be left in several of them: all of theirs are in a
# namespace KROT_UNITS, and Eigen is called KrotEigen_<units>.
function(krot_native_kernel target)
  set(units own)
  set(own_flags)
  if(KROT_NATIVE)
    include(CheckCXXCompilerFlag)
    check_cxx_compiler_flag(-march=native KROT_HAS_MARCH_NATIVE)
    if(KROT_HAS_MARCH_NATIVE)
      set(own_flags -march=native)
    endif()
  elseif(KROT_CHOOSES_UNITS)
    list(APPEND units avx2 avx512)
    set(avx2_flags -mavx2 -mfma)
    set(avx512_flags -mavx512f -mavx512dq -mavx512vl -mavx2 -mfma)
  endif()
  foreach(unit IN LISTS units)
    set(kernels ${target}_${unit})
    add_library(${kernels} OBJECT ${ARGN})
    krot_warnings(${kernels})
    target_include_directories(${kernels} PRIVATE ${PROJECT_SOURCE_DIR}/src)
    target_compile_definitions(${kernels}
      PRIVATE KROT_UNITS=${unit} Eigen=KrotEigen_${unit})
    # GCC 12 warns of what its own AVX-512 headers leave open on purpose.
    target_compile_options(${kernels} PRIVATE
      -O3 -fno-math-errno -fno-trapping-math ${${unit}_flags}
      $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
    if(MINGW)  # GCC aligns no stack of Windows to more than 16 bytes.
      target_compile_options(${kernels}
        PRIVATE -Wa,-muse-unaligned-vector-move)
    endif()
    target_link_libraries(${kernels} PRIVATE Eigen3::Eigen)
    set_target_properties(${kernels} PROPERTIES UNITY_BUILD OFF)
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${kernels}>)
    set_property(GLOBAL APPEND PROPERTY KROT_LIBRARIES ${kernels})
  endforeach()
endfunction()

# krot_test(<name> [SLOW filter] SOURCES file... DEPENDS target...)
#
# A GoogleTest executable whose every TEST is one CTest test, labelled quick for
# the daily round unless SLOW, a GoogleTest filter, names it. -Og compiles faster
# than -O1; the time of most tests is the library's. So does GCC without the
# collection of garbage.
function(krot_test name)
  cmake_parse_arguments(ARG "" "SLOW" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  krot_warnings(${name})
  target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-Og>
    $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1500000>)
  krot_precompiled_headers(${name} TEST)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name}
    PRIVATE ${ARG_DEPENDS} Eigen3::Eigen GTest::gmock GTest::gtest_main)
  set_target_properties(${name} PROPERTIES UNITY_BUILD_BATCH_SIZE 16
    RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  if(ARG_SLOW)
    gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST
      TEST_FILTER "${ARG_SLOW}" TEST_LIST ${name}_slow
      PROPERTIES TIMEOUT 600 LABELS slow)
  endif()
  if(NOT ARG_SLOW STREQUAL "*")
    gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST
      TEST_FILTER "-${ARG_SLOW}"
      PROPERTIES TIMEOUT 600 LABELS quick)
  endif()
endfunction()
