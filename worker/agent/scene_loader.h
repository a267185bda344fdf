// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneLoader and LoadedScene: the agent's interface to the renderer. worker/service implements
// them with the content cache, the scene reader and worker/render.
#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

// A frame's scene, ready to render. Thread safety: const members may be called concurrently.
class LoadedScene {
 public:
  virtual ~LoadedScene() = default;
  virtual uint64_t memory_bytes() const = 0;
  // Renders the lease's task and encodes the part, with the lease's guiding field, which it fetches
  // the first time; or trains that field. Errors: kCancelled when stop was requested; kDataLoss if
  // files of the scene were changed on disk since it was loaded, or the field's bytes are none;
  // kUnavailable if the field could not be fetched; kAborted if the coordinator does not have it
  // any more, or the scene has another one; kResourceExhausted if memory ran out; any other is a
  // defect of the renderer. After any but kCancelled and kUnavailable the scene must be loaded
  // again.
  virtual absl::StatusOr<FinishedPart> Render(const Lease& lease, std::stop_token stop) const = 0;
};

// Either a scene, or the reason for its absence.
struct LoadResult {
  std::unique_ptr<const LoadedScene> scene;
  absl::Status status;                                // OK if and only if scene is set.
  FailureKind failure_kind = FailureKind::kInternal;  // The cause of a failure.
};

class SceneLoader {
 public:
  virtual ~SceneLoader() = default;
  // Fetches, reads and compiles. Thread safety: may be called concurrently.
  virtual LoadResult Load(const Lease& lease, std::stop_token stop) = 0;
};

}  // namespace sheaf::worker
