// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneOpener and OpenScene: how the files of a scene become something that renders. DirectScenes
// does it in this process, SandboxedScenes in a process per scene.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/memory_room.h"
#include "common/scene/settings/render_settings.h"
#include "common/volume/file_bytes.h"
#include "common/volume/volume_pages.h"
#include "worker/agent/work.h"

namespace sheaf::worker {

struct SceneLimits {
  uint64_t scene_memory_bytes_max = uint64_t{4} << 30;  // For one scene, read or compiled.
  uint64_t texture_memory_bytes_max = uint64_t{512} << 20;
  uint32_t build_threads = 0;   // 0: the machine's number of threads.
  uint32_t render_threads = 1;  // Tasks rendered at once; a training uses as many threads.
  uint64_t volume_memory_bytes_max = uint64_t{512} << 20;  // For pages of page files.
};

// Opens a file of a scene that is not there yet, by its canonical name: it is fetched. Thread
// safety: may be called concurrently. Errors: kNotFound if the scene has no such file; kCancelled
// after a request to stop; others if it cannot be fetched.
using OpenOnDemand = std::function<absl::StatusOr<volume::FileBytes>(const std::string& name,
                                                                     const std::stop_token& stop)>;

// All that a scene is made of.
struct SceneInputs {
  std::string main_file;                           // One of the files.
  std::map<std::string, std::string> local_paths;  // By canonical name, as in file_source.h.
  FrameSettings settings;
  SceneLimits limits;
  std::string manifest_sha256_hex = {};  // The manifest that lists the files; empty: unknown.
  OpenOnDemand open_on_demand = {};      // Valid as long as the scene; empty: all files are there.
  uint64_t on_demand_bytes = 0;          // The files that it opens take this.
};

// A part without its description, which its lease gives.
struct RenderedPart {
  std::string exr_bytes;  // The part, or the guiding field of a training.
  uint64_t ray_count = 0;
  double cpu_seconds = 0;
  // Pages of volumes: what the scene did with them since its last part, and what is in memory.
  volume::PageCounts pages = {};
  uint64_t page_bytes = 0;
};

// A compiled scene. Thread safety: const members may be called concurrently.
class OpenScene {
 public:
  virtual ~OpenScene() = default;
  virtual uint64_t memory_bytes() const = 0;
  // Gives the scene the guiding field that its tasks are rendered with. Once, before the first that
  // needs it. Errors: kDataLoss if the bytes are none of the scene; those of Render.
  virtual absl::Status SetField(std::string_view field, std::stop_token stop) const = 0;
  // Renders the lease's task and encodes the part, or trains the guiding field. Errors: kCancelled
  // when stop was requested; kResourceExhausted if memory ran out; any other is a defect of the
  // renderer. After an error other than kCancelled the scene may be unable to render.
  virtual absl::StatusOr<RenderedPart> Render(const Lease& lease, std::stop_token stop) const = 0;
};

// Either a scene, or the reason for its absence.
struct OpenResult {
  std::unique_ptr<const OpenScene> scene;
  absl::Status status;                                // OK if and only if scene is set.
  FailureKind failure_kind = FailureKind::kInternal;  // The cause of a failure.
};

class SceneOpener {
 public:
  virtual ~SceneOpener() = default;
  // Reads and compiles a scene, which must not outlive this. Thread safety: may be called
  // concurrently.
  virtual OpenResult Open(const SceneInputs& inputs, std::stop_token stop) = 0;
};

}  // namespace sheaf::worker
