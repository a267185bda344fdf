// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/openimageio/plain_names.h"

#include <stdlib.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace fs = std::filesystem;

PlainNames::~PlainNames() {
  std::error_code ignored;  // Links left in a temporary folder are no error.
  if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

absl::StatusOr<std::string> PlainNames::Of(const std::string& path) {
  if (path.find_first_of("?<%") == std::string::npos) return path;
  const auto failed = [&path](const std::string& why) {
    return absl::FailedPreconditionError(
        absl::StrCat(path,
                     ": its name has a meaning for OpenImageIO, and there can be no link to "
                     "it in a temporary folder: ",
                     why, "; rename it, or set TMPDIR"));
  };
  if (folder_.empty()) {
    const char* const parent = std::getenv("TMPDIR");
    std::string folder = absl::StrCat(parent == nullptr || parent[0] == '\0' ? "/tmp" : parent,
                                      "/sheaf-images-XXXXXX");
    if (folder.find_first_of("?<%") != std::string::npos) return failed("TMPDIR has such a name");
    if (::mkdtemp(folder.data()) == nullptr) return failed(folder);
    folder_ = folder;
  }
  const std::string extension = fs::path(path).extension().string();
  const std::string link =
      absl::StrCat(folder_, "/", ++link_count_,
                   extension.find_first_of("?<%") == std::string::npos ? extension : std::string());
  std::error_code error;
  fs::create_symlink(fs::absolute(path, error), link, error);
  if (error) return failed(error.message());
  return link;
}

}  // namespace sheaf
