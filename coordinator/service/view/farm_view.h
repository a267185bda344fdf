// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmView: the farm's present state as plain values, for code that shows it to people (the HTTP
// side). It hides gRPC, protobuf and locks; every call returns a consistent copy.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/film/error/rare_layers.h"
#include "common/film/film.h"
#include "common/film/tile_geometry.h"
#include "common/scene/settings/render_settings.h"
#include "coordinator/core/job.h"
#include "coordinator/forecast/refinement_price.h"

namespace sheaf::coordinator {

// Pixels of a preview at most; larger images are averaged over squares of 2x2, 3x3 and so on.
inline constexpr int64_t kPreviewPixelCountMax = int64_t{1} << 21;
// Pixels of a frame's image among many.
inline constexpr int64_t kThumbnailPixelCountMax = int64_t{1} << 14;
// A channel of previews that images do not have: CPU time that a pixel took, seconds, the mean
// over its tile; 0 where nothing is known.
inline constexpr char kCpuChannel[] = "cpu";
// The most leases and scenes of one worker that are shown.
inline constexpr size_t kWorkerLeasesShownMax = 4;
inline constexpr size_t kWorkerScenesShownMax = 8;

// How far something is and what it took.
struct ProgressView {
  uint64_t sample_count_done = 0;   // Pixel samples merged and durable.
  uint64_t sample_count_total = 0;  // As many as are expected, where a frame stops by itself.
  double relative_mse = 0;          // Estimated; 0 until it can be told.
  uint64_t nonfinite_count = 0;
  uint64_t ray_count = 0;
  double cpu_seconds = 0;   // CPU time of workers, on accepted results.
  double wall_seconds = 0;  // Since the first lease, refinements included.
  // With what the farm's other jobs take until then; negative until it can be told.
  double remaining_seconds = -1;
};

// A point of a frame's curve: how it stood at the end of a round (sample_rounds.h), or on the way
// of a frame without rounds.
struct RoundView {
  double relative_mse = 0;
  double relative_mse_upper = 0;      // Its upper confidence bound.
  double predicted_relative_mse = 0;  // For the next round, as foretold; 0 at the last.
  double prediction_ratio = 0;        // relative_mse over what was foretold; 0 at the first.
  uint64_t sample_count = 0;          // Pixel samples so far; this and the following are sums.
  uint64_t ray_count = 0;
  double cpu_seconds = 0, wall_seconds = 0;
  uint64_t part_bytes = 0;
  uint64_t preview_version = 0;  // The version that RoundPreview() shows; 0: none is kept.
};

struct FrameView {
  int32_t frame_number = 0;
  std::string scene_digest;       // Hex, of the manifest blob.
  uint64_t scene_size_bytes = 0;  // The manifest blob's.
  std::string frame_digest;       // Hex.
  FrameSettings settings;
  StopRule stop;
  BlobDigest resumed;  // The EXR that it resumes; empty where there is none.
  StopReason stop_reason = StopReason::kSamples;  // Once complete; this and the next five.
  uint32_t tile_count = 0;
  uint32_t unreliable_tile_count = 0;         // With errors that are not to be trusted.
  std::vector<LayerCount> unreliable_layers;  // The causes, where the frame has layers.
  double flip = 0;                            // As delivered; 0 where it cannot be told.
  double one_sequence_gain = 0;               // OneSequenceGain, for frames without a stop rule.
  std::vector<RoundView> rounds;  // Ascending; empty where there are none, and in ListJobs.
  bool complete = false;          // The EXR is delivered.
  int32_t correction_count = 0;   // How often it was delivered with results found false later.
  std::string image_digest;       // Hex; empty until complete.
  std::string output_path;        // The delivered EXR; empty until complete.
  uint64_t preview_version = 0;   // Grows whenever Preview() would show something new.
  ProgressView progress;
};

// A frame that has an image to show.
struct PreviewFrame {
  int32_t frame_number = 0;
  uint64_t preview_version = 0;
  bool complete = false;
};

// The states of proto Job.State, by the same names without prefix.
enum class JobState { kQueued, kRunning, kPaused, kSucceeded, kFailed, kCancelled };
// Returns "queued", "running", "paused", "succeeded", "failed" or "cancelled".
const char* JobStateName(JobState state);
bool HasEnded(JobState state);

struct JobView {
  std::string job_id;  // The resource name is "jobs/" + job_id.
  bool pilot = false;  // Rendered for a quote.
  std::string title;
  JobState state = JobState::kQueued;
  int32_t priority = 0;
  std::string numeric_profile;
  Partition partition;
  std::string failure;         // Why it failed; empty otherwise.
  std::string waiting_reason;  // Why nothing happens; empty otherwise.
  std::string warning;         // What its users should know of its images; mostly empty.
  int64_t failure_count = 0;   // Leases that came to nothing.
  absl::Time create_time;
  absl::Time end_time = absl::InfiniteFuture();  // InfiniteFuture until it has ended.
  int32_t frame_count = 0;
  int32_t frame_complete_count = 0;
  std::vector<EffectCost> effect_costs;  // Empty where nobody measured them, and in ListJobs.
  ProgressView progress;                 // Sums over the frames.
  // That shows most life: the first that is begun and not complete, or the last complete one. None
  // while there is nothing to see.
  std::optional<PreviewFrame> preview_frame;
  std::vector<FrameView> frames;  // Ascending by number; empty in ListJobs.
};
// Frames are told in ascending order.
void NotePreviewFrame(const FrameView& frame, JobView* job);

// The states of proto Worker.State.
enum class WorkerState { kIdle, kBusy, kDraining, kLost, kQuarantined, kStopped };
inline constexpr size_t kWorkerStateCount = 6;
// Returns "idle", "busy", "draining", "lost", "quarantined" or "stopped".
const char* WorkerStateName(WorkerState state);

// A lease that a worker holds.
struct LeaseView {
  FrameId frame;
  PixelRect tile;
  SampleBlock block;
  LeasePhase phase = LeasePhase::kQueued;
  absl::Time grant_time;
};
// Returns "queued", "loading", "rendering" or "uploading".
const char* LeasePhaseName(LeasePhase phase);

struct WorkerView {
  std::string worker_id;
  std::string identity;  // Who answers for it: its certificate's common name, or itself.
  std::string host;
  WorkerState state = WorkerState::kIdle;
  int32_t thread_count = 0;
  std::string numeric_profile;
  int32_t lease_count = 0;
  uint64_t result_count = 0;
  double samples_per_second = 0;
  absl::Time last_seen_time;
  std::string reason;  // Why it is quarantined; empty otherwise.
  // At most kWorkerLeasesShownMax, what is rendered first.
  std::vector<LeaseView> leases;
  // File names of the scenes in its memory, at most kWorkerScenesShownMax of warm_scene_count.
  std::vector<std::string> warm_scenes;
  int32_t warm_scene_count = 0;
  uint64_t scene_memory_bytes = 0;  // 0: not known.
};

// The cost of refining a job, on the farm as it is now.
struct RefinementPrices {
  std::vector<RefinementPrice> prices;  // In the order of the targets.
  int32_t thread_count = 0;             // Threads of workers that would render it.
  int32_t jobs_before_count = 0;        // Not finished, and of no lower priority.
};

// A lease of a job that came to nothing.
struct FailureView {
  FailureRecord failure;
  std::string command;  // Renders the tile again on one machine.
};

// One number for /metrics, in Prometheus' terms.
struct MetricView {
  enum class Kind { kCounter, kGauge };
  std::string name;  // "sheaf_results_accepted_total".
  std::string help;  // One sentence.
  Kind kind = Kind::kCounter;
  std::string label_name, label_value;  // Both empty where the metric has no label.
  double value = 0;
};

// The image so far.
struct PreviewView {
  uint64_t version = 0;  // FrameView::preview_version that it shows.
  // The channels that were asked for, linear; pixels without samples are 0. The display transform
  // is the viewer's business.
  FrameImage image;
  bool complete = false;
};

// Thread safety: all functions may be called from any thread. None waits longer than for a short
// lock but WaitForChange, Preview (which copies planes of an image) and PriceRefinement.
class FarmView {
 public:
  virtual ~FarmView() = default;

