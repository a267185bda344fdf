// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Farm: the coordinator without its transports. It joins the scheduler (who renders what), the
// store (what must not be forgotten) and the merges (parts becoming pictures), and adds what those
// leave out: locks, the clock and one background thread.
//
// A result's way: AddResult checks it, writes it to the store, tells the scheduler, merges it, and
// only then returns its outcome, which is the acknowledgement. When a frame's last result is
// merged, the background thread develops the frame, writes the EXR, and notes that it is delivered.
//
// Locks, in the order they may be taken: a tile's reservation, that of preparing frames or a
// frame's mutex, the farm's mutex.
// The farm's mutex (scheduler and tables) is never held while a disk or a picture is worked on.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/steady_time.h"
#include "common/content/blob_store.h"
#include "common/content/verified_files.h"
#include "common/film/error/running_error.h"
#include "common/film/exr/resumed_picture.h"
#include "coordinator/core/frame_merge.h"
#include "coordinator/core/limits.h"
#include "coordinator/forecast/work_ahead.h"
#include "coordinator/scheduling/scheduler.h"
#include "coordinator/service/farm/scene_names.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/store/durability.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

struct FarmOptions {
  std::string state_directory;
  Durability durability = Durability::kPowerLoss;  // Of jobs and parts; pictures are durable.
  Limits limits;
  // Parts of delivered frames are kept for RefineJob while all parts together are no more than
  // this; then the oldest go.
  uint64_t kept_parts_bytes_max = uint64_t{20} << 30;
  // Small pictures of the ends of rounds; the oldest go beyond it.
  uint64_t round_previews_bytes_max = uint64_t{2} << 30;
  // Memory of unfinished tiles; beyond it tiles are merged when their last part has come.
  uint64_t merge_bytes_max = uint64_t{1} << 30;
  absl::Duration preview_interval_min =
      absl::Milliseconds(300);                    // Between two previews of a frame.
  uint64_t part_bytes_max = uint64_t{256} << 20;  // Of one result.
};

// A lease with what the worker needs to know of its frame.
struct LeaseGrant {
  Lease lease;
  std::string frame_digest;
  BlobDigest scene;
  FrameSettings settings;
};

// One result as it came in.
struct ResultReport {
  std::string frame_digest;
  PixelRect tile;
  SampleBlock block;
  TileCells cells;
  uint64_t lease_id = 0;
  std::string worker_id;
  BlobDigest digest;  // Of the part's bytes.
  uint64_t ray_count = 0;
  absl::Duration cpu_duration;
};
enum class ResultOutcome { kAccepted, kDuplicateEqual, kDuplicateMismatch, kSuperseded };

// How a job stands, for /metrics: sums and extremes over its frames and their rounds.
struct JobCurve {
  double samples = 0, cpu_seconds = 0, part_bytes = 0;
  double relative_mse = 0, predicted_relative_mse = 0;
  double ratio_sum = 0;  // relMSE over what was foretold.
  int prediction_count = 0;
};

// Thread safety: all members may be called from any thread.
class Farm : public FarmView {
 public:
  // Loads the state and starts the background thread.
  // Errors: those of SqliteJobStore::Open, BlobStore::Open and RoundPreviews::Open.
  static absl::StatusOr<std::unique_ptr<Farm>> Open(const FarmOptions& options);
  // The same with a store of another kind.
  static absl::StatusOr<std::unique_ptr<Farm>> Open(const FarmOptions& options,
                                                    std::unique_ptr<JobStore> store);
  ~Farm() override;

  BlobStore& blobs() { return *blobs_; }
  const FarmOptions& options() const { return options_; }

  // Stores and starts a job; job_id, numeric_profile and frame digests are filled in here. Returns
  // the id, also of the job that an equal request_id made before. Errors: those of
  // Scheduler::CheckJob; kInvalidArgument (a frame cannot go on from its picture);
  // kResourceExhausted (disk).
  absl::StatusOr<uint64_t> CreateJob(JobSpec spec, const std::string& request_id);
  // OK means: the job's end is durable. Nothing happens to a job that was cancelled. Errors:
  // kNotFound; kFailedPrecondition (it has ended otherwise); kUnavailable (the disk).
  absl::Status CancelJob(uint64_t job_id);

