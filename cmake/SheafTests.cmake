# SPDX-License-Identifier: Apache-2.0
# Tests of all kinds. They are listed in a manifest, from which tests/harness/register_tests.py makes
# the tests of ctest: which cases share a process, which are long, and their times.

if(SHEAF_BUILD_TESTS)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
endif()

# ctest leaves a file NAME.xml for each process of a GoogleTest program here.
set(SHEAF_TEST_REPORTS ${CMAKE_BINARY_DIR}/test_reports)

# sheaf_json_list(OUTPUT STRING ...)
function(sheaf_json_list output)
  set(quoted)
  foreach(text ${ARGN})
    string(REPLACE "\\" "\\\\" text "${text}")
    string(REPLACE "\"" "\\\"" text "${text}")
    list(APPEND quoted "\"${text}\"")
  endforeach()
  list(JOIN quoted ", " joined)
  set(${output} "[${joined}]" PARENT_SCOPE)
endfunction()

# sheaf_list_test(NAME name COMMAND ... LABEL fast|slow|integration CASES true|false
#                 [ENVIRONMENT A=b ...] [SCRIPT] [LAST] [OPTIONAL] [NEEDS fixture]
#                 [GIVES fixture] [SKIPPED regex])
#
# Adds an entry to the manifest. CASES: the command is a GoogleTest program. SCRIPT: it gets the label
# "script" too. LAST: it runs after all others. OPTIONAL: only where the program is built. SKIPPED:
# output of a test that did not run.
function(sheaf_list_test)
  cmake_parse_arguments(T "LAST;SCRIPT;OPTIONAL" "NAME;LABEL;CASES;NEEDS;GIVES;SKIPPED" "COMMAND;ENVIRONMENT"
    ${ARGN})
  list(GET T_COMMAND 0 program)
  if(program MATCHES "[.](py|sh|mjs)$")
    message(FATAL_ERROR "test ${T_NAME}: the command starts with the script ${program}, not with an "
      "interpreter; set the variable that names the interpreter above this test")
  endif()
  sheaf_json_list(command ${T_COMMAND})
  sheaf_json_list(environment ${T_ENVIRONMENT})
  string(TOLOWER "\"last\": ${T_LAST}, \"script\": ${T_SCRIPT}, \"optional\": ${T_OPTIONAL}, \
\"cases\": ${T_CASES}" flags)
  set_property(GLOBAL APPEND PROPERTY SHEAF_TESTS "{\"name\": \"${T_NAME}\", ${flags}, \
\"label\": \"${T_LABEL}\", \"needs\": \"${T_NEEDS}\", \"gives\": \"${T_GIVES}\", \
\"skipped\": \"${T_SKIPPED}\", \"environment\": ${environment}, \"command\": ${command}}")
endfunction()

