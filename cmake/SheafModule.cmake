# SPDX-License-Identifier: Apache-2.0
include(GoogleTest)

# sheaf_precompile(TARGET HEADER ... | REUSE_FROM TARGET)
#
# Precompiles the headers for all sources of the target. This pays off for many sources only.
function(sheaf_precompile target)
  if(NOT ARGV1 STREQUAL REUSE_FROM)
    list(PREPEND ARGN PRIVATE)
  endif()
  target_precompile_headers(${target} ${ARGN})
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    target_compile_options(${target} PRIVATE -fpch-preprocess)  # Required by ccache.
  endif()
endfunction()

# sheaf_compile_quickly(TARGET)
#
# Sources that only check others are compiled in two thirds of the time with -O1. The bits of
# floating-point results do not depend on it (cmake/SheafOptions.cmake).
function(sheaf_compile_quickly target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
endfunction()

# sheaf_join_sources(TARGET)
#
# Compiles several sources together, so that headers are read and templates compiled once for all of
# them, in a third of the time. The sources of a target therefore may not define the same name
# internally. SHEAF_JOIN_SOURCES=OFF shows that each source compiles alone.
set(SHEAF_JOINED_SOURCES_MAX 8)
function(sheaf_join_sources target)
  if(SHEAF_JOIN_SOURCES AND NOT target IN_LIST SHEAF_UNJOINED_TARGETS)
    set_target_properties(${target} PROPERTIES
      UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${SHEAF_JOINED_SOURCES_MAX})
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
      # Members of unnamed types cause warnings unless they are in the compiled file itself.
      target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
    endif()
  endif()
endfunction()

# sheaf_add_module(NAME film HEADERS a.h ... SOURCES a.cc ... DEPS sheaf::base ... PRIVATE_DEPS ...
#                  TESTS a_test.cc ... TEST_DEPS ... LABEL fast)
#
# Adds the library sheaf_NAME with alias sheaf::NAME and, if TESTS are given, one GoogleTest program
# sheaf_NAME_test whose cases are registered with ctest by name and label.
function(sheaf_add_module)
  cmake_parse_arguments(M "" "NAME;LABEL" "HEADERS;SOURCES;DEPS;PRIVATE_DEPS;TESTS;TEST_DEPS" ${ARGN})
  set(target sheaf_${M_NAME})
  if(M_SOURCES)
    add_library(${target} STATIC ${M_SOURCES} ${M_HEADERS})
    target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
    target_link_libraries(${target} PUBLIC sheaf_numerics ${M_DEPS} PRIVATE sheaf_warnings ${M_PRIVATE_DEPS})
    sheaf_join_sources(${target})
  else()
    add_library(${target} INTERFACE)
    target_include_directories(${target} INTERFACE ${PROJECT_SOURCE_DIR})
    target_link_libraries(${target} INTERFACE sheaf_numerics ${M_DEPS})
  endif()
  add_library(sheaf::${M_NAME} ALIAS ${target})
  if(M_TESTS AND SHEAF_BUILD_TESTS)
    sheaf_add_test(NAME ${M_NAME} SOURCES ${M_TESTS} DEPS ${target} ${M_TEST_DEPS} LABEL ${M_LABEL})
  endif()
endfunction()

# ctest leaves a file SUITE.TEST.xml for each GoogleTest here.
set(SHEAF_TEST_REPORTS ${CMAKE_BINARY_DIR}/test_reports)

# sheaf_add_test(NAME stability SOURCES ... DEPS ... [LABEL fast|slow|integration] [TIMEOUT seconds]
#                [COST seconds] [PRECOMPILE <header.h> ...])
#
# Test sources are joined (sheaf_join_sources). They reuse the precompiled headers of
# sheaf_test_support unless PRECOMPILE names others. They are compiled with fewer optimisations than
# the libraries that they test (sheaf_compile_quickly). COST is about what each of the longest
# takes: ctest starts those first, and in a new build folder knows no other times.
function(sheaf_add_test)
  cmake_parse_arguments(T "" "NAME;LABEL;TIMEOUT;COST" "SOURCES;DEPS;PRECOMPILE" ${ARGN})
  if(NOT T_LABEL)
    set(T_LABEL fast)
  endif()
  if(NOT T_TIMEOUT)
    set(T_TIMEOUT 300)
  endif()
  if(NOT T_COST)
    set(T_COST 0)
  endif()
  math(EXPR timeout "${T_TIMEOUT} * ${SHEAF_TEST_TIME_SCALE}")
  set(target sheaf_${T_NAME}_test)
  add_executable(${target} ${T_SOURCES})
  target_link_libraries(${target} PRIVATE ${T_DEPS} sheaf_test_support sheaf_temporary_folder
    sheaf_warnings GTest::gtest_main)
  sheaf_compile_quickly(${target})
  sheaf_join_sources(${target})
  if(T_PRECOMPILE)
    sheaf_precompile(${target} ${T_PRECOMPILE})
  else()
    sheaf_precompile(${target} REUSE_FROM sheaf_test_support)
  endif()
  if(SHEAF_TEST_LINKER)
    target_link_options(${target} PRIVATE -fuse-ld=gold)
  endif()
  gtest_discover_tests(${target} DISCOVERY_MODE PRE_TEST XML_OUTPUT_DIR ${SHEAF_TEST_REPORTS}
    PROPERTIES LABELS ${T_LABEL} TIMEOUT ${timeout} COST ${T_COST})
endfunction()
