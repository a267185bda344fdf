// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Groups of ResultIntake: the wanted results of a call become durable together, then the scheduler
// hears of each, and each is merged.
#include <algorithm>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/load_phases.h"
#include "common/base/log.h"
#include "coordinator/service/farm/intake/result_intake.h"

namespace sheaf::coordinator {

// Takes all tiles at once, so that no call waits for another one while it holds some.
class ResultIntake::TileReservation {
 public:
  TileReservation(ResultIntake* intake, std::set<TileName> names)
      : intake_(*intake), names_(std::move(names)) {
    const MutexLock lock(&intake_.mutex_);
    const auto is_free = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(intake_.mutex_) {
      return intake_.pause_count_ == 0 && intake_.NoneReserved(names_);
    };
    intake_.released_.Wait(&intake_.mutex_, is_free);
    intake_.reserved_.insert(names_.begin(), names_.end());
  }
  ~TileReservation() {
    {
      const MutexLock lock(&intake_.mutex_);
      for (const TileName& name : names_) intake_.reserved_.erase(name);
    }
    intake_.released_.NotifyAll();
  }
  TileReservation(const TileReservation&) = delete;
  TileReservation& operator=(const TileReservation&) = delete;

 private:
  ResultIntake& intake_;
  const std::set<TileName> names_;
};

bool ResultIntake::NoneReserved(const std::set<TileName>& names) const {
  return std::none_of(names.begin(), names.end(),
                      [this](const TileName& name) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
                        return reserved_.contains(name);
                      });
}

ResultIntake::Pause::Pause(ResultIntake* intake) : intake_(*intake) {
  const MutexLock lock(&intake_.mutex_);
  ++intake_.pause_count_;
  const auto none_under_way = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(intake_.mutex_) {
    return intake_.reserved_.empty();
  };
  intake_.released_.Wait(&intake_.mutex_, none_under_way);
}

ResultIntake::Pause::~Pause() {
  {
    const MutexLock lock(&intake_.mutex_);
    --intake_.pause_count_;
  }
  intake_.released_.NotifyAll();
}

absl::StatusOr<ResultOutcome> ResultIntake::Add(const ResultReport& report,
                                                const std::string& bytes) {
  const Arrived result{&report, &bytes};
  return AddGroup({&result, 1}).front();
}

std::vector<absl::StatusOr<ResultOutcome>> ResultIntake::AddGroup(
    std::span<const Arrived> results) {
  const PhaseTimer timer(LoadPhase::kResults);
  std::vector<absl::StatusOr<ResultOutcome>> outcomes;
  while (outcomes.size() < results.size()) {
    const std::span<const Arrived> rest = results.subspan(outcomes.size());
    std::set<TileName> names;
    size_t count = 0;
    while (count < rest.size() && names.insert(TileOf(*rest[count].report)).second) ++count;
    std::vector<absl::StatusOr<ResultOutcome>> some = AddTiles(rest.first(count));
    std::move(some.begin(), some.end(), std::back_inserter(outcomes));
  }
  return outcomes;
}

std::vector<absl::StatusOr<ResultOutcome>> ResultIntake::AddTiles(
    std::span<const Arrived> results) {
  std::vector<absl::StatusOr<ResultOutcome>> outcomes(results.size());
  std::vector<size_t> arrived;  // Their places in `results`, here and below.
  std::set<TileName> names;
  for (size_t i = 0; i < results.size(); ++i) {
    if (absl::Status status = CheckArrived(results[i]); !status.ok()) {
      outcomes[i] = std::move(status);
      continue;
    }
    arrived.push_back(i);
    names.insert(TileOf(*results[i].report));
  }
  if (arrived.empty()) return outcomes;
  const TileReservation reservation(this, std::move(names));
  std::vector<Wanted> wanted;
  std::vector<size_t> places;
  for (const size_t i : arrived) {
    absl::StatusOr<Judged> judged = Judge(results[i]);
    if (!judged.ok()) {
      outcomes[i] = judged.status();
    } else if (ResultOutcome* const outcome = std::get_if<ResultOutcome>(&*judged)) {
      outcomes[i] = *outcome;
    } else {
      wanted.push_back(std::get<Wanted>(*std::move(judged)));
      places.push_back(i);
    }
  }
  const std::vector<absl::Status> written = Write(wanted);
  for (size_t i = 0; i < wanted.size(); ++i) {
    absl::StatusOr<ResultOutcome>& outcome = outcomes[places[i]];
    if (!written[i].ok()) {
      outcome = written[i];
      continue;
    }
    outcome = Take(&wanted[i]);
  }
  return outcomes;
}