  // Newest first, without their frames and without pilots.
  virtual std::vector<JobView> ListJobs() const = 0;
  // With its frames. Errors: kNotFound.
  virtual absl::StatusOr<JobView> FindJob(const std::string& job_id) const = 0;
  // The last failures of a job, newest first. Errors: kNotFound.
  virtual absl::StatusOr<std::vector<FailureView>> ListFailures(
      const std::string& job_id) const = 0;
  // The cost of refining a job until its frames are at each of these errors. Takes up to some
  // tenths of a second. Errors: kNotFound; kFailedPrecondition (it has not succeeded);
  // kInvalidArgument (no target, more than kPricedTargetsMax, or one out of range).
  virtual absl::StatusOr<RefinementPrices> PriceRefinement(
      const std::string& job_id, const std::vector<double>& target_errors) const = 0;
  // Ascending by id.
  virtual std::vector<WorkerView> ListWorkers() const = 0;
  // All counters and gauges; those of one name are adjacent.
  virtual std::vector<MetricView> Metrics() const = 0;
  // The image so far in the given channels of FrameImage alone: copying all would take long.
  // kCpuChannel comes alone, as far as parts of the frame are kept.
  // Errors: kNotFound (no such frame); kUnavailable (no sample is there yet, or no part is kept);
  // kInternal (no such channel).
  virtual absl::StatusOr<PreviewView> Preview(const std::string& job_id, int32_t frame_number,
                                              const std::vector<std::string>& channels) const = 0;
  // R, G and B of the image so far, shrunk to kThumbnailPixelCountMax. Errors: kNotFound;
  // kUnavailable (no sample is there yet, or none was kept).
  virtual absl::StatusOr<PreviewView> Thumbnail(const std::string& job_id,
                                                int32_t frame_number) const = 0;
  // The image as it was at the end of a round, from 0, shrunk; with the channels of all layers.
  // Errors: kNotFound (no such frame, or none is kept).
  virtual absl::StatusOr<PreviewView> RoundPreview(const std::string& job_id, int32_t frame_number,
                                                   int32_t round) const = 0;
  // Whether the coordinator accepts work: state is loaded and the disk takes writes. Otherwise why
  // not (kUnavailable or kResourceExhausted).
  virtual absl::Status Ready() const = 0;

  // Grows whenever anything above changes.
  virtual uint64_t ChangeCount() const = 0;
  // Returns ChangeCount() as soon as it differs from `seen`, at the latest after `timeout`.
  virtual uint64_t WaitForChange(uint64_t seen, absl::Duration timeout) const = 0;
};

}  // namespace sheaf::coordinator
