// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SqlJobStore: a JobStore in a database and a directory. The database is a file of the directory,
// unless another one is given:
//
//     DIR/lock                             locked while a coordinator uses the directory; shared
//                                          by those that have their database elsewhere
//     DIR/farm.db                          SQLite, WAL, synchronous=FULL: jobs, frames, parts
//     DIR/parts/JOB/FRAME/X0_Y0_X1_Y1-FIRST-COUNT-DIGEST.exr
//                                          parts, until their frame is delivered; of a training:
//                                          its guiding field, with the extension .field; or
//                                          objects of these names in another ObjectStore
//     DIR/outputs/JOB/FRAME.exr            delivered images
//     DIR/outputs/JOB/FRAME.thumbnail.exr  small copies of them, for overviews
//
// A part's object is written before its row, so a crash in between leaves only an unacknowledged
// object. Parts of concurrent calls are a group: one Sync makes their objects durable, then one
// commit their rows (docs/adr/0075).
//
// With a database elsewhere (PostgreSQL, docs/adr/0081) several coordinators may have the directory
// open. Then there is no DIR/farm.db, and the database says who may write.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "common/base/mutex.h"
#include "common/objects/object_store.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/database/durability.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

class SqlJobStore : public JobStore {
 public:
  // Creates the directory if it does not exist, and in it the database. parts: where parts lie,
  // which must outlive the store; null: files in DIR/parts. Errors: also those of parts;
  // kFailedPrecondition (another coordinator uses it, or its schema is of a later version);
  // kPermissionDenied, kResourceExhausted, kUnavailable, kDataLoss, with the path.
  static absl::StatusOr<std::unique_ptr<SqlJobStore>> Open(
      const std::string& directory, Durability durability = Durability::kPowerLoss,
      ObjectStore* parts = nullptr);
  // The same with a database that several coordinators share, as they do the directory and the
  // store of parts. durability: of files.
  static absl::StatusOr<std::unique_ptr<SqlJobStore>> Open(
      const std::string& directory, std::unique_ptr<Database> database,
      Durability durability = Durability::kPowerLoss, ObjectStore* parts = nullptr);
  ~SqlJobStore() override;