std::vector<absl::Status> ResultIntake::Write(const std::vector<Wanted>& results) {
  std::vector<absl::Status> statuses(results.size());
  std::vector<JobStore::NewPart> parts;
  std::vector<size_t> places;
  uint64_t bytes = 0;
  for (size_t i = 0; i < results.size(); ++i) {
    const Wanted& result = results[i];
    absl::Status& status = statuses[i] = removals_.MakeRoom(result.row.key);
    if (status.ok() && result.arrived.report->is_stored) {
      status = store_.AddStoredPart(result.row, *result.arrived.bytes);
    } else if (status.ok()) {
      bytes += result.arrived.bytes->size();
      status = disk_.CheckRoom(bytes);
      if (!status.ok()) continue;
      parts.push_back({&result.row, result.arrived.bytes});
      places.push_back(i);
    }
  }
  std::vector<absl::Status> written = store_.WriteParts(parts);
  for (size_t i = 0; i < places.size(); ++i) statuses[places[i]] = std::move(written[i]);
  for (const absl::Status& status : statuses) disk_.Note(status);
  return statuses;
}

ResultOutcome ResultIntake::Take(Wanted* result) {
  const ResultReport& report = *result->arrived.report;
  const Scheduler::FoundTask& found = result->found;
  const ResultCost& cost = result->row.cost;
  tables_.PrepareOpen(found.frame);
  std::shared_ptr<OpenFrame> open;
  bool tile_complete = false;
  bool rendered = false;
  const double draw =
      choice_.DrawOf(report.frame_digest, report.tile, report.block, report.cells, report.kind);
  {
    const MutexLock lock(&tables_.mutex);
    const Scheduler::FoundTask again = FindTask(report);
    const bool wanted =
        again.kind == Scheduler::FoundTask::Kind::kWanted && again.frame == found.frame;
    if (wanted) {
      open = tables_.Open(found.frame);
      if (!result->part) tables_.scheduler.SetField(found.frame, report.digest);
      rendered = tables_.scheduler.Accept(found.frame, found.task, report.lease_id,
                                          report.worker_id, cost, SteadyTime::Now());
      tables_.scheduler.ConsiderCheck(found.frame, found.task,
                                      {report.Sender(), report.digest.sha256_hex}, draw);
      tile_complete =
          tables_.scheduler.FindFrame(found.frame)->tasks->TileComplete(found.task.tile);
    } else {
      ++tables_.scheduler.counters().results_superseded;
    }
  }
  if (open == nullptr) {
    // While it was written, its job ended, or a larger block that contains it was leased.
    removals_.Remove({result->row});
    store_.NoteUsage({found.frame.job_id},
                     {.lost_count = 1, .lost_cpu_duration = report.cpu_duration});
    return ResultOutcome::kSuperseded;
  }
  if (cost.nonfinite_count > 0) {
    LogWarning(absl::StrCat(cost.nonfinite_count,
                            report.kind == TaskKind::kLight ? " splats" : " samples",
                            " were not finite in ", KeyText(report)));
  }
  if (result->part) {
    Merge(open.get(), found.frame, found.task.tile, {*std::move(result->part), found.task.cells},
          tile_complete);
  }
  if (rendered) {
    queue_.Add(found.frame);
    queue_.Wake();
  }
  signals_.Changed();
  return ResultOutcome::kAccepted;
}

void ResultIntake::Merge(OpenFrame* frame, const FrameId& id, uint32_t tile, CellPart part,
                         bool tile_complete) {
  const MutexLock lock(&frame->mutex);
  frame->merge.Insert(tile, std::move(part));
  if (!tile_complete || !frame->merge.OnDisk(tile)) return;
  const absl::Status status = tiles_.Rebuild(frame, id, tile);
  if (!status.ok()) LogError(absl::StrCat("merging a tile from disk: ", status.message()));
}

// No other field is taken meanwhile, and the frame is not corrected.
void ResultIntake::LoseField(const PartRow& field, const absl::Status& why) {
  const PartKey& key = field.key;
  std::string frame_digest;
  {
    const MutexLock lock(&tables_.mutex);
    if (!HasField(key.frame, field.digest)) return;
    frame_digest = tables_.scheduler.FindFrame(key.frame)->packed.frame_digest().Hex();
  }
  const TileReservation reservation(this, {{frame_digest, key.kind, key.tile.y0, key.tile.x0}});
  {
    const MutexLock lock(&tables_.mutex);
    if (!HasField(key.frame, field.digest)) return;
  }
  tiles_.RevokePart(field, why);
  signals_.Changed();
}

}  // namespace sheaf::coordinator
