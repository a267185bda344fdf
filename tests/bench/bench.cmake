# SPDX-License-Identifier: Apache-2.0
# Benchmarks that print figures; built with the tests, run by hand or by the slow tests.
add_executable(ray_rate_bench ${CMAKE_CURRENT_LIST_DIR}/ray_rate_bench.cc)
target_link_libraries(ray_rate_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf_warnings)
add_executable(memory_bench ${CMAKE_CURRENT_LIST_DIR}/memory_bench.cc)
target_link_libraries(memory_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf::image sheaf_warnings)
add_executable(texture_memory_bench ${CMAKE_CURRENT_LIST_DIR}/texture_memory_bench.cc)
target_link_libraries(texture_memory_bench PRIVATE sheaf::image sheaf::base sheaf_warnings)
add_executable(geometry_bench ${CMAKE_CURRENT_LIST_DIR}/geometry_bench.cc)
target_link_libraries(geometry_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf_warnings)
add_executable(many_lights_bench ${CMAKE_CURRENT_LIST_DIR}/many_lights_bench.cc)
target_link_libraries(many_lights_bench PRIVATE sheaf::render_sampling sheaf_warnings)
add_executable(variant_speed_bench ${CMAKE_CURRENT_LIST_DIR}/variant_speed_bench.cc)
target_link_libraries(variant_speed_bench PRIVATE sheaf::render sheaf::scene sheaf::film sheaf_warnings)
# Of the pictures of SHEAF_PUBLIC_SCENES alone: what times a busy machine measures is not judged.
sheaf_add_script_test(NAME variant_speed LABEL slow TIMEOUT 1500 COMMAND variant_speed_bench)
add_executable(volume_bench ${CMAKE_CURRENT_LIST_DIR}/volume_bench.cc)
target_link_libraries(volume_bench PRIVATE sheaf::render_volume absl::status absl::strings sheaf_warnings)