  // A paused job gets no new leases until it is resumed. Nothing happens to a job that is as it
  // shall be. OK means: it is durable. Errors: kNotFound; kFailedPrecondition (it has ended);
  // kUnavailable (the disk).
  absl::Status PauseJob(uint64_t job_id);
  absl::Status ResumeJob(uint64_t job_id);
  // Errors: also kInvalidArgument.
  absl::Status SetJobPriority(uint64_t job_id, int32_t priority);

  // Goes on with a job that succeeded, from the parts that are kept of it; what is not kept is
  // rendered again. Nothing happens where all of its frames are good enough. OK means: it is
  // durable. Errors: kNotFound; kFailedPrecondition (it has not succeeded); kInvalidArgument (fewer
  // samples than it has); kUnavailable, kResourceExhausted (the disk).
  absl::Status RefineJob(uint64_t job_id, const Refinement& refinement);

  // The version of a delivered frame's preview, which never changes again.
  static constexpr uint64_t kDeliveredPreviewVersion = uint64_t{1} << 32;

  struct SynchronizeAnswer {
    std::vector<LeaseGrant> leases;
    absl::Duration next_synchronize;
    absl::Duration lease_duration;
  };
  // Errors: those of Scheduler::Synchronize.
  absl::StatusOr<SynchronizeAnswer> Synchronize(const WorkerReport& report);

  // OK means: the outcome is durable.
  // Errors: kInvalidArgument (not a part of its key), kResourceExhausted (disk full), kUnavailable.
  absl::StatusOr<ResultOutcome> AddResult(const ResultReport& report, const std::string& bytes);

  // Path of a delivered EXR. Errors: kNotFound, kFailedPrecondition (not delivered yet, or damaged
  // on disk and being made again).
  absl::StatusOr<std::string> FindOutput(uint64_t job_id, int32_t frame_number) const;

  // FarmView.
  std::vector<JobView> ListJobs() const override;
  // The same with pilots.
  std::vector<JobView> ListJobsAndPilots() const;
  // Somebody waits for the job: a live pilot that nobody waits for is cancelled
  // (Limits::pilot_unasked_max).
  void NoteAsked(uint64_t job_id);
  absl::StatusOr<JobView> FindJob(const std::string& job_id) const override;
  // As ListJobs has it: without its frames. Errors: kNotFound.
  absl::StatusOr<JobView> FindJobAlone(const std::string& job_id) const;
  absl::StatusOr<std::vector<FailureView>> ListFailures(const std::string& job_id) const override;
  absl::StatusOr<RefinementPrices> PriceRefinement(
      const std::string& job_id, const std::vector<double>& target_errors) const override;
  std::vector<WorkerView> ListWorkers() const override;
  std::vector<MetricView> Metrics() const override;
  absl::StatusOr<PreviewView> Preview(const std::string& job_id, int32_t frame_number,
                                      const std::vector<std::string>& channels) const override;
  absl::StatusOr<PreviewView> Thumbnail(const std::string& job_id,
                                        int32_t frame_number) const override;
  absl::StatusOr<PreviewView> RoundPreview(const std::string& job_id, int32_t frame_number,
                                           int32_t round) const override;
  absl::Status Ready() const override;
  uint64_t ChangeCount() const override;
  uint64_t WaitForChange(uint64_t seen, absl::Duration timeout) const override;
  // Grows whenever a job has ended.
  uint64_t EndCount() const;
  // As WaitForChange, of EndCount.
  void WaitForEnd(uint64_t seen, absl::Duration timeout) const;

 private:
  // What the scheduler does not need to know of a job.
  struct JobAccount {
    absl::Time create_time;
    absl::Time end_time = absl::InfiniteFuture();
    SteadyTime ended = SteadyTime::InfiniteFuture();  // The same, where it was in this life.
    std::map<int32_t, DeliveredFrame> delivered;
    // By frame. Cells of the last round only, and only of frames that are not delivered.
    std::map<int32_t, std::vector<RoundRecord>> rounds;
    std::map<int32_t, absl::Duration> wall_before;  // By frame: before this start.
    absl::Duration job_wall_before;                 // Of the job as a whole.
  };
  // A frame between its first part and its delivery. Shared: an upload may still merge into a frame
  // whose job was just cancelled.
  struct OpenFrame {
    OpenFrame(FrameSpec frame_spec, const FrameTasks& tasks, MergeBudget* budget)
        : OpenFrame(std::move(frame_spec), tasks.grid(), tasks.SamplesOfCells(), budget) {}
    OpenFrame(FrameSpec frame_spec, CellGrid grid, std::vector<uint64_t> samples,
              MergeBudget* budget)
        : spec(std::move(frame_spec)),
          merge(spec, std::move(grid), std::move(samples), budget),
          error(merge.grid().tiles()) {}
    const FrameSpec spec;
    std::mutex mutex;  // Guards what follows, down to next_point_samples.
    FrameMerge merge;
    SteadyTime next_refresh_time = SteadyTime::InfinitePast();
    // Read when a tile is first built from it; guarded by `mutex`.
    std::optional<ResumedPicture> resumed;
    // Where the cell with the fewest samples has so many, a frame without rounds gets a point.
    uint64_t next_point_samples = kReplicateCount;
    RunningError error;
    // Guarded by the farm's mutex.
    double relative_mse = 0;
    uint64_t preview_version = 0;
  };
  using TileName = std::pair<std::string, std::pair<int32_t, int32_t>>;  // Frame digest, y0, x0.
  // Holds a tile's reservation: results of one tile are taken one at a time.
  class TileReservation;

