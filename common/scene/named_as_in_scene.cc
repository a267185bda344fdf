// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/named_as_in_scene.h"

#include "absl/strings/str_replace.h"

namespace sheaf {

absl::Status NamedAsInScene(const absl::Status& status, const std::string& local_path,
                            const std::string& canonical_name) {
  if (status.ok()) return status;
  return absl::Status(status.code(), absl::StrReplaceAll(std::string(status.message()),
                                                         {{local_path, canonical_name}}));
}

}  // namespace sheaf
