# SPDX-License-Identifier: Apache-2.0
# The HTTP side: sheaf::coordinator_http. Included by CMakeLists.txt beside this file.
find_package(Boost 1.74 REQUIRED)   # Beast and Asio, headers only: the HTTP port

list(TRANSFORM sheaf_page_files PREPEND ${sheaf_page_dir}/ OUTPUT_VARIABLE page_paths)
set(page_source ${CMAKE_CURRENT_BINARY_DIR}/http_page_files.cc)
add_custom_command(OUTPUT ${page_source}
  COMMAND ${CMAKE_COMMAND} -DPAGE_DIR=${sheaf_page_dir} "-DFILES=${sheaf_page_files}"
          -DOUTPUT=${page_source} -P ${CMAKE_CURRENT_SOURCE_DIR}/http_embed.cmake
  DEPENDS sheaf_page ${page_paths} ${CMAKE_CURRENT_SOURCE_DIR}/http_embed.cmake
          ${PROJECT_SOURCE_DIR}/cmake/EmbedBytes.cmake
  COMMENT "Embedding the web page" VERBATIM)

sheaf_add_module(NAME coordinator_http
  HEADERS event_stream.h false_color.h http_api.h http_connection.h http_json.h http_message.h http_metrics.h http_page.h
          http_preview.h http_router.h http_server.h http_service.h http_watch.h picture_layer.h
  SOURCES event_stream.cc false_color.cc http_api.cc http_json.cc http_message.cc http_metrics.cc http_page.cc
          http_preview.cc http_refine.cc http_router.cc http_server.cc http_service.cc http_watch.cc picture_layer.cc
          ${page_source}
  DEPS sheaf::coordinator_view absl::status absl::statusor absl::time sheaf::film sheaf::image
  PRIVATE_DEPS sheaf::base sheaf::coordinator_core absl::strings absl::str_format Boost::headers
               nlohmann_json::nlohmann_json Threads::Threads
  TESTS event_stream_test.cc http_api_test.cc http_preview_test.cc http_router_test.cc
        http_server_test.cc http_watch_test.cc picture_layer_test.cc
)
# g++ 12 and 13 warn wrongly about the allocation of coroutine frames in Boost 1.74.
set_source_files_properties(http_server.cc PROPERTIES COMPILE_OPTIONS -Wno-mismatched-new-delete)

if(SHEAF_BUILD_TESTS)
  # A made-up farm behind the real page, for tests/page and for working on the page.
  add_executable(sheaf_page_server ${PROJECT_SOURCE_DIR}/tests/page/page_server.cc)
  target_link_libraries(sheaf_page_server PRIVATE sheaf::coordinator_http sheaf_warnings
    absl::strings)
endif()