  Farm(const FarmOptions& options, std::unique_ptr<JobStore> store,
       std::unique_ptr<BlobStore> blobs, std::unique_ptr<RoundPreviews> round_previews);

  // farm.cc
  absl::Status Load();
  // By frame: the samples that a picture, from which the frame goes on, has in each of its cells.
  using ResumedCounts = std::map<int32_t, std::vector<uint64_t>>;
  // Puts a job that the scheduler does not know into it, with what is durable of it: its delivered
  // frames, rounds and, where it is live, parts and what its frames go on from. Requires: mutex_ is
  // held; the job has an account.
  absl::Status RestoreJob(const StoredJob& job, const JobStore::LoadedParts* parts,
                          const ResumedCounts& resumed);
  absl::Status RestoreLiveJob(const StoredJob& job, const JobStore::LoadedParts& parts);
  void Changed() const;
  void NoteDisk(const absl::Status& status);
  // Requires: mutex_ is held, disk_status_ is an error.
  std::string WhyWritesWait() const;
  void NoteEndedJobs();
  void SettleEndedJobs();
  void SaveFailures();
  void EraseOpenFrames(uint64_t job_id);
  std::shared_ptr<OpenFrame> OpenFrameOf(const FrameId& id);
  // Makes OpenFrameOf cheap: takes the frame's memory before the farm's lock is held. Nothing
  // happens to a frame that has no tasks.
  void PrepareOpenFrame(const FrameId& id);

  // farm_results.cc
  absl::StatusOr<ResultOutcome> JudgeCovered(const ResultReport& report,
                                             const Scheduler::FoundTask& found);
  absl::Status RejectResult(const ResultReport& report, const std::string& why);
  absl::StatusOr<ResultOutcome> StoreResult(const ResultReport& report, const std::string& bytes,
                                            const Scheduler::FoundTask& found, FilmTile part);
  void MergeResult(OpenFrame* frame, const FrameId& id, uint32_t tile, CellPart part,
                   bool tile_complete);

  // farm_resume.cc
  // Errors: kInvalidArgument, kNotFound, kDataLoss: the frame cannot go on from its picture.
  absl::StatusOr<ResumedPicture> OpenResumed(const FrameSpec& spec, const CellGrid& grid) const;
  // Of those frames that go on from pictures. Errors: those of OpenResumed.
  absl::StatusOr<ResumedCounts> CountResumed(const std::vector<FrameSpec>& frames,
                                             const Partition& partition) const;
  // Gives the cells at least the samples that they have: after AddJob, before rounds. Then, before
  // other parts, puts those back that the pictures stand for. Both require: mutex_ is held.
  void RestoreResumed(uint64_t job_id, const ResumedCounts& resumed);
  void RestoreResumedParts(uint64_t job_id, const ResumedCounts& resumed);
  // The parts of a tile that the picture stands for; none where the frame goes on from none.
  // Requires: frame->mutex is held.
  absl::StatusOr<std::vector<CellPart>> ResumedParts(OpenFrame* frame, uint32_t tile) const;

  // farm_delivery.cc
  void RunBackground();
  void RefreshFrames();
  void DeliverFrames();
  absl::Status DeliverFrame(const FrameId& id);
  // Builds a tile from its parts on disk; parts that are damaged are given back for rendering.
  absl::Status RebuildTile(OpenFrame* frame, const FrameId& id, uint32_t tile);
  void RevokePart(const PartRow& row, const absl::Status& why);
  DeliveredFrame Account(const FrameId& id, const OpenFrame& frame) const;
  // DeliveredFrame::one_sequence_gain.
  double PriceOfErrorBars(const FrameId& id, const FrameSpec& spec) const;