  absl::StatusOr<std::vector<StoredJob>> LoadJobs() override;
  absl::StatusOr<LoadedParts> LoadParts(uint64_t job_id) override;
  absl::StatusOr<CreatedJob> CreateJob(const JobSpec& spec, const std::string& request_id,
                                       absl::Time create_time) override;
  absl::StatusOr<std::optional<uint64_t>> FindRequest(const std::string& request_id) override;
  absl::Status EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                      absl::Time end_time, absl::Duration wall) override;
  absl::Status WriteFailures(uint64_t job_id, const FailureLog& failures) override;
  absl::Status WriteTroubles(const std::vector<TaskTrouble>& troubles) override;
  absl::StatusOr<std::vector<TaskTrouble>> LoadTroubles(uint64_t job_id) override;
  absl::Status AppendEvents(const std::vector<JobEvent>& events) override;
  absl::StatusOr<std::vector<JobEvent>> LoadEvents(uint64_t job_id) override;
  absl::Status WriteQuarantine(const QuarantineRecord& record) override;
  absl::Status RemoveQuarantine(const std::string& identity) override;
  absl::StatusOr<std::vector<QuarantineRecord>> LoadQuarantines() override;
  absl::Status WriteShare(const ShareSubject& subject, const ShareSetting& setting) override;
  absl::Status RemoveShare(const ShareSubject& subject) override;
  absl::StatusOr<std::map<ShareSubject, ShareSetting>> LoadShares() override;
  absl::Status SetWarning(uint64_t job_id, const std::string& warning) override;
  absl::StatusOr<std::vector<PartRow>> FindPartsOf(const std::string& identity) override;
  absl::Status ChangeJob(uint64_t job_id, const JobChange& change) override;
  absl::Status ReleaseJob(uint64_t job_id) override;
  absl::Status WriteDrains(const std::vector<DrainRecord>& records) override;
  absl::Status RemoveDrains(const std::vector<std::string>& worker_ids) override;
  absl::StatusOr<std::vector<DrainRecord>> LoadDrains() override;
  absl::StatusOr<std::map<uint64_t, uint64_t>> PartsBytesByJob() override;
  absl::Status RemoveJob(uint64_t job_id) override;
  absl::Status WritePart(const PartRow& row, const std::string& bytes) override;
  std::vector<absl::Status> WriteParts(std::span<const NewPart> parts) override;
  absl::Status AddStoredPart(const PartRow& row, const std::string& bytes) override;
  std::optional<PutTicket> TicketFor(const PartRow& row) override;
  absl::StatusOr<std::optional<PartRow>> FindPart(const PartKey& key) override;
  absl::StatusOr<std::vector<PartRow>> FindTileParts(const FrameId& frame, const PixelRect& tile,
                                                     TaskKind kind) override;
  absl::StatusOr<std::vector<PartRow>> ListParts(uint64_t job_id) override;
  absl::StatusOr<std::vector<TileCost>> TileCosts(const FrameId& frame) override;
  absl::StatusOr<std::string> ReadPart(const PartRow& row) override;
  absl::Status RemovePart(const PartRow& row) override;
  absl::Status RemoveFrameParts(const FrameId& frame) override;
  absl::StatusOr<std::string> OutputPath(const FrameId& frame) override;
  absl::Status DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered) override;
  void NoteUsage(const UsageOf& of, const Usage& usage) override;
  absl::Status WriteUsage() override;
  absl::StatusOr<std::vector<UsageRow>> LoadUsage(const UsageQuery& query) override;
  absl::Status AddRound(const FrameId& frame, const RoundRecord& round) override;
  absl::StatusOr<std::vector<StoredRound>> LoadRounds(uint64_t job_id, bool with_cells) override;
  absl::StatusOr<std::vector<RoundRecord>> LoadFrameRounds(const FrameId& frame) override;
  absl::Status ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) override;
  absl::StatusOr<std::optional<FrameId>> OldestDeliveredWithParts() override;
  absl::Status Probe() override;
  uint64_t PartsBytes() const override { return parts_bytes_; }
  uint64_t FirstLeaseId() const override { return first_lease_id_; }
  int64_t LostCommits() const override { return lost_commits_; }

  // The path of a part's bytes where parts are files; for tests and diagnosis.
  std::string PartPath(const PartRow& row) const;

 private:
  // A call whose parts wait for their group's commit: their files are written, but not durable.
  struct PendingCall {
    std::vector<const PartRow*> rows;
    std::vector<absl::Status> statuses;  // One for each row.
    bool leads = false;                  // It commits the next group.
    bool finished = false;
    CondVar changed;
  };
  // Reserves the names of parts: equal parts are written one after the other, so that none replaces
  // the durable object of another.
  class NameReservation;

  SqlJobStore(std::string directory, Durability durability, int lock_fd,
              std::unique_ptr<Database> database, bool shared, ObjectStore* parts)
      : directory_(std::move(directory)),
        durability_(durability),
        lock_fd_(lock_fd),
        shared_(shared),
        parts_(parts),
        database_(std::move(database)) {}
  absl::Status Initialize();
  // Counts this run, and reads the state of earlier runs.
  absl::Status BeginLife() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_);
  // Finds ids of jobs whose rows are lost, so that no new job overwrites their images.
  absl::Status FindUsedJobIds() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_);
  void NoteUsedJobId(uint64_t job_id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_);
  // Finishes removals that a stop interrupted: files of removed jobs, and empty folders of parts of
  // ended jobs.
  absl::Status FinishRemovals() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_);
  absl::Status RemoveFramesWithoutParts(uint64_t job_id)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_);
  // Called without the lock while others work: a server may be slow.
  absl::Status RemoveFilesOf(uint64_t job_id);
  // Adds to a kDataLoss error how to recover from it.
  absl::Status Explained(const absl::Status& status) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_);
  // The object of a part that has no row. Errors: kAlreadyExists (it has one).
  absl::Status WriteObject(const PartRow& row, const std::string& bytes);
  // Called after a commit failed with this status.
  void RemoveUnlessAcknowledged(const PartRow& row, const absl::Status& failed);
  // Returns when the group of the call is durable, or is not and will not be.
  void CommitParts(PendingCall* mine);
  // The calls that wait, as many as a group may have.
  std::vector<PendingCall*> TakeGroup() ABSL_EXCLUSIVE_LOCKS_REQUIRED(pending_mutex_);
  void CommitGroup(const std::vector<PendingCall*>& calls);
  absl::Status CommitRows(const std::vector<PendingCall*>& calls);
  static std::string FolderOf(const FrameId& frame);  // Folder of its parts, ending in "/".
  static std::string NameOf(const PartRow& row);      // Name of its object.

  const std::string directory_;
  const Durability durability_;
  const int lock_fd_;
  const bool shared_;                       // Other coordinators may have the directory open.
  std::unique_ptr<ObjectStore> own_parts_;  // Files, if no other store is given.
  ObjectStore* parts_;
  Mutex database_mutex_;
  std::unique_ptr<Database> database_ ABSL_GUARDED_BY(database_mutex_);
  Mutex pending_mutex_;
  std::deque<PendingCall*> pending_ ABSL_GUARDED_BY(pending_mutex_);
  bool committing_ ABSL_GUARDED_BY(pending_mutex_) = false;      // A call leads, or is about to.
  std::set<std::string> names_ ABSL_GUARDED_BY(pending_mutex_);  // Parts being written.
  CondVar name_released_;
  Mutex usage_mutex_ ABSL_ACQUIRED_AFTER(database_mutex_);
  std::map<UsageOf, Usage> waiting_usage_ ABSL_GUARDED_BY(usage_mutex_);
  std::atomic<uint64_t> parts_bytes_{0};
  uint64_t first_lease_id_ = 1;
  int64_t lost_commits_ = 0;
  // A lower bound from folders and removals.
  uint64_t next_job_id_ ABSL_GUARDED_BY(database_mutex_) = 1;
  uint64_t next_pilot_id_ ABSL_GUARDED_BY(database_mutex_) = kFirstPilotId;
};

}  // namespace sheaf::coordinator
