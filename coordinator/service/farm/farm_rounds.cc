// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Farm that goes from one round of a frame to the next.
#include <algorithm>
#include <bit>
#include <limits>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/check.h"
#include "common/base/log.h"
#include "coordinator/core/cell_errors.h"
#include "coordinator/core/error_curve.h"
#include "coordinator/service/farm/farm.h"

namespace sheaf::coordinator {
namespace {

// How many samples a limit allows where `spent` of it went into sample_count.
double Allowed(uint64_t sample_count, absl::Duration spent, absl::Duration limit) {
  if (limit == absl::InfiniteDuration() || spent <= absl::ZeroDuration()) {
    return std::numeric_limits<double>::infinity();
  }
  return static_cast<double>(sample_count) * absl::FDivDuration(limit, spent);
}

std::vector<ErrorSums> ErrorsOf(const FrameMerge& merge) {
  return EstimateCellErrors(merge.picture(), merge.grid());
}

// The fewest samples of a cell; 0 where cells are not known.
uint64_t FewestSamples(const RoundRecord& record) {
  uint64_t fewest = std::numeric_limits<uint64_t>::max();
  for (const CellRound& cell : record.cells) fewest = std::min(fewest, cell.samples);
  return record.cells.empty() ? 0 : fewest;
}

}  // namespace

absl::Duration Farm::WallSince(uint64_t job_id, SteadyTime first_lease_time, SteadyTime now) const {
  const SteadyTime until =
      std::min({now, accounts_.at(job_id).ended, scheduler_.jobs().at(job_id).paused_time});
  return first_lease_time < until ? until - first_lease_time : absl::ZeroDuration();
}

absl::Duration Farm::WallOf(const FrameId& id, SteadyTime now) const {
  const JobAccount& account = accounts_.at(id.job_id);
  const auto before = account.wall_before.find(id.frame_number);
  return (before == account.wall_before.end() ? absl::ZeroDuration() : before->second) +
         WallSince(id.job_id, scheduler_.FindFrame(id)->first_lease_time, now);
}

absl::Duration Farm::WallOfJob(const JobRecord& job, SteadyTime now) const {
  const uint64_t id = job.spec.job_id;
  return accounts_.at(id).job_wall_before + WallSince(id, FirstLeaseTime(job), now);
}

RoundRecord Farm::RecordOf(const OpenFrame& frame, const FrameId& id,
                           const std::vector<ErrorSums>& errors) const {
  RoundRecord record;
  const std::vector<uint64_t> samples = frame.merge.SamplesOfCells();
  SHEAF_CHECK(errors.size() == samples.size());
  for (size_t i = 0; i < samples.size(); ++i) record.cells.push_back({samples[i], errors[i]});
  const MutexLock lock(&mutex_);
  const FrameRecord& scheduled = *scheduler_.FindFrame(id);
  record.sample_count = scheduled.sample_count_done;
  record.cost = scheduled.cost;
  record.wall_duration = WallOf(id, SteadyTime::Now());
  return record;
}

absl::StatusOr<bool> Farm::FinishRound(OpenFrame* frame, const FrameId& id) {
  RoundRecord record = RecordOf(*frame, id, ErrorsOf(frame->merge));
  RoundAllowance allowance;
  std::vector<CellRound> before;
  {
    const MutexLock lock(&mutex_);
    const FrameRecord* scheduled = scheduler_.FindFrame(id);
    if (scheduled->phase != FrameRecord::Phase::kRendered) return false;  // The job has ended.
    if (const RoundRecord* last = LastRoundOf(id)) {
      if (last->samples_next.empty()) return true;  // Decided, not yet delivered.
      before = last->cells;
      record.round = last->round + 1;
    }
  }
  const StopRule& rule = frame->spec.stop;
  allowance.time = Allowed(record.sample_count, record.wall_duration, rule.time_max);
  allowance.cpu = Allowed(record.sample_count, record.cost.cpu_duration, rule.cpu_max);
  RoundDecision decision = DecideRound(rule, frame->spec.settings.samples, record.round,
                                       record.cells, before, allowance);
  record.Take(std::move(decision));
  const bool ended = record.samples_next.empty();
  absl::Status stored = store_->AddRound(id, record);
  NoteDisk(stored);
  if (!stored.ok()) return stored;
  KeepPreview(*frame, id, record.round);
  LogInfo(absl::StrFormat(
      "job %d: frame %d, round %d: relMSE %.2e, at most %.2e%s", id.job_id, id.frame_number,
      record.round, record.relative_mse, record.relative_mse_upper,
      ended ? absl::StrCat("; ended by ", StopReasonName(record.stop_reason))
            : absl::StrFormat("; the next shall have %.2e", record.predicted_relative_mse)));
  const MutexLock lock(&mutex_);
  const std::vector<RoundRecord>& rounds = AddRound(id, std::move(record));
  if (ended) return true;
  if (scheduler_.FindFrame(id)->phase != FrameRecord::Phase::kRendered) return false;
  const std::vector<uint64_t>& next = rounds.back().samples_next;
  for (uint32_t cell = 0; cell < next.size(); ++cell) frame->merge.Grow(cell, next[cell]);
  scheduler_.Grow(id, next);
  return false;
}

void Farm::KeepPreview(const OpenFrame& frame, const FrameId& id, int32_t round) {
  const absl::Status kept = round_previews_->Keep(id, round, frame.merge.picture());
  if (!kept.ok()) LogWarning(absl::StrCat("storing a round's image: ", kept.message()));
}

const std::vector<RoundRecord>& Farm::AddRound(const FrameId& id, RoundRecord record) {
  std::vector<RoundRecord>& rounds = accounts_[id.job_id].rounds[id.frame_number];
  if (!rounds.empty()) rounds.back().cells.clear();  // Only the last round's are asked for again.
  rounds.push_back(std::move(record));
  return rounds;
}

uint64_t Farm::NextPoint(const RoundRecord& last) {
  return 2 * std::bit_floor(std::max(FewestSamples(last), kReplicateCount / uint64_t{2}));
}

uint64_t Farm::FirstPointOf(const FrameId& id) const {
  const RoundRecord* last = LastRoundOf(id);
  return last == nullptr ? kReplicateCount : NextPoint(*last);
}

void Farm::NotePoint(OpenFrame* frame, const FrameId& id, bool ended) {
  const uint64_t fewest = std::ranges::min(frame->merge.SamplesOfCells());
  if (!ended && fewest < frame->next_point_samples) return;
  // The last point is of the picture as a whole, on its delivery.
  if (!ended && fewest >= frame->spec.settings.samples) return;
  {
    const MutexLock lock(&mutex_);
    const FrameRecord* record = scheduler_.FindFrame(id);
    if (record->phase == FrameRecord::Phase::kDelivered) return;  // With a point at its end.
  }
  // Of a frame at work those that are known already: a large picture is not looked at as a whole.
  // Without a rule each tile is a cell, but where the frame goes on from a picture.
  const bool is_known = !ended && frame->merge.grid().cells() == frame->merge.grid().tiles();
  RoundRecord record =
      RecordOf(*frame, id, is_known ? frame->error.OfTiles() : ErrorsOf(frame->merge));
  const ErrorSums sum = SumOf(record.cells);
  record.relative_mse = sum.RelativeMse();
  record.relative_mse_upper = record.relative_mse + kPointDeviations * sum.Deviation();
  record.sample_count_expected = record.sample_count;
  frame->next_point_samples = NextPoint(record);
  {
    const MutexLock lock(&mutex_);
    if (const RoundRecord* last = LastRoundOf(id)) {
      if (last->sample_count >= record.sample_count) return;  // Noted before a restart.
      record.round = last->round + 1;
    }
  }
  const absl::Status stored = store_->AddRound(id, record);
  NoteDisk(stored);
  if (!stored.ok()) {
    LogWarning(absl::StrCat("storing a point of a frame's error curve: ", stored.message()));
    return;
  }
  if (!ended) KeepPreview(*frame, id, record.round);
  const MutexLock lock(&mutex_);
  AddRound(id, std::move(record));
}

const RoundRecord* Farm::LastRoundOf(const FrameId& id) const {
  const JobAccount& account = accounts_.at(id.job_id);
  const auto rounds = account.rounds.find(id.frame_number);
  return rounds == account.rounds.end() ? nullptr : &rounds->second.back();
}

void Farm::AddRoundMetadata(const FrameId& id, FramePicture* picture) const {
  const MutexLock lock(&mutex_);
  const FrameSpec spec = scheduler_.FindFrame(id)->Spec();
  const auto found = accounts_.at(id.job_id).rounds.find(id.frame_number);
  if (found == accounts_.at(id.job_id).rounds.end()) return;
  std::span<const RoundRecord> rounds(found->second);
  if (spec.stop.IsActive()) {
    picture->metadata["stopReason"] = StopReasonName(rounds.back().stop_reason);
  } else {
    rounds = rounds.last(1);  // Where else it was looked at depends on clocks.
  }
  if (spec.stop.target_error > 0) {
    picture->metadata["targetError"] = absl::StrFormat("%.6g", spec.stop.target_error);
  }
  if (!(rounds.back().relative_mse > 0)) return;  // It cannot be told.
  picture->metadata[kErrorCurveKey] = FormatErrorCurve(rounds, spec.settings.window.PixelCount());
}

absl::Status Farm::LoadRounds(const StoredJob& job) {
  const bool live = job.phase == JobPhase::kLive;
  absl::StatusOr<std::vector<StoredRound>> rounds =
      store_->LoadRounds(job.spec.job_id, /*with_cells=*/live);
  if (!rounds.ok()) return rounds.status();
  JobAccount& account = accounts_[job.spec.job_id];
  for (StoredRound& round : *rounds) {
    std::vector<RoundRecord>& of_frame = account.rounds[round.frame_number];
    if (!of_frame.empty()) of_frame.back().cells.clear();
    account.wall_before[round.frame_number] = round.record.wall_duration;
    account.job_wall_before = std::max(account.job_wall_before, round.record.wall_duration);
    if (live && !round.record.samples_next.empty()) {
      const FrameId id{job.spec.job_id, round.frame_number};
      const FrameRecord* frame = scheduler_.FindFrame(id);
      if (frame != nullptr && frame->phase != FrameRecord::Phase::kDelivered) {
        scheduler_.RestoreRound(id, round.record.samples_next);
      }
    }
    of_frame.push_back(std::move(round.record));
  }
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
