// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PlainNames: names of image files for OpenImageIO's cache, which takes a '?' for the beginning of
// options and <UDIM> or %(UDIM)d for one of several files.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sheaf {

class PlainNames {
 public:
  PlainNames() = default;
  ~PlainNames();  // Removes the links.
  PlainNames(const PlainNames&) = delete;
  PlainNames& operator=(const PlainNames&) = delete;

  // The path, or a link to it in a temporary folder if its name could mean something else. Errors:
  // kFailedPrecondition if there can be no link.
  absl::StatusOr<std::string> Of(const std::string& path);

 private:
  std::string folder_;  // Empty: no link has been needed.
  int link_count_ = 0;
};

}  // namespace sheaf
