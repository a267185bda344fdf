// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/intake/result_intake.h"

#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/digest.h"
#include "common/base/log.h"
#include "common/film/exr/exr_codec.h"
#include "coordinator/core/frame/part_check.h"

namespace sheaf::coordinator {
namespace {

uint64_t NonfiniteCount(const FilmTile& part) {
  const float* plane = part.channel(FilmChannel::kNonFiniteCount);
  double sum = 0;
  for (size_t i = 0; i < part.plane_size(); ++i) sum += static_cast<double>(plane[i]);
  return static_cast<uint64_t>(sum);
}

// Decodes a part and compares its header with its key. Empty text: they match.
std::string WhyNotPartOf(const ResultReport& report, const std::string& numeric_profile,
                         const FrameSettings& settings, const DecodedPart& part) {
  if (part.header.frame_digest != report.frame_digest) return "the part belongs to another frame";
  if (part.header.numeric_profile != numeric_profile) {
    return absl::StrCat("the part was rendered with numeric profile \"",
                        part.header.numeric_profile, "\", but the job needs \"", numeric_profile,
                        "\"");
  }
  if (!(part.tile.rect() == report.tile)) return "the part belongs to another tile";
  if (!(part.tile.block() == report.block)) return "the part has other samples than its task";
  if (part.header.cells != report.cells) return "the part has other cells than its task";
  if (!(part.tile.outputs() == OutputsOf(report.kind, settings))) {
    return "the part has other outputs than the job";
  }
  if (part.header.kind != report.kind) return "the part has another kind of paths than its task";
  if (part.header.lattice != settings.lattice) {
    return "the part has other pixels than the job";
  }
  return WhyNotOfSettings(part.tile, settings, report.kind);
}

}  // namespace

std::string ResultIntake::KeyText(const ResultReport& r) {
  return absl::StrCat("frame digest ", r.frame_digest.substr(0, 12), ", ",
                      WorkText(r.kind, r.tile, r.block),
                      r.cells.All() ? "" : absl::StrFormat(", cells %#x", r.cells.mask));
}

absl::Status ResultIntake::CheckArrived(const Arrived& result) {
  const ResultReport& report = *result.report;
  const std::string& bytes = *result.bytes;
  if (absl::Status allowed = CheckSender(report); !allowed.ok()) return allowed;
  if (bytes.size() != report.digest.size_bytes || Sha256Hex(bytes) != report.digest.sha256_hex) {
    return Reject(report, "the bytes do not match their digest");
  }
  return absl::OkStatus();
}

absl::StatusOr<ResultIntake::Judged> ResultIntake::Judge(const Arrived& result) {
  const ResultReport& report = *result.report;
  const std::string& bytes = *result.bytes;
  // Checked again: the sender's results may have been removed while this one waited for its tile.
  if (absl::Status allowed = CheckSender(report); !allowed.ok()) return allowed;
  Scheduler::FoundTask found;
  std::string numeric_profile;
  FrameSettings settings;
  {
    const MutexLock lock(&tables_.mutex);
    found = FindTask(report);
    if (found.kind == Scheduler::FoundTask::Kind::kWanted) {
      numeric_profile = tables_.scheduler.jobs().at(found.frame.job_id).spec.numeric_profile;
      settings = tables_.scheduler.FindFrame(found.frame)->settings();
    }
  }
  using Kind = Scheduler::FoundTask::Kind;
  if (found.kind == Kind::kMalformed) return Reject(report, "the frame has no such task");
  if (found.kind == Kind::kOtherField) {
    return Reject(report, "it was made with another guiding field than the frame's",
                  &Counters::results_other_field);
  }
  if (found.kind == Kind::kUnknown || found.kind == Kind::kPartial) {
    NoteLost(report, found.frame.job_id);
    const MutexLock lock(&tables_.mutex);
    ++tables_.scheduler.counters().results_superseded;
    return ResultOutcome::kSuperseded;
  }
  if (found.kind == Kind::kCovered) return JudgeCovered(report, found);
  if (report.kind == TaskKind::kTraining) {
    if (absl::Status fits = CheckField(report, bytes, found); !fits.ok()) return fits;
    return WantedOf(result, found, std::nullopt);
  }
  absl::StatusOr<DecodedPart> part = DecodePart(bytes, report.tile.PixelCount());
  if (!part.ok()) return Reject(report, std::string(part.status().message()));
  const std::string why_not = WhyNotPartOf(report, numeric_profile, settings, *part);
  if (!why_not.empty()) return Reject(report, why_not);
  return WantedOf(result, found, std::move(part->tile));
}

ResultIntake::Wanted ResultIntake::WantedOf(const Arrived& result,
                                            const Scheduler::FoundTask& found,
                                            std::optional<FilmTile> part) const {
  const ResultReport& report = *result.report;
  Wanted wanted{result, found, std::move(part), RowOf(report, found.frame)};
  wanted.row.cost = {report.ray_count, wanted.part ? NonfiniteCount(*wanted.part) : 0,
                     report.cpu_duration, report.digest.size_bytes};
  wanted.row.sample_count = SamplesOf(found);
  return wanted;
}

bool ResultIntake::HasField(const FrameId& id, const BlobDigest& digest) const {
  const FrameRecord* frame = tables_.scheduler.FindFrame(id);
  return frame != nullptr && frame->tasks != nullptr &&
         frame->tasks->grid().training_tile().has_value() && frame->tasks->Trained() &&
         frame->tasks->field() == digest;
}

absl::StatusOr<std::string> ResultIntake::ReadField(const FrameId& id, const BlobDigest& digest) {
  const absl::Status none = absl::NotFoundError(absl::StrCat(
      "frame ", id.frame_number, " of job ", id.job_id, " does not have such a guiding field"));
  PartKey key{id, {}, {0, 1}, {}, TaskKind::kTraining};
  {
    const MutexLock lock(&tables_.mutex);
    if (!HasField(id, digest)) return none;
    key.tile = tables_.scheduler.FindFrame(id)->settings().window;
  }
  const absl::StatusOr<std::optional<PartRow>> row = store_.FindPart(key);
  if (!row.ok()) return row.status();
  if (!row->has_value() || (*row)->digest != digest) return none;
  absl::StatusOr<std::string> bytes = store_.ReadPart(**row);
  if (!absl::IsNotFound(bytes.status()) && !absl::IsDataLoss(bytes.status())) return bytes;
  LoseField(**row, bytes.status());
  return none;
}

absl::Status ResultIntake::CheckSender(const ResultReport& report) {
  const LeasedWork work{report.lease_id, report.Sender(), report.frame_digest, report.tile,
                        report.block,    report.cells,    report.kind};
  const bool was_leased = tokens_.IsValid(work, report.token);
  std::string why = "the work was not leased to the sender, or the coordinator has another secret";
  {
    const MutexLock lock(&tables_.mutex);
    const auto& quarantined = tables_.scheduler.workers().quarantined();
    const auto quarantine = quarantined.find(report.Sender());
    if (was_leased && quarantine == quarantined.end()) return absl::OkStatus();
    if (was_leased) why = absl::StrCat("the sender is in quarantine: ", quarantine->second);
    ++tables_.scheduler.counters().results_refused;
  }
  const std::string text =
      absl::StrCat("result of worker ", report.worker_id,
                   report.identity.empty() ? "" : absl::StrCat(" of ", report.identity), " for ",
                   KeyText(report), " is refused: ", why);
  LogWarning(text);
  return absl::PermissionDeniedError(text);
}

absl::Status ResultIntake::CheckField(const ResultReport& report, const std::string& bytes,
                                      const Scheduler::FoundTask& found) {
  if (bytes.empty() || bytes.size() > kGuidingFieldBytesMax) {
    return Reject(report, absl::StrCat("a guiding field has 1 to ", kGuidingFieldBytesMax,
                                       " bytes, not ", bytes.size()));
  }
  {
    const MutexLock lock(&tables_.mutex);
    const FrameRecord* frame = tables_.scheduler.FindFrame(found.frame);
    const bool has_parts = frame != nullptr && frame->tasks != nullptr &&
                           frame->tasks->sample_count_done() > 0 &&
                           !frame->tasks->field().sha256_hex.empty();
    if (has_parts && frame->tasks->field().sha256_hex != report.digest.sha256_hex) {
      tables_.stale_fields.insert(found.frame);
      const std::string text = absl::StrCat(
          "job ", found.frame.job_id, ": frame ", found.frame.frame_number,
          " has another guiding field than the lost one; the parts that were made with that are ",
          "removed first");
      LogWarning(text);
      return absl::UnavailableError(text);
    }
  }
  return absl::OkStatus();
}

absl::Status ResultIntake::Reject(const ResultReport& report, const std::string& why,
                                  uint64_t Counters::*counter) {
  const std::string text =
      absl::StrCat("result of worker ", report.worker_id, " for ", KeyText(report), ": ", why);
  LogWarning(text);
  uint64_t job_id = 0;
  {
    const MutexLock lock(&tables_.mutex);
    ++(tables_.scheduler.counters().*counter);
    const Lease* lease = tables_.scheduler.leases().Find(report.lease_id);
    if (lease != nullptr) job_id = lease->frame.job_id;
    tables_.scheduler.Fail({report.lease_id, FailureKind::kInvalid, "invalid result: " + why},
                           report.worker_id, SteadyTime::Now());
    tables_.NoteEndedJobs();
  }
  NoteLost(report, job_id);
  ends_.SettleEnded();
  signals_.Changed();
  return absl::InvalidArgumentError(text);
}

// The task is already done: equal bits confirm it, different bits mean that one of the two is
// false.
absl::StatusOr<ResultOutcome> ResultIntake::JudgeCovered(const ResultReport& report,
                                                         const Scheduler::FoundTask& found) {
  const absl::StatusOr<std::optional<PartRow>> row =
      store_.FindPart({found.frame, report.tile, report.block, report.cells, report.kind});
  if (!row.ok()) return row.status();
  // A worker that missed the answer sends its result again; it was rendered once.
  const bool is_resent =
      row->has_value() && (*row)->worker_id == report.worker_id && (*row)->digest == report.digest;
  if (!is_resent) NoteRepeated(report, found);
  CheckVerdict verdict;
  bool is_equal = false;
  {
    const MutexLock lock(&tables_.mutex);
    Counters& counters = tables_.scheduler.counters();
    const FrameRecord* frame = tables_.scheduler.FindFrame(found.frame);
    const bool is_open = frame != nullptr && frame->tasks != nullptr;
    if (!row->has_value() || !is_open) {
      ++counters.results_superseded;
      return ResultOutcome::kSuperseded;
    }
    const PartRow& merged = **row;
    is_equal = merged.digest == report.digest;
    ++(is_equal ? counters.results_duplicate_equal : counters.results_duplicate_mismatch);
    const ResultCost cost{report.ray_count, 0, report.cpu_duration, report.digest.size_bytes};
    verdict = tables_.scheduler.Compare(found.frame, found.task, report.lease_id, report.worker_id,
                                        {merged.identity, merged.digest.sha256_hex},
                                        {report.Sender(), report.digest.sha256_hex}, cost,
                                        SteadyTime::Now());
    if (!is_equal) {
      LogWarning(absl::StrCat("the result of worker ", report.worker_id, " for ", KeyText(report),
                              " differs from that of worker ", merged.worker_id));
    }
    Punish(report, merged, verdict);
    tables_.NoteEndedJobs();
  }
  if (verdict.kind == CheckVerdict::Kind::kUndecided) {
    ends_
        .SetWarning(found.frame.job_id,
                    absl::StrCat("frame ", found.frame.frame_number,
                                 " is disputed: no two workers agree on a part of it"))
        .IgnoreError();  // The disk's state is recorded, and the error is logged.
  }
  if (!verdict.liars.empty()) ends_.SettleEnded();
  queue_.Wake();
  signals_.Changed();
  return is_equal ? ResultOutcome::kDuplicateEqual : ResultOutcome::kDuplicateMismatch;
}

void ResultIntake::Punish(const ResultReport& report, const PartRow& merged,
                          const CheckVerdict& verdict) {
  for (const std::string& liar : verdict.liars) {
    const std::string reason =
        absl::StrCat("its result for ", KeyText(report), " differs from that of others, who agree");
    LogError(absl::StrCat(liar, " is quarantined: ", reason,
                          liar == merged.identity ? "; its result was merged" : ""));
    tables_.scheduler.Quarantine(liar, reason, /*made_false_results=*/true);
  }
}

Usage ResultIntake::UsageOfResult(const ResultReport& report, uint64_t sample_count) {
  return {.result_count = 1,
          .sample_count = sample_count,
          .ray_count = report.ray_count,
          .cpu_duration = report.cpu_duration};
}

void ResultIntake::NoteLost(const ResultReport& report, uint64_t job_id) {
  if (job_id == 0) return;
  Usage usage = UsageOfResult(report, 0);
  usage.lost_count = 1;
  usage.lost_cpu_duration = report.cpu_duration;
  store_.NoteUsage({job_id}, usage);
}

void ResultIntake::NoteRepeated(const ResultReport& report, const Scheduler::FoundTask& found) {
  Usage usage = UsageOfResult(report, SamplesOf(found));
  usage.repeated_count = 1;
  usage.repeated_cpu_duration = report.cpu_duration;
  store_.NoteUsage({found.frame.job_id}, usage);
}

uint64_t ResultIntake::SamplesOf(const Scheduler::FoundTask& found) const {
  const MutexLock lock(&tables_.mutex);
  const FrameRecord* frame = tables_.scheduler.FindFrame(found.frame);
  const bool is_open = frame != nullptr && frame->tasks != nullptr;
  return is_open ? frame->tasks->PixelSamples(found.task) : 0;
}

}  // namespace sheaf::coordinator
