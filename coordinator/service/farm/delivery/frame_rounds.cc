// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/delivery/frame_rounds.h"

#include <algorithm>
#include <limits>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/check.h"
#include "common/base/log.h"
#include "common/scene/settings/sample_bound.h"
#include "coordinator/core/frame/cell_errors.h"
#include "coordinator/core/frame/error_curve.h"

namespace sheaf::coordinator {
namespace {

// The samples that a limit allows if sample_count samples spent `spent` of it.
double Allowed(uint64_t sample_count, absl::Duration spent, absl::Duration limit) {
  if (limit == absl::InfiniteDuration() || spent <= absl::ZeroDuration()) {
    return std::numeric_limits<double>::infinity();
  }
  return static_cast<double>(sample_count) * absl::FDivDuration(limit, spent);
}

std::vector<ErrorSums> ErrorsOf(const FrameMerge& merge) {
  return EstimateCellErrors(merge.image(), merge.grid());
}

}  // namespace

RoundRecord FrameRounds::RecordOf(const OpenFrame& frame, const FrameId& id,
                                  const std::vector<ErrorSums>& errors) const {
  RoundRecord record;
  const std::vector<uint64_t> samples = frame.merge.SamplesOfCells();
  SHEAF_CHECK(errors.size() == samples.size());
  for (size_t i = 0; i < samples.size(); ++i) record.cells.push_back({samples[i], errors[i]});
  const MutexLock lock(&tables_.mutex);
  const FrameRecord& scheduled = *tables_.scheduler.FindFrame(id);
  record.sample_count = scheduled.sample_count_done;
  // Decisions count camera samples; light passes follow them. A job that has ended has no tasks.
  if (scheduled.tasks != nullptr) record.sample_count -= scheduled.tasks->light_path_count_done();
  record.cost = scheduled.cost;
  record.wall_duration = tables_.WallOf(id, SteadyTime::Now());
  return record;
}

absl::StatusOr<bool> FrameRounds::Finish(OpenFrame* frame, const FrameId& id) {
  RoundRecord record = RecordOf(*frame, id, ErrorsOf(frame->merge));
  RoundAllowance allowance;
  std::vector<CellRound> before;
  {
    const MutexLock lock(&tables_.mutex);
    const FrameRecord* scheduled = tables_.scheduler.FindFrame(id);
    if (scheduled->phase != FrameRecord::Phase::kRendered) return false;  // The job has ended.
    if (const RoundRecord* last = tables_.LastRoundOf(id)) {
      if (last->samples_next.empty()) return true;  // Decided, not yet delivered.
      before = last->cells;
      record.round = last->round + 1;
    }
  }
  const StopRule& rule = frame->spec.stop;
  allowance.time = Allowed(record.sample_count, record.wall_duration, rule.time_max);
  allowance.cpu = Allowed(record.sample_count, record.cost.cpu_duration, rule.cpu_max);
  record.certified_upper = frame->merge.CertifiedError();
  RoundDecision decision =
      DecideAfter(record, rule, frame->spec.settings.samples, before, allowance);
  record.Take(std::move(decision));
  const bool ended = record.samples_next.empty();
  absl::Status stored = store_.AddRound(id, record);
  disk_.Note(stored);
  if (!stored.ok()) return stored;
  KeepPreview(*frame, id, record.round);
  LogInfo(absl::StrFormat(
      "job %d: frame %d, round %d: relMSE %.2e, at most %.2e%s", id.job_id, id.frame_number,
      record.round, record.relative_mse, record.relative_mse_upper,
      ended ? absl::StrCat("; ended by ", StopReasonName(record.stop_reason))
            : absl::StrFormat("; %.2e predicted for the next", record.predicted_relative_mse)));
  const MutexLock lock(&tables_.mutex);
  const std::vector<RoundRecord>& rounds = tables_.AddRound(id, std::move(record));
  if (ended) return true;
  if (tables_.scheduler.FindFrame(id)->phase != FrameRecord::Phase::kRendered) return false;
  const std::vector<uint64_t>& next = rounds.back().samples_next;
  for (uint32_t cell = 0; cell < next.size(); ++cell) frame->merge.Grow(cell, next[cell]);
  tables_.scheduler.Grow(id, next);
  return false;
}

void FrameRounds::KeepPreview(const OpenFrame& frame, const FrameId& id, int32_t round) {
  const absl::Status kept = previews_.Keep(id, round, frame.merge.image());
  if (!kept.ok()) LogWarning(absl::StrCat("storing a round's image: ", kept.message()));
}

void FrameRounds::NotePoint(OpenFrame* frame, const FrameId& id, bool ended) {
  const uint64_t fewest = frame->merge.FewestSamples();
  if (!ended && fewest < frame->next_point_samples) return;
  // The last point describes the whole image, at its delivery.
  if (!ended && fewest >= frame->spec.settings.samples) return;
  {
    const MutexLock lock(&tables_.mutex);
    const FrameRecord* record = tables_.scheduler.FindFrame(id);
    if (record->phase == FrameRecord::Phase::kDelivered) return;  // With a point at its end.
  }
  // A frame in progress has errors of tiles: a large image is not examined as a whole. Without a
  // rule each tile is a cell, except where the frame resumes an image.
  const bool is_known = !ended && frame->merge.grid().cells() == frame->merge.grid().tiles();
  RoundRecord record =
      RecordOf(*frame, id, is_known ? frame->error.OfTiles() : ErrorsOf(frame->merge));
  const ErrorSums sum = SumOf(record.cells);
  record.relative_mse = sum.RelativeMse();
  record.relative_mse_upper = record.relative_mse + kPointDeviations * sum.Deviation();
  record.sample_count_expected = record.sample_count;
  if (ended) record.certified_upper = frame->merge.CertifiedError();
  frame->next_point_samples = NextPoint(record);
  {
    const MutexLock lock(&tables_.mutex);
    // The last parts arrived meanwhile: the record counts them, but its image lacks them.
    const bool all_came = tables_.scheduler.FindFrame(id)->phase == FrameRecord::Phase::kRendered;
    if (!ended && all_came) return;
    if (const RoundRecord* last = tables_.LastRoundOf(id)) {
      if (last->sample_count >= record.sample_count) return;  // Noted before a restart.
      record.round = last->round + 1;
    }
  }
  const absl::Status stored = store_.AddRound(id, record);
  disk_.Note(stored);
  if (!stored.ok()) {
    LogWarning(absl::StrCat("storing a point of a frame's error curve: ", stored.message()));
    return;
  }
  if (!ended) KeepPreview(*frame, id, record.round);
  const MutexLock lock(&tables_.mutex);
  tables_.AddRound(id, std::move(record));
}

void FrameRounds::AddMetadata(const FrameId& id, FrameImage* image) const {
  const MutexLock lock(&tables_.mutex);
  const FrameSpec spec = tables_.scheduler.FindFrame(id)->Spec();
  const auto found = tables_.accounts.at(id.job_id).rounds.find(id.frame_number);
  if (found == tables_.accounts.at(id.job_id).rounds.end()) return;
  std::span<const RoundRecord> rounds(found->second);
  if (spec.stop.IsActive()) {
    image->metadata["stopReason"] = StopReasonName(rounds.back().stop_reason);
  } else {
    rounds = rounds.last(1);  // The other points depend on clocks.
  }
  if (spec.stop.target_error > 0) {
    image->metadata["targetError"] = absl::StrFormat("%.6g", spec.stop.target_error);
  }
  if (const double certified = rounds.back().certified_upper; certified > 0) {
    image->metadata["certifiedError"] = absl::StrFormat("%.6g", certified);
    image->metadata["certificate"] = SampleBoundOf(spec.settings).reason;
  }
  if (!(rounds.back().relative_mse > 0)) return;  // It is unknown.
  image->metadata[kErrorCurveKey] = FormatErrorCurve(rounds, spec.settings.window.PixelCount());
}

}  // namespace sheaf::coordinator
