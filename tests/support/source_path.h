// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SourcePath: files of the repository that tests read.
#pragma once

#include <cstdlib>
#include <string>

namespace sheaf::testing {

// ctest says where the repository is, by SHEAF_SOURCE; by hand, programs are run there.
inline std::string SourcePath(const std::string& name) {
  const char* folder = std::getenv("SHEAF_SOURCE");
  return folder == nullptr ? name : std::string(folder) + "/" + name;
}

}  // namespace sheaf::testing
