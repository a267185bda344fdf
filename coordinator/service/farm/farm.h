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
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "common/content/blob_store.h"
#include "common/content/verified_files.h"
#include "common/film/error/running_error.h"
#include "common/film/exr/resumed_picture.h"
#include "coordinator/core/frame_merge.h"
#include "coordinator/core/limits.h"
#include "coordinator/forecast/work_ahead.h"
#include "coordinator/scheduling/scheduler.h"
#include "coordinator/service/farm/farm_options.h"
#include "coordinator/service/farm/open_frame.h"
#include "coordinator/service/farm/scene_names.h"
#include "coordinator/service/view/farm_view.h"
#include "coordinator/store/durability.h"
#include "coordinator/store/job_store.h"
#include "coordinator/store/round_previews.h"

namespace sheaf::coordinator {

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
  // An open frame and how it stands, as of its last refresh.
  struct OpenEntry {
    std::shared_ptr<OpenFrame> frame;
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
  // By frame: its tiles of which parts are on disk.
  using TilesOnDisk = std::map<FrameId, std::set<uint32_t>>;
  // Puts a job that the scheduler does not know into it, with what is durable of it: its delivered
  // frames, rounds and, where it is live, parts and what its frames go on from. Requires: the job
  // has an account.
  absl::Status RestoreJob(const StoredJob& job, const JobStore::LoadedParts* parts,
                          const ResumedCounts& resumed) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status RestoreLiveJob(const StoredJob& job, const JobStore::LoadedParts& parts,
                              TilesOnDisk on_disk) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Changed() const;
  void NoteDisk(const absl::Status& status);
  // Requires: disk_status_ is an error.
  std::string WhyWritesWait() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void NoteEndedJobs() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void SettleEndedJobs();
  void SaveFailures() ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
  void EraseOpenFrames(uint64_t job_id);
  std::shared_ptr<OpenFrame> OpenFrameOf(const FrameId& id, const std::set<uint32_t>& on_disk = {})
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The frame where it can be opened and is not; null otherwise.
  const FrameRecord* ToOpen(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
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
  // other parts, puts those back that the pictures stand for.
  void RestoreResumed(uint64_t job_id, const ResumedCounts& resumed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  TilesOnDisk RestoreResumedParts(uint64_t job_id, const ResumedCounts& resumed)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The parts of a tile that the picture stands for; none where the frame goes on from none.
  absl::StatusOr<std::vector<CellPart>> ResumedParts(OpenFrame* frame, uint32_t tile) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);

  // farm_delivery.cc
  void RunBackground();
  void RefreshFrames();
  void DeliverFrames();
  absl::Status DeliverFrame(const FrameId& id);
  // Builds a tile from its parts on disk; parts that are damaged are given back for rendering.
  absl::Status RebuildTile(OpenFrame* frame, const FrameId& id, uint32_t tile)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);
  void RevokePart(const PartRow& row, const absl::Status& why);
  DeliveredFrame Account(const FrameId& id, const OpenFrame& frame) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame.mutex);
  // DeliveredFrame::one_sequence_gain.
  double PriceOfErrorBars(const FrameId& id, const FrameSpec& spec) const;

