// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ResultIntake: takes results. It checks a result, writes it to the store (file, then row), tells
// the scheduler, merges it, and only then returns its outcome, which is the acknowledgement.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/base/mutex.h"
#include "common/film/film_tile.h"
#include "coordinator/core/frame/check_choice.h"
#include "coordinator/core/frame/lease_token.h"
#include "coordinator/service/farm/delivery/tile_builder.h"
#include "coordinator/service/farm/jobs/job_ends.h"
#include "coordinator/service/farm/state/delivery_queue.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/service/farm/state/part_removals.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// One result as it came in.
struct ResultReport {
  std::string frame_digest;
  PixelRect tile;
  SampleBlock block;
  TileCells cells;
  TaskKind kind = TaskKind::kCamera;
  uint64_t lease_id = 0;
  std::string token;  // LeaseGrant::token.
  std::string worker_id;
  std::string identity;  // As in WorkerReport.
  BlobDigest digest;     // The digest of the part's bytes, or of the guiding field's.
  // The SHA-256 of the guiding field that the part was made with; empty if there is none.
  std::string field;
  uint64_t ray_count = 0;
  absl::Duration cpu_duration;
  bool is_stored = false;  // The sender has stored the bytes, by a ticket.

  const std::string& Sender() const { return identity.empty() ? worker_id : identity; }
};
enum class ResultOutcome { kAccepted, kDuplicateEqual, kDuplicateMismatch, kSuperseded };

// Thread safety: all members may be called concurrently.
class ResultIntake {
 public:
  // The objects that it works on; all must outlive it.
  struct Parts {
    const LeaseTokens& tokens;
    const CheckChoice& choice;
    FarmTables& tables;
    JobStore& store;
    PartRemovals& removals;
    TileBuilder& tiles;
    JobEnds& ends;
    DeliveryQueue& queue;
    DiskState& disk;
    FarmSignals& signals;
  };
  explicit ResultIntake(const Parts& parts)
      : tokens_(parts.tokens),
        choice_(parts.choice),
        tables_(parts.tables),
        store_(parts.store),
        removals_(parts.removals),
        tiles_(parts.tiles),
        ends_(parts.ends),
        queue_(parts.queue),
        disk_(parts.disk),
        signals_(parts.signals) {}

  // OK means: the outcome is durable.
  // Errors: kPermissionDenied (the work was not leased to the sender, or the sender is in
  // quarantine), kInvalidArgument (not a part of its key), kResourceExhausted (disk full),
  // kUnavailable.
  absl::StatusOr<ResultOutcome> Add(const ResultReport& report, const std::string& bytes);
  // The same for several results, one outcome for each, in order. Those that are wanted become
  // durable together, except that results of one tile follow each other.
  struct Arrived {
    const ResultReport* report = nullptr;
    const std::string* bytes = nullptr;
  };
  std::vector<absl::StatusOr<ResultOutcome>> AddGroup(std::span<const Arrived> results);

  // These are in intake/stored_results.cc. The permission to store the result's bytes; none if it
  // is not wanted, or if only the coordinator can store it. Errors: kPermissionDenied, as Add.
  absl::StatusOr<std::optional<PutTicket>> TicketFor(const ResultReport& report);
  // Add for a result that the sender has stored. Errors: also kFailedPrecondition (the bytes are
  // missing or wrong; the sender must send them).
  absl::StatusOr<ResultOutcome> AddStored(const ResultReport& report);

  // The verified bytes of a frame's guiding field, which is stored as the part of its training. A
  // lost or damaged field is trained again. Errors: kNotFound (the frame has no such field, or it
  // is lost; the frame is leased again once it has one); those of the store.
  absl::StatusOr<std::string> ReadField(const FrameId& id, const BlobDigest& digest);

  // While it exists no result is taken: its constructor waits for calls in progress, and new calls
  // wait for its end. One at a time. Do not hold a lock that taking a result needs.
  class Pause;

