// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Plain values of the control flow: Job > Frame > Task > Lease. Known by core, store and service.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/time/time.h"
#include "common/base/steady_time.h"
#include "common/content/blob_digest.h"
#include "common/film/task_kind.h"
#include "common/film/tile_cells.h"
#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"
#include "coordinator/core/job/deadline.h"
#include "coordinator/core/job/job_holds.h"
#include "coordinator/core/job/requirements.h"
#include "coordinator/core/job/share_setting.h"
#include "coordinator/core/job/stop_rule.h"

namespace sheaf::coordinator {

// How frames are divided into tasks. Does not change pixels, except that tiles and cells do in
// frames whose samples are distributed by error.
struct Partition {
  int32_t tile_size_px = 32;
  uint64_t pass_sample_count = 16;  // A power of two.
  uint64_t lease_pass_count = 0;    // A power of two; 0 lets the coordinator choose.
  // Edge of the cells in frames whose samples are distributed by error; divides the tile's edge
  // (cell_grid.h). 0: chosen when the job is made; in jobs of earlier versions, the tile's edge.
  int32_t cell_size_px = 0;
};

struct FrameSpec {
  int32_t frame_number = 0;  // Unique in the job.
  BlobDigest scene;          // The manifest blob.
  FrameSettings settings;    // With a stop rule, `samples` is the maximum per pixel.
  StopRule stop;
  std::string frame_digest;  // Hex SHA-256 over scene, settings and numeric profile.
  // The EXR that the frame resumes (resumed_image.h); empty if there is none.
  BlobDigest resumed;
};

// The cost and the gain of an effect of a scene (see v1::EffectCost), measured by the submitter.
struct EffectCost {
  std::string name, problem, ablation;
  double time_fraction = 0, time_fraction_error = 0;
  double mean_change = 0, mean_change_error = 0;
  double relative_mse = 0, variance_ratio = 0;
  friend bool operator==(const EffectCost&, const EffectCost&) = default;
};

// The owner of jobs that were submitted without certificates.
inline constexpr char kLocalOwner[] = "local";

struct JobSpec {
  uint64_t job_id = 0;  // Given by the store, ascending.
  bool pilot = false;   // Rendered for a quote; has an id among those of pilots (IsPilot).
  std::string title;
  std::string owner = kLocalOwner;  // The user's name.
  std::string show = kDefaultShow;  // Its production; shows share the farm (fair_share.h).
  Requirements requirements;
  int32_t priority = 0;
  Partition partition;
  std::string numeric_profile;
  std::vector<FrameSpec> frames;         // Ascending by number.
  std::vector<EffectCost> effect_costs;  // For the first frame's scene; empty: not measured.
  std::vector<JobDependency> dependencies;
  std::map<int32_t, FrameApproval> approvals;  // By frame; empty: nothing waits for approval.
  Deadline deadline;
  std::string command;  // That submitted it, for users; may be empty.
};

// Ids of pilots begin here, so that those of other jobs have no gaps.
inline constexpr uint64_t kFirstPilotId = 1'000'000'001;
inline bool IsPilot(uint64_t job_id) { return job_id >= kFirstPilotId; }

enum class JobPhase { kLive, kSucceeded, kFailed, kCancelled };

// The cost of results.
struct ResultCost {
  uint64_t ray_count = 0;
  uint64_t nonfinite_count = 0;
  absl::Duration cpu_duration;
  uint64_t part_bytes = 0;

