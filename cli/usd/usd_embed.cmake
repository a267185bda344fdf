# SPDX-License-Identifier: Apache-2.0
# Run by the build: writes the converter of USD into a C++ source file, as bytes.
#
#   cmake -DSCRIPT=... -DOUTPUT=... -P usd_embed.cmake
cmake_policy(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/../../cmake/EmbedBytes.cmake)

sheaf_read_bytes(bytes ${SCRIPT})
file(WRITE ${OUTPUT}
"// Generated from dashboard/ by usd_embed.cmake.
#include \"cli/usd/usd_scene.h\"

namespace sheaf::cli {
namespace {

constexpr unsigned char kBytes[] = {
${bytes}};

}  // namespace

std::string_view UsdScript() { return {reinterpret_cast<const char*>(kBytes), sizeof kBytes}; }

}  // namespace sheaf::cli
")
