// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/jobs/job_correction.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/log.h"
#include "coordinator/service/farm/jobs/job_reopening.h"
#include "coordinator/service/farm/jobs/job_restore.h"

namespace sheaf::coordinator {
namespace {

// Lists frames by number for a message.
constexpr size_t kFramesToldMax = 20;

std::string FramesText(const std::set<int32_t>& numbers) {
  std::vector<int32_t> told(numbers.begin(), numbers.end());
  const bool all = told.size() <= kFramesToldMax;
  if (!all) told.resize(kFramesToldMax);
  return absl::StrCat(numbers.size() == 1 ? "frame " : "frames ", absl::StrJoin(told, ", "),
                      all ? "" : " and more");
}

}  // namespace

absl::Status JobCorrection::RemoveResultsOf(const std::string& identity) {
  const MutexLock settling(&context_.settle_mutex);
  // A start continues a correction by this row. Without it a stop would leave some of the false
  // parts, without the one that was found false, and their maker would be believed.
  if (absl::Status saved = SaveNewQuarantines(context_); !saved.ok()) return saved;
  const PartKeys left = context_.removals.Left();
  absl::StatusOr<std::vector<PartRow>> rows = context_.store.FindPartsOf(identity);
  if (!rows.ok()) return rows.status();
  std::map<uint64_t, std::vector<PartRow>> by_job;
  for (PartRow& row : *rows) {
    if (left.contains(row.key)) continue;  // An earlier call corrected its frame.
    by_job[row.key.frame.job_id].push_back(std::move(row));
  }
  for (auto& [job_id, of_job] : by_job) {
    absl::StatusOr<std::vector<PartRow>> parts = WithPartsOfFields(job_id, std::move(of_job));
    if (!parts.ok()) return parts.status();
    absl::Status corrected = CorrectJob(
        job_id, absl::StrCat("results of ", identity, " were found false after delivery"), *parts);
    if (!corrected.ok()) return corrected;
    LogWarning(absl::StrCat("job ", job_id, ": ", parts->size(), " results of ", identity,
                            ", or made with its guiding fields, are no longer trusted and are "
                            "rendered again"));
  }
  rows = context_.store.FindPartsOf(identity);
  if (!rows.ok()) return rows.status();
  if (rows->empty()) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("the disk does not remove ", rows->size(), " of them yet; trying again"));
}

absl::StatusOr<std::vector<PartRow>> JobCorrection::WithPartsOfFields(
    uint64_t job_id, std::vector<PartRow> false_parts) {
  const auto is_field = [](const PartRow& row) { return row.key.kind == TaskKind::kTraining; };
  std::map<FrameId, std::string> fields;
  for (const PartRow& row : false_parts) {
    if (is_field(row)) fields[row.key.frame] = row.digest.sha256_hex;
  }
  if (fields.empty()) return false_parts;
  const absl::StatusOr<JobStore::LoadedParts> all = LoadPartsOf(context_, job_id);
  if (!all.ok()) return all.status();
  const std::string identity = false_parts.front().identity;
  for (const PartRow& row : all->rows) {
    const auto field = fields.find(row.key.frame);
    const bool has_field = field != fields.end() && row.field == field->second;
    if (has_field && row.identity != identity) false_parts.push_back(row);
  }
  std::stable_partition(false_parts.begin(), false_parts.end(),
                        [&](const PartRow& row) { return !is_field(row); });
  return false_parts;
}

absl::Status JobCorrection::RemovePartsOfLostField(const FrameId& id) {
  const MutexLock settling(&context_.settle_mutex);
  {
    const MutexLock lock(&context_.tables.mutex);
    const FrameRecord* frame = context_.tables.scheduler.FindFrame(id);
    if (frame == nullptr || frame->tasks == nullptr) return absl::OkStatus();  // It has ended.
  }
  absl::StatusOr<JobStore::LoadedParts> parts = LoadPartsOf(context_, id.job_id);
  if (!parts.ok()) return parts.status();
  std::erase_if(parts->rows, [&id](const PartRow& row) { return !(row.key.frame == id); });
  return CorrectJob(id.job_id,
                    "its guiding field was lost and trained to a different "
                    "result",
                    parts->rows);
}

absl::Status JobCorrection::CorrectJob(uint64_t job_id, const std::string& why,
                                       const std::vector<PartRow>& false_parts) {
  std::set<int32_t> numbers, delivered;
  for (const PartRow& part : false_parts) numbers.insert(part.key.frame.frame_number);
  StoredJob job;
  bool goes_on = false;
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> found = context_.tables.FindJob(job_id);
    if (found.ok()) {
      const JobRecord& record = **found;
      goes_on = record.phase == JobPhase::kLive ||
                (record.phase == JobPhase::kSucceeded && !record.spec.pilot);
      job = StoredJobOf(context_, record);
      for (const FrameRecord& frame : record.frames) {
        const bool is_delivered = frame.phase == FrameRecord::Phase::kDelivered;
        if (is_delivered && numbers.contains(frame.number())) delivered.insert(frame.number());
      }
    }
  }
  if (!delivered.empty()) {
    absl::Status warned =
        ends_.SetWarning(job_id, absl::StrCat(FramesText(delivered),
                                              goes_on ? " corrected: " : " may be false: ", why,
                                              goes_on ? "" : ", and the job does not continue"));
    if (!warned.ok()) return warned;
  }
  if (!goes_on) {
    RemoveFalse(context_, false_parts);
    return absl::OkStatus();
  }
  std::vector<JobStore::ReopenedFrame> reopened;
  for (const FrameSpec& frame : job.spec.frames) {
    if (!numbers.contains(frame.frame_number)) continue;
    reopened.push_back({frame, /*rounds=*/{}, delivered.contains(frame.frame_number)});
  }
  return ReopenFrames(context_, std::move(job), reopened, false_parts);
}

}  // namespace sheaf::coordinator
