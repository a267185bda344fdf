// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmView: the farm's present state as plain values, for code that displays it (the HTTP port). It
// hides gRPC, protobuf and locks; every call returns a consistent copy.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/film/error/rare_layers.h"
#include "common/film/film.h"
#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/policy/owner_bytes.h"
#include "coordinator/core/policy/usage.h"
#include "coordinator/forecast/refinement_price.h"

namespace sheaf::coordinator {

// Maximum pixels of a preview; larger images are averaged over squares of 2 x 2, 3 x 3 and so on.
inline constexpr int64_t kPreviewPixelCountMax = int64_t{1} << 21;
// Maximum pixels of a thumbnail.
inline constexpr int64_t kThumbnailPixelCountMax = int64_t{1} << 14;
// An additional channel of previews: CPU time per pixel in seconds, averaged over the tile; 0 if
// unknown.
inline constexpr char kCpuChannel[] = "cpu";
// Maximum number of leases and of scenes that are listed for one worker.
inline constexpr size_t kWorkerLeasesShownMax = 4;
inline constexpr size_t kWorkerScenesShownMax = 8;
// Maximum number of tasks that are set aside and listed for one frame.
inline constexpr size_t kSetAsideShownMax = 16;

// Progress of a frame or a job, and its cost.
struct ProgressView {
  uint64_t sample_count_done = 0;   // Pixel samples and light paths, merged and durable.
  uint64_t sample_count_total = 0;  // The expected total if a rule ends the frame.
  double relative_mse = 0;          // Estimated; 0 while unknown.
  uint64_t nonfinite_count = 0;
  uint64_t ray_count = 0;
  double cpu_seconds = 0;   // CPU time of workers for accepted results.
  double wall_seconds = 0;  // Since the first lease, including refinements.
  // Takes the farm's other jobs into account; negative while unknown.
  double remaining_seconds = -1;
  // The band that holds in 8 of 10 cases, and the time that would be left if no other job shared
  // the farm. Only for live jobs; negative while unknown.
  double remaining_low_seconds = -1, remaining_high_seconds = -1, remaining_alone_seconds = -1;
};

// A point of a frame's error curve: its state at the end of a round (sample_rounds.h), or in
// between for a frame without rounds.
struct RoundView {
  double relative_mse = 0;
  double relative_mse_upper = 0;      // Its upper confidence bound.
  double predicted_relative_mse = 0;  // For the next round; 0 in the last one.
  double prediction_ratio = 0;        // relative_mse over its prediction; 0 in the first round.
  uint64_t sample_count = 0;          // Camera samples so far; this and the next are sums.
  uint64_t ray_count = 0;
  double cpu_seconds = 0, wall_seconds = 0;
  uint64_t part_bytes = 0;
  uint64_t preview_version = 0;  // The version of RoundPreview(); 0: not kept.
};

// A task that is set aside: it failed too often, or a user set it aside.
struct SetAsideView {
  uint32_t task = 0;  // The number of its tile, by which it can be retried.
  std::string why;
  std::vector<TaskFailure> failures;  // None if a user set it aside.
};

struct FrameView {
  int32_t frame_number = 0;
  std::string scene_digest;       // Hex, of the manifest blob.
  uint64_t scene_size_bytes = 0;  // Size of the manifest blob.
  std::string frame_digest;       // Hex.
  FrameSettings settings;
  StopRule stop;
  BlobDigest resumed;                             // The EXR that the frame resumes; empty if none.
  StopReason stop_reason = StopReason::kSamples;  // Valid once complete, as are the next five.
  uint32_t tile_count = 0;
  uint32_t unreliable_tile_count = 0;         // Tiles with unreliable error estimates.
  std::vector<LayerCount> unreliable_layers;  // The causes, if the frame has layers.
  double flip = 0;                            // At delivery; 0 if unknown.
  double one_sequence_gain = 0;   // See OneSequenceGain; for frames without a stop rule.
  std::vector<RoundView> rounds;  // Ascending; empty without rounds, and in ListJobs.
  bool is_training = false;       // Whether its guiding field is still to be trained, though begun.
  bool complete = false;          // Whether the EXR is delivered.
  std::string incomplete;         // Why it ended without an image; empty otherwise.
  std::string
      waiting_reason;  // Says that it waits for another job's frame or for approval; or empty.
  // At most kSetAsideShownMax of set_aside_count; empty in ListJobs.
  std::vector<SetAsideView> set_aside;
  int32_t set_aside_count = 0;
  int32_t correction_count = 0;  // Deliveries with results later found false.
  std::string image_digest;      // Hex; empty until complete.
  std::string output_path;       // The delivered EXR; empty until complete.
  uint64_t preview_version = 0;  // Increases whenever Preview() changes.
  ProgressView progress;
};

// A frame with an image to show.
struct PreviewFrame {
  int32_t frame_number = 0;
  uint64_t preview_version = 0;
  bool complete = false;
};

// The states of the proto Job.State; names without its prefix.
enum class JobState { kQueued, kRunning, kPaused, kSucceeded, kFailed, kCancelled };
// Returns "queued", "running", "paused", "succeeded", "failed" or "cancelled".
const char* JobStateName(JobState state);
bool HasEnded(JobState state);

// A job that another one waits for.
struct DependencyView {
  std::string job_id;
  bool by_frame = false;  // Frame n waits for its frame n.
  std::string state;      // "done", "released", "waits", "has failed" and the like, for users.
};

struct JobView {
  std::string job_id;  // The resource name is "jobs/" + job_id.
  bool pilot = false;  // Rendered for a quote.
  std::string title;
  std::string owner;  // The user's name; "local" without certificates.
  std::string show;
  Requirements requirements;
  JobState state = JobState::kQueued;
  int32_t priority = 0;
  std::string numeric_profile;
  Partition partition;
  std::string failure;         // Reason for the failure; empty otherwise.
  std::string waiting_reason;  // Why the job makes no progress; empty otherwise.
  std::string warning;         // About its images, for users; mostly empty.
  int64_t failure_count = 0;   // Number of failed leases.
  bool pinned = false;         // Its stored data is not removed.
  // When its parts were removed to keep the disk free; InfiniteFuture: they were not.
  absl::Time parts_removed_time = absl::InfiniteFuture();
  absl::Time create_time;
  absl::Time end_time = absl::InfiniteFuture();  // InfiniteFuture while it has not ended.
  int32_t frame_count = 0;
  int32_t frame_complete_count = 0;
  int32_t frame_incomplete_count = 0;
  int32_t training_frame_count = 0;
  int32_t unapproved_frame_count = 0;  // Delivered after a first pass, and wait for approval.
  std::vector<DependencyView> dependencies;
  Deadline deadline;
  bool held = false;  // Nothing of it may be leased: it is paused, or waits for jobs or users.
  std::vector<EffectCost> effect_costs;  // Empty unless measured, and in ListJobs.
  ProgressView progress;                 // Sums over the frames.
  // The frame with most activity: the first one that is started but not complete, or else the last
  // complete one. None while no frame has an image.
  std::optional<PreviewFrame> preview_frame;
  std::vector<FrameView> frames;  // Ascending by number; empty in ListJobs.
};
// Updates job->preview_frame. Call for all frames in ascending order.
void NotePreviewFrame(const FrameView& frame, JobView* job);

// The states of the proto Worker.State.
enum class WorkerState { kIdle, kBusy, kDraining, kLost, kQuarantined, kStopped, kSick };
inline constexpr size_t kWorkerStateCount = 7;
// Returns "idle", "busy", "draining", "lost", "quarantined", "stopped" or "sick".
const char* WorkerStateName(WorkerState state);

// A lease that a worker holds.
struct LeaseView {
  FrameId frame;
  PixelRect tile;
  SampleBlock block;
  LeasePhase phase = LeasePhase::kQueued;
  absl::Time grant_time;
  TaskKind kind = TaskKind::kCamera;
};
// Returns "queued", "loading", "rendering" or "uploading".
const char* LeasePhaseName(LeasePhase phase);

struct WorkerView {
  std::string worker_id;
  std::string identity;  // Its certificate's common name, or its id.
  std::string host;
  WorkerState state = WorkerState::kIdle;
  int32_t thread_count = 0;
  WorkerTraits traits;
  std::string numeric_profile;
  int32_t lease_count = 0;
  uint64_t result_count = 0;
  double samples_per_second = 0;
  uint64_t lease_granted_count = 0;
  uint64_t lease_cold_count = 0;  // Those of scenes that it had to load first.
  absl::Time last_seen_time;
  std::string reason;  // Reason for the quarantine or sickness; empty otherwise.
  // An operator has drained it; it exits when it holds no lease.
  bool drained = false, exits = false;
  // At most kWorkerLeasesShownMax, in the order in which they are rendered.
  std::vector<LeaseView> leases;
  // File names of scenes in memory, at most kWorkerScenesShownMax of warm_scene_count.
  std::vector<std::string> warm_scenes;
  int32_t warm_scene_count = 0;
  uint64_t scene_memory_bytes = 0;  // 0: unknown.
};

// The cost of refining a job on the farm in its present state.
struct RefinementPrices {
  std::vector<RefinementPrice> prices;  // In the order of the targets.
  int32_t thread_count = 0;             // Threads of the workers that could render it.
  int32_t jobs_before_count = 0;        // Unfinished jobs of equal or higher priority.
};

// The setting of a user, a show or a pool, and the threads that it holds.
struct ShareView {
  ShareSubject subject;
  bool is_set = false;
  ShareSetting setting;
  int32_t job_count = 0;     // Unfinished.
  int64_t threads_held = 0;  // By its leases, as HeldThreads counts.
};

// A failed lease of a job.
struct FailureView {
  FailureRecord failure;
  std::string command;  // The command that renders the tile again on one machine.
};

// Items of one kind and job that are removed for one reason (coordinator/core/policy/retention.h).
struct RemovalView {
  std::string kind;    // "parts", "upload", "blob", "previews" or "job".
  std::string job_id;  // Empty: blobs and uploads.
  std::string reason = {};
  int64_t item_count = 0;
  uint64_t size_bytes = 0;
};

// One value for /metrics, in Prometheus' terms.
struct MetricView {
  enum class Kind { kCounter, kGauge, kHistogram };
  std::string name;  // "sheaf_results_accepted_total".
  std::string help;  // One sentence.
  Kind kind = Kind::kCounter;
  std::string label_name, label_value;  // Both empty if the metric has no label.
  double value = 0;
  // Further labels, in the order of their names in the text; label_name comes first.
  std::vector<std::pair<std::string, std::string>> more_labels = {};
  // For a histogram's values: "_bucket", "_sum" or "_count", after the name.
  std::string suffix = {};
};

// A condition for accepting work.
struct ReadyCondition {
  std::string name;     // "database", "disk" or "certificate".
  absl::Status status;  // OK, or why it fails and what to do.
};

// A user's stored bytes, and their limit.
struct StoredView {
  std::string user;
  OwnerBytes bytes;
  uint64_t bytes_max = UINT64_MAX;  // UINT64_MAX: none.
};

// The usage of jobs, and the bytes kept now.
struct UsageReport {
  std::vector<UsageSum> sums;
  std::vector<StoredView> stored;  // Ascending by user.
};

// The image so far.
struct PreviewView {
  uint64_t version = 0;  // The FrameView::preview_version of the image.
  // The requested channels, linear; pixels without samples are 0. The viewer applies the display
  // transform.
  FrameImage image;
  bool complete = false;
};

// The marks of a job's frames that a reader has seen, by index.
using FrameMarks = std::vector<size_t>;

// Thread safety: all functions may be called from any thread. They wait for short locks only,
// except WaitForChange, Preview (which copies planes of an image) and PriceRefinement.
class FarmView {
 public:
  virtual ~FarmView() = default;

