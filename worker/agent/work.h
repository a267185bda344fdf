// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The messages between worker and coordinator, as plain values. worker/service converts them to
// messages of proto/sheaf/v1/worker.proto, which defines the meaning of each field.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "common/content/blob_digest.h"
#include "common/content/cache_shortage.h"
#include "common/film/task_kind.h"
#include "common/film/tile_cells.h"
#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::worker {

// A right to a task for a limited time.
struct Lease {
  uint64_t lease_id = 0;  // Never reused, even across restarts of the coordinator.
  int32_t attempt = 0;
  std::string frame_name;
  std::string frame_digest;
  PixelRect tile;
  SampleBlock block;
  TileCells cells;
  TaskKind kind = TaskKind::kCamera;
  BlobDigest scene;  // The manifest's digest.
  FrameSettings settings;
  std::string token;  // Goes back with the result or the failure.
  BlobDigest field;   // The guiding field to render with; empty where there is none.
};

enum class LeasePhase { kQueued, kLoading, kRendering, kUploading };
struct LeaseReport {
  uint64_t lease_id = 0;
  LeasePhase phase = LeasePhase::kQueued;
  friend bool operator==(const LeaseReport&, const LeaseReport&) = default;
};

enum class FailureKind { kReleased, kInfrastructure, kScene, kMemory, kInternal };
struct LeaseFailure {
  uint64_t lease_id = 0;
  FailureKind kind = FailureKind::kInternal;
  std::string message;
  std::string token = {};       // The lease's.
  CacheShortage shortage = {};  // For kInfrastructure: that the scene does not fit into the cache.
  friend bool operator==(const LeaseFailure&, const LeaseFailure&) = default;
};

// Properties and state of the worker: the request of Synchronize.
struct WorkerState {
  std::string worker_id, host, numeric_profile;
  int32_t thread_count = 0;
  std::vector<LeaseReport> leases;
  std::vector<LeaseFailure> failures;
  int32_t requested_lease_count = 0;
  bool draining = false;
  std::vector<std::string> warm_scenes;
  uint64_t scene_memory_bytes = 0;  // Total size of those.
  std::string pool;                 // Empty: the default one.
  std::vector<std::string> tags;
  uint64_t memory_bytes = 0;  // That it gives to scenes.
};

// The leases that the coordinator wants it to hold: the reply.
struct DesiredState {
  std::vector<Lease> leases;
  std::chrono::milliseconds next_synchronize{1000};
  std::chrono::milliseconds lease_duration{30'000};
  bool exit = false;        // An operator drained the worker, and it holds nothing: it ends.
  bool deliveries = false;  // Small results may be delivered with the worker's state, in one call.
};

// A rendered task, encoded and ready to be sent, repeatedly if needed.
struct FinishedPart {
  uint64_t lease_id = 0;
  std::string frame_digest;
  PixelRect tile;
  SampleBlock block;
  TileCells cells;
  TaskKind kind = TaskKind::kCamera;
  std::string exr_bytes;  // The part, or the guiding field of a training.
  BlobDigest digest;      // Digest of exr_bytes.
  BlobDigest field;       // The lease's.
  uint64_t ray_count = 0;
  double cpu_seconds = 0;
  std::string token;  // The lease's.
};

enum class UploadOutcome { kAccepted, kDuplicateEqual, kDuplicateMismatch, kSuperseded };

// The answer to results that came with the worker's state: one outcome for each.
struct Delivery {
  std::vector<UploadOutcome> outcomes;
  DesiredState desired;
};

}  // namespace sheaf::worker