  // farm_rounds.cc
  // Decides what follows the round that was just finished, and begins it. Returns whether the frame
  // is done. Requires: frame->mutex is held, all tiles are developed.
  absl::StatusOr<bool> FinishRound(OpenFrame* frame, const FrameId& id);
  // The record of what the frame's picture is now, with the errors of its cells; its decision is
  // still to be made. Requires: frame->mutex is held.
  RoundRecord RecordOf(const OpenFrame& frame, const FrameId& id,
                       const std::vector<ErrorSums>& errors) const;
  // Notes a point of the curve of a frame without rounds where one is due, or at its end. What
  // cannot be stored is left out. Requires: frame->mutex is held, the picture is refreshed.
  void NotePoint(OpenFrame* frame, const FrameId& id, bool ended);
  // next_point_samples after this point.
  static uint64_t NextPoint(const RoundRecord& last);
  void KeepPreview(const OpenFrame& frame, const FrameId& id, int32_t round);
  // Returns the frame's rounds. Requires: mutex_ is held.
  const std::vector<RoundRecord>& AddRound(const FrameId& id, RoundRecord record);
  // Requires: mutex_ is held; after AddJob, before the job's parts.
  absl::Status LoadRounds(const StoredJob& job);
  // Null where the frame was not rendered in rounds. Requires: mutex_ is held.
  const RoundRecord* LastRoundOf(const FrameId& id) const;
  // How live jobs stand, the oldest first. Requires: mutex_ is held.
  std::vector<std::pair<uint64_t, JobCurve>> LiveCurves(size_t count_max) const;
  // CPU seconds of workers, of each tile of a frame that is not delivered yet, with blanks between.
  std::string TileCpuSeconds(const FrameId& id) const;
  // Why the picture has its samples, and its errors on the way there.
  void AddRoundMetadata(const FrameId& id, FramePicture* picture) const;
  // Since the frame's first lease, in this life and earlier ones. Requires: mutex_ is held.
  absl::Duration WallOf(const FrameId& id, SteadyTime now) const;
  // The part of it in this life, of a frame or a job that was first leased then. Pauses and what
  // follows the job's end do not count. Requires: mutex_ is held.
  absl::Duration WallSince(uint64_t job_id, SteadyTime first_lease_time, SteadyTime now) const;
  // The same for the job. Requires: mutex_ is held.
  absl::Duration WallOfJob(const JobRecord& job, SteadyTime now) const;

  // farm_control.cc
  absl::Status SetPaused(uint64_t job_id, bool paused);
  // Errors: kNotFound. Requires: mutex_ is held.
  absl::StatusOr<const JobRecord*> FindRecord(uint64_t job_id) const;
  // Cancels pilots that nobody has asked for. Requires: mutex_ is held.
  void CancelForgottenPilots();

  // farm_price.cc
  absl::StatusOr<FinishedFrame> FinishedFrameOf(const FrameId& id, const FrameSpec& spec,
                                                const Partition& partition,
                                                const DeliveredFrame& delivered) const;

  // farm_refine.cc
  // Requires: mutex_ is held.
  static absl::Status RequireSucceeded(const JobRecord& job);
  absl::Status CheckRefinement(const JobRecord& job, const Refinement& refinement) const;
  // The job with all its frames, to be put into the scheduler again. Requires: mutex_ is held.
  StoredJob StoredJobOf(const JobRecord& record) const;
  // By frame.
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> RoundsOf(uint64_t job_id) const;
  // Goes on with these frames of a job that has ended. Requires: settle_mutex_ is held.
  absl::Status ReopenFrames(StoredJob job, const std::vector<JobStore::ReopenedFrame>& reopened);
  void LimitKeptParts();

  // farm_damage.cc
  // Which file of a scene is among the lost blobs, and what to do; empty: none.
  std::string LostFileOf(const BlobDigest& scene) const;
  // Holds the frames whose blobs are lost, and lets those go on whose blobs are there again.
  void HoldLostScenes();
  // Whether the EXR of a delivered frame is the picture that was delivered; else has it made again.
  // Errors: kFailedPrecondition.
  absl::Status CheckPicture(const FrameId& id, const std::string& path) const;
  void HealPictures();
  absl::Status RemakeFrames(uint64_t job_id, const std::set<int32_t>& numbers);

