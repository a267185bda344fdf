# SPDX-License-Identifier: Apache-2.0
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

# sheaf_join_sources(TARGET)
#
# Compiles several sources together, so that headers are read and templates compiled once for all of
# them, in a third of the time. The sources of a target therefore may not define the same name
# internally. SHEAF_JOIN_SOURCES=OFF shows that each source compiles alone.
set(SHEAF_JOINED_SOURCES_MAX 24)
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

# sheaf_reuse_precompiled(TARGET FROM)
#
# The target's sources read the headers that FROM has precompiled, in a quarter of their time. The
# options of both must match. Without joined sources, nothing is precompiled: each source shows that it
# includes what it needs.
function(sheaf_reuse_precompiled target from)
  if(SHEAF_JOIN_SOURCES)
    set_target_properties(${target} PROPERTIES PRECOMPILE_HEADERS_REUSE_FROM ${from})
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
      target_compile_options(${target} PRIVATE -fpch-preprocess)  # Required by ccache.
    endif()
  endif()
endfunction()

# sheaf_add_module(NAME film HEADERS a.h ... SOURCES a.cc ... DEPS sheaf::base ... PRIVATE_DEPS ...
#                  PRECOMPILED sheaf_headers TESTS a_test.cc ... TEST_DEPS ... LABEL fast
#                  TESTS_PRECOMPILED sheaf_test_support)
#
# Adds the library sheaf_NAME with alias sheaf::NAME and, if TESTS are given, one GoogleTest program
# sheaf_NAME_test (sheaf_add_test). PRECOMPILED: the target whose precompiled headers its sources read, or
# none. TESTS_PRECOMPILED: the same of its tests.
function(sheaf_add_module)
  cmake_parse_arguments(M "" "NAME;LABEL;PRECOMPILED;TESTS_PRECOMPILED" "HEADERS;SOURCES;DEPS;PRIVATE_DEPS;TESTS;TEST_DEPS" ${ARGN})
  set(target sheaf_${M_NAME})
  if(M_SOURCES)
    add_library(${target} STATIC ${M_SOURCES} ${M_HEADERS})
    target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
    target_link_libraries(${target} PUBLIC sheaf_numerics ${M_DEPS} PRIVATE sheaf_warnings ${M_PRIVATE_DEPS})
    sheaf_join_sources(${target})
    if(NOT M_PRECOMPILED)
      set(M_PRECOMPILED sheaf_headers)
    endif()
    if(NOT M_PRECOMPILED STREQUAL target AND NOT M_PRECOMPILED STREQUAL none)
      sheaf_reuse_precompiled(${target} ${M_PRECOMPILED})
    endif()
  else()
    add_library(${target} INTERFACE)
    target_include_directories(${target} INTERFACE ${PROJECT_SOURCE_DIR})
    target_link_libraries(${target} INTERFACE sheaf_numerics ${M_DEPS})
  endif()
  add_library(sheaf::${M_NAME} ALIAS ${target})
  if(M_TESTS AND SHEAF_BUILD_TESTS)
    if(M_PRECOMPILED STREQUAL sheaf_proto_headers AND NOT M_TESTS_PRECOMPILED)
      set(M_TESTS_PRECOMPILED sheaf_proto_test_headers)
    endif()
    sheaf_add_test(NAME ${M_NAME} SOURCES ${M_TESTS} DEPS ${target} ${M_TEST_DEPS} LABEL "${M_LABEL}"
      PRECOMPILED "${M_TESTS_PRECOMPILED}")
  endif()
endfunction()
