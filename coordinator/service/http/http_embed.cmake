# SPDX-License-Identifier: Apache-2.0
# Run by the build: writes the built files of dashboard/ into one C++ source, as bytes.
#   cmake -DPAGE_DIR=... -DFILES=a;b -DOUTPUT=... -P http_embed.cmake
cmake_policy(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/../../../cmake/EmbedBytes.cmake)
set(types
  "html=text/html\\; charset=utf-8"
  "css=text/css\\; charset=utf-8"
  "js=text/javascript\\; charset=utf-8"
  "svg=image/svg+xml"
  "txt=text/plain\\; charset=utf-8")

# A file that the page's build makes and no list names would be missing in the browser.
file(GLOB built RELATIVE ${PAGE_DIR} ${PAGE_DIR}/*)
foreach(name IN LISTS built)
  if(NOT name IN_LIST FILES)
    message(FATAL_ERROR "${PAGE_DIR}/${name} is not listed in dashboard/CMakeLists.txt")
  endif()
endforeach()

set(arrays "")
set(rows "")
set(index 0)
foreach(name IN LISTS FILES)
  sheaf_read_bytes(bytes ${PAGE_DIR}/${name})
  file(SHA256 ${PAGE_DIR}/${name} digest)
  get_filename_component(extension ${name} LAST_EXT)
  string(SUBSTRING ${extension} 1 -1 extension)
  set(content_type "")
  foreach(type IN LISTS types)
    if(type MATCHES "^${extension}=(.*)$")
      set(content_type "${CMAKE_MATCH_1}")
    endif()
  endforeach()
  if(content_type STREQUAL "")
    message(FATAL_ERROR
      "${name}: no content type is known for .${extension}; add it to http_embed.cmake")
  endif()
  string(APPEND arrays "constexpr unsigned char kBytes${index}[] = {\n${bytes}};\n")
  string(APPEND rows "    {\"${name}\", \"${content_type}\", \"${digest}\",\n"
                     "     Text(kBytes${index}, sizeof kBytes${index})},\n")
  math(EXPR index "${index} + 1")
endforeach()

file(WRITE ${OUTPUT}
"// Generated from dashboard/ by http_embed.cmake.
#include \"coordinator/service/http/server/http_page.h\"

namespace sheaf::coordinator {
namespace {

${arrays}
std::string_view Text(const unsigned char* bytes, size_t size_bytes) {
  return {reinterpret_cast<const char*>(bytes), size_bytes};
}

}  // namespace

std::span<const PageFile> PageFiles() {
  static const PageFile files[] = {
${rows}  };
  return files;
}

}  // namespace sheaf::coordinator
")
