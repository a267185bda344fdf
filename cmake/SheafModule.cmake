# SPDX-License-Identifier: Apache-2.0
include(GoogleTest)

# sheaf_precompile(TARGET HEADER ...)
# Reads the headers once for all sources of the target, which need to be several for that to pay.
function(sheaf_precompile target)
  target_precompile_headers(${target} PRIVATE ${ARGN})
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    target_compile_options(${target} PRIVATE -fpch-preprocess)  # Or ccache would give up.
  endif()
endfunction()
# Sources of a module or test from which on headers that all of them have are read once.
set(SHEAF_PRECOMPILE_SOURCES_MIN 5)

# sheaf_join_sources(TARGET)
# Compiles several sources at a time, for targets of many short ones that all read the headers of
# gRPC and protobuf: a third of the time.
function(sheaf_join_sources target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 6)
endfunction()

# sheaf_add_module(NAME film HEADERS a.h ... SOURCES a.cc ... DEPS sheaf::base ... PRIVATE_DEPS ...
#                  TESTS a_test.cc ... TEST_DEPS ... LABEL fast PRECOMPILE <header.h> ...)
# Makes the library sheaf_NAME with alias sheaf::NAME and, where TESTS are given, one GoogleTest
# program sheaf_NAME_test whose cases ctest knows by name and label.
function(sheaf_add_module)
  cmake_parse_arguments(M "" "NAME;LABEL" "HEADERS;SOURCES;DEPS;PRIVATE_DEPS;TESTS;TEST_DEPS;PRECOMPILE" ${ARGN})
  set(target sheaf_${M_NAME})
  if(M_SOURCES)
    add_library(${target} STATIC ${M_SOURCES} ${M_HEADERS})
    target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
    target_link_libraries(${target} PUBLIC sheaf_numerics ${M_DEPS} PRIVATE sheaf_warnings ${M_PRIVATE_DEPS})
    list(LENGTH M_SOURCES source_count)
    if(M_PRECOMPILE)
      sheaf_precompile(${target} ${M_PRECOMPILE})
    elseif(source_count GREATER_EQUAL SHEAF_PRECOMPILE_SOURCES_MIN AND "sheaf::base" IN_LIST M_DEPS)
      sheaf_precompile(${target} <absl/status/statusor.h> <absl/strings/str_cat.h>)
    endif()
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

# sheaf_add_test(NAME stability SOURCES ... DEPS ... [LABEL fast|slow|integration] [TIMEOUT seconds]
#                [PRECOMPILE <header.h> ...])
function(sheaf_add_test)
  cmake_parse_arguments(T "" "NAME;LABEL;TIMEOUT" "SOURCES;DEPS;PRECOMPILE" ${ARGN})
  if(NOT T_LABEL)
    set(T_LABEL fast)
  endif()
  if(NOT T_TIMEOUT)
    set(T_TIMEOUT 300)
  endif()
  math(EXPR timeout "${T_TIMEOUT} * ${SHEAF_TEST_TIME_SCALE}")
  set(target sheaf_${T_NAME}_test)
  add_executable(${target} ${T_SOURCES})
  target_link_libraries(${target} PRIVATE ${T_DEPS} sheaf_warnings GTest::gmock GTest::gtest_main)
  list(LENGTH T_SOURCES source_count)
  if(T_PRECOMPILE)
    sheaf_precompile(${target} ${T_PRECOMPILE})
  elseif(source_count GREATER_EQUAL SHEAF_PRECOMPILE_SOURCES_MIN)
    sheaf_precompile(${target} <gtest/gtest.h> <gmock/gmock.h>)
  endif()
  gtest_discover_tests(${target} DISCOVERY_MODE PRE_TEST
    PROPERTIES LABELS ${T_LABEL} TIMEOUT ${timeout})
endfunction()