# sheaf_compile_quickly(TARGET)
#
# Sources that only check others are compiled in two thirds of the time with -O1. The bits of
# floating-point results do not depend on it (cmake/SheafOptions.cmake).
function(sheaf_compile_quickly target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
endfunction()

# sheaf_add_test(NAME stability SOURCES ... DEPS ... [LABEL fast|slow|integration]
#                [LONG] [PRECOMPILED target] [PRECOMPILE <header.h> ...])
#
# Adds a GoogleTest program. LONG: only tests/run --all builds it, and tests/long_tests.md lists it.
# Its sources are joined (sheaf_join_sources). They reuse the precompiled headers of
# sheaf_test_support unless PRECOMPILED names another target or PRECOMPILE other headers. They are
# compiled with fewer optimisations than the libraries that they test (sheaf_compile_quickly).
function(sheaf_add_test)
  cmake_parse_arguments(T "LONG" "NAME;LABEL;PRECOMPILED" "SOURCES;DEPS;PRECOMPILE" ${ARGN})
  if(NOT T_LABEL)
    set(T_LABEL fast)
  endif()
  set(target sheaf_${T_NAME}_test)
  add_executable(${target} ${T_SOURCES})
  target_link_libraries(${target} PRIVATE ${T_DEPS} sheaf_test_support sheaf_temporary_folder
    sheaf_warnings GTest::gtest_main)
  sheaf_compile_quickly(${target})
  sheaf_join_sources(${target})
  if(T_PRECOMPILE)
    sheaf_precompile(${target} ${T_PRECOMPILE})
  elseif(T_PRECOMPILED AND SHEAF_JOIN_SOURCES)
    sheaf_reuse_precompiled(${target} ${T_PRECOMPILED})
  else()
    sheaf_precompile(${target} REUSE_FROM sheaf_test_support)
  endif()
  set(optional)
  if(T_LONG)
    set(optional OPTIONAL)
    set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL ON)
    set_property(GLOBAL APPEND PROPERTY SHEAF_LONG_TARGETS ${target})
  endif()
  sheaf_list_test(NAME ${T_NAME} CASES true LABEL ${T_LABEL} ${optional}
    COMMAND $<TARGET_FILE:${target}> ENVIRONMENT SHEAF_SOURCE=${PROJECT_SOURCE_DIR})
endfunction()

# sheaf_add_script_test(NAME one_image COMMAND ... LABEL integration [LAST] [NEEDS fixture]
#                       [GIVES fixture])
#
# Adds a test that runs the built programs, which it finds through SHEAF_BIN. It also gets the label
# "script". If the script uses Python's unittest, register_tests.py lists its cases.
function(sheaf_add_script_test)
  cmake_parse_arguments(T "LAST" "NAME;LABEL;NEEDS;GIVES" "COMMAND" ${ARGN})
  set(last)
  if(T_LAST)
    set(last LAST)
  endif()
  sheaf_list_test(NAME ${T_NAME} CASES false LABEL ${T_LABEL} SCRIPT COMMAND ${T_COMMAND}
    NEEDS "${T_NEEDS}" GIVES "${T_GIVES}" ${last} ENVIRONMENT
    SHEAF_BIN=${CMAKE_RUNTIME_OUTPUT_DIRECTORY} SHEAF_ARTEFACTS=${CMAKE_BINARY_DIR}/artefacts
    SHEAF_TIME_SCALE=${SHEAF_TEST_TIME_SCALE})
endfunction()

# sheaf_register_tests()
#
# Writes the manifest, and has ctest make its tests from it. Called once, last.
function(sheaf_register_tests)
  get_property(long_targets GLOBAL PROPERTY SHEAF_LONG_TARGETS)
  add_custom_target(long_tests DEPENDS ${long_targets})
  get_property(tests GLOBAL PROPERTY SHEAF_TESTS)
  list(JOIN tests ",\n" tests)
  set(manifest ${CMAKE_BINARY_DIR}/tests.json)
  file(GENERATE OUTPUT ${manifest} CONTENT "{\"launcher\": \"$<TARGET_FILE:sheaf_test_timer>\",
\"costs\": \"${CMAKE_BINARY_DIR}/test_costs.txt\", \"reports\": \"${SHEAF_TEST_REPORTS}\",
\"folder\": \"${CMAKE_BINARY_DIR}\", \"time_scale\": ${SHEAF_TEST_TIME_SCALE}, \"tests\": [
${tests}]}\n")
  set(listed ${CMAKE_BINARY_DIR}/listed_tests.cmake)
  set(include ${CMAKE_BINARY_DIR}/register_tests.cmake)
  file(WRITE ${include} "execute_process(COMMAND \"${Python3_EXECUTABLE}\"
  \"${PROJECT_SOURCE_DIR}/tests/harness/register_tests.py\" \"${manifest}\" \"${listed}\"
  RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR \"tests/harness/register_tests.py failed, see above\")
endif()
include(\"${listed}\")\n")
  set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY TEST_INCLUDE_FILES ${include})
endfunction()
