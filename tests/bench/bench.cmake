# SPDX-License-Identifier: Apache-2.0
# Benchmarks that print measurements, run by hand or by long tests: target "benches".
add_executable(ray_rate_bench ${CMAKE_CURRENT_LIST_DIR}/ray_rate_bench.cc)
target_link_libraries(ray_rate_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf_warnings)
add_executable(memory_bench ${CMAKE_CURRENT_LIST_DIR}/memory_bench.cc)
target_link_libraries(memory_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf::image sheaf_warnings)
add_executable(texture_memory_bench ${CMAKE_CURRENT_LIST_DIR}/texture_memory_bench.cc)
target_link_libraries(texture_memory_bench PRIVATE sheaf::image sheaf::base sheaf_warnings)
add_executable(geometry_bench ${CMAKE_CURRENT_LIST_DIR}/geometry_bench.cc)
target_link_libraries(geometry_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf_warnings)
add_executable(many_lights_bench ${CMAKE_CURRENT_LIST_DIR}/many_lights_bench.cc)
target_link_libraries(many_lights_bench PRIVATE sheaf::render_light sheaf_warnings)
add_executable(variant_speed_bench ${CMAKE_CURRENT_LIST_DIR}/variant_speed_bench.cc)
target_link_libraries(variant_speed_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf_warnings)
# Only compares the images of SHEAF_PUBLIC_SCENES: times measured on a busy machine are not judged.
sheaf_add_script_test(NAME variant_speed LABEL slow
  COMMAND $<TARGET_FILE:variant_speed_bench> --images-only)
add_executable(volume_bench ${CMAKE_CURRENT_LIST_DIR}/volume_bench.cc)
target_link_libraries(volume_bench PRIVATE sheaf::render_medium absl::status absl::strings sheaf_warnings)
add_executable(fog_light_bench ${CMAKE_CURRENT_LIST_DIR}/fog_light_bench.cc)
target_link_libraries(fog_light_bench PRIVATE sheaf::render sheaf::film GTest::gtest sheaf_warnings)
add_executable(majorant_bench ${CMAKE_CURRENT_LIST_DIR}/majorant_bench.cc)
target_link_libraries(majorant_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf_warnings)
add_executable(paged_volume_bench ${CMAKE_CURRENT_LIST_DIR}/paged_volume_bench.cc)
target_link_libraries(paged_volume_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf_warnings)
add_executable(part_bench ${CMAKE_CURRENT_LIST_DIR}/part_bench.cc)
target_link_libraries(part_bench PRIVATE sheaf::film sheaf_warnings)
add_executable(completions_bench ${CMAKE_CURRENT_LIST_DIR}/completions_bench.cc)
target_link_libraries(completions_bench PRIVATE sheaf::coordinator_server sheaf::enrolment
  sheaf::synthetic_worker GTest::gtest_main sheaf_warnings)
add_executable(connections_bench ${CMAKE_CURRENT_LIST_DIR}/connections_bench.cc)
target_link_libraries(connections_bench PRIVATE sheaf::coordinator_server sheaf::enrolment
  sheaf::synthetic_worker sheaf_warnings)
add_executable(similarity_bench ${CMAKE_CURRENT_LIST_DIR}/similarity_bench.cc)
target_link_libraries(similarity_bench PRIVATE sheaf::render sheaf::film GTest::gtest sheaf_warnings)
add_executable(light_samples_bench ${CMAKE_CURRENT_LIST_DIR}/light_samples_bench.cc)
target_link_libraries(light_samples_bench PRIVATE sheaf::render sheaf::film GTest::gtest sheaf_warnings)
add_executable(store_bench ${CMAKE_CURRENT_LIST_DIR}/store_bench.cc)
target_link_libraries(store_bench PRIVATE sheaf::coordinator_store sheaf_warnings)
add_executable(discrepancy_bench ${CMAKE_CURRENT_LIST_DIR}/discrepancy_bench.cc)
target_link_libraries(discrepancy_bench PRIVATE sheaf::render_sampling sheaf_warnings)
add_executable(learned_lights_bench ${CMAKE_CURRENT_LIST_DIR}/learned_lights_bench.cc)
target_link_libraries(learned_lights_bench PRIVATE
  sheaf::render sheaf::scene sheaf::film sheaf_warnings)
set(benches
  ray_rate_bench memory_bench texture_memory_bench geometry_bench many_lights_bench
  variant_speed_bench volume_bench fog_light_bench majorant_bench paged_volume_bench part_bench
  completions_bench connections_bench similarity_bench light_samples_bench store_bench
  discrepancy_bench learned_lights_bench)
set_target_properties(${benches} PROPERTIES EXCLUDE_FROM_ALL ON)
add_custom_target(benches DEPENDS ${benches})
