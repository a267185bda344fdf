# SPDX-License-Identifier: Apache-2.0
# Run by the build: writes a built file of dashboard/ into a C++ source file, as a function of
# sheaf::cli that returns its bytes.
#
#   cmake -DTEXT=FILE -DHEADER=cli/... -DFUNCTION=NAME -DOUTPUT=FILE -P embed_text.cmake
#
# HEADER declares the function.
cmake_policy(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/EmbedBytes.cmake)

sheaf_read_bytes(bytes ${TEXT})
file(WRITE ${OUTPUT}
"// Generated from dashboard/ by embed_text.cmake.
#include \"${HEADER}\"

namespace sheaf::cli {
namespace {

constexpr unsigned char kBytes[] = {
${bytes}};

}  // namespace

std::string_view ${FUNCTION}() {
  return {reinterpret_cast<const char*>(kBytes), sizeof kBytes};
}

}  // namespace sheaf::cli
")
