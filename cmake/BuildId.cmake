# SPDX-License-Identifier: Apache-2.0
# The build id: a name for what decides the bits of an image.
#
#     cmake -DSOURCE_DIR=... -DFOLDERS="a b" -DBUILD_WITH=... -DHEADER=... -P BuildId.cmake
#
# writes the header HEADER, which defines SHEAF_BUILD_ID: 12 hexadecimal digits of a digest over the
# sources in the folders (names below SOURCE_DIR and contents, without tests) and the text BUILD_WITH
# (compiler, flags, libraries). Equal sources in another folder have the same id. The header is left
# alone if it would stay the same, so that nothing is compiled again.

# sheaf_build_sources(VARIABLE ROOT FOLDER ...): the files that decide bits, sorted.
function(sheaf_build_sources variable root)
  set(sources)
  foreach(folder ${ARGN})
    file(GLOB_RECURSE found RELATIVE ${root}
      ${root}/${folder}/*.h ${root}/${folder}/*.cc ${root}/${folder}/*.in
      ${root}/${folder}/CMakeLists.txt)
    list(APPEND sources ${found})
  endforeach()
  list(FILTER sources EXCLUDE REGEX "_test\\.cc$")
  list(SORT sources)
  set(${variable} "${sources}" PARENT_SCOPE)
endfunction()

if(CMAKE_SCRIPT_MODE_FILE)
  sheaf_build_sources(sources ${SOURCE_DIR} ${FOLDERS})
  set(text "${BUILD_WITH}\n")
  foreach(source ${sources})
    file(SHA256 ${SOURCE_DIR}/${source} digest)
    string(APPEND text "${source} ${digest}\n")
  endforeach()
  string(SHA256 id "${text}")
  string(SUBSTRING ${id} 0 12 id)
  file(CONFIGURE OUTPUT ${HEADER} CONTENT "// Written by cmake/BuildId.cmake.
#pragma once
#define SHEAF_BUILD_ID \"${id}\"
")
endif()
