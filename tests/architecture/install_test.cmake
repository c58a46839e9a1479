# cmake -DBUILD_DIR= -DSCRATCH_DIR= -DCONSUMER_DIR= -DREFERENCE= -DMODEL=
#       -DGENERATOR= -DCXX_COMPILER= -DCXX_FLAGS= -P install_test.cmake
#
# Installs BUILD_DIR below SCRATCH_DIR, moves the prefix (packages are
# relocatable), builds CONSUMER_DIR against it, once as find_package and once as
# pkg-config says, and solves MODEL with both, compiles the examples of
# REFERENCE, then uninstalls and checks that no file is left.

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status
                  OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${status}:\n${output}")
  endif()
endfunction()

set(prefix ${SCRATCH_DIR}/prefix)
set(moved ${SCRATCH_DIR}/moved)
file(REMOVE_RECURSE ${SCRATCH_DIR})
file(MAKE_DIRECTORY ${SCRATCH_DIR})

# The build's own manifest, if any, belongs to somebody's real installation.
set(manifest ${BUILD_DIR}/install_manifest.txt)
if(EXISTS ${manifest})
  file(RENAME ${manifest} ${SCRATCH_DIR}/kept_manifest.txt)
endif()
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${prefix})
file(RENAME ${manifest} ${SCRATCH_DIR}/manifest.txt)
if(EXISTS ${SCRATCH_DIR}/kept_manifest.txt)
  file(RENAME ${SCRATCH_DIR}/kept_manifest.txt ${manifest})
endif()
file(RENAME ${prefix} ${moved})
run(${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${SCRATCH_DIR}/build
    -G ${GENERATOR} -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH=${moved}
    -DCMAKE_CXX_COMPILER=${CXX_COMPILER} -DCMAKE_CXX_FLAGS=${CXX_FLAGS})
run(${CMAKE_COMMAND} --build ${SCRATCH_DIR}/build)
run(${SCRATCH_DIR}/build/lower_largest_error ${MODEL} ${SCRATCH_DIR}/solved)

file(GLOB pc_file ${moved}/lib*/pkgconfig/krot.pc ${moved}/lib/*/pkgconfig/krot.pc)
get_filename_component(pc_dir ${pc_file} DIRECTORY)
execute_process(
  COMMAND ${CMAKE_COMMAND} -E env PKG_CONFIG_PATH=${pc_dir}
    pkg-config --cflags --libs krot
  OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE
  COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${CXX_FLAGS} ${flags}")
run(${CXX_COMPILER} ${CONSUMER_DIR}/lower_largest_error.cc
    -o ${SCRATCH_DIR}/by_pkg_config ${flags})
run(${SCRATCH_DIR}/by_pkg_config ${MODEL} ${SCRATCH_DIR}/solved_again)

# The reference's examples, one behind the other.
file(READ ${REFERENCE} rest)
set(examples "")
string(FIND "${rest}" "```cpp\n" begin)
while(NOT begin EQUAL -1)
  math(EXPR begin "${begin} + 7")
  string(SUBSTRING "${rest}" ${begin} -1 rest)
  string(FIND "${rest}" "```" end)
  string(SUBSTRING "${rest}" 0 ${end} example)
  string(APPEND examples "${example}\n")
  string(SUBSTRING "${rest}" ${end} -1 rest)
  string(FIND "${rest}" "```cpp\n" begin)
endwhile()
file(WRITE ${SCRATCH_DIR}/examples.cc "${examples}")
run(${CXX_COMPILER} -std=c++17 -fsyntax-only ${SCRATCH_DIR}/examples.cc
    ${flags})

# Uninstalling leaves no file behind.
file(RENAME ${moved} ${prefix})
run(${CMAKE_COMMAND} -DMANIFEST=${SCRATCH_DIR}/manifest.txt
    -P ${CMAKE_CURRENT_LIST_DIR}/../../cmake/Uninstall.cmake)
file(GLOB_RECURSE left ${prefix}/*)
if(left)
  message(FATAL_ERROR "uninstalling left behind: ${left}")
endif()
