// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobStore: the coordinator's durable state. Once a call has returned OK, its change survives kill
// -9 and, in a store of Durability::kPowerLoss, power loss. So an acknowledgement sent afterwards
// is reliable.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/film/error/rare_layers.h"
#include "common/objects/object_store.h"
#include "coordinator/core/frame/sample_rounds.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/job_event.h"
#include "coordinator/core/job/share_setting.h"
#include "coordinator/core/policy/usage.h"

namespace sheaf::coordinator {

// Names a part: a result of one frame of one job; the bytes of a training are a guiding field.
struct PartKey {
  FrameId frame;
  PixelRect tile;
  SampleBlock block;
  TileCells cells = {};
  TaskKind kind = TaskKind::kCamera;
  friend bool operator==(const PartKey&, const PartKey&) = default;
};

struct PartRow {
  PartKey key;
  BlobDigest digest;      // The digest of the part's bytes.
  std::string worker_id;  // The worker that rendered it.
  ResultCost cost;
  std::string identity = {};  // The worker's identity (WorkerReport::identity).
  // The SHA-256 (hex) of the guiding field that it was made with; empty if there is none.
  std::string field = {};
  uint64_t sample_count = 0;  // Pixel samples or light paths, for the accounts; not stored here.
};

// The properties of a frame whose EXR is written.
struct DeliveredFrame {
  std::string image_digest;
  double relative_mse = 0;  // The worse eye's in a stereo frame.
  // Errors of a stereo frame (eye_errors.h); 0 for other frames.
  double left_eye_relative_mse = 0, right_eye_relative_mse = 0, eye_difference_relative_mse = 0;
  double flip = 0;                // Estimated mean (flip_estimate.h); 0 if it is unknown.
  double one_sequence_gain = 0;   // See OneSequenceGain; for frames without a stop rule.
  double relative_mse_upper = 0;  // See RoundDecision; 0 if the frame was not rendered in rounds.
  StopReason stop_reason = StopReason::kSamples;
  uint64_t sample_count = 0;  // Pixel samples.
  uint32_t tile_count = 0;
  uint32_t unreliable_tile_count = 0;         // Tiles with unreliable error estimates.
  std::vector<LayerCount> unreliable_layers;  // The causes (rare_layers.h).
  absl::Duration wall_duration;
  ResultCost cost;  // Sums over its parts.
};

struct StoredRound {
  int32_t frame_number = 0;
  RoundRecord record;
};

struct StoredFrame {
  int32_t frame_number = 0;
  DeliveredFrame delivered;
};

struct StoredJob {
  JobSpec spec;
  std::string request_id;
  JobPhase phase = JobPhase::kLive;
  bool paused = false;  // Only a live job can be paused.
  std::string failure;
  FailureLog failures;
  absl::Time create_time;
  absl::Time end_time = absl::InfiniteFuture();
  absl::Duration wall_duration;            // At its last end; 0 if it has not ended, or if unknown.
  std::vector<StoredFrame> delivered;      // Ascending by number.
  std::string warning;                     // About its images, for users; mostly empty.
  std::map<int32_t, int32_t> corrections;  // By frame, where not 0.
  std::vector<TaskTrouble> troubles;       // Tasks that failed or are set aside.
  bool pinned = false;                     // Nothing of it is removed to make room.
  // When its parts were removed to make room; InfiniteFuture: not since it last began.
  absl::Time parts_removed_time = absl::InfiniteFuture();
  std::string damage;  // Its files that changed on disk; empty: none.
};

// New values of a job's state; what is absent stays.
struct JobChange {
  std::optional<bool> paused = {};  // A job that ends is no longer paused.
  std::optional<int32_t> priority = {};
  std::optional<bool> pinned = {};
  // When the parts of an ended job are removed; stored before RemoveFrameParts.
  std::optional<absl::Time> parts_removed_time = {};
};

// The size of a test write: more than a row, less than most parts.
inline constexpr size_t kProbeBytes = size_t{1} << 20;

// Thread safety: all members may be called concurrently.
// Errors of every writing call: kResourceExhausted (disk full), kUnavailable (other disk errors).
// After an error the state is unchanged.
class JobStore {
 public:
  virtual ~JobStore() = default;