  // farm_rounds.cc
  // Decides what follows the round that was just finished, and begins it. Returns whether the frame
  // is done. Requires: all tiles are developed.
  absl::StatusOr<bool> FinishRound(OpenFrame* frame, const FrameId& id)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);
  // The record of what the frame's picture is now, with the errors of its cells; its decision is
  // still to be made.
  RoundRecord RecordOf(const OpenFrame& frame, const FrameId& id,
                       const std::vector<ErrorSums>& errors) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame.mutex);
  // Notes a point of the curve of a frame without rounds where one is due, or at its end. What
  // cannot be stored is left out. Requires: the picture is refreshed.
  void NotePoint(OpenFrame* frame, const FrameId& id, bool ended)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame->mutex);
  // next_point_samples after this point.
  static uint64_t NextPoint(const RoundRecord& last);
  // The same of a frame that is opened.
  uint64_t FirstPointOf(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void KeepPreview(const OpenFrame& frame, const FrameId& id, int32_t round)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(frame.mutex);
  // Returns the frame's rounds.
  const std::vector<RoundRecord>& AddRound(const FrameId& id, RoundRecord record)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Requires: after AddJob, before the job's parts.
  absl::Status LoadRounds(const StoredJob& job) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Null where the frame was not rendered in rounds.
  const RoundRecord* LastRoundOf(const FrameId& id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // How live jobs stand, the oldest first.
  std::vector<std::pair<uint64_t, JobCurve>> LiveCurves(size_t count_max) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // CPU seconds of workers, of each tile of a frame that is not delivered yet, with blanks between.
  std::string TileCpuSeconds(const FrameId& id) const;
  // Why the picture has its samples, and its errors on the way there.
  void AddRoundMetadata(const FrameId& id, FramePicture* picture) const;
  // Since the frame's first lease, in this life and earlier ones.
  absl::Duration WallOf(const FrameId& id, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The part of it in this life, of a frame or a job that was first leased then. Pauses and what
  // follows the job's end do not count.
  absl::Duration WallSince(uint64_t job_id, SteadyTime first_lease_time, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The same for the job.
  absl::Duration WallOfJob(const JobRecord& job, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // farm_control.cc
  absl::Status SetPaused(uint64_t job_id, bool paused);
  // Errors: kNotFound.
  absl::StatusOr<const JobRecord*> FindRecord(uint64_t job_id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Cancels pilots that nobody has asked for.
  void CancelForgottenPilots() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // farm_price.cc
  absl::StatusOr<FinishedFrame> FinishedFrameOf(const FrameId& id, const FrameSpec& spec,
                                                const Partition& partition,
                                                const DeliveredFrame& delivered) const;

  // farm_refine.cc
  static absl::Status RequireSucceeded(const JobRecord& job);
  absl::Status CheckRefinement(const JobRecord& job, const Refinement& refinement) const;
  // The job with all its frames, to be put into the scheduler again.
  StoredJob StoredJobOf(const JobRecord& record) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // By frame.
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> RoundsOf(uint64_t job_id) const;
  // Goes on with these frames of a job that has ended.
  absl::Status ReopenFrames(StoredJob job, const std::vector<JobStore::ReopenedFrame>& reopened)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(settle_mutex_);
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

  // farm_views.cc, farm_workers.cc
  JobView ViewOf(const JobRecord& job, bool with_frames, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<JobView> FindView(const std::string& job_id, bool with_frames) const;
  std::vector<JobView> ListBelow(uint64_t job_id) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  FrameView ViewOf(const JobRecord& job, const FrameRecord& frame, bool with_spec,
                   SteadyTime now) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  WorkerView ViewOf(const WorkerRecord& worker) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // A frame's samples; where a stop rule decides, as far as it is foreseen.
  uint64_t SamplesExpected(const FrameId& id, const FrameRecord& frame) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The work for the workers of a profile; some tenths of a second old.
  const FarmLoad& LoadOf(const std::string& numeric_profile, SteadyTime now) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // For the samples that are left in progress, which is the job's or one of its frames'.
  void EstimateRemaining(const JobRecord& job, SteadyTime now, ProgressView* progress) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const FarmOptions options_;
  const std::unique_ptr<JobStore> store_;
  const std::unique_ptr<BlobStore> blobs_;
  const std::unique_ptr<RoundPreviews> round_previews_;
  const std::string numeric_profile_;
  MergeBudget merge_budget_;
  mutable SceneNames scene_names_;

  mutable Mutex mutex_;
  Scheduler scheduler_ ABSL_GUARDED_BY(mutex_);
  std::map<uint64_t, JobAccount> accounts_ ABSL_GUARDED_BY(mutex_);
  std::map<FrameId, OpenEntry> open_frames_ ABSL_GUARDED_BY(mutex_);
  std::deque<FrameId> to_deliver_ ABSL_GUARDED_BY(mutex_);
  // Live pilots, and when somebody last asked for them.
  std::map<uint64_t, std::chrono::steady_clock::time_point> pilots_asked_ ABSL_GUARDED_BY(mutex_);
  std::vector<uint64_t> unsettled_jobs_ ABSL_GUARDED_BY(mutex_);  // Ended, but not written down.
  // Jobs with failures that are not yet written down.
  std::set<uint64_t> unsaved_failures_ ABSL_GUARDED_BY(mutex_);
  absl::Status disk_status_ ABSL_GUARDED_BY(mutex_);  // Of the last write.
  // Delivered, and to be made again.
  mutable std::set<FrameId> damaged_pictures_ ABSL_GUARDED_BY(mutex_);
  mutable uint64_t pictures_damaged_ ABSL_GUARDED_BY(mutex_) = 0;  // So far.
  // By numeric profile, as they were at loads_time_.
  mutable std::map<std::string, FarmLoad> loads_ ABSL_GUARDED_BY(mutex_);
  mutable SteadyTime loads_time_ ABSL_GUARDED_BY(mutex_);

  mutable VerifiedFiles pictures_;  // Delivered EXRs, by path.
  // The background thread's alone.
  std::map<std::string, BlobDigest> lost_blobs_;  // That live jobs need, by digest.
  SteadyTime next_lost_blobs_time_ = SteadyTime::InfinitePast();

  // One at a time writes down the end of jobs, so that who comes second waits until it is durable;
  // goes on with one; lets one wait; or removes parts of delivered frames.
  Mutex settle_mutex_ ABSL_ACQUIRED_BEFORE(mutex_);

  // One frame's memory is taken at a time.
  Mutex prepare_mutex_ ABSL_ACQUIRED_BEFORE(mutex_);

  Mutex reservation_mutex_;
  CondVar reservation_released_;
  std::set<TileName> reserved_ ABSL_GUARDED_BY(reservation_mutex_);

  mutable Mutex change_mutex_;
  mutable CondVar change_, end_;
  mutable uint64_t change_count_ ABSL_GUARDED_BY(change_mutex_) = 1;
  uint64_t end_count_ ABSL_GUARDED_BY(change_mutex_) = 0;

  Mutex background_mutex_;
  CondVar background_wake_;
  bool stopping_ ABSL_GUARDED_BY(background_mutex_) = false;
  bool wake_ ABSL_GUARDED_BY(background_mutex_) = false;
  std::thread background_;  // Last: it uses everything above.
};

}  // namespace sheaf::coordinator
