# cmake -DBUILD_DIR= -DSCRATCH_DIR= -DEXAMPLES_DIR= -DREFERENCE= -DMODEL=
#       -DGENERATOR= -DCXX_COMPILER= -DCXX_FLAGS= -P install_test.cmake
#
# Installs BUILD_DIR below SCRATCH_DIR and checks what a program sees of it, moves
# the prefix (packages are relocatable), builds EXAMPLES_DIR against it as
# find_package says and one of them as pkg-config does, runs them with MODEL,
# compiles the examples of REFERENCE, then uninstalls and checks that no file is
# left.

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

# One archive, and the headers of the public face alone.
file(GLOB_RECURSE headers RELATIVE ${prefix}/include ${prefix}/include/*)
list(LENGTH headers num_headers)
if(num_headers EQUAL 0 OR num_headers GREATER 14)
  message(FATAL_ERROR "${num_headers} headers are installed: ${headers}")
endif()
foreach(header IN LISTS headers)
  if(NOT header MATCHES "^krot/[a-z_]+\\.h$")
    message(FATAL_ERROR "${header} is installed, which is not public")
  endif()
endforeach()
file(GLOB_RECURSE archives RELATIVE ${prefix} ${prefix}/*.a)
if(NOT archives MATCHES "^lib[^;]*/libkrot\\.a$")
  message(FATAL_ERROR "instead of libkrot.a alone, installed are ${archives}")
endif()

file(RENAME ${prefix} ${moved})
run(${CMAKE_COMMAND} -S ${EXAMPLES_DIR} -B ${SCRATCH_DIR}/build
    -G ${GENERATOR} -DCMAKE_BUILD_TYPE=None -DCMAKE_PREFIX_PATH=${moved}
    -DCMAKE_CXX_COMPILER=${CXX_COMPILER} -DCMAKE_CXX_FLAGS=${CXX_FLAGS})
# The project may have a module of its own for what KROT needs, as COLMAP 3.8 has.
file(WRITE ${SCRATCH_DIR}/modules/FindSQLite3.cmake "set(SQLite3_FOUND TRUE)\n")
run(${CMAKE_COMMAND} -S ${EXAMPLES_DIR} -B ${SCRATCH_DIR}/own_module
    -G ${GENERATOR} -DCMAKE_BUILD_TYPE=None -DCMAKE_PREFIX_PATH=${moved}
    -DCMAKE_CXX_COMPILER=${CXX_COMPILER} -DCMAKE_CXX_FLAGS=${CXX_FLAGS}
    -DCMAKE_MODULE_PATH=${SCRATCH_DIR}/modules)
run(${CMAKE_COMMAND} --build ${SCRATCH_DIR}/build)
set(examples ${SCRATCH_DIR}/build)
set(certificate ${SCRATCH_DIR}/certificate.json)
run(${BUILD_DIR}/krot solver --input_path ${MODEL}
    --output_path ${SCRATCH_DIR}/by_command --certificate_path ${certificate})
run(${examples}/solve_folder ${MODEL} ${SCRATCH_DIR}/solved)
foreach(file images points3D)
  run(${CMAKE_COMMAND} -E compare_files ${SCRATCH_DIR}/solved/${file}.bin
      ${SCRATCH_DIR}/by_command/${file}.bin)
endforeach()
run(${examples}/arrays)
run(${examples}/triangulate_point)
run(${examples}/check_certificate ${MODEL} ${certificate})
execute_process(COMMAND ${examples}/progress ${MODEL}
  OUTPUT_VARIABLE output COMMAND_ERROR_IS_FATAL ANY)
if(NOT output MATCHES "ended early")
  message(FATAL_ERROR "the cancelled solve went on:\n${output}")
endif()
run(${examples}/find_wrong ${MODEL} ${SCRATCH_DIR}/cured)

file(GLOB pc_file ${moved}/lib*/pkgconfig/krot.pc ${moved}/lib/*/pkgconfig/krot.pc)
get_filename_component(pc_dir ${pc_file} DIRECTORY)
execute_process(
  COMMAND ${CMAKE_COMMAND} -E env PKG_CONFIG_PATH=${pc_dir}
    pkg-config --cflags --libs krot
  OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE
  COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${CXX_FLAGS} ${flags}")
run(${CXX_COMPILER} ${EXAMPLES_DIR}/solve_folder.cc
    -o ${SCRATCH_DIR}/by_pkg_config ${flags})
run(${SCRATCH_DIR}/by_pkg_config ${MODEL} ${SCRATCH_DIR}/solved_again)

# The reference's examples, one behind the other.
file(READ ${REFERENCE} rest)
set(code "")
string(FIND "${rest}" "```cpp\n" begin)
while(NOT begin EQUAL -1)
  math(EXPR begin "${begin} + 7")
  string(SUBSTRING "${rest}" ${begin} -1 rest)
  string(FIND "${rest}" "```" end)
  string(SUBSTRING "${rest}" 0 ${end} example)
  string(APPEND code "${example}\n")
  string(SUBSTRING "${rest}" ${end} -1 rest)
  string(FIND "${rest}" "```cpp\n" begin)
endwhile()
file(WRITE ${SCRATCH_DIR}/reference.cc "${code}")
run(${CXX_COMPILER} -std=c++17 -fsyntax-only ${SCRATCH_DIR}/reference.cc
    ${flags})

# Uninstalling leaves no file behind.
file(RENAME ${moved} ${prefix})
run(${CMAKE_COMMAND} -DMANIFEST=${SCRATCH_DIR}/manifest.txt
    -P ${CMAKE_CURRENT_LIST_DIR}/../../cmake/Uninstall.cmake)
file(GLOB_RECURSE left ${prefix}/*)
if(left)
  message(FATAL_ERROR "uninstalling left behind: ${left}")
endif()
