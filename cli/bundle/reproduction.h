// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reproduce: renders the task of a bundle as a worker would, and compares the outcome with the
// recorded one.
#pragma once

#include <stop_token>
#include <string>

#include "absl/status/statusor.h"
#include "cli/bundle/bundle_file.h"
#include "common/content/content_cache.h"
#include "coordinator/core/job/job.h"
#include "worker/sandbox/scene_opener.h"

namespace sheaf::cli {

enum class Ending {
  kRendered,
  kFailedAsRecorded,  // By the class of a recorded failure.
  kFailedOtherwise,
};
// "rendered", "failed as recorded", "failed otherwise".
const char* EndingName(Ending ending);

struct Reproduction {
  Ending ending = Ending::kRendered;
  worker::RenderedPart part;  // For a rendered task, with its digest.
  std::string part_sha256;
  // For a failed task: the class and message that the coordinator would record.
  coordinator::FailureKind kind = coordinator::FailureKind::kInternal;
  std::string message;
  // Whether a recorded failure has this class and message, numbers aside.
  bool same_message = false;
};

// Fetches the files of the scene into the cache, opens the scene, gives it its guiding field,
// renders the task, and checks the part as the coordinator does. A failure of any class is a
// result. Errors: kCancelled.
absl::StatusOr<Reproduction> Reproduce(const Bundle& bundle, ContentCache* cache,
                                       worker::SceneOpener* scenes,
                                       const worker::SceneLimits& limits, std::stop_token stop);

// Whether two messages are the same except for their numbers; a message that ends with "..." was
// cut.
bool IsSameMessage(const std::string& recorded, const std::string& message);

}  // namespace sheaf::cli