  // farm_preview.cc
  // A frame whose picture is asked for; open is null where it has no samples in memory.
  struct ShownFrame {
    FrameId id;
    PixelRect window;
    bool complete = false;
    std::shared_ptr<OpenFrame> open;
    uint64_t version = 0;
  };
  // kCpuChannel of the frame. Errors: kUnavailable (no part of it is kept).
  absl::StatusOr<FramePicture> CpuPicture(const ShownFrame& shown) const;
  // Errors: kNotFound.
  absl::StatusOr<ShownFrame> FindShown(const std::string& job_id, int32_t frame_number) const;
  // The shrunk picture of a delivered frame, beside its EXR. What cannot be written is not shown.
  void KeepThumbnail(const FrameId& id, const FramePicture& picture) const;
  absl::StatusOr<std::string> ThumbnailPath(const FrameId& id) const;

  // farm_views.cc, farm_workers.cc; all require the farm's mutex.
  JobView ViewOf(const JobRecord& job, bool with_frames, SteadyTime now) const;
  absl::StatusOr<JobView> FindView(const std::string& job_id, bool with_frames) const;
  std::vector<JobView> ListBelow(uint64_t job_id) const;
  FrameView ViewOf(const JobRecord& job, const FrameRecord& frame, bool with_spec,
                   SteadyTime now) const;
  WorkerView ViewOf(const WorkerRecord& worker) const;
  // A frame's samples; where a stop rule decides, as far as it is foreseen.
  uint64_t SamplesExpected(const FrameId& id, const FrameRecord& frame) const;
  // The work for the workers of a profile; some tenths of a second old.
  const FarmLoad& LoadOf(const std::string& numeric_profile, SteadyTime now) const;
  // For the samples that are left in progress, which is the job's or one of its frames'.
  void EstimateRemaining(const JobRecord& job, SteadyTime now, ProgressView* progress) const;

  const FarmOptions options_;
  const std::unique_ptr<JobStore> store_;
  const std::unique_ptr<BlobStore> blobs_;
  const std::unique_ptr<RoundPreviews> round_previews_;
  const std::string numeric_profile_;
  MergeBudget merge_budget_;
  mutable SceneNames scene_names_;

  mutable std::mutex mutex_;  // Guards everything down to loads_time_.
  Scheduler scheduler_;
  std::map<uint64_t, JobAccount> accounts_;
  std::map<FrameId, std::shared_ptr<OpenFrame>> open_frames_;
  std::deque<FrameId> to_deliver_;
  // Live pilots, and when somebody last asked for them.
  std::map<uint64_t, std::chrono::steady_clock::time_point> pilots_asked_;
  std::vector<uint64_t> unsettled_jobs_;        // Ended, but not yet written down.
  std::set<uint64_t> unsaved_failures_;         // Jobs with failures that are not yet written down.
  absl::Status disk_status_;                    // Of the last write.
  mutable std::set<FrameId> damaged_pictures_;  // Delivered, and to be made again.
  mutable uint64_t pictures_damaged_ = 0;       // So far.
  mutable std::map<std::string, FarmLoad> loads_;  // By numeric profile, as they were at
  mutable SteadyTime loads_time_;

  mutable VerifiedFiles pictures_;  // Delivered EXRs, by path.
  // The background thread's alone.
  std::map<std::string, BlobDigest> lost_blobs_;  // That live jobs need, by digest.
  SteadyTime next_lost_blobs_time_ = SteadyTime::InfinitePast();

  // One at a time writes down the end of jobs, so that who comes second waits until it is durable;
  // goes on with one; lets one wait; or removes parts of delivered frames.
  // Taken before mutex_.
  std::mutex settle_mutex_;

  // One frame's memory is taken at a time. Taken before mutex_.
  std::mutex prepare_mutex_;

  std::mutex reservation_mutex_;  // Guards reserved_.
  std::condition_variable reservation_released_;
  std::set<TileName> reserved_;

  mutable std::mutex change_mutex_;  // Guards change_count_ and end_count_.
  mutable std::condition_variable change_, end_;
  mutable uint64_t change_count_ = 1;
  uint64_t end_count_ = 0;

  std::mutex background_mutex_;  // Guards stopping_ and wake_.
  std::condition_variable background_wake_;
  bool stopping_ = false;
  bool wake_ = false;
  std::thread background_;  // Last: it uses everything above.
};

}  // namespace sheaf::coordinator
