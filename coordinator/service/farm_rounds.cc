// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Farm that goes from one round of a frame to the next.
#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "coordinator/service/farm.h"

namespace sheaf::coordinator {
namespace {

// How many samples a limit allows where `spent` of it went into sample_count.
double Allowed(uint64_t sample_count, absl::Duration spent, absl::Duration limit) {
  if (limit == absl::InfiniteDuration() || spent <= absl::ZeroDuration()) {
    return std::numeric_limits<double>::infinity();
  }
  return static_cast<double>(sample_count) * absl::FDivDuration(limit, spent);
}

}  // namespace

absl::Duration Farm::WallOf(const FrameId& id, absl::Time now) const {
  const FrameRecord& record = *scheduler_.FindFrame(id);
  const JobAccount& account = accounts_.at(id.job_id);
  absl::Duration wall;
  if (const auto before = account.wall_before.find(id.frame_number);
      before != account.wall_before.end()) {
    wall = before->second;
  }
  const absl::Time until =
      std::min({now, account.end_time, scheduler_.jobs().at(id.job_id).paused_time});
  if (record.first_lease_time < until) wall += until - record.first_lease_time;
  return wall;
}

absl::StatusOr<bool> Farm::FinishRound(OpenFrame* frame, const FrameId& id) {
  std::vector<PixelRect> tiles;
  for (uint32_t tile = 0; tile < frame->merge.tile_count(); ++tile) {
    tiles.push_back(frame->merge.rect(tile));
  }
  const std::vector<ErrorSums> errors = EstimateTileErrors(frame->merge.picture(), tiles);
  RoundRecord record;
  RoundAllowance allowance;
  std::vector<TileRound> before;
  {
    const std::lock_guard lock(mutex_);
    const FrameRecord* scheduled = scheduler_.FindFrame(id);
    if (scheduled->phase != FrameRecord::Phase::kRendered) return false;  // The job has ended.
    if (const RoundRecord* last = LastRoundOf(id)) {
      if (last->samples_next.empty()) return true;  // Decided, not yet delivered.
      before = last->tiles;
      record.round = last->round + 1;
    }
    const std::vector<uint64_t> samples = scheduled->tasks->SamplesOfTiles();
    for (size_t i = 0; i < tiles.size(); ++i) record.tiles.push_back({samples[i], errors[i]});
    record.sample_count = scheduled->sample_count_done;
    record.cost = scheduled->cost;
    record.wall_duration = WallOf(id, absl::Now());
  }
  const StopRule& rule = frame->spec.stop;
  allowance.time = Allowed(record.sample_count, record.wall_duration, rule.time_max);
  allowance.cpu = Allowed(record.sample_count, record.cost.cpu_duration, rule.cpu_max);
  RoundDecision decision = DecideRound(rule, frame->spec.settings.samples, record.round,
                                       record.tiles, before, allowance);
  record.Take(std::move(decision));
  const bool ended = record.samples_next.empty();
  absl::Status stored = store_->AddRound(id, record);
  NoteDisk(stored);
  if (!stored.ok()) return stored;
  const absl::Status kept = round_previews_->Keep(id, record.round, frame->merge.picture());
  if (!kept.ok()) LogWarning(absl::StrCat("keeping a round's picture: ", kept.message()));
  LogInfo(absl::StrFormat(
      "job %d: frame %d, round %d: relMSE %.2e, at most %.2e%s", id.job_id, id.frame_number,
      record.round, record.relative_mse, record.relative_mse_upper,
      ended ? absl::StrCat("; ended by ", StopReasonName(record.stop_reason))
            : absl::StrFormat("; the next shall have %.2e", record.predicted_relative_mse)));
  const std::lock_guard lock(mutex_);
  std::vector<RoundRecord>& rounds = accounts_[id.job_id].rounds[id.frame_number];
  if (!rounds.empty()) rounds.back().tiles.clear();  // Only the last round's are asked for again.
  rounds.push_back(std::move(record));
  if (ended) return true;
  if (scheduler_.FindFrame(id)->phase != FrameRecord::Phase::kRendered) return false;
  const std::vector<uint64_t>& next = rounds.back().samples_next;
  for (uint32_t tile = 0; tile < next.size(); ++tile) frame->merge.Grow(tile, next[tile]);
  scheduler_.Grow(id, next);
  return false;
}

const RoundRecord* Farm::LastRoundOf(const FrameId& id) const {
  const JobAccount& account = accounts_.at(id.job_id);
  const auto rounds = account.rounds.find(id.frame_number);
  return rounds == account.rounds.end() ? nullptr : &rounds->second.back();
}

void Farm::AddRoundMetadata(const FrameId& id, FramePicture* picture) const {
  const std::lock_guard lock(mutex_);
  const FrameSpec& spec = scheduler_.FindFrame(id)->spec;
  if (spec.stop.target_error > 0) {
    picture->metadata["targetError"] = absl::StrFormat("%.6g", spec.stop.target_error);
  }
  picture->metadata["stopReason"] = StopReasonName(LastRoundOf(id)->stop_reason);
  std::string curve;
  const auto pixel_count = static_cast<double>(spec.settings.window.PixelCount());
  for (const RoundRecord& round : accounts_.at(id.job_id).rounds.at(id.frame_number)) {
    absl::StrAppendFormat(&curve, "%s%.6g %.6g %.6g", curve.empty() ? "" : ", ",
                          static_cast<double>(round.sample_count) / pixel_count, round.relative_mse,
                          round.relative_mse_upper);
  }
  // Of each round: mean samples of a pixel, relMSE, and the upper bound of its confidence.
  picture->metadata["errorCurve"] = curve;
}

absl::Status Farm::LoadRounds(const StoredJob& job) {
  const bool live = job.phase == JobPhase::kLive;
  absl::StatusOr<std::vector<StoredRound>> rounds =
      store_->LoadRounds(job.spec.job_id, /*with_tiles=*/live);
  if (!rounds.ok()) return rounds.status();
  JobAccount& account = accounts_[job.spec.job_id];
  for (StoredRound& round : *rounds) {
    std::vector<RoundRecord>& of_frame = account.rounds[round.frame_number];
    if (!of_frame.empty()) of_frame.back().tiles.clear();
    account.wall_before[round.frame_number] = round.record.wall_duration;
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