  // Newest first, without frames; excludes pilots.
  virtual std::vector<JobView> ListJobs() const = 0;
  // With frames. Errors: kNotFound.
  virtual absl::StatusOr<JobView> FindJob(const std::string& job_id) const = 0;
  // Returns only the frames whose marks differ from these, and updates the marks. A frame's mark
  // changes if users would see a change other than elapsed time.
  virtual absl::StatusOr<JobView> FindJobChanges(const std::string& job_id,
                                                 FrameMarks* marks) const = 0;
  // The last failures of a job, newest first. Errors: kNotFound.
  virtual absl::StatusOr<std::vector<FailureView>> ListFailures(
      const std::string& job_id) const = 0;
  // Estimates the cost of refining a job until its frames reach each of these errors. Takes up to
  // some tenths of a second. Errors: kNotFound; kFailedPrecondition (the job has not succeeded);
  // kInvalidArgument (no target, more than kPricedTargetsMax, or one out of range).
  virtual absl::StatusOr<RefinementPrices> PriceRefinement(
      const std::string& job_id, const std::vector<double>& target_errors) const = 0;
  // Ascending by id.
  virtual std::vector<WorkerView> ListWorkers() const = 0;
  // All counters and gauges; values of the same name are adjacent.
  virtual std::vector<MetricView> Metrics() const = 0;
  // The image so far, in the given channels of FrameImage only, as copying all would take long.
  // kCpuChannel must be requested alone; it covers the stored parts of the frame. Errors: kNotFound
  // (no such frame); kUnavailable (no samples yet, or no stored parts); kInternal (no such
  // channel).
  virtual absl::StatusOr<PreviewView> Preview(const std::string& job_id, int32_t frame_number,
                                              const std::vector<std::string>& channels) const = 0;
  // R, G and B of the image so far, shrunk to kThumbnailPixelCountMax. Errors: kNotFound;
  // kUnavailable (no samples yet, or no stored thumbnail).
  virtual absl::StatusOr<PreviewView> Thumbnail(const std::string& job_id,
                                                int32_t frame_number) const = 0;
  // A small copy of the image at the end of a round (from 0), with the channels of all layers.
  // Errors: kNotFound (no such frame, or no stored preview).
  virtual absl::StatusOr<PreviewView> RoundPreview(const std::string& job_id, int32_t frame_number,
                                                   int32_t round) const = 0;
  // The coordinator accepts work if all of them hold. Looks at the file system.
  virtual std::vector<ReadyCondition> Conditions() const = 0;

  // Increases whenever anything above changes.
  virtual uint64_t ChangeCount() const = 0;
  // Returns ChangeCount() as soon as it differs from `seen`, or after `timeout`.
  virtual uint64_t WaitForChange(uint64_t seen, absl::Duration timeout) const = 0;
};

}  // namespace sheaf::coordinator