  // All jobs, ascending by id.
  virtual absl::StatusOr<std::vector<StoredJob>> LoadJobs() = 0;
  // Returns the parts of a job whose bytes are on disk. Rows without bytes, and rows that changed
  // on disk, are lost: their work is to be done again, and the caller removes them. Bytes without a
  // row are removed: no call has acknowledged them, or the row is among lost commits. They are not
  // taken as parts, because their maker is unknown.
  struct LoadedParts {
    std::vector<PartRow> rows;
    std::vector<PartRow> lost;
    int64_t files_without_row = 0;  // Removed; without half-written ones.
  };
  virtual absl::StatusOr<LoadedParts> LoadParts(uint64_t job_id) = 0;

  // Stores a job under a new id, or finds the existing job with this request_id.
  struct CreatedJob {
    uint64_t job_id = 0;
    bool is_new = false;
  };
  virtual absl::StatusOr<CreatedJob> CreateJob(const JobSpec& spec, const std::string& request_id,
                                               absl::Time create_time) = 0;
  virtual absl::StatusOr<std::optional<uint64_t>> FindRequest(const std::string& request_id) = 0;
  virtual absl::Status EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                              absl::Time end_time, absl::Duration wall) = 0;
  // Replaces the job's stored failures.
  virtual absl::Status WriteFailures(uint64_t job_id, const FailureLog& failures) = 0;
  // Replaces the record of each of these tasks; removes that of a task without failures that is not
  // set aside.
  virtual absl::Status WriteTroubles(const std::vector<TaskTrouble>& troubles) = 0;
  // Without rows that changed on disk: their tasks are rendered again.
  virtual absl::StatusOr<std::vector<TaskTrouble>> LoadTroubles(uint64_t job_id) = 0;
  // Adds events to their jobs, in one transaction; skips those of removed jobs. Keeps the last
  // kJobEventsMax of a job.
  virtual absl::Status AppendEvents(const std::vector<JobEvent>& events) = 0;
  // In the order in which they were added.
  virtual absl::StatusOr<std::vector<JobEvent>> LoadEvents(uint64_t job_id) = 0;
  // Quarantined identities. Write replaces an identity's record; Remove is a no-op if there is
  // none. Loaded in the order of their times.
  virtual absl::Status WriteQuarantine(const QuarantineRecord& record) = 0;
  virtual absl::Status RemoveQuarantine(const std::string& identity) = 0;
  virtual absl::StatusOr<std::vector<QuarantineRecord>> LoadQuarantines() = 0;
  // Operators' settings for users, shows and pools. Write replaces a subject's setting; Remove is a
  // no-op if there is none.
  virtual absl::Status WriteShare(const ShareSubject& subject, const ShareSetting& setting) = 0;
  virtual absl::Status RemoveShare(const ShareSubject& subject) = 0;
  virtual absl::StatusOr<std::map<ShareSubject, ShareSetting>> LoadShares() = 0;
  // Replaces the job's warning.
  virtual absl::Status SetWarning(uint64_t job_id, const std::string& warning) = 0;
  // All parts of an identity, ascending by job.
  virtual absl::StatusOr<std::vector<PartRow>> FindPartsOf(const std::string& identity) = 0;
  virtual absl::Status ChangeJob(uint64_t job_id, const JobChange& change) = 0;
  // Removes the job's dependencies.
  virtual absl::Status ReleaseJob(uint64_t job_id) = 0;
  // Drained workers. Write replaces a worker's record; Remove is a no-op if there is none.
  virtual absl::Status WriteDrains(const std::vector<DrainRecord>& records) = 0;
  virtual absl::Status RemoveDrains(const std::vector<std::string>& worker_ids) = 0;
  virtual absl::StatusOr<std::vector<DrainRecord>> LoadDrains() = 0;

  // Retention (coordinator/core/policy/retention.h).
  // Bytes of parts, by job; only jobs with parts.
  virtual absl::StatusOr<std::map<uint64_t, uint64_t>> PartsBytesByJob() = 0;
  // Removes an ended job: its rows, then its parts and images. Files left by a stop or by the disk
  // are removed when the store is next opened. The id is not reused.
  virtual absl::Status RemoveJob(uint64_t job_id) = 0;