  void Add(const ResultCost& other) {
    ray_count += other.ray_count;
    nonfinite_count += other.nonfinite_count;
    cpu_duration += other.cpu_duration;
    part_bytes += other.part_bytes;
  }
};

// Names a frame. Frames of equal digest in different jobs are different frames.
struct FrameId {
  uint64_t job_id = 0;
  int32_t frame_number = 0;
  friend auto operator<=>(const FrameId&, const FrameId&) = default;
};

// One tile's block of samples, for some of its cells; a block of light passes; or the training.
struct Task {
  uint32_t tile = 0;  // A tile of the frame's CellGrid, which knows the kind of task.
  SampleBlock block;
  uint64_t cells = 1;  // Bit i: the tile's cell i (CellGrid). A tile that is one cell has bit 0.
  friend bool operator==(const Task&, const Task&) = default;
};

enum class LeasePhase { kQueued, kLoading, kRendering, kUploading };

struct Lease {
  uint64_t lease_id = 0;  // Unique, also over restarts.
  int32_t attempt = 0;    // Number of earlier leases of this task.
  FrameId frame;
  Task task;
  TaskKind kind = TaskKind::kCamera;
  PixelRect tile_rect;
  TileCells cells;   // The task's.
  BlobDigest field;  // The guiding field to render with; empty if the frame has none.
  std::string worker_id;
  std::string identity;  // The worker's.
  LeasePhase phase = LeasePhase::kQueued;
  SteadyTime grant_time;
  bool is_check = false;  // Its task is done; the result is compared. Workers are not told.
};

// Why a lease gave no result; each class has its own budget (limits.h). Stored as numbers: append
// new ones. kLost and kLoading: the worker vanished while it rendered, or loaded the scene.
// kInvalid: its result was refused.
enum class FailureKind {
  kReleased,
  kInfrastructure,
  kScene,
  kMemory,
  kInternal,
  kLost,
  kLoading,
  kInvalid
};
inline constexpr int kFailureKindCount = 8;
// Returns "released", "infrastructure", "scene", "memory", "internal", "lost", "loading" or
// "invalid".
const char* FailureKindName(FailureKind kind);
// How a worker failed, for people: "a crash", "lack of memory".
const char* FailureKindText(FailureKind kind);
// Whether the worker itself failed the task, so that it never gets it again: a crash, lack of
// memory or an invalid result.
bool IsOwnFailure(FailureKind kind);

// Light paths of a pass: one for each pixel of the whole frame, whatever the window.
int64_t PathsPerLightPass(const FrameSettings& settings);
// Paths for one more sample of each of the window's pixels: camera paths, and light paths if the
// frame has them.
uint64_t PathsPerSample(const FrameSettings& settings);

// Names work for people: "tile [0, 32) x [0, 32), samples [0, 16)", "light passes [0, 16)",
// "training".
std::string WorkText(TaskKind kind, const PixelRect& tile, SampleBlock block);

// The failure text of a job whose scene cannot be rendered. message: the worker's message. Clients
// recognize this text.
std::string SceneFailureText(int32_t frame_number, const std::string& message);
bool IsSceneFailure(std::string_view failure);

struct LeaseFailure {
  uint64_t lease_id = 0;
  FailureKind kind = FailureKind::kReleased;
  std::string message;
  std::string token = {};  // The proof that the lease is the sender's (lease_token.h).
  // For kInfrastructure: the size of the scene's files and the room in the worker's cache; 0:
  // another failure.
  uint64_t cache_needed_bytes = 0, cache_room_bytes = 0;
};

// A lease that gave no result, as shown to users.
struct FailureRecord {
  int32_t frame_number = 0;
  PixelRect tile;
  SampleBlock block;
  std::string worker_id;
  FailureKind kind = FailureKind::kInternal;
  std::string message;
  absl::Time time = absl::InfinitePast();  // InfinitePast until it is dated.
  TaskKind task_kind = TaskKind::kCamera;
  friend bool operator==(const FailureRecord&, const FailureRecord&) = default;
};

// How often a worker failed a task with one class of failure. For lost workers only the count is
// known: their id and identity are empty.
struct TaskFailure {
  std::string worker_id, identity;
  FailureKind kind = FailureKind::kInternal;
  int32_t count = 0;
  std::string words;  // The last message, for users.
  friend bool operator==(const TaskFailure&, const TaskFailure&) = default;
};

// Decides which workers may still render a task; durable. A block without samples stands for the
// whole frame.
struct TaskTrouble {
  FrameId frame;
  TaskKind kind = TaskKind::kCamera;
  PixelRect tile;
  SampleBlock block;
  TileCells cells;
  std::vector<TaskFailure> failures;
  std::string set_aside;  // Why it is set aside; empty if it is not.

  bool Empty() const { return failures.empty() && set_aside.empty(); }
  bool OfFrame() const { return block.count == 0; }
  friend bool operator==(const TaskTrouble&, const TaskTrouble&) = default;
};

// A job's failures that lost work: the last ones, oldest first, and their total number.
struct FailureLog {
  std::deque<FailureRecord> last;
  int64_t count = 0;
};

struct LeaseReport {
  uint64_t lease_id = 0;
  LeasePhase phase = LeasePhase::kQueued;
};

// A worker's report of itself.
struct WorkerReport {
  std::string worker_id;
  // The name accountable for the worker: the common name of its certificate. Without a certificate
  // it is empty, and the worker id takes its place (IdentityOf).
  std::string identity;
  std::string host;
  std::string numeric_profile;
  int32_t thread_count = 1;
  std::vector<LeaseReport> leases;
  std::vector<LeaseFailure> failures;
  int32_t requested_lease_count = 0;
  bool draining = false;
  std::vector<std::string> warm_scenes;  // Hex digests.
  uint64_t scene_memory_bytes = 0;       // Their memory; 0: not reported.
  WorkerTraits traits = {};
};

inline const std::string& IdentityOf(const WorkerReport& report) {
  return report.identity.empty() ? report.worker_id : report.identity;
}

// An identity that gets no work and whose results are refused, until an operator lifts that.
struct QuarantineRecord {
  std::string identity, reason;
  bool made_false_results = false;         // None of its results is believed.
  absl::Time time = absl::InfinitePast();  // InfinitePast until it is dated.
  friend bool operator==(const QuarantineRecord&, const QuarantineRecord&) = default;
};

}  // namespace sheaf::coordinator