 private:
  using TileName = std::tuple<std::string, TaskKind, int32_t, int32_t>;  // Frame digest, y0, x0.
  // Holds reservations of tiles: results of one tile are taken one at a time.
  class TileReservation;
  // A result that has passed all checks; it is to be stored.
  struct Wanted {
    Arrived arrived;
    Scheduler::FoundTask found;
    std::optional<FilmTile> part;  // None for a training.
    PartRow row;
  };
  using Judged = std::variant<ResultOutcome, Wanted>;

  static TileName TileOf(const ResultReport& report) {
    return {report.frame_digest, report.kind, report.tile.y0, report.tile.x0};
  }
  bool NoneReserved(const std::set<TileName>& names) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // For people.
  static std::string KeyText(const ResultReport& r);
  Scheduler::FoundTask FindTask(const ResultReport& report) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // The row of a result for a frame, without its counts.
  static PartRow RowOf(const ResultReport& report, const FrameId& frame);
  // Checks that the sender may deliver the result. Errors: kPermissionDenied.
  absl::Status CheckSender(const ResultReport& report);
  // The account of a result that does not become a part.
  static Usage UsageOfResult(const ResultReport& report, uint64_t sample_count);
  // Accounts for a lost result; job_id: 0 if unknown.
  void NoteLost(const ResultReport& report, uint64_t job_id);
  // Accounts for a result of a task that was already done.
  void NoteRepeated(const ResultReport& report, const Scheduler::FoundTask& found);
  // Pixel samples or light paths of a task; 0 if its frame has ended.
  uint64_t SamplesOf(const Scheduler::FoundTask& found) const ABSL_LOCKS_EXCLUDED(tables_.mutex);
  absl::StatusOr<ResultOutcome> JudgeCovered(const ResultReport& report,
                                             const Scheduler::FoundTask& found);
  // counter: the counter to increment.
  absl::Status Reject(const ResultReport& report, const std::string& why,
                      uint64_t Counters::*counter = &Counters::results_invalid);
  // The checks before a result waits for its tile. Errors: those of Add.
  absl::Status CheckArrived(const Arrived& result);
  // Requires: its tile is reserved, here and below.
  absl::StatusOr<Judged> Judge(const Arrived& result);
  Wanted WantedOf(const Arrived& result, const Scheduler::FoundTask& found,
                  std::optional<FilmTile> part) const;
  // Checks the bytes of a guiding field. Errors: kInvalidArgument; kUnavailable while parts made
  // with another field remain.
  absl::Status CheckField(const ResultReport& report, const std::string& bytes,
                          const Scheduler::FoundTask& found);
  // AddGroup for results of different tiles.
  std::vector<absl::StatusOr<ResultOutcome>> AddTiles(std::span<const Arrived> results);
  // Stores results, file and row. Returns one status for each.
  std::vector<absl::Status> Write(const std::vector<Wanted>& results);
  // Tells the scheduler of a stored result, and merges it.
  ResultOutcome Take(Wanted* result);
  // Returns a field to be trained again. A no-op if the frame no longer has it.
  void LoseField(const PartRow& field, const absl::Status& why);
  // Whether the frame is trained, with this field.
  bool HasField(const FrameId& id, const BlobDigest& digest) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  // Acts on the verdict of a comparison.
  void Punish(const ResultReport& report, const PartRow& merged, const CheckVerdict& verdict)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(tables_.mutex);
  void Merge(OpenFrame* frame, const FrameId& id, uint32_t tile, CellPart part, bool tile_complete);

  const LeaseTokens& tokens_;
  const CheckChoice& choice_;
  FarmTables& tables_;
  JobStore& store_;
  PartRemovals& removals_;
  TileBuilder& tiles_;
  JobEnds& ends_;
  DeliveryQueue& queue_;
  DiskState& disk_;
  FarmSignals& signals_;
  Mutex mutex_;
  CondVar released_;
  std::set<TileName> reserved_ ABSL_GUARDED_BY(mutex_);
  int pause_count_ ABSL_GUARDED_BY(mutex_) = 0;
};

class ResultIntake::Pause {
 public:
  explicit Pause(ResultIntake* intake);
  ~Pause();
  Pause(const Pause&) = delete;
  Pause& operator=(const Pause&) = delete;

 private:
  ResultIntake& intake_;
};

}  // namespace sheaf::coordinator
