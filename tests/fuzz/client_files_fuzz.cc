// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the recognition of scenes in other formats, and to the door of
// OpenColorIO as a config. Errors are statuses: the library's exceptions do not pass the door.
#include <string>

#include "cli/image/view_transform.h"
#include "cli/job/foreign_scene.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf::cli {

// The first byte selects the reader.
SHEAF_FUZZ_TARGET(client_files) {
  const uint8_t kind = testing::TakeByte(&bytes);
  if (kind % 2 == 0) {
    const absl::Status status = CheckSceneFormat("a.pbrt", std::string(bytes));
    if (!status.ok()) SHEAF_CHECK(absl::IsInvalidArgument(status));
    return;
  }
  const testing::MemoryFile config(bytes);
  const absl::StatusOr<ViewTransform> view =
      ViewTransform::Open({.config = config.Path(), .display = "", .view = "Raw"});
  if (view.ok()) SHEAF_CHECK(!view->view().empty());
}

}  // namespace sheaf::cli
