# SPDX-License-Identifier: Apache-2.0
# Run by the build: writes the built page of a study into a C++ source file, as bytes.
#
#   cmake -DPAGE=... -DOUTPUT=... -P study_embed.cmake
cmake_policy(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/../../cmake/EmbedBytes.cmake)

sheaf_read_bytes(bytes ${PAGE})
file(WRITE ${OUTPUT}
"// Generated from dashboard/ by study_embed.cmake.
#include \"cli/study/study_page.h\"

namespace sheaf::cli {
namespace {

constexpr unsigned char kBytes[] = {
${bytes}};

}  // namespace

std::string_view StudyPageTemplate() {
  return {reinterpret_cast<const char*>(kBytes), sizeof kBytes};
}

}  // namespace sheaf::cli
")