  // Writes the bytes, then the row, and with it the job's account of the day. Errors:
  // kAlreadyExists if the key has a row.
  virtual absl::Status WritePart(const PartRow& row, const std::string& bytes) = 0;
  // The same for several parts, which become durable together. Returns the status of each, in
  // order. Requires: no two have one key.
  struct NewPart {
    const PartRow* row = nullptr;
    const std::string* bytes = nullptr;
  };
  virtual std::vector<absl::Status> WriteParts(std::span<const NewPart> parts) = 0;
  // The same as WritePart for a part whose bytes another process has stored with a ticket; writes
  // them if they are not there.
  virtual absl::Status AddStoredPart(const PartRow& row, const std::string& bytes) = 0;
  // The permission to store the bytes of a part that has no row; none if only this process can
  // store them.
  virtual std::optional<PutTicket> TicketFor(const PartRow& row) = 0;
  virtual absl::StatusOr<std::optional<PartRow>> FindPart(const PartKey& key) = 0;
  // The rows of one tile, ascending by first sample.
  virtual absl::StatusOr<std::vector<PartRow>> FindTileParts(const FrameId& frame,
                                                             const PixelRect& tile,
                                                             TaskKind kind) = 0;
  // The rows of a job; without those that changed on disk.
  virtual absl::StatusOr<std::vector<PartRow>> ListParts(uint64_t job_id) = 0;
  // CPU time of the stored parts of one of the camera's tiles.
  struct TileCost {
    PixelRect tile;
    absl::Duration cpu_duration;
  };
  virtual absl::StatusOr<std::vector<TileCost>> TileCosts(const FrameId& frame) = 0;
  // The bytes of a row, or of a part that was stored with a ticket and has none yet. Errors:
  // kNotFound; kDataLoss if the bytes do not match the row's digest.
  virtual absl::StatusOr<std::string> ReadPart(const PartRow& row) = 0;
  virtual absl::Status RemovePart(const PartRow& row) = 0;
  // Removes rows, then bytes.
  virtual absl::Status RemoveFrameParts(const FrameId& frame) = 0;

  // The path of a frame's EXR, which may not exist yet; its directory exists when this returns.
  virtual absl::StatusOr<std::string> OutputPath(const FrameId& frame) = 0;
  virtual absl::Status DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered) = 0;

  // Accounts (coordinator/core/policy/usage.h). The subject of a usage: a job, or an owner's
  // uploads, which have the job id 0.
  struct UsageOf {
    uint64_t job_id = 0;
    std::string owner = {};  // Only for uploads; the store knows jobs' owners.
    friend auto operator<=>(const UsageOf&, const UsageOf&) = default;
  };
  // Adds usage that no call above accounts for. It is in memory until the next WriteUsage.
  virtual void NoteUsage(const UsageOf& of, const Usage& usage) = 0;
  // Writes the additions of NoteUsage, and removes rows older than kUsageDaysKept. A no-op if there
  // are none. After an error the additions stay in memory.
  virtual absl::Status WriteUsage() = 0;
  // The rows of the query's days and owner, including the additions of NoteUsage.
  virtual absl::StatusOr<std::vector<UsageRow>> LoadUsage(const UsageQuery& query) = 0;

  // Stores the decision at the end of a round, before any work on the next round starts. Does
  // nothing if the frame already has this round.
  virtual absl::Status AddRound(const FrameId& frame, const RoundRecord& round) = 0;
  // The rounds of all frames of a job, ascending by frame and round. If !with_cells, `cells` and
  // samples_next are empty.
  virtual absl::StatusOr<std::vector<StoredRound>> LoadRounds(uint64_t job_id, bool with_cells) = 0;
  // The rounds of one frame, with cells.
  virtual absl::StatusOr<std::vector<RoundRecord>> LoadFrameRounds(const FrameId& frame) = 0;

  // Continues a job that has ended: marks these frames as not delivered, and replaces their rules,
  // samples, rounds and resumed images. Approves frames that waited for approval and get the
  // samples of it. Idempotent: a repeated call does not count a correction twice.
  struct ReopenedFrame {
    FrameSpec spec;
    std::vector<RoundRecord> rounds;
    bool is_correction = false;  // It was delivered with false results.
  };
  virtual absl::Status ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) = 0;

  // The first frame that still has parts, among frames of unpinned jobs that were delivered or
  // whose job failed; none if there is none.
  virtual absl::StatusOr<std::optional<FrameId>> OldestDeliveredWithParts() = 0;

  // Writes and removes kProbeBytes, to test whether the disk accepts writes (again).
  virtual absl::Status Probe() = 0;

  // Size of all parts on disk, in bytes.
  virtual uint64_t PartsBytes() const = 0;
  // The first lease id of this run of the coordinator; no earlier run has used it or a larger one.
  virtual uint64_t FirstLeaseId() const = 0;
  // An upper bound of the acknowledged changes lost before this run. If not 0, the state is an
  // earlier one.
  virtual int64_t LostCommits() const = 0;
};

}  // namespace sheaf::coordinator
