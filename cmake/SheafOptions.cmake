# SPDX-License-Identifier: Apache-2.0
# Build-wide choices: language level, numeric flags, warnings, sanitizers.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()
# Checks are active in every build type: SHEAF_CHECK does not depend on NDEBUG.
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")

# With g++ 12, the compiler of Debian 12, without instrumentation: others warn of what it does not.
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION MATCHES "^12\\."
   AND CMAKE_BUILD_TYPE STREQUAL Release AND NOT SHEAF_SANITIZE AND NOT SHEAF_COVERAGE)
  set(CMAKE_COMPILE_WARNING_AS_ERROR ON CACHE BOOL "Warnings are errors")
endif()

option(SHEAF_BUILD_TESTS "Build the tests" ON)
option(SHEAF_JOIN_SOURCES "Compile several sources of a target at a time" ON)
set(SHEAF_UNJOINED_TARGETS "" CACHE STRING "Targets that compile each source alone nevertheless")
set(SHEAF_TEST_TIME_SCALE 1 CACHE STRING "What the time limits of tests are multiplied by")
set(SHEAF_SANITIZE "" CACHE STRING "Sanitizers, as for -fsanitize= (address,undefined or thread)")
set(SHEAF_VARIANTS "all" CACHE STRING
  "Variants of the renderer: all, or generic for builds that are made often, with the same images")
set(SHEAF_MARCH "x86-64-v3" CACHE STRING "Instruction set; part of the numeric profile")

find_program(SHEAF_CCACHE ccache)
if(SHEAF_CCACHE)
  # ccache looks objects up by the dependencies that the compiler reports, without a preprocessing
  # step, and also caches objects made with precompiled headers.
  set(CMAKE_CXX_COMPILER_LAUNCHER env CCACHE_DEPEND=1
    CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${SHEAF_CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${SHEAF_CCACHE})
endif()

# Flags that affect a pixel's bits: no contraction, no fast-math, one instruction set.
add_library(sheaf_numerics INTERFACE)
target_compile_options(sheaf_numerics INTERFACE
  -ffp-contract=off -fno-math-errno -march=${SHEAF_MARCH}
  "-ffile-prefix-map=${CMAKE_SOURCE_DIR}/=")

add_library(sheaf_warnings INTERFACE)
target_compile_options(sheaf_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wno-sign-conversion -Wshadow -Wnon-virtual-dtor -Wundef -Wno-restrict)

option(SHEAF_COVERAGE "Count the lines that run (tests/harness/coverage.py)" OFF)
if(SHEAF_COVERAGE)
  add_compile_options(--coverage -O1)
  add_link_options(--coverage)
endif()
if(SHEAF_SANITIZE)
  add_compile_options(-fsanitize=${SHEAF_SANITIZE} -fno-omit-frame-pointer -g1)
  add_link_options(-fsanitize=${SHEAF_SANITIZE})
endif()

# All programs in one folder, so that they find each other.
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
